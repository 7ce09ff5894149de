//! Polarisation that grows with cycles.
//!
//! `V_pol(N) = V_pol (1 + g N)`, N full cycles, g per cycle: it multiplies what the pairs and ladders
//! have put together, as `resistance_growth` does every drop at once. The two wear at different
//! rates: contacts and electrolyte make up the one, films and lost reaction area the other. Time
//! constants stay.
//!
//! Absence: what relaxes after a current step grows from month to month.

use super::resistance_growth::Growth;
use crate::{Channel, EffectSpec, ParameterSpec, Phase, System};

/// Of what pairs and ladders have put together.
pub(crate) static SLOW: Growth = Growth(&SPEC);

static SPEC: EffectSpec = EffectSpec {
    id: "polarisation_growth",
    title: "Polarisation growth per cycle",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA, Channel::CycleCount],
    equation: "V = V_polarisation (1 + g N)",
    source: "form of Schmalstieg et al., J. Power Sources 257 (2014) 325, who found the resistance linear in charge throughput",
    validity: "until the polarisation has tripled; needs a pair or a ladder to act on",
    signature: "the part of the residual that relaxes after a step grows with cycle count",
    matters: 1e-3,
    confused_with: &[
        ("resistance_growth", "current steps logged faster than the polarisation"),
        ("polarisation_arrhenius", "two temperatures at one age"),
    ],
    parameters: &[ParameterSpec {
        name: "growth_per_cycle",
        meaning: "share of the new polarisation added per full cycle",
        default: 1e-3,
        null: Some(0.0),
        min: -1e-3,
        max: 0.02,
        source: "guess: as the resistance at once, for which Schmalstieg 2014 found 1.1e-3 in a 2 Ah NMC cell",
    }],
    states: &[],
};

#[cfg(test)]
mod tests {
    use crate::effect::cell;
    use crate::{Channel, Start};

    /// What is missing of the OCV after a long discharge at 1 A.
    fn drop_v(cycle_count: f64) -> f64 {
        let effects: &[(&str, &[(&str, f64)])] = &[
            ("ohmic", &[("resistance_ohm", 0.05)]),
            ("rc1", &[("resistance_ohm", 0.02), ("tau_s", 10.0)]),
            ("hysteresis", &[("amplitude_v", 10e-3), ("rate", 1000.0)]),
            ("polarisation_growth", &[("growth_per_cycle", 2e-3)]),
        ];
        let mut run = cell(1, effects, Start { cycle_count, ..Start::at_soc(0.9) });
        run.channels[Channel::CurrentA] = 1.0;
        run.step(1000.0);
        run.channels[Channel::OcvV] - run.channels[Channel::VoltageV]
    }

    /// 500 cycles at 2e-3 double it: the 20 mV of the pair become 40; 50 mV at once and 10 mV of hysteresis stay.
    #[test]
    fn grows_with_cycles_and_leaves_the_ohmic_drop_and_hysteresis() {
        assert!((drop_v(0.0) - 0.08).abs() < 1e-6, "{}", drop_v(0.0));
        assert!((drop_v(500.0) - 0.10).abs() < 1e-6, "{}", drop_v(500.0));
    }
}
