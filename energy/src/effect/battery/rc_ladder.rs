//! Polarisation with a range of time constants: a depressed semicircle in the impedance.
//!
//! `Z(s) = R / (1 + (s tau)^a)`, `a = 1 - spread`, the ZARC (Cole-Cole) element: a resistance
//! beside a constant phase element (Kottas, Eq. C.2). Spread 0 is an RC pair; measured arcs have
//! 0.1-0.4. R in ohm per cell, tau in s.
//!
//! Its relaxation times are distributed over `u = ln(t / tau)` with the cumulative share
//! `G(u) = atan(tan(a pi / 2) tanh(a u / 2)) / (a pi)`, from -1/2 to 1/2. Seven RC pairs stand a
//! fixed distance apart around tau; each has the share of R between the middles to its
//! neighbours, the outer two all that is beyond. So the shares add up to R, and with spread 0 the
//! middle pair has all.
//!
//! Absence: after a current step the residual relaxes over several decades of time, fast at
//! first, and comes to an end.

use super::rc::step_slowed_pairs;
use super::relaxation_arrhenius::slowness;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct RcLadder;

const PAIRS: usize = 7;

/// Distance of the pairs' times on a logarithmic axis: a factor of e^2 = 7.4.
const SPACING: f64 = 2.0;

static SPEC: EffectSpec = EffectSpec {
    id: "rc_ladder",
    title: "Ladder of time constants (ZARC)",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "Z = R / (1 + (j 2 pi f tau)^(1 - spread))",
    source: "Cole and Cole, J. Chem. Phys. 9 (1941) 341; constant phase element: Kottas, Eq. C.2",
    validity: "within 2 % of R at all frequencies for spread 0.05-0.5; linear in the current",
    signature: "after each current step the residual relaxes over several decades of time and comes to an end",
    matters: 1e-3,
    confused_with: &[
        ("rc1", "a rest logged from its first second to ten time constants"),
        ("rc2", "a rest logged from its first second to ten time constants"),
        ("warburg", "a rest of several hours: a ladder settles"),
    ],
    parameters: &[
        ParameterSpec {
            name: "resistance_ohm",
            meaning: "sum of the polarisation resistances of one cell",
            default: 0.01,
            null: Some(0.0),
            min: 0.0,
            max: 1.0,
            source: "of the order of R0 in published fits",
        },
        ParameterSpec {
            name: "tau_s",
            meaning: "middle of the time constants",
            default: 50.0,
            null: None,
            min: 1.0,
            max: 5000.0,
            source: "guess: between the 10-70 s and 250-1900 s of fits with two pairs",
        },
        ParameterSpec {
            name: "spread",
            meaning: "one less the exponent of the constant phase element: 0 is one time constant",
            default: 0.3,
            null: None,
            min: 0.0,
            max: 0.5,
            source: "0.1-0.4 in impedance spectra of porous electrodes; 0.5 is Warburg's exponent",
        },
    ],
    states: &["ladder_0_v", "ladder_1_v", "ladder_2_v", "ladder_3_v", "ladder_4_v", "ladder_5_v", "ladder_6_v"],
};

/// Logarithm of every pair's time over the middle one.
fn place(pair: usize) -> f64 {
    SPACING * (pair as f64 - (PAIRS / 2) as f64)
}

/// Share of R of every pair.
fn shares<S: Real>(spread: S) -> [S; PAIRS] {
    let exponent = -spread + 1.0;
    let steep = (exponent * std::f64::consts::FRAC_PI_2).tan();
    let mut below = S::from(-0.5);
    std::array::from_fn(|pair| {
        let middle = place(pair) + SPACING / 2.0;
        let up_to = if pair + 1 < PAIRS {
            (steep * (exponent * (middle / 2.0)).tanh()).atan() / (exponent * std::f64::consts::PI)
        } else {
            S::from(0.5)
        };
        let share = up_to - below;
        below = up_to;
        share
    })
}

impl Physics for RcLadder {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    /// Decay and share of every pair, then the exponents of all decays.
    fn prepared_len(&self) -> usize {
        3 * PAIRS
    }

    fn prepare<S: Real>(&self, facts: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        for (share, pair) in shares(parameters[2]).into_iter().zip(prepared[..2 * PAIRS].chunks_exact_mut(2)) {
            pair[1] = parameters[0] * share;
        }
        self.prepare_length(facts, dt_s, parameters, prepared);
    }

    fn prepare_length<S: Real>(&self, _: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        let per_tau = parameters[1].recip() * -dt_s;
        for pair in 0..PAIRS {
            let exponent = per_tau * (-place(pair)).exp();
            (prepared[2 * pair], prepared[2 * PAIRS + pair]) = (exponent.exp(), exponent);
        }
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let sum_v = step_slowed_pairs(own.states, own.prepared.split_at(2 * PAIRS), channels[Channel::CellCurrentA], slowness(channels));
        channels.add(Channel::OverpotentialV, sum_v);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;
    use crate::effect::step_once;

    #[test]
    fn the_ladder_has_the_impedance_of_a_zarc_within_two_per_cent_of_r() {
        for spread in [0.05, 0.1, 0.2, 0.3, 0.4, 0.5] {
            for step in -400..=400 {
                let s = Complex::new(0.0, 10f64.powf(f64::from(step) / 100.0));
                let exact = (s.powf(1.0 - spread) + 1.0).inv();
                let pairs = shares(spread).into_iter().enumerate();
                let ours: Complex<f64> = pairs.map(|(pair, share)| (s * place(pair).exp() + 1.0).inv() * share).sum();
                assert!((ours - exact).norm() < 0.02, "spread {spread} at {s}: {ours} {exact}");
            }
        }
    }

    #[test]
    fn without_spread_it_is_one_rc_pair_and_at_last_it_is_a_resistance() {
        let after = |spread: f64, dt_s: f64| {
            let (mut states, mut channels) = ([0.0; PAIRS], Channels::filled(0.0_f64));
            channels[Channel::CellCurrentA] = 1.0;
            step_once(&RcLadder, &Facts::robot(), dt_s, &[0.02, 50.0, spread], &mut states, &mut channels);
            channels[Channel::OverpotentialV]
        };
        assert!((after(0.0, 50.0) - 0.02 * (1.0 - (-1f64).exp())).abs() < 1e-12);
        assert!((after(0.4, 1e7) - 0.02).abs() < 1e-12);
    }

    /// A depressed semicircle's height is known: at f = 1 / (2 pi tau) the imaginary part is
    /// R/2 tan(a pi / 4): 0.5 R for a pair, 0.207 R at a = 1/2.
    #[test]
    fn with_half_spread_the_arc_is_0_207_r_high() {
        let s = Complex::new(0.0, 1.0);
        let pairs = shares(0.5).into_iter().enumerate();
        let ours: Complex<f64> = pairs.map(|(pair, share)| (s * place(pair).exp() + 1.0).inv() * share).sum();
        assert!((-ours.im - 0.207).abs() < 0.01, "{ours}");
    }
}
