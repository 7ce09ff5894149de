//! Services that somebody refuses, or does not do.

use proto::{CommandId, CommandReply, Outcome, Rejection, RobotAction};

use super::*;

/// Commands that left since it was last asked, and what was told.
fn heard(core: &mut Core) -> (Vec<(CommandId, String)>, Vec<EventKind>) {
    let (mut commands, mut kinds) = (Vec::new(), Vec::new());
    while let Some(output) = core.poll() {
        match output {
            Output::ToRobot(_, command) => commands.push((command.id, command.action.to_string())),
            Output::ToStation(_, command) => commands.push((command.id, command.action.to_string())),
            Output::Record(Record::Event(event)) => kinds.push(event.kind),
            _ => {}
        }
    }
    (commands, kinds)
}

fn refuses(core: &mut Core, time_s: f64, id: &CommandId, reason: Rejection) {
    let outcome = Outcome::Rejected { reason, detail: "the lift is at work".to_owned() };
    core.handle(at(time_s), Input::Reply(CommandReply { id: id.clone(), at: at(time_s), outcome }));
}

/// Robot and station speak, so that nothing is stale, and the core looks again.
fn goes_on(core: &mut Core, time_s: f64, phase: RobotPhase, bay: (BayPhase, Option<&str>)) {
    says(core, time_s, "r0", phase);
    core.handle(at(time_s), Input::RobotGauge(id("r0"), Gauge { power_w: 0.1, ..gauge(time_s, 0.3, 14.6) }));
    holds(core, time_s, bay.0, bay.1);
    core.handle(at(time_s), Input::Tick);
}

const FREE: (BayPhase, Option<&str>) = (BayPhase::Free, None);

#[test]
fn who_is_busy_is_asked_again_later_and_later_and_no_promise_is_broken() {
    let mut core = begun(recharge(), Stage::Waiting);
    let (mut asked_s, mut told) = (Vec::new(), Vec::new());
    for second in 110..170 {
        let time_s = f64::from(second);
        goes_on(&mut core, time_s, RobotPhase::Waiting, FREE);
        let (commands, kinds) = heard(&mut core);
        told.extend(kinds);
        for (id, _) in commands.iter().filter(|(_, action)| action == "dock r0 in bay-1") {
            asked_s.push(second);
            refuses(&mut core, time_s + 0.5, id, Rejection::Busy);
        }
    }
    assert_eq!(asked_s, [110, 116, 127, 148], "5, 10 and 20 s after each answer");
    let count = |kind: EventKind| told.iter().filter(|known| **known == kind).count();
    let failed = [EventKind::CommandRejected, EventKind::ServiceFailed, EventKind::PromiseBroken].map(count);
    assert_eq!((failed, core.running.len()), ([1, 0, 0], 1));
}

#[test]
fn a_robot_is_told_where_its_service_stands_and_what_it_waits_for() {
    let mut core = begun(recharge(), Stage::Waiting);
    goes_on(&mut core, 110.0, RobotPhase::Waiting, FREE);
    let stands = |core: &Core| core.explain(at(110.6), &id("r0")).unwrap().reasons[1].clone();
    let (commands, _) = heard(&mut core);
    assert_eq!(stands(&core), format!("its service has begun: it waits at the station; {} has not been answered yet", commands[0].0));
    refuses(&mut core, 110.5, &commands[0].0, Rejection::Busy);
    let said = stands(&core);
    assert!(
        said.starts_with("its service has begun: it waits at the station; it is asked again at 00:01:")
            && said.ends_with(": the lift is at work"),
        "{said}"
    );
}

#[test]
fn after_any_other_refusal_robot_and_station_are_not_brought_together_for_a_while() {
    let mut core = begun(recharge(), Stage::Waiting);
    goes_on(&mut core, 110.0, RobotPhase::Waiting, FREE);
    let (commands, _) = heard(&mut core);
    refuses(&mut core, 110.5, &commands[0].0, Rejection::NotPossible);
    goes_on(&mut core, 112.0, RobotPhase::Waiting, FREE);
    let (commands, kinds) = heard(&mut core);
    assert!(kinds.contains(&EventKind::ServiceFailed) && commands.iter().all(|(_, action)| !action.starts_with("dock")), "{commands:?}");
    let why = &core.schedule().unserved[0].reasons[0];
    assert_eq!(why, "s takes no part: at 00:01 s refused (not_possible: the lift is at work); not tried again before 00:02");
    // Then it is.
    goes_on(&mut core, 175.0, RobotPhase::Working, FREE);
    core.handle(at(240.0), Input::Tick);
    assert!(core.schedule().unserved.is_empty(), "{:?}", core.schedule().unserved);
}

#[test]
fn a_robot_in_another_bay_than_it_was_told_is_serviced_there() {
    let mut core = begun(recharge(), Stage::Charging);
    let bay = |bay: &str, phase, robot: Option<&str>| BayState { bay: id(bay), phase, robot: robot.map(id) };
    let bays = vec![bay("bay-1", BayPhase::Free, None), bay("bay-2", BayPhase::Occupied, Some("r0"))];
    says(&mut core, 110.0, "r0", RobotPhase::Charging);
    let state = StationState { at: at(110.0), seq: 110_002, bays, ..ready(110.0) };
    core.handle(at(110.0), Input::StationState(id("s"), state));
    core.handle(at(111.0), Input::Tick);
    assert!(core.running[&id::<RobotId>("r0")].is_in(&id("s"), &id("bay-2")));
}

#[test]
fn who_stands_in_its_bay_and_does_not_charge_is_asked_again_and_let_go_where_the_bay_has_failed() {
    let occupied = (BayPhase::Occupied, Some("r0"));
    let mut core = begun(recharge(), Stage::Charging);
    let mut asked = Vec::new();
    for second in (110..300).step_by(5) {
        goes_on(&mut core, f64::from(second), RobotPhase::Docked, occupied);
        for (id, action) in heard(&mut core).0 {
            asked.push((second, action));
            core.handle(
                at(f64::from(second) + 0.5),
                Input::Reply(CommandReply { id, at: at(f64::from(second)), outcome: Outcome::Accepted }),
            );
        }
    }
    let again = |second: i32| (second, "charge to 25 %".to_owned());
    assert_eq!(asked, [again(175), again(235), again(295)]);
    goes_on(&mut core, 301.0, RobotPhase::Docked, (BayPhase::Failed, Some("r0")));
    let (commands, kinds) = heard(&mut core);
    assert!(kinds.contains(&EventKind::PhaseChanged) && kinds.contains(&EventKind::ServiceFailed), "{kinds:?}");
    assert_eq!(commands.iter().map(|(_, action)| action.as_str()).collect::<Vec<_>>(), ["undock", "undock r0 from bay-1"]);
}

#[test]
fn nobody_is_sent_who_has_another_command_to_answer() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    core.handle(at(0.0), Input::RobotGauge(id("r0"), gauge(0.5, 0.05, 14.6)));
    core.ask_robot(at(1.0), &id("r0"), RobotAction::Undock, None);
    let sent = |core: &mut Core, time_s: f64| {
        core.handle(at(time_s), Input::Tick);
        heard(core).0.into_iter().filter(|(_, action)| action.starts_with("dock")).count()
    };
    let before: usize = (2..58).map(|second| sent(&mut core, f64::from(second))).sum();
    assert_eq!((before, core.schedule().services.len()), (0, 1), "it is planned for, and not sent");
    let undock = core.asked.keys().next().unwrap().clone();
    core.handle(at(58.0), Input::Reply(CommandReply { id: undock, at: at(58.0), outcome: Outcome::Accepted }));
    assert_eq!(sent(&mut core, 59.0), 1);
}

#[test]
fn who_was_busy_for_long_and_then_agrees_has_time_to_set_off() {
    let mut core = begun(recharge(), Stage::Travelling);
    let (robot, mut refused) = (id::<RobotId>("r0"), 0);
    let run = core.running[&robot].clone();
    core.ask_robot(at(99.0), &robot, run.first(), Some((robot.clone(), Stage::Travelling)));
    let mut agreed_s = None;
    for second in 100..700 {
        let time_s = f64::from(second);
        goes_on(&mut core, time_s, RobotPhase::Working, FREE);
        for (id, _) in heard(&mut core).0.into_iter().filter(|(_, action)| action.starts_with("dock")) {
            if second < 400 {
                refused += 1;
                refuses(&mut core, time_s + 0.5, &id, Rejection::Busy);
            } else if agreed_s.is_none() {
                agreed_s = Some(second);
                core.handle(at(time_s + 0.5), Input::Reply(CommandReply { id, at: at(time_s), outcome: Outcome::Accepted }));
            }
        }
        if agreed_s.is_some_and(|agreed_s| second < agreed_s + 50) {
            assert!(core.running.contains_key(&robot), "at {second}");
        }
    }
    assert!((7..12).contains(&refused) && agreed_s.is_some(), "{refused} {agreed_s:?}");
    assert!(!core.running.contains_key(&robot), "but not for ever");
}

#[test]
fn who_is_let_out_early_leaves_its_bay_as_soon_as_it_says_that_it_is_ready() {
    let occupied = (BayPhase::Occupied, Some("r0"));
    let mut core = begun(How::Recharge { bay: id("bay-1"), to_soc: 0.98 }, Stage::Charging);
    core.running.get_mut(&id::<RobotId>("r0")).unwrap().end = at(110.0);
    let late_s = core.settings.late_s;
    goes_on(&mut core, 110.0, RobotPhase::Charging, occupied);
    goes_on(&mut core, 111.0 + late_s, RobotPhase::Charging, occupied);
    let (commands, _) = heard(&mut core);
    let (undock, _) = commands.into_iter().find(|(_, action)| action == "undock").expect("it takes no charge");
    core.handle(at(112.0 + late_s), Input::Reply(CommandReply { id: undock, at: at(112.0 + late_s), outcome: Outcome::Accepted }));
    goes_on(&mut core, 113.0 + late_s, RobotPhase::Charged, occupied);
    let actions: Vec<String> = heard(&mut core).0.into_iter().map(|(_, action)| action).collect();
    assert_eq!(actions, ["undock r0 from bay-1"]);
}
