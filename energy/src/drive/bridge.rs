//! The H-bridge between battery and motor.
//!
//! Ripple: `di = d (1 - d) V_bat / (f_pwm L_a)`, A peak to peak. Kottas, Eq. 4.9, divides by the
//! armature current, which does not give amperes; the inductance belongs there, and the current
//! rises for `d` and falls for `1 - d` of a period. Conduction: `P = 2 R_DS,on I_rms² d` for the
//! conducting pair. Kottas, Eq. A.2, multiplies a complex divider with a current; power needs RMS.
//! Supply: `I_dcm = I_a V_a / V_bat` for a bridge without loss (Kottas, Eq. A.1).
//! Single-ended switching, `V_a` between 0 and `V_bat`; freewheeling through the diode is taken
//! as free, switching loss is not in it. The ripple is that of a current which never stops
//! (`I > di / 2`, or a bridge that also conducts backward); a lightly loaded coreless motor behind
//! a diode stops within the period, and ripples less.

use crate::real::Real;

/// Four switches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HBridge<S = f64> {
    /// On-resistance of one switch R_DS,on, ohm, >= 0.
    pub on_ohm: S,
    /// Switching frequency f_pwm, Hz, > 0.
    pub pwm_hz: S,
}

/// What the bridge takes from the battery, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supply<S = f64> {
    /// Share of the period in which the motor is connected, 0..1.
    pub duty: S,
    /// Ripple of the armature current, A peak to peak.
    pub ripple_a: S,
    /// RMS of the armature current, ripple included, A.
    pub rms_a: S,
    /// Conduction loss of the two conducting switches, W.
    pub conduction_w: S,
    /// Copper loss that the ripple adds in the armature, W.
    pub ripple_copper_w: S,
    /// Mean current from the battery, losses included, A.
    pub supply_a: S,
}

/// Ripple `d (1 - d) V_bat / (f_pwm L_a)`, A peak to peak: holds while the period is short
/// against L_a / R_a.
#[must_use]
pub fn ripple_a<S: Real>(duty: S, battery_v: S, pwm_hz: S, inductance_h: S) -> S {
    duty * (-duty + 1.0) * battery_v / (pwm_hz * inductance_h)
}

/// Ripple at any frequency: the periodic solution of `L dI/dt + R I` under a square wave,
/// `V_bat/R (1 - e^(-dT/tau)) (1 - e^(-(1-d)T/tau)) / (1 - e^(-T/tau))`, A peak to peak.
/// Tends to [`ripple_a`] at high frequency and to V_bat / R at low.
#[must_use]
pub fn ripple_any_a<S: Real>(duty: S, battery_v: S, pwm_hz: S, inductance_h: S, resistance_ohm: S) -> S {
    let periods = resistance_ohm / (inductance_h * pwm_hz);
    let part = |share: S| -(-(periods * share)).exp_m1();
    battery_v / resistance_ohm * part(duty) * part(-duty + 1.0) / part(S::from(1.0))
}

impl<S: Real> HBridge<S> {
    /// What it takes to put `voltage_v` (>= 0) on a motor that draws `current_a` (mean), from a
    /// battery at `battery_v` (> 0). The ripple is that of [`ripple_any_a`], taken as a triangle
    /// (`I_rms² = I² + di²/12`). The duty ends at 1: then the motor does not get its voltage.
    #[must_use]
    pub fn supply(&self, voltage_v: S, current_a: S, battery_v: S, inductance_h: S, resistance_ohm: S) -> Supply<S> {
        // While it is connected the motor gets what the two switches leave of the battery's voltage, and nothing while the diode conducts.
        let left_v = battery_v - self.on_ohm * current_a * 2.0;
        let wanted = voltage_v / left_v;
        let duty = if left_v.re() <= 0.0 || wanted.re() > 1.0 {
            S::from(1.0)
        } else if wanted.re() < 0.0 {
            S::from(0.0)
        } else {
            wanted
        };
        let ripple_a = ripple_any_a(duty, battery_v, self.pwm_hz, inductance_h, resistance_ohm);
        let ripple_square = ripple_a * ripple_a / 12.0;
        let mean_square = current_a * current_a + ripple_square;
        let conduction_w = self.on_ohm * 2.0 * mean_square * duty;
        let ripple_copper_w = resistance_ohm * ripple_square;
        let supply_a = (voltage_v * current_a + conduction_w + ripple_copper_w) / battery_v;
        Supply { duty, ripple_a, rms_a: mean_square.sqrt(), conduction_w, ripple_copper_w, supply_a }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ripple_by_hand_and_at_both_ends_of_frequency() {
        // 0.5 x 0.5 x 12 V / (20 kHz x 310 uH) = 0.4839 A.
        assert!((ripple_a(0.5_f64, 12.0, 20e3, 310e-6) - 3.0 / 6.2).abs() < 1e-12);
        let (fast, slow) = (1e7, 1.0_f64);
        let ratio = ripple_any_a(0.3_f64, 12.0, fast, 310e-6, 13.7) / ripple_a(0.3, 12.0, fast, 310e-6);
        assert!((ratio - 1.0).abs() < 1e-5, "{ratio}");
        assert!((ripple_any_a(0.3_f64, 12.0, slow, 310e-6, 13.7) - 12.0 / 13.7).abs() < 1e-9);
    }

    #[test]
    fn the_ripple_of_any_frequency_is_that_of_a_simulated_period() {
        let (duty, battery_v, pwm_hz, l, r) = (0.4, 12.0, 24.57e3, 310e-6, 13.7);
        let steps = 20_000;
        let h = 1.0 / pwm_hz / f64::from(steps);
        let (mut i, mut low, mut high) = (0.0, f64::MAX, f64::MIN);
        for period in 0..20 {
            for step in 0..steps {
                let on = f64::from(step) < duty * f64::from(steps);
                i += h / l * (if on { battery_v } else { 0.0 } - r * i);
                if period == 19 {
                    (low, high) = (f64::min(low, i), f64::max(high, i));
                }
            }
        }
        let formula = ripple_any_a(duty, battery_v, pwm_hz, l, r);
        assert!((formula / (high - low) - 1.0).abs() < 1e-3, "{formula} {}", high - low);
    }

    #[test]
    fn a_bridge_without_resistance_passes_power_at_the_overdrive_ratio() {
        // Kottas, Eq. A.1: I_dcm = I_a V_a / V_bat.
        let bridge = HBridge { on_ohm: 0.0, pwm_hz: 1e9 };
        let supply = bridge.supply(6.0_f64, 0.2, 12.0, 310e-6, 13.7);
        assert!((supply.supply_a - 0.1).abs() < 1e-6 && (supply.duty - 0.5).abs() < 1e-12);
        // With 0.5 ohm per switch: duty 6 / (12 - 0.2) and 2 x 0.5 x 0.04 A² x 0.5085 = 20.3 mW, by hand. The battery gives what the motor has
        // while it is connected: 0.5085 x 0.2 A.
        let lossy = HBridge { on_ohm: 0.5, pwm_hz: 1e9 }.supply(6.0_f64, 0.2, 12.0, 310e-6, 13.7);
        assert!((lossy.conduction_w - 0.04 * (6.0 / 11.8)).abs() < 1e-6, "{}", lossy.conduction_w);
        assert!((lossy.supply_a - lossy.duty * 0.2).abs() < 1e-6, "{lossy:?}");
        // What the switches leave nothing of is on all the time.
        assert_eq!(HBridge { on_ohm: 50.0, pwm_hz: 1e9 }.supply(6.0_f64, 0.2, 12.0, 310e-6, 13.7).duty, 1.0);
    }
}
