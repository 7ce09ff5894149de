//! Plots of a robot that drives: its motors, its caster tail, its energy per metre.
//!
//! # Plots
//!
//! ```text
//! cargo run -p energy --example plot_motion [FOLDER]      (default: plots)
//! ```
//!
//! - `motor`: speed, armature current, power and efficiency over the torque at the wheel.
//! - `motor-start`: speed and current of a start and a stop, ripple over the PWM frequency.
//! - `caster`: holding torque, weight on the wheels and power to hold over the tail's angle.
//! - `energy-per-metre`: of the drive motors alone and of whole robots, over speed.
//!
//! Each as SVG and as PNG.

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

use energy::drive::bridge::ripple_any_a;
use energy::drive::explorer::{BRIDGE, CASTER, MOTOR, PACK_V, ROLLING, SERVO, SPEED_MAX_MPS, WHEELS};
use energy::drive::transient::{Load, Turning};
use energy::drive::travel::{energy_per_metre, most_economical};
use energy::units::GRAVITY_MPS2;
use energy::{Channel, Model, Run, Start, load_model};
use plotters::prelude::SeriesLabelPosition::{LowerRight, UpperLeft, UpperRight};

mod plot;

use plot::{Line, Mark, Panel, save};

const SIZE: (u32, u32) = (620, 420);
/// Pack voltages: full, mean, nearly empty.
const VOLTAGES: [f64; 3] = [12.6, PACK_V, 9.0];
const MNM_PER_NM: f64 = 1e3;

/// Torque of the Explorer's wheel on a level floor, N m.
fn level_nm() -> f64 {
    ROLLING * (CASTER.body_kg + CASTER.tail_kg) * GRAVITY_MPS2 * WHEELS.wheel_radius_m / 2.0
}

fn mark(at: (f64, f64), offset: (i32, i32), text: String) -> Mark {
    Mark { at, text, offset }
}

fn motor() -> Vec<Panel> {
    let end_mnm = MOTOR.stall_nm(VOLTAGES[0]) * MNM_PER_NM;
    let of = |what: fn(f64, f64) -> f64| -> Vec<Line> {
        let line = |(colour, voltage_v): (usize, &f64)| {
            let last_mnm = MOTOR.stall_nm(*voltage_v) * MNM_PER_NM * 0.9999;
            Line::of(&format!("{voltage_v:.1} V"), colour, 0.0..last_mnm, |torque_mnm| what(torque_mnm / MNM_PER_NM, *voltage_v))
        };
        VOLTAGES.iter().enumerate().map(line).collect()
    };
    let at = |wheel_nm: f64, voltage_v: f64| MOTOR.at(wheel_nm, MOTOR.speed_at(voltage_v, wheel_nm));
    let driving = at(level_nm(), PACK_V);
    let level_mnm = level_nm() * MNM_PER_NM;
    let panel = |title: &str, y_label: &str, top: f64, lines, marks, legend| {
        Panel::new(title, ("torque at the wheel / mN m", 0.0..end_mnm * 1.02), (y_label, 0.0..top), lines, legend).marked(marks)
    };
    let best = (1..1000)
        .map(|step| MOTOR.stall_nm(PACK_V) * f64::from(step) / 1000.0)
        .max_by(|a, b| at(*a, PACK_V).efficiency.total_cmp(&at(*b, PACK_V).efficiency))
        .expect("a thousand torques");
    let best_efficiency = 100.0 * at(best, PACK_V).efficiency;
    vec![
        panel(
            "Speed over ground",
            "speed / (m/s)",
            0.65,
            of(|nm, v| MOTOR.speed_at(v, nm) * WHEELS.wheel_radius_m),
            vec![mark(
                (level_mnm, MOTOR.speed_at(PACK_V, level_nm()) * WHEELS.wheel_radius_m),
                (12, -46),
                format!("{PACK_V} V on a level floor: {:.2} m/s", MOTOR.speed_at(PACK_V, level_nm()) * WHEELS.wheel_radius_m),
            )],
            UpperRight,
        ),
        panel(
            "Armature current, up to stall",
            "current / mA",
            1000.0,
            of(|nm, v| 1e3 * MOTOR.at(nm, MOTOR.speed_at(v, nm)).current_a),
            vec![mark((level_mnm, 1e3 * driving.current_a), (40, -10), format!("level floor: {:.0} mA", 1e3 * driving.current_a))],
            UpperLeft,
        ),
        panel(
            "Power at the wheel",
            "power / W",
            2.2,
            of(|nm, v| MOTOR.at(nm, MOTOR.speed_at(v, nm)).wheel_w),
            vec![mark((level_mnm, driving.wheel_w), (40, -10), format!("level floor: {:.0} mW", 1e3 * driving.wheel_w))],
            UpperRight,
        ),
        panel(
            "Efficiency, armature to wheel",
            "efficiency / %",
            70.0,
            of(|nm, v| 100.0 * MOTOR.at(nm, MOTOR.speed_at(v, nm)).efficiency),
            vec![
                mark((level_mnm, 100.0 * driving.efficiency), (14, 0), format!("level floor: {:.0} %", 100.0 * driving.efficiency)),
                mark((best * MNM_PER_NM, best_efficiency), (4, -14), format!("{best_efficiency:.0} % at {:.0} mN m", best * MNM_PER_NM)),
            ],
            UpperRight,
        ),
    ]
}

fn start() -> Vec<Panel> {
    // Half of the robot behind each wheel.
    let inertia_kg_m2 = (CASTER.body_kg + CASTER.tail_kg) / 2.0 * WHEELS.wheel_radius_m.powi(2) + WHEELS.wheel_inertia_kg_m2;
    let load = Load { torque_nm: 0.0, friction_nm: level_nm(), inertia_kg_m2 };
    let (mut now, mut speed, mut current) = (Turning::default(), vec![(0.0, 0.0)], vec![(0.0, 0.0)]);
    for step in 1..=600 {
        // Full voltage for 60 ms, then a short circuit.
        let voltage_v = if step <= 300 { PACK_V } else { 0.0 };
        now = MOTOR.turn(now, 0.2e-3, voltage_v, &load).end;
        let time_ms = 0.2 * f64::from(step);
        speed.push((time_ms, now.motor_radps / MOTOR.gear.ratio * WHEELS.wheel_radius_m));
        current.push((time_ms, 1e3 * now.current_a));
    }
    let ripple = |duty: f64, colour: usize| {
        let of_frequency =
            move |khz: f64| 1e3 * ripple_any_a(duty, PACK_V, 1e3 * khz, MOTOR.motor.inductance_h, MOTOR.motor.resistance_ohm);
        Line::of(&format!("duty {:.0} %", 100.0 * duty), colour, 1.0..100.0, of_frequency)
    };
    let khz = BRIDGE.pwm_hz / 1e3;
    let chosen_ma = 1e3 * ripple_any_a(0.5, PACK_V, BRIDGE.pwm_hz, MOTOR.motor.inductance_h, MOTOR.motor.resistance_ohm);
    let panel = |title: &str, x_label: &str, end: f64, y_label: &str, y, lines, marks, legend| {
        Panel::new(title, (x_label, 0.0..end), (y_label, y), lines, legend).marked(marks)
    };
    let time = "time / ms";
    vec![
        panel(
            "Start and short-circuit stop",
            time,
            120.0,
            "speed / (m/s)",
            0.0..0.6,
            vec![Line::through("", 0, speed)],
            vec![],
            UpperRight,
        ),
        panel("Armature current", time, 120.0, "current / mA", -900.0..900.0, vec![Line::through("", 1, current)], vec![], UpperRight),
        panel(
            "Ripple of the armature current",
            "PWM frequency / kHz",
            100.0,
            "ripple, peak to peak / mA",
            0.0..900.0,
            vec![ripple(0.5, 1), ripple(0.25, 0), ripple(0.1, 2)],
            vec![mark((khz, chosen_ma), (12, -10), format!("{khz:.2} kHz, {chosen_ma:.0} mA"))],
            UpperRight,
        ),
    ]
}

fn caster() -> Vec<Panel> {
    let range = -10.0..42.0_f64;
    let stance = |degrees: f64| CASTER.stance(degrees.to_radians(), 0.0).expect("the links reach");
    let weight_n = (CASTER.body_kg + CASTER.tail_kg) * GRAVITY_MPS2;
    let (worst_rad, worst_nm) = CASTER.worst(range.start.to_radians(), range.end.to_radians()).expect("the links reach");
    let worst = worst_rad.to_degrees();
    let panel = |title: &str, y_label: &str, y, line, marks| {
        Panel::new(title, ("tail below the horizontal / degrees", range.clone()), (y_label, y), vec![line], LowerRight).marked(marks)
    };
    let wheels = |degrees: f64| 100.0 * stance(degrees).wheels_n / weight_n;
    let hold_w = |degrees: f64| SERVO.hold_w(stance(degrees).hold_nm);
    vec![
        panel(
            "Holding torque of the tail",
            "torque / mN m",
            0.0..60.0,
            Line::of("", 0, range.clone(), |degrees| MNM_PER_NM * stance(degrees).hold_nm),
            vec![mark((worst, MNM_PER_NM * worst_nm), (0, -16), format!("{:.1} mN m at {worst:.1} degrees", MNM_PER_NM * worst_nm))],
        ),
        panel("Weight on the wheels", "share of the weight / %", 75.0..95.0, Line::of("", 1, range.clone(), wheels), vec![]),
        panel(
            "Power to hold",
            "power / W",
            0.0..0.4,
            Line::of("", 2, range.clone(), hold_w),
            vec![mark((worst, hold_w(worst)), (0, -16), format!("{:.2} W", hold_w(worst)))],
        ),
    ]
}

/// Power of the effects that drive the robot, W.
fn motors_w(run: &mut Run<f64>, speed_mps: f64) -> f64 {
    run.channels[Channel::SpeedMps] = speed_mps;
    let of_motors = |id: &str| ["motion", "dry_friction", "acceleration", "motor_copper", "floor"].contains(&id);
    run.step_explained(1.0).iter().filter(|(id, _)| of_motors(id)).map(|(_, share)| share).sum()
}

fn whole_robot(title: &str, model: &Arc<Model>, fastest_mps: f64, floors: &[(u32, &str)], top: f64) -> Panel {
    let (mut lines, mut marks) = (Vec::new(), Vec::new());
    for (colour, &(floor, label)) in floors.iter().enumerate() {
        let inputs = [(Channel::FloorClass, f64::from(floor))];
        let speeds = (0..=150).map(|step| 0.02 + (fastest_mps - 0.02) * f64::from(step) / 150.0);
        let costs: Vec<_> = speeds.map(|speed_mps| (speed_mps, energy_per_metre(model, &inputs, speed_mps))).collect();
        let mut line = Line::through(label, colour, costs.iter().map(|(speed, cost)| (*speed, cost.value)).collect());
        line.band = costs.iter().map(|(_, cost)| cost.sigma).collect();
        let shown = line.points.iter().zip(&line.band).filter(|((_, y), half)| y + **half < top);
        (line.points, line.band) = shown.map(|(&point, &half)| (point, half)).unzip();
        lines.push(line);
        let best = most_economical(model, &inputs, 0.02..=fastest_mps);
        let text = format!("{:.1} J/m at {:.2} m/s", best.energy_j_per_m.value, best.speed_mps);
        let below = if colour == 0 { 30 } else { -42 };
        marks.push(mark((best.speed_mps, best.energy_j_per_m.value), (-4, below), text));
    }
    Panel::new(title, ("speed / (m/s)", 0.0..fastest_mps * 1.04), ("energy / (J/m)", 0.0..top), lines, UpperRight).marked(marks)
}

fn energy() -> Result<Vec<Panel>, Box<dyn Error>> {
    let model = |name: &str| load_model(name, &|_| unreachable!("built in")).map(Arc::new);
    let (explorer, roomba, station) = (model("explorer-robot")?, model("roomba-robot")?, model("mds-vehicle")?);
    let per_metre = |floor: u32, label: &str, colour: usize| {
        let at = |speed_mps: f64| {
            let mut run = Run::new(Arc::clone(&explorer), Start::at_soc(0.0));
            run.channels[Channel::FloorClass] = f64::from(floor);
            motors_w(&mut run, speed_mps) / speed_mps
        };
        Line::of(label, colour, 0.01..SPEED_MAX_MPS, at)
    };
    let (speed, lines) =
        (("speed / (m/s)", 0.0..SPEED_MAX_MPS * 1.04), vec![per_metre(0, "hard floor", 0), per_metre(2, "long carpet", 1)]);
    let motors = Panel::new("Explorer, drive motors alone", speed, ("energy / (J/m)", 0.0..2.0), lines, UpperRight);
    Ok(vec![
        motors,
        whole_robot("Explorer, all it takes", &explorer, SPEED_MAX_MPS, &[(0, "hard floor, one sigma")], 60.0),
        whole_robot("Vacuum robot of the Roomba kind, cleaning", &roomba, 0.5, &[(0, "hard floor, one sigma")], 250.0),
        whole_robot("Docking station as a vehicle", &station, 0.5, &[(0, "hard floor"), (2, "long carpet")], 120.0),
    ])
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "plots".to_owned()));
    let figures = [("motor", 2, motor()), ("motor-start", 3, start()), ("caster", 3, caster()), ("energy-per-metre", 2, energy()?)];
    for (name, columns, panels) in figures {
        for path in save(&folder, name, columns, SIZE, &panels)? {
            println!("{}", path.display());
        }
    }
    Ok(())
}
