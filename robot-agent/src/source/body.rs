//! A real robot beside its battery: the program that drives it, and where it is, as far as that
//! program and the charger's current tell.

use anyhow::anyhow;
use device::program::{Ended, retry_s};
use device::{Program, Supply, Unmeasured};
use serde::{Deserialize, Serialize};
use tracing::warn;

use super::{Act, Place};

/// The key of the configuration that names the program.
const KEY: &str = "body.drive";

/// `[body]`: what is true of a real robot, whatever measures its battery.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Body {
    /// Program, with its first arguments, that makes the robot act; see [`Hands`]. Without it the
    /// robot is only watched.
    pub drive: Vec<String>,
    /// Temperature taken where nothing measures the battery's, °C.
    pub ambient_degc: f64,
    /// How far a device's own state of charge may be off (standard deviation) where it does not say.
    pub soc_sigma: f64,
}

impl Default for Body {
    fn default() -> Self {
        let Unmeasured { ambient_degc, soc_sigma } = Unmeasured::default();
        Self { drive: Vec::new(), ambient_degc, soc_sigma }
    }
}

impl Body {
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn check(&self) -> anyhow::Result<()> {
        self.unmeasured().check().map_err(|error| anyhow!("body.{error}"))?;
        Program::check(KEY, &self.drive)
    }

    /// What stands in for what a device does not measure.
    #[must_use]
    pub fn unmeasured(&self) -> Unmeasured {
        Unmeasured { ambient_degc: self.ambient_degc, soc_sigma: self.soc_sigma }
    }
}

/// The program that makes the robot act. It is started anew for every act with the act as its last
/// arguments: `travel_to STATION [BAY]`, `charge`, `stop_charging` or `resume`. It ends when that is
/// done, with exit status 0; the last line that it prints may say where the robot is then:
/// `mission`, `underway`, `at_station` or `in_bay`. Another act ends it before its time (SIGTERM). What fails is begun
/// again, later each time, until something else is asked.
#[derive(Debug)]
pub struct Hands {
    program: Program,
    place: Place,
    powered: bool,
    trouble: Option<String>,
    /// What was asked last, until it is done.
    asked: Vec<String>,
    /// Time until what failed is begun again, s; none while nothing waits for that.
    again_in_s: Option<f64>,
    /// How often it failed.
    failures: u32,
}

impl Hands {
    /// The hands of a robot at work.
    #[must_use]
    pub fn new(drive: Vec<String>) -> Self {
        let program = Program::new(KEY, drive);
        program.look_for();
        Self { program, place: Place::Mission, powered: false, trouble: None, asked: Vec::new(), again_in_s: None, failures: 0 }
    }

    /// Takes in where the robot stood when its agent was stopped; a bay feeds it until something else is felt.
    pub fn stand(&mut self, place: Place) {
        (self.place, self.powered) = (place, place == Place::InBay);
    }

    /// Begins an act.
    pub fn begin(&mut self, act: &Act) {
        let arguments: Vec<String> = match act {
            Act::TravelTo { station, bay } | Act::GoOnTo { station, bay } => {
                let bay = bay.iter().map(ToString::to_string);
                ["travel_to".to_owned(), station.to_string()].into_iter().chain(bay).collect()
            }
            Act::Charge => vec!["charge".to_owned()],
            Act::StopCharging => vec!["stop_charging".to_owned()],
            Act::Resume => vec!["resume".to_owned()],
        };
        match act {
            Act::TravelTo { .. } => self.place = Place::Underway,
            // Where nobody drives it, it stays where it is.
            Act::GoOnTo { .. } if self.program.is_set() => self.place = Place::Underway,
            Act::Resume if !self.powered => self.place = Place::Mission,
            _ => {}
        }
        (self.trouble, self.asked, self.failures) = (None, arguments, 0);
        self.start();
    }

    fn start(&mut self) {
        self.again_in_s = None;
        if let Err(what) = self.program.begin(&self.asked) {
            self.fail(what);
        }
    }

    /// Takes in whether something feeds the robot.
    pub fn feel(&mut self, supply: Supply) {
        match (supply, self.place) {
            (Supply::Connected, _) => (self.powered, self.place) = (true, Place::InBay),
            (Supply::Absent, Place::InBay) if self.powered => (self.powered, self.place) = (false, Place::AtStation),
            (Supply::Absent, _) => self.powered = false,
            (Supply::Unknown, _) => {}
        }
    }

    /// Where the robot is after another `dt_s` seconds.
    pub fn place(&mut self, dt_s: f64) -> Place {
        self.watch();
        match &mut self.again_in_s {
            Some(left_s) if *left_s <= dt_s => self.start(),
            Some(left_s) => *left_s -= dt_s,
            None => {}
        }
        self.place
    }

    /// Whether something feeds it.
    #[must_use]
    pub fn powered(&self) -> bool {
        self.powered
    }

    /// What went wrong with the last act.
    #[must_use]
    pub fn trouble(&self) -> Option<String> {
        self.trouble.clone()
    }

    /// Sees whether the program has ended, and what it says.
    fn watch(&mut self) {
        let Some(Ended { said, printed, result }) = self.program.ended() else { return };
        if let Err(what) = result {
            return self.fail(what);
        }
        self.trouble = None;
        let travelled = said.starts_with("travel_to");
        let told = printed.lines().rev().find_map(|line| place_named(line.trim()));
        match told {
            Some(place) => self.place = place,
            None if travelled && self.place == Place::Underway => self.place = Place::AtStation,
            None => {}
        }
    }

    fn fail(&mut self, what: String) {
        self.failures += 1;
        let wait_s = retry_s(self.failures);
        warn!("{what}; again in {wait_s} s");
        (self.trouble, self.again_in_s) = (Some(what), Some(wait_s));
    }
}

fn place_named(text: &str) -> Option<Place> {
    match text {
        "mission" => Some(Place::Mission),
        "underway" => Some(Place::Underway),
        "at_station" => Some(Place::AtStation),
        "in_bay" => Some(Place::InBay),
        _ => None,
    }
}
