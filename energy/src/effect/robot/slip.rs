//! Wheel slip: the wheels turn faster than the robot drives, the more the harder they push.
//!
//! `s = k |F|`, `P += max(0, F v) s / (1 - s)`: the motors turn at `v / (1 - s)` against the same force. F is
//! the sum of the forces at the wheels in N, k in 1/N; s ends at 0.9.
//!
//! Absence: hard pulls (slopes, acceleration, payload) take more than their force times the speed.

use crate::drive::traction;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

/// Greatest slip: beyond it the wheels spin and the model says nothing.
const SLIP_MAX: f64 = 0.9;

pub(crate) struct Slip;

static SPEC: EffectSpec = EffectSpec {
    id: "slip",
    title: "Wheel slip",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps],
    equation: "P += max(0, F v) s / (1 - s), s = k |F|, F the sum of all forces",
    source: "Wong, Theory of Ground Vehicles: slip s = 1 - v / (r w), linear in force while small",
    validity: "adhesion not exceeded; speed over ground, not of the wheels",
    signature: "a residual with speed and the square of force",
    matters: 0.02,
    confused_with: &[
        ("motor_copper", "two speeds on one slope"),
        ("gear_loss", "two slopes"),
        ("h_bridge", "a full and a nearly empty pack"),
        ("viscous_friction", "the same speeds with and without payload"),
    ],
    parameters: &[ParameterSpec {
        name: "slip_per_n",
        meaning: "slip over force",
        default: 0.02,
        null: Some(0.0),
        min: 0.0,
        max: 1.0,
        source: "rubber on a hard floor: 1-5 % at a tenth of the weight",
    }],
    states: &[],
};

impl Physics for Slip {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let (force_n, speed_mps) = (channels[Channel::TractionN], channels[Channel::SpeedMps]);
        let wanted = own.parameters[0] * force_n.abs();
        let slip = if wanted.re() < SLIP_MAX { wanted } else { S::from(SLIP_MAX) };
        channels.add(Channel::PowerW, traction::drawn_w(force_n, speed_mps) * slip / (-slip + 1.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&Slip, parameters, inputs)
    }

    #[test]
    fn wheels_that_turn_a_quarter_faster_take_a_quarter_more() {
        // s = 0.2: the wheels turn 1 / 0.8 = 1.25 times as fast (definition in Wong).
        let inputs = [(Channel::SpeedMps, 0.5), (Channel::TractionN, 4.0)];
        assert!((power_w(&[0.05], &inputs) - 0.25 * 4.0 * 0.5).abs() < 1e-12);
        assert_eq!(power_w(&[0.0], &inputs), 0.0);
    }

    #[test]
    fn slip_ends_before_the_wheels_spin_for_ever() {
        let taken_w = power_w(&[1.0], &[(Channel::SpeedMps, 1.0), (Channel::TractionN, 1e3)]);
        assert!((taken_w - 1e3 * 9.0).abs() < 1e-6);
    }
}
