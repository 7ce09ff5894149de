//! Polarisation that depends on state of charge: more of it near empty, and near full.
//!
//! `V = V_pol (1 + r(SoC))`, r linearly interpolated between knots and zero at SoC 0.4, which the
//! effects before it were stated for. It multiplies what these have put together (pairs, ladders,
//! diffusion, charge transfer that bends with the current): a pair whose resistance is a table, `V1 = R1(SoC) i1` with `di1/dt = (I - i1) / tau1`. Charge transfer
//! is slow where few sites are left to give lithium or to take it. What follows the current at
//! once is `ohmic_soc`.
//!
//! Absence: what relaxes after a current step, or bends with it, is too small near empty, and right
//! in the middle.

use super::ohmic_soc::between;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct PolarisationSoc;

/// State of charge of each knot: those of the resistance that follows the current at once.
const KNOTS: [f64; 7] = [0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0];
/// The knot at which the polarisation is its own.
const MIDDLE: usize = 4;

macro_rules! knot {
    ($name:literal) => {
        ParameterSpec {
            name: $name,
            meaning: "polarisation at this SoC beyond that at SoC 0.4, as a share of that one",
            default: 0.0,
            null: Some(0.0),
            min: -0.9,
            max: 20.0,
            source: "range is a guess: charge transfer near empty is several times that at half charge (Waag et al., Applied Energy 102 (2013) 885)",
        }
    };
}

static SPEC: EffectSpec = EffectSpec {
    id: "polarisation_soc",
    title: "Polarisation over state of charge",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "V = V_polarisation (1 + r(SoC)), r linear between SoC 0, 0.05, 0.1, 0.2, 0.4 (r = 0), 0.7, 1",
    source: "Waag, Kaebitz and Sauer, Applied Energy 102 (2013) 885; tables of pairs over SoC are usual in equivalent circuits",
    validity: "SoC 0..1; held constant outside; time constants do not follow the charge",
    signature: "the part of the residual that relaxes after a current step follows SoC, largest near empty",
    matters: 1e-3,
    confused_with: &[
        ("ohmic_soc", "current steps logged faster than the polarisation, near empty and in the middle"),
        ("butler_volmer", "current steps of several sizes, near empty and in the middle"),
        ("surface_diffusion", "rests at several SoC, where the OCV curve is steep and where it is flat"),
    ],
    parameters: &[
        knot!("share_soc_000"),
        knot!("share_soc_005"),
        knot!("share_soc_010"),
        knot!("share_soc_020"),
        knot!("share_soc_070"),
        knot!("share_soc_100"),
    ],
    states: &[],
};

impl Physics for PolarisationSoc {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let mut shares = [S::from(0.0); KNOTS.len()];
        shares[..MIDDLE].copy_from_slice(&own.parameters[..MIDDLE]);
        shares[MIDDLE + 1..].copy_from_slice(&own.parameters[MIDDLE..]);
        let share = between(&KNOTS, &shares, channels[Channel::Soc]);
        channels[Channel::OverpotentialV] *= share + 1.0;
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::cell;
    use crate::{Channel, Start};

    const SHARES: &[(&str, f64)] = &[
        ("share_soc_000", 5.0),
        ("share_soc_005", 3.0),
        ("share_soc_010", 2.0),
        ("share_soc_020", 1.0),
        ("share_soc_070", -0.2),
        ("share_soc_100", 0.4),
    ];

    /// What is missing of the OCV with 10 mV of ohmic drop, 10 mV of hysteresis and 20 mV of a settled pair.
    fn drop_v(soc: f64) -> f64 {
        let effects: &[(&str, &[(&str, f64)])] = &[
            ("ohmic", &[("resistance_ohm", 0.01)]),
            ("rc1", &[("resistance_ohm", 0.02), ("tau_s", 1.0)]),
            ("polarisation_soc", SHARES),
            ("hysteresis", &[("amplitude_v", 10e-3), ("rate", 1000.0)]),
        ];
        // 72 s at 1 A are a hundredth of 2 Ah, a gamma of 1000 later all hysteresis has turned.
        let mut run = cell(1, effects, Start { history: 1.0, ..Start::at_soc(soc + 0.01) });
        run.channels[Channel::CurrentA] = 1.0;
        run.step(72.0);
        run.channels[Channel::OcvV] - run.channels[Channel::VoltageV]
    }

    #[test]
    fn multiplies_what_is_slow_by_a_table_and_neither_the_ohmic_drop_nor_hysteresis() {
        // By hand: half-way between 2 and 1 at SoC 0.15; 1 at 0.2 falls to 0 at 0.4; -0.2 at 0.7 rises to 0.4 at 1.
        for (soc, share) in [(0.4, 0.0), (0.05, 3.0), (0.15, 1.5), (0.3, 0.5), (0.55, -0.1), (0.85, 0.1), (0.0, 5.0)] {
            let expected_v = 0.02 + 0.02 * (1.0 + share);
            assert!((drop_v(soc) - expected_v).abs() < 1e-9, "at {soc}: {} in place of {expected_v}", drop_v(soc));
        }
    }

    /// The state is the current through the resistance, not its voltage: a rest that begins at one charge and is watched at the same
    /// decays from what R1 is there, and a pair does not jump when the charge that it was loaded at is left.
    #[test]
    fn the_pair_relaxes_from_what_its_resistance_is_where_it_rests() {
        let effects: &[(&str, &[(&str, f64)])] = &[("rc1", &[("resistance_ohm", 0.02), ("tau_s", 100.0)]), ("polarisation_soc", SHARES)];
        let mut run = cell(1, effects, Start::at_soc(0.1 + 0.1));
        run.channels[Channel::CurrentA] = 1.0;
        run.step(720.0);
        let loaded_v = run.channels[Channel::OverpotentialV];
        run.channels[Channel::CurrentA] = 0.0;
        run.step(100.0);
        let gone = 1.0 - (-7.2f64).exp();
        assert!((loaded_v - 0.02 * 3.0 * gone).abs() < 1e-9, "{loaded_v}");
        assert!((run.channels[Channel::OverpotentialV] - loaded_v * (-1f64).exp()).abs() < 1e-9);
    }
}
