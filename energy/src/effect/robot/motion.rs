//! Motion: rolling, slope and acceleration, through the drive train.
//!
//! `F = m g (c_rr cos(pitch) sign(v) + sin(pitch)) + m a`, `P = F v / eta` in sum with the forces of other effects,
//! never below zero: braking returns nothing to the battery. m in kg (own mass plus payload), v in m/s, pitch in rad.
//! Nothing rolls at a standstill.
//!
//! It lumps `rolling`, `slope`, `acceleration`, `payload` and `gear_loss`, each of which is an effect
//! of its own (`acceleration` beside it is that of the rotors, which has no weight and does not pass the gear), and gives its force to those that follow the force (`motor_copper`, `slip`).
//!
//! Absence: the power residual grows with speed and with uphill pitch.

use crate::drive::traction;
use crate::units::GRAVITY_MPS2;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Motion;

static SPEC: EffectSpec = EffectSpec {
    id: "motion",
    title: "Rolling, slope and acceleration",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps],
    equation: "F = m g (c_rr cos(pitch) sign(v) + sin(pitch)) + m a, P += what F adds to max(0, v sum of all F) / eta",
    source: "Kottas, chapter 5; Newton's second law",
    validity: "no wheel slip; drive efficiency constant; no regeneration",
    signature: "the power residual grows with speed and uphill pitch",
    matters: 0.02,
    confused_with: &[("idle", "one log at rest and one while driving")],
    parameters: &[
        ParameterSpec {
            name: "rolling_coefficient",
            meaning: "rolling resistance over weight",
            default: 0.02,
            null: Some(0.0),
            min: 0.0,
            max: 0.5,
            source: "rubber tyres on hard floor: 0.01-0.04",
        },
        ParameterSpec {
            name: "mass_kg",
            meaning: "mass of the robot without payload",
            default: 0.5,
            null: Some(0.0),
            min: 0.0,
            max: 500.0,
            source: "guess: palm-sized robot",
        },
        ParameterSpec {
            name: "drive_efficiency",
            meaning: "mechanical power at the wheel over electrical power",
            default: 0.4,
            null: None,
            min: 0.05,
            max: 1.0,
            source: "small geared brushed motors: 0.3-0.6",
        },
    ],
    states: &[],
};

impl Physics for Motion {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn lumps(&self) -> &'static [&'static str] {
        &["rolling", "slope", "acceleration", "payload", "gear_loss"]
    }

    /// What turns before the gear has inertia, but no weight.
    fn may_need(&self) -> &'static [&'static str] {
        &["acceleration"]
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let own_kg = own.parameters[1];
        // A robot of no mass carries nothing: that is how the effect vanishes.
        let mass_kg = if own_kg.re() == 0.0 { own_kg } else { own_kg + channels[Channel::PayloadKg] };
        let pitch_rad = channels[Channel::PitchRad];
        let weight_n = mass_kg * GRAVITY_MPS2;
        let rolling_n = traction::along(channels, weight_n * own.parameters[0] * pitch_rad.cos());
        let force_n = rolling_n + weight_n * pitch_rad.sin() + mass_kg * channels[Channel::AccelMps2];
        let drawn_w = traction::pushed_w(channels, force_n);
        channels.add(Channel::PowerW, drawn_w / own.parameters[2]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    /// Standard gravity, 9.80665 m/s² (3rd CGPM, 1901).
    #[test]
    fn a_kilogram_up_a_slope_takes_m_g_sin_v() {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::SpeedMps] = 0.5;
        channels[Channel::PitchRad] = 0.1;
        step_once(&Motion, &Facts::robot(), 1.0, &[0.0, 1.0, 1.0], &mut [], &mut channels);
        assert!((channels[Channel::PowerW] - 9.806_65 * 0.1_f64.sin() * 0.5).abs() < 1e-12);
    }

    /// Newton: what rolls downhill by its own weight has that much less to overcome.
    #[test]
    fn its_weight_downhill_pays_for_what_others_resist_with() {
        let mut channels = Channels::filled(0.0_f64);
        (channels[Channel::SpeedMps], channels[Channel::PitchRad]) = (0.5, -0.1);
        traction::push(&mut channels, 2.0);
        step_once(&Motion, &Facts::robot(), 1.0, &[0.0, 1.0, 1.0], &mut [], &mut channels);
        assert!((channels[Channel::PowerW] - (2.0 - 9.806_65 * 0.1_f64.sin()) * 0.5).abs() < 1e-12);
    }

    /// By hand: 0.02 of 9.80665 N at 0.5 m/s through a drive of 0.5.
    #[test]
    fn rolling_resists_in_reverse_too_and_holds_nothing_at_rest() {
        for (speed_mps, force_n, power_w) in [(0.5, 0.196_133, 0.196_133), (-0.5, -0.196_133, 0.196_133), (0.0, 0.0, 0.0)] {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::SpeedMps] = speed_mps;
            step_once(&Motion, &Facts::robot(), 1.0, &[0.02, 1.0, 0.5], &mut [], &mut channels);
            let found = [channels[Channel::TractionN], channels[Channel::PowerW]];
            assert!((found[0] - force_n).abs() < 1e-12 && (found[1] - power_w).abs() < 1e-12, "{speed_mps}: {found:?}");
        }
    }

    #[test]
    fn rolling_downhill_returns_nothing() {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::SpeedMps] = 0.5;
        channels[Channel::PitchRad] = -0.3;
        step_once(&Motion, &Facts::robot(), 1.0, &[0.02, 1.0, 0.5], &mut [], &mut channels);
        assert_eq!(channels[Channel::PowerW], 0.0);
    }
}
