//! A robot's first model, made of the data sheets of its motors, gears and wheels.
//!
//! The file of a data sheet is TOML. A number is written as the sheet has it, or with its deviation as `{ value = .., sigma = .. }`; without one
//! it has what sheets of its kind promise. The deviations of what follows are carried through by `energy::propagate`.

use energy::document::{Document, DocumentError};
use energy::drive::bridge::HBridge;
use energy::drive::kinematics::DifferentialDrive;
use energy::drive::motor::{Gear, Gearmotor, Motor};
use energy::drive::sheet::DriveSheet;
use energy::{Estimate, System, find, propagate};
use serde::Deserialize;
use toml::Spanned;

/// What a data sheet of a small motor or driver promises of its numbers, as a share: tolerances of 10 % are usual.
const OF_MOTORS: f64 = 0.1;
/// The same of a gear's efficiency, which nobody measures in small robots. A guess.
const OF_GEARS: f64 = 0.1;
/// The same of what a ruler or a balance tells. A guess.
const OF_MEASURES: f64 = 0.02;
/// Rolling resistance where none is given, and its deviation: rubber on a hard floor, 0.01 to 0.04.
const ROLLING: (f64, f64) = (0.02, 0.01);
/// Inductance over resistance of a small motor where none is given, s: 0.02 to 0.5 ms. A guess, which only a start and a ripple see.
const INDUCTANCE_S: f64 = 1e-4;
/// A torque constant over the back-EMF constant of the same motor: 1 in an ideal one. What lies beyond is another unit. A guess.
const SAME_CONSTANT: (f64, f64) = (0.7, 1.4);
/// What no sheet says.
const ON_NO_SHEET: [&str; 2] = ["step_w", "switching_w"];
/// Rad/s of a turn a minute.
const RADPS_PER_RPM: f64 = std::f64::consts::PI / 30.0;

/// A number, with or without its deviation.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "a number, or { value = .., sigma = .. }")]
enum RawNumber {
    Plain(f64),
    Known(RawKnown),
}

impl RawNumber {
    fn value(&self) -> f64 {
        match self {
            RawNumber::Plain(value) => *value,
            RawNumber::Known(known) => known.value,
        }
    }
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawKnown {
    value: f64,
    sigma: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSheet {
    schema: Spanned<u32>,
    name: String,
    battery_v: Spanned<RawNumber>,
    mass_kg: Spanned<RawNumber>,
    #[serde(default = "two")]
    driven_wheels: Spanned<u32>,
    wheel_radius_m: Spanned<RawNumber>,
    wheel_inertia_kg_m2: Option<Spanned<RawNumber>>,
    rolling_coefficient: Option<Spanned<RawNumber>>,
    idle_w: Option<Spanned<RawNumber>>,
    motor: RawMotor,
    gear: RawGear,
    bridge: Option<RawBridge>,
}

/// The greatest that an effect's parameter may be.
fn of_effect(effect: &str, name: &str) -> f64 {
    let spec = find(System::Robot, effect).map(|(_, effect)| effect.spec());
    spec.and_then(|spec| spec.parameters.iter().find(|parameter| parameter.name == name)).map_or(f64::INFINITY, |parameter| parameter.max)
}

fn two() -> Spanned<u32> {
    Spanned::new(0..0, 2)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMotor {
    nominal_v: Spanned<RawNumber>,
    resistance_ohm: Spanned<RawNumber>,
    torque_nm_per_a: Spanned<RawNumber>,
    no_load_rpm: Spanned<RawNumber>,
    no_load_a: Spanned<RawNumber>,
    inductance_h: Option<Spanned<RawNumber>>,
    inertia_kg_m2: Option<Spanned<RawNumber>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawGear {
    ratio: Spanned<RawNumber>,
    efficiency: Spanned<RawNumber>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawBridge {
    on_ohm: Spanned<RawNumber>,
    pwm_hz: Spanned<RawNumber>,
}

/// Where each number lies in [`RobotSheet::numbers`].
#[derive(Debug, Clone, Copy)]
enum At {
    Mass,
    Radius,
    WheelInertia,
    Rolling,
    Resistance,
    Torque,
    NoLoadSpeed,
    NoLoadCurrent,
    Inductance,
    Inertia,
    Ratio,
    Efficiency,
    OnOhm,
}

/// A robot as its data sheets have it.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotSheet {
    /// Name of the robot.
    pub name: String,
    /// Mean voltage of its battery, V.
    pub battery_v: f64,
    /// What it takes at rest, W, where that is known.
    pub idle_w: Option<Estimate>,
    motors: f64,
    nominal_v: f64,
    pwm_hz: Option<f64>,
    /// By [`At`].
    numbers: Vec<Estimate>,
}

/// A parameter that follows, with its deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its effect.
    pub effect: &'static str,
    /// Its name, with its unit.
    pub name: &'static str,
    /// Its value.
    pub value: Estimate,
}

impl RobotSheet {
    /// Reads the file of a data sheet.
    ///
    /// # Errors
    /// Says what is wrong, where, and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<RobotSheet, DocumentError> {
        let document = Document { file, text };
        let raw: RawSheet = document.parse()?;
        if *raw.schema.get_ref() != 1 {
            return Err(document.error_at(raw.schema.span(), format!("schema = {}: this program reads schema = 1", raw.schema.get_ref())));
        }
        let read = |name: &str, given: &Spanned<RawNumber>, (min, max): (f64, f64), share: f64| {
            let number = match *given.get_ref() {
                RawNumber::Plain(value) => Estimate::new(value, share * value.abs()),
                RawNumber::Known(known) => Estimate::new(known.value, known.sigma),
            };
            if !(number.value.is_finite() && (min..=max).contains(&number.value)) {
                return Err(document.error_at(given.span(), format!("{name} = {}: must be between {min} and {max}", number.value)));
            }
            if !(number.sigma.is_finite() && number.sigma >= 0.0 && number.sigma <= number.value.abs()) {
                return Err(document.error_at(given.span(), format!("{name}: sigma = {}: must be between 0 and the value", number.sigma)));
            }
            Ok(number)
        };
        let optional = |name: &str, given: &Option<Spanned<RawNumber>>, range, share, without: Estimate| {
            given.as_ref().map_or(Ok(without), |given| read(name, given, range, share))
        };
        let wheels = *raw.driven_wheels.get_ref();
        if !(1..=16).contains(&wheels) {
            return Err(document.error_at(raw.driven_wheels.span(), format!("driven_wheels = {wheels}: must be between 1 and 16")));
        }
        let (motor, gear) = (&raw.motor, &raw.gear);
        let nominal_v = read("motor.nominal_v", &motor.nominal_v, (0.1, 1000.0), 0.0)?.value;
        let resistance = read("motor.resistance_ohm", &motor.resistance_ohm, (1e-4, 1e4), OF_MOTORS)?;
        let no_load_rpm = read("motor.no_load_rpm", &motor.no_load_rpm, (1.0, 1e6), OF_MOTORS)?;
        let no_load_a = read("motor.no_load_a", &motor.no_load_a, (0.0, 1e3), OF_MOTORS)?;
        if no_load_a.value * resistance.value >= nominal_v {
            let blocked_a = nominal_v / resistance.value;
            let message =
                format!("motor.no_load_a = {}: must be less than the current of the blocked motor, {blocked_a:.3} A", no_load_a.value);
            return Err(document.error_at(motor.no_load_a.span(), message));
        }
        let back_emf = (nominal_v - resistance.value * no_load_a.value) / (no_load_rpm.value * RADPS_PER_RPM);
        let torque = motor.torque_nm_per_a.get_ref().value();
        if !(SAME_CONSTANT.0..=SAME_CONSTANT.1).contains(&(torque / back_emf)) {
            let message = format!(
                "motor.torque_nm_per_a = {torque}: nominal voltage and speed without load make it {back_emf:.4}, since a motor's torque and voltage have one \
                 constant: check the units (N m/A, turns a minute)"
            );
            return Err(document.error_at(motor.torque_nm_per_a.span(), message));
        }
        let inductance = Estimate::exact(INDUCTANCE_S * resistance.value);
        let numbers = vec![
            read("mass_kg", &raw.mass_kg, (1e-3, of_effect("motion", "mass_kg")), OF_MEASURES)?,
            read("wheel_radius_m", &raw.wheel_radius_m, (1e-3, 2.0), OF_MEASURES)?,
            optional("wheel_inertia_kg_m2", &raw.wheel_inertia_kg_m2, (0.0, 10.0), OF_MOTORS, Estimate::exact(0.0))?,
            optional(
                "rolling_coefficient",
                &raw.rolling_coefficient,
                (0.0, 0.5),
                ROLLING.1 / ROLLING.0,
                Estimate::new(ROLLING.0, ROLLING.1),
            )?,
            resistance,
            read("motor.torque_nm_per_a", &motor.torque_nm_per_a, (1e-5, 100.0), OF_MOTORS)?,
            no_load_rpm,
            no_load_a,
            optional("motor.inductance_h", &motor.inductance_h, (1e-9, 1.0), OF_MOTORS, inductance)?,
            optional("motor.inertia_kg_m2", &motor.inertia_kg_m2, (0.0, 1.0), OF_MOTORS, Estimate::exact(0.0))?,
            read("gear.ratio", &gear.ratio, (1e-2, 1e4), 0.0)?,
            read("gear.efficiency", &gear.efficiency, (0.05, 1.0), OF_GEARS)?,
            raw.bridge
                .as_ref()
                .map_or(Ok(Estimate::exact(0.0)), |bridge| read("bridge.on_ohm", &bridge.on_ohm, (0.0, 100.0), OF_MOTORS))?,
        ];
        Ok(RobotSheet {
            name: raw.name,
            battery_v: read("battery_v", &raw.battery_v, (0.5, 1000.0), 0.0)?.value,
            idle_w: raw.idle_w.as_ref().map(|idle_w| read("idle_w", idle_w, (0.0, of_effect("idle", "idle_w")), OF_MOTORS)).transpose()?,
            motors: f64::from(wheels),
            nominal_v,
            pwm_hz: raw.bridge.as_ref().map(|bridge| Ok(read("bridge.pwm_hz", &bridge.pwm_hz, (10.0, 1e7), 0.0)?.value)).transpose()?,
            numbers,
        })
    }

    /// The drive that these numbers describe.
    #[must_use]
    pub fn drive(&self) -> DriveSheet {
        self.with(&self.numbers.iter().map(|number| number.value).collect::<Vec<_>>())
    }

    fn with(&self, numbers: &[f64]) -> DriveSheet {
        let number = |at: At| numbers[at as usize];
        let (resistance, torque) = (number(At::Resistance), number(At::Torque));
        let mut motor =
            Motor::from_datasheet(self.nominal_v, resistance, torque, number(At::NoLoadSpeed) * RADPS_PER_RPM, number(At::NoLoadCurrent));
        (motor.inductance_h, motor.inertia_kg_m2) = (number(At::Inductance), number(At::Inertia));
        DriveSheet {
            motors: self.motors,
            gearmotor: Gearmotor { motor, gear: Gear { ratio: number(At::Ratio), efficiency: number(At::Efficiency) } },
            bridge: self.pwm_hz.map(|pwm_hz| HBridge { on_ohm: number(At::OnOhm), pwm_hz }),
            wheels: DifferentialDrive {
                // Nothing here turns on the spot.
                base_m: 1.0,
                wheel_radius_m: number(At::Radius),
                wheel_inertia_kg_m2: number(At::WheelInertia),
                rotor_inertia_kg_m2: number(At::Inertia),
                gear_ratio: number(At::Ratio),
            },
            mass_kg: number(At::Mass),
            rolling_coefficient: number(At::Rolling),
        }
    }

    /// Parameters of the robot's effects that follow.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut parameters: Vec<Parameter> =
            self.idle_w.map(|value| Parameter { effect: "idle", name: "idle_w", value }).into_iter().collect();
        for (index, follows) in self.drive().parameters().into_iter().enumerate() {
            let value = propagate(&self.numbers, |numbers| self.with(numbers).parameters()[index].value);
            parameters.push(Parameter { effect: follows.effect, name: follows.name, value });
        }
        parameters
    }

    /// The model as the text of a file. `origin` says what made it of which sheet, and when.
    #[must_use]
    pub fn model_text(&self, origin: &str) -> String {
        let mut text = format!(
            "# A first model of a robot, made by {origin}.\n# It has what data sheets say of its drive: `lab discover` says what its logs show besides.\n\
             schema = 1\nsystem = \"robot\"\nname = {}\n",
            toml::Value::from(self.name.as_str())
        );
        let mut last = "";
        for Parameter { effect, name, value } in self.parameters() {
            if effect != last {
                text.push_str(&format!("\n[[effect]]\nid = \"{effect}\"\n"));
                last = effect;
            }
            let nothing = value.value == 0.0 && ON_NO_SHEET.contains(&name);
            let (value, sigma) = (format!("{:.4e}", value.value), format!("{:.1e}", value.sigma));
            let source = if nothing { "no sheet says it: taken as nothing".to_owned() } else { format!("data sheets, by {origin}") };
            text.push_str(&format!("{name} = {{ value = {value}, sigma = {sigma}, source = {} }}\n", toml::Value::from(source)));
        }
        text
    }
}
