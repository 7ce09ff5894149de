//! What holds at a pack's terminals when it is not the current: a constant power, or a charger.

use std::fmt;

use crate::{Channel, Run};

/// The pack cannot deliver a power: no current gives it, or the voltage falls below the end of
/// discharge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CannotDeliver {
    /// The power asked for, W.
    pub power_w: f64,
}

impl fmt::Display for CannotDeliver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the pack cannot deliver {:.2} W", self.power_w)
    }
}

impl std::error::Error for CannotDeliver {}

/// Largest relative error of the power that the root search leaves.
const POWER_TOLERANCE: f64 = 1e-9;
/// Bound on iterations; quadratic convergence needs about five.
const ITERATIONS_MAX: usize = 60;

impl Run<f64> {
    /// Voltage at the end of a step with this current, without keeping the step.
    fn trial_v(&mut self, current_a: f64, dt_s: f64) -> f64 {
        self.restore();
        self.channels[Channel::CurrentA] = current_a;
        self.step(dt_s);
        self.channels[Channel::VoltageV]
    }

    /// Steps a battery by `dt_s` under a constant power (W, discharge positive) and returns the
    /// current, A.
    ///
    /// Power rises with current up to the power limit and falls beyond it. Newton's iteration
    /// on a concave curve approaches the root from the no-load side and cannot jump to the far
    /// branch; past the limit the slope turns and there is no answer.
    ///
    /// # Errors
    /// [`CannotDeliver`] when no current gives that power; the run is as it was before.
    pub fn step_power(&mut self, power_w: f64, dt_s: f64) -> Result<f64, CannotDeliver> {
        let temperature_degc = self.channels[Channel::TemperatureDegc];
        self.save();
        if power_w == 0.0 {
            self.trial_v(0.0, dt_s);
            return Ok(0.0);
        }
        // Under a steady power the last current is a close start; a discharge lets it rise slowly.
        let mut current_a = if power_w > 0.0 { self.channels[Channel::CurrentA].max(0.0) } else { 0.0 };
        let mut slope = None;
        let mut before_w = f64::INFINITY;
        for _ in 0..ITERATIONS_MAX {
            let voltage_v = self.trial_v(current_a, dt_s);
            let missing_w = power_w - current_a * voltage_v;
            if missing_w.abs() <= POWER_TOLERANCE * power_w.abs() {
                return Ok(current_a);
            }
            // Where it bends more, near the power limit, the slope is taken anew.
            if missing_w.abs() > 0.1 * before_w.abs() {
                slope = None;
            }
            before_w = missing_w;
            // The curve bends so little over one step that its first slope serves all iterations.
            let slope_v = *slope.get_or_insert_with(|| {
                let nudge_a = 1e-4 * (1.0 + current_a.abs());
                ((current_a + nudge_a) * self.trial_v(current_a + nudge_a, dt_s) - current_a * voltage_v) / nudge_a
            });
            if slope_v > 0.0 {
                current_a += missing_w / slope_v;
            } else if current_a > 0.0 && missing_w < 0.0 {
                // The start was beyond the limit of a smaller power: come from the other side.
                (current_a, slope) = (0.0, None);
            } else {
                break;
            }
        }
        self.restore();
        self.channels[Channel::TemperatureDegc] = temperature_degc;
        Err(CannotDeliver { power_w })
    }

    /// Steps a battery by `dt_s` on a CC-CV charger and returns the current, A (charging is
    /// negative, zero when the pack is above the charger's voltage).
    pub fn step_charge(&mut self, current_max_a: f64, voltage_max_v: f64, dt_s: f64) -> f64 {
        self.save();
        if self.trial_v(-current_max_a, dt_s) <= voltage_max_v {
            return -current_max_a;
        }
        // The voltage rises with the charge current: the root lies between none and the most.
        let (mut less_a, mut more_a) = (0.0, current_max_a);
        let mut less_v = self.trial_v(0.0, dt_s);
        if less_v >= voltage_max_v {
            return 0.0;
        }
        let mut more_v = self.trial_v(-more_a, dt_s);
        for _ in 0..ITERATIONS_MAX {
            let guess_a = less_a + (voltage_max_v - less_v) / (more_v - less_v) * (more_a - less_a);
            let guess_v = self.trial_v(-guess_a, dt_s);
            if (guess_v - voltage_max_v).abs() < 1e-7 || (more_a - less_a) < 1e-9 {
                return -guess_a;
            }
            if guess_v > voltage_max_v {
                (more_a, more_v) = (guess_a, guess_v);
            } else {
                (less_a, less_v) = (guess_a, guess_v);
            }
        }
        let kept_a = less_a;
        self.trial_v(-kept_a, dt_s);
        -kept_a
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Model, Start};
    use std::sync::Arc;

    /// One cell, OCV 4 V flat, 0.1 ohm: the most power is 4²/(4·0.1) = 40 W at 20 A.
    fn cell() -> Run<f64> {
        let text = r#"
            schema = 1
            system = "battery"
            name = "flat"
            battery = { series = 1, parallel = 1, capacity_ah = 100.0, full_v_per_cell = 4.2, eod_v_per_cell = 1.0, charge_current_a = 5.0, charge_cutoff_a = 0.1, ocv = { soc = [0.0, 1.0], voltage_v = [4.0, 4.0] } }
            [[effect]]
            id = "ohmic"
            resistance_ohm = { value = 0.1, source = "test" }
        "#;
        let model = Model::parse("flat", text, &|_| unreachable!()).unwrap();
        Run::new(Arc::new(model), Start::at_soc(0.5))
    }

    #[test]
    fn constant_power_takes_the_smaller_of_the_two_currents() {
        // 30 W: 0.1 I² - 4 I + 30 = 0, I = 20 ± 10.
        let mut run = cell();
        assert!((run.step_power(30.0, 1.0).unwrap() - 10.0).abs() < 1e-6);
        assert!((run.channels[Channel::PowerW] - 30.0).abs() < 1e-6);
    }

    #[test]
    fn power_near_the_limit_is_found_and_beyond_it_is_refused_without_a_trace() {
        let mut run = cell();
        assert!((run.step_power(39.999, 1.0).unwrap() - (20.0 - (400.0 - 10.0 * 39.999_f64).sqrt())).abs() < 1e-3);
        let mut run = cell();
        assert_eq!(run.step_power(40.01, 1.0), Err(CannotDeliver { power_w: 40.01 }));
        assert!((run.channels[Channel::Soc] - 0.5).abs() < 1e-15);
    }

    #[test]
    fn a_charger_holds_its_current_and_then_its_voltage() {
        assert!((cell().step_charge(5.0, 4.6, 1.0) + 5.0).abs() < 1e-12);
        // 4.0 V + 0.1 ohm I = 4.2 V: 2 A.
        assert!((cell().step_charge(5.0, 4.2, 1.0) + 2.0).abs() < 1e-5);
        assert_eq!(cell().step_charge(5.0, 3.9, 1.0), 0.0);
    }
}
