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

#[test]
fn for_whom_the_first_plan_waits_is_named() {
    let mut core = core();
    let model = core.models.built_in["explorer-3s1p-1320mah"].clone();
    (0..9).for_each(|n| drop(core.models.robots.insert(id(&format!("r{n}")), model.clone())));
    core.handle(at(0.0), Input::Tick);
    assert_eq!(core.schedule().trigger, "waits for s, r0, r1, r2, r3 and 5 more, until 00:01:00 at most");
    (0..8).for_each(|n| joins(&mut core, 1.0, n));
    core.handle(at(2.0), Input::Tick);
    assert_eq!(core.schedule().trigger, "waits for s, r8, until 00:01:00 at most");
    core.handle(at(61.0), Input::Tick);
    assert!(core.schedule().plan > 0 && !core.schedule().trigger.contains("waits"), "{}", core.schedule().trigger);
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

#[test]
fn who_is_gone_for_a_moment_keeps_what_it_was_promised_and_who_stays_away_gives_it_up_when_it_would_have_to_leave() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    core.handle(at(61.0), Input::Tick);
    let planned = |core: &Core| core.plan.planned.iter().find(|planned| planned.robot == id("r0")).cloned();
    let leave_s = planned(&core).unwrap().leave.seconds_since(at(0.0));
    assert!(leave_s > 300.0, "{leave_s}");
    let told = |core: &mut Core| -> Vec<EventKind> {
        let told = std::iter::from_fn(|| core.poll()).filter_map(|output| match output {
            Output::Record(Record::Event(event)) => Some(event.kind),
            _ => None,
        });
        told.filter(|kind| matches!(kind, EventKind::Joined | EventKind::Lost | EventKind::PromiseBroken)).collect()
    };
    told(&mut core);
    // Both agents are restarted, and heard again a moment later.
    core.handle(at(70.0), Input::StationAlive(id("s"), false));
    core.handle(at(70.0), Input::RobotAlive(id("r0"), false));
    core.handle(at(90.0), Input::Tick);
    assert!(planned(&core).is_some(), "{:?}", core.schedule());
    core.handle(at(91.0), Input::StationAlive(id("s"), true));
    joins(&mut core, 91.0, 0);
    core.handle(at(91.0), Input::RobotAlive(id("r0"), true));
    core.handle(at(150.0), Input::Tick);
    assert_eq!(told(&mut core), [EventKind::Lost, EventKind::Lost, EventKind::Joined, EventKind::Joined]);
    assert!(planned(&core).is_some());
    // It is gone for good: its place is kept until it would have to leave for it, and nobody sends it there.
    core.handle(at(160.0), Input::RobotAlive(id("r0"), false));
    core.handle(at(leave_s - 1.0), Input::Tick);
    let leave = planned(&core).unwrap().leave;
    assert_eq!(told(&mut core), [EventKind::Lost]);
    core.handle(leave.plus_s(1.0), Input::Tick);
    core.handle(leave.plus_s(3.0), Input::Tick);
    assert_eq!(told(&mut core), [EventKind::PromiseBroken]);
    let [unserved] = &core.schedule().unserved[..] else { panic!("{:?}", core.schedule()) };
    assert!(unserved.reasons[0].starts_with("it was lost: it has not been heard since 00:02"), "{unserved:?}");
    assert!(!unserved.runs_empty && core.running.is_empty());
    // Back again, it is planned for at once.
    joins(&mut core, leave_s + 10.0, 0);
    core.handle(at(leave_s + 12.0), Input::Tick);
    assert!(
        !core.fleet.robots[&id::<RobotId>("r0")].written_off
            && !core.schedule().unserved.iter().any(|left| left.reasons[0].contains("lost"))
    );
}

#[test]
fn who_is_gone_for_good_is_forgotten_with_what_it_was_promised_and_begins_anew_when_it_speaks_again() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    core.handle(at(61.0), Input::Tick);
    let planned = |core: &Core| core.plan.planned.iter().map(|planned| planned.robot.to_string()).collect::<Vec<_>>();
    assert_eq!(planned(&core), ["r0"]);
    let told = |core: &mut Core| -> Vec<(EventKind, String)> {
        let told = std::iter::from_fn(|| core.poll()).filter_map(|output| match output {
            Output::Record(Record::Event(event)) => Some((event.kind, event.robot?.to_string())),
            _ => None,
        });
        told.collect()
    };
    told(&mut core);
    // It is there: nothing is forgotten, and nobody else is either.
    core.handle(at(62.0), Input::Forget(id("r0")));
    core.handle(at(62.0), Input::Forget(id("nobody")));
    assert_eq!(told(&mut core), []);
    assert_eq!(core.can_forget(&id("r0")), Err(NotForgotten::Heard("r0 is there to be heard: end its agent first".to_owned())));
    assert!(matches!(core.can_forget(&id("nobody")), Err(NotForgotten::Unknown(_))));
    core.handle(at(63.0), Input::RobotAlive(id("r0"), false));
    core.handle(at(64.0), Input::Forget(id("r0")));
    core.handle(at(70.0), Input::Tick);
    let of_r0 = |kind| (kind, "r0".to_owned());
    assert_eq!(told(&mut core), [EventKind::Lost, EventKind::PromiseBroken, EventKind::Forgotten].map(of_r0));
    assert!(planned(&core).is_empty() && core.fleet().robots.is_empty() && core.schedule().unserved.is_empty());
    assert!(core.explain(at(70.0), &id("r0")).is_err());
    // Its agent was only restarted after all.
    joins(&mut core, 80.0, 0);
    core.handle(at(81.0), Input::Tick);
    assert_eq!(told(&mut core)[0], of_r0(EventKind::Joined));
    assert_eq!(planned(&core), ["r0"]);
}

/// A computer without a battery for its clock starts again forty minutes behind.
#[test]
fn who_was_lost_is_heard_again_whatever_its_clock_says_now() {
    let mut core = core();
    station_joins(&mut core, 3_000.0);
    joins(&mut core, 3_000.0, 1);
    let (robot, station): (RobotId, StationId) = (id("r1"), id("s"));
    core.handle(at(3_030.0), Input::RobotAlive(robot.clone(), false));
    core.handle(at(3_030.0), Input::StationAlive(station.clone(), false));
    let back = at(3_060.0);
    core.handle(back, Input::RobotAlive(robot.clone(), true));
    core.handle(back, Input::StationAlive(station.clone(), true));
    let phase = |core: &Core| core.fleet().robots[&robot].phase();
    let waits = RobotState { seq: 1, phase: RobotPhase::Waiting, station: Some(station.clone()), ..working(660.0, &["s"]) };
    core.handle(back, Input::RobotState(robot.clone(), waits.clone()));
    core.handle(back, Input::RobotGauge(robot.clone(), Gauge { seq: 1, ..gauge(660.0, 0.2, 14.6) }));
    core.handle(back, Input::StationState(station.clone(), StationState { powered: false, ..ready(660.0) }));
    core.handle(back, Input::PackGauge(station.clone(), id("p"), Gauge { seq: 1, ..gauge(660.0, 0.7, 84.0) }));
    assert_eq!((phase(&core), core.fleet().robots[&robot].gauge.as_ref().unwrap().soc.value), (Some(RobotPhase::Waiting), 0.2));
    let belief = &core.fleet().stations[&station];
    assert_eq!((belief.state.as_ref().unwrap().powered, belief.packs[&id("p")].soc.value), (false, 0.7));
    // From then on its own order counts again.
    core.handle(back, Input::RobotState(robot.clone(), RobotState { phase: RobotPhase::Working, ..waits.clone() }));
    assert_eq!(phase(&core), Some(RobotPhase::Waiting), "a copy");
    core.handle(back, Input::RobotState(robot.clone(), RobotState { seq: 2, at: at(661.0), phase: RobotPhase::Working, ..waits }));
    assert_eq!(phase(&core), Some(RobotPhase::Working));
}

#[test]
fn who_never_gives_a_sign_of_life_is_forgotten_once_nothing_is_heard_of_it() {
    let mut core = core();
    joins(&mut core, 0.0, 1);
    core.handle(at(300.0), Input::Tick);
    assert!(core.can_forget(&id("r1")).is_err());
    core.handle(at(700.0), Input::Tick);
    assert!(core.can_forget(&id("r1")).is_ok());
    core.handle(at(700.0), Input::Forget(id("r1")));
    assert!(core.fleet().robots.is_empty());
}
