//! A fleet that is too large to be planned as a whole while somebody waits.

mod before;
mod capacity;
mod joining;
mod packs;
mod page;
mod services;

use proto::{
    BayId, BayPhase, BayState, Estimate, Gauge, Mission, PackState, RobotPhase, RobotState, SpareId, SpareState, StationState, Travel,
};

use super::*;
use crate::config::Config;
use crate::models::from_wire;
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
    core.handle(at(time_s), Input::RobotState(robot.clone(), working(time_s, &["s"])));
    core.handle(at(time_s), Input::RobotGauge(robot, gauge(time_s, 0.3 + 0.005 * n as f64, 14.6)));
}

/// A robot at work a minute from these stations.
fn working(time_s: f64, stations: &[&str]) -> RobotState {
    let travel = |station: &&str| (id(station), Travel { time_s: 60.0, energy_wh: Estimate::new(0.1, 0.01) });
    RobotState {
        at: at(time_s),
        seq: (time_s * 1e3) as u64 + 1,
        phase: RobotPhase::Working,
        station: None,
        bay: None,
        drain_w: Estimate::new(4.3, 0.1),
        travel: stations.iter().map(travel).collect(),
        mission: Mission { weight: 1.0, until: None },
        battery: "explorer-3s1p-1320mah".to_owned(),
        load: None,
        last_command: None,
        note: None,
    }
}

fn station_joins(core: &mut Core, time_s: f64) {
    core.handle(at(time_s), Input::StationState(id("s"), ready(time_s)));
    core.handle(at(time_s), Input::PackGauge(id("s"), id("p"), gauge(time_s, 1.0, 84.0)));
}

/// A station with a bay and a pack.
fn ready(time_s: f64) -> StationState {
    StationState {
        at: at(time_s),
        seq: 1,
        bays: vec![BayState { bay: id::<BayId>("bay-1"), phase: BayPhase::Free, robot: None }],
        lift_busy: false,
        swapping: None,
        packs: vec![PackState { pack: id("p"), connected: true, depleted: false, back: None }],
        active_pack: Some(id("p")),
        powered: true,
        pack_power_w: 6.0,
        arrives: None,
        away: Vec::new(),
        spares: Vec::new(),
        last_command: None,
        note: None,
    }
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
