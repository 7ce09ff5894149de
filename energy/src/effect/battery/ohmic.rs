//! Ohmic resistance: the drop that follows the current at once.
//!
//! `V_ohm = R0 I_cell`, with R0 in ohm per cell, I_cell in A per cell, V_ohm in V per cell
//! (Kottas, section C.1.1: the dominant overpotential over most of the discharge).
//!
//! Absence: the residual steps with the current and has its sign.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Ohmic;

static SPEC: EffectSpec = EffectSpec {
    id: "ohmic",
    title: "Ohmic resistance R0",
    system: System::Battery,
    phase: Phase::Series,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "V = R0 I",
    source: "Kottas, section C.1.1",
    validity: "any current; R0 constant over SoC and temperature",
    signature: "the residual steps with the current, in proportion and at once",
    matters: 1e-3,
    confused_with: &[("ohmic_soc", "a discharge over the whole range of SoC")],
    parameters: &[ParameterSpec {
        name: "resistance_ohm",
        meaning: "resistance of one cell",
        default: 0.03,
        null: Some(0.0),
        min: 0.0,
        max: 1.0,
        source: "LiPo cells of 1-8 Ah: about 5-60 mOhm",
    }],
    states: &[],
};

impl Physics for Ohmic {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::OverpotentialV, own.parameters[0] * channels[Channel::CellCurrentA]);
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::cell;
    use crate::{Channel, Start};

    fn run(resistance_ohm: f64, current_a: f64) -> crate::Run<f64> {
        let mut run = cell(1, &[("ohmic", &[("resistance_ohm", resistance_ohm)])], Start::at_soc(0.5));
        run.channels[Channel::CurrentA] = current_a;
        run.step(1e-6);
        run
    }

    /// Ohm and Joule by hand: 50 mOhm at 2 A drop 100 mV and make 0.2 W, in either direction.
    #[test]
    fn the_drop_follows_the_current_and_its_heat_the_square() {
        for current_a in [2.0, -2.0] {
            let run = run(0.05, current_a);
            assert!((run.channels[Channel::OverpotentialV] - 0.05 * current_a).abs() < 1e-12);
            assert!((run.channels[Channel::HeatW] - 0.2).abs() < 1e-12);
        }
        assert_eq!(run(0.05, 0.0).channels[Channel::VoltageV], 3.5);
    }

    /// Enertech pouch (logs in `scenarios/measured`), 1.14 Ah after full: 3.7937, 3.7292 and
    /// 3.6534 V at 0.228, 1.14 and 2.28 A. The resistance between the first two must tell the
    /// third. It is a few per cent high, for charge transfer bends the line.
    #[test]
    fn two_measured_discharges_tell_the_voltage_of_a_third() {
        let resistance_ohm = (3.7937 - 3.7292) / (1.14 - 0.228);
        let drop_v = |current_a| run(resistance_ohm, current_a).channels[Channel::OverpotentialV];
        let more_v: f64 = drop_v(2.28) - drop_v(1.14);
        assert!((more_v / (3.7292 - 3.6534) - 1.0).abs() < 0.08, "{more_v}");
    }
}
