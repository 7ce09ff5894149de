//! How many can draw most at the same time: a whole number, where prices alone would sell a part of a charger too.
//!
//! A station of 3,000 W feeds four chargers of 700 W, but at prices of power alone four and two sevenths are asked for,
//! and the bound believes it. So those that draw most are counted as well: in bays from the greatest draw of a charger
//! on, beside them from the greatest draw of a pack that is charged outside its robot.

use crate::problem::{Problem, Station};
use crate::way::SHARED_MIN;

/// Who is counted, and how many there can be. In a small fleet nobody is: there power is seldom what is short, and prices of more
/// rows take longer to find.
#[derive(Debug)]
pub(super) struct Crowd {
    /// The draws from which those in bays and those who exchange are counted.
    pub(super) least: [i64; 2],
    /// The most there can be in each tick; empty when nobody is counted.
    pub(super) there: Vec<i64>,
}

impl Crowd {
    /// `left` is what there is of bays, spares and power by tick.
    pub(super) fn new(problem: &Problem, station: &Station, left: [&[i64]; 3]) -> Self {
        if problem.robots.len() < SHARED_MIN {
            return Self { least: [i64::MAX; 2], there: Vec::new() };
        }
        let chargers = problem.batteries.iter().filter_map(|battery| battery.chargers.get(station.charger));
        let curve = || chargers.clone().flat_map(|charger| &charger.curve);
        let most = |draw: Option<i64>| draw.filter(|&draw| draw > 0).unwrap_or(i64::MAX);
        let bay = most(curve().map(|segment| segment.draw).max());
        let beside = most(curve().map(|segment| segment.draw_bare).max());
        let [bays, spares, power] = left;
        let by_tick = |least: [i64; 2]| -> Vec<i64> {
            let ticks = bays.iter().zip(spares).zip(power);
            ticks.map(|((&bays, &spares), &power)| together([bays, spares], least, power)).collect()
        };
        let (alone, both) = (by_tick([bay, i64::MAX]), by_tick([bay, beside]));
        // Where nobody beside them can make it more, all are counted.
        let sum = |there: &[i64]| there.iter().sum::<i64>();
        if sum(&both) <= sum(&alone) || sum(&alone) >= bays.iter().sum() {
            Self { least: [bay, beside], there: both }
        } else {
            Self { least: [bay, i64::MAX], there: alone }
        }
    }
}

/// The most of two kinds that power suffices for: so many of each there may be, and so much each draws at least.
fn together([bays, beside]: [i64; 2], [bay, spare]: [i64; 2], power: i64) -> i64 {
    let with = |first: i64| first + ((power - first.saturating_mul(bay)) / spare).clamp(0, beside.max(0));
    (0..=bays.max(0)).filter(|&first| first.saturating_mul(bay) <= power.max(0)).map(with).max().unwrap_or(0)
}
