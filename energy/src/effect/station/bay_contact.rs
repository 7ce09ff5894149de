//! Contact resistance of the bays.
//!
//! `P += R_contact sum(I_bay^2)` in W, with `R_contact` in ohm for both poles of one bay and
//! `I_bay` in A. Contacts lie between converter and charger, for the robots carry their chargers
//! (Kottas, section B.2.1). A log that has charge currents instead of contact currents does nearly
//! as well: 12 V at the battery over 0.88 is 0.9 times the current at 15 V, and the own load makes
//! up for the rest; the resistance found then is that times the square of the ratio.
//!
//! Absence: missing power in the square of the bay currents: it is gone in the constant-voltage
//! part, and steps when a robot is docked anew.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct BayContact;

static SPEC: EffectSpec = EffectSpec {
    id: "bay_contact",
    title: "Contact resistance of the bays",
    system: System::Station,
    phase: Phase::Bypass,
    channel: Channel::PackPowerW,
    needs: &[Channel::BaySquaredCurrentA2],
    equation: "P += R_contact sum(I_bay^2)",
    source: "Joule's law",
    validity: "contacts of one kind, of one resistance over a docking",
    signature: "missing power in the square of the bay currents; steps from docking to docking",
    matters: 0.1,
    confused_with: &[
        ("charger_curve", "measure the voltage on both sides of a bay's contacts"),
        ("converter_curve", "one bay at full current against three at a third"),
    ],
    parameters: &[ParameterSpec {
        name: "contact_ohm",
        meaning: "resistance of both contacts of a bay with their springs",
        default: 0.1,
        null: Some(0.0),
        min: 0.0,
        max: 2.0,
        source: "spring contacts: up to 50 milliohm each when new, several times that when worn or dirty",
    }],
    states: &[],
};

impl Physics for BayContact {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PackPowerW, own.parameters[0] * channels[Channel::BaySquaredCurrentA2]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn added_w(contact_ohm: f64, squared_a2: f64) -> f64 {
        let mut channels = Channels::filled(0.0);
        channels[Channel::BaySquaredCurrentA2] = squared_a2;
        step_once(&BayContact, &Facts::Station, 1.0, &[contact_ohm], &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn three_robots_at_full_current_heat_three_contacts() {
        // 3 x 1.32^2 A^2 x 0.1 ohm.
        assert!((added_w(0.1, 3.0 * 1.32 * 1.32) - 0.52272).abs() < 1e-12);
        assert!(added_w(0.0, 5.0).abs() < 1e-15);
    }

    /// Makers of spring contacts for charging docks state at most 50 milliohm when new: at the
    /// Explorer's 1.32 A such a contact costs less than a tenth of a watt.
    #[test]
    fn a_contact_as_specified_does_not_matter_for_one_explorer() {
        assert!(added_w(0.05, 1.32 * 1.32) < SPEC.matters);
    }
}
