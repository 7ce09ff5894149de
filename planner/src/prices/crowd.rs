//! How many can draw most at the same time: a whole number, where prices alone would sell a part of a charger too.
//!
//! A station of 3,000 W feeds four chargers of 700 W, but at prices of power alone four and two sevenths are asked for,
//! and the bound believes it. So those that draw most are counted as well: in bays from the greatest draw of a charger
//! on, beside them from the greatest draw of a pack that is charged outside its robot. Who is loaded draws more still
//! and counts twice, where that leaves the bound less to believe.

use crate::problem::{Problem, Station};

/// Who is counted, and how often.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Counted {
    /// The draws from which those in bays and those who exchange are counted.
    least: [i64; 2],
    /// The draw from which those in bays count twice: more than any charger has, so they are on the lift.
    twice: i64,
}

impl Counted {
    const NOBODY: Self = Self { least: [i64::MAX; 2], twice: i64::MAX };

    /// How often somebody counts in a bay, or else beside it, who draws this.
    #[inline]
    pub(crate) fn weight(&self, charges: bool, draw: i64) -> i64 {
        if charges { i64::from(draw >= self.least[0]) + i64::from(draw >= self.twice) } else { i64::from(draw >= self.least[1]) }
    }

    /// The most that they can count together.
    fn together(&self, there: There) -> i64 {
        let [bay, beside] = self.least;
        let mut most = 0;
        for loaded in 0..=if self.twice == i64::MAX { 0 } else { there.lift.min(there.bays) } {
            for charged in 0..=there.bays - loaded {
                let left = there.power - loaded.saturating_mul(self.twice) - charged.saturating_mul(bay);
                if left < 0 {
                    break;
                }
                most = most.max(2 * loaded + charged + (left / beside).clamp(0, there.spares));
            }
        }
        most
    }

    /// About what they would count together if parts of them counted too.
    fn believed(&self, there: There) -> f64 {
        let (mut power, mut sum) = (there.power as f64, 0.0);
        let mut take = |draw: i64, most: i64, weight: f64| {
            let count = (power / draw as f64).clamp(0.0, most as f64);
            power -= count * draw as f64;
            sum += weight * count;
            most - count as i64
        };
        let [bay, beside] = self.least;
        let loaded = if self.twice == i64::MAX { 0 } else { there.lift.min(there.bays) };
        take(self.twice, loaded, 2.0);
        let mut kinds = [(bay, there.bays - loaded), (beside, there.spares)];
        kinds.sort_unstable();
        for (draw, most) in kinds {
            take(draw, most, 1.0);
        }
        sum
    }
}

/// What there is in a tick.
#[derive(Debug, Clone, Copy)]
struct There {
    bays: i64,
    lift: i64,
    spares: i64,
    power: i64,
}

/// Who is counted at a station, and how many there can be.
#[derive(Debug)]
pub(super) struct Crowd {
    pub(super) counted: Counted,
    /// The most there can be in each tick; empty when nobody is counted.
    pub(super) there: Vec<i64>,
}

impl Crowd {
    /// `left` is what there is of bays, lift, spares and power by tick. Of some ways to count the one is taken that
    /// falls furthest short of what prices of power would believe.
    pub(super) fn new(problem: &Problem, station: &Station, left: [&[i64]; 4]) -> Self {
        let chargers = problem.batteries.iter().filter_map(|battery| battery.chargers.get(station.charger));
        let curve = || chargers.clone().flat_map(|charger| &charger.curve);
        let most = |draw: Option<i64>| draw.filter(|&draw| draw > 0).unwrap_or(i64::MAX);
        let bay = most(curve().map(|segment| segment.draw).max());
        let beside = most(curve().map(|segment| segment.draw_bare).max());
        let load = if station.load_draw > bay { station.load_draw } else { i64::MAX };
        let there: Vec<There> = (0..left[0].len())
            .map(|tick| {
                let [bays, lift, spares, power] = left.map(|row| row[tick].max(0));
                There { bays, lift, spares, power }
            })
            .collect();
        let nobody = Self { counted: Counted::NOBODY, there: Vec::new() };
        let (mut best, mut most) = (nobody, 0.0);
        for least in [[bay, i64::MAX], [bay, beside]] {
            for twice in [i64::MAX, load] {
                let counted = Counted { least, twice };
                let known: Vec<i64> = there.iter().map(|&there| counted.together(there)).collect();
                let surplus = |(&there, &known): (&There, &i64)| (counted.believed(there) - known as f64) / known.max(1) as f64;
                let surplus = there.iter().zip(&known).map(surplus).sum::<f64>() / there.len().max(1) as f64;
                if surplus > most {
                    (best, most) = (Self { counted, there: known }, surplus);
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws in bays (loading, charging fast and slowly) and beside them (fast and slowly).
    const DRAWS: [(bool, i64); 5] = [(true, 833), (true, 663), (true, 299), (false, 586), (false, 226)];

    #[test]
    fn nobody_who_finds_power_is_counted_out() {
        for least in [[663, i64::MAX], [663, 586]] {
            for twice in [i64::MAX, 833] {
                let counted = Counted { least, twice };
                for power in (0..3500).step_by(50) {
                    for (bays, lift, spares) in [(0, 1, 1), (1, 1, 0), (2, 1, 1), (3, 1, 2), (3, 2, 2), (4, 1, 0)] {
                        let most = counted.together(There { bays, lift, spares, power });
                        let mut reached = 0;
                        for number in 0..5_i64.pow(5) {
                            let counts: [i64; 5] = std::array::from_fn(|kind| number / 5_i64.pow(kind as u32) % 5);
                            let drawn: i64 = counts.iter().zip(DRAWS).map(|(count, (_, draw))| count * draw).sum();
                            let weight: i64 =
                                counts.iter().zip(DRAWS).map(|(count, (charges, draw))| count * counted.weight(charges, draw)).sum();
                            let is_possible =
                                counts[0] <= lift && counts[..3].iter().sum::<i64>() <= bays && counts[3] + counts[4] <= spares;
                            if is_possible && drawn <= power {
                                reached = reached.max(weight);
                            }
                        }
                        assert_eq!(reached, most, "{counted:?} {bays} bays {lift} lift {spares} spares {power}");
                    }
                }
            }
        }
    }
}
