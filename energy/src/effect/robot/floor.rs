//! Kind of floor: extra resistance on floors other than the reference floor.
//!
//! `F = F_class` for the classes 1, 2 and 3 of the channel `floor_class`, `P = F v` in sum with the
//! other forces, never below zero; class 0 is the
//! floor for which the other numbers were stated, and takes nothing extra. N at the ground, but beside `motion`, whose efficiency is for its own forces
//! alone, N as the motors have to give it: that over the efficiency. A floor
//! that is easier than the reference has a negative force. Other classes count as the reference.
//!
//! Absence: the residual of driving differs from floor to floor.

use crate::drive::traction;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Floor;

static SPEC: EffectSpec = EffectSpec {
    id: "floor",
    title: "Kind of floor",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps, Channel::FloorClass],
    equation: "F = F_class, P += what F adds to max(0, v sum of all F)",
    source: "measured motor currents of one robot on three floors differ by a factor of three",
    validity: "a class is one kind of floor; edges and thresholds are not in it",
    signature: "a residual of driving that goes with the floor",
    matters: 0.02,
    confused_with: &[
        ("rolling", "two floors in one log"),
        ("slope", "level floors: measure with a spirit level"),
        ("slip", "two speeds: slip grows with force"),
    ],
    parameters: &[
        ParameterSpec {
            name: "extra_1_n",
            meaning: "force more than on the reference floor, on floor 1",
            default: 0.2,
            null: Some(0.0),
            min: -50.0,
            max: 500.0,
            source: "guess: short carpet, a palm-sized robot",
        },
        ParameterSpec {
            name: "extra_2_n",
            meaning: "force more than on the reference floor, on floor 2",
            default: 0.4,
            null: Some(0.0),
            min: -50.0,
            max: 500.0,
            source: "guess: long carpet, a palm-sized robot",
        },
        ParameterSpec {
            name: "extra_3_n",
            meaning: "force more than on the reference floor, on floor 3",
            default: 0.3,
            null: Some(0.0),
            min: -50.0,
            max: 500.0,
            source: "guess: rough concrete, a palm-sized robot",
        },
    ],
    states: &[],
};

impl Physics for Floor {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let class = channels[Channel::FloorClass].re().round();
        for (index, &extra_n) in own.parameters.iter().enumerate() {
            if class == (index + 1) as f64 {
                traction::resist(channels, extra_n);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&Floor, parameters, inputs)
    }

    #[test]
    fn each_class_has_its_force_and_the_reference_none() {
        for (class, power) in [(0.0, 0.0), (1.0, 0.5), (2.0, 1.0), (3.0, 1.5), (4.0, 0.0)] {
            let taken_w = power_w(&[1.0, 2.0, 3.0], &[(Channel::SpeedMps, 0.5), (Channel::FloorClass, class)]);
            assert_eq!(taken_w, power, "class {class}");
        }
        assert_eq!(power_w(&[1.0, 2.0, 3.0], &[(Channel::FloorClass, 2.0)]), 0.0);
    }

    #[test]
    fn carpet_and_tiles_by_their_coefficients() {
        // Published coefficients of a hard caster wheel: 0.01 on smooth concrete, 0.03 on carpet
        // (0.02 more), 3 kg: 0.59 N, 0.18 W at 0.3 m/s.
        let extra_n = 0.02 * 3.0 * 9.806_65;
        let taken_w = power_w(&[extra_n, 0.0, 0.0], &[(Channel::SpeedMps, 0.3), (Channel::FloorClass, 1.0)]);
        assert!((taken_w - 0.18).abs() < 0.005, "{taken_w}");
    }
}
