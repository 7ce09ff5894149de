//! Linear (low drop-out) voltage regulators.
//!
//! `P = (V_in - V_out) I_out + V_in I_gnd` in W (Kottas, Eq. 4.2), `T_J = T_A + theta_JA P` in °C
//! (Eq. 4.3). What comes in goes out: a linear regulator takes the output current, whatever its
//! input voltage. So behind one a constant current stays a constant current for the battery; the
//! thesis calls such a load constant-power, which holds behind a switch-mode converter only.

use crate::Real;

/// A linear regulator.
#[derive(Debug, Clone, PartialEq)]
pub struct Ldo {
    /// Output voltage, V, > 0.
    pub output_v: f64,
    /// Current that the regulator itself takes to ground, A, >= 0 (usually some uA).
    pub ground_a: f64,
    /// Least difference between input and output at which the output holds, V, >= 0.
    pub dropout_v: f64,
    /// Thermal resistance from junction to surroundings, K/W; none when not known.
    pub theta_ja_k_per_w: Option<f64>,
    /// Junction temperature at which the regulator shuts down, °C.
    pub junction_max_degc: f64,
}

impl Ldo {
    /// Output voltage at an input voltage, V: below the drop-out it follows the input.
    #[must_use]
    pub fn output_v<S: Real>(&self, input_v: S) -> S {
        let left_v = input_v - self.dropout_v;
        if left_v.re() >= self.output_v {
            S::from(self.output_v)
        } else if left_v.re() > 0.0 {
            left_v
        } else {
            S::from(0.0)
        }
    }

    /// Current that the regulator takes at its input, A.
    #[must_use]
    pub fn input_a<S: Real>(&self, output_a: S) -> S {
        output_a + self.ground_a
    }

    /// Power that turns into heat, W (Kottas, Eq. 4.2).
    #[must_use]
    pub fn loss_w<S: Real>(&self, input_v: S, output_a: S) -> S {
        (input_v - self.output_v(input_v)) * output_a + input_v * self.ground_a
    }

    /// Junction temperature, °C (Kottas, Eq. 4.3); none when its thermal resistance is not known.
    #[must_use]
    pub fn junction_degc<S: Real>(&self, ambient_degc: S, loss_w: S) -> Option<S> {
        self.theta_ja_k_per_w.map(|theta| loss_w * theta + ambient_degc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn regulator() -> Ldo {
        Ldo { output_v: 3.3, ground_a: 1e-3, dropout_v: 0.3, theta_ja_k_per_w: Some(60.0), junction_max_degc: 125.0 }
    }

    #[test]
    fn the_loss_is_drop_times_current_and_the_ground_current() {
        // (5 - 3.3) V x 0.5 A + 5 V x 1 mA = 0.855 W; at 60 K/W that is 51.3 K above 25 degC.
        let loss_w: f64 = regulator().loss_w(5.0, 0.5);
        assert!((loss_w - 0.855).abs() < 1e-12);
        assert!((regulator().junction_degc(25.0, loss_w).unwrap() - 76.3).abs() < 1e-9);
        // What goes in is what comes out and what is lost.
        assert!((5.0 * regulator().input_a(0.5_f64) - 3.3 * 0.5 - loss_w).abs() < 1e-12);
    }

    #[test]
    fn a_sot223_at_its_datasheet_limit_reaches_its_rated_junction() {
        // LM1117 (Texas Instruments, SNOS412): theta_JA 136 K/W for SOT-223 without copper, T_J at most 125 degC:
        // from 25 degC it may turn (125 - 25) / 136 = 0.735 W into heat.
        let ldo = Ldo { theta_ja_k_per_w: Some(136.0), ground_a: 0.0, ..regulator() };
        let loss_w = ldo.loss_w(5.0_f64, 0.735 / 1.7);
        assert!((ldo.junction_degc(25.0, loss_w).unwrap() - 125.0).abs() < 0.05);
    }

    #[test]
    fn below_the_drop_out_the_output_follows_the_input() {
        assert_eq!(regulator().output_v(3.6_f64), 3.3);
        assert!((regulator().output_v(3.5_f64) - 3.2).abs() < 1e-12);
        assert_eq!(regulator().output_v(0.1_f64), 0.0);
    }
}
