//! Regeneration: braking and rolling downhill charge the battery.
//!
//! `P += rho F v` where the sum F of all forces at the wheels brakes (F v < 0), in W; rho is the share
//! of that mechanical power that reaches the battery. The other effects of motion return nothing.
//!
//! Absence: the model takes too much when the robot brakes or rolls downhill.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Regeneration;

static SPEC: EffectSpec = EffectSpec {
    id: "regeneration",
    title: "Energy recovered when braking",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps],
    equation: "P += rho min(0, F v), F the sum of all forces",
    source: "energy balance of driving, of which Kottas, Eq. 5.2a, has the forward half",
    validity: "motors that brake into the battery (synchronous H-bridge), not into a resistor",
    signature: "a negative residual when braking and downhill",
    matters: 0.02,
    confused_with: &[("acceleration", "braking apart from speeding up"), ("slope", "downhill apart from uphill")],
    parameters: &[ParameterSpec {
        name: "share",
        meaning: "share of braking power that reaches the battery",
        default: 0.3,
        null: Some(0.0),
        min: 0.0,
        max: 1.0,
        source: "drive efficiency back and forth: 0-0.5 for small geared motors, up to 0.7 for vehicles",
    }],
    states: &[],
};

impl Physics for Regeneration {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let power_w = channels[Channel::TractionN] * channels[Channel::SpeedMps];
        if power_w.re() < 0.0 {
            channels.add(Channel::PowerW, own.parameters[0] * power_w);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::explorer::MOTOR;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&Regeneration, parameters, inputs)
    }

    #[test]
    fn braking_returns_its_share_and_driving_nothing() {
        let inputs = |force_n| [(Channel::SpeedMps, 0.5), (Channel::TractionN, force_n)];
        assert!((power_w(&[0.4], &inputs(-2.0)) + 0.4).abs() < 1e-15);
        assert_eq!(power_w(&[0.4], &inputs(2.0)), 0.0);
        assert_eq!(power_w(&[0.0], &inputs(-2.0)), 0.0);
    }

    #[test]
    fn a_wheel_that_drives_the_motor_returns_less_than_it_gives() {
        // Independent: the motor's own steady state, pulled along with 0.1 N m at 25 rad/s.
        let pulled = MOTOR.at(-0.1, 25.0);
        assert!(pulled.electrical_w < 0.0);
        let share = pulled.electrical_w / pulled.wheel_w;
        assert!((0.0..0.7).contains(&share), "{share}");
        let returned_w = power_w(&[share], &[(Channel::SpeedMps, 1.0), (Channel::TractionN, pulled.wheel_w)]);
        assert!((returned_w - pulled.electrical_w).abs() < 1e-12);
    }
}
