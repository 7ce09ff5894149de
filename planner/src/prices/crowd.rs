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
    /// Draws that are counted too, though they are less: that of who is unloaded and that of who is exchanged.
    also: [i64; 2],
    /// The draw from which those in bays count twice: more than any charger has, so they are on the lift.
    twice: i64,
}

impl Counted {
    const NOBODY: Self = Self { least: [i64::MAX; 2], also: [i64::MAX; 2], twice: i64::MAX };

    /// How often somebody counts in a bay, or else beside it, who draws this.
    #[inline]
    pub(crate) fn weight(&self, charges: bool, draw: i64) -> i64 {
        let [bay, beside] = self.least;
        if charges {
            i64::from(draw >= bay || draw == self.also[0]) + i64::from(draw >= self.twice)
        } else {
            i64::from(draw >= beside || draw == self.also[1])
        }
    }

    /// The most that they can count together.
    fn together(&self, draws: &Draws, there: There) -> i64 {
        let least = |of: &[i64], charges| of.iter().copied().filter(|&draw| self.weight(charges, draw) > 0).min();
        let (bay, beside) = (least(&draws.bay, true), least(&draws.beside, false));
        let [load, unload, swap] = draws.handling;
        let [loads, unloads, swaps] = [(true, load), (true, unload), (false, swap)].map(|(charges, draw)| self.weight(charges, draw));
        let most = |weight: i64, most: i64| if weight > 0 { most } else { 0 };
        let lift = there.lift.min(there.bays);
        let [loaded, unloaded, swapped] = [most(loads, lift), most(unloads, lift), most(swaps, there.slot.min(there.spares))];
        if (loaded + 1).saturating_mul(unloaded + 1).saturating_mul(swapped + 1) > HANDLED_MAX {
            // Nobody counts more than twice: too much, and so nothing that is worth a price.
            return 2 * there.bays + there.spares;
        }
        let mut found = 0;
        for loaded in 0..=loaded {
            for unloaded in 0..=unloaded.min(lift - loaded) {
                for swapped in 0..=swapped {
                    let handled = [(loaded, load), (unloaded, unload), (swapped, swap)];
                    let left = handled.iter().fold(there.power, |left, (count, draw)| left.saturating_sub(count.saturating_mul(*draw)));
                    if left < 0 {
                        break;
                    }
                    let count = loads * loaded + unloads * unloaded + swaps * swapped;
                    // Those who draw less come first: one that draws more in the place of one of them leaves no room for another.
                    let (free, spares) = (there.bays - loaded - unloaded, there.spares - swapped);
                    let mut kinds = [(bay, free), (beside, spares)];
                    kinds.sort_unstable_by_key(|(draw, _)| draw.unwrap_or(i64::MAX));
                    let (mut left, mut charged) = (left, 0);
                    for (draw, most) in kinds {
                        let more = draw.map_or(0, |draw| (left / draw).min(most));
                        left -= more * draw.unwrap_or(0);
                        charged += more;
                    }
                    found = found.max(count + charged);
                }
            }
        }
        found
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

    /// Counts more, as long as in nearly no tick more could be counted together: the same is then said of more.
    fn and_more(mut self, draws: &Draws, there: &[There]) -> (Self, Vec<i64>) {
        let mut known = self.all_together(draws, there);
        let [_, unload, swap] = draws.handling;
        let next = |of: &[i64], least: i64| of.iter().copied().filter(|&draw| draw < least).max();
        // Beginning with those who are there most often.
        for step in 0..6 {
            let mut more = self;
            match step {
                // Nobody counts how many draw nothing.
                0 if unload > 0 => more.also[0] = unload,
                1 if swap > 0 => more.also[1] = swap,
                0 | 1 => continue,
                2 | 4 => more.least[1] = next(&draws.beside, self.least[1]).unwrap_or(self.least[1]),
                _ => more.least[0] = next(&draws.bay, self.least[0]).unwrap_or(self.least[0]),
            }
            let then = more.all_together(draws, there);
            let same = known.iter().zip(&then).filter(|(before, then)| before == then).count();
            if same * SAME_OF >= known.len() * SAME {
                (self, known) = (more, then);
            }
        }
        (self, known)
    }

    /// The most that they can count together in each tick.
    fn all_together(&self, draws: &Draws, there: &[There]) -> Vec<i64> {
        let mut last: Option<(There, i64)> = None;
        let count = |&there: &There| match last {
            Some((before, known)) if before == there => known,
            _ => {
                let known = self.together(draws, there);
                last = Some((there, known));
                known
            }
        };
        there.iter().map(count).collect()
    }
}

/// Ways of handling robots at a time that are gone through: a lift and a slot take one or two.
const HANDLED_MAX: i64 = 4096;
/// In so many ticks of [`SAME_OF`] no more may be counted together when others are counted too: stations have fewer
/// places while services that had begun go on, and more when spares come, for a few ticks.
const SAME: usize = 4;
/// See [`SAME`].
const SAME_OF: usize = 5;

/// What there is in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct There {
    bays: i64,
    lift: i64,
    slot: i64,
    spares: i64,
    power: i64,
}

/// What is drawn at a station.
#[derive(Debug)]
struct Draws {
    /// By chargers in bays and beside them; above zero.
    bay: Vec<i64>,
    beside: Vec<i64>,
    /// While somebody is loaded, unloaded or exchanged.
    handling: [i64; 3],
}

/// Who is counted at a station, and how many there can be.
#[derive(Debug)]
pub(super) struct Crowd {
    pub(super) counted: Counted,
    /// The most there can be in each tick; empty when nobody is counted.
    pub(super) there: Vec<i64>,
}

impl Crowd {
    /// `left` is what there is of bays, lift, slot, spares and power by tick. Of some ways to count the one is taken that
    /// falls furthest short of what prices of power would believe; then others are counted too where that costs nothing.
    pub(super) fn new(problem: &Problem, station: &Station, left: [&[i64]; 5]) -> Self {
        let chargers = problem.batteries.iter().filter_map(|battery| battery.chargers.get(station.charger));
        let curve = || chargers.clone().flat_map(|charger| &charger.curve);
        let draws = Draws {
            bay: curve().map(|segment| segment.draw).filter(|&draw| draw > 0).collect(),
            beside: curve().map(|segment| segment.draw_bare).filter(|&draw| draw > 0).collect(),
            handling: [station.load_draw, station.unload_draw, station.swap_draw],
        };
        let most = |of: &[i64]| of.iter().copied().max().unwrap_or(i64::MAX);
        let (bay, beside) = (most(&draws.bay), most(&draws.beside));
        let load = if station.load_draw > bay { station.load_draw } else { i64::MAX };
        let there: Vec<There> = (0..left[0].len())
            .map(|tick| {
                let [bays, lift, slot, spares, power] = left.map(|row| row[tick].max(0));
                There { bays, lift, slot, spares, power }
            })
            .collect();
        let (mut best, mut most) = (None, 0.0);
        for least in [[bay, i64::MAX], [bay, beside]] {
            for twice in [i64::MAX, load] {
                let counted = Counted { least, twice, ..Counted::NOBODY };
                let known = counted.all_together(&draws, &there);
                let surplus = |(&there, &known): (&There, &i64)| (counted.believed(there) - known as f64) / known.max(1) as f64;
                let surplus = there.iter().zip(&known).map(surplus).sum::<f64>() / there.len().max(1) as f64;
                if surplus > most {
                    (best, most) = (Some(counted), surplus);
                }
            }
        }
        let Some(counted) = best else { return Self { counted: Counted::NOBODY, there: Vec::new() } };
        let (counted, there) = counted.and_more(&draws, &there);
        Self { counted, there }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws in bays (loading, charging fast and slowly, unloading) and beside them (exchanging, charging fast and slowly).
    const DRAWS: [(bool, i64); 7] = [(true, 833), (true, 663), (true, 299), (true, 500), (false, 400), (false, 586), (false, 226)];

    #[test]
    fn nobody_who_finds_power_is_counted_out() {
        let draws = Draws { bay: vec![663, 299], beside: vec![586, 226], handling: [833, 500, 400] };
        for (least, also) in [
            ([663, i64::MAX], [i64::MAX; 2]),
            ([663, 586], [i64::MAX; 2]),
            ([663, 586], [500, i64::MAX]),
            ([663, 226], [500, 400]),
            ([299, 586], [500, 400]),
        ] {
            for twice in [i64::MAX, 833] {
                let counted = Counted { least, also, twice };
                for power in (0..3500).step_by(125) {
                    for (bays, lift, slot, spares) in [(0, 1, 1, 1), (1, 1, 1, 0), (2, 1, 1, 1), (3, 1, 0, 2), (3, 2, 1, 2), (4, 1, 1, 0)] {
                        let most = counted.together(&draws, There { bays, lift, slot, spares, power });
                        let mut reached = 0;
                        for number in 0..3 * 5_i64.pow(6) {
                            // Nobody has more than two on the lift.
                            let counts: [i64; 7] =
                                std::array::from_fn(
                                    |kind| {
                                        if kind == 0 { number % 3 } else { number / 3 / 5_i64.pow(kind as u32 - 1) % 5 }
                                    },
                                );
                            let is_possible = counts[0] + counts[3] <= lift
                                && counts[..4].iter().sum::<i64>() <= bays
                                && counts[4] <= slot
                                && counts[4..].iter().sum::<i64>() <= spares;
                            let drawn: i64 = counts.iter().zip(DRAWS).map(|(count, (_, draw))| count * draw).sum();
                            if is_possible && drawn <= power {
                                let weigh = |(count, (charges, draw)): (&i64, (bool, i64))| count * counted.weight(charges, draw);
                                reached = reached.max(counts.iter().zip(DRAWS).map(weigh).sum());
                            }
                        }
                        assert_eq!(reached, most, "{counted:?} {bays} bays {lift} lift {slot} slot {spares} spares {power}");
                    }
                }
            }
        }
    }

    #[test]
    fn who_is_counted_too_leaves_no_room_for_more() {
        let draws = Draws { bay: vec![663, 299], beside: vec![586, 226], handling: [833, 500, 400] };
        let there = vec![There { bays: 5, lift: 1, slot: 1, spares: 2, power: 4196 }; 10];
        let few = Counted { least: [663, 586], ..Counted::NOBODY };
        let (more, known) = few.and_more(&draws, &there);
        assert_eq!(known, few.all_together(&draws, &there));
        assert_eq!(known[0], 6);
        assert_eq!(more.weight(true, 500), 1, "who is unloaded draws too much as well");
        assert_eq!(more.weight(false, 226), 0, "seven would find power if packs that are nearly full were counted");
    }
}
