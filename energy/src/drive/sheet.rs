//! What data sheets of motors, gears and wheels say of a robot: the parameters of its effects, and what it can do.
//!
//! A robot's effects take what its drive costs as functions of the force at the wheels; a data sheet has resistances and
//! constants. Between them lie the equations of `motor.rs`, `bridge.rs` and `kinematics.rs`:
//!
//! ```text
//!   dry_friction      F = n tau_f N / r_w k_w / k_tau
//!   motor_copper      c = n R_a I² / F², where I is what the motor takes for F on a ramp
//!   acceleration      m = n (J_w + N² J_m) / r_w² k_w / k_tau
//!   h_bridge          c = 2 R_DS,on n I² / F² k_w N / r_w, on that ramp
//!   motion            mass, rolling resistance, and the gear's efficiency times k_tau / k_w
//! ```
//!
//! A motor takes `k_w omega I` for the power `k_tau omega I` of its shaft: where a sheet's two constants differ, what lies between
//! is lost in the motor.
//!
//! The current goes by the load over the gear's efficiency and by the motor's own friction without it, the effects by the sum of
//! both forces: they agree on a ramp of 1:12, the steepest that a wheelchair must take (ADA Standards, 405.2), and
//! nearly elsewhere.

use super::bridge::{HBridge, Supply};
use super::kinematics::DifferentialDrive;
use super::motor::{Gearmotor, Operating};
use super::transient::{Load, Turning};
use crate::units::GRAVITY_MPS2;

/// Pitch of a ramp of 1:12, rad.
pub const RAMP_RAD: f64 = 0.083_141_231_888_441_22;
/// Length of a start that is looked at, in time constants of the drive.
const START_TAUS: f64 = 8.0;
/// Points of a start.
const START_POINTS: u32 = 4000;

/// A robot on driven wheels, by its data sheets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveSheet {
    /// Driven wheels, each with a motor, >= 1.
    pub motors: f64,
    /// Motor and gear of each.
    pub gearmotor: Gearmotor,
    /// Its driver, if it is known.
    pub bridge: Option<HBridge>,
    /// The wheels.
    pub wheels: DifferentialDrive,
    /// Mass of the robot, kg, > 0.
    pub mass_kg: f64,
    /// Rolling resistance over weight, >= 0.
    pub rolling_coefficient: f64,
}

/// A parameter of an effect that follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follows {
    /// The effect.
    pub effect: &'static str,
    /// Its parameter.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
}

/// A start from rest on the whole voltage of the battery, level, with nothing that limits the current.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Started {
    /// Greatest current of all motors, A.
    pub peak_a: f64,
    /// Time for which it is more than half of that, s.
    pub half_s: f64,
    /// Time after which the robot has 63 % of its speed, s.
    pub rise_s: f64,
}

impl DriveSheet {
    /// Parameters of the robot's effects, in the order of a model file.
    #[must_use]
    pub fn parameters(&self) -> Vec<Follows> {
        let (motor, wheels) = (&self.gearmotor.motor, &self.wheels);
        let lever = self.gearmotor.gear.ratio / wheels.wheel_radius_m;
        let lost = motor.back_emf_v_s_per_rad / motor.torque_nm_per_a;
        let friction_n = self.motors * motor.friction_nm * lever * lost;
        let force_n = self.load_n(RAMP_RAD) + friction_n;
        let ramp = self.gearmotor.at(self.wheel_nm(RAMP_RAD), 1.0);
        let square = self.motors * (ramp.current_a / force_n).powi(2);
        let mut follows = vec![
            ("motion", "mass_kg", self.mass_kg),
            ("motion", "rolling_coefficient", self.rolling_coefficient),
            // No drive gives more than it takes, whatever its sheet says.
            ("motion", "drive_efficiency", (self.gearmotor.gear.efficiency / lost).min(1.0)),
            ("dry_friction", "force_n", friction_n),
            ("dry_friction", "step_w", 0.0),
            ("acceleration", "mass_kg", self.motors / 2.0 * wheels.equivalent_mass_kg(0.0) * lost),
            ("motor_copper", "copper_w_per_n2", motor.resistance_ohm * square),
        ];
        if motor.viscous_nm_s_per_rad > 0.0 {
            let viscous = self.motors * motor.viscous_nm_s_per_rad * lever * lever * lost;
            follows.push(("viscous_friction", "viscous_n_s_per_m", viscous));
        }
        if let Some(bridge) = self.bridge {
            follows.push(("h_bridge", "conduction_v_per_n", 2.0 * bridge.on_ohm * square * motor.back_emf_v_s_per_rad * lever));
            follows.push(("h_bridge", "switching_w", 0.0));
        }
        follows.into_iter().map(|(effect, name, value)| Follows { effect, name, value }).collect()
    }

    /// What every motor does at this speed and pitch.
    #[must_use]
    pub fn operating(&self, speed_mps: f64, pitch_rad: f64) -> Operating {
        self.gearmotor.at(self.wheel_nm(pitch_rad), speed_mps / self.wheels.wheel_radius_m)
    }

    /// Power that all motors take from a battery at this voltage, W, by their own equations; ripple included where the bridge is known.
    #[must_use]
    pub fn power_w(&self, speed_mps: f64, pitch_rad: f64, battery_v: f64) -> f64 {
        let at = self.operating(speed_mps, pitch_rad);
        self.motors * self.supply(&at, battery_v).map_or(at.electrical_w, |supply| supply.supply_a * battery_v)
    }

    /// What the bridge of one motor takes; none where it is not known.
    #[must_use]
    pub fn supply(&self, at: &Operating, battery_v: f64) -> Option<Supply> {
        let motor = &self.gearmotor.motor;
        self.bridge.map(|bridge| bridge.supply(at.voltage_v, at.current_a, battery_v, motor.inductance_h, motor.resistance_ohm))
    }

    /// Greatest speed on a level floor, m/s; 0 where it does not move.
    #[must_use]
    pub fn top_speed_mps(&self, battery_v: f64) -> f64 {
        self.behind_bridge().speed_at(battery_v, self.wheel_nm(0.0)) * self.wheels.wheel_radius_m
    }

    /// The steepest slope up which its motors push it, rad; pi/2 where they would lift it. Its wheels may slip before.
    #[must_use]
    pub fn steepest_rad(&self, battery_v: f64) -> f64 {
        let share = self.motors * self.behind_bridge().stall_nm(battery_v) / self.wheels.wheel_radius_m / (self.mass_kg * GRAVITY_MPS2);
        // sin(p) + c cos(p) = share
        let (c, whole) = (self.rolling_coefficient, 1.0_f64.hypot(self.rolling_coefficient));
        if share >= 1.0 { std::f64::consts::FRAC_PI_2 } else { ((share / whole).asin() - c.atan()).max(0.0) }
    }

    /// A start on the whole voltage of the battery.
    #[must_use]
    pub fn start(&self, battery_v: f64) -> Started {
        let wheels = &self.wheels;
        let radius_m = wheels.wheel_radius_m;
        // What one motor moves at its wheel: its share of the robot, and the wheel itself.
        let inertia_kg_m2 = self.mass_kg / self.motors * radius_m.powi(2) + wheels.wheel_inertia_kg_m2;
        let load = Load { torque_nm: 0.0, friction_nm: self.wheel_nm(0.0), inertia_kg_m2 };
        let driven = self.behind_bridge();
        let (motor, gear) = (&driven.motor, &driven.gear);
        let moved_kg_m2 = motor.inertia_kg_m2 + inertia_kg_m2 / (gear.ratio.powi(2) * gear.efficiency);
        let tau_s = motor.resistance_ohm * moved_kg_m2 / (motor.back_emf_v_s_per_rad * motor.torque_nm_per_a);
        let step_s = START_TAUS * (tau_s + motor.electrical_time_s()) / f64::from(START_POINTS);
        let top_radps = driven.speed_at(battery_v, self.wheel_nm(0.0)) * gear.ratio;
        let mut now = Turning::default();
        let points: Vec<Turning> = (0..START_POINTS)
            .map(|_| {
                now = driven.turn(now, step_s, battery_v, &load).end;
                now
            })
            .collect();
        let peak_a = points.iter().map(|point| point.current_a).fold(0.0, f64::max);
        let while_s = |holds: &dyn Fn(&Turning) -> bool| step_s * points.iter().filter(|point| holds(point)).count() as f64;
        Started {
            peak_a: self.motors * peak_a,
            half_s: while_s(&|point| point.current_a > peak_a / 2.0),
            rise_s: while_s(&|point| point.motor_radps < top_radps * (1.0 - (-1.0_f64).exp())),
        }
    }

    /// Whether the battery's voltage lets it go that fast up there.
    #[must_use]
    pub fn reaches(&self, speed_mps: f64, pitch_rad: f64, battery_v: f64) -> bool {
        self.behind_bridge().at(self.wheel_nm(pitch_rad), speed_mps / self.wheels.wheel_radius_m).voltage_v <= battery_v * (1.0 + 1e-9)
    }

    /// The motor with the two switches that conduct, as it stands on the whole voltage.
    fn behind_bridge(&self) -> Gearmotor {
        let mut driven = self.gearmotor;
        driven.motor.resistance_ohm += 2.0 * self.bridge.map_or(0.0, |bridge| bridge.on_ohm);
        driven
    }

    /// Force at the ground that rolling and slope ask for, N.
    fn load_n(&self, pitch_rad: f64) -> f64 {
        self.mass_kg * GRAVITY_MPS2 * (self.rolling_coefficient * pitch_rad.cos() + pitch_rad.sin())
    }

    /// The same as the torque of one wheel, N m.
    fn wheel_nm(&self, pitch_rad: f64) -> f64 {
        self.load_n(pitch_rad) * self.wheels.wheel_radius_m / self.motors
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::explorer::{BRIDGE, MOTOR, MOTORS, PACK_V, ROLLING, SPEED_MAX_MPS, WHEELS};

    fn explorer() -> DriveSheet {
        DriveSheet { motors: MOTORS, gearmotor: MOTOR, bridge: Some(BRIDGE), wheels: WHEELS, mass_kg: 0.5, rolling_coefficient: ROLLING }
    }

    #[test]
    fn a_ramp_of_one_in_twelve() {
        assert!((RAMP_RAD - (1.0_f64 / 12.0).atan()).abs() < 1e-15);
    }

    #[test]
    fn an_explorer_reaches_its_top_speed_and_climbs_until_it_stalls() {
        let explorer = explorer();
        // Kottas, section 5.2: approximately 520 mm/s.
        assert!((explorer.top_speed_mps(PACK_V) / SPEED_MAX_MPS - 1.0).abs() < 0.02);
        assert!(explorer.reaches(explorer.top_speed_mps(PACK_V), 0.0, PACK_V) && !explorer.reaches(0.55, 0.0, PACK_V));
        // By hand, with two switches of half an ohm: 11.4e-3 x 11.1 / 14.7 - 0.12e-3 = 8.49 mN m at the motor, 0.2436 N m at each wheel, 21.65 N of both: more
        // than its weight.
        assert_eq!(explorer.steepest_rad(PACK_V), std::f64::consts::FRAC_PI_2);
        // Ten times as heavy: 21.65 N of 49.03 N, so sin(p) + 0.02 cos(p) = 0.4416.
        let heavy = DriveSheet { mass_kg: 5.0, ..explorer };
        let p = heavy.steepest_rad(PACK_V);
        assert!((p.sin() + 0.02 * p.cos() - 0.4416).abs() < 0.001 && heavy.operating(0.0, p).voltage_v < PACK_V, "{p}");
    }

    #[test]
    fn a_start_takes_the_current_of_a_blocked_motor_at_first() {
        let explorer = DriveSheet { bridge: None, ..explorer() };
        let start = explorer.start(PACK_V);
        // A blocked motor takes 11.1 V / 13.7 ohm; its inductance lets it turn a little before that.
        let blocked_a = 2.0 * PACK_V / 13.7;
        assert!(start.peak_a < blocked_a && start.peak_a > 0.95 * blocked_a, "{start:?}");
        // By hand: (0.67e-7 + (0.25 x 0.0225² + 2.5e-6) / (41² x 0.7)) 13.7 / (11.43e-3 x 11.4e-3) = 18.5 ms to 63 %.
        assert!((start.rise_s / 18.5e-3 - 1.0).abs() < 0.06, "{start:?}");
        assert!((start.half_s / (18.5e-3 * 2.0_f64.ln()) - 1.0).abs() < 0.15, "{start:?}");
    }
}
