//! Services that go on, whatever robots, stations and the coordinator have missed of each other.

use super::*;
use crate::scheduler::{Grounds, Planned};

mod leaving;
mod refusing;
mod waiting;

/// The service of robot `n`, which stands before its bay.
fn waits(n: usize, start_s: f64) -> ServiceRun {
    ServiceRun {
        robot: id(&format!("r{n}")),
        station: id("s"),
        how: How::Recharge { bay: id("bay-1"), to_soc: 0.98 },
        left: at(0.0),
        start: at(start_s),
        end: at(start_s + 600.0),
        need: energy::Need::default(),
        packs: Vec::new(),
        why: Vec::new().into(),
        stage: Stage::Waiting,
        asked: None,
        hands_over: None,
        takes_none_since: None,
        called_off_since: None,
        cut_short: None,
        again: None,
    }
}

/// The robot says what it does, and where.
fn says(core: &mut Core, time_s: f64, robot: &str, phase: RobotPhase) {
    let place = |place: &str| (phase != RobotPhase::Working).then(|| place.to_owned());
    let state = RobotState {
        at: at(time_s),
        seq: (time_s * 1e3) as u64 + 2,
        phase,
        station: place("s").map(|station| id(&station)),
        bay: place("bay-1").map(|bay| id(&bay)),
        ..core.fleet.robots[&id::<RobotId>(robot)].state.clone().unwrap()
    };
    core.handle(at(time_s), Input::RobotState(id(robot), state));
}

/// The station says who is in its bay.
fn holds(core: &mut Core, time_s: f64, phase: BayPhase, robot: Option<&str>) {
    let state = StationState {
        at: at(time_s),
        seq: (time_s * 1e3) as u64 + 2,
        bays: vec![BayState { bay: id("bay-1"), phase, robot: robot.map(id) }],
        ..core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap()
    };
    core.handle(at(time_s), Input::StationState(id("s"), state));
}

/// One robot, whose service at the only station has come to `stage`.
fn begun(how: How, stage: Stage) -> Core {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    core.running.insert(id("r0"), ServiceRun { how, stage, ..waits(0, 100.0) });
    core
}

fn recharge() -> How {
    How::Recharge { bay: id("bay-1"), to_soc: 0.25 }
}

/// What was noted of services since it was last asked.
fn noted(core: &mut Core) -> Vec<EventKind> {
    let told = std::iter::from_fn(|| core.poll()).filter_map(|output| match output {
        Output::Record(Record::Event(event)) => Some(event.kind),
        _ => None,
    });
    told.filter(|kind| matches!(kind, EventKind::ServiceDone | EventKind::ServiceFailed)).collect()
}

#[test]
fn who_is_found_in_a_bay_is_let_out_though_somebody_is_on_the_way_to_it() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    joins(&mut core, 0.0, 1);
    core.running.insert(id("r1"), waits(1, 100.0));
    says(&mut core, 0.5, "r1", RobotPhase::Waiting);
    let charges = RobotState {
        at: at(1.0),
        seq: 2000,
        phase: RobotPhase::Charging,
        station: Some(id("s")),
        bay: Some(id("bay-1")),
        ..core.fleet.robots[&id::<RobotId>("r0")].state.clone().unwrap()
    };
    core.handle(at(1.0), Input::RobotState(id("r0"), charges));
    let held = StationState {
        at: at(1.0),
        seq: 2000,
        bays: vec![BayState { bay: id("bay-1"), phase: BayPhase::Occupied, robot: Some(id("r0")) }],
        ..core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap()
    };
    core.handle(at(1.0), Input::StationState(id("s"), held));
    core.handle(at(2.0), Input::Tick);
    let run = &core.running[&id::<RobotId>("r0")];
    assert_eq!((run.stage, &run.packs[..]), (Stage::Loading, &[id("p")][..]));
    // From 30 to 98 % of 14.6 Wh, and what is lost and drawn beside.
    assert!((10.0..30.0).contains(&run.need.mean_wh), "{:?}", run.need);
    assert_eq!(core.explain(at(2.0), &id("r0")).unwrap().changed, ["it is taken over at s as it was found"]);
    studies(&mut core);
    core.handle(at(3.0), Input::Tick);
    let told = std::iter::from_fn(|| core.poll()).find_map(|output| match output {
        Output::ToRobot(robot, command) => Some((robot, command.action)),
        _ => None,
    });
    let how_far = proto::RobotAction::ChargeTo { soc: core.settings.charge_to_soc };
    assert_eq!(told, Some((id("r0"), how_far)), "it may charge by a rule of its own");
    assert!(core.running.contains_key(&id::<RobotId>("r1")), "who is on the way waits");
}

#[test]
fn who_is_let_out_and_not_heard_holds_no_bay_and_is_serviced() {
    let mut core = begun(recharge(), Stage::Unloading);
    holds(&mut core, 190.0, BayPhase::Unloading, Some("r0"));
    core.handle(at(195.0), Input::RobotAlive(id("r0"), false));
    core.handle(at(196.0), Input::Tick);
    assert!(core.running.contains_key(&id::<RobotId>("r0")), "the lift still has it");
    holds(&mut core, 200.0, BayPhase::Free, None);
    let told = core.schedule().services.iter().find(|service| service.robot == id("r0")).map(|service| service.end);
    assert_eq!(told, Some(at(200.0)), "its end is no guess any more");
    core.handle(at(260.0), Input::Tick);
    assert_eq!(noted(&mut core), [EventKind::ServiceDone]);
}

#[test]
fn who_goes_back_to_work_before_it_is_taken_in_holds_no_bay() {
    for stage in [Stage::Waiting, Stage::Loading] {
        let mut core = begun(recharge(), stage);
        says(&mut core, 110.0, "r0", RobotPhase::Waiting);
        core.handle(at(110.0), Input::Tick);
        noted(&mut core);
        core.asked.clear();
        core.running.get_mut(&id::<RobotId>("r0")).unwrap().asked = None;
        says(&mut core, 120.0, "r0", RobotPhase::Working);
        core.handle(at(121.0), Input::Tick);
        assert_eq!(noted(&mut core), [EventKind::ServiceFailed], "{stage:?}");
    }
}

#[test]
fn an_exchange_is_done_when_the_gauge_of_the_new_pack_is_heard() {
    let mut core = begun(How::Swap { spare: id("spare-1") }, Stage::Swapping);
    says(&mut core, 110.0, "r0", RobotPhase::Swapping);
    says(&mut core, 150.0, "r0", RobotPhase::Working);
    core.handle(at(151.0), Input::Tick);
    assert_eq!(noted(&mut core), [], "by the gauge of the pack that it left it would be sent again at once");
    core.handle(at(152.0), Input::RobotGauge(id("r0"), gauge(149.0, 0.3, 14.6)));
    assert_eq!(noted(&mut core), [], "that one was under way for long");
    core.handle(at(153.0), Input::RobotGauge(id("r0"), gauge(152.0, 0.95, 14.6)));
    assert_eq!(noted(&mut core), [EventKind::ServiceDone]);
}

#[test]
fn an_exchange_waits_for_its_spare_and_remembers_what_its_robot_hands_over() {
    let mut core = begun(How::Swap { spare: id("spare-1") }, Stage::Travelling);
    let shelf = |core: &mut Core, time_s: f64, ready: bool| {
        let spare = SpareState { spare: id("spare-1"), soc: Estimate::new(0.9, 0.01), ready, battery: None };
        let before = core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap();
        let state = StationState { at: at(time_s), seq: (time_s * 1e3) as u64 + 2, spares: vec![spare], ..before };
        core.handle(at(time_s), Input::StationState(id("s"), state));
    };
    let stage = |core: &Core| core.running[&id::<RobotId>("r0")].stage;
    let asked = |core: &Core| core.running[&id::<RobotId>("r0")].asked.is_some();
    shelf(&mut core, 110.0, false);
    says(&mut core, 111.0, "r0", RobotPhase::Waiting);
    core.handle(at(112.0), Input::Tick);
    assert!(stage(&core) == Stage::Waiting && !asked(&core), "it is still charged, and nobody is asked for it");
    shelf(&mut core, 150.0, true);
    core.handle(at(151.0), Input::Tick);
    assert!(asked(&core));
    core.enter(at(152.0), &id("r0"), Stage::Handing);
    let said = from_wire(core.fleet.robots[&id::<RobotId>("r0")].gauge.as_ref().unwrap().soc);
    // The gauge of the new pack is heard before the station says that it has the old one.
    core.handle(at(215.0), Input::RobotGauge(id("r0"), gauge(214.0, 0.95, 14.6)));
    shelf(&mut core, 216.0, false);
    assert_eq!(core.fleet.stations[&id::<StationId>("s")].left[&id::<SpareId>("spare-1")].soc, Some(said));
}

#[test]
fn who_waits_for_a_spare_gets_another_that_is_ready() {
    let mut core = begun(How::Swap { spare: id("spare-1") }, Stage::Travelling);
    let shelf = |core: &mut Core, time_s: f64, ready: [bool; 2]| {
        let spare = |(name, ready): (&str, bool)| SpareState { spare: id(name), soc: Estimate::new(0.9, 0.01), ready, battery: None };
        let before = core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap();
        let spares = ["spare-1", "spare-2"].into_iter().zip(ready).map(spare).collect();
        core.handle(
            at(time_s),
            Input::StationState(id("s"), StationState { at: at(time_s), seq: (time_s * 1e3) as u64 + 2, spares, ..before }),
        );
    };
    let given = |core: &Core| core.running[&id::<RobotId>("r0")].how.clone();
    let due_s = core.running[&id::<RobotId>("r0")].start.seconds_since(at(0.0));
    shelf(&mut core, due_s - 5.0, [false, true]);
    says(&mut core, due_s - 4.0, "r0", RobotPhase::Waiting);
    core.handle(at(due_s - 3.0), Input::Tick);
    assert_eq!(given(&core), How::Swap { spare: id("spare-1") }, "its time has not come");
    // Who was promised that one comes before the other is ready; then it comes after that, and is given the other.
    let planned = |start_s: f64| Planned {
        robot: id("r2"),
        station: id("s"),
        mode: planner::Mode::Swap,
        bay: None,
        spare: Some(id("spare-2")),
        to_soc: 0.98,
        leave: at(start_s - 60.0),
        start: at(start_s),
        end: at(start_s + 60.0),
        need: energy::Need::default(),
        packs: Vec::new(),
        probability: 1.0,
        covered: 1.0,
        why: Vec::new().into(),
        grounds: Grounds::default(),
    };
    let promised = |core: &mut Core, start_s: f64| {
        core.plan.planned = vec![planned(start_s)];
        let run = core.running[&id::<RobotId>("r0")].clone();
        let state = RobotState { phase: RobotPhase::Waiting, ..core.fleet.robots[&id::<RobotId>("r0")].state.clone().unwrap() };
        core.basis(at(due_s + 1.0)).ready_instead(&run, &state)
    };
    assert_eq!(promised(&mut core, due_s + 120.0), None);
    assert_eq!(promised(&mut core, due_s + 9_000.0), Some(id("spare-2")));
    core.plan.planned.clear();
    let mut other = begun(How::Swap { spare: id("spare-1") }, Stage::Waiting);
    other.plan.planned = vec![planned(due_s + 9_000.0)];
    other.is_given(at(due_s + 1.0), &id("r0"), id("spare-2"));
    assert_eq!(other.plan.planned[0].spare, Some(id("spare-1")));
    // Another robot has that one.
    let other = ServiceRun { robot: id("r1"), how: How::Swap { spare: id("spare-2") }, ..core.running[&id::<RobotId>("r0")].clone() };
    core.running.insert(id("r1"), other);
    core.handle(at(due_s + 1.0), Input::Tick);
    assert_eq!(given(&core), How::Swap { spare: id("spare-1") });
    core.running.remove(&id::<RobotId>("r1"));
    core.handle(at(due_s + 2.0), Input::Tick);
    assert_eq!(given(&core), How::Swap { spare: id("spare-2") });
    core.handle(at(due_s + 3.0), Input::Tick);
    assert!(core.running[&id::<RobotId>("r0")].asked.is_some(), "and is handed it");
}

#[test]
fn a_pack_that_a_robot_left_is_as_full_as_its_gauge_said_unless_the_station_knows_better() {
    let mut core = begun(How::Swap { spare: id("spare-1") }, Stage::Swapping);
    let said = core.fleet.robots[&id::<RobotId>("r0")].gauge.as_ref().unwrap().soc;
    let spare = |soc: Estimate, ready: bool| SpareState { spare: id("spare-1"), soc, ready, battery: None };
    let told = |core: &mut Core, time_s: f64, spare: SpareState| {
        let state = StationState {
            at: at(time_s),
            seq: (time_s * 1e3) as u64 + 2,
            spares: vec![spare],
            ..core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap()
        };
        core.handle(at(time_s), Input::StationState(id("s"), state));
        core.fleet.stations[&id::<StationId>("s")].left.get(&id::<SpareId>("spare-1")).copied()
    };
    // A station that cannot measure a pack says that it may be anything.
    let anything = Estimate::new(0.0, 0.2);
    let left = told(&mut core, 110.0, spare(anything, false)).expect("a pack stands there");
    assert_eq!((left.since, left.soc), (at(110.0), Some(from_wire(said))));
    core.handle(at(170.0), Input::RobotGauge(id("r0"), gauge(169.0, 0.95, 14.6)));
    let left = told(&mut core, 171.0, spare(anything, false)).expect("it still does");
    assert_eq!((left.since, left.soc(from_wire(anything))), (at(110.0), from_wire(said)), "the gauge speaks of another pack now");
    let measured = Estimate::new(0.18, said.sigma / 2.0);
    assert_eq!(left.soc(from_wire(measured)), from_wire(measured));
    assert_eq!(told(&mut core, 4000.0, spare(Estimate::new(0.98, 0.01), true)), None);
}

#[test]
fn who_was_taken_in_elsewhere_is_taken_over_there() {
    let mut core = begun(How::Recharge { bay: id("bay-2"), to_soc: 0.98 }, Stage::Travelling);
    holds(&mut core, 110.0, BayPhase::Occupied, Some("r0"));
    says(&mut core, 111.0, "r0", RobotPhase::Docked);
    assert_eq!(noted(&mut core), [EventKind::ServiceFailed]);
    core.handle(at(112.0), Input::Tick);
    let run = &core.running[&id::<RobotId>("r0")];
    assert!(run.is_in(&id("s"), &id("bay-1")) && run.stage == Stage::Loading, "{run:?}");
}

#[test]
fn nobody_is_sent_off_while_a_lift_moves_it() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    core.handle(at(61.0), Input::Tick);
    let leave = core.plan.planned.first().expect("a plan").leave;
    let before_s = leave.seconds_since(at(0.0)) - 2.0;
    holds(&mut core, before_s, BayPhase::Loading, Some("r0"));
    says(&mut core, before_s, "r0", RobotPhase::Waiting);
    core.handle(leave.plus_s(1.0), Input::Tick);
    assert!(core.running.is_empty(), "{:?}", core.running);
}

#[test]
fn who_is_lost_before_a_free_bay_does_not_keep_others_out() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    core.running.insert(id("r0"), waits(0, 100.0));
    core.handle(at(110.0), Input::RobotAlive(id("r0"), false));
    let begun = |core: &Core| core.running.contains_key(&id::<RobotId>("r0"));
    core.handle(at(180.0), Input::Tick);
    assert!(begun(&core), "nobody else wants the bay");
    joins(&mut core, 181.0, 1);
    core.handle(at(183.0), Input::Tick);
    assert!(!begun(&core), "{:?}", core.plan.planned);
}

#[test]
fn who_waits_for_a_bay_begins_after_everybody_who_comes_into_it_before_and_never_in_the_past() {
    let mut core = core();
    let mut begins = |n: usize, start_s: f64| {
        let run = waits(n, start_s);
        core.running.insert(run.robot.clone(), run);
    };
    begins(0, 100.0);
    begins(1, 200.0);
    let counts = |core: &Core, robot: &str| {
        let (basis, run) = (core.basis(at(150.0)), &core.running[&id::<RobotId>(robot)]);
        (basis.late_s(run), basis.ends_s(run))
    };
    // Nobody is in the bay, but the first can begin no sooner than now, and the second after it.
    assert_eq!(counts(&core, "r0"), (50.0, 600.0));
    assert_eq!(counts(&core, "r1"), (550.0, 1200.0));
    // What has begun ends as it was planned.
    core.running.get_mut(&id::<RobotId>("r0")).unwrap().stage = Stage::Loading;
    assert_eq!(counts(&core, "r0"), (0.0, 550.0));
    assert_eq!(counts(&core, "r1"), (500.0, 1150.0));
}

/// A robot that charges from 100 s to 700 s, and whose gauge shows this power at a time.
fn charges(core: &mut Core, time_s: f64, soc: f64, power_w: f64) {
    let gauge = Gauge { power_w, current_a: power_w / 11.1, temperature_degc: 44.0, ..gauge(time_s, soc, 14.6) };
    core.handle(at(time_s), Input::RobotGauge(id("r0"), gauge));
    says(core, time_s, "r0", RobotPhase::Charging);
}

#[test]
fn who_takes_no_charge_is_let_go_long_after_its_end_and_its_bay_counts_as_taken_until_then() {
    let how = How::Recharge { bay: id("bay-1"), to_soc: 0.98 };
    let mut core = begun(how, Stage::Charging);
    let late_s = core.settings.late_s;
    says(&mut core, 105.0, "r0", RobotPhase::Charging);
    holds(&mut core, 110.0, BayPhase::Occupied, Some("r0"));
    let ends_s = |core: &Core, time_s: f64| {
        let run = &core.running[&id::<RobotId>("r0")];
        core.basis(at(time_s)).ends_s(run)
    };
    charges(&mut core, 300.0, 0.5, 0.0);
    assert_eq!(ends_s(&core, 300.0), 400.0, "a rest is no reason to think otherwise than planned");
    charges(&mut core, 800.0, 0.6, 0.02);
    assert_eq!(ends_s(&core, 800.0), late_s - 100.0);
    charges(&mut core, 810.0, 0.6, -15.0);
    assert!((600.0..3000.0).contains(&ends_s(&core, 810.0)), "who charges again is done when it is full: {}", ends_s(&core, 810.0));

    let asked = |core: &mut Core| {
        let told = std::iter::from_fn(|| core.poll()).filter_map(|output| match output {
            Output::ToRobot(robot, command) => Some((robot, command.action)),
            _ => None,
        });
        told.collect::<Vec<_>>()
    };
    asked(&mut core);
    charges(&mut core, 1000.0, 0.62, 0.0);
    charges(&mut core, 990.0 + late_s, 0.62, 0.0);
    assert_eq!(asked(&mut core), []);
    charges(&mut core, 1000.0 + late_s, 0.62, -15.0);
    charges(&mut core, 1010.0 + late_s, 0.62, 0.0);
    charges(&mut core, 1000.0 + 2.0 * late_s, 0.62, 0.0);
    assert_eq!(asked(&mut core), [], "it is late, and was charged in between");
    charges(&mut core, 1020.0 + 2.0 * late_s, 0.62, 0.0);
    assert_eq!(asked(&mut core), [(id("r0"), proto::RobotAction::Undock)]);
    let run = &core.running[&id::<RobotId>("r0")];
    assert_eq!(run.cut_short.as_deref(), Some("it has taken none for 30 min (its charger gives nothing)"));
}

#[test]
fn a_station_takes_part_from_when_its_packs_are_heard() {
    let mut core = core();
    joins(&mut core, 0.0, 0);
    core.handle(at(61.0), Input::Tick);
    core.handle(at(62.0), Input::StationState(id("s"), ready(62.0)));
    core.handle(at(62.5), Input::Tick);
    let told = core.schedule().unserved[0].reasons.join(" ");
    assert!(told.contains("s takes no part: the gauge of p has not been heard"), "{told}");
    core.handle(at(63.0), Input::PackGauge(id("s"), id("p"), gauge(63.0, 1.0, 84.0)));
    core.handle(at(63.5), Input::Tick);
    assert_eq!((core.schedule().services.len(), core.schedule().trigger.as_str()), (1, "the packs of s are known"));
}
