//! Stations: robots come, charge with constant current and then constant voltage, stay a while
//! and leave; the lift lowers and lifts them, and the selector changes packs.

use energy::{Channel, Sensor, Start, System, Uncertainty};

use super::{Setting, Wish, believed};
use crate::draft::{Draft, Part, part};
use crate::random::Stream;
use crate::world::Script;

/// Rows of a log, and the length of one, s: six hours.
const ROWS: usize = 1080;
const DT_S: f64 = 20.0;
/// Bays of a station.
const BAYS: usize = 3;
/// An hour in which no robot is there, in rows.
const EMPTY_HOUR: std::ops::Range<usize> = 500..690;
/// Every base, less what is hidden.
const PARTS: &[&str] = &["robot_own_load", "charger_efficiency", "converter_efficiency", "hotel", "lift"];
/// Bases in which nothing else can stand for what is hidden.
const BASES: &[(&str, &[&str])] = &[
    ("charger_curve", &["robot_own_load", "converter_efficiency", "hotel", "lift"]),
    ("converter_curve", &["robot_own_load", "charger_efficiency", "hotel", "lift"]),
    ("path_selection", &["charger_efficiency", "converter_efficiency", "hotel", "lift"]),
];

/// Draws a station and what happens at it.
#[must_use]
pub fn draw(seed: u64, wish: &Wish) -> Setting {
    let mut random = Stream::new(seed, "station");
    let sensors = vec![(
        Channel::PackPowerW,
        Sensor {
            sigma: random.between(0.03, 0.08),
            quantum: 0.01,
            dead_band: 0.0,
            lag_s: 0.0,
            lag_sigma_s: 0.0,
            offset_sigma: 0.01,
            gain_sigma: 2e-3,
        },
    )];
    let needed = wish.hidden.iter().find_map(|id| BASES.iter().find(|(known, _)| known == id)).map(|(_, base)| *base);
    let base = wish.base.or(needed).unwrap_or(PARTS);
    let mut values = Stream::new(seed, "station parameters");
    let kept: Vec<&'static str> = base.iter().copied().filter(|id| !wish.hidden.contains(id)).collect();
    let parts: Vec<Part> = kept.iter().map(|&id| base_part(id, !wish.all_known, &kept, &mut values)).collect();
    let truth = Draft {
        system: System::Station,
        name: "base".to_owned(),
        pack: None,
        sensors: sensors.clone(),
        uncertainty: Uncertainty::default(),
        parts,
    };
    let mut told = truth.clone();
    told.parts = believed(System::Station, &truth.parts, &mut Stream::new(seed, "beliefs"));
    let mut visits = Stream::new(seed, "scripts");
    let scripts = (0..6).map(|index| script(index, wish.poor.together, &mut visits)).collect();
    Setting { truth, believed: told, scripts, sensors }
}

/// True numbers of a base effect. Of charger and converter in a row only one loss is free: their
/// product is all that a log shows.
fn base_part(id: &'static str, free: bool, kept: &[&'static str], random: &mut Stream) -> Part {
    let of = |free: bool, values: &[(&'static str, f64)]| part(System::Station, id, free, values);
    match id {
        "robot_own_load" => of(free, &[("own_load_w", random.between(2.0, 5.0))]),
        "charger_efficiency" => {
            let both = kept.contains(&"converter_efficiency");
            of(free && both, &[("efficiency", random.between(0.86, 0.92))])
        }
        "converter_efficiency" => of(false, &[("efficiency", random.between(0.82, 0.9)), ("quiescent_w", 0.2)]),
        "hotel" => of(free, &[("hotel_w", random.between(3.0, 7.0))]),
        "lift" => of(free, &[("lift_w", random.between(6.0, 14.0))]),
        _ => panic!("no base has `{id}`"),
    }
}

/// What one bay does.
#[derive(Clone, Copy)]
enum Bay {
    Empty { rows: usize },
    Charging { row: usize, rows: usize, volts: f64, amperes: f64 },
    Full { rows: usize },
}

fn script(index: usize, always_taken: bool, random: &mut Stream) -> Script {
    let holdout = index >= 4;
    let name = if holdout { format!("holdout-{}", index - 3) } else { format!("train-{}", index + 1) };
    let names = [
        Channel::ChargePowerW,
        Channel::RobotsDocked,
        Channel::RobotsCharging,
        Channel::BaySquaredCurrentA2,
        Channel::SelectorEvents,
        Channel::LiftActive,
        Channel::PackVoltageV,
        Channel::AmbientDegc,
    ];
    let mut inputs: Vec<(Channel, Vec<f64>)> = names.iter().map(|&channel| (channel, Vec::with_capacity(ROWS))).collect();
    let mut bays = [Bay::Empty { rows: 0 }; BAYS];
    for (bay, state) in bays.iter_mut().enumerate() {
        *state = if always_taken { Bay::Full { rows: 10 } } else { Bay::Empty { rows: 10 + 60 * bay } };
    }
    let mut lift = 0;
    let ambient_degc = random.between(15.0, 30.0);
    let mut pack_v = random.between(11.6, 12.4);
    for row in 0..ROWS {
        let closed = EMPTY_HOUR.contains(&row) && !always_taken;
        let (mut docked, mut charging, mut power_w, mut squared_a2) = (0.0, 0.0, 0.0, 0.0);
        for bay in &mut bays {
            *bay = next(*bay, closed, always_taken, &mut lift, random);
            if let Bay::Charging { row, rows, volts, amperes } = *bay {
                // Two thirds at constant current, then a taper; each with its own time.
                let turn = 2 * rows / 3;
                let taper = if row < turn { 1.0 } else { (-((row - turn) as f64) / (rows as f64 / 9.0)).exp() };
                let current_a = amperes * taper;
                let bay_v = volts - 1.2 * (1.0 - (row as f64 / turn as f64).min(1.0));
                charging += 1.0;
                power_w += bay_v * current_a;
                squared_a2 += current_a * current_a;
            }
            docked += f64::from(u8::from(!matches!(bay, Bay::Empty { .. })));
        }
        let switched = random.chance(0.012);
        pack_v = if switched { random.between(11.8, 12.6) } else { (pack_v - 0.004 * (0.3 + power_w / 40.0)).max(9.6) };
        let lifting = f64::from(u8::from(lift > 0));
        lift = lift.saturating_sub(1);
        let now = [power_w, docked, charging, squared_a2, f64::from(u8::from(switched)), lifting, pack_v, ambient_degc];
        for ((_, values), value) in inputs.iter_mut().zip(now) {
            values.push(value);
        }
    }
    Script { name, holdout, start: Start::at_soc(1.0), dt_s: DT_S, bath: false, stretches: Vec::new(), inputs }
}

fn next(bay: Bay, closed: bool, always_taken: bool, lift: &mut usize, random: &mut Stream) -> Bay {
    match bay {
        Bay::Empty { .. } if closed => Bay::Empty { rows: random.between(1.0, 40.0) as usize },
        Bay::Empty { rows: 0 } => {
            *lift = 3;
            charge(random)
        }
        Bay::Empty { rows } => Bay::Empty { rows: rows - 1 },
        // Everybody leaves before the empty hour.
        Bay::Charging { .. } | Bay::Full { .. } if closed => {
            *lift = 3;
            Bay::Empty { rows: random.between(1.0, 40.0) as usize }
        }
        Bay::Charging { row, rows, volts, amperes } if row < rows => Bay::Charging { row: row + 1, rows, volts, amperes },
        Bay::Charging { .. } => Bay::Full { rows: random.between(10.0, 60.0) as usize },
        Bay::Full { rows: 0 } if always_taken => charge(random),
        Bay::Full { rows: 0 } => {
            *lift = 3;
            Bay::Empty { rows: random.between(20.0, 120.0) as usize }
        }
        Bay::Full { rows } => Bay::Full { rows: rows - 1 },
    }
}

fn charge(random: &mut Stream) -> Bay {
    let (volts, amperes) = (random.between(12.3, 12.6), random.pick(&[0.6, 1.0, 1.32, 1.9]));
    Bay::Charging { row: 0, rows: random.between(90.0, 240.0) as usize, volts, amperes }
}
