//! State of health: the resistance as it is now, whatever raised it.
//!
//! `R = k R_stated`: k multiplies every drop that follows the current at once. Where cycles or days
//! are told, `resistance_growth` and `calendar_resistance` say how it came to be and what comes
//! next; a log without them shows the factor alone.
//!
//! Absence: a residual under load in proportion to the drop that the model has.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

/// What multiplies the drops of its phase: those at once, or what is slow (`polarisation_health`); and what tells how it came to be.
pub(crate) struct Health(pub(crate) &'static EffectSpec, pub(crate) &'static [Channel]);

/// Of every drop at once.
pub(crate) static AT_ONCE: Health = Health(&SPEC, &[Channel::CycleCount, Channel::AgeDays]);

static SPEC: EffectSpec = EffectSpec {
    id: "resistance_health",
    title: "State of health: resistance as it is",
    system: System::Battery,
    phase: Phase::Series,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "R = k R_stated",
    source: "definition of the state of health by resistance: Plett, Battery Management Systems, volume 2, chapter 4",
    validity: "weeks: it says how much there is, and not how it goes on; needs a series resistance to act on",
    signature: "residual under load in proportion to the model's own drop",
    matters: 1e-3,
    confused_with: &[
        ("arrhenius", "logs at two temperatures"),
        ("contact_resistance", "measure the voltage at the cells and at the terminals"),
        ("rc_ladder", "current steps logged faster than its shortest time constant"),
    ],
    parameters: &[ParameterSpec {
        name: "resistance_ratio",
        meaning: "resistance that there is, over the stated one",
        default: 1.2,
        null: Some(1.0),
        min: 0.5,
        max: 5.0,
        source: "guess: a cell in the middle of its life; it counts as worn out at 2",
    }],
    states: &[],
};

impl Physics for Health {
    fn spec(&self) -> &'static EffectSpec {
        self.0
    }

    fn told_by(&self) -> &'static [Channel] {
        self.1
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels[Channel::OverpotentialV] *= own.parameters[0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn every_drop_at_once_grows_alike() {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::OverpotentialV] = 0.1;
        step_once(&AT_ONCE, &Facts::robot(), 1.0, &[1.5], &mut [], &mut channels);
        assert!((channels[Channel::OverpotentialV] - 0.15).abs() < 1e-12);
    }
}
