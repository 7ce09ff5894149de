//! Plans at once: robots in some order, each takes its best way that is still free.

use crate::draft::{Draft, NONE};
use crate::thrift::Thrift;
use crate::way::{Choices, Mode, Way, Ways};

/// Who goes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Who is empty first.
    Deadline,
    /// Who has the fewest ways.
    Slack,
    /// Who loses most without a service.
    Loss,
    /// Who needs the least energy to be off the list.
    Need,
}

/// The orders that are tried.
pub const ORDERS: [Order; 4] = [Order::Deadline, Order::Slack, Order::Loss, Order::Need];

/// Robots in an order; those who would run empty come before those who would not.
#[must_use]
pub fn ranked(ways: &Ways<'_>, order: Order) -> Vec<usize> {
    let problem = ways.problem();
    let key = |robot: usize| -> (i64, usize) {
        let choices = ways.of(robot);
        let key = match order {
            Order::Deadline => problem.last_start(robot),
            Order::Slack => choices.ways.len() as i64,
            Order::Loss => i64::from(choices.ways.first().map_or(0, |way| way.cost)) - i64::from(choices.unserved_cost),
            Order::Need => choices.ways.iter().map(|way| way.energy).min().unwrap_or(0),
        };
        (key, robot)
    };
    let mut keys: Vec<(bool, (i64, usize))> = (0..problem.robots.len()).map(|robot| (!ways.of(robot).strands, key(robot))).collect();
    keys.sort_unstable();
    keys.into_iter().map(|(_, (_, robot))| robot).collect()
}

/// Serves the robots in turn, each by the free way with the least `cost + thrift * (ticks in the
/// bay)`: more thrift leaves more for the others. Robots that have a service keep it.
pub fn greedy(draft: &mut Draft<'_, '_>, order: &[usize], thrift: f32) {
    for &robot in order {
        if draft.chosen[robot] == NONE
            && let Some(way) = thrifty(draft, robot, thrift)
        {
            draft.serve(robot, way);
        }
    }
    draft.keep();
}

/// What robots may ask of a station together, in thousandths of its places and of its energy (2,000 in all), before those
/// who ask for least are served first. Fleets of 1,000 for 50 stations ask for 1,100, those of 10,000 for 200 for 2,400.
const ASKED_MAX: i64 = 1500;

/// Serves those who would run empty, in turn, each by the free way that takes least of its station. Where far more is
/// asked for than there is, those who take least come first: so most are served.
pub fn frugal(draft: &mut Draft<'_, '_>, order: &[usize]) {
    let thrift = Thrift::new(draft.problem());
    let least = |robot: usize| draft.ways.of(robot).ways.iter().map(|way| thrift.of(way)).min().unwrap_or(0);
    let mut order: Vec<(i32, usize)> =
        order.iter().filter(|robot| draft.ways.of(**robot).strands).map(|&robot| (least(robot), robot)).collect();
    let asked: i64 = order.iter().map(|&(least, _)| i64::from(least)).sum();
    if asked > ASKED_MAX * draft.books.len() as i64 {
        order.sort_unstable();
    }
    for (_, robot) in order {
        let choices = draft.ways.of(robot);
        let mut best: Option<(i32, u32)> = None;
        for (way, place) in choices.ways.iter().zip(0..) {
            let taken = thrift.of(way);
            if best.is_none_or(|(least, _)| taken < least) && draft.books[usize::from(way.station)].fits(choices, way) {
                best = Some((taken, place));
            }
        }
        if let Some((_, way)) = best {
            draft.serve(robot, way);
        }
    }
    draft.keep();
}

/// The free way with the least cost plus price of the bay's time.
fn thrifty(draft: &Draft<'_, '_>, robot: usize, thrift: f32) -> Option<u32> {
    let choices: &Choices = draft.ways.of(robot);
    if thrift == 0.0 {
        return draft.cheapest(robot, i64::MAX);
    }
    let price = |way: &Way| match way.mode {
        Mode::Charge(_) => way.cost as f32 + thrift * f32::from(way.end - way.start),
        _ => way.cost as f32,
    };
    let mut best: Option<(f32, u32)> = None;
    for (place, way) in choices.ways.iter().enumerate() {
        if best.is_some_and(|(least, _)| way.cost as f32 >= least) {
            break;
        }
        let price = price(way);
        if best.is_none_or(|(least, _)| price < least) && draft.books[usize::from(way.station)].fits(choices, way) {
            best = Some((price, place as u32));
        }
    }
    best.map(|(_, way)| way)
}
