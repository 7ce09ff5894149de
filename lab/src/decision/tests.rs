use super::*;
use crate::measurement::{LogFacts, read_log};
use crate::prepare::prepare;

/// Before and after a change of a model's text, under the circumstances of a log.
fn decisions(before: &str, log: &str, change: impl Fn(&str) -> String) -> Decisions {
    let builtin = |path: &str| energy::built_in(path).map(str::to_owned).ok_or_else(|| format!("{path} is not built in"));
    let [before, after] = [before.to_owned(), change(before)].map(|text| Arc::new(Model::parse("m", &text, &builtin).unwrap()));
    let log = read_log("run.csv", log.as_bytes(), LogFacts { soc_initial: Some(0.8), ..LogFacts::default() }).unwrap();
    let ready = |model: &Model| vec![prepare(model, &log).unwrap()];
    let (old, new) = (ready(&before), ready(&after));
    Decisions::between(Seen { model: &before, logs: &old }, Seen { model: &after, logs: &new })
}

fn of<'a>(decisions: &'a Decisions, name: &str) -> &'a Decision {
    decisions.0.iter().find(|decision| decision.name == name).unwrap_or_else(|| panic!("no {name} in {decisions:?}"))
}

#[test]
fn more_resistance_shortens_the_run_time() {
    let log = "time_s,current_a,voltage_v,ambient_degc\n0,2,4.0,25\n600,2,3.8,25\n";
    let worse = |text: &str| text.replace("value = 0.0679", "value = 0.2");
    let found = decisions(energy::built_in("enertech-lco-2280mah").unwrap(), log, worse);
    for name in ["usable_energy_wh", "run_time_full_s", "run_time_left_s"] {
        let decision = of(&found, name);
        assert!(decision.after.value < 0.98 * decision.before.value, "{decision:?}");
        assert!(decision.before.sigma > 0.0 && decision.before.sigma < 0.2 * decision.before.value, "{decision:?}");
    }
    // By hand: 2 A at the 3.8 V measured at the end of the only interval.
    let full = of(&found, "run_time_full_s").before.value;
    assert!((full - of(&found, "usable_energy_wh").before.value / 7.6 * 3600.0).abs() < 1e-6 * full);
    assert_eq!(found.rows()[1].unit, "min");
}

const ROBOT: &str = r#"
schema = 1
system = "robot"
name = "r"
[[effect]]
id = "idle"
idle_w = { value = 3.47, sigma = 0.3, source = "guess" }
[[effect]]
id = "converter"
efficiency = { value = 0.9, sigma = 0.02, source = "guess" }
"#;

#[test]
fn a_robots_power_and_way_are_those_of_the_log() {
    let log = "time_s,power_w,speed_mps\n0,4,0.1\n100,4,0.1\n";
    let found = decisions(ROBOT, log, |text| text.replace("3.47", "4.37"));
    let (power, way) = (of(&found, "mean_power_w"), of(&found, "energy_per_way_j_per_m"));
    // 0.9 W more behind a converter of 0.9.
    assert!((power.after.value - power.before.value - 1.0).abs() < 1e-9, "{power:?}");
    // 100 s at 0.1 m/s are 10 m.
    assert!((way.before.value - power.before.value * 10.0).abs() < 1e-9, "{way:?}");
    assert!(power.before.sigma > 0.3, "{power:?}");
}

/// Two hours in a dock, of which the log has no rows, are no way that it drove.
#[test]
fn nothing_counts_over_a_gap() {
    let rows = |begins_s: i32| (0..20).map(move |row| format!("{},4,0.1\n", begins_s + 10 * row)).collect::<String>();
    let log = |pause_s: i32| format!("time_s,power_w,speed_mps\n{}{}", rows(0), rows(200 + pause_s));
    let [whole, paused] = [0, 7200].map(|pause_s| decisions(ROBOT, &log(pause_s), |text| text.replace("3.47", "4.37")));
    for name in ["mean_power_w", "energy_per_way_j_per_m"] {
        let (whole, paused) = (of(&whole, name).before.value, of(&paused, name).before.value);
        assert!((paused / whole - 1.0).abs() < 1e-9, "{name}: {paused} for {whole}");
    }
}

#[test]
fn a_worse_converter_makes_a_service_dearer_and_a_pack_pay_for_fewer() {
    let log = "time_s,pack_power_w,charge_power_w,robots_docked,robots_charging,lift_active,bay_squared_current_a2,pack_voltage_v\n\
               0,40,20,2,2,0,2,11\n60,40,20,2,2,0,2,11\n";
    let found = decisions(energy::built_in("mds-station").unwrap(), log, |text| text.replace("value = 0.84", "value = 0.7"));
    let (service, robots) = (of(&found, "energy_per_service_wh"), of(&found, "robots_per_pack_count"));
    assert!(service.after.value > 1.1 * service.before.value, "{service:?}");
    assert!(robots.after.value < 0.95 * robots.before.value, "{robots:?}");
    assert!(robots.before.sigma > 0.0 && robots.what.contains("2 at once"), "{robots:?}");
    let json = serde_json::to_value(&found).unwrap();
    assert_eq!(json["energy_per_service_wh"]["before"]["value"], service.before.value);
}
