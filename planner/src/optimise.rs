//! The default policy: several plans at once, prices, search, and the bound that goes with it.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use crate::construct::{ORDERS, greedy, ranked};
use crate::draft::{Draft, Score};
use crate::guide::Guide;
use crate::prices::{Level, Prices};
use crate::search::Search;
use crate::way::Ways;

/// How long to go on.
pub trait Budget {
    /// The part of the budget that is used up after so many moves: 0 at the start, 1 or more to stop.
    fn used(&mut self, moves: u64) -> f64;
}

/// So many moves: the same plan on every machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moves(pub u64);

impl Budget for Moves {
    fn used(&mut self, moves: u64) -> f64 {
        if self.0 == 0 { 1.0 } else { moves as f64 / self.0 as f64 }
    }
}

impl<F: FnMut(u64) -> f64> Budget for F {
    fn used(&mut self, moves: u64) -> f64 {
        self(moves)
    }
}

/// A choice, its score and what is proven about it.
#[derive(Debug)]
pub struct Optimised {
    /// Index of each robot's way.
    pub chosen: Vec<u32>,
    /// Its score.
    pub score: Score,
    /// No plan strands fewer robots.
    pub stranded_bound: i64,
    /// No plan that strands as few misses less.
    pub cost_bound: i64,
}

/// Knobs
#[derive(Debug, Clone, Copy)]
pub struct Knobs {
    /// hot
    pub hot: f64,
    /// cold
    pub cold: f64,
    /// dual part
    pub dual: f64,
    /// print
    pub trace: bool,
}

/// The best plan that the budget allows.
pub fn optimise(ways: &Ways<'_>, seed: u64, budget: &mut dyn Budget, knobs: Knobs) -> Optimised {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut moves = 0;
    let mut best = Draft::new(ways);
    for (number, order) in ORDERS.into_iter().enumerate() {
        for thrift in [0.0, 2.0] {
            if number > 0 && budget.used(moves) >= 1.0 {
                break;
            }
            let mut draft = Draft::new(ways);
            greedy(&mut draft, &ranked(ways, order), thrift);
            if knobs.trace {
                eprintln!("{:.4} greedy {order:?} {thrift}: {:?}", budget.used(moves), draft.score);
            }
            if draft.score < best.score {
                best = draft;
            }
        }
    }
    let mut strand = Prices::new(ways, Level::Stranded);
    let mut prices = Prices::new(ways, Level::Cost { stranded_max: best.score.stranded });
    let robots = ways.problem().robots.len().max(1) as u64;
    let mut search = Search::new(best);
    let mut since = 0_u64;
    let mut guide = Guide::new(ways, &prices);
    let start = budget.used(moves);
    let (mut dual, mut total) = (0.0, 0.0);
    let mut settled = false;
    loop {
        let at = budget.used(moves);
        if at >= 1.0 {
            break;
        }
        let progress = ((at - start) / (1.0 - start)).clamp(0.0, 1.0);
        // search
        if dual >= knobs.dual * total || settled {
            let heat = knobs.hot * (knobs.cold / knobs.hot).powf(progress);
            search.run(&guide, &mut rng, robots.clamp(50, 500), heat);
            moves += robots.clamp(50, 500);
            let now = budget.used(moves);
            total += now - at;
            if search.best_score.stranded == 0 && false {
                break;
            }
        } else {
            prices.cap_stranded(search.best_score.stranded);
            prices.improve(10, search.best_score.cost);
            if strand.bound() < search.best_score.stranded && since % 4 == 0 {
                strand.improve(10, search.best_score.stranded);
            }
            since += 1;
            if since.is_power_of_two() || since % 16 == 0 {
                guide = Guide::new(ways, &prices);
            }
            settled = prices.settled() && since > 100;
            moves += 10 * robots;
            let now = budget.used(moves);
            dual += now - at;
            total += now - at;
            if knobs.trace && since % 8 == 0 {
                eprintln!("{now:.3} moves {moves} bound {} ({} {:.4}) L1 bound {} best {:?}", prices.bound(), prices.stranded_price(), prices.pull(), strand.bound(), search.best_score);
            }
        }
    }
    prices.cap_stranded(search.best_score.stranded);
    Optimised { chosen: search.best, score: search.best_score, stranded_bound: strand.bound(), cost_bound: prices.bound() }
}
