//! The brushed motor in time: armature current and shaft speed under a held voltage and load.
//!
//! ```text
//!   L_a dI/dt = V_a - R_a I - k_w w                                   (Kottas, Eq. 4.5)
//!   J   dw/dt = k_tau I - f_m w - tau_f sign(w) - tau_load / (N eta_G)
//! ```
//!
//! Kottas, Eq. 4.7, prints the torque term with a minus sign; a driving torque must accelerate.
//! `J = J_m + J_L / (N² eta_G)` gathers rotor and load (from Eq. 4.6). Between two changes of
//! the friction's sign the system is linear, so each piece is one matrix exponential in closed
//! form and exact for any step; where the shaft stops and breaks away is found on that solution.
//! Holds while voltage, load and temperature stay as they are over the step.

use super::motor::{Gearmotor, direction};

/// Pieces between sign changes of the friction that one step may have. A motor on a held voltage
/// stops and breaks away a few times at most; what is left after the last is spent standing.
const PIECES_MAX: usize = 32;
/// Points at which a piece is searched for a stop.
const SEARCH_POINTS: u32 = 64;
/// Halvings of an interval that holds a stop: beyond the precision of f64.
const HALVINGS: u32 = 60;

/// What turns with time in a motor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Turning {
    /// Armature current, A.
    pub current_a: f64,
    /// Speed of the motor's shaft, rad/s.
    pub motor_radps: f64,
}

/// What hangs at the wheel's side of the gear.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Load {
    /// Torque that pulls against forward turning, standing or not (a slope), N m.
    pub torque_nm: f64,
    /// Dry friction, against any turning, N m, >= 0.
    pub friction_nm: f64,
    /// Inertia of wheel and of the robot's mass seen by it, kg m², >= 0.
    pub inertia_kg_m2: f64,
}

/// What a step did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turned {
    /// Current and speed at its end.
    pub end: Turning,
    /// Charge through the armature, A s. Times the held voltage: the electrical energy, J.
    pub charge_c: f64,
    /// Angle of the motor's shaft, rad.
    pub angle_rad: f64,
}

/// A linear piece: `dx/dt = A (x - rest)`, x = (I, w).
struct Piece {
    a: [[f64; 2]; 2],
    rest: [f64; 2],
}

impl Piece {
    /// `exp(A t) (x - rest)`.
    fn deviation(&self, from: Turning, time_s: f64) -> [f64; 2] {
        let a = &self.a;
        let (half_trace, determinant) = ((a[0][0] + a[1][1]) / 2.0, a[0][0] * a[1][1] - a[0][1] * a[1][0]);
        let d = [from.current_a - self.rest[0], from.motor_radps - self.rest[1]];
        // (A - half_trace) d
        let turned = [(a[0][0] - half_trace) * d[0] + a[0][1] * d[1], a[1][0] * d[0] + (a[1][1] - half_trace) * d[1]];
        let discriminant = half_trace.powi(2) - determinant;
        // exp(A t) = even I + odd (A - half_trace I), by the eigenvalues half_trace +- root.
        let (even, odd) = if discriminant > 1e-12 * half_trace.powi(2) {
            let root = discriminant.sqrt();
            let fast = half_trace - root;
            let (fast_e, slow_e) = ((fast * time_s).exp(), (determinant / fast * time_s).exp());
            (f64::midpoint(slow_e, fast_e), (slow_e - fast_e) / (2.0 * root))
        } else if discriminant < -1e-12 * half_trace.powi(2) {
            let (turn, decay) = ((-discriminant).sqrt(), (half_trace * time_s).exp());
            (decay * (turn * time_s).cos(), decay * (turn * time_s).sin() / turn)
        } else {
            let decay = (half_trace * time_s).exp();
            (decay, decay * time_s)
        };
        [even * d[0] + odd * turned[0], even * d[1] + odd * turned[1]]
    }

    fn at(&self, from: Turning, time_s: f64) -> Turning {
        let d = self.deviation(from, time_s);
        Turning { current_a: self.rest[0] + d[0], motor_radps: self.rest[1] + d[1] }
    }

    /// Integrals of current and speed over the piece: `rest t + A^-1 (d(t) - d(0))`.
    fn integral(&self, from: Turning, time_s: f64) -> [f64; 2] {
        let a = &self.a;
        let after = self.deviation(from, time_s);
        let change = [after[0] - (from.current_a - self.rest[0]), after[1] - (from.motor_radps - self.rest[1])];
        let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
        [
            self.rest[0] * time_s + (a[1][1] * change[0] - a[0][1] * change[1]) / determinant,
            self.rest[1] * time_s + (a[0][0] * change[1] - a[1][0] * change[0]) / determinant,
        ]
    }

    /// First time in (0, `time_s`] at which the shaft, turning in `direction`, stops.
    fn stop_s(&self, from: Turning, direction: f64, time_s: f64) -> Option<f64> {
        // Beyond ten times the slowest time constant nothing moves any more.
        let slowest = -(self.a[0][0] + self.a[1][1]) / (self.a[0][0] * self.a[1][1] - self.a[0][1] * self.a[1][0]);
        let searched_s = time_s.min(10.0 * slowest);
        let turns = |at_s: f64| self.at(from, at_s).motor_radps * direction > 0.0;
        let mut last_s = 0.0;
        for point in 1..=SEARCH_POINTS {
            let at_s = searched_s * f64::from(point) / f64::from(SEARCH_POINTS);
            if !turns(at_s) {
                let (mut low_s, mut high_s) = (last_s, at_s);
                for _ in 0..HALVINGS {
                    let middle_s = f64::midpoint(low_s, high_s);
                    if turns(middle_s) { low_s = middle_s } else { high_s = middle_s }
                }
                return Some(high_s);
            }
            last_s = at_s;
        }
        (!turns(time_s)).then_some(time_s)
    }
}

impl Gearmotor<f64> {
    /// Advances current and speed over `dt_s` (> 0) at a held armature voltage and load.
    #[must_use]
    pub fn turn(&self, from: Turning, dt_s: f64, voltage_v: f64, load: &Load) -> Turned {
        let motor = &self.motor;
        let friction_nm = motor.friction_nm + load.friction_nm / (self.gear.ratio * self.gear.efficiency);
        // What opposes forward and backward turning, friction included.
        let against_nm = |direction: f64| self.gear_input_nm(load.torque_nm, direction) + friction_nm * direction;
        let (mut now, mut left_s, mut charge_c, mut angle_rad) = (from, dt_s, 0.0, 0.0);
        let mut turning = direction(now.motor_radps);
        for _ in 0..PIECES_MAX {
            if turning == 0.0 {
                now.motor_radps = 0.0;
                let stood_s =
                    self.stands_s(now.current_a, voltage_v, [against_nm(-1.0), against_nm(1.0)]).map_or(left_s, |s| s.min(left_s));
                let (end_a, stood_c) = self.blocked(now.current_a, voltage_v, stood_s);
                (now.current_a, charge_c, left_s) = (end_a, charge_c + stood_c, left_s - stood_s);
                if left_s <= 0.0 {
                    return Turned { end: now, charge_c, angle_rad };
                }
                turning = if motor.torque_nm_per_a * now.current_a > against_nm(0.0) { 1.0 } else { -1.0 };
            }
            let piece = self.piece(voltage_v, against_nm(turning), load.inertia_kg_m2);
            let stop_s = piece.stop_s(now, turning, left_s);
            let piece_s = stop_s.unwrap_or(left_s);
            let [c, r] = piece.integral(now, piece_s);
            (charge_c, angle_rad) = (charge_c + c, angle_rad + r);
            now = piece.at(now, piece_s);
            left_s -= piece_s;
            match stop_s {
                Some(_) => (now.motor_radps, turning) = (0.0, 0.0),
                None => return Turned { end: now, charge_c, angle_rad },
            }
        }
        let (end_a, stood_c) = self.blocked(now.current_a, voltage_v, left_s.max(0.0));
        Turned { end: Turning { current_a: end_a, motor_radps: 0.0 }, charge_c: charge_c + stood_c, angle_rad }
    }

    fn piece(&self, voltage_v: f64, against_nm: f64, load_inertia_kg_m2: f64) -> Piece {
        let motor = &self.motor;
        let inertia_kg_m2 = motor.inertia_kg_m2 + load_inertia_kg_m2 / (self.gear.ratio.powi(2) * self.gear.efficiency);
        let (k_w, k_tau, r, f) = (motor.back_emf_v_s_per_rad, motor.torque_nm_per_a, motor.resistance_ohm, motor.viscous_nm_s_per_rad);
        let stiffness = r * f + k_w * k_tau;
        Piece {
            a: [[-r / motor.inductance_h, -k_w / motor.inductance_h], [k_tau / inertia_kg_m2, -f / inertia_kg_m2]],
            rest: [(f * voltage_v + k_w * against_nm) / stiffness, (k_tau * voltage_v - r * against_nm) / stiffness],
        }
    }

    /// Current and charge of a blocked shaft after `time_s`.
    fn blocked(&self, current_a: f64, voltage_v: f64, time_s: f64) -> (f64, f64) {
        let (final_a, tau_s) = (voltage_v / self.motor.resistance_ohm, self.motor.electrical_time_s());
        let keep = (-time_s / tau_s).exp();
        (final_a + (current_a - final_a) * keep, final_a * time_s + (current_a - final_a) * tau_s * (1.0 - keep))
    }

    /// How long a standing shaft stays where it is; none for ever. `band_nm` are the motor torques
    /// at which it begins to turn backward and forward.
    fn stands_s(&self, current_a: f64, voltage_v: f64, band_nm: [f64; 2]) -> Option<f64> {
        let [low_a, high_a] = band_nm.map(|torque_nm| torque_nm / self.motor.torque_nm_per_a);
        let final_a = voltage_v / self.motor.resistance_ohm;
        let leaves_at_a = if current_a < low_a || current_a > high_a {
            return Some(0.0);
        } else if final_a > high_a {
            high_a
        } else if final_a < low_a {
            low_a
        } else {
            return None;
        };
        Some(self.motor.electrical_time_s() * ((final_a - current_a) / (final_a - leaves_at_a)).ln())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::motor::{Gear, Motor};

    fn explorer(viscous_nm_s_per_rad: f64) -> Gearmotor {
        let motor = Motor {
            back_emf_v_s_per_rad: 11.46e-3,
            torque_nm_per_a: 11.4e-3,
            resistance_ohm: 13.7,
            inductance_h: 310e-6,
            inertia_kg_m2: 0.67e-7,
            viscous_nm_s_per_rad,
            friction_nm: 0.12e-3,
        };
        Gearmotor { motor, gear: Gear { ratio: 41.0, efficiency: 0.7 } }
    }

    /// Semi-implicit Euler at a tenth of a microsecond, with friction as a sign.
    fn reference(drive: &Gearmotor, from: Turning, dt_s: f64, voltage_v: f64, load: &Load) -> Turning {
        let (m, n) = (&drive.motor, drive.gear.ratio * drive.gear.efficiency);
        let inertia = m.inertia_kg_m2 + load.inertia_kg_m2 / (n * drive.gear.ratio);
        let (mut i, mut w) = (from.current_a, from.motor_radps);
        let h = 1e-7;
        for _ in 0..(dt_s / h).round() as u64 {
            i += h / m.inductance_h * (voltage_v - m.resistance_ohm * i - m.back_emf_v_s_per_rad * w);
            let driving = m.torque_nm_per_a * i - m.viscous_nm_s_per_rad * w - load.torque_nm / n;
            let friction = m.friction_nm + load.friction_nm / n;
            let next = w + h / inertia * (driving - friction * w.signum());
            w = if w == 0.0 && driving.abs() <= friction || w != 0.0 && next * w < 0.0 {
                0.0
            } else if w == 0.0 {
                h / inertia * (driving - friction * driving.signum())
            } else {
                next
            };
        }
        Turning { current_a: i, motor_radps: w }
    }

    #[test]
    fn a_driving_torque_accelerates_to_the_steady_state() {
        let drive = explorer(2e-8);
        let load = Load { torque_nm: 0.01, friction_nm: 0.0, inertia_kg_m2: 1e-4 };
        let end = drive.turn(Turning::default(), 100.0, 9.0, &load).end;
        let wheel_radps = drive.speed_at(9.0, 0.01);
        assert!((end.motor_radps / (wheel_radps * 41.0) - 1.0).abs() < 1e-9);
        assert!((end.current_a - drive.at(0.01, wheel_radps).current_a).abs() < 1e-9);
    }

    #[test]
    fn the_exact_step_agrees_with_a_fine_integration_through_start_stop_and_reversal() {
        let drive = explorer(2e-8);
        let load = Load { torque_nm: 0.0, friction_nm: 1.1e-3, inertia_kg_m2: 2.5e-4 };
        // From a standstill, while running, brought to a stop, and reversed.
        for (from, voltage_v, dt_s) in [
            (Turning::default(), 6.0, 5e-3),
            (Turning { current_a: 0.02, motor_radps: 400.0 }, 11.0, 20e-3),
            (Turning { current_a: 0.0, motor_radps: 5.0 }, 0.0, 40e-3),
            (Turning { current_a: 0.02, motor_radps: 20.0 }, -5.0, 20e-3),
        ] {
            let (exact, fine) = (drive.turn(from, dt_s, voltage_v, &load).end, reference(&drive, from, dt_s, voltage_v, &load));
            assert!((exact.current_a - fine.current_a).abs() < 1e-4, "{voltage_v} V: {exact:?} {fine:?}");
            assert!((exact.motor_radps - fine.motor_radps).abs() < 0.05, "{voltage_v} V: {exact:?} {fine:?}");
        }
    }

    #[test]
    fn energy_in_equals_losses_work_and_stored_energy() {
        let mut drive = explorer(2e-8);
        drive.motor.back_emf_v_s_per_rad = drive.motor.torque_nm_per_a;
        drive.gear.efficiency = 1.0;
        let load = Load { torque_nm: 0.01, friction_nm: 2e-3, inertia_kg_m2: 2.5e-4 };
        let (mut now, mut in_j, mut lost_j, mut lifted_j) = (Turning::default(), 0.0, 0.0, 0.0);
        let dt_s = 2e-6;
        for _ in 0..20_000 {
            let turned = drive.turn(now, dt_s, 10.0, &load);
            let (i, w) = (f64::midpoint(now.current_a, turned.end.current_a), f64::midpoint(now.motor_radps, turned.end.motor_radps));
            in_j += 10.0 * turned.charge_c;
            let friction_nm = drive.motor.friction_nm + 2e-3 / 41.0;
            lost_j += (13.7 * i * i + 2e-8 * w * w) * dt_s + friction_nm * turned.angle_rad;
            lifted_j += 0.01 / 41.0 * turned.angle_rad;
            now = turned.end;
        }
        let inertia = 0.67e-7 + 2.5e-4 / 41f64.powi(2);
        let stored_j = inertia * now.motor_radps.powi(2) / 2.0 + 310e-6 * now.current_a.powi(2) / 2.0;
        assert!(in_j > 0.01 && (in_j - lost_j - lifted_j - stored_j).abs() < 1e-4 * in_j, "{in_j} {lost_j} {lifted_j} {stored_j}");
    }

    #[test]
    fn one_step_equals_many_and_any_step_is_finite() {
        let drive = explorer(0.0);
        let load = Load { torque_nm: 5e-3, friction_nm: 1e-3, inertia_kg_m2: 2.5e-4 };
        let once = drive.turn(Turning::default(), 0.3, 7.0, &load);
        let (mut now, mut charge_c) = (Turning::default(), 0.0);
        for _ in 0..300 {
            let turned = drive.turn(now, 1e-3, 7.0, &load);
            (now, charge_c) = (turned.end, charge_c + turned.charge_c);
        }
        assert!((once.end.motor_radps - now.motor_radps).abs() < 1e-6 && (once.charge_c - charge_c).abs() < 1e-9);
        for dt_s in [1e-9, 1e-3, 1.0, 1e4] {
            for voltage_v in [-12.0, 0.0, 0.1, 12.0] {
                for motor_radps in [-1e3, 0.0, 1e-3, 1e4] {
                    let end = drive.turn(Turning { current_a: 0.5, motor_radps }, dt_s, voltage_v, &load);
                    assert!(end.end.current_a.is_finite() && end.end.motor_radps.is_finite() && end.charge_c.is_finite());
                }
            }
        }
    }

    #[test]
    fn friction_holds_a_motor_until_its_voltage_breaks_it_away() {
        let drive = explorer(0.0);
        // By hand: friction 0.12e-3 + 1e-3 / (41 * 0.7) N m takes 13.6 mA, 0.186 V at 13.7 ohm.
        let load = Load { torque_nm: 0.0, friction_nm: 1e-3, inertia_kg_m2: 0.0 };
        let breakaway_v = (0.12e-3 + 1e-3 / (41.0 * 0.7)) / 11.4e-3 * 13.7;
        assert_eq!(drive.turn(Turning::default(), 1.0, 0.99 * breakaway_v, &load).end.motor_radps, 0.0);
        assert!(drive.turn(Turning::default(), 1.0, 1.01 * breakaway_v, &load).end.motor_radps > 0.0);
    }
}
