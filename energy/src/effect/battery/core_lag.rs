//! Core-to-sensor lag: the sensor sits on the surface, which follows the inside of the cell late.
//!
//! `tau dT_s/dt = T - T_s`, with T inside the cell and T_s at the sensor, both in °C, tau in s.
//! Stepped exactly for a T that moves linearly over the step, so that tau = 0 is no lag at all:
//! `T_s' = a T_s + (b - a) T + (1 - b) T'` with `a = exp(-dt / tau)`, `b = (1 - a) tau / dt`.
//! What the pouch loses to the surroundings is left to the thermal effect; this one only delays.
//!
//! Absence: the temperature residual follows the slope of the temperature, late after each change
//! of load. Resistances read the temperature inside, so their residuals are early by as much.

use crate::real::exp;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CoreLag;

/// Beyond this exponent e^-x is zero in double precision, and its derivatives are not looked at.
const EXPONENT_MAX: f64 = 700.0;

static SPEC: EffectSpec = EffectSpec {
    id: "core_lag",
    title: "Lag between cell core and temperature sensor",
    system: System::Battery,
    phase: Phase::Shown,
    channel: Channel::TemperatureDegc,
    needs: &[Channel::TemperatureDegc],
    equation: "tau dT_s/dt = T - T_s",
    source: "first-order heat conduction; Kottas, Fig. 6.1 (thermistor on the pack)",
    validity: "models that predict temperature; one thermal path from core to sensor",
    signature: "the temperature residual is proportional to the slope of the temperature",
    matters: 0.1,
    confused_with: &[("thermal", "a step of load logged faster than tau")],
    parameters: &[ParameterSpec {
        name: "tau_s",
        meaning: "time in which the sensor makes up 63 % of a difference",
        default: 60.0,
        null: Some(0.0),
        min: 0.0,
        max: 1000.0,
        source: "30-120 s on small cells with a thermistor on the can",
    }],
    states: &["sensor_degc", "core_before_degc"],
};

impl Physics for CoreLag {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn start<S: Real>(&self, _: &Facts, _: &[S], states: &mut [S], channels: &Channels<S>) {
        states.fill(channels[Channel::CellDegc]);
    }

    fn prepared_len(&self) -> usize {
        2
    }

    fn prepare<S: Real>(&self, _: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        let tau_s = parameters[0];
        let kept = if dt_s < EXPONENT_MAX * tau_s.re() { exp(tau_s.recip() * -dt_s) } else { S::from(0.0) };
        prepared[0] = kept;
        prepared[1] = (-kept + 1.0) * tau_s / dt_s;
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let (kept, late) = (own.prepared[0], own.prepared[1]);
        let [sensor_degc, before_degc] = [own.states[0], own.states[1]];
        let now_degc = channels[Channel::CellDegc];
        own.states[0] = now_degc + (before_degc - now_degc) * late + (sensor_degc - before_degc) * kept;
        own.states[1] = now_degc;
        let lag_k = now_degc - own.states[0];
        channels.add(Channel::TemperatureDegc, -lag_k);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    /// The sensor's temperature after a core that begins at 20 degC followed `core_degc(t)`.
    fn sensor_degc(tau_s: f64, dt_s: f64, steps: u32, core_degc: impl Fn(f64) -> f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        let mut states = [20.0, 20.0];
        for step in 1..=steps {
            let core = core_degc(f64::from(step) * dt_s);
            channels[Channel::CellDegc] = core;
            channels[Channel::TemperatureDegc] = core;
            step_once(&CoreLag, &Facts::robot(), dt_s, &[tau_s], &mut states, &mut channels);
        }
        channels[Channel::TemperatureDegc]
    }

    #[test]
    fn without_a_time_constant_the_sensor_shows_the_core() {
        assert_eq!(sensor_degc(0.0, 10.0, 5, |t| 20.0 + t), 70.0);
    }

    #[test]
    fn a_ramp_is_shown_late_by_the_time_constant_whatever_the_step() {
        // Laplace: the answer of a first-order lag to a ramp of k K/s trails by k tau.
        let ramp = |t: f64| 20.0 + 0.02 * t;
        let shown = sensor_degc(60.0, 10.0, 200, ramp);
        assert!((ramp(2000.0) - shown - 0.02 * 60.0).abs() < 1e-12, "{shown}");
        assert!((sensor_degc(60.0, 2000.0, 1, ramp) - shown).abs() < 1e-9);
    }

    #[test]
    fn follows_the_surface_of_a_measured_cell_whose_core_swings() {
        // A123 26650: 1.94 K/W from core to surface and 4.5 J/K of surface (Lin et al. 2014, J. Power Sources 257, 1),
        // here integrated in steps of 1 ms; the effect takes steps of 2 s.
        let (resistance_k_per_w, capacity_j_per_k) = (1.94, 4.5);
        let core = |t: f64| 20.0 + 5.0 * (t / 40.0).sin();
        let mut surface_degc = 20.0;
        for step in 0..100_000 {
            let t = (f64::from(step) + 0.5) * 1e-3;
            surface_degc += 1e-3 * (core(t) - surface_degc) / resistance_k_per_w / capacity_j_per_k;
        }
        let shown = sensor_degc(resistance_k_per_w * capacity_j_per_k, 2.0, 50, core);
        assert!((shown - surface_degc).abs() < 5e-3, "{shown} and {surface_degc}");
        assert!((shown - core(100.0)).abs() > 0.5);
    }
}
