//! Differential drive: two wheels on one axle, and the energy that is in their motion.
//!
//! `u = (u_R + u_L) / 2`, `psi' = (u_R - u_L) / L_base`. Kottas, Eq. 5.12, divides u by the wheel
//! radius once more; u_R and u_L are already speeds over ground. No slip, flat contact.

use crate::real::Real;

/// Two driven wheels and their motors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DifferentialDrive<S = f64> {
    /// Distance between the wheels' contact points L_base, m, > 0.
    pub base_m: S,
    /// Wheel radius r_w, m, > 0.
    pub wheel_radius_m: S,
    /// Inertia of one wheel with what turns with it J_w, kg m².
    pub wheel_inertia_kg_m2: S,
    /// Inertia of one motor's rotor J_m, kg m²; it turns `gear_ratio` times as fast as the wheel.
    pub rotor_inertia_kg_m2: S,
    /// Reduction of the gear, N.
    pub gear_ratio: S,
}

/// Inertia about an axis at `offset_m` from the one through the centre of gravity:
/// `J_cog + m d²` (parallel axes; Kottas, Eq. 5.11), kg m².
#[must_use]
pub fn parallel_axis<S: Real>(inertia_cog_kg_m2: S, mass_kg: S, offset_m: S) -> S {
    inertia_cog_kg_m2 + mass_kg * offset_m * offset_m
}

impl<S: Real> DifferentialDrive<S> {
    /// Speed (m/s) and yaw rate (rad/s, left turn positive) for the speeds over ground of the left
    /// and the right wheel, m/s.
    #[must_use]
    pub fn body(&self, left_mps: S, right_mps: S) -> (S, S) {
        ((right_mps + left_mps) / 2.0, (right_mps - left_mps) / self.base_m)
    }

    /// Speeds over ground of the left and the right wheel, m/s: the inverse of [`Self::body`].
    #[must_use]
    pub fn wheels(&self, speed_mps: S, yaw_rate_radps: S) -> (S, S) {
        let half = yaw_rate_radps * self.base_m / 2.0;
        (speed_mps - half, speed_mps + half)
    }

    /// Inertia of one wheel with its rotor seen through the gear, `J_w + N² J_m`, kg m².
    #[must_use]
    pub fn turning_inertia_kg_m2(&self) -> S {
        self.wheel_inertia_kg_m2 + self.gear_ratio * self.gear_ratio * self.rotor_inertia_kg_m2
    }

    /// Mass that an acceleration along the path must move: the robot and what turns with its
    /// wheels, `m + 2 (J_w + N² J_m) / r_w²`, kg.
    #[must_use]
    pub fn equivalent_mass_kg(&self, mass_kg: S) -> S {
        mass_kg + self.turning_inertia_kg_m2() * 2.0 / (self.wheel_radius_m * self.wheel_radius_m)
    }

    /// Kinetic energy, J: `(m u² + J_os psi'² + J (u_R/r_w)² + J (u_L/r_w)²) / 2` with
    /// `J = J_w + N² J_m` (Kottas, Eq. 5.14, whose wheels carry no rotors). `yaw_inertia_kg_m2` is
    /// taken about the middle of the axle: see [`parallel_axis`].
    #[must_use]
    pub fn kinetic_j(&self, mass_kg: S, yaw_inertia_kg_m2: S, speed_mps: S, yaw_rate_radps: S) -> S {
        let (left_mps, right_mps) = self.wheels(speed_mps, yaw_rate_radps);
        let radius_square = self.wheel_radius_m * self.wheel_radius_m;
        let wheels = self.turning_inertia_kg_m2() * (left_mps * left_mps + right_mps * right_mps) / radius_square;
        (mass_kg * speed_mps * speed_mps + yaw_inertia_kg_m2 * yaw_rate_radps * yaw_rate_radps + wheels) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: DifferentialDrive = DifferentialDrive {
        base_m: 0.06,
        wheel_radius_m: 0.0225,
        wheel_inertia_kg_m2: 2e-6,
        rotor_inertia_kg_m2: 0.67e-7,
        gear_ratio: 41.0,
    };

    #[test]
    fn equal_wheels_drive_straight_and_opposite_ones_turn_on_the_spot() {
        assert_eq!(DRIVE.body(0.3, 0.3), (0.3, 0.0));
        let (speed_mps, yaw_rate_radps) = DRIVE.body(-0.15, 0.15);
        assert!(speed_mps == 0.0 && (yaw_rate_radps - 5.0).abs() < 1e-12);
        let (left_mps, right_mps) = DRIVE.wheels(0.2, 1.5);
        let (speed_mps, yaw_rate_radps) = DRIVE.body(left_mps, right_mps);
        assert!((speed_mps - 0.2).abs() < 1e-15 && (yaw_rate_radps - 1.5).abs() < 1e-12);
    }

    #[test]
    fn a_rod_about_its_end_is_a_rod_about_its_middle_shifted() {
        // Textbook: m l²/12 about the middle, m l²/3 about the end.
        assert!((parallel_axis(2.0_f64 * 0.09 / 12.0, 2.0, 0.15) - 2.0 * 0.09 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn kinetic_energy_is_that_of_the_equivalent_mass_and_turns_add_to_it() {
        let straight_j = DRIVE.kinetic_j(0.5, 5e-4, 0.5, 0.0);
        assert!((straight_j - DRIVE.equivalent_mass_kg(0.5) * 0.125).abs() < 1e-15);
        // By hand: 2 (2e-6 + 41² x 0.67e-7) / 0.0225² = 0.453 kg: the rotors nearly double the mass.
        assert!((DRIVE.equivalent_mass_kg(0.5) - 0.9528).abs() < 1e-3, "{}", DRIVE.equivalent_mass_kg(0.5));
        // On the spot: J psi'²/2 and two wheels at psi' L/2.
        let by_hand_j = 5e-4 * 4.0 / 2.0 + DRIVE.turning_inertia_kg_m2() * (2.0 * 0.03 / 0.0225_f64).powi(2);
        assert!((DRIVE.kinetic_j(0.5, 5e-4, 0.0, 2.0) - by_hand_j).abs() < 1e-15);
    }
}
