//! Bias of the temperature sensor.
//!
//! `T_shown = T + T_bias`, in K. Acts after the lag between core and sensor. Only models that
//! predict the temperature have a shown one: a temperature that is an input is taken as it is.
//!
//! Absence: the temperature residual is constant, also after a night at ambient temperature.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct TemperatureBias;

static SPEC: EffectSpec = EffectSpec {
    id: "temperature_bias",
    title: "Bias of the temperature sensor",
    system: System::Battery,
    phase: Phase::Shown,
    channel: Channel::TemperatureDegc,
    needs: &[Channel::TemperatureDegc],
    equation: "T_shown = T + T_bias",
    source: "definition of an offset; thermistor tolerances",
    validity: "models that predict temperature; a bias that does not move with it",
    signature: "a constant temperature residual, at rest too",
    matters: 0.5,
    confused_with: &[("thermal", "a night at a known ambient temperature")],
    parameters: &[ParameterSpec {
        name: "bias_k",
        meaning: "temperature shown beyond the cell's",
        default: 0.0,
        null: Some(0.0),
        min: -20.0,
        max: 20.0,
        source: "sign unknown; thermistor and reference resistor: 1-3 K",
    }],
    states: &[],
};

impl Physics for TemperatureBias {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::TemperatureDegc, own.parameters[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn a_thermistor_of_one_percent_reads_a_quarter_of_a_kelvin_off() {
        // 103AT thermistor: B = 3435 K. At 25 degC, 1 % of resistance is 0.01 T^2 / B (data sheet's own formula).
        let bias_k = 0.01 * 298.15_f64.powi(2) / 3435.0;
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::TemperatureDegc] = 25.0;
        step_once(&TemperatureBias, &Facts::robot(), 1.0, &[bias_k], &mut [], &mut channels);
        assert!((channels[Channel::TemperatureDegc] - 25.26).abs() < 5e-3);
        assert_eq!(channels[Channel::CellDegc], 0.0);
    }

    #[test]
    fn at_its_null_the_sensor_shows_what_is() {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::TemperatureDegc] = 25.0;
        step_once(&TemperatureBias, &Facts::robot(), 1.0, &[0.0], &mut [], &mut channels);
        assert_eq!(channels[Channel::TemperatureDegc], 25.0);
    }
}
