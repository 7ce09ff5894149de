//! Robots: loads that come and go, drives over floors and slopes, with and without a payload.

use energy::{Channel, Sensor, Start, System, Uncertainty};

use super::{Setting, Wish, believed};
use crate::draft::{Draft, Part, part};
use crate::random::Stream;
use crate::world::Script;

/// Rows of a log, and the length of one, s.
const ROWS: usize = 1800;
const DT_S: f64 = 1.0;
/// The parts of a robot that every base has, unless a case hides one or needs others.
const PARTS: &[&str] = &["idle", "rolling", "slope", "acceleration", "payload"];
/// What a converter is tried on: loads that are known and change.
const LOADED: &[&str] = &["cpu", "camera", "radio", "rolling", "slope", "acceleration", "payload"];
/// A robot of which only the loads at standstill are known: `motion` holds all the rest.
const STANDING: &[&str] = &["idle"];

/// Bases of effects that the usual one would swallow, or that need another.
const BASES: &[(&str, &[&str])] = &[
    ("motion", STANDING),
    ("converter", LOADED),
    ("converter_quadratic", LOADED),
    ("idle", LOADED),
    ("gps", LOADED),
    ("encoders", LOADED),
    ("copper_temperature", &["idle", "rolling", "slope", "acceleration", "payload", "motor_copper"]),
];

/// Draws a robot and what it does.
#[must_use]
pub fn draw(seed: u64, wish: &Wish) -> Setting {
    let mut random = Stream::new(seed, "robot");
    let mass_kg = random.log_between(1.0, 8.0);
    let sensors = vec![(
        Channel::PowerW,
        Sensor {
            sigma: random.between(0.015, 0.04),
            quantum: 0.005,
            dead_band: 0.0,
            lag_s: 0.0,
            lag_sigma_s: 0.0,
            offset_sigma: 0.005,
            gain_sigma: 2e-3,
        },
    )];
    let needed = wish.hidden.iter().find_map(|id| BASES.iter().find(|(known, _)| known == id)).map(|(_, base)| *base);
    let base = wish.base.or(needed).unwrap_or(PARTS);
    let mut values = Stream::new(seed, "robot parameters");
    let parts: Vec<Part> =
        base.iter().filter(|id| !wish.hidden.contains(id)).map(|&id| base_part(id, mass_kg, !wish.all_known, &mut values)).collect();
    let truth = Draft {
        system: System::Robot,
        name: "base".to_owned(),
        pack: None,
        sensors: sensors.clone(),
        uncertainty: Uncertainty::default(),
        parts,
    };
    let mut told = truth.clone();
    told.parts = believed(System::Robot, &truth.parts, &mut Stream::new(seed, "beliefs"));
    let mut moves = Stream::new(seed, "scripts");
    let mut scripts: Vec<Script> = (0..6).map(|index| script(index, wish.poor.together, &mut moves)).collect();
    if wish.hidden.contains(&"motion") {
        // The effect carries a payload even when the robot itself weighs nothing.
        let payloads = scripts.iter_mut().flat_map(|script| &mut script.inputs).filter(|(channel, _)| *channel == Channel::PayloadKg);
        payloads.for_each(|(_, values)| values.fill(0.0));
    }
    Setting { truth, believed: told, scripts, sensors }
}

/// True numbers of a base effect. Masses come from a scale and loads from data sheets: known.
fn base_part(id: &'static str, mass_kg: f64, free: bool, random: &mut Stream) -> Part {
    let of = |free: bool, values: &[(&'static str, f64)]| part(System::Robot, id, free, values);
    match id {
        "idle" => of(free, &[("idle_w", random.between(2.0, 6.0))]),
        "rolling" => {
            let mut rolling = of(free, &[("rolling_coefficient", random.between(0.015, 0.04)), ("mass_kg", mass_kg)]);
            rolling.values[1].free = false;
            rolling
        }
        "slope" | "acceleration" => of(false, &[("mass_kg", mass_kg)]),
        "payload" => of(false, &[("share", 1.0)]),
        "cpu" => of(false, &[("capacitance_nf", 0.72), ("leakage_a", 0.02), ("idle_share", 0.3)]),
        "camera" => of(false, &[("camera_w", random.between(0.8, 2.0))]),
        "radio" => of(false, &[("listen_w", 0.6), ("send_w", random.between(0.5, 2.0)), ("supply_per_radiated", 5.0)]),
        "motor_copper" => of(free, &[("copper_w_per_n2", random.between(0.1, 0.4))]),
        _ => panic!("no base has `{id}`"),
    }
}

/// A drive: stretches of 5 to 60 s, each with a speed, a slope, a floor; the loads change on
/// their own, so that no two are always on together.
fn script(index: usize, together: bool, random: &mut Stream) -> Script {
    let holdout = index >= 4;
    let name = if holdout { format!("holdout-{}", index - 3) } else { format!("train-{}", index + 1) };
    let names = [
        Channel::VoltageV,
        Channel::AmbientDegc,
        Channel::SpeedMps,
        Channel::AccelMps2,
        Channel::PitchRad,
        Channel::PayloadKg,
        Channel::YawRateRadps,
        Channel::CpuMhz,
        Channel::CpuUtil,
        Channel::RadioTxDbm,
        Channel::RadioDuty,
        Channel::CameraOn,
        Channel::TailAngleRad,
        Channel::FloorClass,
    ];
    let mut inputs: Vec<(Channel, Vec<f64>)> = names.iter().map(|&channel| (channel, Vec::with_capacity(ROWS))).collect();
    let mut now = [0.0; 14];
    now[1] = [24.0, 2.0, 38.0, 18.0, 10.0, 30.0][index] + random.between(-2.0, 2.0);
    (now[7], now[9]) = (312.0, 10.0);
    let (full_v, empty_v) = (random.between(12.2, 12.6), random.between(9.6, 10.4));
    let (mut left, mut wanted_mps) = (0, 0.0);
    for row in 0..ROWS {
        now[0] = full_v + (empty_v - full_v) * (row as f64 / ROWS as f64) - 0.05 * (now[2] * 4.0 + now[11]);
        if left == 0 {
            left = random.between(5.0, 60.0) as usize;
            wanted_mps = random.pick(&[0.0, 0.0, 0.1, 0.2, 0.35, 0.5, 0.7]);
            now[4] = if random.chance(0.4) { random.between(-0.12, 0.15) } else { 0.0 };
            now[5] = if random.chance(0.3) { random.pick(&[0.3, 0.6, 1.2]) } else { now[5] * f64::from(u8::from(random.chance(0.6))) };
            now[6] = if random.chance(0.35) { random.pick(&[-1.2, -0.4, 0.3, 0.8, 1.5]) } else { 0.0 };
            now[13] = if random.chance(0.3) { random.pick(&[0.0, 1.0, 2.0, 3.0]) } else { now[13] };
            now[12] = if random.chance(0.4) { random.between(-0.5, 0.6) } else { now[12] };
        }
        left -= 1;
        // Speeding up and braking take a few rows.
        let accel_mps2: f64 = (wanted_mps - now[2]).clamp(-0.15, 0.12);
        (now[2], now[3]) = (now[2] + accel_mps2 * DT_S, accel_mps2);
        if random.chance(0.04) {
            now[7] = random.pick(&[104.0, 156.0, 208.0, 312.0, 416.0]);
        }
        if random.chance(0.08) {
            now[8] = random.between(0.05, 1.0);
        }
        if random.chance(0.03) {
            now[9] = random.pick(&[0.0, 5.0, 10.0, 15.0, 20.0]);
        }
        if random.chance(0.06) {
            now[10] = if random.chance(0.4) { 0.0 } else { random.between(0.02, 0.9) };
        }
        if random.chance(0.02) {
            now[11] = 1.0 - now[11];
        }
        if together {
            // The radio sends what the camera sees, at one power, and is silent otherwise.
            (now[9], now[10]) = (10.0, 0.5 * now[11]);
        }
        for ((_, values), value) in inputs.iter_mut().zip(now) {
            values.push(value);
        }
    }
    Script { name, holdout, start: Start::at_soc(1.0), dt_s: DT_S, bath: false, stretches: Vec::new(), inputs }
}
