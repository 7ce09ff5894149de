//! Single readings that are off, which are no thing that comes and goes.

use super::rows::{Found, REFITS, ROUNDS, Rows, Settled};
use crate::infer::frame::Frame;

/// Rows one behind the other that still are single readings, and share of all that must be such.
const TOGETHER: usize = 2;
const MOST: f64 = 0.8;

impl Rows {
    /// Single readings that are off, each by its own amount: what is left is left of all others.
    pub(super) fn readings_off(&self) -> Found {
        // A reading takes all that is left of it; what that was follows once more from what the others say.
        let without = |mut settled: Settled, rows: &[bool]| {
            for _ in 0..REFITS {
                let amount = |(alone, off): (&f64, &bool)| if *off { alone * self.floor } else { 0.0 };
                let amounts: Vec<f64> = settled.alone.iter().zip(rows).map(amount).collect();
                settled = self.settled(&amounts, Some(1.0));
            }
            settled
        };
        let (mut settled, mut there) = (self.without(), Vec::new());
        for _ in 0..ROUNDS {
            let now: Vec<bool> = settled.alone.iter().map(|alone| alone.powi(2) > 2.0 * self.per_change()).collect();
            if now == there {
                break;
            }
            settled = without(settled, &now);
            there = now;
        }
        // Only in the end is it clear which stand alone: readings that are off bend all others at first.
        if !self.are_single(&there) {
            (settled, there) = (self.without(), vec![false; there.len()]);
        }
        let amounts: Vec<f64> =
            settled.alone.iter().zip(&there).filter(|(_, there)| **there).map(|(alone, _)| alone * self.floor).collect();
        let count = amounts.len().max(1) as f64;
        let size = amounts.iter().sum::<f64>() / count;
        settled.sigma = (amounts.iter().map(|amount| (amount - size).powi(2)).sum::<f64>() / count).sqrt();
        let cost = self.cost(&settled, 2 * amounts.len());
        settled.left = settled.left.iter().zip(&there).filter(|(_, there)| !**there).map(|(left, _)| *left).collect();
        Found { cost, settled, size, there }
    }

    /// Whether most of some rows stand alone, or two by two: what goes on for longer is no reading that is off.
    fn are_single(&self, rows: &[bool]) -> bool {
        let goes_on = |index: usize| rows[index] && rows[index - 1] && self.judged[index].1 == self.judged[index - 1].1;
        let (mut begin, mut single, mut all) = (0, 0, 0_usize);
        for index in 1..=rows.len() {
            if index == rows.len() || !goes_on(index) {
                let count = if rows[begin] { index - begin } else { 0 };
                all += count;
                single += if count <= TOGETHER { count } else { 0 };
                begin = index;
            }
        }
        single as f64 > MOST * all as f64
    }

    /// The same for single readings.
    pub(super) fn settle_readings(self, frame: &Frame, mut found: Found) -> (Rows, Found) {
        let mut rows = self;
        for _ in 0..REFITS {
            let moved = Rows::new(frame, rows.moved(frame, &found.settled), rows.by.clone(), rows.channel);
            let again = moved.readings_off();
            if again.cost > found.cost {
                break;
            }
            (rows, found) = (moved, again);
        }
        (rows, found)
    }
}
