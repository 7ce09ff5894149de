//! One hand-written value per message, with numbers that a small fleet would send.

use std::collections::BTreeMap;

use proto::*;

/// Calls `$run!(name, value)` for every message; the name is that of its golden file.
macro_rules! each_message {
    ($run:ident) => {{
        $run!("gauge", $crate::examples::gauge());
        $run!("robot-state", $crate::examples::robot_state());
        $run!("station-state", $crate::examples::station_state());
        $run!("robot-command", $crate::examples::robot_command());
        $run!("station-command", $crate::examples::station_command());
        $run!("command-reply", $crate::examples::command_reply());
        $run!("schedule", $crate::examples::schedule());
        $run!("capacity", $crate::examples::capacity());
        $run!("explanation", $crate::examples::explanation());
        $run!("event", $crate::examples::event());
        $run!("sim-supply", $crate::examples::sim_supply());
        $run!("sim-draw", $crate::examples::sim_draw());
    }};
}
pub(crate) use each_message;

/// Any id from a text that is known to be one.
pub fn id<T: std::str::FromStr<Err = IdError>>(text: &str) -> T {
    text.parse().unwrap()
}

/// `after_s` seconds into 2026.
pub fn at(after_s: i64) -> Timestamp {
    Timestamp::from_unix_ms(1_767_225_600_000 + after_s * 1_000)
}

pub fn gauge() -> Gauge {
    Gauge {
        at: at(0),
        seq: 41,
        soc: Estimate::new(0.42, 0.008),
        remaining_wh: Estimate::new(12.3, 0.31),
        full_wh: Estimate::new(29.1, 0.4),
        time_to_empty_s: Some(Estimate::new(5_270.0, 180.0)),
        time_to_full_s: None,
        soh: Estimate::new(0.93, 0.02),
        cycles: Some(117.4),
        voltage_v: 7.41,
        current_a: 1.13,
        temperature_degc: 27.5,
        power_w: 8.4,
        cells_series: 2,
        source: "sigma-point".to_owned(),
    }
}

pub fn robot_state() -> RobotState {
    let travel = |time_s, energy_wh| Travel { time_s, energy_wh: Estimate::new(energy_wh, 0.05) };
    RobotState {
        at: at(1),
        seq: 42,
        phase: RobotPhase::Travelling,
        station: Some(id("north")),
        bay: Some(id("b1")),
        drain_w: Estimate::new(8.4, 0.6),
        travel: BTreeMap::from([(id("north"), travel(35.0, 0.09)), (id("south"), travel(80.5, 0.21))]),
        mission: Mission { weight: 1.0, until: Some(at(3_600)) },
        battery: "two-cell-rover".to_owned(),
        load: Some(NamedModel { model: "rover.toml".to_owned(), without: vec!["floor".to_owned()] }),
        last_command: Some(id("c7")),
        note: None,
    }
}

pub fn station_state() -> StationState {
    let bay = |bay, phase, robot: Option<&str>| BayState { bay: id(bay), phase, robot: robot.map(id) };
    let pack = |pack, depleted| PackState { pack: id(pack), connected: true, depleted, back: None };
    let away = PackReturn { at: at(1_802), soc: Estimate::new(0.97, 0.01) };
    StationState {
        at: at(2),
        seq: 9,
        bays: vec![bay("b1", BayPhase::Loading, Some("r1")), bay("b2", BayPhase::Free, None)],
        lift_busy: true,
        swapping: None,
        packs: vec![pack("p1", true), pack("p2", false), PackState { connected: false, back: Some(away), ..pack("p3", true) }],
        active_pack: Some(id("p2")),
        powered: true,
        pack_power_w: 31.5,
        arrives: Some(at(302)),
        away: vec![Absence { leaves: at(3_902), returns: Some(at(4_202)) }, Absence { leaves: at(7_802), returns: None }],
        spares: vec![SpareState { spare: id("s1"), soc: Estimate::new(0.98, 0.01), ready: true, battery: None }],
        last_command: Some(id("c8")),
        note: Some("fan of bay b2 is loud".to_owned()),
    }
}

pub fn robot_command() -> RobotCommand {
    Command { id: id("c7"), epoch: 3, at: at(3), deadline: at(63), action: RobotAction::Dock { station: id("north"), bay: Some(id("b1")) } }
}

pub fn station_command() -> StationCommand {
    Command { id: id("c8"), epoch: 3, at: at(4), deadline: at(64), action: StationAction::SwapPack { robot: id("r1"), spare: id("s1") } }
}

pub fn command_reply() -> CommandReply {
    CommandReply {
        id: id("c8"),
        at: at(5),
        outcome: Outcome::Rejected { reason: Rejection::Busy, detail: "the lift is loading r1".to_owned() },
    }
}

fn service(robot: &str, mode: Mode) -> Service {
    Service {
        robot: id(robot),
        station: id("north"),
        mode,
        bay: Some(id("b1")),
        packs: vec![id("p1"), id("p2")],
        leave: at(10),
        start: at(45),
        end: at(2_745),
        pack_energy_wh: Estimate::new(17.9, 0.7),
        probability: Some(0.975),
        status: ServiceStatus::Planned,
        why: ["north is nearest".to_owned()].into(),
    }
}

fn doubt() -> Doubt {
    Doubt {
        robot: Some(id("r2")),
        station: None,
        pack: None,
        since: at(3),
        z: 6.1,
        text: "the battery model of r2 no longer explains its data".to_owned(),
        command: "lab discover --model M --store tender.db --robot r2".to_owned(),
    }
}

pub fn schedule() -> Schedule {
    let swap = Service { bay: None, status: ServiceStatus::Swapping, ..service("r2", Mode::Swap { spare: id("s1") }) };
    Schedule {
        at: at(6),
        plan: 12,
        policy: "least-regret".to_owned(),
        trigger: "r1 joined".to_owned(),
        services: vec![service("r1", Mode::Recharge { to_soc: 0.9 }), swap],
        unserved: vec![Unserved { robot: id("r3"), runs_empty: true, reasons: vec!["north: out of reach by 0.4 Wh".to_owned()] }],
        doubts: vec![doubt()],
        quality: Some(Quality { stranded: 1, stranded_bound: 0, missed_s: 5_400.0, missed_bound_s: 5_280.0, moved: vec![id("r2")] }),
    }
}

fn promises() -> Vec<Promise> {
    vec![
        Promise { robot: Some(id("r1")), part_to_soc: Some(0.63), probability: 0.998, need_wh: Estimate::new(17.9, 0.7) },
        Promise { robot: None, part_to_soc: None, probability: 0.41, need_wh: Estimate::new(35.8, 1.1) },
    ]
}

pub fn capacity() -> Capacity {
    Capacity {
        at: at(7),
        packs: vec![PackCapacity {
            station: id("north"),
            pack: id("p2"),
            remaining_wh: Estimate::new(190.0, 4.0),
            usable_wh: Estimate::new(171.0, 4.5),
            service_wh: Estimate::new(17.9, 0.7),
            breakdown_wh: BTreeMap::from([("conversion".to_owned(), 1.6), ("robot_battery".to_owned(), 16.3)]),
            robots_expected: 9,
            robots_promised: 8,
            confidence: 0.95,
            short_for_next_wh: 1.4,
            lacks_power: false,
            lacks_bay: false,
            lacks_spare: false,
            lacks_right_temperature: false,
            promises: promises(),
        }],
        stations: vec![StationCapacity {
            station: id("north"),
            usable_wh: Estimate::new(171.0, 4.5),
            robots_expected: 9,
            robots_promised: 8,
            short_for_next_wh: 1.4,
            lacks_power: false,
            lacks_bay: false,
            lacks_spare: false,
            lacks_right_temperature: false,
            promises: promises(),
        }],
        robots_expected: 9,
        robots_promised: 8,
        confidence: 0.95,
    }
}

pub fn explanation() -> Explanation {
    Explanation {
        at: at(8),
        robot: id("r1"),
        service: Some(service("r1", Mode::Recharge { to_soc: 0.9 })),
        reasons: vec!["it runs empty first".to_owned()],
        alternatives: vec![Alternative {
            station: id("south"),
            mode: "swap".to_owned(),
            start: None,
            why_not: vec!["no spare is ready".to_owned()],
        }],
        doubts: vec![Doubt { station: Some(id("north")), pack: Some(id("p1")), robot: None, ..doubt() }],
        earlier: vec!["every bay is taken at 10:05, planned for r2".to_owned()],
        changed: vec!["plan 12, because r1 joined: it was given a service".to_owned()],
    }
}

pub fn event() -> Event {
    Event {
        at: at(9),
        seq: 1_000,
        kind: EventKind::PackDepleted,
        robot: None,
        station: Some(id("north")),
        pack: Some(id("p1")),
        text: "pack p1 of north is empty".to_owned(),
    }
}

pub fn sim_supply() -> SimSupply {
    SimSupply { at: at(10), powered: true, exchanged: Some(Estimate::new(0.98, 0.01)), docked: true, charge_w_max: Some(12.0) }
}

pub fn sim_draw() -> SimDraw {
    SimDraw {
        at: at(11),
        charge_power_w: 14.8,
        charge_current_a: 1.85,
        voltage_v: 8.0,
        charging: true,
        left_soc: Some(0.11),
        own_load_w: Some(4.2),
    }
}
