//! Writes `mds-sol-1` files.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::capacity::Capacity;
use crate::instance::Instance;
use crate::plan::Plan;
use crate::way::Mode;

/// Name and version of the format that is written.
pub const FORMAT: &str = "mds-sol-1";

#[derive(Serialize)]
struct File<'a> {
    format: &'static str,
    instance: &'a str,
    solver: &'a str,
    objective: [i64; 4],
    bound: [i64; 4],
    gap: [f64; 4],
    optimal: [bool; 4],
    sessions: Vec<Session>,
    pack_order: BTreeMap<String, Vec<i64>>,
    service_capacity: ServiceCapacity,
    unserved: Vec<Unserved<'a>>,
}

#[derive(Serialize)]
struct Session {
    robot: i64,
    station: i64,
    mode: &'static str,
    start: u32,
    end: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    target: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bay: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    recharge: Option<bool>,
}

#[derive(Serialize)]
struct ServiceCapacity {
    packs: Vec<Alone>,
    atomic_assignment: Vec<[i64; 3]>,
    joint_atomic: usize,
    joint_atomic_bound: usize,
    joint_split: usize,
    joint_split_bound: usize,
}

#[derive(Serialize)]
struct Alone {
    station: i64,
    pack: i64,
    alone: usize,
}

#[derive(Serialize)]
struct Unserved<'a> {
    robot: i64,
    stranded: bool,
    reasons: &'a [String],
}

/// The plan and the capacity as JSON. Beside the keys of the format it has `gap` and `optimal` per
/// level, `end` per session, and `unserved` with reasons.
#[must_use]
pub fn to_json(instance: &Instance, policy: &str, plan: &Plan, capacity: &Capacity) -> String {
    let (robots, stations, packs) = (&instance.robot_ids, &instance.station_ids, &instance.pack_ids);
    let (objective, bound) = (plan.objective.all(), plan.bound.all());
    let mut proven = true;
    let optimal = std::array::from_fn(|level| {
        proven &= objective[level] == bound[level];
        proven
    });
    let session = |session: &crate::plan::Session| Session {
        robot: robots[session.robot],
        station: stations[session.station],
        mode: if matches!(session.mode, Mode::Charge(_)) { "charge" } else { "swap" },
        start: session.start,
        end: session.end,
        target: if let Mode::Charge(level) = session.mode { Some(level) } else { None },
        bay: session.bay,
        recharge: match session.mode {
            Mode::Charge(_) => None,
            Mode::Swap => Some(false),
            Mode::SwapAndRecharge => Some(true),
        },
    };
    let order = plan.pack_order.iter().enumerate();
    let file = File {
        format: FORMAT,
        instance: &instance.problem.name,
        solver: policy,
        objective,
        bound,
        gap: plan.gaps().map(|gap| (gap * 1e6).round() / 1e6),
        optimal,
        sessions: plan.sessions.iter().map(session).collect(),
        pack_order: order.map(|(at, order)| (stations[at].to_string(), order.iter().map(|&pack| packs[at][pack]).collect())).collect(),
        service_capacity: ServiceCapacity {
            packs: capacity.packs.iter().map(|&(at, pack, alone)| Alone { station: stations[at], pack: packs[at][pack], alone }).collect(),
            atomic_assignment: capacity.atomic.iter().map(|&(robot, at, pack)| [robots[robot], stations[at], packs[at][pack]]).collect(),
            joint_atomic: capacity.atomic.len(),
            joint_atomic_bound: capacity.atomic_bound,
            joint_split: capacity.split,
            joint_split_bound: capacity.split_bound,
        },
        unserved: plan
            .unserved
            .iter()
            .map(|one| Unserved { robot: robots[one.robot], stranded: one.stranded, reasons: &one.reasons })
            .collect(),
    };
    serde_json::to_string_pretty(&file).expect("numbers and texts can always be written")
}
