//! Switch-mode DC/DC converters.
//!
//! `P_in = P_out + P_loss`, `P_loss = P_in (1 - eta)`, all in W. Kottas, Eq. 4.1, labels
//! `V_in I_in eta` as the loss; that is the output power. Efficiency is a table over input voltage
//! and output current (Kottas, Fig. 4.2: better at a low input voltage, worse at light load), or
//! the loss is a polynomial of the output current.

use crate::Real;

/// Efficiency over input voltage (V) and output current (A), interpolated bilinearly.
///
/// Outside the table the nearest edge holds, with one exception: below the least current it is the
/// *loss* that stays as it is at the edge, since what is left at light load is the converter's own
/// need. Efficiency then goes to zero with the current, and the input power to that need.
#[derive(Debug, Clone, PartialEq)]
pub struct EfficiencyTable {
    input_v: Vec<f64>,
    output_a: Vec<f64>,
    /// Row by row: one row per input voltage.
    efficiency: Vec<f64>,
}

impl EfficiencyTable {
    /// Checks and keeps a table. `efficiency` has one row per `input_v`, each with one number per
    /// `output_a`. Both axes strictly increase and are positive; efficiencies lie in (0, 1].
    ///
    /// # Errors
    /// Says which axis or entry is wrong and why.
    pub fn new(input_v: Vec<f64>, output_a: Vec<f64>, efficiency: &[Vec<f64>]) -> Result<Self, String> {
        for (name, axis) in [("input_v", &input_v), ("output_a", &output_a)] {
            if axis.is_empty() {
                return Err(format!("{name} is empty; at least one number is needed"));
            }
            if let Some(wrong) = axis.iter().find(|x| !x.is_finite() || **x <= 0.0) {
                return Err(format!("{name} has {wrong}: every number must be finite and > 0"));
            }
            if let Some(pair) = axis.windows(2).find(|pair| pair[1] <= pair[0]) {
                return Err(format!("{name} must increase: {} comes after {}", pair[1], pair[0]));
            }
        }
        if efficiency.len() != input_v.len() {
            return Err(format!("efficiency has {} rows; input_v has {} numbers: one row each", efficiency.len(), input_v.len()));
        }
        for (row, volts) in efficiency.iter().zip(&input_v) {
            if row.len() != output_a.len() {
                return Err(format!("efficiency at {volts} V has {} numbers; output_a has {}", row.len(), output_a.len()));
            }
            if let Some(wrong) = row.iter().find(|eta| !(**eta > 0.0 && **eta <= 1.0)) {
                return Err(format!("efficiency at {volts} V has {wrong}: it must be above 0 and at most 1"));
            }
        }
        Ok(Self { input_v, output_a, efficiency: efficiency.concat() })
    }

    /// Efficiency at an input voltage (V) and an output current (A, >= 0); 0..1.
    #[must_use]
    pub fn efficiency<S: Real>(&self, input_v: S, output_a: S) -> S {
        let least_a = self.output_a[0];
        let edge = self.bilinear(input_v, output_a);
        if output_a.re() >= least_a {
            return edge;
        }
        // P_loss = V_out I_0 (1 / eta_0 - 1) held below I_0; V_out cancels.
        let need_a = (edge.recip() - 1.0) * least_a;
        let output_a = if output_a.re() > 0.0 { output_a } else { S::from(0.0) };
        if need_a.re() > 0.0 { output_a / (output_a + need_a) } else { edge }
    }

    /// Input power for an output voltage (V) and current (A), W.
    fn input_w<S: Real>(&self, input_v: S, output_v: f64, output_a: S) -> S {
        let least_a = self.output_a[0];
        let edge = self.bilinear(input_v, output_a);
        if output_a.re() >= least_a { output_a * output_v / edge } else { (output_a + (edge.recip() - 1.0) * least_a) * output_v }
    }

    fn bilinear<S: Real>(&self, input_v: S, output_a: S) -> S {
        let (row, across) = place(&self.input_v, input_v);
        let (column, along) = place(&self.output_a, output_a);
        let at = |row: usize, column: usize| self.efficiency[row * self.output_a.len() + column];
        let (next_row, next_column) = ((row + 1).min(self.input_v.len() - 1), (column + 1).min(self.output_a.len() - 1));
        let low = along * (at(row, next_column) - at(row, column)) + at(row, column);
        let high = along * (at(next_row, next_column) - at(next_row, column)) + at(next_row, column);
        low + across * (high - low)
    }
}

/// The segment of an axis in which `x` lies, and how far along it: 0..1, clamped at both ends.
fn place<S: Real>(axis: &[f64], x: S) -> (usize, S) {
    let last = axis.len() - 1;
    if x.re() <= axis[0] {
        return (0, S::from(0.0));
    }
    if x.re() >= axis[last] {
        return (last, S::from(0.0));
    }
    let low = axis.partition_point(|&knot| knot <= x.re()) - 1;
    (low, (x - axis[low]) / (axis[low + 1] - axis[low]))
}

/// How a converter's input power follows from its output.
#[derive(Debug, Clone, PartialEq)]
pub enum ConverterLoss {
    /// From a table of efficiencies.
    Table(EfficiencyTable),
    /// `I_in = (P0 + a I + b I^2) / V_in`, so `P_in = P0 + a I + b I^2` with the output current I.
    Polynomial {
        /// P0: power at no load, W, >= 0.
        fixed_w: f64,
        /// a: output voltage plus the drops that grow with the current (a diode), V, at least the output voltage.
        linear_v: f64,
        /// b: resistance of switch and inductor, seen from the output, ohm, >= 0.
        resistance_ohm: f64,
    },
}

/// A switch-mode converter with a fixed output voltage.
#[derive(Debug, Clone, PartialEq)]
pub struct SwitchMode {
    /// Output voltage, V, > 0.
    pub output_v: f64,
    /// Least input voltage at which the output holds, V; 0 for a converter that also steps up.
    pub input_v_min: f64,
    /// Where the input power goes.
    pub loss: ConverterLoss,
}

impl SwitchMode {
    /// Power that the converter takes at its input, W, for an input voltage (V, > 0) and an output
    /// current (A, >= 0).
    #[must_use]
    pub fn input_w<S: Real>(&self, input_v: S, output_a: S) -> S {
        match &self.loss {
            ConverterLoss::Table(table) => table.input_w(input_v, self.output_v, output_a),
            ConverterLoss::Polynomial { fixed_w, linear_v, resistance_ohm } => {
                (output_a * *resistance_ohm + *linear_v) * output_a + *fixed_w
            }
        }
    }

    /// Power that turns into heat, W: `P_in (1 - eta)` (Kottas, Eq. 4.1, put right).
    #[must_use]
    pub fn loss_w<S: Real>(&self, input_v: S, output_a: S) -> S {
        let input_w = self.input_w(input_v, output_a);
        match &self.loss {
            ConverterLoss::Table(table) if output_a.re() > 0.0 => input_w * (-table.efficiency(input_v, output_a) + 1.0),
            _ => input_w - output_a * self.output_v,
        }
    }

    /// Output power over input power, 0..1; 0 at no load.
    #[must_use]
    pub fn efficiency<S: Real>(&self, input_v: S, output_a: S) -> S {
        let input_w = self.input_w(input_v, output_a);
        if input_w.re() > 0.0 { output_a * self.output_v / input_w } else { S::from(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 5 V module after Kottas, Fig. 4.2: at a small current 15 points better at 7 V than at 12 V.
    fn module() -> SwitchMode {
        let efficiency = vec![vec![0.90, 0.94, 0.92], vec![0.75, 0.88, 0.90]];
        let table = EfficiencyTable::new(vec![7.0, 12.0], vec![0.1, 0.5, 1.5], &efficiency).unwrap();
        SwitchMode { output_v: 5.0, input_v_min: 6.0, loss: ConverterLoss::Table(table) }
    }

    #[test]
    fn efficiency_is_interpolated_between_four_points_and_held_outside() {
        let ConverterLoss::Table(table) = module().loss else { unreachable!() };
        // The middle of the first cell: the mean of its four corners.
        assert!((table.efficiency(9.5_f64, 0.3) - (0.90 + 0.94 + 0.75 + 0.88) / 4.0).abs() < 1e-12);
        assert!((table.efficiency(3.0_f64, 1.5) - 0.92).abs() < 1e-12);
        assert!((table.efficiency(20.0_f64, 9.0) - 0.90).abs() < 1e-12);
        // Kottas, section 4.1.1: 15 % between 7 V and 12 V at small currents.
        assert!((table.efficiency(7.0_f64, 0.1) - table.efficiency(12.0_f64, 0.1) - 0.15).abs() < 1e-12);
    }

    #[test]
    fn the_loss_is_the_input_power_times_one_minus_eta() {
        // 12 V, 0.5 A at 5 V: 2.5 W out, 2.5 / 0.88 in.
        let module = module();
        let input_w: f64 = module.input_w(12.0, 0.5);
        assert!((input_w - 2.5 / 0.88).abs() < 1e-12);
        assert!((module.loss_w(12.0_f64, 0.5) - input_w * 0.12).abs() < 1e-12);
        assert!((module.loss_w(12.0_f64, 0.5) - (input_w - 2.5)).abs() < 1e-12);
    }

    #[test]
    fn at_light_load_the_loss_stays_and_the_efficiency_falls_to_zero() {
        let module = module();
        let edge_w = 0.5 * (1.0 / 0.75 - 1.0);
        for output_a in [0.0_f64, 0.01, 0.05, 0.099_999] {
            assert!((module.loss_w(12.0, output_a) - edge_w).abs() < 1e-9, "{output_a}");
            assert!((module.input_w(12.0, output_a) - 5.0 * output_a - edge_w).abs() < 1e-9);
        }
        assert_eq!(module.efficiency(12.0_f64, 0.0), 0.0);
        assert!((module.efficiency(12.0_f64, 0.05) - 0.25 / (0.25 + edge_w)).abs() < 1e-12);
    }

    #[test]
    fn the_polynomial_is_a_fixed_need_a_drop_and_a_resistance() {
        let loss = ConverterLoss::Polynomial { fixed_w: 0.1, linear_v: 5.3, resistance_ohm: 0.2 };
        let converter = SwitchMode { output_v: 5.0, input_v_min: 6.0, loss };
        // 0.1 + 5.3 x 2 + 0.2 x 4 = 11.5 W in for 10 W out.
        assert!((converter.input_w(9.0_f64, 2.0) - 11.5).abs() < 1e-12);
        assert!((converter.loss_w(9.0_f64, 2.0) - 1.5).abs() < 1e-12);
        assert!((converter.efficiency(9.0_f64, 2.0) - 10.0 / 11.5).abs() < 1e-12);
    }

    #[test]
    fn a_table_that_makes_no_sense_is_refused_with_the_reason() {
        let refused = |v: &[f64], a: &[f64], eta: &[Vec<f64>]| EfficiencyTable::new(v.to_vec(), a.to_vec(), eta).unwrap_err();
        assert!(refused(&[], &[1.0], &[]).contains("input_v is empty"));
        assert!(refused(&[7.0, 5.0], &[1.0], &[vec![0.9], vec![0.9]]).contains("5 comes after 7"));
        assert!(refused(&[7.0], &[0.0, 1.0], &[vec![0.9, 0.9]]).contains("output_a has 0"));
        assert!(refused(&[7.0], &[1.0], &[vec![0.9], vec![0.9]]).contains("2 rows"));
        assert!(refused(&[7.0], &[1.0, 2.0], &[vec![0.9]]).contains("at 7 V has 1 numbers"));
        assert!(refused(&[7.0], &[1.0], &[vec![1.01]]).contains("at 7 V has 1.01"));
        assert!(refused(&[7.0], &[1.0], &[vec![f64::NAN]]).contains("NaN"));
    }
}
