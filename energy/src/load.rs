//! What holds at a pack's terminals when it is not the current: a constant power, a constant
//! resistance, a mix of both, or a charger.

mod search;

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
/// Error of the power that no search tries to undercut, W.
const POWER_FLOOR_W: f64 = 1e-12;
/// Largest error of a charger's voltage that the search leaves, V.
const VOLTAGE_TOLERANCE_V: f64 = 1e-7;
/// Bound on iterations.
const ITERATIONS_MAX: usize = 200;
/// Secants before every second guess is the middle: one end of the bracket may stay where it is.
const SECANTS: usize = 8;

/// Loads side by side at a pack's terminals: constant power, constant current and constant
/// resistance ("ZIP"). Together they take `P + I V + G V^2`. Negative numbers feed the pack.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mix {
    /// Sum of the loads of constant power, W.
    pub power_w: f64,
    /// Sum of the loads of constant current, A.
    pub current_a: f64,
    /// Sum of the conductances of resistors, S (>= 0).
    pub conductance_s: f64,
}

impl Mix {
    /// Power that the mix takes at that voltage, W.
    #[must_use]
    pub fn power_w(&self, voltage_v: f64) -> f64 {
        self.power_w + self.current_a * voltage_v + self.conductance_s * voltage_v * voltage_v
    }

    /// What a search may leave of it, W.
    fn tolerance_w(&self, voltage_v: f64) -> f64 {
        let parts_w = [self.power_w, self.current_a * voltage_v, self.conductance_s * voltage_v * voltage_v];
        POWER_TOLERANCE * parts_w.into_iter().map(f64::abs).sum::<f64>() + POWER_FLOOR_W
    }

    /// How much more than the mix takes there is at the terminals, in tolerances.
    fn excess(&self, voltage_v: f64, power_w: f64) -> f64 {
        (power_w - self.power_w(voltage_v)) / self.tolerance_w(voltage_v)
    }
}

/// A thing with two terminals whose steps can be tried: a run of like cells, or a pack of unlike
/// ones. Whatever holds at the terminals is found by trying currents.
pub trait Terminals {
    /// Keeps the present state.
    fn save(&mut self);
    /// Takes back every step since [`Terminals::save`].
    fn restore(&mut self);
    /// Steps under a current as its sensor shows it, A.
    fn step_current(&mut self, current_a: f64, dt_s: f64);
    /// The value of a channel at the terminals: current, voltage, power.
    fn channel(&self, channel: Channel) -> f64;

    /// Voltage and power at the terminals after a step with this current from the kept state.
    fn trial(&mut self, current_a: f64, dt_s: f64) -> (f64, f64) {
        self.restore();
        self.step_current(current_a, dt_s);
        (self.channel(Channel::TerminalVoltageV), self.channel(Channel::PowerW))
    }

    /// Steps a battery by `dt_s` under a constant power (W, discharge positive) and returns the
    /// current, A. [`Terminals::restore`] takes the step back.
    ///
    /// Power rises with current up to the power limit and falls beyond it; the answer lies
    /// before the limit. See [`Terminals::step_mix`].
    ///
    /// # Errors
    /// [`CannotDeliver`] when no current gives that power; everything is as it was before.
    fn step_power(&mut self, power_w: f64, dt_s: f64) -> Result<f64, CannotDeliver> {
        self.step_mix(Mix { power_w, ..Mix::default() }, dt_s)
    }

    /// Steps a battery by `dt_s` under a mix of loads side by side and returns the current, A.
    /// [`Terminals::restore`] takes the step back.
    ///
    /// Newton's iteration from the last current does nearly every step. Where it does not end,
    /// near the power limit or at a kink, a patient search over all currents finds the smallest
    /// that meets the mix, to 1e-9 of it, or finds that there is none: beyond the limit, or where
    /// the power jumps over the wish because a sensor has a dead band.
    ///
    /// # Errors
    /// [`CannotDeliver`] when no current does; everything is as it was before.
    fn step_mix(&mut self, mix: Mix, dt_s: f64) -> Result<f64, CannotDeliver> {
        // Under a steady load the last current is a close start; a discharge lets it rise slowly.
        let last_a = self.channel(Channel::CurrentA);
        let asked_w = mix.power_w(self.channel(Channel::TerminalVoltageV));
        self.save();
        let start_a = if last_a * asked_w > 0.0 { last_a } else { 0.0 };
        let mut found = search::meet(self, dt_s, start_a, &mix);
        if found.is_none() && mix == Mix::default() {
            // No load at all is always met: open terminals.
            self.trial(0.0, dt_s);
            found = Some(0.0);
        }
        found.ok_or_else(|| {
            self.restore();
            CannotDeliver { power_w: asked_w }
        })
    }

    /// Steps a battery by `dt_s` with a resistance (ohm, > 0) across its terminals and returns
    /// the current, A.
    ///
    /// The current lies where `V(I) = R I`; V falls with I, so there is one root, found by
    /// secants within brackets.
    fn step_resistance(&mut self, resistance_ohm: f64, dt_s: f64) -> f64 {
        self.save();
        let (mut low_a, mut low_v) = (0.0, self.trial(0.0, dt_s).0);
        let mut high_a = low_v.max(0.0) / resistance_ohm;
        let mut high_v = self.trial(high_a, dt_s).0 - resistance_ohm * high_a;
        let mut current_a = low_a;
        for round in 0..ITERATIONS_MAX {
            if high_a - low_a <= POWER_TOLERANCE * high_a {
                break;
            }
            let secant_a = low_a + low_v / (low_v - high_v) * (high_a - low_a);
            current_a = if round > SECANTS && round % 2 == 0 { f64::midpoint(low_a, high_a) } else { secant_a };
            let excess_v = self.trial(current_a, dt_s).0 - resistance_ohm * current_a;
            if excess_v.abs() <= POWER_TOLERANCE * resistance_ohm * current_a {
                break;
            }
            if excess_v > 0.0 { (low_a, low_v) = (current_a, excess_v) } else { (high_a, high_v) = (current_a, excess_v) }
        }
        self.trial(current_a, dt_s);
        current_a
    }

    /// Steps a battery by `dt_s` on a CC-CV charger and returns the current, A (charging is
    /// negative, zero when the pack is above the charger's voltage).
    fn step_charge(&mut self, current_max_a: f64, voltage_max_v: f64, dt_s: f64) -> f64 {
        self.save();
        let mut more_v = self.trial(-current_max_a, dt_s).0;
        if more_v <= voltage_max_v {
            return -current_max_a;
        }
        // The voltage rises with the charge current: the root lies between none and the most.
        let (mut less_a, mut more_a) = (0.0, current_max_a);
        let mut less_v = self.trial(0.0, dt_s).0;
        if less_v >= voltage_max_v {
            return 0.0;
        }
        for round in 0..ITERATIONS_MAX {
            if more_a - less_a < 1e-9 {
                break;
            }
            let secant_a = less_a + (voltage_max_v - less_v) / (more_v - less_v) * (more_a - less_a);
            let guess_a = if round > SECANTS && round % 2 == 0 { f64::midpoint(less_a, more_a) } else { secant_a };
            let guess_v = self.trial(-guess_a, dt_s).0;
            if (guess_v - voltage_max_v).abs() < VOLTAGE_TOLERANCE_V {
                return -guess_a;
            }
            if guess_v > voltage_max_v {
                (more_a, more_v) = (guess_a, guess_v);
            } else {
                (less_a, less_v) = (guess_a, guess_v);
            }
        }
        // At a jump, the side that stays below the charger's voltage.
        self.trial(-less_a, dt_s);
        -less_a
    }
}

impl Terminals for Run<f64> {
    fn save(&mut self) {
        Run::save(self);
    }

    fn restore(&mut self) {
        Run::restore(self);
    }

    #[inline]
    fn step_current(&mut self, current_a: f64, dt_s: f64) {
        self.channels[Channel::CurrentA] = current_a;
        self.step(dt_s);
    }

    fn channel(&self, channel: Channel) -> f64 {
        self.channels[channel]
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
    fn a_resistance_draws_what_ohms_law_says() {
        // 4 V over 0.1 + 1.9 ohm: 2 A; over a short of 1 milliohm: 4 / 0.101.
        assert!((cell().step_resistance(1.9, 1.0) - 2.0).abs() < 1e-8);
        assert!((cell().step_resistance(0.001, 1.0) - 4.0 / 0.101).abs() < 1e-6);
    }

    #[test]
    fn a_charger_holds_its_current_and_then_its_voltage() {
        assert!((cell().step_charge(5.0, 4.6, 1.0) + 5.0).abs() < 1e-12);
        // 4.0 V + 0.1 ohm I = 4.2 V: 2 A.
        assert!((cell().step_charge(5.0, 4.2, 1.0) + 2.0).abs() < 1e-5);
        assert_eq!(cell().step_charge(5.0, 3.9, 1.0), 0.0);
    }
}
