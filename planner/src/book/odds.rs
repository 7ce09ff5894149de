//! Whether a station's packs hold what is promised with the probability that is asked for.

use super::Book;
use crate::problem::{Chance, Station, Tick};
use crate::supply::Limit;
use crate::way::{Choices, Way};

/// Variances are summed in so many units²: services by the hundred, of megawatt-hours, stay within 63 bits. Rounding up adds less than
/// 32 units to a deviation, 0.3 mWh where a Wh has 100,000 of them.
const PART: f64 = 1024.0;

/// What is promised of the energy of a station whose packs are not known for certain.
#[derive(Debug, Clone)]
pub(super) struct Odds<'p> {
    chance: &'p Chance,
    /// What the packs hold, less what services that have begun take.
    held: i64,
    /// The same of the packs that are there before another one comes, for each that does. All of what has begun
    /// counts, and the doubt of every pack: on the safe side.
    held_before: Vec<Limit>,
    /// What the services in the book take.
    taken: i64,
    /// Variance of that which is their own, in [`PART`]s. Whole, so that what is struck out leaves no trace.
    variance: i64,
    /// Services that were not promised before.
    new: u32,
    /// How many services end in each tick.
    ends: Vec<u16>,
    /// When services begin and end, and the variance that is their own, where another pack comes.
    spans: Vec<(Tick, Tick, i64)>,
    /// When the last service ends, of those that had begun too.
    last: Tick,
    /// The same without those in the book.
    last_begun: Tick,
}

impl<'p> Odds<'p> {
    pub(super) fn new(chance: &'p Chance, station: &Station, horizon: Tick) -> Self {
        let held = |before: Tick| {
            let there = station.packs.iter().filter(|pack| pack.available_from < i64::from(before.max(1)));
            there.map(|pack| pack.usable().max(0)).sum::<i64>() - chance.begun
        };
        let mut comes: Vec<i64> = station.packs.iter().map(|pack| pack.available_from).collect();
        comes.sort_unstable();
        comes.dedup();
        let comes = comes.into_iter().filter(|from| (1..i64::from(horizon)).contains(from)).map(|from| from as Tick);
        let held_before = comes.map(|before| Limit { before, energy: held(before) }).collect();
        let last = station.ongoing.iter().map(|ongoing| ongoing.until).max().unwrap_or(0);
        Self {
            chance,
            held: held(horizon),
            held_before,
            taken: 0,
            variance: 0,
            new: 0,
            ends: vec![0; horizon as usize + 1],
            spans: Vec::new(),
            last,
            last_begun: last,
        }
    }

    /// What is missing if this way is promised too; 0 or less when there is enough.
    pub(super) fn short(&self, choices: &Choices, way: &Way) -> i64 {
        let last = self.last.max(Tick::from(way.end));
        let (spare, sigma) = self.with(last, self.taken + way.energy, self.variance + own(way));
        (self.quantile(choices) * sigma).ceil() as i64 - spare
    }

    /// The same before a pack comes, when the packs that are there have so much left and the way draws so much by then.
    pub(super) fn short_before(&self, choices: &Choices, way: &Way, left: Limit, drawn: i64) -> i64 {
        let (last, variance) = self.of_those_before(left.before);
        let (spare, sigma) = self.before(left, last.max(Tick::from(way.end)), drawn, variance + own(way));
        (self.quantile(choices) * sigma).ceil() as i64 - spare
    }

    fn quantile(&self, choices: &Choices) -> f64 {
        if self.new == 0 && choices.held { self.chance.quantile_held } else { self.chance.quantile }
    }

    /// What is left beyond what is promised, with its standard deviation, when that is least sure: in the end, or
    /// before a pack comes. `left` is what the packs that are there before each tick have left.
    pub(super) fn margin(&self, left: &[Limit]) -> (i64, f64) {
        // Where nothing is drawn before, the station may even go dark until the pack comes.
        let is_drawn = |limit: &&Limit| self.chance.begun > 0 || limit.energy < self.held_by(limit.before);
        let between = left.iter().filter(is_drawn).map(|&limit| {
            let (last, variance) = self.of_those_before(limit.before);
            self.before(limit, last, 0, variance)
        });
        let sure = |&(spare, sigma): &(i64, f64)| spare as f64 / sigma.max(1.0);
        let end = self.with(self.last, self.taken, self.variance);
        between.chain([end]).min_by(|a, b| sure(a).total_cmp(&sure(b))).unwrap_or(end)
    }

    fn before(&self, left: Limit, last: Tick, drawn: i64, variance: i64) -> (i64, f64) {
        let (until, held, left) = (left.before.min(last), self.held_by(left.before), left.energy - drawn);
        (left - i64::from(until) * self.chance.hotel, self.chance.sigma(until, held - left, variance as f64 * PART))
    }

    /// When the last of the services ends that begin before a tick, and their variance: those that begin later ask nothing of what is there before.
    fn of_those_before(&self, before: Tick) -> (Tick, i64) {
        let early = self.spans.iter().filter(|(start, ..)| *start < before);
        early.fold((self.last_begun, 0), |(last, sum), &(_, end, variance)| (last.max(end), sum + variance))
    }

    fn held_by(&self, before: Tick) -> i64 {
        self.held_before.iter().find(|held| held.before == before).map_or(self.held, |held| held.energy)
    }

    fn with(&self, last: Tick, taken: i64, variance: i64) -> (i64, f64) {
        let spare = self.held - taken - i64::from(last) * self.chance.hotel;
        (spare, self.chance.sigma(last, taken, variance as f64 * PART))
    }

    pub(super) fn change(&mut self, choices: &Choices, way: &Way, sign: i32) {
        // What the book takes falls by a negative sign of what is left.
        let sign = i64::from(-sign);
        self.taken += sign * way.energy;
        self.variance += sign * own(way);
        let (end, span) = (usize::from(way.end), (Tick::from(way.start), Tick::from(way.end), own(way)));
        if !self.held_before.is_empty() {
            match self.spans.iter().position(|known| *known == span).filter(|_| sign < 0) {
                Some(place) => _ = self.spans.swap_remove(place),
                None => self.spans.push(span),
            }
        }
        if sign > 0 {
            self.ends[end] += 1;
            self.new += u32::from(!choices.held);
            self.last = self.last.max(Tick::from(way.end));
            return;
        }
        self.ends[end] -= 1;
        self.new -= u32::from(!choices.held);
        while self.last > self.last_begun && self.ends.get(self.last as usize).is_none_or(|&ends| ends == 0) {
            self.last -= 1;
        }
    }
}

/// The variance that is a service's own, in [`PART`]s.
fn own(way: &Way) -> i64 {
    (f64::from(way.variance) / PART).ceil() as i64
}

impl Book<'_> {
    /// The same, and before which tick it is missing: the horizon, or when a pack comes for which the way is too early.
    #[inline]
    pub(super) fn odds_clash(&self, choices: &Choices, way: &Way) -> (Tick, i64) {
        let Some(odds) = &self.odds else { return (self.horizon, 0) };
        let whole = (self.horizon, odds.short(choices, way));
        let early = self.energy.iter().filter(|limit| limit.before < self.horizon && Tick::from(way.start) < limit.before);
        let early = early.map(|&left| (left.before, odds.short_before(choices, way, left, self.drawn(choices, way, left.before))));
        early.fold(whole, |worst, here| if here.1 > worst.1 { here } else { worst })
    }

    /// Before which tick the packs are most short of what a way takes, for as much certainty as is asked for, and of how much; none where they
    /// are not.
    pub(super) fn energy_short(&self, choices: &Choices, way: &Way) -> Option<(Tick, i64)> {
        let worst =
            self.certain_short(choices, way).fold(self.odds_clash(choices, way), |worst, here| if here.1 > worst.1 { here } else { worst });
        (worst.1 > 0).then_some(worst)
    }

    /// What the packs are short of for a way before each tick that it draws before, certain as they are; 0 or less where they are not.
    pub(super) fn certain_short<'a>(&'a self, choices: &'a Choices, way: &'a Way) -> impl Iterator<Item = (Tick, i64)> + 'a {
        let concerned = self.energy.iter().filter(|limit| Tick::from(way.start) < limit.before);
        concerned.map(|limit| (limit.before, self.drawn(choices, way, limit.before) - limit.energy))
    }

    /// What a way draws before a tick.
    pub(super) fn drawn(&self, choices: &Choices, way: &Way, before: Tick) -> i64 {
        if before >= self.horizon {
            return way.energy;
        }
        if Tick::from(way.start) >= before {
            return 0;
        }
        let mut sum = 0;
        choices.draws(way, self.station, self.horizon, |from, to, draw| {
            sum += to.min(before as usize).saturating_sub(from) as i64 * draw;
        });
        sum
    }
}
