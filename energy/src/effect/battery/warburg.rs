//! Diffusion as a Warburg element: a voltage that grows with the square root of time.
//!
//! `Z(s) = Z0 / sqrt(s)`, so `Z0 / (j 2 pi f)^(1/2)` at a frequency f (Kottas, Eq. C.2 with
//! n = 1/2); Z0 in ohm/sqrt(s) per cell. After a step of current I the voltage is
//! `2 Z0 I sqrt(t / pi)`.
//!
//! As a ladder of RC pairs, from the integral `s^(-1/2) = (1/pi) int x^(-1/2) / (s + x) dx` over
//! x from 0 to infinity. With `x = exp(u)` the integrand is smooth on a logarithmic axis and the
//! trapezoidal rule converges as `exp(-pi^2 / h)` with the spacing h of its nodes, so a factor of
//! eight between neighbours is enough. Every node is a pair with rate x and weight
//! `h sqrt(x) / pi`. The endless geometric rows of nodes beyond either end are drawn together
//! into one pair each, with the row's first two moments: below, `sum w` and `sum w x` (to a much
//! faster current they are integrators); above, `sum w / x` and `sum w / x^2` (to a slower one,
//! resistances).
//!
//! Absence: after a current step the residual grows as the square root of time, over every
//! decade alike, where an RC pair would settle.

use std::sync::LazyLock;

use super::rc::step_pairs;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Warburg;

/// Pairs of the ladder: four nodes and the two ends. Five pairs stay just outside 2 % over the
/// three decades from 1 mHz to 1 Hz, however they are placed.
const PAIRS: usize = 6;

/// Rate of the slowest node, 1/s, and spacing of the nodes' logarithms: the impedance then stays
/// within 2 % from 0.15 mHz, where an hour-long rest is seen, to 1 Hz.
const SLOWEST_PER_S: f64 = 3.4e-3;
const SPACING: f64 = 2.08;

static SPEC: EffectSpec = EffectSpec {
    id: "warburg",
    title: "Warburg diffusion",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "V(s) = Z0 / sqrt(s) I(s)",
    source: "Kottas, Eq. C.2 with n = 1/2; ladder from the integral representation of s^(-1/2)",
    validity: "0.15 mHz to 1 Hz within 2 %; slower than about an hour the ladder settles, as a finite particle does",
    signature: "the residual grows and relaxes as the square root of the time since a current step",
    matters: 1e-3,
    confused_with: &[
        ("rc2", "a rest of over one hour, logged from its first second"),
        ("rc1", "a rest of over one hour, logged from its first second"),
    ],
    parameters: &[ParameterSpec {
        name: "z0_ohm_per_sqrt_s",
        meaning: "impedance of one cell at one radian per second",
        default: 5e-4,
        null: Some(0.0),
        min: 0.0,
        max: 0.05,
        source: "guess: some mOhm in the first minute of a 2 Ah cell, since 2 sqrt(60 s / pi) = 8.7 sqrt(s)",
    }],
    states: &[
        "diffusion_0_a_sqrt_s",
        "diffusion_1_a_sqrt_s",
        "diffusion_2_a_sqrt_s",
        "diffusion_3_a_sqrt_s",
        "diffusion_4_a_sqrt_s",
        "diffusion_5_a_sqrt_s",
    ],
};

/// Rate in 1/s and weight of every pair: `s^(-1/2)` is about the sum of `weight / (s + rate)`.
static LADDER: LazyLock<[(f64, f64); PAIRS]> = LazyLock::new(ladder);

fn ladder() -> [(f64, f64); PAIRS] {
    let node = |index: usize| SLOWEST_PER_S * (SPACING * index as f64).exp();
    let weight = |rate_per_s: f64| SPACING * rate_per_s.sqrt() / std::f64::consts::PI;
    // Sums of the rows of powers 1/q, 1/q^2 ... and 1/q^3, 1/q^6 ... : from a node, the square
    // roots of its neighbours' rates go by q, the cubes of these by q^3.
    let q = (SPACING / 2.0).exp();
    let (row, cubed_row) = (1.0 / (q - 1.0), 1.0 / (q.powi(3) - 1.0));
    let (first, last) = (node(0), node(PAIRS - 3));
    let slow = (first * cubed_row / row, weight(first) * row);
    let fast_rate = last * row / cubed_row;
    let fast = (fast_rate, weight(last) / last * row * fast_rate);
    std::array::from_fn(|pair| match pair {
        0 => slow,
        pair if pair == PAIRS - 1 => fast,
        pair => (node(pair - 1), weight(node(pair - 1))),
    })
}

impl Physics for Warburg {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn prepared_len(&self) -> usize {
        2 * PAIRS
    }

    fn prepare<S: Real>(&self, _: &Facts, dt_s: f64, _: &[S], prepared: &mut [S]) {
        for (pair, &(rate_per_s, weight)) in prepared.chunks_exact_mut(2).zip(LADDER.iter()) {
            pair[0] = S::from((-rate_per_s * dt_s).exp());
            pair[1] = S::from(weight / rate_per_s);
        }
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let sum = step_pairs(own.states, own.prepared, channels[Channel::CellCurrentA]);
        channels.add(Channel::OverpotentialV, own.parameters[0] * sum);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;
    use crate::effect::step_once;

    #[test]
    fn the_ladder_has_the_impedance_of_diffusion_within_two_per_cent_from_0_15_mhz_to_1_hz() {
        for step in 0..=600 {
            let frequency_hz = 1.5e-4 * (1.0 / 1.5e-4_f64).powf(f64::from(step) / 600.0);
            let s = Complex::new(0.0, 2.0 * std::f64::consts::PI * frequency_hz);
            let ours: Complex<f64> = LADDER.iter().map(|&(rate, weight)| weight / (s + rate)).sum();
            let ratio = ours * s.sqrt();
            assert!((ratio.norm() - 1.0).abs() < 0.02, "magnitude at {frequency_hz} Hz: {}", ratio.norm());
            assert!(ratio.arg().abs() < 0.02, "phase at {frequency_hz} Hz: {} rad", ratio.arg());
            assert!((ratio - 1.0).norm() < 0.02, "both at {frequency_hz} Hz: {ratio}");
        }
    }

    /// Step response of Z0 / sqrt(s): 2 Z0 I sqrt(t / pi).
    #[test]
    fn after_a_current_step_the_voltage_grows_with_the_square_root_of_time() {
        let (mut states, mut channels) = ([0.0; PAIRS], Channels::filled(0.0_f64));
        channels[Channel::CellCurrentA] = 2.0;
        for second in 1..=1800 {
            channels[Channel::OverpotentialV] = 0.0;
            step_once(&Warburg, &Facts::robot(), 1.0, &[1e-3], &mut states, &mut channels);
            let exact_v = 2.0 * 1e-3 * 2.0 * (f64::from(second) / std::f64::consts::PI).sqrt();
            let ratio = channels[Channel::OverpotentialV] / exact_v;
            assert!((ratio - 1.0).abs() < 0.03, "{second} s: {ratio}");
        }
    }

    #[test]
    fn one_long_step_equals_many_short_ones() {
        let run = |steps: u32| {
            let (mut states, mut channels) = ([0.0; PAIRS], Channels::filled(0.0_f64));
            channels[Channel::CellCurrentA] = -1.0;
            for _ in 0..steps {
                channels[Channel::OverpotentialV] = 0.0;
                step_once(&Warburg, &Facts::robot(), 300.0 / f64::from(steps), &[1e-3], &mut states, &mut channels);
            }
            channels[Channel::OverpotentialV]
        };
        assert!((run(1) - run(300)).abs() < 1e-12);
    }
}
