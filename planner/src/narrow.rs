//! Makes an end of small fleets: prices say which ways a better plan could still use, and mostly these
//! are few.
//!
//! ```text
//!   prices, best plan known       what each way costs beyond the bound    (prices::Reduced)
//!     |
//!   sweep   each of the ways that leave room for a better plan is tried once        (search)
//!     |  ^
//!     v  |  every better plan leaves fewer
//!   apart   stations one by one for all sets of robots, and these put together      (worth, site, pass, sets, together)
//!     |  ^
//!     v  |
//!   search  the same moves as elsewhere, among these ways alone
//! ```
//!
//! Where promises need some certainty, what a station can promise one by one it may not be able to promise in another order.
//! Then all stations are gone through at a time (`beam.rs`), and after each search the best plan is looked for that is made of
//! ways of good plans (`merge.rs`). Where passes had room for everything, the plan is proven best.

mod apart;
mod beam;
mod cover;
mod lenient;
mod merge;
mod pass;
mod sets;
mod site;
mod together;
mod worth;

use rand::Rng;

use crate::draft::{Draft, Score, broken};
use crate::optimise::{Clock, heat};
use crate::prices::{Level, Prices, Reduced};
use crate::search::{SETTLED_MAX, Search};
use crate::way::Ways;
use apart::{Apart, Asked, Came};
use beam::beam;
pub(crate) use cover::fewer_by_cover;
pub(crate) use lenient::fewer_leniently;
pub(crate) use merge::Seen;
use merge::merge;
pub(crate) use sets::Sets;

/// The largest fleet that is looked at so: beyond that too many ways are left.
pub(crate) const ROBOTS_MAX: usize = 32;
/// Beginnings of plans at a time: at first, by how much more the next time, and at most.
pub(crate) const WIDTH: usize = 64;
const WIDER: usize = 4;
pub(crate) const WIDTH_MAX: usize = 1 << 16;
/// Beginnings that a beam looks at in the time of a move of the search.
const TO_A_MOVE: u64 = 3;
/// Rounds of prices before a pass, before the first one, and when another number of stranded robots is asked for.
const ROUNDS: u32 = 2;
const ROUNDS_FIRST: u32 = 20;
const ROUNDS_ANEW: u32 = 60;
/// Share of the time that those may take.
const PRICED: f64 = 0.3;
/// What a plan is taken to cost that strands fewer than any that is known, as a part of the bound: prices that aim
/// lower make steps that are too short.
const AIM: f64 = 1.3;
/// Part of the bound that such a plan may cost beyond it at first, and by how much more when there is none. Some need a tenth, and passes
/// within a smaller room lose their time: from 0.04 and 40 rounds of prices on, two fleets of 400 took five times as long.
const ROOM: f64 = 0.16;
const MORE_ROOM: f64 = 2.0;
/// Moves in whose time all stations can be planned one by one: where there is less, all at a time is the better use of it.
pub(crate) const APART_MOVES: u64 = 10_000;
/// Part of the time that goes to stations one by one: with 0.5 and 0.9 as many best plans were found, or fewer.
const APART_SHARE: f64 = 0.7;
/// Part of the time that goes to beams wider than the first. With more the best plan was found less often.
const BEAM_SHARE: f64 = 0.25;
/// Moves of a search before sets are put together again: with 2500 and 10,000 the best plan was found less often.
const MOVES: u64 = 5000;
/// A search among few ways begins as hot as this part of what a plan may cost beyond the bound.
const HOT: f64 = 0.5;
/// Temperature at its end, in units of cost.
const COLD: f64 = 0.3;
/// Moves between two looks at the time while all ways are tried.
const LOOK: u64 = 64;
/// Slices in which it cools.
const SLICES: u64 = 16;

/// Looks for a plan that strands as few and misses less work until the time is used. Whether it is proven that there is
/// none.
pub(crate) fn cheaper<'w, 'p>(
    ways: &'w Ways<'p>,
    prices: &mut Prices<'w, 'p>,
    search: &mut Search<'w, 'p>,
    rng: &mut impl Rng,
    clock: &mut Clock<'_>,
) -> bool {
    let mut ends = if is_certain(ways) { Ends::Apart(None) } else { Ends::Beams { width: WIDTH, last: 0 } };
    // Moves before, and those that went to passes.
    let (mut first, mut passes) = (clock.moves, 0);
    let mut swept = Score::default();
    let mut rounds = ROUNDS_FIRST;
    while merge(ways, prices, search, clock) {}
    loop {
        let known = search.best_score;
        prices.cap_stranded(known.stranded);
        for _ in 0..rounds {
            clock.moves += prices.improve(known.cost);
        }
        rounds = ROUNDS;
        let reduced = prices.reduced(known.cost);
        if reduced.room < 0 {
            return true;
        }
        if known != swept {
            sweep(&reduced, prices, search, rng, clock);
            swept = search.best_score;
        }
        if (swept.stranded, swept.cost) < (known.stranded, known.cost) {
            continue;
        }
        let (began, gone) = (clock.moves, (clock.moves - first) as f64);
        if matches!(&ends, Ends::Apart(Some(apart)) if !apart.goes_on()) {
            ends = Ends::Beams { width: WIDTH, last: 0 };
            (first, passes) = (clock.moves, 0);
        }
        let came = match &mut ends {
            Ends::Apart(apart) if passes <= (APART_SHARE * gone) as u64 => {
                let asked = Asked { reduced: &reduced, stranded_price: prices.stranded(), below: known, until: 1.0 };
                apart.get_or_insert_with(|| Apart::new(ways, &reduced, prices)).plan(ways, asked, search, clock)
            }
            Ends::Beams { width, last } if *width <= WIDTH_MAX && passes + WIDER as u64 * *last <= (BEAM_SHARE * gone) as u64 => {
                let came = one_beam(ways, &reduced, known.stranded, (width, 1.0), clock);
                *last = clock.moves - began;
                came
            }
            _ => Came::Unknown,
        };
        passes += clock.moves - began;
        match came {
            Came::Better(chosen) if go_on_from(search, &chosen) => continue,
            Came::Proven => return true,
            _ => {}
        }
        if clock.used() >= 1.0 {
            return false;
        }
        anneal(ways, prices, search, rng, clock);
        while merge(ways, prices, search, clock) {}
        if clock.used() >= 1.0 {
            return false;
        }
    }
}

/// How an end is made.
enum Ends {
    /// Stations one by one, until wider passes promise nothing.
    Apart(Option<Apart>),
    /// All stations at a time: the next width, and the moves of the last time. What a station can promise one by one it may
    /// not be able to promise in another order, where promises need some certainty.
    Beams { width: usize, last: u64 },
}

/// Goes through all stations at a time with beginnings as wide as this, which becomes wider unless that settles something.
fn one_beam(ways: &Ways<'_>, reduced: &Reduced, stranded_max: i64, (width, until): (&mut usize, f64), clock: &mut Clock<'_>) -> Came {
    let began = clock.moves;
    let found = beam(ways, reduced, stranded_max, *width, |seen| clock.used_with(began + seen / TO_A_MOVE) < until);
    clock.moves = began + found.seen / TO_A_MOVE;
    match found.chosen {
        Some(chosen) => Came::Better(chosen),
        None if found.complete && is_certain(ways) => Came::Proven,
        None => {
            *width *= WIDER;
            Came::Unknown
        }
    }
}

/// Goes on from a plan, unless it breaks more promises than the best one.
fn go_on_from(search: &mut Search<'_, '_>, chosen: &[u32]) -> bool {
    let problem = search.draft.problem();
    let keeps = broken(problem, chosen) <= broken(problem, &search.best);
    if keeps {
        search.go_on_from(chosen);
        search.settle(SETTLED_MAX);
    }
    keeps
}

/// Tries every way that leaves room for a better plan once: a search draws its ways at random and forgets some.
fn sweep(reduced: &Reduced, prices: &Prices<'_, '_>, search: &mut Search<'_, '_>, rng: &mut impl Rng, clock: &mut Clock<'_>) {
    let ways: Vec<Vec<u32>> = reduced.ways.iter().map(|ways| ways.iter().map(|&(_, way)| way).collect()).collect();
    let began = clock.moves;
    search.return_to_best();
    let made = search.sweep(prices.guide(), rng, &ways, |made| !made.is_multiple_of(LOOK) || clock.used_with(began + made) < 1.0);
    clock.moves = began + made;
}

/// A search among the ways that leave room for a better plan.
fn anneal<'w, 'p>(ways: &'w Ways<'p>, prices: &Prices<'w, 'p>, search: &mut Search<'w, 'p>, rng: &mut impl Rng, clock: &mut Clock<'_>) {
    let known = search.best_score;
    let reduced = prices.reduced(known.cost);
    if reduced.room < 0 {
        return;
    }
    let kept = |robot: usize| {
        let mut kept: Vec<u32> = reduced.ways[robot].iter().map(|&(_, way)| way).collect();
        kept.sort_unstable();
        kept
    };
    let kept: Vec<Vec<u32>> = (0..reduced.ways.len()).map(kept).collect();
    let few = ways.only(|robot| kept[robot].clone());
    let mut draft = Draft::new(&few);
    draft.become_choice(&few.translated(ways, &search.best));
    let priced = Prices::from(&few, Level::Cost { stranded_max: known.stranded }, prices.best());
    let mut among = Search::new(draft);
    among.seen = search.seen.as_ref().map(|_| Seen::new(&few, known.stranded));
    among.sets = search.sets.as_ref().map(|_| Sets::new(&few));
    let hot = (HOT * reduced.room_in_cost()).max(2.0 * COLD);
    for slice in 0..SLICES {
        among.run(priced.guide(), rng, MOVES / SLICES, heat([hot, COLD], slice as f64 / SLICES as f64));
        clock.moves += MOVES / SLICES;
        if clock.used() >= 1.0 {
            break;
        }
    }
    if let (Some(seen), Some(new)) = (&mut search.seen, &among.seen) {
        seen.take_over(new, &kept);
    }
    if let (Some(sets), Some(new)) = (&mut search.sets, &among.sets) {
        sets.take_over(new, &kept);
    }
    if among.best_score < known {
        go_on_from(search, &ways.translated(&few, &among.best));
    }
}

/// Looks for a plan that strands fewer than the one that is known, until `until` of the time is used. How few any plan
/// strands at least; `least` are stranded in any case. `width` is that of the next beam.
pub(crate) fn fewer_stranded<'w, 'p>(
    ways: &'w Ways<'p>,
    prices: &mut Prices<'w, 'p>,
    search: &mut Search<'w, 'p>,
    least: i64,
    until: f64,
    clock: &mut Clock<'_>,
    width: &mut usize,
) -> i64 {
    let mut rounds = ROUNDS_ANEW;
    let mut part = ROOM;
    let dearest = dearest(ways);
    let mut apart: Option<Apart> = None;
    while search.best_score.stranded > least && clock.used() < until && *width <= WIDTH_MAX {
        let aim = search.best_score.stranded - 1;
        prices.cap_stranded(aim);
        // A bound of nothing would leave no room at all.
        let above = |bound: i64| bound + ((bound.max(dearest / 16) as f64 * part) as i64).max(1);
        let priced = clock.used() + PRICED * (until - clock.used());
        for _ in 0..rounds {
            if clock.used() < priced {
                clock.moves += prices.improve((prices.bound() as f64 * AIM) as i64);
            }
        }
        rounds = ROUNDS;
        if prices.bound() > dearest {
            return aim + 1;
        }
        let below = above(prices.bound());
        let reduced = prices.reduced(below);
        let is_long = clock.used_with(clock.moves + APART_MOVES) < until;
        let came = if is_certain(ways) && is_long && apart.as_ref().is_none_or(Apart::goes_on) {
            let below = Score { stranded: aim, cost: below, energy: 0 };
            let asked = Asked { reduced: &reduced, stranded_price: prices.stranded(), below, until };
            apart.get_or_insert_with(|| Apart::new(ways, &reduced, prices)).plan(ways, asked, search, clock)
        } else {
            one_beam(ways, &reduced, aim, (width, until), clock)
        };
        match came {
            Came::Better(chosen) if go_on_from(search, &chosen) => {
                (rounds, part, apart) = (ROUNDS_ANEW, ROOM, None);
                *width = WIDTH;
            }
            // There is none at any cost.
            Came::Proven if below > dearest => return if is_certain(ways) { aim + 1 } else { least },
            Came::Proven => (part, apart, *width) = (part * MORE_ROOM, None, WIDTH),
            Came::Better(_) => *width *= WIDER,
            Came::Unknown => {}
        }
    }
    least
}

/// No plan costs more.
fn dearest(ways: &Ways<'_>) -> i64 {
    let of = |robot: usize| {
        let choices = ways.of(robot);
        i64::from(choices.ways.last().map_or(choices.unserved_cost, |way| way.cost.max(choices.unserved_cost)))
    };
    (0..ways.problem().robots.len()).map(of).sum()
}

/// Whether what fits does not depend on the order in which it is entered: where promises need some certainty, those
/// that are only held to need less, and may come in after others that would not after them. What plans stations one by one counts
/// spares of one kind.
pub(crate) fn is_certain(ways: &Ways<'_>) -> bool {
    ways.problem().stations.iter().all(|station| station.chance.is_none() && station.kinds_of_spares() <= 1)
}
