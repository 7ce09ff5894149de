//! A coordinator that starts where another has promised something.

use proto::{Mode, Service, ServiceStatus};

use super::*;

/// A service at `s` that the coordinator before had planned until then.
fn service(robot: &str, to_soc: f64, end_s: f64) -> Service {
    Service {
        robot: id(robot),
        station: id("s"),
        mode: Mode::Recharge { to_soc },
        bay: Some(id("bay-1")),
        packs: vec![id("p")],
        leave: at(-200.0),
        start: at(-100.0),
        end: at(end_s),
        pack_energy_wh: Estimate::new(12.0, 1.0),
        probability: Some(0.97),
        status: ServiceStatus::Planned,
        why: [].into(),
    }
}

/// A core that was told of these, and then hears of a robot that charges in the bay.
fn takes_over(services: Vec<Service>) -> Core {
    let mut core = core();
    let schedule = Schedule { services, ..core.schedule().clone() };
    core.handle(at(0.0), Input::Before(Arc::new(schedule)));
    joins(&mut core, 0.0, 0);
    let charges =
        RobotState { phase: RobotPhase::Charging, station: Some(id("s")), bay: Some(id("bay-1")), seq: 2000, ..working(1.0, &["s"]) };
    core.handle(at(1.0), Input::RobotState(id("r0"), charges));
    let bays = vec![BayState { bay: id("bay-1"), phase: BayPhase::Occupied, robot: Some(id("r0")) }];
    core.handle(at(1.0), Input::StationState(id("s"), StationState { bays, ..ready(1.0) }));
    core.handle(at(1.0), Input::PackGauge(id("s"), id("p"), gauge(1.0, 1.0, 84.0)));
    core
}

#[test]
fn a_charge_that_goes_on_ends_where_it_was_promised() {
    for (before, to_soc) in [
        (vec![service("r0", 0.8, 1800.0)], 0.8),
        // It should have been over for longer than anybody is waited for: that was another one.
        (vec![service("r0", 0.8, -7200.0)], 0.98),
        // Planned with a clock that was years ahead.
        (vec![service("r0", 0.8, 1e8)], 0.98),
        (vec![service("r1", 0.8, 1800.0)], 0.98),
        (Vec::new(), 0.98),
    ] {
        let mut core = takes_over(before);
        core.handle(at(2.0), Input::Tick);
        let How::Recharge { to_soc: taken, .. } = core.running[&id::<RobotId>("r0")].how else { panic!() };
        assert_eq!(taken, to_soc);
        core.handle(at(3.0), Input::Tick);
        let told = std::iter::from_fn(|| core.poll()).find_map(|output| match output {
            Output::ToRobot(_, command) => Some(command.action),
            _ => None,
        });
        assert_eq!(told, Some(proto::RobotAction::ChargeTo { soc: to_soc }));
    }
}

#[test]
fn what_was_promised_before_holds_until_that_is_done() {
    let mut core = takes_over(vec![service("r0", 0.8, 1800.0)]);
    core.handle(at(2.0), Input::Tick);
    let promised_soc = |core: &Core| core.promised_soc(at(2.0), &id("r0"), &id("s"));
    // Also once a plan was made: it is in its bay, and no plan is about it.
    assert_eq!((core.schedule().plan, promised_soc(&core)), (1, Some(0.8)));
    core.done(at(2.0), &id("r0"));
    assert_eq!(promised_soc(&core), None, "the next time it is charged is another time");
}

#[test]
fn a_promise_of_the_coordinator_before_is_kept_or_told_to_be_broken() {
    // The one in the bay keeps it; of those at work one is full, and one would have been taken in now and is far away.
    let mut core = takes_over(vec![service("r0", 0.8, 1800.0), service("r1", 0.9, 3000.0), service("r2", 0.9, 5000.0)]);
    core.handle(at(2.0), Input::RobotState(id("r1"), working(2.0, &["s"])));
    core.handle(at(2.0), Input::RobotGauge(id("r1"), gauge(2.0, 1.0, 14.6)));
    core.handle(at(2.0), Input::RobotState(id("r2"), working(2.0, &[])));
    core.handle(at(2.0), Input::RobotGauge(id("r2"), gauge(2.0, 0.2, 14.6)));
    (3..20).for_each(|tick| core.handle(at(f64::from(tick)), Input::Tick));
    core.handle(at(20.0), Input::Replan("asked".to_owned()));
    let broken: Vec<_> = std::iter::from_fn(|| core.poll())
        .filter_map(|output| match output {
            Output::Record(Record::Event(event)) if event.kind == EventKind::PromiseBroken => event.robot,
            _ => None,
        })
        .collect();
    assert_eq!(broken, [id::<RobotId>("r2")], "{:?}", core.schedule());
    assert!(core.promised.contains(&id::<RobotId>("r0")) && !core.promised.contains(&id::<RobotId>("r2")), "{:?}", core.promised);
    // Should it not be serviced when it needs to be, some day, that breaks no promise.
    let is_planned = core.schedule().services.iter().any(|service| service.robot == id("r1"));
    assert_eq!(core.promised.contains(&id::<RobotId>("r1")), is_planned);
}

#[test]
fn who_is_on_its_way_to_an_exchange_that_was_promised_gets_it() {
    let mut core = core();
    let promised = Service { mode: Mode::Swap { spare: id("spare-1") }, bay: None, ..service("r0", 0.98, 1800.0) };
    core.handle(at(0.0), Input::Before(Arc::new(Schedule { services: vec![promised], ..core.schedule().clone() })));
    joins(&mut core, 0.0, 0);
    let travels = RobotState { phase: RobotPhase::Travelling, station: Some(id("s")), seq: 2000, ..working(1.0, &["s"]) };
    core.handle(at(1.0), Input::RobotState(id("r0"), travels));
    let spare = SpareState { spare: id("spare-1"), soc: Estimate::new(0.9, 0.01), ready: true, battery: None };
    core.handle(at(1.0), Input::StationState(id("s"), StationState { spares: vec![spare], ..ready(1.0) }));
    core.handle(at(1.0), Input::PackGauge(id("s"), id("p"), gauge(1.0, 1.0, 84.0)));
    let settled_s = core.settings.deadline_s + core.settings.resend_s + 2.0;
    [2.0, settled_s, settled_s + 2.0].into_iter().for_each(|time_s| core.handle(at(time_s), Input::Tick));
    let run = &core.running[&id::<RobotId>("r0")];
    assert_eq!((&run.how, run.stage), (&How::Swap { spare: id("spare-1") }, Stage::Travelling));
    let broken = |output| matches!(output, Output::Record(Record::Event(event)) if event.kind == EventKind::PromiseBroken);
    assert!(!std::iter::from_fn(|| core.poll()).any(broken));
    // What was given up is not taken up again, though the robot still says that it travels.
    core.fail(at(settled_s + 3.0), &id("r0"), "it is stuck");
    (1..60).for_each(|n| core.handle(at(settled_s + 3.0 + f64::from(n)), Input::Tick));
    assert!(!core.running.contains_key(&id::<RobotId>("r0")));
}

#[test]
fn who_charges_somewhere_by_itself_is_not_told_to_run_empty() {
    let stuck = |station: &str, powered: bool| {
        let mut core = core();
        joins(&mut core, 0.0, 0);
        let own = RobotState { phase: RobotPhase::Charging, station: Some(id(station)), seq: 2000, ..working(1.0, &["s"]) };
        core.handle(at(1.0), Input::RobotState(id("r0"), own));
        core.handle(at(1.0), Input::StationState(id("s"), StationState { powered, ..ready(1.0) }));
        core.handle(at(1.0), Input::PackGauge(id("s"), id("p"), gauge(1.0, 1.0, 84.0)));
        core.handle(at(3.0), Input::Tick);
        let told: Vec<bool> = core.schedule().unserved.iter().map(|unserved| unserved.runs_empty).collect();
        told
    };
    assert_eq!([stuck("elsewhere", true), stuck("s", true), stuck("s", false)], [vec![false], vec![false], vec![true]]);
}

#[test]
fn what_was_planned_before_is_moved_for_no_little_gain() {
    let starts = |promised: Option<f64>| {
        let mut core = core();
        let service = |start_s: f64| Service { leave: at(start_s - 60.0), start: at(start_s), ..service("r0", 0.98, start_s + 3000.0) };
        let services = promised.map(service).into_iter().collect();
        core.handle(at(0.0), Input::Before(Arc::new(Schedule { services, ..core.schedule().clone() })));
        station_joins(&mut core, 1.0);
        core.handle(at(2.0), Input::Tick);
        // Nobody is configured, and yet the first plan waits for whom it was promised.
        assert_eq!(core.schedule().plan == 0, promised.is_some());
        joins(&mut core, 3.0, 0);
        core.handle(at(4.0), Input::Tick);
        core.schedule().services.iter().map(|service| service.start.seconds_since(at(0.0))).collect::<Vec<f64>>()
    };
    let wanted_s = starts(None)[0];
    // By default moving a promise takes two minutes that are saved, of work and of lateness.
    assert_eq!(starts(Some(wanted_s + 40.0)), [wanted_s + 40.0]);
    assert_eq!(starts(Some(wanted_s + 600.0)), [wanted_s]);
}
