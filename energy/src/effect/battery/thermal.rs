//! Lumped thermal mass: the cell warms by its losses and cools towards the surroundings.
//!
//! `C dT/dt = P_heat - G (T - T_amb)` for one cell, stepped exactly for heat held over the step
//! (Kottas, Eq. C.9, states the first law and no more). P_heat = I V_eta in W, with `entropic` also
//! the reversible heat; C in J/K, G in W/K, temperatures in °C.
//!
//! Absence: measured temperature rises under load where the model stays at ambient.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct LumpedThermal;

static SPEC: EffectSpec = EffectSpec {
    id: "thermal",
    title: "Lumped thermal mass",
    system: System::Battery,
    phase: Phase::Heat,
    channel: Channel::CellDegc,
    needs: &[Channel::CurrentA, Channel::AmbientDegc],
    equation: "C dT/dt = P_heat - G (T - T_amb)",
    source: "first law of thermodynamics (Kottas, Eq. C.9); Newton's law of cooling",
    validity: "small cells (Biot number << 1); reversible heat comes with the effect `entropic`",
    signature: "the temperature residual follows the load with minutes of lag",
    matters: 1.0,
    confused_with: &[],
    parameters: &[
        ParameterSpec {
            name: "conductance_w_per_k",
            meaning: "heat flow to the surroundings per kelvin, one cell",
            default: 0.05,
            null: None,
            min: 1e-3,
            max: 5.0,
            source: "tau = C / G of about 900 s for small pouch cells",
        },
        ParameterSpec {
            name: "heat_share",
            meaning: "share of the losses that warms the cell",
            default: 1.0,
            null: Some(0.0),
            min: 0.0,
            max: 1.0,
            source: "energy conservation: 1; 0 is an isothermal cell",
        },
        ParameterSpec {
            name: "heat_capacity_j_per_k",
            meaning: "heat capacity of one cell",
            default: 45.0,
            null: None,
            min: 1.0,
            max: 5000.0,
            source: "about 1000 J/(kg K) for pouch cells, 45 g",
        },
    ],
    states: &["temperature_degc"],
};

impl Physics for LumpedThermal {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn start<S: Real>(&self, _: &Facts, _: &[S], states: &mut [S], channels: &Channels<S>) {
        states[0] = channels[Channel::TemperatureDegc];
    }

    fn prepared_len(&self) -> usize {
        2
    }

    fn prepare<S: Real>(&self, _: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        // How far a watt of heat warms the cell in the end, K/W.
        prepared[1] = parameters[1] / parameters[0];
        prepared[0] = (parameters[0] / parameters[2] * -dt_s).exp();
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let settled_degc = channels[Channel::AmbientDegc] + own.prepared[1] * channels[Channel::HeatW];
        own.states[0] = settled_degc + (own.states[0] - settled_degc) * own.prepared[0];
        channels[Channel::CellDegc] = own.states[0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn settles_where_heat_and_cooling_balance() {
        let (mut states, mut channels) = ([25.0_f64], Channels::filled(0.0_f64));
        channels[Channel::AmbientDegc] = 25.0;
        channels[Channel::HeatW] = 0.5;
        step_once(&LumpedThermal, &Facts::robot(), 1e6, &[0.05, 1.0, 45.0], &mut states, &mut channels);
        assert!((channels[Channel::CellDegc] - 35.0).abs() < 1e-9);
    }

    #[test]
    fn without_cooling_time_the_rise_is_heat_over_capacity() {
        let (mut states, mut channels) = ([25.0_f64], Channels::filled(0.0_f64));
        channels[Channel::AmbientDegc] = 25.0;
        channels[Channel::HeatW] = 4.5;
        step_once(&LumpedThermal, &Facts::robot(), 0.01, &[0.05, 1.0, 45.0], &mut states, &mut channels);
        assert!((states[0] - 25.001_f64).abs() < 1e-7);
    }

    /// Enertech pouch after its 1C discharge (logs in `scenarios/measured`): 28.966 °C, 27.000 °C
    /// after 191 s, then 25.986, 25.497 and 25.221 °C after 391, 591 and 791 s, in surroundings of
    /// 24.97 °C. The first two give C / G = 282 s; it must tell the others.
    #[test]
    fn the_first_minutes_of_a_measured_cooling_tell_the_rest() {
        let ambient_degc = 24.97;
        let tau_s = 191.0 / ((28.966_f64 - ambient_degc) / (27.0 - ambient_degc)).ln();
        for (time_s, measured_degc) in [(391.0, 25.986), (591.0, 25.497), (791.0, 25.221)] {
            let (mut states, mut channels) = ([28.966_f64], Channels::filled(0.0_f64));
            channels[Channel::AmbientDegc] = ambient_degc;
            step_once(&LumpedThermal, &Facts::robot(), time_s, &[45.0 / tau_s, 1.0, 45.0], &mut states, &mut channels);
            assert!((states[0] - measured_degc).abs() < 0.05, "{time_s} s: {states:?}");
        }
    }
}
