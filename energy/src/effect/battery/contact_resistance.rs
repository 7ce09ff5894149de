//! Resistance of contacts and wiring between the cells and the pack's terminals.
//!
//! `V_terminal -= R I`, with the pack's current I in A and R in ohm for the whole pack. Its heat
//! does not reach the cells.
//!
//! Absence: the residual steps with the current, at every docking by another amount.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct ContactResistance;

static SPEC: EffectSpec = EffectSpec {
    id: "contact_resistance",
    title: "Contacts and wiring",
    system: System::Battery,
    phase: Phase::Connection,
    channel: Channel::TerminalVoltageV,
    needs: &[Channel::CurrentA],
    equation: "V = V_cells - R I",
    source: "Ohm's law; a docking contact, a connector and their wires",
    validity: "any current; constant over a log",
    signature: "the residual steps with the current, is alike at all temperatures, and changes when plugged anew",
    matters: 1e-3,
    confused_with: &[("ohmic", "the voltage on both sides of the connector")],
    parameters: &[ParameterSpec {
        name: "resistance_ohm",
        meaning: "resistance between the cells and where the pack's voltage is measured",
        default: 0.02,
        null: Some(0.0),
        min: 0.0,
        max: 1.0,
        source: "5-50 mOhm for a docking contact or connector with its wires; corroded ones more",
    }],
    states: &[],
};

impl Physics for ContactResistance {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::TerminalVoltageV, -(own.parameters[0] * channels[Channel::TerminalCurrentA]));
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::cell;
    use crate::{Channel, Start};

    /// A 2 m loop of AWG 18 wire has 2 x 20.95 mOhm/m (ASTM B258) = 41.9 mOhm: at 5 A a pack
    /// of three cells loses 210 mV of its voltage, not three times that, and its cells nothing.
    #[test]
    fn a_loop_of_thin_wire_costs_the_pack_its_drop_once() {
        let effects: &[(&str, &[(&str, f64)])] = &[("contact_resistance", &[("resistance_ohm", 2.0 * 0.02095)])];
        let mut run = cell(3, effects, Start::at_soc(0.5));
        run.channels[Channel::CurrentA] = 5.0;
        run.step(0.01);
        let lost_v = 3.0 * run.channels[Channel::OcvV] - run.channels[Channel::VoltageV];
        assert!((lost_v - 0.2095).abs() < 1e-9, "{lost_v}");
        assert_eq!(run.channels[Channel::CellVoltageV], run.channels[Channel::OcvV]);
        assert_eq!(run.channels[Channel::HeatW], 0.0);
    }

    #[test]
    fn without_current_there_is_no_drop() {
        let effects: &[(&str, &[(&str, f64)])] = &[("contact_resistance", &[("resistance_ohm", 1.0)])];
        let mut run = cell(1, effects, Start::at_soc(0.5));
        run.step(1.0);
        assert_eq!(run.channels[Channel::VoltageV], 3.5);
    }
}
