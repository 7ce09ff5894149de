//! What data sheets say of a robot, for people and for JSON.

use std::ops::RangeInclusive;
use std::sync::Arc;

use energy::drive::sheet::RAMP_RAD;
use energy::drive::travel::most_economical;
use energy::forecast::power_w;
use energy::{Channel, Model};
use serde::Serialize;

use crate::drive::RobotSheet;

use super::quantity::{quantity, unit_of, with_sigma};
use super::table::{numbers_from, table, text};

/// Slowest speed of a search for the cheapest, as a share of the greatest.
const SLOWEST: f64 = 0.02;

/// A ripple that makes up more than this share of what motors take is told.
const TOLD: f64 = 0.1;

/// A parameter that follows from the sheets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveParameter {
    /// Its effect.
    pub effect: &'static str,
    /// Its name, with its unit.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its deviation.
    pub sigma: f64,
}

/// What the robot takes somewhere.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Going {
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Slope, uphill, degrees.
    pub pitch_deg: f64,
    /// Power that its motors take by their own equations, W.
    pub motors_w: f64,
    /// Power that the model's effects make of it, W.
    pub model_w: f64,
    /// Current of one motor, A.
    pub current_a: f64,
    /// Mechanical power of the wheels over what its motors take, ripple and bridge included.
    pub efficiency: f64,
    /// Ripple of a motor's current, A peak to peak; null where the bridge is not known.
    pub ripple_a: Option<f64>,
    /// What that ripple heats all motors with, W, in a bridge that conducts both ways.
    pub ripple_w: Option<f64>,
}

/// Everything that `lab drive` says.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveReport {
    /// Version of this structure.
    pub schema: u32,
    /// Name of the robot.
    pub model: String,
    /// Version of the program.
    pub version: &'static str,
    /// Mean voltage of the battery, V.
    pub battery_v: f64,
    /// What follows for its effects.
    pub parameters: Vec<DriveParameter>,
    /// Greatest speed on a level floor, m/s; 0 where it does not move.
    pub top_speed_mps: f64,
    /// The steepest slope up which its motors push it, degrees.
    pub steepest_deg: f64,
    /// What it takes to go at half of the greatest speed, level and up a ramp of 1:12, and at the greatest.
    pub going: Vec<Going>,
    /// Greatest current of all motors in a start on the whole voltage, A.
    pub start_peak_a: f64,
    /// Time for which it is more than half of that, s.
    pub start_half_s: f64,
    /// Time to 63 % of its greatest speed, s.
    pub start_rise_s: f64,
    /// Speed at which a metre costs least, m/s; null where it is not known what the robot takes at rest, or where it does not move.
    pub cheapest_mps: Option<f64>,
    /// What a metre costs then, J/m.
    pub cheapest_j_per_m: Option<f64>,
    /// The file written; null when none was asked for.
    pub output: Option<String>,
}

impl DriveReport {
    /// Puts a report together, of a sheet and of the model that was made of it.
    #[must_use]
    pub fn of(sheet: &RobotSheet, model: &Arc<Model>, output: Option<String>) -> DriveReport {
        let (drive, battery_v) = (sheet.drive(), sheet.battery_v);
        let top_mps = drive.top_speed_mps(battery_v);
        let standing_w = power_w(model, &[]).value;
        let going = |speed_mps: f64, pitch_rad: f64| {
            let (at, motors_w) = (drive.operating(speed_mps, pitch_rad), drive.power_w(speed_mps, pitch_rad, battery_v));
            let inputs = [(Channel::SpeedMps, speed_mps), (Channel::PitchRad, pitch_rad), (Channel::VoltageV, battery_v)];
            Going {
                speed_mps,
                pitch_deg: pitch_rad.to_degrees(),
                motors_w,
                model_w: power_w(model, &inputs).value - standing_w,
                current_a: at.current_a,
                efficiency: drive.motors * at.wheel_w / motors_w,
                ripple_a: drive.supply(&at, battery_v).map(|supply| supply.ripple_a),
                ripple_w: drive.supply(&at, battery_v).map(|supply| drive.motors * supply.ripple_copper_w),
            }
        };
        let start = drive.start(battery_v);
        let range: RangeInclusive<f64> = SLOWEST * top_mps..=top_mps;
        let cheapest = (sheet.idle_w.is_some() && top_mps > 0.0).then(|| most_economical(model, &[(Channel::VoltageV, battery_v)], range));
        let speeds = if top_mps > 0.0 { vec![(top_mps / 2.0, 0.0), (top_mps / 2.0, RAMP_RAD), (top_mps, 0.0)] } else { Vec::new() };
        // Up a ramp it may not be that fast.
        let reached = |&(speed_mps, pitch_rad): &(f64, f64)| drive.reaches(speed_mps, pitch_rad, battery_v);
        DriveReport {
            schema: 1,
            model: sheet.name.clone(),
            version: env!("CARGO_PKG_VERSION"),
            battery_v,
            parameters: sheet
                .parameters()
                .into_iter()
                .map(|of| DriveParameter { effect: of.effect, name: of.name, value: of.value.value, sigma: of.value.sigma })
                .collect(),
            top_speed_mps: top_mps,
            steepest_deg: drive.steepest_rad(battery_v).to_degrees(),
            going: speeds.into_iter().filter(reached).map(|(speed_mps, pitch_rad)| going(speed_mps, pitch_rad)).collect(),
            start_peak_a: start.peak_a,
            start_half_s: start.half_s,
            start_rise_s: start.rise_s,
            cheapest_mps: cheapest.map(|cheapest| cheapest.speed_mps),
            cheapest_j_per_m: cheapest.map(|cheapest| cheapest.energy_j_per_m.value),
            output,
        }
    }

    /// The report for people.
    #[must_use]
    pub fn human(&self) -> String {
        let mut parameters = table(&["parameter", "value"]);
        numbers_from(&mut parameters, 1);
        for of in &self.parameters {
            let value = if of.value == 0.0 { "0".to_owned() } else { with_sigma(of.value, Some(of.sigma), unit_of(of.name)) };
            parameters.add_row([format!("{}.{}", of.effect, of.name), value]);
        }
        let mut said = format!("{}\n", text(&parameters));
        if self.top_speed_mps <= 0.0 {
            said.push_str(&format!("at {} its motors do not move it on a level floor\n", quantity(self.battery_v, "V")));
            return said;
        }
        let steepest =
            if self.steepest_deg >= 90.0 { "any slope".to_owned() } else { format!("slopes up to {:.1} degrees", self.steepest_deg) };
        said.push_str(&format!(
            "at {}: {} at most on a level floor; its motors push it up {steepest}\n",
            quantity(self.battery_v, "V"),
            quantity(self.top_speed_mps, "m/s")
        ));
        let mut going = table(&["speed", "uphill", "motors take", "by the model", "current of each", "efficiency", "ripple"]);
        numbers_from(&mut going, 0);
        for at in &self.going {
            going.add_row([
                quantity(at.speed_mps, "m/s"),
                format!("{:.1} deg", at.pitch_deg),
                quantity(at.motors_w, "W"),
                quantity(at.model_w, "W"),
                quantity(at.current_a, "A"),
                format!("{:.0} %", 100.0 * at.efficiency),
                at.ripple_a.map_or_else(|| "-".to_owned(), |ripple_a| quantity(ripple_a, "A")),
            ]);
        }
        said.push_str(&format!("{}\n", text(&going)));
        if let Some((at, ripple_w)) =
            self.going.first().and_then(|at| Some((at, at.ripple_w.filter(|ripple_w| *ripple_w > TOLD * at.motors_w)?)))
        {
            said.push_str(&format!(
                "of the {} at {} {} are the ripple of the current, where the bridge conducts both ways; the model has none of it: a log shows it, as \
                 h_bridge.switching_w\n",
                quantity(at.motors_w, "W"),
                quantity(at.speed_mps, "m/s"),
                quantity(ripple_w, "W"),
            ));
        }
        said.push_str(&format!(
            "a start on the whole voltage takes {} from the battery at most, more than half of it for {}; 63 % of the speed after {}\n",
            quantity(self.start_peak_a, "A"),
            quantity(self.start_half_s, "s"),
            quantity(self.start_rise_s, "s")
        ));
        if self.parameters.iter().any(|of| of.effect == "acceleration" && of.value == 0.0) {
            said.push_str("the inertia of rotors and wheels is not in the sheet: a start takes longer than that, and the model counts nothing for them when it speeds up\n");
        }
        match (self.cheapest_mps, self.cheapest_j_per_m) {
            (Some(speed_mps), Some(j_per_m)) => {
                said.push_str(&format!("a metre costs least at {}: {}\n", quantity(speed_mps, "m/s"), quantity(j_per_m, "J/m")));
            }
            _ => said.push_str("what the robot takes at rest is not in the sheet: say idle_w, or let `lab fit` find it\n"),
        }
        said
    }
}
