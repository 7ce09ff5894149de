//! Cycles that a pack has seen: full ones by throughput, partial ones by rainflow.
//!
//! A full-equivalent cycle is one capacity's worth of charge drawn. Kottas, section 7.1, asks for
//! *pseudo cycles* too, because a gauge that counts only discharges below a fixed threshold misses
//! a pack that is always recharged early. They are the closed cycles of the rainflow count (ASTM
//! E1049-85, section 5.4.4, three-point method) over the turning points of state of charge;
//! swings below 2 % of capacity are left out. What has not closed yet counts as half cycles.

/// Smallest swing of state of charge that is a turning point.
const SWING_MIN: f64 = 0.02;
/// Turning points that may be open: swings of at least 2 % that grow and shrink again, each inside
/// the range 0..1, cannot be more.
const OPEN_MAX: usize = 110;

/// Counts cycles.
#[derive(Debug, Clone, Default)]
pub(crate) struct CycleCounter {
    drawn: f64,
    /// Pseudo cycles that have closed.
    closed: f64,
    /// Turning points that belong to open cycles; the last one may still move outwards.
    open: Vec<f64>,
}

impl CycleCounter {
    /// Takes in the state of charge, and the share of capacity that was drawn on the way there.
    pub(crate) fn update(&mut self, soc: f64, drawn: f64) {
        self.drawn += drawn.max(0.0);
        let Some(&last) = self.open.last() else {
            self.open.push(soc);
            return;
        };
        let goes_on = match self.open.len() {
            1 => false,
            n => (self.open[n - 1] - self.open[n - 2]) * (soc - self.open[n - 1]) > 0.0,
        };
        if goes_on {
            *self.open.last_mut().expect("there is one") = soc;
        } else if (soc - last).abs() >= SWING_MIN {
            if self.open.len() == OPEN_MAX {
                self.open.remove(0);
                self.closed += 0.5;
            }
            self.open.push(soc);
        } else {
            return;
        }
        self.close();
    }

    /// Three-point rule: a range that the next one reaches beyond is a cycle; if it holds the
    /// first point of all, half a one.
    fn close(&mut self) {
        while let [.., a, b, c] = self.open[..] {
            if (c - b).abs() < (b - a).abs() {
                return;
            }
            let at = self.open.len() - 3;
            if at == 0 {
                self.closed += 0.5;
                self.open.remove(0);
            } else {
                self.closed += 1.0;
                self.open.drain(at..at + 2);
            }
        }
    }

    /// Full-equivalent cycles: charge drawn over capacity.
    pub(crate) fn full(&self) -> f64 {
        self.drawn
    }

    /// Pseudo cycles, closed ones and half of each open range.
    pub(crate) fn pseudo(&self) -> f64 {
        self.closed + 0.5 * self.open.len().saturating_sub(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(points: &[f64]) -> CycleCounter {
        let mut counter = CycleCounter::default();
        let mut before = points[0];
        for pair in points.windows(2) {
            for step in 0..=100 {
                let soc = pair[0] + (pair[1] - pair[0]) * f64::from(step) / 100.0;
                counter.update(soc, before - soc);
                before = soc;
            }
        }
        counter
    }

    #[test]
    fn the_example_of_the_standard_gives_its_count() {
        // ASTM E1049-85, Fig. 6: peaks -2 1 -3 5 -1 3 -4 4 -2: one cycle of range 4 and half
        // cycles of ranges 3, 4, 8, 9, 8, 6. Here scaled into 0..1.
        let counter = counted(&[-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0].map(|peak| (peak + 5.0) / 12.0));
        assert!((counter.pseudo() - (1.0 + 0.5 * 6.0)).abs() < 1e-12, "{counter:?}");
    }

    #[test]
    fn two_discharges_by_half_are_one_full_cycle_and_two_pseudo_cycles() {
        let counter = counted(&[1.0, 0.5, 1.0, 0.5, 1.0]);
        assert!((counter.full() - 1.0).abs() < 1e-9);
        assert!((counter.pseudo() - 2.0).abs() < 1e-12, "{counter:?}");
    }

    #[test]
    fn trembling_is_no_cycle() {
        let counter = counted(&[0.8, 0.79, 0.8, 0.79, 0.8]);
        assert!(counter.pseudo() == 0.0 && (counter.full() - 0.02).abs() < 1e-9);
    }

    #[test]
    fn open_points_stay_few_whatever_comes() {
        let mut counter = CycleCounter::default();
        for step in 0..1_000_u32 {
            let reach = 0.5 * f64::from(step % 500) / 500.0;
            counter.update(if step % 2 == 0 { 0.5 - reach } else { 0.5 + reach }, 0.0);
            assert!(counter.open.len() <= OPEN_MAX);
        }
    }
}
