//! What is told when a robot joins.

use super::*;

/// What was said when `r0`, which the configuration gives that model, joined.
fn joined(configured: &str) -> String {
    let mut core = core();
    let model = core.models.built_in[configured].clone();
    core.models.robots.insert(id("r0"), model);
    joins(&mut core, 0.0, 0);
    let events = std::iter::from_fn(|| core.poll()).filter_map(|output| match output {
        Output::Record(Record::Event(event)) if event.kind == EventKind::Joined => Some(event.text),
        _ => None,
    });
    events.collect::<Vec<_>>().join("; ")
}

#[test]
fn a_robot_that_counts_by_another_battery_model_than_it_is_planned_with_is_told_of() {
    assert_eq!(joined("explorer-3s1p-1320mah"), "r0 joined");
    let told = joined("mds-3s4p-7600mah");
    let both =
        told.contains("by the battery model `explorer-3s1p-1320mah`") && told.contains("planned with `mds-3s4p-7600mah` (robots.r0)");
    assert!(both, "{told}");
}

/// Milliseconds that were meant, or a planet away: who says that it is on its way for a thousand years holds nobody up, and no memory.
#[test]
fn a_way_without_an_end_harms_no_plan() {
    for time_s in [1e6, 4e10, 1e300] {
        let mut core = core();
        station_joins(&mut core, 0.0);
        joins(&mut core, 0.0, 1);
        let travel = [(id("s"), Travel { time_s, energy_wh: Estimate::new(0.1, 0.01) })].into();
        let state =
            RobotState { phase: RobotPhase::Travelling, station: Some(id("s")), bay: Some(id("bay-1")), travel, ..working(0.0, &[]) };
        core.handle(at(0.0), Input::RobotState(id("far"), state));
        core.handle(at(0.0), Input::RobotGauge(id("far"), gauge(0.0, 0.5, 14.6)));
        for tick in 1..100 {
            core.handle(at(f64::from(tick)), Input::Tick);
        }
        assert!(core.schedule().services.iter().any(|service| service.robot == id("r1")), "{time_s}: {:?}", core.schedule());
    }
}

#[test]
fn what_is_wrong_with_an_input_is_told_once_whatever_its_numbers() {
    let mut core = core();
    for degc in 0..2000 {
        core.handle(
            at(f64::from(degc)),
            Input::Refused(format!("gauge of r1: `temperature_degc` is {}, allowed is -50 .. 200", 300 + degc)),
        );
    }
    core.handle(at(2000.0), Input::Refused("gauge of r2: `temperature_degc` is 300, allowed is -50 .. 200".to_owned()));
    let refused = |output: &Output| matches!(output, Output::Record(Record::Event(event)) if event.kind == EventKind::InputRefused);
    assert_eq!(std::iter::from_fn(|| core.poll()).filter(refused).count(), 2, "one of each robot");
}
