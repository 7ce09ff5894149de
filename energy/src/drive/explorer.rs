//! Dimensions and motor of the Explorer robot, for the functions of this folder.
//!
//! Kottas prints hardly a number of its mechanics. What he does print: 14 x 6 x 4.5 cm (B.2.1),
//! coreless motors with precious-metal brushes and magnetic encoders (4.2, A.1), 0.52 m/s at most
//! and less than 5 % of the battery's current in the motors (5.2), most holding torque near 7.5
//! degrees of tail (5.1.1). The rest are guesses that meet these; each says so, with its range.
//! The parameter set `explorer-robot` states what follows from them.

use super::bridge::HBridge;
use super::caster::{Caster, Servo};
use super::kinematics::DifferentialDrive;
use super::motor::{Gear, Gearmotor, Motor};

/// Number of drive motors.
pub const MOTORS: f64 = 2.0;

/// Mean voltage of the 3s pack, V: 3 x 3.7 V.
pub const PACK_V: f64 = 11.1;

/// Greatest speed, m/s (Kottas, section 5.2: a limit in the firmware).
pub const SPEED_MAX_MPS: f64 = 0.52;

/// One drive motor with its gear.
///
/// Motor: FAULHABER 1331 T 012 SR, data sheet; the right kind and size, but a guess of the type
/// (+-50 % on every constant). Gear: 41:1, which makes the top speed at the mean pack voltage
/// that of the firmware's limit, guess 30-60; efficiency 0.7, guess 0.6-0.8 for three stages.
pub const MOTOR: Gearmotor = Gearmotor {
    motor: Motor {
        back_emf_v_s_per_rad: 11.43e-3,
        torque_nm_per_a: 11.4e-3,
        resistance_ohm: 13.7,
        inductance_h: 310e-6,
        inertia_kg_m2: 0.67e-7,
        viscous_nm_s_per_rad: 0.0,
        friction_nm: 0.12e-3,
    },
    gear: Gear { ratio: 41.0, efficiency: 0.7 },
};

/// Its driver: a small integrated H-bridge, guess 0.5 ohm per switch (0.2-1); 24.57 kHz is the
/// frequency of Kottas, Fig. A.2, that is no round number.
pub const BRIDGE: HBridge = HBridge { on_ohm: 0.5, pwm_hz: 24.57e3 };

/// Wheels as high as the robot (4.5 cm, guess +-20 %), as far apart as it is wide; wheel inertia
/// of a 10 g disc, guess.
pub const WHEELS: DifferentialDrive =
    DifferentialDrive { base_m: 0.06, wheel_radius_m: 0.0225, wheel_inertia_kg_m2: 2.5e-6, rotor_inertia_kg_m2: 0.67e-7, gear_ratio: 41.0 };

/// Its tail. The lengths add up to the robot's 14 cm; 0.5 kg in all, the body's centre of gravity
/// 1.5 cm behind the axle and a little above the line to the pivot. With them the torque is
/// greatest at 7.5 degrees and the weight on the wheels least near it, as in Kottas, Fig. 5.3;
/// these angles follow from the lengths and hardly depend on the masses. Guesses, +-20 % each
/// length, +-30 % each mass.
pub const CASTER: Caster = Caster {
    wheel_radius_m: 0.0225,
    ball_radius_m: 0.005,
    pivot_m: 0.04,
    tail_m: 0.072,
    body_cog_rad: 0.113,
    body_cog_m: 0.015,
    tail_cog_m: 0.045,
    body_kg: 0.46,
    tail_kg: 0.04,
};

/// The tail's servo: hobby size, 0.15 N m and 0.7 A when blocked at 4.8 V. Guess of the class,
/// +-40 % each.
pub const SERVO: Servo = Servo { output_nm_per_a: 0.15 / 0.7, resistance_ohm: 4.8 / 0.7 };

/// Rolling resistance over weight: rubber on a hard floor, guess 0.01-0.04.
pub const ROLLING: f64 = 0.02;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::GRAVITY_MPS2;

    fn mass_kg() -> f64 {
        CASTER.body_kg + CASTER.tail_kg
    }

    /// Torque at one wheel that rolls on a level floor, N m.
    fn wheel_nm() -> f64 {
        ROLLING * mass_kg() * GRAVITY_MPS2 * WHEELS.wheel_radius_m / MOTORS
    }

    #[test]
    fn the_motors_reach_the_explorers_top_speed_on_its_pack() {
        // Kottas, section 5.2: approximately 520 mm/s.
        let speed_mps = MOTOR.speed_at(PACK_V, wheel_nm()) * WHEELS.wheel_radius_m;
        assert!((speed_mps / SPEED_MAX_MPS - 1.0).abs() < 0.02, "{speed_mps}");
        // And not when the pack is nearly empty: 9 V.
        assert!(MOTOR.speed_at(9.0, wheel_nm()) * WHEELS.wheel_radius_m < SPEED_MAX_MPS);
    }

    #[test]
    fn a_metre_takes_more_of_the_motors_when_slow() {
        // Kottas, Fig. 5.7 and A.1: losses weigh more at small velocities; here the copper's.
        let per_metre_j = |speed_mps: f64| MOTORS * MOTOR.at(wheel_nm(), speed_mps / WHEELS.wheel_radius_m).electrical_w / speed_mps;
        assert!(per_metre_j(0.01) > 1.5 * per_metre_j(0.1) && per_metre_j(0.1) > per_metre_j(0.5));
    }
}
