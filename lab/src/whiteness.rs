//! Is a residual white, or is there still something in it to explain?
//!
//! Two tests that need no alternative: Ljung and Box (1978) on the first lags, and Bartlett's
//! test of the cumulative periodogram, which also sees slow drifts and single tones. Both take
//! the mean as known to be wrong: an offset is for the mean to show, not for these.
//!
//! Sampling need not be regular: see [`slots`] for what happens to gaps and crowds.

mod ljung_box;
mod periodogram;
mod slots;

use serde::Serialize;

pub use ljung_box::LjungBox;
pub(crate) use periodogram::quarters;
pub use periodogram::{Cumulative, Period};
pub use slots::Slots;

/// Fewer rows than this say nothing about whiteness.
pub const LEAST_ROWS: usize = 20;

/// What the residual of one channel of one log looks like in time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Whiteness {
    /// Median time between neighbouring rows, s: the width of a slot.
    pub interval_s: f64,
    /// Slots that hold at least one row.
    pub slots: usize,
    /// Slots that hold none.
    pub empty_slots: usize,
    /// Correlation of neighbouring slots, about the mean.
    pub lag1: f64,
    /// Time after which the correlation has fallen below 1/e, s; null when it never does.
    pub correlation_time_s: Option<f64>,
    /// Ljung and Box: are the first lags uncorrelated?
    pub ljung_box: LjungBox,
    /// Bartlett: is the power spread evenly over all frequencies?
    pub cumulative_periodogram: Cumulative,
    /// The period that stands out; null when none does.
    pub period: Option<Period>,
}

impl Whiteness {
    /// Of residuals at increasing times; none when there are too few rows or they never differ.
    #[must_use]
    pub fn of(time_s: &[f64], residual: &[f64]) -> Option<Whiteness> {
        let slots = Slots::of(time_s, residual)?;
        let correlation = slots.correlation();
        let spectrum = periodogram::Spectrum::of(&slots);
        Some(Whiteness {
            interval_s: slots.interval_s,
            slots: slots.filled,
            empty_slots: slots.values.len() - slots.filled,
            lag1: slots.lag1(),
            // Between rows that say nothing of each other nothing can be filled in.
            correlation_time_s: match slots.neighbours_agree() {
                true => slots.filled_between().correlation().time_s(slots.interval_s),
                false => correlation.time_s(slots.interval_s),
            },
            ljung_box: LjungBox::of(&correlation, slots.filled),
            cumulative_periodogram: spectrum.cumulative(),
            period: spectrum.period(),
        })
    }

    /// Whether both tests pass at 5 %: each at 2.5 %, as either may fail by chance.
    #[must_use]
    pub fn is_white(&self) -> bool {
        self.ljung_box.p_value.min(self.cumulative_periodogram.p_value) >= 0.025
    }
}

/// The cumulative periodogram of residuals, for plotting; none where there is nothing to judge.
#[must_use]
pub fn cumulative_curve(time_s: &[f64], residual: &[f64]) -> Option<Vec<(f64, f64)>> {
    Some(periodogram::Spectrum::of(&Slots::of(time_s, residual)?).curve())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The series of `tests/reference/whiteness.py`: plain integer arithmetic in both languages.
    pub(crate) fn uniform(n: usize) -> Vec<f64> {
        let mut state = 12345_u64;
        let mut next = || {
            state = (1_103_515_245 * state + 12345) % (1 << 31);
            state as f64 / f64::from(1_u32 << 31) - 0.5
        };
        (0..n).map(|_| next()).collect()
    }

    pub(crate) fn seconds(n: usize) -> Vec<f64> {
        (0..n).map(|k| k as f64).collect()
    }

    /// x\[k\] = 0.8 x\[k-1\] + u\[k\].
    fn red(n: usize) -> Vec<f64> {
        let mut last = 0.0;
        let step = |value| {
            last = 0.8 * last + value;
            last
        };
        uniform(n).into_iter().map(step).collect()
    }

    #[test]
    fn white_noise_is_white_and_a_slow_error_is_not() {
        let white = Whiteness::of(&seconds(500), &uniform(500)).unwrap();
        assert!(white.is_white() && white.period.is_none(), "{white:?}");
        let red = Whiteness::of(&seconds(500), &red(500)).unwrap();
        assert!(!red.is_white() && red.period.is_none(), "{red:?}");
        assert!((red.lag1 - 0.8).abs() < 0.06, "{red:?}");
        // -1 / ln(0.8) = 4.5 s
        assert!((red.correlation_time_s.unwrap() - 4.5).abs() < 1.5, "{red:?}");
    }

    #[test]
    fn gaps_and_uneven_sampling_do_not_make_white_noise_red() {
        let all = uniform(1200);
        let kept: Vec<usize> = (0..1200).filter(|k| k % 7 != 3 && !(400..700).contains(k)).collect();
        let time_s: Vec<f64> = kept.iter().map(|&k| 5.0 * k as f64 + if k % 2 == 0 { 0.3 } else { 0.0 }).collect();
        let residual: Vec<f64> = kept.iter().map(|&k| all[k]).collect();
        let white = Whiteness::of(&time_s, &residual).unwrap();
        assert!((white.interval_s - 5.0).abs() < 0.5 && white.empty_slots > 100, "{white:?}");
        assert!(white.is_white(), "{white:?}");
    }

    /// A slow error that is large where readings are seldom: neighbours are all of the quiet time, and yet no row differs from the next.
    #[test]
    fn an_error_of_a_log_that_is_read_often_while_little_happens_lasts_as_long_as_it_does() {
        let often = (0..400).map(f64::from);
        let seldom = (1..=200).map(|k| 400.0 + 20.0 * f64::from(k));
        let time_s: Vec<f64> = often.chain(seldom).collect();
        let wave = |time_s: f64| (time_s * std::f64::consts::TAU / 2000.0).sin();
        let residual: Vec<f64> = time_s.iter().map(|&time_s| if time_s < 400.0 { 0.05 } else { 1.0 } * wave(time_s)).collect();
        let white = Whiteness::of(&time_s, &residual).unwrap();
        // A wave has fallen below 1/e after a fifth of its period.
        let lasts_s = white.correlation_time_s.unwrap();
        assert!(white.lag1 > 0.9 && (200.0..600.0).contains(&lasts_s), "{white:?}");
    }

    #[test]
    fn noise_of_rows_that_are_far_apart_lasts_no_longer_than_that_of_rows_that_are_near() {
        let time_s: Vec<f64> = (0..200).chain((200..2000).step_by(10)).map(f64::from).collect();
        let white = Whiteness::of(&time_s, &uniform(time_s.len())).unwrap();
        assert!(white.empty_slots > 1000 && white.correlation_time_s.unwrap() < 1.0, "{white:?}");
    }

    #[test]
    fn a_tone_is_named_with_its_share() {
        let tone = |k: usize| 0.5 * (k as f64 * std::f64::consts::TAU / 40.0).sin();
        let residual: Vec<f64> = uniform(800).into_iter().enumerate().map(|(k, noise)| noise + tone(k)).collect();
        let white = Whiteness::of(&seconds(800), &residual).unwrap();
        let period = white.period.unwrap();
        assert!((period.period_s - 40.0).abs() < 0.5, "{period:?}");
        // 0.5^2 / 2 of 0.5^2 / 2 + 1/12
        assert!((period.share - 0.6).abs() < 0.05, "{period:?}");
    }

    #[test]
    fn too_few_rows_and_a_constant_say_nothing() {
        assert_eq!(Whiteness::of(&seconds(10), &uniform(10)), None);
        assert_eq!(Whiteness::of(&seconds(100), &[1.0; 100]), None);
    }
}
