//! What robots are worth to stations.
//!
//! A plan that is put together of what was seen costs at least what each robot is worth, or its lack of a service costs,
//! plus what stations cost beyond the worth of those they serve. Steps along the slope find worths at which that is most.
//! They end where it is as much as the best plan known: worths further off only make other bounds worse.

use crate::draft::Score;
use crate::narrow::sets::{Set, Sets};
use crate::prices::{Reduced, UNIT};
use crate::way::Ways;

/// Worths are whole numbers of this part of a unit of cost.
pub(super) const SCALE: i64 = 32;
/// Steps at a time.
const STEPS: u32 = 100;
/// Sets of each station that they look at, those that cost least at first.
const SETS_MAX: usize = 1000;
/// After so many steps in vain they begin at the best worths again, and are shorter.
const PATIENCE: u32 = 5;
const SHORTER: f64 = 0.6;

/// The worths, in parts of [`SCALE`].
#[derive(Debug)]
pub(super) struct Worth(Vec<f64>);

impl Worth {
    /// What robots pay at the prices at which these ways were reduced.
    pub(super) fn new(ways: &Ways<'_>, reduced: &Reduced) -> Self {
        Self((0..ways.problem().robots.len()).map(|robot| (reduced.least(robot) * SCALE) as f64 / UNIT as f64).collect())
    }

    /// As whole numbers: at these a bound is exact.
    pub(super) fn whole(&self) -> Vec<i64> {
        self.0.iter().map(|worth| worth.round() as i64).collect()
    }

    /// What robots cost at least if stations cost nothing.
    pub(super) fn alone(&self, ways: &Ways<'_>, stranded_price: i64) -> i64 {
        self.whole().iter().enumerate().map(|(robot, &worth)| worth.min(unserved(ways, robot, stranded_price))).sum()
    }

    /// What sets cost beyond the worth of their robots, at least.
    pub(super) fn least(&self, sets: &[Set]) -> i64 {
        self.columns(sets).map(|(column, ..)| column).min().unwrap_or(0)
    }

    /// What each set costs beyond the worth of its robots, and where it stands.
    fn columns(&self, sets: &[Set]) -> impl Iterator<Item = (i64, usize)> {
        let whole: Vec<f64> = self.whole().into_iter().map(|worth| worth as f64).collect();
        let sums = sums(&whole);
        sets.iter().enumerate().map(move |(place, set)| {
            let bytes = set.robots.to_le_bytes();
            let worth = bytes.iter().zip(&sums).map(|(&byte, sums)| sums[usize::from(byte)]).sum::<f64>();
            (set.cost * SCALE - worth as i64, place)
        })
    }

    /// Takes steps for a plan that costs less than this and strands no more.
    pub(super) fn step(&mut self, ways: &Ways<'_>, sets: &Sets, below: Score, stranded_price: i64) {
        let scale = SCALE as f64;
        let aim = (below.cost * SCALE + stranded_price * below.stranded) as f64;
        let unserved: Vec<f64> = (0..self.0.len()).map(|robot| unserved(ways, robot, stranded_price) as f64).collect();
        let stations: Vec<Vec<(f64, u32)>> = sets.stations.iter().map(|station| self.cheapest(&station.sets)).collect();
        let (mut now, mut best, mut pull, mut in_vain) = (self.0.clone(), f64::MIN, 1.0, 0);
        for _ in 0..STEPS {
            let (value, slope) = look(&now, &unserved, &stations);
            if value > best {
                (best, in_vain) = (value, 0);
                self.0.clone_from(&now);
            } else {
                in_vain += 1;
                if in_vain > PATIENCE {
                    (pull, in_vain) = (pull * SHORTER, 0);
                    now.clone_from(&self.0);
                }
            }
            let square: f64 = slope.iter().map(|slope| slope * slope).sum();
            if square == 0.0 || best >= aim - scale {
                return;
            }
            let step = pull * (aim - value).max(0.01 * scale) / square;
            now.iter_mut().zip(&slope).zip(&unserved).for_each(|((now, slope), without)| *now = (*now + step * slope).min(*without));
        }
    }

    /// The sets that cost least at the worths of now, with their costs.
    fn cheapest(&self, sets: &[Set]) -> Vec<(f64, u32)> {
        let mut columns: Vec<(i64, usize)> = self.columns(sets).collect();
        if columns.len() > SETS_MAX {
            columns.select_nth_unstable(SETS_MAX);
            columns.truncate(SETS_MAX);
        }
        columns.into_iter().map(|(_, place)| ((sets[place].cost * SCALE) as f64, sets[place].robots)).collect()
    }
}

/// What all costs at least at these worths, and how it changes with each.
fn look(worth: &[f64], unserved: &[f64], stations: &[Vec<(f64, u32)>]) -> (f64, Vec<f64>) {
    let mut value = worth.iter().zip(unserved).map(|(worth, without)| worth.min(*without)).sum::<f64>();
    let mut slope: Vec<f64> = worth.iter().zip(unserved).map(|(worth, without)| if worth < without { 1.0 } else { 0.0 }).collect();
    let sums = sums(worth);
    for columns in stations {
        let (mut least, mut served) = (f64::MAX, 0);
        for &(cost, robots) in columns {
            let bytes = robots.to_le_bytes();
            let cost = cost - bytes.iter().zip(&sums).map(|(&byte, sums)| sums[usize::from(byte)]).sum::<f64>();
            if cost < least {
                (least, served) = (cost, robots);
            }
        }
        value += least;
        slope.iter_mut().enumerate().for_each(|(robot, slope)| *slope -= f64::from(served >> robot & 1));
    }
    (value, slope)
}

/// What the robots that each byte of a set may name are worth together.
fn sums(worth: &[f64]) -> Vec<[f64; 256]> {
    let of = |worth: &[f64]| {
        let mut sums = [0.0; 256];
        for byte in 1..256_usize {
            let last = byte.trailing_zeros() as usize;
            sums[byte] = sums[byte & (byte - 1)] + worth.get(last).copied().unwrap_or(0.0);
        }
        sums
    };
    worth.chunks(8).map(of).collect()
}

/// What it costs not to serve a robot.
fn unserved(ways: &Ways<'_>, robot: usize, stranded_price: i64) -> i64 {
    let choices = ways.of(robot);
    i64::from(choices.unserved_cost) * SCALE + if choices.strands { stranded_price } else { 0 }
}
