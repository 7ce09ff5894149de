//! The actuated caster tail of a two-wheeled robot: where it puts the centre of gravity, and what
//! the servo must hold.
//!
//! Body and tail are a four-bar crank slider (Kottas, Fig. 5.1): up `l_1` from the height of the
//! tail's ball to the axle, along `l_2` to the tail's pivot, along `l_3` to the ball, and back
//! along the ground by `l_4`. Kottas counts the tail's angle theta_3 counter-clockwise from the
//! horizontal, so that a tail that reaches down lies between 3 pi/2 and 2 pi; his Eq. 5.10 turns
//! that into `2 pi - theta_3`. Here the tail's angle is that: how far it points below the
//! horizontal, positive down.
//!
//! ```text
//!   sin(theta_2) = (l_3 sin(tail) - l_1) / l_2                                    Eq. 5.3
//!   l_4 = l_2 cos(theta_2) + l_3 cos(tail)                                        Eq. 5.4
//!   C_ct = (l_2 cos(theta_2) + l_ct,c cos(tail), l_2 sin(theta_2) - l_ct,c sin(tail))
//!   C_bd = l_bd,c (cos(phi + theta_2), sin(phi + theta_2))                        Eq. 5.6
//!   F_ct = m g C_x / l_4,   F_w = m g (l_4 - C_x) / l_4
//!   tau = l_3 F_ct cos(tail) - m_ct g l_ct,c cos(tail)
//! ```
//!
//! Three equations are printed wrong: 5.5 puts link 2 at theta_3 instead of theta_2; 5.8 lacks the
//! division by l_4; 5.9 has `1 - l_4 - C_x` where the moments give `C_x`. Eq. 5.10 leaves out the
//! tail's own weight, which hangs on the same pivot and helps the servo; it is in here, and
//! vanishes for a light tail. Origin at the axle, x towards the tail, z up. On a slope the weight
//! turns by the pitch and pulls at the height of the centre of gravity above the ground.
//! Holds standing or at steady speed, with the ball sliding without friction.

use crate::real::Real;
use crate::units::GRAVITY_MPS2;

/// Dimensions and masses of body and tail.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Caster<S = f64> {
    /// Wheel radius r_w, m.
    pub wheel_radius_m: S,
    /// Radius of the tail's ball r_ctb, m. `l_1 = r_w - r_ctb`.
    pub ball_radius_m: S,
    /// From the axle to the tail's pivot l_2, m.
    pub pivot_m: S,
    /// From the pivot to the ball's centre l_3, m.
    pub tail_m: S,
    /// Angle phi from the line axle-pivot to the line axle-body's centre of gravity, rad, up positive.
    pub body_cog_rad: S,
    /// From the axle to the body's centre of gravity l_bd,c, m.
    pub body_cog_m: S,
    /// From the pivot to the tail's centre of gravity l_ct,c, m.
    pub tail_cog_m: S,
    /// Mass of the body m_bd, kg.
    pub body_kg: S,
    /// Mass of the tail m_ct, kg.
    pub tail_kg: S,
}

/// How a robot stands at one angle of its tail.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stance<S = f64> {
    /// Angle of the body's link 2 theta_2 from the horizontal, rad.
    pub body_rad: S,
    /// Distance of the ball from the wheels' contact along the ground l_4, m.
    pub base_m: S,
    /// Centre of gravity behind the axle C_x, m.
    pub cog_x_m: S,
    /// Centre of gravity above the axle C_z, m.
    pub cog_z_m: S,
    /// Weight on both wheels F_2w, N.
    pub wheels_n: S,
    /// Weight on the ball F_ct, N; negative where the robot would tip over its wheels.
    pub ball_n: S,
    /// Torque that the servo holds about the pivot, N m; 0 where the ball carries nothing.
    pub hold_nm: S,
}

/// A servo seen from its output shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Servo<S = f64> {
    /// Torque constant at the output, `k_tau N eta`, N m/A.
    pub output_nm_per_a: S,
    /// Resistance of winding and driver, ohm.
    pub resistance_ohm: S,
}

impl<S: Real> Servo<S> {
    /// Electrical power to hold a torque without turning: `I² R`, `I = tau / (k_tau N eta)`, W.
    /// The gear's efficiency counts as when lifting; a gear that helps to hold takes less.
    #[must_use]
    pub fn hold_w(&self, torque_nm: S) -> S {
        let current_a = torque_nm / self.output_nm_per_a;
        current_a * current_a * self.resistance_ohm
    }
}

/// Holding torque over its greatest, `cos(k (tail - worst))`: the shape of [`Caster::stance`] on
/// level ground with the geometry put into the angle of greatest torque and how fast the torque
/// falls beside it (k; about 1 for a tail as long as the pivot's arm, more for a longer one).
/// Within 2.5 % of the greatest torque for the Explorer's tail from 5 degrees up to 40 degrees
/// down; zero beyond a right angle.
pub fn relative_hold<S: Real>(tail_rad: S, worst_rad: S, narrowness: S) -> S {
    let off = (tail_rad - worst_rad) * narrowness;
    if off.re().abs() < std::f64::consts::FRAC_PI_2 { off.cos() } else { S::from(0.0) }
}

impl<S: Real> Caster<S> {
    /// How the robot stands on ground that rises by `pitch_rad` towards its front. None where the
    /// links do not reach: `|l_3 sin(tail) - l_1| > l_2`, or the tail folds under the axle.
    #[must_use]
    pub fn stance(&self, tail_rad: S, pitch_rad: S) -> Option<Stance<S>> {
        let sine = (self.tail_m * tail_rad.sin() - self.wheel_radius_m + self.ball_radius_m) / self.pivot_m;
        if sine.re().abs() >= 1.0 {
            return None;
        }
        let body_rad = sine.asin();
        let pivot = (self.pivot_m * body_rad.cos(), self.pivot_m * sine);
        let base_m = pivot.0 + self.tail_m * tail_rad.cos();
        if base_m.re() <= 0.0 {
            return None;
        }
        let tail = (pivot.0 + self.tail_cog_m * tail_rad.cos(), pivot.1 - self.tail_cog_m * tail_rad.sin());
        let body_angle = body_rad + self.body_cog_rad;
        let body = (self.body_cog_m * body_angle.cos(), self.body_cog_m * body_angle.sin());
        let mass_kg = self.body_kg + self.tail_kg;
        let cog_x_m = (tail.0 * self.tail_kg + body.0 * self.body_kg) / mass_kg;
        let cog_z_m = (tail.1 * self.tail_kg + body.1 * self.body_kg) / mass_kg;
        let weight_n = mass_kg * GRAVITY_MPS2;
        let lever_m = cog_x_m * pitch_rad.cos() + (cog_z_m + self.wheel_radius_m) * pitch_rad.sin();
        let ball_n = weight_n * lever_m / base_m;
        let wheels_n = weight_n * pitch_rad.cos() - ball_n;
        let hold_nm = if ball_n.re() > 0.0 {
            // The part of the tail's weight across the tail, which hangs down behind a robot that climbs.
            let own_nm = self.tail_kg * GRAVITY_MPS2 * self.tail_cog_m * (tail_rad + pitch_rad).cos();
            self.tail_m * ball_n * tail_rad.cos() - own_nm
        } else {
            S::from(0.0)
        };
        Some(Stance { body_rad, base_m, cog_x_m, cog_z_m, wheels_n, ball_n, hold_nm })
    }

    /// Yaw inertia about the middle of the axle for a yaw inertia about the centre of gravity
    /// (parallel axes by C_x; Kottas, Eq. 5.11), kg m².
    #[must_use]
    pub fn yaw_inertia_kg_m2(&self, inertia_cog_kg_m2: S, stance: &Stance<S>) -> S {
        super::kinematics::parallel_axis(inertia_cog_kg_m2, self.body_kg + self.tail_kg, stance.cog_x_m)
    }
}

impl Caster<f64> {
    /// The angle between `low_rad` and `high_rad` at which the servo holds most on level ground,
    /// and that torque, N m. None where the links reach at no angle between.
    #[must_use]
    pub fn worst(&self, low_rad: f64, high_rad: f64) -> Option<(f64, f64)> {
        let hold = |tail_rad: f64| self.stance(tail_rad, 0.0).map(|stance| stance.hold_nm);
        let steps = 2000;
        (0..=steps)
            .map(|step| low_rad + (high_rad - low_rad) * f64::from(step) / f64::from(steps))
            .filter_map(|tail_rad| hold(tail_rad).map(|hold_nm| (tail_rad, hold_nm)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::explorer::{CASTER as EXPLORER, MOTOR, MOTORS, SERVO as EXPLORER_SERVO};

    fn degrees(angle: f64) -> f64 {
        angle.to_radians()
    }

    #[test]
    fn the_explorers_tail_holds_most_near_seven_and_a_half_degrees() {
        // Kottas, section 5.1.1: the greatest holding torque occurs around 7.5 degrees.
        let (worst_rad, _) = EXPLORER.worst(degrees(-10.0), degrees(40.0)).unwrap();
        assert!((worst_rad.to_degrees() - 7.5).abs() < 0.25, "{}", worst_rad.to_degrees());
        // The same section: where the torque is greatest, the weight on the wheels is least.
        let wheels = |angle: &i32| EXPLORER.stance(degrees(f64::from(*angle)), 0.0).unwrap().wheels_n;
        let least = (-10..=40).min_by(|a, b| wheels(a).total_cmp(&wheels(b))).unwrap();
        assert!((f64::from(least) - 7.5).abs() < 7.5, "{least}");
        // The robot is 14 cm long (B.2.1): wheel radius, links, ball.
        let level = EXPLORER.stance(0.0, 0.0).unwrap();
        assert!((0.0225 + level.base_m + 0.005 - 0.14).abs() < 0.01, "{}", level.base_m);
    }

    #[test]
    fn forces_and_moments_balance_at_every_angle_and_pitch() {
        for tail in [-10.0, 0.0, 7.5, 20.0, 40.0] {
            for pitch in [-0.1, 0.0, 0.2_f64] {
                let stance = EXPLORER.stance(degrees(tail), pitch).unwrap();
                let weight_n = 0.5 * GRAVITY_MPS2;
                // Across the ground, and about the ball's foot.
                assert!((stance.wheels_n + stance.ball_n - weight_n * pitch.cos()).abs() < 1e-12);
                let about_ball = stance.wheels_n * stance.base_m - weight_n * pitch.cos() * (stance.base_m - stance.cog_x_m)
                    + weight_n * pitch.sin() * (stance.cog_z_m + 0.0225);
                assert!(about_ball.abs() < 1e-12, "{tail} {pitch}: {about_ball}");
                // The tail about its pivot, in the axes of level ground: r x F of the ball's push, across the slope, and of the tail's weight, straight down.
                let turned = |x: f64, z: f64| (x * pitch.cos() + z * pitch.sin(), z * pitch.cos() - x * pitch.sin());
                let across = |arm: (f64, f64), force: (f64, f64)| arm.0 * force.1 - arm.1 * force.0;
                let arm = |length_m: f64| turned(length_m * degrees(tail).cos(), -length_m * degrees(tail).sin());
                let (ball, cog) = (arm(EXPLORER.tail_m), arm(EXPLORER.tail_cog_m));
                let held = across(ball, turned(0.0, stance.ball_n)) + across(cog, (0.0, -EXPLORER.tail_kg * GRAVITY_MPS2));
                assert!((held - stance.hold_nm).abs() < 1e-12 || stance.ball_n < 0.0, "{tail} {pitch}: {held} {}", stance.hold_nm);
                // The loop closes: the ball's centre lies l_1 below the axle.
                let ball_z = 0.04 * stance.body_rad.sin() - 0.072 * degrees(tail).sin();
                assert!((ball_z + 0.0175).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_level_tail_of_no_weight_by_hand() {
        // l_1 = 0: all level. Body 1 kg at 0.1 of 0.4 m: a quarter of its weight on the ball.
        let flat = Caster {
            wheel_radius_m: 0.02,
            ball_radius_m: 0.02,
            pivot_m: 0.3,
            tail_m: 0.1,
            body_cog_rad: 0.0,
            body_cog_m: 0.1,
            tail_cog_m: 0.05,
            body_kg: 1.0,
            tail_kg: 0.0,
        };
        let stance = flat.stance(0.0, 0.0).unwrap();
        assert!((stance.ball_n - GRAVITY_MPS2 / 4.0).abs() < 1e-12);
        // Kottas, Eq. 5.10: l_3 F_ct.
        assert!((stance.hold_nm - 0.1 * GRAVITY_MPS2 / 4.0).abs() < 1e-12);
        assert!(flat.stance(degrees(89.9), 0.0).is_some() && Caster { pivot_m: 0.05, ..flat }.stance(1.0, 0.0).is_none());
    }

    #[test]
    fn the_short_form_of_the_torque_follows_the_whole_geometry() {
        let (worst_rad, worst_nm) = EXPLORER.worst(degrees(-10.0), degrees(40.0)).unwrap();
        for tail in (-5..=40).map(f64::from) {
            let exact = EXPLORER.stance(degrees(tail), 0.0).unwrap().hold_nm / worst_nm;
            let short = relative_hold(degrees(tail), worst_rad, 1.6);
            assert!((exact - short).abs() < 0.025, "{tail}: {exact} {short}");
        }
    }

    #[test]
    fn the_servo_burns_more_than_the_motors_of_the_wheels() {
        // Kottas, section 4.2.2: the servo may overshadow the motors that drive the wheels.
        let motors_w = MOTORS * MOTOR.at(1.1e-3, 0.3 / 0.0225).electrical_w;
        let (_, worst_nm) = EXPLORER.worst(degrees(-10.0), degrees(40.0)).unwrap();
        let hold_w = EXPLORER_SERVO.hold_w(worst_nm);
        // By hand: 0.0472 N m / 0.2143 N m/A = 0.22 A; 0.22² x 6.86 ohm = 0.33 W.
        assert!((hold_w - 0.333).abs() < 0.005, "{hold_w}");
        assert!(hold_w > motors_w);
    }
}
