//! Why a robot has no service: what stands in the way at each station, and the same in words.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;

use crate::book::Clash;
use crate::draft::Draft;
use crate::problem::{Problem, Robot, Station, Tick, Travel};
use crate::way::{Mode, Way, Ways, has_any_way};

/// Best ways of one kind at a station that a reason looks at.
const LOOKED_AT: usize = 64;
/// So many of the others, evenly among them: what lacks least may be far from best, such as a service hours early, that takes less.
const OTHERS: usize = 64;

/// What stands in the way of servicing a robot at a station.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Obstacle {
    /// Index of the station.
    pub station: usize,
    /// What.
    pub why: Why,
}

/// What stands in the way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Why {
    /// The robot may be empty before it is there.
    TooFar {
        /// Ticks to the station.
        away: Tick,
        /// The last tick in which it has enough for the way and until it is served; below zero where it never has.
        last: i64,
    },
    /// The robot may be empty before the station is where it takes robots in.
    NotThere {
        /// Ticks until it is.
        opens: Tick,
        /// The last tick in which it has enough for the way and until it is served; below zero where it never has.
        last: i64,
    },
    /// It has neither bay nor spare.
    NoPlace,
    /// It has no bay, and spares that do not fit the robot.
    NoFit,
    /// It is away again before any service there would have ended, and back too late for any other.
    Leaves {
        /// When for the first time after the robot could have come.
        away: Range<Tick>,
    },
    /// No service that adds enough ends within the horizon.
    TooLate {
        /// What it must add.
        min_gain: i64,
        /// The end of the horizon.
        horizon: Tick,
    },
    /// A service there would cost more work than it gives.
    Pointless,
    /// It could be serviced, and is not because that is worth less than what else is planned.
    Free {
        /// From when.
        start: Tick,
        /// What that would cost.
        cost: i32,
        /// What no service costs.
        unserved: i32,
    },
    /// Something is taken, or energy is short, whichever of its ways is looked at.
    Taken {
        /// When the service that comes closest would begin.
        start: Tick,
        /// How it would be serviced.
        mode: Mode,
        /// How many ways were looked at.
        ways: usize,
        /// All that is missing for it, at least one thing: with that, and all others as planned, it could have this service.
        lacks: Vec<Clash>,
    },
}

/// What stands in the way of a robot at every station in reach.
#[must_use]
pub fn obstacles(draft: &Draft<'_, '_>, robot: usize) -> Vec<Obstacle> {
    let who = &draft.problem().robots[robot];
    who.travel.iter().map(|travel| Obstacle { station: travel.station, why: at_station(draft, robot, travel) }).collect()
}

/// Whether packs could pay for a service of the robot, and only a place to have it in is missing, or that it may come earlier or leave with less.
#[must_use]
pub fn wants_place(draft: &Draft<'_, '_>, robot: usize) -> bool {
    let (choices, who) = (draft.ways.of(robot), &draft.problem().robots[robot]);
    let is_shut_out = choices.ways.is_empty() && !who.travel.is_empty() && (who.not_before > 0 || who.lowest_target > 0);
    is_shut_out || choices.ways.iter().any(|way| draft.books[usize::from(way.station)].feeds(choices, way))
}

/// The reasons in words, one for each station in reach if there is any.
#[must_use]
pub fn why_not(draft: &Draft<'_, '_>, robot: usize, obstacles: &[Obstacle]) -> Vec<String> {
    let problem = draft.problem();
    let (who, choices) = (&problem.robots[robot], draft.ways.of(robot));
    if !choices.strands && choices.unserved_cost == 0 {
        return vec!["needs none: it works to the end of its mission".to_owned()];
    }
    if who.travel.is_empty() {
        return vec!["no station is in reach".to_owned()];
    }
    if obstacles.iter().all(|obstacle| matches!(obstacle.why, Why::Pointless)) {
        return vec!["a service would cost more work than it gives".to_owned()];
    }
    obstacles.iter().map(|obstacle| format!("station {}: {}", problem.stations[obstacle.station].name, obstacle.why)).collect()
}

fn at_station(draft: &Draft<'_, '_>, robot: usize, travel: &Travel) -> Why {
    let (problem, choices) = (draft.problem(), draft.ways.of(robot));
    let book = &draft.books[travel.station];
    let mut of_kind: BTreeMap<Mode, Vec<&Way>> = BTreeMap::new();
    for way in choices.ways.iter().filter(|way| usize::from(way.station) == travel.station) {
        of_kind.entry(way.mode).or_default().push(way);
    }
    let ways = of_kind.values().flat_map(|ways| {
        let (best, others) = ways.split_at(LOOKED_AT.min(ways.len()));
        best.iter().chain(others.iter().step_by(others.len().div_ceil(OTHERS).max(1))).copied()
    });
    let mut count = 0;
    // By the kinds of things that they lack: how many ways, and the one that comes closest.
    let mut lacking: BTreeMap<Vec<u8>, (usize, Vec<Clash>, &Way)> = BTreeMap::new();
    for way in ways {
        count += 1;
        let lacks = book.lacks(choices, way);
        if lacks.is_empty() {
            return Why::Free { start: Tick::from(way.start), cost: way.cost, unserved: choices.unserved_cost };
        }
        let kinds = lacks.iter().map(|&clash| severity(clash).0).collect();
        let (ways, nearest, of) = lacking.entry(kinds).or_insert_with(|| (0, lacks.clone(), way));
        *ways += 1;
        if amount(&lacks) < amount(nearest) {
            (*nearest, *of) = (lacks, way);
        }
    }
    // The fewest things that would do, of those what would do for most ways: a lift that is taken now is free later.
    let fewest = lacking.into_iter().max_by_key(|(kinds, (ways, ..))| {
        use std::cmp::Reverse;
        (Reverse(kinds.len()), *ways, Reverse(kinds.clone()))
    });
    let Some((_, (_, lacks, way))) = fewest else { return no_way(problem, robot, travel) };
    Why::Taken { start: Tick::from(way.start), mode: way.mode, ways: count, lacks }
}

/// Energy and power that are lacking, together.
fn amount(lacks: &[Clash]) -> i64 {
    lacks.iter().map(|&clash| severity(clash).1).sum()
}

fn no_way(problem: &Problem, robot: usize, travel: &Travel) -> Why {
    let station = &problem.stations[travel.station];
    let (who, battery) = (&problem.robots[robot], problem.battery(robot));
    let (soonest, last) = (problem.soonest(travel), who.last_start(travel, battery.floor));
    if i64::from(soonest) > last {
        return if soonest > travel.ticks { Why::NotThere { opens: soonest, last } } else { Why::TooFar { away: soonest, last } };
    }
    if station.bays == 0 && !problem.exchanges(travel) {
        return if station.spares.is_empty() { Why::NoPlace } else { Why::NoFit };
    }
    let in_the_way = station.away.iter().find(|away| away.end > soonest.max(who.not_before)).or(station.away.first());
    if let Some(away) = in_the_way.filter(|_| would_do_if_it_stayed(problem, robot, travel)) {
        return Why::Leaves { away: away.clone() };
    }
    // Who would not strand may have no way either, whatever it costs.
    if problem.strands(robot) || !has_any_way(&alone(problem, robot, travel, station.clone()), 0) {
        return Why::TooLate { min_gain: who.least_gain(battery), horizon: problem.horizon };
    }
    Why::Pointless
}

/// Whether there would be a way for a robot at the end of this way, were the station to stay for good.
fn would_do_if_it_stayed(problem: &Problem, robot: usize, travel: &Travel) -> bool {
    let station = Station { away: Vec::new(), ..problem.stations[travel.station].clone() };
    !Ways::new(&alone(problem, robot, travel, station)).of(0).ways.is_empty()
}

/// A problem of that robot and that station at the end of that way, and nothing else.
fn alone(problem: &Problem, robot: usize, travel: &Travel, station: Station) -> Problem {
    let batteries = vec![problem.battery(robot).clone()];
    let robot = Robot { battery: 0, travel: vec![Travel { station: 0, ..*travel }], ..problem.robots[robot].clone() };
    Problem { name: problem.name.clone(), batteries, stations: vec![station], robots: vec![robot], ..*problem }
}

/// What a lack amounts to: waiting for a place is less than energy that nobody has.
fn severity(clash: Clash) -> (u8, i64) {
    match clash {
        Clash::Lift(_) => (0, 0),
        Clash::Slot(_) => (1, 0),
        Clash::Power(_, short) => (2, short),
        Clash::Bay(_) => (3, 0),
        Clash::Spare(..) => (4, 0),
        Clash::Energy(_, short) => (5, short),
    }
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Why::TooFar { last: ..0, .. } | Why::NotThere { last: ..0, .. } => {
                f.write_str("the way there takes more than the robot may have")
            }
            Why::TooFar { away, last } => write!(f, "it is {away} ticks away, and the robot may have enough for {last} only"),
            Why::NotThere { opens, last } => {
                write!(f, "it takes robots in from tick {opens}, and the robot may have enough until {last} only")
            }
            Why::Leaves { away } => {
                write!(
                    f,
                    "it is away in ticks {} to {}, and no service that adds enough ends before or begins in time after",
                    away.start, away.end
                )
            }
            Why::NoPlace => write!(f, "it has neither bay nor spare"),
            Why::NoFit => write!(f, "it has no bay, and its spares do not fit the robot"),
            Why::TooLate { min_gain, horizon } => write!(f, "no service of at least {min_gain} mWh ends by tick {horizon}"),
            Why::Pointless => write!(f, "a service there would cost more work than it gives"),
            Why::Free { start, cost, unserved } => write!(f, "could be serviced from tick {start} at a cost of {cost} against {unserved}"),
            Why::Taken { start, ways, lacks, .. } => {
                let lacks: Vec<String> = lacks.iter().map(Clash::to_string).collect();
                write!(f, "none of {ways} ways is free; from tick {start}, {}", lacks.join(", and "))
            }
        }
    }
}

impl fmt::Display for Clash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Clash::Bay(tick) => write!(f, "all bays are taken in tick {tick}"),
            Clash::Lift(tick) => write!(f, "the lift is taken in tick {tick}"),
            Clash::Slot(tick) => write!(f, "the place for exchanges is taken in tick {tick}"),
            Clash::Spare(tick, _) => write!(f, "no charged spare is left in tick {tick}"),
            Clash::Power(tick, short) => write!(f, "the station may not draw {short} mWh more in tick {tick}"),
            Clash::Energy(before, short) => write!(f, "the packs are {short} mWh short before tick {before}"),
        }
    }
}
