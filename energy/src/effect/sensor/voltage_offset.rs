//! Offset of the voltage sensor.
//!
//! `V_shown = V + V_off`, in V of the pack. Acts after the gain: shown = g V + offset.
//!
//! Absence: a constant residual, at every current, SoC and temperature.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct VoltageOffset;

static SPEC: EffectSpec = EffectSpec {
    id: "voltage_offset",
    title: "Offset of the voltage sensor",
    system: System::Battery,
    phase: Phase::Shown,
    channel: Channel::VoltageV,
    needs: &[],
    equation: "V_shown = V + V_off",
    source: "definition of an offset; gauge data sheets",
    validity: "an offset that does not move with temperature",
    signature: "a constant voltage residual",
    matters: 1e-3,
    confused_with: &[("entropic", "rests at least 10 K apart"), ("voltage_gain", "rests at high and low SoC")],
    parameters: &[ParameterSpec {
        name: "offset_v",
        meaning: "voltage shown beyond the pack's",
        default: 0.0,
        null: Some(0.0),
        min: -0.5,
        max: 0.5,
        source: "sign unknown; gauge chips: 1-6 mV",
    }],
    states: &[],
};

impl Physics for VoltageOffset {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::VoltageV, own.parameters[0]);
    }
}

#[cfg(test)]
mod tests {
    use crate::{Channel, Model, Run, Start, built_in};
    use std::sync::Arc;

    #[test]
    fn the_sensor_is_off_and_the_terminals_and_their_power_are_not() {
        // Gauge chips show up to 6 mV beside the truth (data sheets).
        let plain = built_in("explorer-3s1p-1320mah").unwrap();
        let with = format!("{plain}\n[[effect]]\nid = \"voltage_offset\"\noffset_v = {{ value = 6e-3, source = \"test\" }}\n");
        let run = |text: &str| {
            let model = Model::parse("test", text, &|table| Ok(built_in(table).unwrap().to_owned())).unwrap();
            let mut run = Run::new(Arc::new(model), Start::at_soc(0.5));
            run.channels[Channel::CurrentA] = 1.0;
            run.step(1.0);
            run.channels
        };
        let (plain, with) = (run(plain), run(&with));
        assert!((with[Channel::VoltageV] - plain[Channel::VoltageV] - 6e-3).abs() < 1e-12);
        assert_eq!(with[Channel::TerminalVoltageV], plain[Channel::TerminalVoltageV]);
        assert_eq!(with[Channel::PowerW], plain[Channel::PowerW]);
    }
}
