//! The open-circuit voltage table of one cell.

use crate::real::Real;

/// Open-circuit voltage over state of charge, linearly interpolated (Kottas, section 3.2, found
/// a cubic spline worse). Outside the table the end segments are continued.
#[derive(Debug, Clone, PartialEq)]
pub struct OcvTable {
    soc: Vec<f64>,
    voltage_v: Vec<f64>,
    /// Slope of every segment, V.
    slopes_v: Vec<f64>,
    /// Buckets per unit of SoC.
    buckets_per_soc: f64,
    /// The segment at the beginning of each of [`BUCKETS`] equal parts of the table: where a
    /// search begins, so that it ends after a step or two.
    buckets: Vec<u16>,
}

/// Most points of a table.
const POINTS_MAX: usize = 10_000;
/// Parts that the table is divided into for searching.
const BUCKETS: u16 = 1024;

impl OcvTable {
    /// Checks and keeps a table: at least two points, `soc` strictly increasing, voltages finite
    /// and never falling with `soc`.
    ///
    /// # Errors
    /// Says which point is wrong and why.
    pub fn new(soc: Vec<f64>, voltage_v: Vec<f64>) -> Result<Self, String> {
        if soc.len() != voltage_v.len() {
            return Err(format!("the OCV table has {} soc and {} voltage_v entries; they must be as many", soc.len(), voltage_v.len()));
        }
        if !(2..=POINTS_MAX).contains(&soc.len()) {
            return Err(format!("the OCV table has {} points; it needs 2 to {POINTS_MAX}", soc.len()));
        }
        for (index, pair) in soc.windows(2).enumerate() {
            let voltages = &voltage_v[index..index + 2];
            if !pair.iter().chain(voltages).all(|x| x.is_finite()) {
                return Err(format!("the OCV table has a number that is not finite at point {index} or {}", index + 1));
            }
            if pair[1] <= pair[0] {
                return Err(format!("the OCV table's soc must increase: point {} is {} after {}", index + 1, pair[1], pair[0]));
            }
            if voltages[1] < voltages[0] {
                return Err(format!(
                    "the OCV table's voltage_v must not fall with soc: point {} is {} V after {} V",
                    index + 1,
                    voltages[1],
                    voltages[0]
                ));
            }
        }
        Ok(Self::kept(soc, voltage_v))
    }

    /// The same table with an error added, V over SoC: a straight line between its own points and these
    /// further ones. Unlike a table that is read, it may fall where the error does.
    ///
    /// # Panics
    /// When a further point is not finite.
    #[must_use]
    pub fn moved(&self, further: &[f64], error_v: impl Fn(f64) -> f64) -> Self {
        assert!(further.iter().all(|soc| soc.is_finite()), "points of an error are numbers");
        let mut soc: Vec<f64> = self.soc.iter().chain(further).copied().collect();
        soc.sort_by(f64::total_cmp);
        soc.dedup_by(|a, b| *a - *b < 1e-9);
        let voltage_v = soc.iter().map(|&soc| self.voltage_v(soc) + error_v(soc)).collect();
        Self::kept(soc, voltage_v)
    }

    fn kept(soc: Vec<f64>, voltage_v: Vec<f64>) -> Self {
        let slope = |(s, v): (&[f64], &[f64])| (v[1] - v[0]) / (s[1] - s[0]);
        let slopes_v = soc.windows(2).zip(voltage_v.windows(2)).map(slope).collect();
        let (first, last) = (soc[0], soc[soc.len() - 1]);
        let buckets_per_soc = f64::from(BUCKETS) / (last - first);
        let mut table = Self { soc, voltage_v, slopes_v, buckets_per_soc, buckets: Vec::new() };
        let begins = (0..BUCKETS).map(|bucket| first + (last - first) * f64::from(bucket) / f64::from(BUCKETS));
        // Both go up: one sweep over the points finds the segments of all buckets.
        let mut segment = 0;
        let segments = begins.map(|begin| {
            while segment + 2 < table.soc.len() && table.soc[segment + 1] <= begin {
                segment += 1;
            }
            segment as u16
        });
        table.buckets = segments.collect();
        table
    }

    /// Points of the table.
    #[must_use]
    pub fn points(&self) -> (&[f64], &[f64]) {
        (&self.soc, &self.voltage_v)
    }

    /// Open-circuit voltage of one cell at `soc`, V.
    #[inline(always)]
    pub fn voltage_v<S: Real>(&self, soc: S) -> S {
        let low = self.segment(soc.re());
        let slope_v = self.slopes_v[low];
        soc.chain((soc.re() - self.soc[low]) * slope_v + self.voltage_v[low], slope_v)
    }

    /// dOCV/dSoC at `soc`, V.
    #[must_use]
    #[inline]
    pub fn slope_v(&self, soc: f64) -> f64 {
        self.slopes_v[self.segment(soc)]
    }

    /// Open-circuit voltage of one cell and its slope at `soc`, V.
    #[must_use]
    #[inline(always)]
    pub fn line_v(&self, soc: f64) -> (f64, f64) {
        let low = self.segment(soc);
        let slope_v = self.slopes_v[low];
        ((soc - self.soc[low]) * slope_v + self.voltage_v[low], slope_v)
    }

    /// Sums of the open-circuit voltage of one cell and of its slope, V, at so many states of charge, one as far from the next as the
    /// first is from `before` and the last of them `last`: on a line of the table all of them count as their mean does.
    #[must_use]
    pub fn sums_v(&self, before: f64, last: f64, count: usize) -> (f64, f64) {
        let step = (last - before) / count as f64;
        let (mut volts, mut slopes, mut done) = (0.0, 0.0, 0);
        while done < count {
            let soc = before + step * (done + 1) as f64;
            let low = self.segment(soc);
            // The first and the last line go on.
            let end = match step > 0.0 {
                true if low + 2 < self.soc.len() => self.soc[low + 1],
                false if low > 0 => self.soc[low],
                _ => f64::INFINITY * step,
            };
            let on_line = (((end - soc) / step) as usize).min(count - done - 1) + 1;
            let mean = soc + step * 0.5 * (on_line - 1) as f64;
            volts += on_line as f64 * ((mean - self.soc[low]) * self.slopes_v[low] + self.voltage_v[low]);
            slopes += on_line as f64 * self.slopes_v[low];
            done += on_line;
        }
        (volts, slopes)
    }

    /// State of charge at which a rested cell shows `voltage_v`, kept within the table. On a
    /// flat stretch, the stretch's lower end.
    #[must_use]
    pub fn soc(&self, voltage_v: f64) -> f64 {
        let last = self.soc.len() - 1;
        if voltage_v <= self.voltage_v[0] {
            return self.soc[0];
        }
        if voltage_v >= self.voltage_v[last] {
            return self.soc[last];
        }
        let high = self.voltage_v.partition_point(|&v| v < voltage_v).max(1);
        self.soc[high - 1] + (voltage_v - self.voltage_v[high - 1]) / self.slopes_v[high - 1]
    }

    #[inline(always)]
    fn segment(&self, soc: f64) -> usize {
        // Below the table the first bucket, above it the last: a float becomes an integer by
        // saturation.
        let bucket = ((soc - self.soc[0]) * self.buckets_per_soc) as i32;
        let mut segment = usize::from(self.buckets[bucket.clamp(0, i32::from(BUCKETS) - 1) as usize]);
        while segment + 2 < self.soc.len() && self.soc[segment + 1] <= soc {
            segment += 1;
        }
        segment
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> OcvTable {
        OcvTable::new(vec![0.0, 0.5, 1.0], vec![3.0, 3.7, 4.2]).unwrap()
    }

    #[test]
    fn interpolates_linearly_and_continues_outside() {
        assert!((table().voltage_v(0.25_f64) - 3.35).abs() < 1e-12);
        assert!((table().voltage_v(1.1_f64) - 4.3).abs() < 1e-12);
        assert!((table().voltage_v(-0.1_f64) - 2.86).abs() < 1e-12);
    }

    #[test]
    fn the_search_finds_the_segment_that_a_plain_search_finds() {
        let knots: Vec<f64> = vec![0.0, 0.001, 0.002, 0.3, 0.5, 0.501, 0.9, 1.0];
        let table = OcvTable::new(knots.clone(), (0..8).map(f64::from).collect()).unwrap();
        for step in -100..=1100 {
            let soc = f64::from(step) / 1000.0;
            let plain = knots.partition_point(|&knot| knot <= soc).clamp(1, knots.len() - 1) - 1;
            assert_eq!(table.segment(soc), plain, "{soc}");
        }
    }

    #[test]
    fn sums_are_those_of_the_voltages_one_by_one() {
        let table = OcvTable::new(vec![0.0, 0.1, 0.15, 0.6, 1.0], vec![3.0, 3.4, 3.5, 3.7, 4.2]).unwrap();
        for (before, last) in [(-0.2, 1.3), (1.1, -0.1), (0.05, 0.12), (0.3, 0.3), (0.7, 0.6), (0.15, 0.15)] {
            for count in [0_usize, 1, 2, 7, 40] {
                let socs = (1..=count).map(|row| before + (last - before) / count as f64 * row as f64);
                let (volts, slopes) = socs.map(|soc| table.line_v(soc)).fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
                let found = table.sums_v(before, last, count);
                assert!((found.0 - volts).abs() < 1e-9, "{before} {last} {count}: {found:?}, {volts}");
                // Where two lines meet, rounding decides whose slope counts.
                assert!((found.1 - slopes).abs() < 4.0, "{before} {last} {count}: {found:?}, {slopes}");
            }
        }
    }

    #[test]
    fn voltage_gives_back_the_soc_it_came_from() {
        for soc in [0.0_f64, 0.1, 0.5, 0.77, 1.0] {
            assert!((table().soc(table().voltage_v(soc)) - soc).abs() < 1e-12);
        }
    }

    #[test]
    fn an_error_is_added_between_the_points_and_where_the_table_goes_on() {
        let moved = table().moved(&[-0.1, 0.25, 1.1], |soc| 0.1 * soc);
        for soc in [-0.05, 0.1, 0.25, 0.6, 1.05_f64] {
            assert!((moved.voltage_v(soc) - table().voltage_v(soc) - 0.1 * soc).abs() < 1e-12, "{soc}");
        }
    }

    #[test]
    fn refuses_a_table_that_turns_back() {
        let error = OcvTable::new(vec![0.0, 0.5, 0.4], vec![3.0, 3.5, 4.0]).unwrap_err();
        assert!(error.contains("point 2 is 0.4 after 0.5"), "{error}");
        assert!(OcvTable::new(vec![0.0, 1.0], vec![3.0, f64::NAN]).is_err());
        assert!(OcvTable::new(vec![0.0], vec![3.0]).is_err());
    }
}
