//! Why a robot has no service, in words that name what would have to change.

use crate::book::Clash;
use crate::draft::Draft;
use crate::problem::{Problem, Robot, Travel};

/// Ways at a station that a reason looks at.
const LOOKED_AT: usize = 64;

/// The reasons, one for each station in reach if there is any.
#[must_use]
pub fn why_not(draft: &Draft<'_, '_>, robot: usize) -> Vec<String> {
    let problem = draft.problem();
    let (who, choices) = (&problem.robots[robot], draft.ways.of(robot));
    if !choices.strands && choices.unserved_cost == 0 {
        return vec!["needs none: it works to the end of its mission".to_owned()];
    }
    if who.travel.is_empty() {
        return vec!["no station is in reach".to_owned()];
    }
    if choices.ways.is_empty() && !choices.strands {
        return vec!["a service would cost more work than it gives".to_owned()];
    }
    who.travel
        .iter()
        .map(|travel| format!("station {}: {}", problem.stations[travel.station].name, at_station(draft, robot, travel)))
        .collect()
}

fn at_station(draft: &Draft<'_, '_>, robot: usize, travel: &Travel) -> String {
    let (problem, choices) = (draft.problem(), draft.ways.of(robot));
    let who = &problem.robots[robot];
    let book = &draft.books[travel.station];
    let mut ways = choices.ways.iter().filter(|way| usize::from(way.station) == travel.station).take(LOOKED_AT).peekable();
    if ways.peek().is_none() {
        return no_way(problem, who, travel);
    }
    // The way that comes closest: the least severe lack of its cheapest ways tells most.
    let mut count = 0;
    let mut nearest: Option<(Clash, u16)> = None;
    for way in ways {
        count += 1;
        match book.clash(choices, way) {
            None => {
                return format!("could be serviced from tick {} at a cost of {} against {}", way.start, way.cost, choices.unserved_cost);
            }
            Some(clash) if nearest.is_none_or(|(least, _)| severity(clash) < severity(least)) => nearest = Some((clash, way.start)),
            Some(_) => {}
        }
    }
    let (clash, start) = nearest.expect("at least one way");
    format!("none of its {count} best ways is free; from tick {start}, {}", told(clash))
}

fn no_way(problem: &Problem, who: &Robot, travel: &Travel) -> String {
    let station = &problem.stations[travel.station];
    let endurance = who.endurance(problem.battery.floor);
    if i64::from(travel.ticks) > endurance || who.energy - who.drain_hi * i64::from(travel.ticks) < problem.battery.floor {
        return format!("it is {} ticks away, and the robot may be empty in {endurance}", travel.ticks);
    }
    if station.bays == 0 && station.spares.is_empty() {
        return "it has neither bay nor spare".to_owned();
    }
    if who.strands(problem) {
        return format!("no service of at least {} mWh ends by tick {}", problem.battery.min_gain, problem.horizon);
    }
    "a service there would cost more work than it gives".to_owned()
}

/// What a lack amounts to: waiting for a place is less than energy that nobody has.
fn severity(clash: Clash) -> (u8, i64) {
    match clash {
        Clash::Lift(_) => (0, 0),
        Clash::Slot(_) => (1, 0),
        Clash::Power(_, short) => (2, short),
        Clash::Bay(_) => (3, 0),
        Clash::Spare(_) => (4, 0),
        Clash::Energy(_, short) => (5, short),
    }
}

/// A lack in words.
#[must_use]
pub fn told(clash: Clash) -> String {
    match clash {
        Clash::Bay(tick) => format!("all bays are taken in tick {tick}"),
        Clash::Lift(tick) => format!("the lift is taken in tick {tick}"),
        Clash::Slot(tick) => format!("the place for exchanges is taken in tick {tick}"),
        Clash::Spare(tick) => format!("no charged spare is left in tick {tick}"),
        Clash::Power(tick, short) => format!("the station may not draw {short} mWh more in tick {tick}"),
        Clash::Energy(before, short) => format!("the packs are {short} mWh short before tick {before}"),
    }
}
