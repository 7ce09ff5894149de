//! What of a station is taken, tick by tick: the only place where bays, lift, swap slot, spares,
//! power and energy are promised.
//!
//! Beside each row of counters stands a row of flags "nothing left here", so that most ways that
//! do not fit are refused by a look at one or two words.

mod clash;
mod counters;
mod gates;
mod odds;
mod rack;

use crate::bits::Bits;
use crate::guide::Spot;
use crate::problem::{Problem, Station, Tick};
use crate::supply::{self, Limit};
use crate::way::{At, Choices, Mode, NEVER, Starts, Way};
pub use clash::Clash;
use counters::Counters;
use gates::{Gates, Kept};
use odds::Odds;
use rack::Rack;

/// The rows of [`Book::left_at`] that bays, lift and slot, 0 to 2, do not take.
const SPARE_ROW: usize = 3;
const POWER_ROW: usize = 4;

/// The book of one station.
#[derive(Debug, Clone)]
pub struct Book<'p> {
    station: &'p Station,
    horizon: Tick,
    /// The greatest draw that a stretch of a way can have, per tick.
    draw_max: i64,
    bays: Counters,
    lift: Counters,
    slot: Counters,
    /// Spares that are charged and not handed out.
    spares: Rack,
    /// The flags of all of these once more.
    gates: Gates,
    /// Whether nobody is to be given a place.
    closed: bool,
    /// What may still be drawn in each tick.
    headroom: Vec<i64>,
    /// Ticks in which some way may ask for more than the headroom.
    tight: Bits,
    /// What the packs can still give, by when.
    energy: Vec<Limit>,
    /// How certain that is, where it is not for certain.
    odds: Option<Odds<'p>>,
    /// Robots with a way at this station.
    pub robots: Vec<u32>,
    /// These ways, in the same order.
    pub(crate) taken: Vec<Way>,
}

impl<'p> Book<'p> {
    /// A book with nothing in it but what had begun at tick 0.
    #[must_use]
    pub fn new(problem: &'p Problem, station: &'p Station) -> Self {
        let horizon = problem.horizon;
        let ticks = horizon as usize;
        let chargers = problem.batteries.iter().filter_map(|battery| battery.chargers.get(station.charger));
        let curve = chargers.flat_map(|charger| &charger.curve).map(|segment| segment.draw.max(segment.draw_bare));
        let draw_max = curve.chain([station.load_draw, station.unload_draw, station.swap_draw]).max().unwrap_or(0);
        let spares = Rack::new(station, horizon);
        let lift_ticks = [station.load_ticks, station.unload_ticks].map(|ticks| ticks as usize);
        let mut book = Self {
            station,
            horizon,
            draw_max,
            bays: Counters::new(ticks, i64::from(station.bays), station.ongoing.len()),
            lift: Counters::new(ticks, station.lift_slots, station.ongoing.len()),
            slot: Counters::new(ticks, station.swap_slots, station.ongoing.len()),
            gates: Gates::new(ticks, lift_ticks, station.swap_ticks as usize, spares.len()),
            spares,
            closed: false,
            headroom: problem.base_load(station).iter().map(|draw| station.p_max - draw).collect(),
            tight: Bits::new(ticks, false),
            energy: supply::limits(station, horizon),
            odds: station.chance.as_ref().map(|chance| Odds::new(chance, station, horizon)),
            robots: Vec::new(),
            taken: Vec::new(),
        };
        // Who comes into a bay after another takes it from when that one leaves.
        let mut held: Vec<usize> = vec![0; station.bays as usize];
        for ongoing in &station.ongoing {
            let until = ongoing.until.min(horizon) as usize;
            let from = (ongoing.from as usize).min(until);
            match ongoing.bay {
                Some(bay) => {
                    let held = &mut held[bay as usize];
                    if until > *held {
                        book.bays.change(*held, until, -1);
                        *held = until;
                    }
                }
                None => book.slot.change(from, until, -1),
            }
            let load = (from + ongoing.load_ticks as usize).min(until);
            let unload = (ongoing.until.saturating_sub(ongoing.unload_ticks) as usize).min(until).max(load);
            book.lift.change(from, load, -1);
            book.lift.change(unload, until, -1);
        }
        let base = problem.base_load(station);
        for limit in &mut book.energy {
            let begun = station.chance.as_ref().map_or(0, |chance| chance.begun);
            limit.energy -= begun + base[..limit.before as usize].iter().sum::<i64>();
        }
        book.tight.put(0, &book.headroom, |&room| room < draw_max);
        [true, false].into_iter().for_each(|charge| book.renew_gates(charge, 0, ticks));
        book
    }

    /// Leaves no place for anybody.
    pub(crate) fn close(&mut self) {
        self.closed = true;
        self.gates.shut();
    }

    /// Whether it was closed.
    pub(crate) fn is_closed(&self) -> bool {
        self.closed
    }

    /// Whether there is room for a way.
    #[inline]
    #[must_use]
    pub fn fits(&self, choices: &Choices, way: &Way) -> bool {
        let (start, end) = (usize::from(way.start), usize::from(way.end));
        let drawn_to = if let Mode::Charge(_) = way.mode {
            if self.gates.refuse_charge(start, end) {
                return false;
            }
            end
        } else {
            if self.gates.refuse_exchange(start, end, (way.spares, self.spare_back(way))) {
                return false;
            }
            if way.ready == NEVER { end } else { self.spare_back(way) }
        };
        self.feeds_until(choices, way, drawn_to)
    }

    /// Whether there is a place for a way; power and energy are not asked for.
    #[inline]
    pub(crate) fn has_place(&self, choices: &Choices, spot: &Spot) -> bool {
        let (start, end) = (usize::from(spot.start), usize::from(spot.end));
        if spot.back == 0 {
            !self.gates.refuse_charge(start, end)
        } else {
            let kind = if self.spares.len() > 1 { choices.ways[spot.way as usize].spares } else { 0 };
            !self.gates.refuse_exchange(start, end, (kind, usize::from(spot.back).min(self.horizon as usize)))
        }
    }

    /// Whether power and energy are there for a way that has a place, as [`Self::tell_places`] tells them.
    #[inline]
    pub(crate) fn feeds_in_place(&self, choices: &Choices, way: &Way) -> bool {
        self.feeds_until(choices, way, if way.ready == NEVER { usize::from(way.end) } else { self.spare_back(way) })
    }

    /// The same for a way that draws until this tick.
    #[inline]
    fn feeds_until(&self, choices: &Choices, way: &Way, drawn_to: usize) -> bool {
        if !self.may_feed(way) {
            return false;
        }
        let start = usize::from(way.start);
        // Limits rise with time, so a way that all packs can pay may still come too early.
        let plenty = self.energy.iter().all(|limit| Tick::from(way.start) >= limit.before || way.energy <= limit.energy);
        let calm = !self.tight.any(start, drawn_to.min(self.horizon as usize));
        if plenty && calm { self.odds_short(choices, way) <= 0 } else { self.feeds(choices, way) }
    }

    /// Tells those of a robot's ways of one kind here that have a place; power and energy are not asked for.
    pub(crate) fn tell_places(&self, starts: &Starts, at: &At, limit: i64, tell: &mut impl FnMut(u32)) {
        self.gates.tell(starts, at, limit, tell);
    }

    fn spare_back(&self, way: &Way) -> usize {
        usize::from(way.ready).min(self.horizon as usize)
    }

    /// Whether power and energy are there for a way, wherever it may take place.
    #[must_use]
    pub fn feeds(&self, choices: &Choices, way: &Way) -> bool {
        self.may_feed(way) && self.draw_clash(choices, way).is_none()
    }

    /// Whether all packs together still hold what a way takes: where they do not, nothing else needs a look.
    fn may_feed(&self, way: &Way) -> bool {
        self.energy.last().is_none_or(|limit| way.energy <= limit.energy)
    }

    /// What is missing for as much certainty as is asked for; 0 or less when there is enough.
    #[inline]
    fn odds_short(&self, choices: &Choices, way: &Way) -> i64 {
        self.odds_clash(choices, way).1
    }

    /// Enters a robot's way; it must fit.
    pub fn take(&mut self, robot: usize, choices: &Choices, way: &Way) {
        self.robots.push(robot as u32);
        self.taken.push(*way);
        self.change(choices, way, -1);
    }

    /// Strikes a robot's way out; it must be in.
    pub fn give_back(&mut self, robot: usize, choices: &Choices, way: &Way) {
        if let Some(place) = self.robots.iter().position(|&other| other == robot as u32) {
            self.robots.swap_remove(place);
            self.taken.swap_remove(place);
        }
        self.change(choices, way, 1);
    }

    fn change(&mut self, choices: &Choices, way: &Way, sign: i32) {
        let (start, end) = (usize::from(way.start), usize::from(way.end));
        let charge = matches!(way.mode, Mode::Charge(_));
        if charge {
            self.bays.change(start, end, sign);
            self.lift.change(start, start + self.station.load_ticks as usize, sign);
            self.lift.change(end - self.station.unload_ticks as usize, end, sign);
        } else {
            self.slot.change(start, end, sign);
            self.spares.change(way.spares, start, self.spare_back(way), sign);
        }
        self.renew_gates(charge, start, end.max(if charge { 0 } else { self.spare_back(way) }));
        if let Some(odds) = &mut self.odds {
            odds.change(choices, way, sign);
        }
        let (headroom, draw_max) = (&mut self.headroom, self.draw_max);
        // The last limit is that of the horizon: all that a way takes counts for it.
        let (whole, parts): (&mut [Limit], &mut [Limit]) = match self.energy.split_last_mut() {
            Some((last, parts)) if last.before >= self.horizon => (std::slice::from_mut(last), parts),
            _ => (&mut [], &mut self.energy),
        };
        whole.iter_mut().for_each(|limit| limit.energy += i64::from(sign) * way.energy);
        let first = parts.partition_point(|limit| limit.before as usize <= start);
        let parts = &mut parts[first..];
        let mut last = start;
        choices.draws(way, self.station, self.horizon, |from, to, draw| {
            let draw = i64::from(sign) * draw;
            headroom[from..to].iter_mut().for_each(|room| *room += draw);
            for limit in &mut *parts {
                limit.energy += to.min(limit.before as usize).saturating_sub(from) as i64 * draw;
            }
            last = to;
        });
        self.tight.put(start, &headroom[start..last], |&room| room < draw_max);
    }

    fn renew_gates(&mut self, charge: bool, from: usize, to: usize) {
        let Self { bays, lift, slot, spares, .. } = self;
        let kept = Kept { bays: bays.none(), lift: lift.none(), slot: slot.none() };
        if charge {
            self.gates.renew_charges(&kept, from, to);
        } else {
            self.gates.renew_exchanges(&kept, spares.all_none(), from, to);
        }
    }

    /// Energy that all ways in the book and the station itself draw before a tick.
    #[must_use]
    pub fn drawn_before(&self, before: Tick) -> i64 {
        self.headroom[..before as usize].iter().map(|room| self.station.p_max - room).sum()
    }

    /// How many packs the load needs: the fewest. All packs if even they do not suffice.
    #[must_use]
    pub fn packs(&self) -> Vec<usize> {
        supply::fewest_packs(self.station, self.horizon, |before| self.drawn_before(before))
            .unwrap_or_else(|_| (0..self.station.packs.len()).collect())
    }

    /// What is left of bays, lift, slot, spares and power in each tick and then of energy by its limits.
    pub(crate) fn left(&self) -> Vec<i64> {
        let ticks = self.horizon as usize;
        let by_tick = (0..=POWER_ROW).flat_map(|row| (0..ticks).map(move |tick| self.left_at(row, tick)));
        by_tick.chain(self.energy.iter().map(|limit| limit.energy)).collect()
    }

    /// What is left in a tick of bays, lift, slot, spares or power: the rows of [`Self::left`].
    pub(crate) fn left_at(&self, row: usize, tick: usize) -> i64 {
        match row {
            POWER_ROW => self.headroom[tick],
            SPARE_ROW => self.spares.left_at(tick),
            _ => [&self.bays, &self.lift, &self.slot][row].left_at(tick),
        }
    }

    /// Tells in words how many spares are left from a tick on.
    pub(crate) fn spares_from(&self, tick: usize, tell: impl FnMut(u64)) {
        self.spares.from(tick, tell);
    }

    /// The ticks that it has.
    pub(crate) fn horizon(&self) -> Tick {
        self.horizon
    }

    /// How much there is of bay ticks, lift ticks, spares and energy; at least 1 of each.
    pub(crate) fn plenty(&self) -> [f64; 4] {
        let sum = |counters: &Counters| counters.left(self.horizon).map(|left| left.max(0) as f64).sum::<f64>();
        let spares = self.horizon.checked_sub(1).map_or(0, |last| self.spares.left_at(last as usize));
        let energy = self.energy.last().map_or(0, |limit| limit.energy);
        [sum(&self.bays), sum(&self.lift), spares as f64, energy as f64].map(|there| there.max(1.0))
    }

    /// What the packs can still give, by when.
    #[must_use]
    pub fn limits(&self) -> &[Limit] {
        &self.energy
    }

    /// What the packs hold beyond what is promised, and its standard deviation, once everything that is in
    /// the book has ended, or before a pack comes if that is less sure: `(units, units)`. None where everything
    /// is known for certain.
    #[must_use]
    pub fn margin(&self) -> Option<(i64, f64)> {
        self.odds.as_ref().map(|odds| odds.margin(&self.energy))
    }

    /// The station.
    #[must_use]
    pub fn station(&self) -> &'p Station {
        self.station
    }
}
