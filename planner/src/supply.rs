//! What a station's packs can give by when, and the fewest packs that cover a load.
//!
//! One pack feeds the station at a time, a switch costs energy, and a pack at the depot comes
//! later. Drained in the order in which they become usable, the packs `U` cover a load exactly if
//! up to every tick t: load before t <= switch cost + sum over the packs of `U` usable before t of
//! (usable - switch cost); the first pack costs no switch. Only ticks in which a pack arrives and
//! the horizon's end need looking at.

use crate::problem::{Problem, Station, Tick};

/// Until a tick the packs can give so much.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limit {
    /// The tick before which the energy is drawn.
    pub before: Tick,
    /// What all packs usable by then give, mWh.
    pub energy: i64,
}

/// A load that the packs do not cover.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shortfall {
    /// Before this tick.
    pub before: Tick,
    /// What is missing, mWh; none when there is no pack at all to begin with.
    pub short: Option<i64>,
}

/// Indices of the packs that can take part, and the one that must be first if all that are there
/// at tick 0 are too empty for a switch to them.
fn eligible(station: &Station, horizon: Tick) -> (Vec<usize>, Option<usize>) {
    let packs = &station.packs;
    let mut usable: Vec<usize> = (0..packs.len())
        .filter(|&pack| packs[pack].usable() >= station.switch_cost && packs[pack].available_from < i64::from(horizon.max(1)))
        .collect();
    usable.sort_by_key(|&pack| (packs[pack].available_from.max(0), -packs[pack].usable(), pack));
    if usable.first().is_some_and(|&pack| packs[pack].available_from <= 0) {
        return (usable, None);
    }
    let weak = (0..packs.len()).filter(|&pack| packs[pack].available_from <= 0);
    (usable, weak.max_by_key(|&pack| (packs[pack].usable(), std::cmp::Reverse(pack))))
}

/// What all the station's packs together can give, by when; empty when none is there at tick 0 and one must be.
#[must_use]
pub fn limits(station: &Station, horizon: Tick) -> Vec<Limit> {
    let (usable, weak) = eligible(station, horizon);
    let none_at_start = usable.first().is_none_or(|&pack| station.packs[pack].available_from > 0);
    // A station that may go dark waits for the first.
    if none_at_start && weak.is_none() && station.chance.is_none() {
        return Vec::new();
    }
    let arrivals = usable.iter().map(|&pack| station.packs[pack].available_from).filter(|&from| from > 0);
    let mut ends: Vec<Tick> = arrivals.map(|from| from as Tick).chain([horizon]).collect();
    ends.sort_unstable();
    ends.dedup();
    let until = |before: Tick| -> i64 {
        let there = usable.iter().copied().chain(weak).filter(|&pack| station.packs[pack].available_from < i64::from(before.max(1)));
        station.switch_cost + there.map(|pack| station.packs[pack].usable() - station.switch_cost).sum::<i64>()
    };
    ends.into_iter().map(|before| Limit { before, energy: until(before) }).collect()
}

/// Indices of the fewest packs that cover a load, in the order in which they are drained.
///
/// `drawn(t)` is the load before tick t, mWh. Whenever the packs taken so far run short, the
/// largest that is there by then is taken: any cover takes one of these, and the largest serves
/// every later tick at least as well.
///
/// # Errors
/// Where the packs run short even if all are used.
pub fn fewest_packs(station: &Station, horizon: Tick, drawn: impl Fn(Tick) -> i64) -> Result<Vec<usize>, Shortfall> {
    let (mut free, weak) = eligible(station, horizon);
    let first = weak.or_else(|| free.iter().copied().find(|&pack| station.packs[pack].available_from <= 0));
    let Some(first) = first else { return Err(Shortfall { before: 1, short: None }) };
    free.retain(|&pack| pack != first);
    let mut taken = vec![first];
    let mut given = station.packs[first].usable();
    for limit in limits(station, horizon) {
        while drawn(limit.before) > given {
            let there = free.iter().copied().filter(|&pack| station.packs[pack].available_from < i64::from(limit.before.max(1)));
            let largest = there.max_by_key(|&pack| (station.packs[pack].usable(), std::cmp::Reverse(pack)));
            let short = drawn(limit.before) - given;
            let largest = largest.ok_or(Shortfall { before: limit.before, short: Some(short) })?;
            free.retain(|&pack| pack != largest);
            given += station.packs[largest].usable() - station.switch_cost;
            taken.push(largest);
        }
    }
    taken[1..].sort_by_key(|&pack| (station.packs[pack].available_from.max(0), -station.packs[pack].usable(), pack));
    if weak.is_none() {
        taken.sort_by_key(|&pack| (station.packs[pack].available_from.max(0), -station.packs[pack].usable(), pack));
    }
    Ok(taken)
}

/// Why no plan at all is possible: what the stations hold by themselves already asks too much.
/// One sentence for every station that fails. A station that may go dark never does.
#[must_use]
pub fn impossible(problem: &Problem) -> Vec<String> {
    let fed = problem.stations.iter().filter(|station| station.chance.is_none());
    fed.filter_map(|station| impossible_station(problem, station)).collect()
}

fn impossible_station(problem: &Problem, station: &Station) -> Option<String> {
    let (load, name) = (problem.base_load(station), &station.name);
    let mut drawn = vec![0];
    for tick in &load {
        drawn.push(drawn.last().copied().unwrap_or(0) + tick);
    }
    match fewest_packs(station, problem.horizon, |before| drawn[before as usize]) {
        Err(Shortfall { short: None, .. }) => return Some(format!("station {name} has no pack on line at tick 0, so nothing feeds it")),
        Err(Shortfall { before, short: Some(short) }) => {
            return Some(format!(
                "station {name}: its own load and the charges that have begun take {} mWh before tick {before}, \
                 and its packs are {short} mWh short of that",
                drawn[before as usize]
            ));
        }
        Ok(_) => {}
    }
    if let Some(tick) = load.iter().position(|&draw| draw > station.p_max) {
        return Some(format!("station {name} draws {} mWh in tick {tick} without any service, and may draw {}", load[tick], station.p_max));
    }
    let lifting = |tick: Tick| {
        station.ongoing.iter().filter(|ongoing| (ongoing.until.saturating_sub(ongoing.unload_ticks)..ongoing.until).contains(&tick)).count()
    };
    let tick = (0..problem.horizon).find(|&tick| lifting(tick) as i64 > station.lift_slots)?;
    Some(format!(
        "station {name}: charges that have begun need the lift {} times in tick {tick}, it has {}",
        lifting(tick),
        station.lift_slots
    ))
}
