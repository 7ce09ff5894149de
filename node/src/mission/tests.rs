use std::sync::Arc;

use energy::Model;

use super::*;

fn explorer() -> Arc<Model> {
    Arc::new(energy::load_model("explorer-robot", &|_| unreachable!("built in")).unwrap())
}

fn mission(text: &str) -> Mission {
    toml::from_str(text).unwrap()
}

#[test]
fn a_profile_draws_the_mean_of_its_legs() {
    let constant = |speed: f64| mission(&format!("inputs = {{ speed_mps = {speed:.1} }}")).drain_w(&explorer()).unwrap();
    let legs = "profile = [{ for_s = 30, inputs = { speed_mps = 0.5 } }, { for_s = 90, inputs = {} }]";
    let mean = mission(legs).drain_w(&explorer()).unwrap();
    let by_hand_w = (30.0 * constant(0.5).value + 90.0 * constant(0.0).value) / 120.0;
    assert!((mean.value - by_hand_w).abs() < 1e-9, "{mean:?} {by_hand_w}");
    // The computer's doubt is common to both legs: no averaging out.
    assert!(mean.sigma > 0.9 * constant(0.0).sigma, "{mean:?}");
    let same = "profile = [{ for_s = 1, inputs = { speed_mps = 0.1 } }, { for_s = 9, inputs = { speed_mps = 0.1 } }]";
    let (one, same) = (constant(0.1), mission(same).drain_w(&explorer()).unwrap());
    assert!((one.value - same.value).abs() < 1e-9 && (one.sigma - same.sigma).abs() < 1e-9);
}

#[test]
fn every_stretch_names_every_channel_so_that_nothing_is_left_over_from_the_leg_before() {
    let stretches = mission("inputs = { cpu_util = 0.5 }\nprofile = [{ for_s = 1, inputs = { speed_mps = 0.5 } }, { for_s = 2 }]")
        .stretches(&[Channel::PitchRad])
        .unwrap();
    let names = |stretch: &Stretch| stretch.inputs.iter().map(|(channel, _)| channel.name()).collect::<Vec<_>>();
    assert_eq!(names(&stretches[0]), names(&stretches[1]));
    let value = |index: usize, channel| stretches[index].inputs.iter().find(|(known, _)| *known == channel).unwrap().1;
    assert_eq!([value(0, Channel::SpeedMps), value(1, Channel::SpeedMps), value(1, Channel::CpuUtil)], [0.5, 0.0, 0.5]);
    assert_eq!(value(0, Channel::PitchRad), 0.0);
}

#[test]
fn mistakes_are_named_with_the_leg_and_what_is_allowed() {
    let refused = |text: &str| mission(text).check().unwrap_err().to_string();
    let wrong = refused("profile = [{ for_s = 10 }, { for_s = 10, inputs = { speed_mp = 0.5 } }]");
    assert!(wrong.contains("mission.profile[1].inputs.speed_mp: unknown channel") && wrong.contains("`speed_mps`"), "{wrong}");
    assert!(refused("profile = [{ for_s = 0 }]").contains("mission.profile[0].for_s = 0: must be above 0"));
    assert!(refused("distance_m = -1").contains("mission.distance_m = -1: must be between 0"));
}

#[test]
fn a_weight_is_nothing_or_within_what_plans_can_count() {
    for weight in ["0", "0.1", "1000"] {
        mission(&format!("weight = {weight}")).check().unwrap();
    }
    for weight in ["0.04", "1000.1", "-1", "1000000"] {
        let said = mission(&format!("weight = {weight}")).check().unwrap_err().to_string();
        assert!(said.ends_with("must be 0, or between 0.1 and 1000"), "{said}");
    }
}
