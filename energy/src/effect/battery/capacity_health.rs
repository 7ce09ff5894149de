//! State of health: the capacity that is left, whatever took the rest.
//!
//! `Q = s Q_stated`, s the share of the stated capacity that there is: the state of health of a
//! fuel gauge. Where cycles or days are told, `capacity_fade` and `calendar_fade` say how it came
//! to be and what comes next; a log without them shows the share alone.
//!
//! Absence: a pack empties earlier than the model says, by the same share at every current.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CapacityHealth;

static SPEC: EffectSpec = EffectSpec {
    id: "capacity_health",
    title: "State of health: capacity that is left",
    system: System::Battery,
    phase: Phase::Capacity,
    channel: Channel::CapacityAh,
    needs: &[Channel::CurrentA],
    equation: "Q = s Q_stated",
    source: "definition of the state of health of a battery: Plett, Battery Management Systems, volume 2, chapter 4",
    validity: "weeks: it says how much is left, and not how it goes on",
    signature: "SoC error grows with the charge drawn; full discharges end early at every current",
    matters: 1e-2,
    confused_with: &[
        ("current_gain", "count the same charge by another meter"),
        ("rate_capacity", "discharges at two currents"),
        ("weak_cell", "measure the cells' voltages one by one"),
    ],
    parameters: &[ParameterSpec {
        name: "capacity_share",
        meaning: "capacity that there is, as a share of the stated one",
        default: 0.9,
        null: Some(1.0),
        min: 0.2,
        max: 1.2,
        source: "guess: a cell in the middle of its life; it counts as worn out at 0.8",
    }],
    states: &[],
};

impl Physics for CapacityHealth {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn told_by(&self) -> &'static [Channel] {
        &[Channel::CycleCount, Channel::AgeDays]
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels[Channel::CapacityAh] *= own.parameters[0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn a_battery_holds_its_share() {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::CapacityAh] = 2.5;
        step_once(&CapacityHealth, &Facts::robot(), 1.0, &[0.8], &mut [], &mut channels);
        assert!((channels[Channel::CapacityAh] - 2.0).abs() < 1e-12);
    }
}
