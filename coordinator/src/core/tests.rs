//! A fleet that is too large to be planned as a whole while somebody waits.

use proto::{BayId, BayPhase, BayState, Estimate, Mission, PackState, RobotPhase, Travel};

use super::*;
use crate::config::Config;
use crate::service_run::{How, Stage};

/// More than are planned as a whole at once.
const ROBOTS: usize = 70;

fn core() -> Core {
    let text = "schema = 1\nsite = \"test\"\n[stations.s]\nload = \"mds-station\"\nload_s = 30\nunload_s = 30\nswap_s = 60\n\
                packs = { p = \"mds-3s4p-7600mah\" }\n";
    let (settings, models) = toml::from_str::<Config>(text).unwrap().load(None).unwrap();
    Core::new(settings, models, Numbering::default())
}

fn id<T: std::str::FromStr<Err: std::fmt::Debug>>(text: &str) -> T {
    text.parse().unwrap()
}

fn at(time_s: f64) -> Timestamp {
    Timestamp::from_unix_ms(1_767_225_600_000).plus_s(time_s)
}

fn gauge(time_s: f64, soc: f64, full_wh: f64) -> Gauge {
    Gauge {
        at: at(time_s),
        seq: (time_s * 1e3) as u64 + 1,
        soc: Estimate::new(soc, 0.01),
        remaining_wh: Estimate::new(soc * full_wh, 0.1),
        full_wh: Estimate::new(full_wh, 0.1),
        time_to_empty_s: None,
        time_to_full_s: None,
        soh: Estimate::new(1.0, 0.01),
        cycles: None,
        voltage_v: 11.1,
        current_a: 0.4,
        temperature_degc: 25.0,
        power_w: 4.3,
        cells_series: 3,
        source: "test".to_owned(),
    }
}

fn joins(core: &mut Core, time_s: f64, n: usize) {
    let robot: RobotId = id(&format!("r{n}"));
    let state = RobotState {
        at: at(time_s),
        seq: (time_s * 1e3) as u64 + 1,
        phase: RobotPhase::Working,
        station: None,
        bay: None,
        drain_w: Estimate::new(4.3, 0.1),
        travel: [(id("s"), Travel { time_s: 60.0, energy_wh: Estimate::new(0.1, 0.01) })].into(),
        mission: Mission { weight: 1.0, until: None },
        battery: "explorer-3s1p-1320mah".to_owned(),
        last_command: None,
        note: None,
    };
    core.handle(at(time_s), Input::RobotState(robot.clone(), state));
    core.handle(at(time_s), Input::RobotGauge(robot, gauge(time_s, 0.3 + 0.005 * n as f64, 14.6)));
}

fn station_joins(core: &mut Core, time_s: f64) {
    let state = StationState {
        at: at(time_s),
        seq: 1,
        bays: vec![BayState { bay: id::<BayId>("bay-1"), phase: BayPhase::Free, robot: None }],
        lift_busy: false,
        swapping: None,
        packs: vec![PackState { pack: id("p"), connected: true, depleted: false }],
        active_pack: Some(id("p")),
        powered: true,
        pack_power_w: 6.0,
        spares: Vec::new(),
        last_command: None,
        note: None,
    };
    core.handle(at(time_s), Input::StationState(id("s"), state));
    core.handle(at(time_s), Input::PackGauge(id("s"), id("p"), gauge(time_s, 1.0, 84.0)));
}

/// The studies that the core has asked for since it was last asked.
fn studies(core: &mut Core) -> usize {
    std::iter::from_fn(|| core.poll()).filter(|output| matches!(output, Output::Study(_))).count()
}

fn tells_of(core: &Core, n: usize) -> bool {
    let robot: RobotId = id(&format!("r{n}"));
    let schedule = core.schedule();
    schedule.services.iter().any(|service| service.robot == robot) || schedule.unserved.iter().any(|unserved| unserved.robot == robot)
}

#[test]
fn who_joins_while_everything_is_about_to_be_planned_anew_is_planned_for_at_once() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    (0..ROBOTS).for_each(|n| joins(&mut core, 0.0, n));
    core.handle(at(61.0), Input::Tick);
    assert_eq!(studies(&mut core), 1);
    core.handle(at(62.0), Input::Studied);
    let period_s = core.settings.replan_period_s;
    let renewed_s = core.renewed.unwrap().seconds_since(at(0.0));

    // So many join just before the next whole plan is due that no other may follow at once, and one just after.
    let due_s = renewed_s + period_s;
    // Nobody has fallen silent by then, which would ask for a plan too.
    (0..ROBOTS).for_each(|n| joins(&mut core, due_s - 2.0, n));
    core.handle(at(due_s - 1.5), Input::Tick);
    studies(&mut core);
    (0..5).for_each(|n| joins(&mut core, due_s - 0.05 + 0.01 * n as f64, ROBOTS + n));
    assert!(tells_of(&core, ROBOTS + 4) && studies(&mut core) == 0);
    core.handle(at(due_s + 0.01), Input::Tick);
    joins(&mut core, due_s + 0.02, ROBOTS + 5);
    assert!(studies(&mut core) == 0 && !tells_of(&core, ROBOTS + 5));
    core.handle(at(due_s + 0.6), Input::Tick);
    assert_eq!(studies(&mut core), 1, "the whole plan is made beside the core");
    assert!(tells_of(&core, ROBOTS + 5), "and nobody waits for it: {}", core.schedule().trigger);
}

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
    }
}

#[test]
fn who_is_found_in_a_bay_is_let_out_though_somebody_is_on_the_way_to_it() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    joins(&mut core, 0.0, 1);
    core.running.insert(id("r1"), waits(1, 100.0));
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
    assert_eq!(core.running.get(&id::<RobotId>("r0")).map(|run| run.stage), Some(Stage::Loading));
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
