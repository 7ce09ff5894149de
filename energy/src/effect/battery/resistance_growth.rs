//! Resistance that grows with cycles.
//!
//! `R(N) = R (1 + g N)`, N full cycles, g per cycle: it multiplies every drop that follows the
//! current at once. Growth with time alone is an effect of its own (`calendar_resistance`).
//!
//! Absence: the residual under load grows from month to month, in proportion to the current.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

/// What multiplies the drops of its phase: those at once, or what is slow (`polarisation_growth`).
pub(crate) struct Growth(pub(crate) &'static EffectSpec);

/// Of every drop at once.
pub(crate) static AT_ONCE: Growth = Growth(&SPEC);

static SPEC: EffectSpec = EffectSpec {
    id: "resistance_growth",
    title: "Resistance growth per cycle",
    system: System::Battery,
    phase: Phase::Series,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA, Channel::CycleCount],
    equation: "R = R_new (1 + g N)",
    source: "Schmalstieg et al., J. Power Sources 257 (2014) 325: linear in charge throughput",
    validity: "until the resistance has tripled; needs a series resistance to act on",
    signature: "the residual under load grows with cycle count, in proportion to the current",
    matters: 1e-3,
    confused_with: &[
        ("arrhenius", "two temperatures at one age"),
        ("calendar_resistance", "two packs of one age, of which one was hardly used"),
    ],
    parameters: &[ParameterSpec {
        name: "growth_per_cycle",
        meaning: "share of the new resistance added per full cycle",
        default: 1e-3,
        null: Some(0.0),
        min: -1e-3,
        max: 0.02,
        source: "Schmalstieg 2014: 1.1e-3 for full cycles of a 2 Ah NMC cell; new cells may fall by some per cent first (NASA B0025)",
    }],
    states: &[],
};

/// What is left of a resistance at least: a line that falls would cross zero.
const LEAST: f64 = 0.05;

/// One plus a growth, kept positive.
#[inline]
pub(crate) fn factor<S: Real>(growth: S) -> S {
    if growth.re() > LEAST - 1.0 { growth + 1.0 } else { S::from(LEAST) }
}

impl Physics for Growth {
    fn spec(&self) -> &'static EffectSpec {
        self.0
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let growth = own.parameters[0] * channels[Channel::CycleCount];
        channels[Channel::OverpotentialV] *= factor(growth);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn grown(growth_per_cycle: f64, cycles: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::OverpotentialV] = 1.0;
        channels[Channel::CycleCount] = cycles;
        step_once(&AT_ONCE, &Facts::robot(), 1.0, &[growth_per_cycle], &mut [], &mut channels);
        channels[Channel::OverpotentialV]
    }

    #[test]
    fn a_new_cell_has_its_stated_resistance_and_no_growth_takes_all_of_it() {
        assert_eq!(grown(1e-3, 0.0), 1.0);
        assert_eq!(grown(-1e-3, 1e4), LEAST);
    }

    /// Schmalstieg 2014 for a mean voltage of 3.725 V: 2.798e-4 DoD - 1.521e-5 per Ah moved. A
    /// full cycle of their 2.05 Ah cell moves 4.1 Ah: 1.085e-3, so the resistance doubles (the
    /// usual end of life by power) in 1 / 1.085e-3 = 922 cycles.
    #[test]
    fn a_cell_of_the_published_growth_doubles_its_resistance_in_922_cycles() {
        let per_cycle = (2.798e-4 - 1.521e-5) * 4.1;
        assert!((grown(per_cycle, 922.0) - 2.0).abs() < 1e-3);
    }
}
