//! Second polarisation pair: the slow part of relaxation, minutes to an hour.
//!
//! `dV2/dt = (R2 I_cell - V2) / tau2`, the physics of the first pair ([`super::rc`]) with a time
//! constant of its own. R2 in ohm per cell, tau2 in s. It stands for diffusion in one term
//! (Kottas, section C.1.1, circuits of a few lumped elements).
//!
//! Absence: the residual still relaxes when the first pair has long settled.

use super::rc::Pair;
use crate::{Channel, EffectSpec, ParameterSpec, Phase, System};

/// The pair of the slower time constant.
pub(crate) static SECOND: Pair = Pair(&SPEC);

static SPEC: EffectSpec = EffectSpec {
    id: "rc2",
    title: "Second polarisation (RC) pair",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "dV2/dt = (R2 I - V2) / tau2",
    source: "Kottas, section C.1.1",
    validity: "time steps of any length; linear in the current; one time constant for what is a range of them",
    signature: "the residual relaxes over many minutes after a current step, slower than the first pair",
    matters: 1e-3,
    confused_with: &[
        ("rc1", "pulses and rests of seconds as well as of an hour"),
        ("warburg", "a rest of over one hour, logged from its first second"),
        ("hysteresis", "a rest of several hours after a charge and after a discharge"),
    ],
    parameters: &[
        ParameterSpec {
            name: "resistance_ohm",
            meaning: "slow polarisation resistance of one cell",
            default: 0.01,
            null: Some(0.0),
            min: 0.0,
            max: 1.0,
            source: "of the order of R0 in second-order fits of pouch and cylindrical cells",
        },
        ParameterSpec {
            name: "tau_s",
            meaning: "time constant",
            default: 500.0,
            null: None,
            min: 50.0,
            max: 20_000.0,
            source: "250-1900 s in second-order fits of HPPC records of LiPo and LMO pouch cells",
        },
    ],
    states: &["slow_polarisation_v"],
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;
    use crate::{Channels, Facts};

    #[test]
    fn after_a_long_charge_it_holds_r_times_i_and_forgets_half_of_it_in_ln_2_tau() {
        let (mut states, mut channels) = ([0.0_f64], Channels::filled(0.0_f64));
        channels[Channel::CellCurrentA] = -2.0;
        step_once(&SECOND, &Facts::robot(), 1e4, &[0.02, 500.0], &mut states, &mut channels);
        assert!((states[0] + 0.04).abs() < 1e-9, "{states:?}");
        channels[Channel::CellCurrentA] = 0.0;
        step_once(&SECOND, &Facts::robot(), 500.0 * 2f64.ln(), &[0.02, 500.0], &mut states, &mut channels);
        assert!((states[0] + 0.02).abs() < 1e-9, "{states:?}");
    }

    /// Kottas, section 3.2: the relaxation time constant is the time in which the voltage at rest
    /// goes 63 % of the way to its end.
    #[test]
    fn a_rest_as_long_as_the_time_constant_goes_63_percent_of_the_way() {
        let (mut states, mut channels) = ([0.04_f64], Channels::filled(0.0_f64));
        step_once(&SECOND, &Facts::robot(), 500.0, &[0.02, 500.0], &mut states, &mut channels);
        assert!((1.0 - states[0] / 0.04 - 0.63).abs() < 3e-3, "{states:?}");
    }
}
