//! Services that wait for a place.

use super::*;

/// Stations `s` and `t` with a bay each.
fn two_stations() -> Core {
    let station = |name: &str| {
        format!("[stations.{name}]\nload = \"mds-station\"\nload_s = 30\nunload_s = 30\npacks = {{ p = \"mds-3s4p-7600mah\" }}\n")
    };
    let text = format!("schema = 1\nsite = \"test\"\n{}{}", station("s"), station("t"));
    let (settings, models) = toml::from_str::<Config>(&text).unwrap().load(None).unwrap();
    let mut core = Core::new(settings, models, Numbering::default());
    for name in ["s", "t"] {
        core.handle(at(99.0), Input::StationState(id(name), ready(99.0)));
        core.handle(at(99.0), Input::PackGauge(id(name), id("p"), gauge(99.0, 1.0, 84.0)));
    }
    core
}

/// A robot that waits before the bay of `s`, with so much left, and a free station `t` a minute away.
fn waits_with(remaining_wh: f64, time_s: f64) -> (bool, Option<StationId>) {
    let mut core = two_stations();
    let before_s = time_s - 1.0;
    core.running.insert(id("r0"), waits(0, 100.0));
    let state = RobotState { phase: RobotPhase::Waiting, station: Some(id("s")), ..working(before_s, &["s", "t"]) };
    core.handle(at(before_s), Input::RobotState(id("r0"), state));
    let soc = Estimate::new(remaining_wh / 14.6, 0.0005);
    let left = Gauge { remaining_wh: Estimate::new(remaining_wh, 0.01), soc, ..gauge(before_s, 0.0, 14.6) };
    core.handle(at(before_s), Input::RobotGauge(id("r0"), left));
    // Its bay is not free, or its station has said that it is busy.
    let busy = BayState { bay: id("bay-1"), phase: BayPhase::Occupied, robot: Some(id("other")) };
    core.handle(at(before_s), Input::StationState(id("s"), StationState { bays: vec![busy], seq: 2, ..ready(before_s) }));
    core.handle(at(time_s), Input::Tick);
    core.handle(at(time_s + 2.0), Input::Tick);
    let planned = core.schedule().services.iter().find(|service| service.robot == id("r0")).map(|service| service.station.clone());
    (core.refusals.holds(at(time_s), &id("r0"), &id("s")).is_some(), planned)
}

#[test]
fn who_waits_goes_elsewhere_before_that_is_out_of_reach() {
    // At 4.3 W and a little more, surely: 0.22 Wh less 0.04 that the way takes beyond as much work last for 130 s, of which a minute is for the way and half of one for the lift; 2 Wh last for
    // half an hour, and 0.1 Wh for little more than the way.
    let (s, t) = (Some(id::<StationId>("s")), Some(id::<StationId>("t")));
    assert_eq!(waits_with(2.0, 200.0), (false, s.clone()), "there is time");
    assert_eq!(waits_with(0.22, 101.0), (false, s.clone()), "it is not even late");
    assert_eq!(waits_with(0.22, 200.0), (true, t));
    assert_eq!(waits_with(0.1, 200.0), (false, s), "nothing else is in reach");
}

/// Two wait at `s` with as little left, and `t` has one bay.
#[test]
fn of_two_that_wait_in_vain_one_leaves_for_a_free_bay() {
    let mut core = two_stations();
    let at_s = 200.0;
    let left = Gauge { remaining_wh: Estimate::new(0.22, 0.01), soc: Estimate::new(0.22 / 14.6, 0.0005), ..gauge(at_s - 1.0, 0.0, 14.6) };
    for n in 0..2 {
        let robot: RobotId = id(&format!("r{n}"));
        core.running.insert(robot.clone(), waits(n, 100.0));
        let state = RobotState { phase: RobotPhase::Waiting, station: Some(id("s")), ..working(at_s - 1.0, &["s", "t"]) };
        core.handle(at(at_s - 1.0), Input::RobotState(robot.clone(), state));
        core.handle(at(at_s - 1.0), Input::RobotGauge(robot, left.clone()));
    }
    let busy = BayState { bay: id("bay-1"), phase: BayPhase::Occupied, robot: Some(id("other")) };
    core.handle(at(at_s - 1.0), Input::StationState(id("s"), StationState { bays: vec![busy], seq: 2, ..ready(at_s - 1.0) }));
    core.handle(at(at_s), Input::Tick);
    core.handle(at(at_s + 2.0), Input::Tick);
    let told = std::iter::from_fn(|| core.poll()).filter(|output| match output {
        Output::Record(Record::Event(event)) => {
            event.kind == EventKind::ServiceFailed && event.text.contains("t will soon be out of reach")
        }
        _ => false,
    });
    assert_eq!(told.count(), 1, "{:?}", core.schedule());
}

#[test]
fn who_waited_too_long_is_not_sent_to_the_same_place_at_once() {
    let mut core = begun(recharge(), Stage::Waiting);
    // All is as it is before the service is looked at.
    let run = core.running.remove(&id::<RobotId>("r0")).unwrap();
    says(&mut core, 110.0, "r0", RobotPhase::Waiting);
    holds(&mut core, 110.0, BayPhase::Occupied, Some("other"));
    core.running.insert(id("r0"), run);
    let late_s = 101.0 + core.settings.late_s;
    // All of them are heard all the time.
    for before_s in (1..170).map(|n| 10.0 * f64::from(n)).rev() {
        holds(&mut core, late_s - before_s, BayPhase::Occupied, Some("other"));
        says(&mut core, late_s - before_s, "r0", RobotPhase::Waiting);
    }
    core.handle(at(late_s), Input::Tick);
    let told = std::iter::from_fn(|| core.poll()).filter_map(|output| match output {
        Output::Record(Record::Event(event)) if event.kind == EventKind::ServiceFailed => Some(event.text),
        _ => None,
    });
    assert_eq!(told.collect::<Vec<_>>(), ["r0: not in its bay 30 min after it was due"]);
    assert!(core.refusals.holds(at(late_s), &id("r0"), &id("s")).is_some());
}

/// A robot drives into its bay by itself, and a coordinator that has just begun hears its station call the bay free.
#[test]
fn no_one_is_sent_into_a_bay_in_which_another_says_that_it_stands() {
    for phase in [RobotPhase::Docked, RobotPhase::Charging, RobotPhase::Charged] {
        let mut core = core();
        station_joins(&mut core, 0.0);
        joins(&mut core, 0.0, 0);
        joins(&mut core, 0.0, 1);
        says(&mut core, 1.0, "r0", phase);
        // Before a command is given up; who is charged is looked after once it must have heard all that was said to it.
        let until = if phase == RobotPhase::Charged { 90 } else { 30 };
        (2..until).for_each(|time_s| {
            let time_s = f64::from(time_s);
            holds(&mut core, time_s, BayPhase::Free, None);
            says(&mut core, time_s, "r0", phase);
            core.handle(at(time_s), Input::Tick);
        });
        let run = core.running.get(&id::<RobotId>("r0")).unwrap_or_else(|| panic!("{phase:?}: nobody looks after it"));
        // Until it has agreed to how far it is charged, it counts as one that comes.
        assert!(run.is_in(&id("s"), &id("bay-1")), "{phase:?}: {run:?}");
        assert_eq!((run.at_place(), run.asked.is_some()), if phase == RobotPhase::Charged { (true, false) } else { (false, true) });
        let sent = core.running.get(&id::<RobotId>("r1")).map(|run| run.start);
        assert!(sent.is_none_or(|start| start > at(f64::from(until))), "{phase:?}: {sent:?}");
    }
}

/// One waits before a bay that its station calls free, and hears first, or never, that another one stands in it.
#[test]
fn no_one_is_lifted_into_a_bay_in_which_another_says_that_it_stands() {
    for is_taken in [false, true] {
        let mut core = begun(recharge(), Stage::Waiting);
        joins(&mut core, 0.0, 1);
        let run = core.running.remove(&id::<RobotId>("r0")).unwrap();
        says(&mut core, 110.0, "r0", RobotPhase::Waiting);
        if is_taken {
            says(&mut core, 110.0, "r1", RobotPhase::Charging);
        }
        core.running.insert(id("r0"), run);
        for time_s in (111..140).map(f64::from) {
            holds(&mut core, time_s, BayPhase::Free, None);
            says(&mut core, time_s, "r0", RobotPhase::Waiting);
            says(&mut core, time_s, "r1", if is_taken { RobotPhase::Charging } else { RobotPhase::Working });
        }
        let lifts = |output: &Output| {
            let Output::ToStation(_, command) = output else { return false };
            matches!(&command.action, proto::StationAction::Dock { robot, .. } if *robot == id("r0"))
        };
        assert_eq!(std::iter::from_fn(|| core.poll()).any(|output| lifts(&output)), !is_taken);
    }
}
