//! Strands fewer robots by a search in which running empty is only missed work.
//!
//! From a plan that strands one robot to one that strands none there are often no steps that strand no more on the way.
//! Where that is allowed for a price, a search comes across what stations can serve for more robots than in any one of its
//! plans, and what was seen of all stations together may strand fewer.

use rand::Rng;

use crate::draft::{Draft, Score, broken};
use crate::narrow::together::together;
use crate::narrow::{AIM, COLD, Sets, is_certain};
use crate::optimise::{Clock, heat};
use crate::prices::Prices;
use crate::search::Search;
use crate::way::Ways;

/// What a robot that runs empty is taken to cost, in prices of one: with once the price as many stayed stranded as
/// without this search.
const PENALTY: f64 = 3.0;
/// The least that its price is taken to be, in units of cost.
const PRICE_MIN: f64 = 20.0;
/// Moves of a search (twice as many at twice the price were no better), and in how many slices it cools from which temperature.
const MOVES: u64 = 4000;
const SLICES: u64 = 16;
const HOT: f64 = 20.0;
/// Rounds of prices before each.
const ROUNDS: u32 = 3;
/// What a plan that strands fewer may cost, as a part of the bound: what is put together is not looked through beyond that.
const COST_MAX: f64 = 1.2;

/// Looks for a plan that strands fewer than the best one known, until `until` of the time is used; `least` are stranded in
/// any case.
pub(crate) fn fewer_leniently<'w, 'p>(
    ways: &'w Ways<'p>,
    prices: &mut Prices<'w, 'p>,
    found: &mut Search<'w, 'p>,
    least: i64,
    until: f64,
    rng: &mut impl Rng,
    clock: &mut Clock<'_>,
) {
    // Where there is no time for a whole search, all that fewer stranded leave open is the better use of it.
    let mut enough = clock.used_with(clock.moves + MOVES) < until;
    while enough && is_certain(ways) && found.best_score.stranded > least && clock.used() < until {
        let begun = clock.used();
        prices.cap_stranded(found.best_score.stranded - 1);
        for _ in 0..ROUNDS {
            clock.moves += prices.improve((prices.bound() as f64 * AIM) as i64);
        }
        let price = prices.best().last().copied().unwrap_or(0.0).max(PRICE_MIN);
        let lenient = ways.lenient((PENALTY * price).min(f64::from(i32::MAX / 64)) as i32);
        let mut draft = Draft::new(&lenient);
        draft.become_choice(&found.best);
        let mut search = Search::new(draft);
        search.sets = Some(found.sets.take().unwrap_or_else(|| Sets::new(ways)));
        for slice in 0..SLICES {
            search.run(prices.guide(), rng, MOVES / SLICES, heat([HOT, COLD], slice as f64 / (SLICES - 1) as f64));
            clock.moves += MOVES / SLICES;
            enough = begun + SLICES as f64 * (clock.used() - begun) / (slice + 1) as f64 <= until;
            if !enough || clock.used() >= until {
                break;
            }
        }
        found.sets = search.sets.take();
        let mut alone = Draft::new(ways);
        alone.become_choice(&search.best);
        let chosen = if alone.score.stranded < found.best_score.stranded { Some(search.best) } else { fewer_together(ways, prices, found) };
        if let Some(chosen) = chosen.filter(|chosen| broken(ways.problem(), chosen) <= broken(ways.problem(), &found.best)) {
            found.go_on_from(&chosen);
        }
    }
}

/// A plan that strands fewer, if what stations were seen to serve makes one.
fn fewer_together<'w, 'p>(ways: &'w Ways<'p>, prices: &Prices<'w, 'p>, found: &Search<'w, 'p>) -> Option<Vec<u32>> {
    let bound = prices.bound();
    let below = bound + ((COST_MAX - 1.0) * bound as f64) as i64 + 1;
    let known = Score { stranded: found.best_score.stranded - 1, cost: below, energy: 0 };
    together(found.sets.as_ref()?, ways, &prices.reduced(below), known, (0, 0)).better
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::construct::{self, Order};
    use crate::draft::NONE;
    use crate::instance::Instance;
    use crate::optimise::Moves;
    use crate::prices::Level;

    #[test]
    fn a_plan_that_strands_fewer_can_be_had() {
        let instance = Instance::parse(include_str!("../../tests/instances/16-2-1.json")).expect("a valid instance");
        let ways = Ways::all(&instance.problem);
        let mut draft = Draft::new(&ways);
        // Only half of the robots are served at first.
        let order = construct::ranked(&ways, Order::Slack);
        construct::greedy(&mut draft, &order[..order.len() / 2], 0.0);
        let before = draft.score.stranded;
        let mut prices = Prices::new(&ways, Level::Cost { stranded_max: before });
        let mut search = Search::new(draft);
        let mut budget = Moves(100_000);
        let mut clock = Clock { budget: &mut budget, moves: 0 };
        fewer_leniently(&ways, &mut prices, &mut search, 0, 1.0, &mut Pcg64Mcg::seed_from_u64(1), &mut clock);
        assert!(search.best_score.stranded < before);
        let mut anew = Draft::new(&ways);
        for (robot, &way) in search.best.iter().enumerate().filter(|(_, way)| **way != NONE) {
            let choices = ways.of(robot);
            let taken = &choices.ways[way as usize];
            assert!(anew.books[usize::from(taken.station)].fits(choices, taken), "robot {robot} has no place");
            anew.serve(robot, way);
        }
        assert_eq!(anew.score, search.best_score);
    }
}
