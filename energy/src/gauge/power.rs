//! Recent mean power: what energy and time to empty are predicted at.

use super::Sample;

/// Time constant of the mean, s.
const TAU_S: f64 = 60.0;

/// The mean, forgetting exponentially.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct MeanPower {
    /// W, discharge positive.
    pub(crate) power_w: f64,
    /// Variance of the mean of as many independent errors, for a variance of 1 each: the sum of the
    /// squared weights.
    pub(crate) noise_share: f64,
    seen_s: f64,
}

impl MeanPower {
    /// Takes in a sample. What was before the first one does not count.
    pub(crate) fn update(&mut self, sample: &Sample) {
        let keep = (-sample.dt_s / TAU_S).exp();
        let all = 1.0 - (-(self.seen_s + sample.dt_s) / TAU_S).exp();
        let before = 1.0 - (-self.seen_s / TAU_S).exp();
        let (kept, new) = (keep * before / all, (1.0 - keep) / all);
        self.power_w = kept * self.power_w + new * sample.current_a * sample.voltage_v;
        self.noise_share = kept * kept * self.noise_share + new * new;
        self.seen_s = (self.seen_s + sample.dt_s).min(100.0 * TAU_S);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_sample_is_the_mean_and_later_ones_are_followed() {
        let sample = |current_a| Sample { dt_s: 1.0, current_a, voltage_v: 10.0, temperature_degc: 25.0 };
        let mut mean = MeanPower::default();
        mean.update(&sample(1.0));
        assert!((mean.power_w - 10.0).abs() < 1e-9 && (mean.noise_share - 1.0).abs() < 1e-12);
        (0..60).for_each(|_| mean.update(&sample(2.0)));
        // Two thirds of the way and a little more, as one second is soon forgotten.
        assert!((16.0..20.0).contains(&mean.power_w));
        (0..600).for_each(|_| mean.update(&sample(2.0)));
        assert!((mean.power_w - 20.0).abs() < 1e-2);
        // The mean of 2 tau / dt readings in a row.
        assert!((mean.noise_share * 120.0 - 1.0).abs() < 1e-2);
    }
}
