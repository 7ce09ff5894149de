//! Reads `mds-inst-1` files: raw text, then the checks, then a [`Problem`].

mod raw;

use std::collections::BTreeMap;

use crate::problem::{Battery, Charger, Critical, LeftPacks, Ongoing, Pack, Problem, Robot, Segment, Spare, Station, Tick, Travel};

/// Name and version of the format that is read.
pub const FORMAT: &str = "mds-inst-1";

/// Longest horizon, ticks.
const HORIZON_MAX: i64 = 20_000;
/// Greatest energy, mWh.
const ENERGY_MAX: i64 = 10_000_000_000;
/// Units of energy of the format in a Wh: mWh.
const MWH_PER_WH: i64 = 1000;
/// Greatest worth of all the work of one robot.
const WORTH_MAX: i64 = 1_000_000_000;

/// A problem and the numbers by which its file names things.
#[derive(Debug, Clone, PartialEq)]
pub struct Instance {
    /// The problem.
    pub problem: Problem,
    /// Of each robot, by index.
    pub robot_ids: Vec<i64>,
    /// Of each station, by index.
    pub station_ids: Vec<i64>,
    /// Of each station's packs, by index.
    pub pack_ids: Vec<Vec<i64>>,
}

/// What is wrong in an instance.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InstanceError {
    /// It is not JSON, or a field is missing, unknown or of the wrong kind.
    #[error("line {line}, column {column}: {what}")]
    Text {
        /// Counted from 1.
        line: usize,
        /// Counted from 1.
        column: usize,
        /// What, and what was probably meant.
        what: String,
    },
    /// A number is outside its range.
    #[error("{place} is {value}, allowed are {allowed}")]
    Range {
        /// Which one.
        place: String,
        /// What it is.
        value: i64,
        /// What it may be.
        allowed: String,
    },
    /// Parts contradict each other.
    #[error("{place}: {what}")]
    Contradiction {
        /// Where.
        place: String,
        /// What, and what would do.
        what: String,
    },
}

impl Instance {
    /// Reads an instance.
    ///
    /// # Errors
    /// With the place, what stands there, and what is allowed.
    pub fn parse(text: &str) -> Result<Self, InstanceError> {
        let wrong = |error: &serde_json::Error, place: &str| InstanceError::Text {
            line: error.line(),
            column: error.column(),
            what: place.to_owned() + &raw::explain(&error.to_string()),
        };
        let mut reader = serde_json::Deserializer::from_str(text);
        let raw = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
            let place = error.path().to_string();
            let place = if place.chars().any(char::is_alphanumeric) { format!("{place}: ") } else { String::new() };
            wrong(error.inner(), &place)
        })?;
        reader.end().map_err(|error| wrong(&error, ""))?;
        checked(raw)
    }
}

fn range(place: impl Into<String>, value: i64, from: i64, to: i64) -> Result<i64, InstanceError> {
    if (from..=to).contains(&value) {
        return Ok(value);
    }
    Err(InstanceError::Range { place: place.into(), value, allowed: format!("{from} to {to}") })
}

fn contradiction<T>(place: impl Into<String>, what: impl Into<String>) -> Result<T, InstanceError> {
    Err(InstanceError::Contradiction { place: place.into(), what: what.into() })
}

/// Indices by id, each id once.
fn indices(kind: &str, ids: &[i64]) -> Result<BTreeMap<i64, usize>, InstanceError> {
    let mut found = BTreeMap::new();
    for (index, &id) in ids.iter().enumerate() {
        if let Some(first) = found.insert(id, index) {
            return contradiction(format!("{kind} {id}"), format!("number {} and number {} have the same id", first + 1, index + 1));
        }
    }
    Ok(found)
}

fn checked(raw: raw::Instance) -> Result<Instance, InstanceError> {
    if raw.format != FORMAT {
        return contradiction("format", format!("{:?} cannot be read, {FORMAT:?} can", raw.format));
    }
    let horizon = range("horizon", raw.horizon, 0, HORIZON_MAX)?;
    let battery = battery(&raw.battery)?;
    let targets = battery.targets.len() as i64;
    let capacity_target = range("capacity_target", raw.capacity_target, 0, (targets - 1).max(0))? as usize;
    let station_ids: Vec<i64> = raw.stations.iter().map(|station| station.id).collect();
    let robot_ids: Vec<i64> = raw.robots.iter().map(|robot| robot.id).collect();
    range("number of stations", station_ids.len() as i64, 0, i64::from(u16::MAX))?;
    let by_id = indices("station", &station_ids)?;
    indices("robot", &robot_ids)?;
    let mut stations = Vec::new();
    for raw in &raw.stations {
        stations.push(station(raw, horizon)?);
    }
    let mut robots = Vec::new();
    for raw in &raw.robots {
        robots.push(robot(raw, &by_id, horizon, battery.capacity)?);
    }
    let pack_ids = raw.stations.iter().map(|station| station.packs.iter().map(|pack| pack.id).collect()).collect();
    let tick_s = range("tick_s", raw.tick_s, 1, 86_400)? as u32;
    let problem = Problem {
        name: raw.name,
        tick_s,
        horizon: horizon as Tick,
        units_per_wh: MWH_PER_WH,
        capacity_target,
        batteries: vec![battery],
        stations,
        robots,
    };
    Ok(Instance { problem, robot_ids, station_ids, pack_ids })
}

fn battery(raw: &raw::Battery) -> Result<Battery, InstanceError> {
    let capacity = range("battery.capacity", raw.capacity, 1, ENERGY_MAX)?;
    let floor = range("battery.floor", raw.floor, 0, capacity)?;
    let min_gain = range("battery.min_gain", raw.min_gain, 0, capacity)?;
    let mut curve: Vec<Segment> = Vec::new();
    for (place, segment) in raw.curve.iter().enumerate() {
        let name = |field: &str| format!("battery.curve[{place}].{field}");
        let above = curve.last().map_or(0, |last| last.below);
        if above >= capacity {
            return contradiction("battery.curve", format!("its entry {place} begins at {above}, and the capacity is {capacity}"));
        }
        let gain = range(name("gain"), segment.gain, 1, capacity)?;
        curve.push(Segment {
            below: range(name("below"), segment.below, above + 1, capacity)?,
            gain,
            gain_bare: gain,
            draw: range(name("draw"), segment.draw, 0, ENERGY_MAX)?,
            draw_bare: range(name("draw_bare"), segment.draw_bare, 0, ENERGY_MAX)?,
        });
    }
    let full = curve.last().map_or(0, |last| last.below);
    if full != capacity {
        return contradiction("battery.curve", format!("it ends at {full}; the last \"below\" must be the capacity, {capacity}"));
    }
    let mut last = 0;
    for (place, &target) in raw.targets.iter().enumerate() {
        last = range(format!("battery.targets[{place}]"), target, last, capacity)?;
    }
    range("number of battery.targets", raw.targets.len() as i64, 1, 250)?;
    let swap_energy = range("battery.swap_energy", raw.swap_energy, 0, capacity)?;
    Ok(Battery {
        capacity,
        floor,
        min_gain,
        targets: raw.targets.clone(),
        chargers: vec![Charger { swap_energy, again_energy: swap_energy, curve, owed: Vec::new() }],
    })
}

fn station(raw: &raw::Station, horizon: i64) -> Result<Station, InstanceError> {
    let at = |field: &str| format!("station {}: {field}", raw.id);
    let energy = |field: &str, value| range(at(field), value, 0, ENERGY_MAX);
    let ticks = |field: &str, value| range(at(field), value, 0, HORIZON_MAX).map(|ticks| ticks as Tick);
    let ids: Vec<i64> = raw.packs.iter().map(|pack| pack.id).collect();
    indices(&at("pack"), &ids)?;
    let mut packs = Vec::new();
    for pack in &raw.packs {
        packs.push(Pack {
            name: pack.id.to_string(),
            remaining: energy(&format!("pack {}: remaining", pack.id), pack.remaining)?,
            reserve: energy(&format!("pack {}: reserve", pack.id), pack.reserve)?,
            available_from: pack.available_from,
        });
    }
    let mut spares = Vec::new();
    for (place, &ready) in raw.spares.iter().enumerate() {
        spares.push(Spare { ready: range(at(&format!("spares[{place}]")), ready, 0, i64::from(Tick::MAX))? as Tick, kind: 0 });
    }
    let bays = range(at("bays"), raw.bays, 0, 10_000)?;
    let mut ongoing: Vec<Ongoing> = Vec::new();
    for (place, session) in raw.ongoing.iter().enumerate() {
        let name = |field: &str| at(&format!("ongoing[{place}].{field}"));
        if bays == 0 {
            return contradiction(at("ongoing"), "a charge is under way, but there is no bay");
        }
        let bay = range(name("bay"), session.bay, 0, bays - 1)? as u32;
        if ongoing.iter().any(|other| other.bay == Some(bay)) {
            return contradiction(name("bay"), format!("bay {bay} holds two charges at once; each may hold one"));
        }
        ongoing.push(Ongoing {
            bay: Some(bay),
            from: 0,
            load_ticks: 0,
            until: range(name("until"), session.until, 0, i64::from(Tick::MAX))? as Tick,
            draw: range(name("draw"), session.draw, 0, ENERGY_MAX)?,
            unload_ticks: range(name("unload_ticks"), session.unload_ticks, 0, horizon.max(HORIZON_MAX))? as Tick,
        });
    }
    Ok(Station {
        name: raw.id.to_string(),
        charger: 0,
        opens: 0,
        away: Vec::new(),
        away_slack: 0,
        bays: bays as u32,
        lift_slots: range(at("lift_slots"), raw.lift_slots, 0, 10_000)?,
        swap_slots: range(at("swap_slots"), raw.swap_slots, 0, 10_000)?,
        hotel: energy("hotel", raw.hotel)?,
        p_max: energy("p_max", raw.p_max)?,
        switch_cost: energy("switch_cost", raw.switch_cost)?,
        load_ticks: ticks("load_ticks", raw.load_ticks)?,
        load_draw: energy("load_draw", raw.load_draw)?,
        unload_ticks: ticks("unload_ticks", raw.unload_ticks)?,
        unload_draw: energy("unload_draw", raw.unload_draw)?,
        swap_ticks: ticks("swap_ticks", raw.swap_ticks)?,
        swap_draw: energy("swap_draw", raw.swap_draw)?,
        spares,
        left_packs: LeftPacks::AsPlanned,
        packs,
        ongoing,
        chance: None,
    })
}

fn robot(raw: &raw::Robot, stations: &BTreeMap<i64, usize>, horizon: i64, capacity: i64) -> Result<Robot, InstanceError> {
    let at = |field: &str| format!("robot {}: {field}", raw.id);
    let mission_end = range(at("mission_end"), raw.mission_end, 0, 1_000_000)?;
    let drain_max = ENERGY_MAX / horizon.max(1);
    let drain = range(at("drain"), raw.drain, 0, drain_max)?;
    let weight = range(at("weight"), raw.weight, 0, WORTH_MAX)?;
    let critical_weight = range(at("critical_weight"), raw.critical_weight, 0, WORTH_MAX)?;
    range(at("weight and critical_weight over all ticks of the mission"), (weight + critical_weight) * mission_end, 0, WORTH_MAX)?;
    if let Some((from, to)) = raw.critical.filter(|(from, to)| from > to) {
        return contradiction(at("critical"), format!("it ends at {to}, before it begins at {from}"));
    }
    let (mut travel, mut beyond): (Vec<Travel>, Vec<Travel>) = (Vec::new(), Vec::new());
    let mut named = vec![false; stations.len()];
    for &(id, ticks) in &raw.travel {
        let Some(&station) = stations.get(&id) else {
            let nearest = stations.keys().min_by_key(|&&known| known.abs_diff(id));
            let hint = nearest.map_or_else(|| "there is none".to_owned(), |near| format!("the nearest id is {near}"));
            return contradiction(at("travel"), format!("no station has the id {id}; {hint}"));
        };
        if std::mem::replace(&mut named[station], true) {
            return contradiction(at("travel"), format!("station {id} is named twice"));
        }
        let ticks = range(at(&format!("travel time to station {id}")), ticks, 0, i64::from(Tick::MAX))?;
        let list = if ticks < horizon { &mut travel } else { &mut beyond };
        list.push(Travel { station, ticks: ticks as Tick, extra: 0, extra_hi: 0, variance: 0.0, spares: Some(0) });
    }
    Ok(Robot {
        name: raw.id.to_string(),
        battery: 0,
        not_before: 0,
        wanted: None,
        held: false,
        lowest_target: 0,
        energy: range(at("energy"), raw.energy, 0, capacity)?,
        drain,
        drain_hi: range(at("drain_hi"), raw.drain_hi, drain.max(1), drain_max)?,
        drain_served: raw.drain_hi,
        mission_end,
        weight,
        // What lies outside the mission is missed by nobody.
        critical: raw.critical.map(|(from, to)| Critical {
            from: from.clamp(0, mission_end),
            to: to.clamp(0, mission_end),
            weight: critical_weight,
        }),
        travel,
        beyond,
    })
}
