//! The default policy: plans at once, then prices and search for as long as the budget lasts.
//!
//! ```text
//!   at once          several orders, the best is kept                            (construct)
//!     |
//!   strand few       search over orders of robots, in small fleets               (turns)
//!     |              search with what a way takes of its station as its cost     (thrifty ways)
//!     |              in small fleets instead: as if that were only missed work, then
//!     |              all that fewer stranded leave open                           (narrow)
//!     |
//!   miss little      search by missed work, at most as many stranded,            (search)
//!     |  ^            led by prices, which are bettered in between               (prices, guide)
//!     |  |           in large fleets among few ways, in two halves of the
//!     |  |           stations at a time                                   (large, halves)
//!     |  +---- prices bound the missed work from below
//!     |              in small fleets then: all that a better plan could still be (narrow)
//!   tidy up          ways of equal cost that take less energy
//! ```

mod large;

use std::cell::OnceCell;

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use crate::construct::{self, ORDERS, greedy, ranked};
use crate::draft::{Draft, NONE, broken};
use crate::guide::Guide;
use crate::halves::Halves;
use crate::narrow;
use crate::plan::{Levels, Plan};
use crate::prices::{Level, Prices};
use crate::search::{SETTLED_MAX, Search};
use crate::turns;
use crate::way::{SHARED_MIN, Ways};

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

/// Share of the budget in which nothing counts but how few are stranded, in a small fleet that has some time and in any other.
const STRAND_SHARE: [f64; 2] = [0.6, 0.3];
/// The largest fleet for which orders are searched: beyond that, turning one into a plan takes too long.
const TURNS_MAX: u64 = 64;
/// Share of the time for few stranded that goes to orders.
const TURNS_SHARE: f64 = 0.9;
/// Moves for each robot of a small fleet after which only what a better plan could still use is looked at:
/// first for fewer stranded robots, then for less missed work.
const TURNS_MOVES: u64 = 200;
/// See [`TURNS_MOVES`]; where stations cannot be planned one by one it takes more.
const WIDE_MOVES: [u64; 2] = [750, 3000];
/// Share of the time for few stranded in which a small fleet is searched for what stations can serve.
const COVER_SHARE: f64 = 0.3;
/// Share of the time for few stranded in which a small fleet is searched as if running empty were only missed work.
const LENIENT_SHARE: f64 = 0.3;
/// Share of the search's time that goes to prices.
const PRICES_SHARE: f64 = 0.25;
/// Temperatures at the beginning of a search for a small and for a large fleet, in units of cost.
const HOT: [f64; 2] = [20.0, 160.0];
/// The same at its end. So many more moves are made in a large fleet that below this nothing is accepted any more.
const COLD: [f64; 2] = [0.3, 1.0];
/// A search of a small fleet is over long before its time: it is heated again so often, from its best plan.
const HEATS: f64 = 6.0;
/// The largest fleet for which that pays.
const REHEATED_MAX: usize = 32;
/// Both while the cost is what a way takes of its station.
const THRIFTY_HEAT: [f64; 2] = [30.0, 0.5];
/// Rounds of prices that bound the number of stranded robots.
const PROVEN_ROUNDS: u32 = 16;
/// The largest fleet for which they run: they come after the budget, so they must be short.
const PROVEN_ROBOTS_MAX: usize = 64;
/// Rounds in which everybody may take a better place, when there is no time.
const HASTY: u32 = 2;
/// Moves between two looks at the budget: at most this many.
const MOVES_AT_ONCE: u64 = 400;

/// The best plan that the budget allows. The same seed and number of moves give the same plan.
#[must_use]
pub fn optimise(ways: &Ways<'_>, seed: u64, budget: &mut dyn Budget) -> Plan {
    let (draft, bounds) = best(ways, None, seed, budget);
    Plan::new(&draft, bounds.stranded, bounds.cost, bounds.energy)
}

/// The best draft, no worse than one that is known, and what is proven about it.
pub(crate) fn best<'w, 'p>(
    ways: &'w Ways<'p>,
    known: Option<Draft<'w, 'p>>,
    seed: u64,
    budget: &mut dyn Budget,
) -> (Draft<'w, 'p>, Levels) {
    let mut run = Run { ways, rng: Pcg64Mcg::seed_from_u64(seed), clock: Clock { budget, moves: 0 }, halves: OnceCell::new(), rounds: 0 };
    let at_once = run.at_once();
    let mut search = Search::new(match known {
        Some(known) if (known.broken(), known.score) <= (at_once.broken(), at_once.score) => known,
        _ => at_once,
    });
    search.settle(if run.used() < 1.0 { SETTLED_MAX } else { HASTY });
    let least = least_stranded(ways);
    let mut prices = Prices::new(ways, Level::Cost { stranded_max: search.best_score.stranded });
    let (mut least, mut proven) = (least, false);
    if run.used() < 1.0 && !search.idle() {
        least = run.strand_few(&mut search, &mut prices, least);
        proven = run.miss_little(&mut search, &mut prices, least);
        // When nothing is left to miss less, the rest of the time goes to stranding fewer.
        let mut width = narrow::WIDTH;
        while run.is_small() && proven && search.best_score.stranded > least && run.used() < 1.0 && width <= narrow::WIDTH_MAX {
            let before = search.best_score.stranded;
            least = narrow::fewer_stranded(run.ways, &mut prices, &mut search, least, 1.0, &mut run.clock, &mut width);
            if search.best_score.stranded < before {
                proven = run.miss_little(&mut search, &mut prices, least);
            }
        }
        search.return_to_best();
        let stranded = search.draft.score.stranded;
        search.settle(SETTLED_MAX);
        // What is proven is proven of plans that strand as many.
        proven &= search.draft.score.stranded == stranded;
    }
    let draft = search.draft;
    let least = if prices.improved() { proven_least(ways, least, draft.score.stranded) } else { least };
    prices.cap_stranded(draft.score.stranded);
    let energy_bound = if prices.improved() { prices.energy_bound(draft.score.cost) } else { 0 };
    let cost = if proven { draft.score.cost } else { prices.bound() };
    let bounds = Levels { stranded: least, cost, energy: energy_bound, packs: 0 };
    (draft, bounds)
}

/// A bound on how few can be stranded: those whom no service can reach in time.
#[must_use]
pub fn least_stranded(ways: &Ways<'_>) -> i64 {
    let hopeless = |robot: &usize| ways.of(*robot).strands && ways.of(*robot).ways.is_empty();
    (0..ways.problem().robots.len()).filter(hopeless).count() as i64
}

/// A better bound by prices, where that takes no time to speak of.
fn proven_least(ways: &Ways<'_>, least: i64, stranded: i64) -> i64 {
    if stranded <= least || ways.problem().robots.len() > PROVEN_ROBOTS_MAX {
        return least;
    }
    let mut prices = Prices::new(ways, Level::Stranded);
    for _ in 0..PROVEN_ROUNDS {
        if prices.bound() >= stranded {
            break;
        }
        prices.improve(stranded);
    }
    prices.bound().max(least)
}

/// What of the budget is used.
pub(crate) struct Clock<'b> {
    pub(crate) budget: &'b mut dyn Budget,
    /// Moves so far.
    pub(crate) moves: u64,
}

impl Clock<'_> {
    /// The part of the budget that is used up.
    pub(crate) fn used(&mut self) -> f64 {
        self.budget.used(self.moves)
    }

    /// The same if there had been so many moves.
    pub(crate) fn used_with(&mut self, moves: u64) -> f64 {
        self.budget.used(moves)
    }
}

struct Run<'w, 'p, 'b> {
    ways: &'w Ways<'p>,
    rng: Pcg64Mcg,
    clock: Clock<'b>,
    /// Made for the first search in halves: a plan at once, and that of a small fleet, has no time for it and no use.
    halves: OnceCell<Halves>,
    rounds: u64,
}

impl<'w, 'p> Run<'w, 'p, '_> {
    fn used(&mut self) -> f64 {
        self.clock.used()
    }

    /// The best of several orders. The first serves most, so it has to do when there is no time.
    fn at_once(&mut self) -> Draft<'w, 'p> {
        let mut best = Draft::new(self.ways);
        construct::frugal(&mut best, &ranked(self.ways, ORDERS[0]));
        for order in ORDERS {
            if self.used() >= 1.0 {
                return best;
            }
            let order = ranked(self.ways, order);
            let found = both(self.ways, [(&order, 2.0), (&order, 0.0)]);
            for draft in found {
                if draft.score < best.score {
                    best = draft;
                }
            }
        }
        best
    }

    /// Strands fewer, whatever work is missed for it. How few are stranded by any plan.
    fn strand_few(&mut self, found: &mut Search<'w, 'p>, prices: &mut Prices<'w, 'p>, mut least: i64) -> i64 {
        let start = self.used();
        if found.best_score.stranded <= least {
            return least;
        }
        let thrifty = self.ways.thrifty();
        let mut few = Draft::new(&thrifty);
        let orders = [construct::Order::Deadline, construct::Order::Slack].map(|order| ranked(&thrifty, order));
        for draft in both(&thrifty, [(&orders[0], 0.0), (&orders[1], 0.0)]) {
            if draft.score < few.score {
                few = draft;
            }
        }
        let is_short = self.is_large() || self.clock.used_with(self.clock.moves + 2 * narrow::APART_MOVES) >= 1.0;
        let until = start + STRAND_SHARE[usize::from(is_short)] * (1.0 - start);
        let robots = self.ways.problem().robots.len() as u64;
        if robots <= TURNS_MAX {
            let first = start + TURNS_SHARE * (until - start);
            let orders = ORDERS.map(|order| ranked(&thrifty, order));
            let is_small = self.is_small();
            let clock = &mut self.clock;
            let enough = clock.moves + robots * TURNS_MOVES;
            let found = turns::few_stranded(&thrifty, &orders, least, &mut self.rng, |placed| {
                clock.moves += placed;
                clock.used() < first && !(is_small && clock.moves > enough)
            });
            if found.score < few.score {
                few = found;
            }
        }
        if self.is_small() {
            let chosen = self.ways.translated(&thrifty, &few.chosen);
            if few.score.stranded < found.best_score.stranded
                && broken(self.ways.problem(), &chosen) <= broken(self.ways.problem(), &found.best)
            {
                found.go_on_from(&chosen);
                found.settle(SETTLED_MAX);
            }
            let cover = start + COVER_SHARE * (until - start);
            narrow::fewer_by_cover(self.ways, found, least, cover, &mut self.rng, &mut self.clock);
            if found.best_score.stranded <= least {
                return least;
            }
            let lenient = start + LENIENT_SHARE * (until - start);
            // Prices for fewer stranded than can be rise without end, and are of no use later.
            let mut hard = Prices::new(self.ways, Level::Cost { stranded_max: found.best_score.stranded });
            narrow::fewer_leniently(self.ways, &mut hard, found, least, lenient, &mut self.rng, &mut self.clock);
            least = narrow::fewer_stranded(self.ways, &mut hard, found, least, until, &mut self.clock, &mut { narrow::WIDTH });
            return least;
        }
        let guide = Guide::by_cost(&thrifty, 0..few.chosen.len());
        let mut search = Search::new(few);
        let start = self.used();
        let enough = (start + large::STRAND_SHARE * (1.0 - start), self.clock.moves + large::STRAND_MOVES * robots);
        loop {
            let at = self.used();
            let is_enough = self.is_large() && at >= enough.0 && self.clock.moves >= enough.1;
            if at >= until || is_enough || search.best_score.stranded <= least {
                break;
            }
            let heat = heat(THRIFTY_HEAT, (at - start) / (until - start));
            if self.is_large() {
                prices.cap_stranded(search.best_score.stranded.min(found.best_score.stranded));
                self.search_halves(&mut search, &guide, heat, prices, found.best_score.cost);
            } else {
                self.search(&mut search, &guide, heat);
            }
        }
        let few = self.ways.translated(&thrifty, &search.best);
        if search.best_score.stranded < found.best_score.stranded
            && broken(self.ways.problem(), &few) <= broken(self.ways.problem(), &found.best)
        {
            found.go_on_from(&few);
            found.settle(SETTLED_MAX);
        }
        least
    }

    /// Misses less work, strands no more. Whether no plan that strands as few misses less.
    fn miss_little(&mut self, search: &mut Search<'w, 'p>, prices: &mut Prices<'w, 'p>, least: i64) -> bool {
        let start = self.used();
        let robots = self.ways.problem().robots.len();
        let hot = (robots as f64 / 4.0).clamp(HOT[0], HOT[1]);
        let cold = COLD[usize::from(self.is_large())];
        let heats = if robots <= REHEATED_MAX { HEATS } else { 1.0 };
        let mut heated = 0.0;
        if self.is_small() {
            if narrow::is_certain(self.ways) {
                search.sets.get_or_insert_with(|| narrow::Sets::new(self.ways));
            } else {
                search.seen = Some(narrow::Seen::new(self.ways, search.best_score.stranded));
            }
        }
        let (began, wide) = (
            self.clock.moves,
            if self.is_small() { WIDE_MOVES[usize::from(!narrow::is_certain(self.ways))] * robots as u64 } else { u64::MAX },
        );
        let (mut priced, mut searched) = (0.0, 0.0);
        loop {
            let at = self.used();
            let score = search.best_score;
            prices.cap_stranded(score.stranded);
            let proven = score.stranded == least && score.cost == prices.bound();
            if at >= 1.0 || (proven && at >= 0.3) || search.idle() {
                return proven;
            }
            let gone = ((self.clock.moves - began) as f64 / wide as f64).max((at - start) / (1.0 - start));
            if self.clock.moves - began >= wide {
                return narrow::cheaper(self.ways, prices, search, &mut self.rng, &mut self.clock);
            }
            if self.is_large() && prices.improved() {
                self.search_few(search, prices, [hot, cold], start);
            } else if priced < PRICES_SHARE * (priced + searched) || !prices.improved() {
                self.clock.moves += prices.improve(score.cost);
                priced += self.used() - at;
            } else {
                let progress = heats * gone;
                if progress - heated >= 1.0 {
                    heated = progress.floor();
                    search.return_to_best();
                }
                self.search(search, prices.guide(), heat([hot, cold], progress - heated));
                searched += self.used() - at;
            }
        }
    }

    /// Whether it is worth while to look at whatever a better plan could be.
    fn is_small(&self) -> bool {
        self.ways.problem().robots.len() <= narrow::ROBOTS_MAX
    }

    /// Whether there is work for several threads.
    fn is_large(&self) -> bool {
        self.ways.problem().robots.len() >= SHARED_MIN
    }

    fn search(&mut self, search: &mut Search<'_, '_>, guide: &Guide, heat: f64) {
        let moves = (self.ways.problem().robots.len() as u64 * 2).clamp(20, MOVES_AT_ONCE);
        search.run(guide, &mut self.rng, moves, heat);
        self.clock.moves += moves;
    }
}

/// Plans at once by two orders and thrifts, a large fleet's on two threads.
fn both<'w, 'p>(ways: &'w Ways<'p>, orders: [(&[usize], f32); 2]) -> [Draft<'w, 'p>; 2] {
    let at_once = |(order, thrift): (&[usize], f32)| {
        let mut draft = Draft::new(ways);
        greedy(&mut draft, order, thrift);
        draft
    };
    let [one, other] = orders;
    if ways.problem().robots.len() < SHARED_MIN {
        return [at_once(one), at_once(other)];
    }
    let (one, other) = rayon::join(|| at_once(one), || at_once(other));
    [one, other]
}

/// The temperature falls by equal factors.
pub(crate) fn heat([hot, cold]: [f64; 2], progress: f64) -> f64 {
    hot * f64::powf(cold / hot, progress.clamp(0.0, 1.0))
}

impl Ways<'_> {
    /// A choice among `other`'s ways, of the same problem, as a choice among these.
    pub(crate) fn translated(&self, other: &Ways<'_>, chosen: &[u32]) -> Vec<u32> {
        let here = chosen.iter().enumerate().map(|(robot, &way)| {
            if way == NONE {
                return NONE;
            }
            let way = other.of(robot).ways[way as usize];
            let place = self.of(robot).find(usize::from(way.station), u32::from(way.start), way.mode);
            place.map_or(NONE, |place| place as u32)
        });
        here.collect()
    }
}
