//! A station and what can begin there, laid out for a pass: arrays by tick, and prices added up beforehand.

use crate::book::Book;
use crate::prices::Reduced;
use crate::problem::Problem;
use crate::way::{Mode, NEVER, Ways};

/// Limits of energy that a beginning has room for: a station with more is not planned so.
pub(super) const LIMITS_MAX: usize = 4;
/// Power is counted in 32 bits; a station with more is not planned so.
const POWER_MAX: i64 = 1 << 29;
/// Bays, lift, slot, spares, power: each has a row of prices by tick.
const ROWS: usize = 5;
/// Where the row of power stands.
const POWER: usize = 4;

/// A way of a robot at the station.
#[derive(Debug)]
pub(super) struct Service {
    pub(super) robot: u32,
    pub(super) way: u32,
    pub(super) reduced: i64,
    pub(super) charges: bool,
    pub(super) start: usize,
    pub(super) end: usize,
    /// It draws until then.
    pub(super) drawn_to: usize,
    /// From then on the station is as if it had never been, but for a spare that does not come back.
    pub(super) gone: usize,
    /// The tick from which its spare is there again; the horizon if that is never.
    pub(super) spare_back: usize,
    /// Where its draws, by tick from its start on, and what it has paid before each of these ticks stand.
    pub(super) draws: usize,
    pub(super) paid: usize,
    /// What it draws before each limit.
    pub(super) energy: [i64; LIMITS_MAX],
    /// What it adds to a bound if it begins and nothing else is decided until somebody may begin again.
    pub(super) adds: i64,
}

impl Service {
    /// Whether it has a spare that does not come back once it is gone.
    #[inline]
    pub(super) fn keeps_spare(&self) -> bool {
        self.gone < self.spare_back
    }
}

/// A station and its services.
#[derive(Debug)]
pub(super) struct Site {
    pub(super) ticks: usize,
    /// Ticks on the lift before and after a charge.
    pub(super) lift_ticks: [usize; 2],
    pub(super) swap_ticks: usize,
    /// The ticks before which energy is limited, and what there is.
    pub(super) limits: Vec<usize>,
    pub(super) energy: [i64; LIMITS_MAX],
    /// What a unit of it is worth, which is paid when its limit comes.
    pub(super) energy_prices: [i64; LIMITS_MAX],
    /// What there is in each tick of bays, lift, slot and spares, and of power.
    pub(super) there: [Vec<i64>; POWER],
    pub(super) power: Vec<i32>,
    /// What the prices of all that there is come to before each tick.
    pub(super) earned: Vec<i64>,
    pub(super) services: Vec<Service>,
    /// Those that begin in each tick, who adds least to a bound first.
    pub(super) starts: Vec<Vec<u32>>,
    /// The next tick in which something may begin.
    pub(super) next_start: Vec<usize>,
    /// At most so much can further services that begin in a tick take off a bound.
    pub(super) relief: Vec<i64>,
    pub(super) draws: Vec<i32>,
    pub(super) paid: Vec<i64>,
    /// What each robot costs at least from each tick on, if it has not begun before.
    pub(super) least: Vec<Vec<i64>>,
    pub(super) room: i64,
}

impl Site {
    /// A station at these prices; none if it is too large for a pass.
    pub(super) fn new(ways: &Ways<'_>, station: usize, reduced: &Reduced) -> Option<Self> {
        let problem = ways.problem();
        let (ticks, at) = (problem.horizon as usize, &problem.stations[station]);
        let book = Book::new(problem, at);
        let left = book.left();
        let row = |row: usize| left[row * ticks..][..ticks].to_vec();
        let limits: Vec<usize> = book.limits().iter().map(|limit| limit.before as usize).collect();
        if limits.len() > LIMITS_MAX || left[POWER * ticks..][..ticks].iter().any(|power| power.abs() > POWER_MAX) {
            return None;
        }
        let mut energy = [0; LIMITS_MAX];
        book.limits().iter().zip(&mut energy).for_each(|(limit, energy)| *energy = limit.energy);
        let mut site = Self {
            ticks,
            lift_ticks: [at.load_ticks as usize, at.unload_ticks as usize],
            swap_ticks: at.swap_ticks as usize,
            limits,
            energy,
            energy_prices: [0; LIMITS_MAX],
            there: [row(0), row(1), row(2), row(3)],
            power: row(POWER).into_iter().map(|power| power as i32).collect(),
            earned: vec![0],
            services: Vec::new(),
            starts: vec![Vec::new(); ticks],
            next_start: vec![ticks; ticks],
            relief: vec![0; ticks],
            draws: Vec::new(),
            paid: Vec::new(),
            least: Vec::new(),
            room: reduced.room,
        };
        site.earn(reduced, station);
        for (robot, priced) in reduced.ways.iter().enumerate() {
            let mut least = vec![i64::MAX; ticks + 1];
            least[ticks] = reduced.unserved[robot];
            for &(cost, way) in priced {
                let (choices, taken) = (ways.of(robot), &ways.of(robot).ways[way as usize]);
                // What draws more than any station has does not fit, whatever its costs.
                let mut most = 0;
                choices.draws(taken, at, problem.horizon, |_, _, draw| most = most.max(draw));
                if usize::from(taken.station) == station && most <= POWER_MAX {
                    let start = site.add(problem, ways, (station, reduced), (robot, way, cost));
                    least[start] = least[start].min(cost);
                }
            }
            for tick in (0..ticks).rev() {
                least[tick] = least[tick].min(least[tick + 1]);
            }
            site.least.push(least);
        }
        site.sort();
        Some(site)
    }

    /// What all that there is is worth.
    fn earn(&mut self, reduced: &Reduced, station: usize) {
        let prices = reduced.prices(station);
        let (_, crowd_there, crowd) = reduced.crowd(station);
        let of_energy = prices[ROWS * self.ticks..].iter().take(self.limits.len());
        self.energy_prices.iter_mut().zip(of_energy).for_each(|(own, price)| *own = *price);
        let mut sum = 0;
        for tick in 0..self.ticks {
            for (row, there) in self.there.iter().enumerate() {
                sum += prices[row * self.ticks + tick] * there[tick].max(0);
            }
            sum += prices[POWER * self.ticks + tick] * i64::from(self.power[tick]).max(0);
            sum += crowd.get(tick).map_or(0, |price| price * crowd_there[tick]);
            for (place, _) in self.limits.iter().enumerate().filter(|(_, before)| **before == tick + 1) {
                sum += self.energy_prices[place] * self.energy[place].max(0);
            }
            self.earned.push(sum);
        }
    }

    /// Adds a way; the tick in which it begins.
    fn add(
        &mut self,
        problem: &Problem,
        ways: &Ways<'_>,
        (station, reduced): (usize, &Reduced),
        (robot, way, cost): (usize, u32, i64),
    ) -> usize {
        let (at, choices) = (&problem.stations[station], ways.of(robot));
        let taken = &choices.ways[way as usize];
        let (start, end) = (usize::from(taken.start), usize::from(taken.end));
        let (prices, ticks) = (reduced.prices(station), self.ticks);
        let (counted, _, crowd) = reduced.crowd(station);
        let mut by_tick = vec![0; ticks + 1 - start];
        let mut pays = |row: usize, from: usize, to: usize| {
            (from..to).for_each(|tick| by_tick[tick - start] += prices[row * ticks + tick]);
        };
        let charges = taken.charges();
        let spare_back = usize::from(taken.ready).min(ticks);
        if charges {
            pays(0, start, end);
            pays(1, start, start + self.lift_ticks[0]);
            pays(1, end - self.lift_ticks[1], end);
        } else {
            pays(2, start, end);
            pays(3, start, spare_back);
        }
        let (draws, mut drawn_to, mut energy) = (self.draws.len(), end, [0; LIMITS_MAX]);
        choices.draws(taken, at, problem.horizon, |from, to, draw| {
            for tick in from..to {
                by_tick[tick - start] += draw * prices[POWER * ticks + tick];
                by_tick[tick - start] += crowd.get(tick).map_or(0, |price| price * counted.weight(charges, draw));
                self.draws.push(draw as i32);
            }
            for (energy, &before) in energy.iter_mut().zip(&self.limits) {
                *energy += to.min(before).saturating_sub(from) as i64 * draw;
            }
            drawn_to = to.max(from);
        });
        for (place, &before) in self.limits.iter().enumerate().filter(|(_, before)| **before > start) {
            by_tick[before - 1 - start] += self.energy_prices[place] * energy[place];
        }
        let paid = self.paid.len();
        let mut sum = 0;
        self.paid.extend(by_tick.iter().map(|price| {
            sum += price;
            sum - price
        }));
        let comes_back = taken.ready != NEVER && taken.mode == Mode::SwapAndRecharge;
        let gone = if comes_back { spare_back } else { end.max(drawn_to) };
        self.starts[start].push(self.services.len() as u32);
        let robot = robot as u32;
        self.services.push(Service {
            robot,
            way,
            reduced: cost,
            charges,
            start,
            end,
            drawn_to,
            gone,
            spare_back,
            draws,
            paid,
            energy,
            adds: 0,
        });
        start
    }

    /// Sorts what begins in each tick.
    fn sort(&mut self) {
        let mut next = self.ticks;
        for tick in (0..self.ticks).rev() {
            self.next_start[tick] = next;
            let mut most = [0, 0];
            for &service in &self.starts[tick] {
                let paid = self.paid(service as usize, next);
                let service = &mut self.services[service as usize];
                service.adds = service.reduced - paid - self.least[service.robot as usize][next];
                let most = &mut most[usize::from(service.charges)];
                *most = service.adds.min(*most);
            }
            let (services, lift) = (&self.services, self.there[1][tick].max(0));
            self.starts[tick].sort_unstable_by_key(|&service| (services[service as usize].adds, service));
            // The lift brings in one at a time, the slot takes one at a time; else nobody knows how many.
            let charges = if self.lift_ticks[0] > 0 { lift } else { self.there[0][tick].max(0) };
            let exchanges = if self.swap_ticks > 0 { self.there[2][tick].max(0) } else { self.there[3][tick].max(0) };
            self.relief[tick] = most[1].saturating_mul(charges) + most[0].saturating_mul(exchanges);
            if !self.starts[tick].is_empty() {
                next = tick;
            }
        }
    }

    /// What a service has paid before a tick.
    #[inline]
    pub(super) fn paid(&self, service: usize, before: usize) -> i64 {
        let service = &self.services[service];
        self.paid[service.paid + before - service.start]
    }
}
