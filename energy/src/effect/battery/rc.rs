//! First polarisation pair: a voltage that follows the current with a time constant.
//!
//! `dV1/dt = (R1 I_cell - V1) / tau1`, stepped exactly for a current held over the step:
//! `V1' = V1 a + R1 I (1 - a)`, `a = exp(-dt / tau1)` (Kottas, section C.1.1, Randles circuit
//! without its Warburg element). R1 in ohm per cell, tau1 in s.
//!
//! Absence: after every current step the residual relaxes exponentially.

use super::relaxation_arrhenius::{left, slowness};
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

/// A polarisation pair: `resistance_ohm` and `tau_s` are its parameters, its voltage its state.
pub(crate) struct Pair(pub(crate) &'static EffectSpec);

/// The pair of the faster time constant.
pub(crate) static FIRST: Pair = Pair(&SPEC);

static SPEC: EffectSpec = EffectSpec {
    id: "rc1",
    title: "First polarisation (RC) pair",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "dV1/dt = (R1 I - V1) / tau1",
    source: "Kottas, section C.1.1",
    validity: "time steps of any length; linear in the current",
    signature: "the residual relaxes exponentially after each current step",
    matters: 1e-3,
    confused_with: &[
        ("ohmic", "current steps logged faster than tau1"),
        ("rc2", "a rest that lasts several times the longer time constant"),
    ],
    parameters: &[
        ParameterSpec {
            name: "resistance_ohm",
            meaning: "polarisation resistance of one cell",
            default: 0.01,
            null: Some(0.0),
            min: 0.0,
            max: 1.0,
            source: "of the order of R0 in published first-order fits",
        },
        ParameterSpec {
            name: "tau_s",
            meaning: "time constant",
            default: 50.0,
            null: None,
            min: 1.0,
            max: 5000.0,
            source: "10-70 s on measured pouch and cylindrical cells",
        },
    ],
    states: &["polarisation_v"],
};

/// Advances pairs side by side and adds their states up: `prepared` holds decay over the step and
/// gain of each pair in turn, a state settles at its gain times `drive`.
#[inline]
pub(crate) fn step_pairs<S: Real>(states: &mut [S], prepared: &[S], drive: S) -> S {
    step_pairs_by(states, prepared, drive, |_, decay| decay)
}

/// The same where relaxations take that many times longer than what was prepared; `exponents` are those of the decays.
#[inline]
pub(crate) fn step_slowed_pairs<S: Real>(states: &mut [S], (prepared, exponents): (&[S], &[S]), drive: S, slowness: Option<S>) -> S {
    let Some(slowness) = slowness else { return step_pairs(states, prepared, drive) };
    step_pairs_by(states, prepared, drive, |pair, _| left(exponents[pair], slowness))
}

#[inline(always)]
fn step_pairs_by<S: Real>(states: &mut [S], prepared: &[S], drive: S, decay: impl Fn(usize, S) -> S) -> S {
    let mut sum = S::from(0.0);
    for (pair, (state, numbers)) in states.iter_mut().zip(prepared.chunks_exact(2)).enumerate() {
        let settled = numbers[1] * drive;
        *state = settled + (*state - settled) * decay(pair, numbers[0]);
        sum += *state;
    }
    sum
}

impl Physics for Pair {
    fn spec(&self) -> &'static EffectSpec {
        self.0
    }

    /// The decay over a step, and its exponent.
    fn prepared_len(&self) -> usize {
        2
    }

    fn prepare<S: Real>(&self, _: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        prepared[1] = parameters[1].recip() * -dt_s;
        prepared[0] = prepared[1].exp();
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let target_v = own.parameters[0] * channels[Channel::CellCurrentA];
        let decay = slowness(channels).map_or(own.prepared[0], |slowness| left(own.prepared[1], slowness));
        own.states[0] = target_v + (own.states[0] - target_v) * decay;
        channels.add(Channel::OverpotentialV, own.states[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn one_long_step_equals_many_short_ones_and_reaches_63_percent_at_tau() {
        let run = |steps: u32| {
            let (mut states, mut channels) = ([0.0_f64], Channels::filled(0.0_f64));
            for _ in 0..steps {
                channels[Channel::CellCurrentA] = 1.0;
                step_once(&FIRST, &Facts::robot(), 50.0 / f64::from(steps), &[0.02, 50.0], &mut states, &mut channels);
            }
            states[0]
        };
        assert!((run(1) - run(1000)).abs() < 1e-12);
        assert!((run(1) - 0.02 * (1.0 - (-1f64).exp())).abs() < 1e-12);
    }

    /// Any text on circuits: a capacitor C that discharges through R from `R I` passes the charge
    /// `C R I = tau I`, so the area under its relaxation is `R I tau`. Here 0.02 ohm x 2 A x 50 s.
    #[test]
    fn the_area_under_the_relaxation_is_the_charge_of_its_capacitor() {
        let (mut states, mut channels) = ([0.0_f64], Channels::filled(0.0_f64));
        channels[Channel::CellCurrentA] = 2.0;
        step_once(&FIRST, &Facts::robot(), 1e4, &[0.02, 50.0], &mut states, &mut channels);
        let mut area_vs = 0.0;
        channels[Channel::CellCurrentA] = 0.0;
        for _ in 0..100_000 {
            let before_v = states[0];
            step_once(&FIRST, &Facts::robot(), 0.01, &[0.02, 50.0], &mut states, &mut channels);
            area_vs += 0.01 * (before_v + states[0]) / 2.0;
        }
        assert!((area_vs - 0.02 * 2.0 * 50.0).abs() < 1e-6, "{area_vs}");
    }
}
