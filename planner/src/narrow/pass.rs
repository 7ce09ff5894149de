//! Plans one station alone, tick by tick, for every set of robots at once.
//!
//! Stations share nothing but robots, so what one of them can do is gone through without the others. Every beginning of
//! a station's plan has a bound of its own, as in `beam.rs`; of those that have served the same robots and leave the
//! same future the better ones are kept, and in the end the least cost of every set is known that leaves room. Where
//! nobody was left out, sets that are missing leave none.
//!
//! A beginning knows only its last service, and by it the ones before. What bays, lift and packs have left is made up
//! from these when it is its turn, which takes less time than to book services and to strike them out again.

#[cfg(test)]
mod tests;

use crate::narrow::site::{LIMITS_MAX, Service, Site};

/// So many times as many beginnings as go on are kept at first, the most promising.
const WIDE_ENOUGH: usize = 3;
/// In a plan that has no room left each of so many services has taken its part: without this, beginnings that have put
/// everything off look best. With 4 and with 16 as many best plans were found, with 2 and without it fewer.
const SERVICES: i64 = 8;
/// Nothing has begun.
const NOBODY: u32 = u32::MAX;

/// A plan of a station that leaves room.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Planned {
    /// What it costs beyond the bound.
    pub(super) reduced: i64,
    /// Its robots, as the bits of a number.
    pub(super) robots: u32,
    /// Their ways.
    pub(super) ways: Vec<(u32, u32)>,
}

/// What came of a pass.
#[derive(Debug)]
pub(super) struct Passed {
    /// The plans that were left in the end.
    pub(super) plans: Vec<Planned>,
    /// Whether every beginning was looked at that leaves room.
    pub(super) complete: bool,
    /// Beginnings that were looked at.
    pub(super) seen: u64,
}

/// The beginning of a plan.
#[derive(Debug, Clone)]
struct Beginning {
    /// Tells robots that were served and what goes on: where it is the same, the same can follow.
    future: [u64; 2],
    served: u32,
    /// Its last service, as the place of a link.
    last: u32,
    spent: i64,
    bound: i64,
    /// How promising it is; less is better.
    rank: i64,
    /// What is left by each limit of energy.
    energy: [i64; LIMITS_MAX],
}

/// Where a pass stands.
struct Pass<'a> {
    site: &'a Site,
    /// Services, and the link of the one before.
    links: Vec<(u32, u32)>,
    next: Vec<Beginning>,
    /// By hash one more than where in `next` a beginning stands, or 0.
    places: Vec<u32>,
    kept_max: usize,
    /// Who ranks behind this is sure to be left out.
    worst: i64,
    /// What each service takes off a rank.
    credit: i64,
    left_out: bool,
    seen: u64,
    /// What energy is worth that is left, by limits that are still to come.
    prices: [i64; LIMITS_MAX],
    /// What of power and lift is left by the beginning that is gone on from.
    power: Vec<i32>,
    lift: Vec<i32>,
    going_on: Vec<u32>,
}

/// What is common to all that follows a beginning in a tick.
#[derive(Debug, Clone, Copy)]
struct Now {
    tick: usize,
    until: usize,
    bays: i64,
    slot: i64,
    spares: i64,
}

/// Looks for all that a station can do within the room, with at most `width` beginnings at a time. `go_on` is told now
/// and then how many were looked at.
pub(super) fn pass(site: &Site, width: usize, mut go_on: impl FnMut(u64) -> bool) -> Passed {
    let mut pass = Pass {
        site,
        links: Vec::new(),
        next: Vec::new(),
        places: vec![0; (4 * WIDE_ENOUGH * width).next_power_of_two()],
        kept_max: WIDE_ENOUGH * width,
        worst: i64::MAX,
        credit: site.room / SERVICES,
        left_out: false,
        seen: 0,
        prices: [0; LIMITS_MAX],
        power: vec![0; site.ticks],
        lift: vec![0; site.ticks],
        going_on: Vec::new(),
    };
    let nothing = Beginning { future: [0; 2], served: 0, last: NOBODY, spent: 0, bound: 0, rank: 0, energy: site.energy };
    let mut now = vec![nothing];
    let mut tick = 0;
    while tick < site.ticks {
        let until = site.next_start[tick];
        for (price, (limit, own)) in pass.prices.iter_mut().zip(site.limits.iter().zip(&site.energy_prices)) {
            *price = if *limit > until { *own } else { 0 };
        }
        for beginning in &now {
            pass.spread(beginning, tick, until);
        }
        pass.thin(width);
        std::mem::swap(&mut now, &mut pass.next);
        pass.next.clear();
        pass.places.fill(0);
        pass.worst = i64::MAX;
        tick = until;
        if !go_on(pass.seen) {
            return Passed { plans: Vec::new(), complete: false, seen: pass.seen };
        }
    }
    let plan = |beginning: &Beginning| Planned { reduced: beginning.bound, robots: beginning.served, ways: pass.ways(beginning.last) };
    Passed { plans: now.iter().map(plan).collect(), complete: !pass.left_out, seen: pass.seen }
}

impl Pass<'_> {
    /// A beginning goes on in a tick: with nothing more, or with any of what may begin.
    fn spread(&mut self, beginning: &Beginning, tick: usize, until: usize) {
        let site = self.site;
        let mut spent = beginning.spent + site.earned[until] - site.earned[tick];
        let mut now = Now { tick, until, bays: site.there[0][tick], slot: site.there[2][tick], spares: site.there[3][tick] };
        let (mut link, mut future, mut kept) = (beginning.last, [0; 2], 0);
        self.going_on.clear();
        while let Some(&(service, before)) = self.links.get(link as usize) {
            link = before;
            let taken = &site.services[service as usize];
            spent -= site.paid(service as usize, until) - site.paid(service as usize, tick);
            if taken.charges {
                now.bays -= i64::from(taken.end > tick);
            } else {
                now.slot -= i64::from(taken.end > tick);
                now.spares -= i64::from(taken.spare_back > tick);
                kept += u64::from(taken.keeps_spare());
            }
            if taken.gone > tick {
                self.going_on.push(service);
            }
            if taken.gone > until {
                tell(&mut future, u64::from(service) + 1);
            }
        }
        tell(&mut future, u64::from(beginning.served) | kept << 32);
        let to_come = (0..site.least.len()).filter(|robot| beginning.served >> robot & 1 == 0).map(|robot| site.least[robot][until]);
        let bound = spent + to_come.sum::<i64>();
        let after =
            Beginning { future, spent, bound, rank: bound - i64::from(beginning.served.count_ones()) * self.credit, ..beginning.clone() };
        self.keep(&after);
        let first = site.starts[tick].first().map_or(i64::MAX, |&service| site.services[service as usize].adds);
        if first == i64::MAX || bound.saturating_add(first).saturating_add(site.relief[tick]) > site.room {
            return;
        }
        // An exchange that takes no time needs no place.
        let (charge, exchange) = (now.bays > 0, (now.slot > 0 || site.swap_ticks == 0) && now.spares > 0);
        if charge || exchange {
            self.make_up(tick);
            self.begin(&after, now, 0);
        }
    }

    /// What is left of power and lift.
    fn make_up(&mut self, tick: usize) {
        let site = self.site;
        self.power[tick..].copy_from_slice(&site.power[tick..]);
        for (lift, &there) in self.lift[tick..].iter_mut().zip(&site.there[1][tick..]) {
            *lift = there as i32;
        }
        for &service in &self.going_on {
            let taken = &site.services[service as usize];
            change(&mut self.power, site, taken, tick, -1);
            if taken.charges {
                let unload = (taken.end - site.lift_ticks[1]).max(tick);
                let load = (taken.start + site.lift_ticks[0]).max(tick);
                self.lift[tick..load].iter_mut().for_each(|lift| *lift -= 1);
                self.lift[unload..taken.end.max(unload)].iter_mut().for_each(|lift| *lift -= 1);
            }
        }
    }

    /// All that can begin in this tick from this place of its list on, beside what begins already.
    fn begin(&mut self, after: &Beginning, now: Now, from: usize) {
        let site = self.site;
        for place in from..site.starts[now.tick].len() {
            let service = site.starts[now.tick][place];
            let taken = &site.services[service as usize];
            let bound = after.bound + taken.adds;
            if bound + site.relief[now.tick] > site.room {
                break;
            }
            if after.served >> taken.robot & 1 == 1 || !self.fits(taken, after, now) {
                continue;
            }
            let mut with = after.clone();
            with.served |= 1 << taken.robot;
            (with.bound, with.rank) = (bound, after.rank + taken.adds - self.credit);
            with.spent = after.spent + taken.reduced - site.paid(service as usize, now.until);
            with.energy.iter_mut().zip(&taken.energy).for_each(|(left, drawn)| *left -= drawn);
            with.last = self.links.len() as u32;
            tell(&mut with.future, 1 << 40 | u64::from(taken.robot));
            if taken.gone > now.until {
                tell(&mut with.future, u64::from(service) + 1);
            }
            if taken.keeps_spare() {
                tell(&mut with.future, 1 << 50);
            }
            self.links.push((service, after.last));
            let links = self.links.len();
            let kept = self.keep(&with);
            let mut then = now;
            if taken.charges {
                then.bays -= 1;
            } else {
                then.slot -= i64::from(taken.end > now.tick);
                then.spares -= i64::from(taken.spare_back > now.tick);
            }
            let is_lifted = taken.charges && site.lift_ticks[0] > 0;
            let charge = then.bays > 0 && (site.lift_ticks[0] == 0 || self.lift[now.tick] > i32::from(is_lifted));
            if charge || ((then.slot > 0 || site.swap_ticks == 0) && then.spares > 0) {
                self.occupy(taken, -1);
                self.begin(&with, then, place + 1);
                self.occupy(taken, 1);
            }
            if !kept && self.links.len() == links {
                self.links.pop();
            }
        }
    }

    /// Whether there is room for a service.
    fn fits(&self, taken: &Service, after: &Beginning, now: Now) -> bool {
        let site = self.site;
        if taken.charges {
            let [load, unload] = site.lift_ticks;
            let none = |lift: &i32| *lift <= 0;
            if now.bays <= 0
                || self.lift[now.tick..now.tick + load].iter().any(none)
                || self.lift[taken.end - unload..taken.end].iter().any(none)
            {
                return false;
            }
        } else if (now.slot <= 0 && taken.end > now.tick) || (now.spares <= 0 && taken.spare_back > now.tick) {
            return false;
        }
        if taken.energy.iter().zip(&after.energy).any(|(drawn, left)| drawn > left) {
            return false;
        }
        let draws = &site.draws[taken.draws..][..taken.drawn_to - taken.start];
        // The sign of the sum of all signs: no branch in it, so that several ticks are compared at once.
        self.power[taken.start..taken.drawn_to].iter().zip(draws).fold(0, |short, (power, draw)| short | (power - draw)) >= 0
    }

    fn occupy(&mut self, taken: &Service, by: i32) {
        let site = self.site;
        change(&mut self.power, site, taken, taken.start, by);
        if taken.charges {
            self.lift[taken.start..taken.start + site.lift_ticks[0]].iter_mut().for_each(|lift| *lift += by);
            self.lift[taken.end - site.lift_ticks[1]..taken.end].iter_mut().for_each(|lift| *lift += by);
        }
    }

    /// Keeps a beginning, unless it leaves no room or another with the same future is as good. Whether it is kept.
    fn keep(&mut self, beginning: &Beginning) -> bool {
        self.seen += 1;
        if beginning.bound > self.site.room || beginning.rank > self.worst {
            return false;
        }
        let last = self.places.len() - 1;
        let mut at = beginning.future[0] as usize & last;
        while let Some(other) = self.places[at].checked_sub(1) {
            let other = &mut self.next[other as usize];
            if other.future == beginning.future {
                // What is spent holds the price of energy that was drawn, though nothing is paid for it until its limit: whoever has drawn less would
                // look cheaper by what the same energy costs it later.
                let owed = |of: &Beginning| of.spent + self.prices.iter().zip(&of.energy).map(|(price, left)| price * left).sum::<i64>();
                let no_less = |a: &Beginning, b: &Beginning| owed(a) <= owed(b) && a.energy.iter().zip(&b.energy).all(|(a, b)| a >= b);
                if no_less(other, beginning) {
                    return false;
                }
                if no_less(beginning, other) {
                    other.clone_from(beginning);
                    return true;
                }
            }
            at = (at + 1) & last;
        }
        self.next.push(beginning.clone());
        self.places[at] = self.next.len() as u32;
        if self.next.len() >= self.kept_max {
            self.thin(self.kept_max / WIDE_ENOUGH);
        }
        true
    }

    /// Leaves the most promising beginnings, so many.
    fn thin(&mut self, width: usize) {
        if self.next.len() > width {
            let (_, worst, _) = self.next.select_nth_unstable_by_key(width, |beginning| (beginning.rank, beginning.future));
            self.worst = worst.rank;
            self.left_out = true;
            self.next.truncate(width);
        }
        self.places.fill(0);
        let last = self.places.len() - 1;
        for (beginning, place) in self.next.iter().zip(1..) {
            let mut at = beginning.future[0] as usize & last;
            while self.places[at] != 0 {
                at = (at + 1) & last;
            }
            self.places[at] = place;
        }
    }

    /// The ways of all services up to a link.
    fn ways(&self, mut link: u32) -> Vec<(u32, u32)> {
        let mut ways = Vec::new();
        while let Some(&(service, before)) = self.links.get(link as usize) {
            let taken = &self.site.services[service as usize];
            ways.push((taken.robot, taken.way));
            link = before;
        }
        ways
    }
}

/// What a service draws from a tick on is added to the power that is left, or taken from it.
#[inline]
fn change(power: &mut [i32], site: &Site, taken: &Service, from: usize, by: i32) {
    let draws = &site.draws[taken.draws..][..taken.drawn_to - taken.start];
    let from = from.min(taken.drawn_to);
    power[from..taken.drawn_to].iter_mut().zip(&draws[from - taken.start..]).for_each(|(power, draw)| *power += by * draw);
}

/// Takes a word of what is still to come into a hash of all of it.
#[inline]
pub(super) fn tell(future: &mut [u64; 2], word: u64) {
    // Two odd multipliers with well spread bits (the golden ratio's and that of murmur's finaliser).
    for (hash, by) in future.iter_mut().zip([0x9e37_79b9_7f4a_7c15, 0xff51_afd7_ed55_8ccd]) {
        *hash = (u64::rotate_left(*hash, 23) ^ word).wrapping_mul(by);
    }
}
