//! Permanent-magnet brushed motor with a gear, where nothing changes any more.
//!
//! Armature: `V_a = k_w w + R_a I` (Kottas, Eq. 4.5 with dI/dt = 0). Shaft:
//! `k_tau I = f_m w + tau_f sign(w) + tau_G / (N eta_G)` (Kottas, Eq. 4.6 with dw/dt = 0), where
//! `tau_G` is the torque at the wheel, N the gear's reduction and eta_G its efficiency. A wheel
//! that drives the motor loses in the gear the other way: `tau_G eta_G / N`.
//! Kottas adds the no-load current to I; here it is the dry friction `tau_f = k_tau I_0 - f_m w_0`,
//! which says the same at the no-load speed and stays right at every other.

use crate::real::Real;

/// Speed below which a shaft counts as standing, rad/s.
const STANDING_RADPS: f64 = 1e-9;

/// A brushed motor without its gear. Datasheets state most of these.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motor<S = f64> {
    /// Back-EMF constant k_w, V s/rad, > 0.
    pub back_emf_v_s_per_rad: S,
    /// Torque constant k_tau, N m/A, > 0. Equals the back-EMF constant in an ideal motor.
    pub torque_nm_per_a: S,
    /// Armature resistance R_a with brushes, ohm, > 0.
    pub resistance_ohm: S,
    /// Armature inductance L_a, H, > 0. Matters in time only.
    pub inductance_h: S,
    /// Rotor inertia J_m, kg m², > 0. Matters in time only.
    pub inertia_kg_m2: S,
    /// Viscous friction f_m, N m s/rad, >= 0.
    pub viscous_nm_s_per_rad: S,
    /// Dry friction tau_f of bearings and brushes, N m, >= 0.
    pub friction_nm: S,
}

/// A reduction between motor and wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gear<S = f64> {
    /// Turns of the motor per turn of the wheel, N > 0.
    pub ratio: S,
    /// Mechanical efficiency eta_G under load, in (0, 1].
    pub efficiency: S,
}

/// Motor and gear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gearmotor<S = f64> {
    /// The motor.
    pub motor: Motor<S>,
    /// Its gear.
    pub gear: Gear<S>,
}

/// A motor and its wheel at a constant load and speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Operating<S = f64> {
    /// Armature current, A.
    pub current_a: S,
    /// Armature voltage, V.
    pub voltage_v: S,
    /// Speed of the motor's shaft, rad/s.
    pub motor_radps: S,
    /// Torque that the current makes, `k_tau I`, N m.
    pub motor_nm: S,
    /// Electrical power into the armature, W. Negative when the wheel drives the motor hard enough.
    pub electrical_w: S,
    /// Mechanical power at the wheel, W.
    pub wheel_w: S,
    /// `wheel_w / electrical_w` (Kottas, Eq. 4.8); 0 unless both are positive.
    pub efficiency: S,
}

/// -1, 0 or 1: the direction in which something turns.
pub(crate) fn direction<S: Real>(speed: S) -> f64 {
    if speed.re() > STANDING_RADPS {
        1.0
    } else if speed.re() < -STANDING_RADPS {
        -1.0
    } else {
        0.0
    }
}

impl Motor<f64> {
    /// A motor from the five numbers that every datasheet has: nominal voltage (V), resistance
    /// (ohm), torque constant (N m/A), and speed (rad/s) and current (A) without load at the
    /// nominal voltage. All friction is taken as dry; inductance and inertia are left to add.
    #[must_use]
    pub fn from_datasheet(nominal_v: f64, resistance_ohm: f64, torque_nm_per_a: f64, no_load_radps: f64, no_load_a: f64) -> Self {
        Motor {
            back_emf_v_s_per_rad: (nominal_v - resistance_ohm * no_load_a) / no_load_radps,
            torque_nm_per_a,
            resistance_ohm,
            inductance_h: 1e-4,
            inertia_kg_m2: 1e-7,
            viscous_nm_s_per_rad: 0.0,
            friction_nm: torque_nm_per_a * no_load_a,
        }
    }
}

impl<S: Real> Motor<S> {
    /// L_a / R_a, s (Kottas, Table A.1).
    #[must_use]
    pub fn electrical_time_s(&self) -> S {
        self.inductance_h / self.resistance_ohm
    }
}

impl<S: Real> Gearmotor<S> {
    /// Torque that the gear asks of the motor for `wheel_nm` at the wheel, turning in `direction`
    /// (-1, 0, 1). At a standstill the gear passes the torque without loss.
    #[must_use]
    pub fn gear_input_nm(&self, wheel_nm: S, direction: f64) -> S {
        let power_flow = wheel_nm.re() * direction;
        if power_flow > 0.0 {
            wheel_nm / (self.gear.ratio * self.gear.efficiency)
        } else if power_flow < 0.0 {
            wheel_nm * self.gear.efficiency / self.gear.ratio
        } else {
            wheel_nm / self.gear.ratio
        }
    }

    /// What the motor takes to turn its wheel at `wheel_radps` against `wheel_nm`.
    ///
    /// At exactly zero speed dry friction has no direction and is left out: the least current
    /// that holds the wheel is `(tau_G / N - tau_f) / k_tau`, the greatest that does not yet
    /// move it `(tau_G / N + tau_f) / k_tau`; this gives the middle.
    #[must_use]
    pub fn at(&self, wheel_nm: S, wheel_radps: S) -> Operating<S> {
        let motor = &self.motor;
        let motor_radps = wheel_radps * self.gear.ratio;
        let direction = direction(wheel_radps);
        let motor_nm = self.gear_input_nm(wheel_nm, direction) + motor.viscous_nm_s_per_rad * motor_radps + motor.friction_nm * direction;
        let current_a = motor_nm / motor.torque_nm_per_a;
        let voltage_v = motor.back_emf_v_s_per_rad * motor_radps + motor.resistance_ohm * current_a;
        let (electrical_w, wheel_w) = (voltage_v * current_a, wheel_nm * wheel_radps);
        let efficiency = if electrical_w.re() > 0.0 && wheel_w.re() > 0.0 { wheel_w / electrical_w } else { S::from(0.0) };
        Operating { current_a, voltage_v, motor_radps, motor_nm, electrical_w, wheel_w, efficiency }
    }

    /// Speed that the wheel reaches at `voltage_v` (>= 0) against `wheel_nm` (>= 0), rad/s, and
    /// 0 when the motor stalls.
    #[must_use]
    pub fn speed_at(&self, voltage_v: S, wheel_nm: S) -> S {
        let motor = &self.motor;
        let stiffness = motor.back_emf_v_s_per_rad * motor.torque_nm_per_a / motor.resistance_ohm;
        let stall_nm = motor.torque_nm_per_a * voltage_v / motor.resistance_ohm;
        let spare_nm = stall_nm - motor.friction_nm - self.gear_input_nm(wheel_nm, 1.0);
        if spare_nm.re() > 0.0 { spare_nm / (stiffness + motor.viscous_nm_s_per_rad) / self.gear.ratio } else { S::from(0.0) }
    }

    /// Greatest torque at the wheel at `voltage_v` (>= 0), just before it stalls, N m.
    #[must_use]
    pub fn stall_nm(&self, voltage_v: S) -> S {
        let motor = &self.motor;
        let stall_nm = motor.torque_nm_per_a * voltage_v / motor.resistance_ohm - motor.friction_nm;
        stall_nm * self.gear.ratio * self.gear.efficiency
    }

    /// Copper loss of the current that `wheel_nm` at the wheel takes, `R_a (tau_G / (N eta_G k_tau))²`,
    /// W. Without the motor's own friction.
    #[must_use]
    pub fn copper_w(&self, wheel_nm: S) -> S {
        let current_a = self.gear_input_nm(wheel_nm, 1.0) / self.motor.torque_nm_per_a;
        self.motor.resistance_ohm * current_a * current_a
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADPS_PER_RPM: f64 = std::f64::consts::PI / 30.0;

    /// FAULHABER 1331 T 012 SR, data sheet: 12 V, 13.7 ohm, 9900 rpm and 10.5 mA without load,
    /// 11.4 mN m/A, 310 uH, 0.67 g cm².
    fn faulhaber_1331() -> Motor {
        let mut motor = Motor::from_datasheet(12.0, 13.7, 11.4e-3, 9900.0 * RADPS_PER_RPM, 10.5e-3);
        (motor.inductance_h, motor.inertia_kg_m2) = (310e-6, 0.67e-7);
        motor
    }

    fn direct(motor: Motor) -> Gearmotor {
        Gearmotor { motor, gear: Gear { ratio: 1.0, efficiency: 1.0 } }
    }

    #[test]
    fn a_motor_meets_the_numbers_of_its_datasheet_that_were_not_put_in() {
        let motor = faulhaber_1331();
        let drive = direct(motor);
        // Same data sheet: back-EMF constant 1.20 mV/rpm.
        assert!((motor.back_emf_v_s_per_rad * RADPS_PER_RPM / 1.20e-3 - 1.0).abs() < 0.01);
        // Stall torque 9.90 mN m.
        assert!((drive.stall_nm(12.0) / 9.90e-3 - 1.0).abs() < 0.02, "{}", drive.stall_nm(12.0));
        // Friction torque 0.12 mN m.
        assert!((motor.friction_nm / 0.12e-3 - 1.0).abs() < 0.01);
        // Slope of the n-M curve 1000 rpm per mN m: R_a / (k_w k_tau).
        let slope_radps_per_nm = motor.resistance_ohm / (motor.back_emf_v_s_per_rad * motor.torque_nm_per_a);
        assert!((slope_radps_per_nm / RADPS_PER_RPM * 1e-3 / 1000.0 - 1.0).abs() < 0.02);
        // Mechanical time constant 7 ms: that slope times J_m.
        assert!((slope_radps_per_nm * motor.inertia_kg_m2 / 7e-3 - 1.0).abs() < 0.02);
        // Greatest efficiency 80 %, greatest output 2.57 W.
        let points: Vec<_> = (1..1000)
            .map(|i| {
                let load_nm = 9.9e-3 * f64::from(i) / 1000.0;
                drive.at(load_nm, drive.speed_at(12.0, load_nm))
            })
            .collect();
        let greatest = |of: fn(&Operating) -> f64| points.iter().map(of).fold(0.0, f64::max);
        assert!((greatest(|p| p.efficiency) - 0.80).abs() < 0.03, "{}", greatest(|p| p.efficiency));
        assert!((greatest(|p| p.wheel_w) / 2.57 - 1.0).abs() < 0.03, "{}", greatest(|p| p.wheel_w));
    }

    #[test]
    fn without_load_the_motor_takes_its_no_load_current() {
        let drive = direct(faulhaber_1331());
        let at = drive.at(0.0, drive.speed_at(12.0, 0.0));
        assert!((at.current_a - 10.5e-3).abs() < 1e-12);
        assert!((at.motor_radps - 9900.0 * RADPS_PER_RPM).abs() < 1e-6);
        assert!((at.voltage_v - 12.0).abs() < 1e-9);
    }

    #[test]
    fn speed_from_voltage_and_voltage_from_speed_are_one_line() {
        let mut motor = faulhaber_1331();
        motor.viscous_nm_s_per_rad = 2e-8;
        let drive = Gearmotor { motor, gear: Gear { ratio: 41.0, efficiency: 0.7 } };
        let wheel_radps = drive.speed_at(9.0, 0.03);
        assert!((drive.at(0.03, wheel_radps).voltage_v - 9.0).abs() < 1e-9);
        // Power is conserved: input = copper + friction + gear loss + wheel.
        let at = drive.at(0.03, wheel_radps);
        let copper_w = 13.7 * at.current_a.powi(2);
        let friction_w = (motor.friction_nm + motor.viscous_nm_s_per_rad * at.motor_radps) * at.motor_radps;
        // The part of k_w w I that k_tau w I is not: the data sheet's constants differ by 0.6 %.
        let constants_w = (motor.back_emf_v_s_per_rad - motor.torque_nm_per_a) * at.motor_radps * at.current_a;
        let gear_w = at.wheel_w * (1.0 / 0.7 - 1.0);
        assert!((at.electrical_w - copper_w - friction_w - constants_w - gear_w - at.wheel_w).abs() < 1e-12);
    }

    #[test]
    fn a_stalled_motor_stands_and_a_driven_one_takes_less() {
        let drive = Gearmotor { motor: faulhaber_1331(), gear: Gear { ratio: 41.0, efficiency: 0.7 } };
        assert_eq!(drive.speed_at(12.0, drive.stall_nm(12.0) * 1.001), 0.0);
        // By hand: 10 mN m that pull the wheel along leave 10e-3 * 0.7 / 41 at the motor.
        let pulled = drive.at(-10e-3, 10.0);
        let by_hand_a = (11.4e-3 * 10.5e-3 - 10e-3 * 0.7 / 41.0) / 11.4e-3;
        assert!((pulled.current_a - by_hand_a).abs() < 1e-12);
        assert!(pulled.current_a < drive.at(0.0, 10.0).current_a);
    }
}
