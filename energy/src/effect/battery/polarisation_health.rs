//! State of health: the polarisation as it is now, whatever raised it.
//!
//! `V = k V_polarisation`: k multiplies what the pairs and ladders have put together; time constants
//! stay. Where cycles are told, `polarisation_growth` says how it came to be and what comes next; a
//! log without them shows the factor alone.
//!
//! Absence: after every current step the residual relaxes as the model's own polarisation does.

use super::resistance_health::Health;
use crate::{Channel, EffectSpec, ParameterSpec, Phase, System};

/// Of what pairs and ladders have put together.
pub(crate) static SLOW: Health = Health(&SPEC, &[Channel::CycleCount]);

static SPEC: EffectSpec = EffectSpec {
    id: "polarisation_health",
    title: "State of health: polarisation as it is",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "V = k V_polarisation",
    source: "definition of the state of health by resistance, of its slow part: Plett, Battery Management Systems, volume 2, chapter 4",
    validity: "weeks: it says how much there is, and not how it goes on; needs a pair or a ladder to act on",
    signature: "the residual relaxes after each current step as the model's own polarisation does",
    matters: 1e-3,
    confused_with: &[
        ("resistance_health", "current steps logged faster than the polarisation"),
        ("polarisation_arrhenius", "logs at two temperatures"),
        ("rc2", "a log of the cell when it was new"),
        ("rc_ladder", "a log of the cell when it was new"),
    ],
    parameters: &[ParameterSpec {
        name: "polarisation_ratio",
        meaning: "polarisation that there is, over the stated one",
        default: 1.2,
        null: Some(1.0),
        min: 0.5,
        max: 5.0,
        source: "guess: a cell in the middle of its life, as its resistance at once",
    }],
    states: &[],
};

#[cfg(test)]
mod tests {
    use crate::effect::cell;
    use crate::{Channel, Start};

    /// A pair of 20 mohm with 1.5 times its polarisation drops 30 mV at 1 A; the 50 mohm beside it stay.
    #[test]
    fn what_is_slow_grows_and_what_is_at_once_does_not() {
        let effects: &[(&str, &[(&str, f64)])] = &[
            ("ohmic", &[("resistance_ohm", 0.05)]),
            ("rc1", &[("resistance_ohm", 0.02), ("tau_s", 10.0)]),
            ("polarisation_health", &[("polarisation_ratio", 1.5)]),
        ];
        let mut run = cell(1, effects, Start::at_soc(0.9));
        run.channels[Channel::CurrentA] = 1.0;
        run.step(1000.0);
        let drop_v = run.channels[Channel::OcvV] - run.channels[Channel::VoltageV];
        assert!((drop_v - 0.08).abs() < 1e-6, "{drop_v}");
    }
}
