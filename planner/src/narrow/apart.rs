//! Plans every station alone for all sets of robots that could be part of a better plan, and puts them together.
//!
//! What stations have in common are robots, so a worth is put on each robot, and a station is paid it for serving that
//! robot. At any worths stations no longer meet: what they cost at least is a bound, and a better plan than the one
//! known leaves each of them only so much room beyond its own least cost. How a station gets along with bays, lift and
//! packs is gone through in whole services (`pass.rs`), where prices would sell parts of them. Worths are good when what
//! was seen so far costs, at the least, as much as the plan that is known: then a better plan needs a station that does
//! better than it was ever seen to do, and the room is split so that no station is asked for more than that.

use crate::draft::{Score, broken};
use crate::narrow::pass::{Passed, pass};
use crate::narrow::sets::Sets;
use crate::narrow::site::Site;
use crate::narrow::together::together;
use crate::narrow::worth::{SCALE, Worth};
use crate::optimise::Clock;
use crate::prices::{Level, Prices, Reduced, UNIT};
use crate::search::Search;
use crate::way::Ways;

/// Rounds of prices at a station for new worths, at most. After every so many it ends where the bound has gained less than
/// this part of what it may still gain: with a fixed dozen the bound after a change of worths was far below what it can be.
const ROUNDS_MAX: u32 = 60;
const ROUNDS: u32 = 6;
const LITTLE: f64 = 0.02;
/// Beginnings that a pass looks at in the time of a move of the search.
const TO_A_MOVE: u64 = 20;
/// Beginnings at a time: at first, by how much more when nothing new was seen, and at most. With half as many at first fewer
/// best plans were found.
const WIDTH: usize = 1024;
const WIDER: usize = 4;
const WIDTH_MAX: usize = 1 << 18;

/// Where the planning of stations one by one stands.
#[derive(Debug)]
pub(super) struct Apart {
    worth: Worth,
    /// Prices of the rows of each station at these worths.
    prices: Vec<Vec<f64>>,
    width: usize,
}

/// What came of planning every station once.
#[derive(Debug, PartialEq)]
pub(super) enum Came {
    /// A better plan.
    Better(Vec<u32>),
    /// There is none.
    Proven,
    /// Nobody knows yet.
    Unknown,
}

/// A plan that is asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked<'a> {
    /// What ways cost beyond the bound, and what room there is.
    pub(super) reduced: &'a Reduced,
    /// The price of a stranded robot.
    pub(super) stranded_price: f64,
    /// It must cost less than this, and strand no more.
    pub(super) below: Score,
    /// The part of the time that may be used up.
    pub(super) until: f64,
}

/// A station at some worths.
struct Alone<'w, 'p> {
    /// The station's ways, and where they stand among all.
    ways: &'w Ways<'p>,
    places: &'w [Vec<u32>],
    prices: Prices<'w, 'p>,
    /// What was seen to cost least, beyond the bound.
    seen: i64,
}

impl Apart {
    /// From the worths and prices at which these ways were reduced.
    pub(super) fn new(ways: &Ways<'_>, reduced: &Reduced, prices: &Prices<'_, '_>) -> Self {
        let prices: Vec<f64> = prices.best().iter().map(|price| price * SCALE as f64).collect();
        Self { worth: Worth::new(ways, reduced), prices: vec![prices; ways.problem().stations.len()], width: WIDTH }
    }

    /// Whether wider passes still promise something.
    pub(super) fn goes_on(&self) -> bool {
        self.width <= WIDTH_MAX
    }

    /// Plans all stations once and puts together what was seen of them.
    pub(super) fn plan(&mut self, ways: &Ways<'_>, asked: Asked<'_>, search: &mut Search<'_, '_>, clock: &mut Clock<'_>) -> Came {
        let mut sets = search.sets.take().unwrap_or_else(|| Sets::new(ways));
        let before = sets.sum();
        let proven = self.plan_all(ways, asked, &mut sets, clock);
        if proven.is_none() && sets.sum() == before {
            self.width *= WIDER;
        }
        let robots = &ways.problem().robots;
        let held = robots.iter().zip(0..).filter(|(robot, _)| robot.held).fold(0, |held, (_, bit)| held | 1 << bit);
        let found = together(&sets, ways, asked.reduced, asked.below, (held, broken(ways.problem(), &search.best) as u32));
        let complete = found.complete && !sets.is_full();
        search.sets = Some(sets);
        match found.better {
            Some(chosen) => Came::Better(chosen),
            None if complete && proven == Some(true) => Came::Proven,
            None => Came::Unknown,
        }
    }

    /// Notes what stations can serve within their room. Whether that is all that a better plan could be made of; none where
    /// some pass had no room for all.
    fn plan_all(&mut self, ways: &Ways<'_>, asked: Asked<'_>, sets: &mut Sets, clock: &mut Clock<'_>) -> Option<bool> {
        let kept: Vec<Vec<u32>> = asked.reduced.ways.iter().map(|ways| ways.iter().map(|&(_, way)| way).collect()).collect();
        let worth = self.worth.whole();
        let stranded_price = (asked.stranded_price * SCALE as f64) as i64;
        let stations = ways.problem().stations.len();
        let few = (0..stations).map(|station| ways.apart(station, &kept, SCALE, &worth)).collect::<Option<Vec<_>>>()?;
        let mut room = (asked.below.cost - 1) * SCALE + stranded_price * asked.below.stranded - self.worth.alone(ways, stranded_price);
        let mut alone = Vec::with_capacity(stations);
        for (station, (few, places)) in few.iter().enumerate() {
            let seen = self.worth.least(&sets.stations[station].sets);
            let prices = self.price(few, station, seen, clock);
            room -= prices.bound();
            alone.push(Alone { ways: few, places, seen: seen - prices.bound(), prices });
        }
        if room < 0 {
            return Some(true);
        }
        let rooms = split(room, &alone.iter().map(|alone| alone.seen).collect::<Vec<_>>());
        let mut least = vec![0; stations];
        let mut complete = true;
        for (station, alone) in alone.iter().enumerate() {
            let passed = alone.pass(station, (rooms[station], self.width), asked.until, clock)?;
            complete &= passed.complete;
            if passed.complete {
                least[station] = passed.plans.iter().map(|plan| plan.reduced / UNIT).min().unwrap_or(rooms[station] + 1);
            }
            for plan in passed.plans {
                let of = |&(robot, way): &(u32, u32)| (robot, alone.places[robot as usize][way as usize]);
                let chosen: Vec<(u32, u32)> = plan.ways.iter().map(of).collect();
                let cost = chosen.iter().map(|&(robot, way)| i64::from(ways.of(robot as usize).ways[way as usize].cost)).sum();
                sets.stations[station].note(plan.robots, cost, chosen.into_iter());
            }
        }
        self.worth.step(ways, sets, asked.below, stranded_price);
        let all: i64 = least.iter().sum();
        complete.then(|| rooms.iter().zip(&least).all(|(mine, least)| mine + all - least >= room))
    }

    /// Prices at the worths of now; `aim` is what was seen to cost least.
    fn price<'w, 'p>(&mut self, few: &'w Ways<'p>, station: usize, aim: i64, clock: &mut Clock<'_>) -> Prices<'w, 'p> {
        let mut prices = Prices::from(few, Level::Cost { stranded_max: 0 }, &self.prices[station]);
        let mut before = prices.bound();
        for round in 1..=ROUNDS_MAX {
            if prices.bound() >= aim {
                break;
            }
            clock.moves += prices.improve(aim);
            if round.is_multiple_of(ROUNDS) {
                if ((prices.bound() - before) as f64) < LITTLE * (aim - prices.bound()) as f64 {
                    break;
                }
                before = prices.bound();
            }
        }
        self.prices[station].copy_from_slice(prices.best());
        prices
    }
}

impl Alone<'_, '_> {
    /// All that the station can do within so much room.
    fn pass(&self, station: usize, (room, width): (i64, usize), until: f64, clock: &mut Clock<'_>) -> Option<Passed> {
        let reduced = self.prices.reduced(self.prices.bound() + room + 1);
        let site = Site::new(self.ways, station, &reduced)?;
        let began = clock.moves;
        let passed = pass(&site, width, |seen| clock.used_with(began + seen / TO_A_MOVE) < until);
        clock.moves += passed.seen / TO_A_MOVE;
        Some(passed)
    }
}

/// The room of each station, where they were seen to cost so much at least. If that is more than there is room for
/// together, each gets less than that, and a better plan still has to show at one of them. Else each gets what the
/// others leave.
fn split(room: i64, seen: &[i64]) -> Vec<i64> {
    let over = seen.iter().sum::<i64>() - room;
    if over <= 0 {
        return seen.iter().map(|seen| (seen - over).clamp(0, room)).collect();
    }
    let each = (over + seen.len() as i64 - 1) / seen.len() as i64;
    let mut rooms: Vec<i64> = seen.iter().map(|seen| (seen - each).clamp(0, room)).collect();
    let left = room - rooms.iter().sum::<i64>();
    if let Some(last) = rooms.last_mut() {
        *last = (*last + left).max(0);
    }
    rooms
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_better_plan_shows_at_a_station_that_has_room_for_it() {
        for (room, seen) in [(10, [4, 5]), (10, [8, 9]), (3, [9, 9]), (0, [1, 0]), (7, [0, 20])] {
            let rooms = split(room, &seen);
            for first in 0..=room {
                // The other costs what is left at most, and no station less than it was seen to, but within its room.
                let shows = [first, room - first].iter().zip(&rooms).any(|(cost, mine)| cost <= mine);
                assert!(shows, "{room} {seen:?} {rooms:?} {first}");
            }
        }
    }
}
