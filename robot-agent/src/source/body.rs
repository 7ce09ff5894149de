//! A real robot beside its battery: the program that drives it, and where it is, as far as that
//! program and the charger's current tell.

use anyhow::anyhow;
use device::program::{Ended, retry_s};
use device::{Program, Supply, Unmeasured};
use serde::{Deserialize, Serialize};
use tracing::warn;

use super::{Act, Held, Place};

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

/// Time for which something must feed a robot that may be moving before that is a bay, s: longer than brakes give current back. A guess.
const FELT_S: f64 = 10.0;
/// Time without being fed after which a robot whose charge was ended has left its bay, s, where no station says so: longer than a lift takes to
/// let it down. A guess.
const LET_OUT_S: f64 = 120.0;
/// Time without being fed after which a robot whose charge was not ended is elsewhere, s, where no station says so: longer than a hot pack
/// cools or a station is dark. A guess.
const LEFT_S: f64 = 3600.0;
/// A program that has been at an act for longer, s, or has failed so often, moves nothing any more: as long as stations give theirs. A guess.
const DRIVES_S: f64 = 900.0;
const FAILURES_MAX: u32 = 5;

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
    /// Whether something feeds it, by the last report that tells, and for how long reports have said that, s.
    felt: (Supply, f64),
    /// Time since the last report, s.
    unheard_s: f64,
    /// Whether something has fed it where it is.
    was_fed: bool,
    /// Whether nothing of a charge goes on: what feeds it no more has been left.
    is_over: bool,
    /// What its station says of it.
    held: Held,
    /// Whether that was once that it has the robot in the bay where it is.
    was_held: bool,
    /// Whether its program has said that it has left a bay, since it was last sent to one.
    has_come_out: bool,
    /// For how long the program has been at what it was asked last, s.
    driving_s: f64,
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
        let (place, felt) = (Place::Mission, (Supply::Unknown, 0.0));
        let (powered, was_fed, is_over) = (false, false, true);
        let (held, was_held, has_come_out, driving_s) = (Held::Unheard, false, false, 0.0);
        let (trouble, asked, again_in_s) = (None, Vec::new(), None);
        Self {
            program,
            place,
            powered,
            felt,
            unheard_s: 0.0,
            was_fed,
            is_over,
            held,
            was_held,
            has_come_out,
            driving_s,
            trouble,
            asked,
            again_in_s,
            failures: 0,
        }
    }

    /// Takes in where the robot stood when its agent was stopped; a bay feeds it until something else is felt. Whether its charge goes on
    /// is not known.
    pub fn stand(&mut self, place: Place) {
        let is_fed = place == Place::InBay;
        (self.place, self.powered, self.was_fed, self.is_over) = (place, is_fed, is_fed, !is_fed);
    }

    /// Takes in what its station says of it.
    pub fn held(&mut self, held: Held) {
        if held == Held::Unheard && self.held != Held::Unheard {
            // For how long nothing has fed it counts from here: until now its station knew better.
            self.felt.1 = 0.0;
        }
        self.held = held;
    }

    /// Begins an act.
    pub fn begin(&mut self, act: &Act) {
        // It is at it already, or tries again: begun anew it would only take longer.
        let is_at_it = self.program.is_running() || self.program.is_ending() || self.again_in_s.is_some();
        if *act == Act::Charge && self.asked == ["charge"] && is_at_it {
            return;
        }
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
        self.is_over = matches!(act, Act::StopCharging | Act::Resume);
        match act {
            Act::TravelTo { .. } | Act::GoOnTo { .. } => (self.was_held, self.has_come_out) = (false, false),
            Act::Resume => self.was_held = false,
            Act::Charge | Act::StopCharging => {}
        }
        self.driving_s = 0.0;
        if self.is_over {
            // That nothing fed it before says nothing of where it is after.
            self.felt.1 = 0.0;
        }
        (self.trouble, self.asked, self.failures) = (None, arguments, 0);
        self.program.stop();
        self.again_in_s = Some(0.0);
        self.start_when_due(0.0);
    }

    /// Starts what was asked last when it is time to. Two programs would steer one robot: not before another one has ended.
    fn start_when_due(&mut self, dt_s: f64) {
        match &mut self.again_in_s {
            Some(left_s) if *left_s <= dt_s && !self.program.is_ending() => self.start(),
            Some(left_s) => *left_s = (*left_s - dt_s).max(0.0),
            None => {}
        }
    }

    fn start(&mut self) {
        self.again_in_s = None;
        if let Err(what) = self.program.begin(&self.asked) {
            self.fail(what);
        }
    }

    /// Takes in whether something feeds the robot.
    pub fn feel(&mut self, supply: Supply) {
        let passed_s = std::mem::take(&mut self.unheard_s);
        // What stands at a station, or in a bay by its program's word, gives nothing back by its brakes.
        if supply == Supply::Connected && matches!(self.place, Place::AtStation | Place::InBay) {
            (self.powered, self.was_fed, self.place) = (true, true, Place::InBay);
        }
        match (supply, self.felt.0) {
            (same, felt) if same == felt => self.felt.1 += passed_s,
            // No current either way, after one that went in: that was nothing that lasts.
            (Supply::Unknown, Supply::Connected) => self.felt = (Supply::Unknown, 0.0),
            (Supply::Unknown, _) => {}
            (other, _) => self.felt = (other, 0.0),
        }
    }

    /// Whether its program moves it.
    fn is_driven(&self) -> bool {
        (self.program.is_running() || self.program.is_ending()) && self.driving_s < DRIVES_S
    }

    /// What feeds it for some time is a bay, and so is where its station says that it stands.
    fn locate(&mut self, dt_s: f64) {
        self.unheard_s += dt_s;
        self.driving_s += dt_s;
        let (supply, for_s) = self.felt;
        let drives = self.program.is_set() && self.place == Place::Underway;
        match supply {
            _ if for_s < FELT_S => {}
            Supply::Connected if !drives => (self.powered, self.was_fed, self.place) = (true, true, Place::InBay),
            Supply::Connected | Supply::Unknown => {}
            Supply::Absent => self.powered = false,
        }
        // Chargers that give only when they are asked to show nothing before.
        let is_moved = self.is_driven() || self.again_in_s.is_some() || self.has_come_out;
        if self.held == Held::InBay && self.place == Place::AtStation && !is_moved {
            self.place = Place::InBay;
        }
        if self.place == Place::InBay {
            self.was_held |= matches!(self.held, Held::InBay | Held::LetsOut);
            if self.has_left() {
                (self.place, self.powered, self.was_fed, self.was_held) = (Place::AtStation, false, false, false);
            }
        }
    }

    /// Whether it is in its bay no longer, where it cannot drive out by itself: its station has let it out. Otherwise that nothing has fed it
    /// for long must do, as of a station that has forgotten it; if its charge is not over, the bay may be dark, or a hot or cold battery take
    /// nothing for a while, and where a station is not heard any more that had it in a bay, its lift may still hold it.
    fn has_left(&self) -> bool {
        let (supply, for_s) = self.felt;
        match self.held {
            Held::InBay | Held::TakesIn | Held::LetsOut => false,
            _ if self.is_driven() => false,
            Held::Out => supply != Supply::Connected,
            Held::No | Held::Unheard => {
                let is_tried_again = self.again_in_s.is_some() && self.failures < FAILURES_MAX;
                let is_soon = self.is_over && (self.held == Held::No || !self.was_held);
                let has_left_s = if is_soon { LET_OUT_S } else { LEFT_S };
                supply == Supply::Absent && (self.was_fed || self.was_held) && for_s >= has_left_s && !is_tried_again
            }
        }
    }

    /// Where the robot is after another `dt_s` seconds.
    pub fn place(&mut self, dt_s: f64) -> Place {
        self.watch();
        self.start_when_due(dt_s);
        self.locate(dt_s);
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
        let Some(Ended { said, printed, result, .. }) = self.program.ended() else { return };
        if let Err(what) = result {
            return self.fail(what);
        }
        self.trouble = None;
        let travelled = said.starts_with("travel_to");
        let told = printed.lines().rev().find_map(|line| place_named(line.trim()));
        match told {
            // What was felt was felt where it was before, but for what feeds it in the bay that it has come to.
            Some(place) => {
                self.has_come_out |= self.place == Place::InBay && place != Place::InBay;
                self.was_held &= place == Place::InBay;
                let is_fed = place == Place::InBay && (self.powered || self.felt.0 == Supply::Connected);
                (self.place, self.powered, self.was_fed, self.felt) = (place, is_fed, is_fed, (Supply::Unknown, 0.0));
            }
            // It has driven to where something feeds it.
            None if travelled && self.place == Place::Underway && self.felt.0 == Supply::Connected => {
                (self.powered, self.was_fed, self.place) = (true, true, Place::InBay);
            }
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
