//! Prices as running sums by tick, so that a stretch of ticks is priced by one subtraction.

use std::ops::Range;

use super::crowd::Counted;
use super::layout::{BAY, BY_TICK, CROWD, LIFT, Layout, POWER, SLOT, SPARE};
use crate::problem::Problem;
use crate::way::{Choices, Mode, Way};

/// Tables of places at a station.
const PLACES: usize = 4;

/// Whole prices, added up beforehand: a place at a station costs what its beginning costs and what its end costs,
/// since how long it stands on the lift or in the slot is the same for all ways of a station.
#[derive(Debug, Clone)]
pub(super) struct Table {
    width: usize,
    /// For each station what it costs to begin a charge in each tick, to end one, to begin an exchange, and to
    /// give its spare back.
    places: Vec<i64>,
    /// For each station the running sums of the price of power: at t over all ticks before it.
    power: Vec<i64>,
    /// For each station the tick until which power costs the same as in each tick.
    same_until: Vec<u16>,
    /// For each station the running sums of the price of being one of its crowd, and who is.
    crowd: Vec<i64>,
    crowded: Vec<Counted>,
    earned: i128,
}

impl Table {
    pub(super) fn new(layout: &Layout, prices: &[f64], unit: i64) -> Self {
        let stations = layout.before.len();
        let part = |stations: Range<usize>| Self::of_stations(layout, prices, unit, stations);
        if layout.is_small() {
            return part(0..stations);
        }
        let (mut table, other) = rayon::join(|| part(0..stations / 2), || part(stations / 2..stations));
        table.places.extend(other.places);
        table.power.extend(other.power);
        table.same_until.extend(other.same_until);
        table.crowd.extend(other.crowd);
        table.earned += other.earned;
        table
    }

    /// The part of some stations.
    fn of_stations(layout: &Layout, prices: &[f64], unit: i64, stations: Range<usize>) -> Self {
        let (ticks, width) = (layout.ticks, layout.ticks + 1);
        let count = layout.before.len();
        let (places, power) = (Vec::with_capacity(count * PLACES * width), Vec::with_capacity(count * width));
        let (same_until, crowd) = (Vec::with_capacity(count * width), Vec::with_capacity(count * width));
        let mut table = Self { width, places, power, same_until, crowd, crowded: layout.crowded(), earned: 0 };
        let mut sums = vec![0; BY_TICK * width];
        let whole = |row: usize| (prices[row] * layout.inverse[row] * unit as f64) as i64;
        for station in stations {
            let first = layout.first[station];
            let energy: Vec<i64> = (first + BY_TICK * ticks..layout.crowd(station)).map(whole).collect();
            for (place, &price) in energy.iter().enumerate() {
                table.earned += i128::from(price) * i128::from(layout.there[first + BY_TICK * ticks + place]);
            }
            for row in 0..BY_TICK {
                let mut later: i64 = energy.iter().sum();
                let mut limits = layout.before[station].iter().zip(&energy).peekable();
                let rows = first + row * ticks + layout.asked.start..first + row * ticks + layout.asked.end;
                let out = &mut sums[row * width..][..width];
                // Most rows are asked for nothing.
                if prices[rows].iter().all(|&price| price == 0.0) && (row != POWER || later == 0) {
                    out.fill(0);
                    continue;
                }
                out[..=layout.asked.start].fill(0);
                for tick in layout.asked.clone() {
                    let at = first + row * ticks + tick;
                    let mut price = whole(at);
                    table.earned += i128::from(price) * i128::from(layout.there[at]);
                    if row == POWER {
                        // What is drawn in a tick also counts for every energy limit after it.
                        while let Some((_, passed)) = limits.next_if(|&(&before, _)| before <= tick) {
                            later -= passed;
                        }
                        price += later;
                    }
                    out[tick + 1] = out[tick] + price;
                }
                let last = out[layout.asked.end];
                out[layout.asked.end..].fill(last);
            }
            let crowd = layout.crowd(station)..layout.first[station + 1];
            let mut sum = 0;
            table.crowd.extend((0..width).map(|tick| {
                let before = sum;
                if let Some(at) = crowd.clone().nth(tick) {
                    table.earned += i128::from(whole(at)) * i128::from(layout.there[at]);
                    sum += whole(at);
                }
                before
            }));
            table.add_up(&sums, layout.handling[station]);
        }
        table
    }

    /// The places of a station, from the running sums of its rows.
    fn add_up(&mut self, sums: &[i64], [load, unload, swap]: [usize; 3]) {
        let (width, last) = (self.width, self.width - 1);
        let row = |row: usize| &sums[row * width..][..width];
        let (bay, lift, slot, spare) = (row(BAY), row(LIFT), row(SLOT), row(SPARE));
        let until = |row: &[i64], from: usize, ticks: usize| row[(from + ticks).min(last)] - row[from];
        self.places.extend((0..width).map(|start| until(lift, start, load) - bay[start]));
        self.places.extend((0..width).map(|end| bay[end] + lift[end] - lift[end.saturating_sub(unload)]));
        self.places.extend((0..width).map(|start| until(slot, start, swap) - spare[start]));
        self.places.extend_from_slice(spare);
        let power = row(POWER);
        self.power.extend_from_slice(power);
        let first = self.same_until.len();
        self.same_until.resize(first + width, last as u16);
        let same_until = &mut self.same_until[first..];
        for tick in (0..last.saturating_sub(1)).rev() {
            let same = power[tick + 1] - power[tick] == power[tick + 2] - power[tick + 1];
            same_until[tick] = if same { same_until[tick + 1] } else { tick as u16 + 1 };
        }
    }

    /// What the prices bring in for all that there is.
    pub(super) fn earned(&self) -> i128 {
        self.earned
    }

    /// What a way pays for what it takes.
    #[inline]
    pub(super) fn of(&self, problem: &Problem, choices: &Choices, way: &Way) -> i64 {
        self.place(way) + self.fed(problem, choices, way)
    }

    /// The same, if it is less than a limit.
    #[inline]
    pub(super) fn below(&self, problem: &Problem, choices: &Choices, way: &Way, limit: i64) -> Option<i64> {
        let place = self.place(way);
        // Power is dearer to ask for than a place, and has no negative price.
        if place >= limit {
            return None;
        }
        Some(place + self.fed(problem, choices, way)).filter(|&paid| paid < limit)
    }

    /// What a way pays for its place.
    #[inline]
    fn place(&self, way: &Way) -> i64 {
        let width = self.width;
        let places = &self.places[usize::from(way.station) * PLACES * width..][..PLACES * width];
        let (kind, end) = if way.charges() { (0, way.end) } else { (2 * width, way.ready) };
        places[kind + usize::from(way.start)] + places[kind + width + usize::from(end).min(width - 1)]
    }

    /// What a way pays for power, and for being one of a crowd.
    #[inline]
    fn fed(&self, problem: &Problem, choices: &Choices, way: &Way) -> i64 {
        let (width, at) = (self.width, usize::from(way.station));
        let start = usize::from(way.start);
        // An exchange that gives no spare back draws until its end.
        let to = if way.mode == Mode::SwapAndRecharge { usize::from(way.ready).min(width - 1) } else { usize::from(way.end) };
        let (power, crowd) = (&self.power[at * width..][..width], &self.crowd[at * width..][..width]);
        if crowd[start] == crowd[to] && usize::from(self.same_until[at * width + start]) >= to {
            (power[start + 1] - power[start]) * way.energy
        } else {
            self.drawn(problem, choices, way)
        }
    }

    /// What a way pays for power, where that is not the same in all ticks.
    fn drawn(&self, problem: &Problem, choices: &Choices, way: &Way) -> i64 {
        let at = usize::from(way.station);
        let (power, crowd) = (&self.power[at * self.width..][..self.width], &self.crowd[at * self.width..][..self.width]);
        let (counted, charges) = (self.crowded[at], way.charges());
        let mut paid = 0;
        choices.draws(way, &problem.stations[at], problem.horizon, |from, to, draw| {
            paid += draw * (power[to] - power[from]);
            paid += counted.weight(charges, draw) * (crowd[to] - crowd[from]);
        });
        paid
    }
}

/// What all chosen ways ask for, as differences from tick to tick.
pub(super) struct Uses {
    width: usize,
    changes: Vec<i64>,
    crowded: Vec<Counted>,
}

impl Uses {
    pub(super) fn new(layout: &Layout) -> Self {
        let width = layout.ticks + 1;
        Self { width, changes: vec![0; layout.before.len() * (BY_TICK + 1) * width], crowded: layout.crowded() }
    }

    pub(super) fn add(&mut self, problem: &Problem, choices: &Choices, way: &Way) {
        let width = self.width;
        let changes = &mut self.changes[usize::from(way.station) * (BY_TICK + 1) * width..][..(BY_TICK + 1) * width];
        let station = &problem.stations[usize::from(way.station)];
        let mut stretch = |row: usize, from: usize, to: usize, by: i64| {
            changes[row * width + from] += by;
            changes[row * width + to] -= by;
        };
        let (start, end) = (usize::from(way.start), usize::from(way.end));
        if let Mode::Charge(_) = way.mode {
            stretch(BAY, start, end, 1);
            stretch(LIFT, start, start + station.load_ticks as usize, 1);
            stretch(LIFT, end - station.unload_ticks as usize, end, 1);
        } else {
            stretch(SLOT, start, end, 1);
            stretch(SPARE, start, usize::from(way.ready).min(width - 1), 1);
        }
        let (counted, charges) = (self.crowded[usize::from(way.station)], way.charges());
        choices.draws(way, station, problem.horizon, |from, to, draw| {
            stretch(POWER, from, to, draw);
            let weight = counted.weight(charges, draw);
            if weight > 0 {
                stretch(CROWD, from, to, weight);
            }
        });
    }

    /// What these and others ask for.
    pub(super) fn and(mut self, others: &Self) -> Self {
        self.changes.iter_mut().zip(&others.changes).for_each(|(change, other)| *change += other);
        self
    }

    /// What is asked for beyond what there is, in units of the prices.
    pub(super) fn over(&self, layout: &Layout, over: &mut [f64]) {
        let stations = layout.before.len();
        if layout.is_small() {
            return self.over_at(layout, 0..stations, over);
        }
        let (one, other) = over.split_at_mut(layout.first[stations / 2]);
        rayon::join(|| self.over_at(layout, 0..stations / 2, one), || self.over_at(layout, stations / 2..stations, other));
    }

    /// The same for the rows of some stations.
    fn over_at(&self, layout: &Layout, stations: Range<usize>, over: &mut [f64]) {
        let begin = layout.first[stations.start];
        for station in stations {
            let first = layout.first[station];
            let (mut drawn, asked_in) = (vec![0; self.width], &layout.asked);
            for row in 0..BY_TICK {
                let changes = &self.changes[(station * (BY_TICK + 1) + row) * self.width..][..self.width];
                let mut asked = 0;
                for tick in asked_in.clone() {
                    asked += changes[tick];
                    let at = first + row * layout.ticks + tick;
                    over[at - begin] = (asked - layout.there[at]) as f64 * layout.inverse[at];
                    if row == POWER {
                        drawn[tick + 1] = drawn[tick] + asked;
                    }
                }
            }
            let all = drawn[asked_in.end];
            drawn[asked_in.end..].fill(all);
            let changes = &self.changes[(station * (BY_TICK + 1) + CROWD) * self.width..][..self.width];
            let mut asked = 0;
            for (at, change) in (layout.crowd(station)..layout.first[station + 1]).zip(changes) {
                asked += change;
                over[at - begin] = (asked - layout.there[at]) as f64;
            }
            for (place, &before) in layout.before[station].iter().enumerate() {
                let at = first + BY_TICK * layout.ticks + place;
                over[at - begin] = (drawn[before] - layout.there[at]) as f64 * layout.inverse[at];
            }
        }
    }
}
