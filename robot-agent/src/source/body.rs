//! A real robot beside its battery: the program that drives it, and where it is, as far as that
//! program and the charger's current tell.

use std::io::Read as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use anyhow::ensure;
use energy::units::REFERENCE_DEGC;
use rustix::process::{Pid, Signal, kill_process};
use serde::{Deserialize, Serialize};
use tracing::{info, warn};

use super::device::Supply;
use super::{Act, Place};

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
        Self { drive: Vec::new(), ambient_degc: REFERENCE_DEGC, soc_sigma: 0.05 }
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
        let ambient_degc = self.ambient_degc;
        ensure!((-60.0..=100.0).contains(&ambient_degc), "body.ambient_degc = {ambient_degc}: must be between -60 and 100");
        ensure!((0.0001..=0.5).contains(&self.soc_sigma), "body.soc_sigma = {}: must be between 0.0001 and 0.5", self.soc_sigma);
        ensure!(self.drive.first().is_none_or(|program| !program.is_empty()), "body.drive: its first entry is a program");
        Ok(())
    }
}

/// An act under way.
#[derive(Debug)]
struct Doing {
    said: String,
    child: Child,
    printed: String,
}

impl Doing {
    /// Takes what has been printed by now; what matters is the end of it.
    fn hear(&mut self) {
        let Some(stdout) = &mut self.child.stdout else { return };
        let mut bytes = [0; 4096];
        // It does not wait: `begin` has said so, and what the program has started may hold the pipe.
        while let Ok(read @ 1..) = stdout.read(&mut bytes) {
            self.printed.push_str(&String::from_utf8_lossy(&bytes[..read]));
            let beyond = self.printed.len().saturating_sub(bytes.len());
            self.printed.drain(..self.printed.ceil_char_boundary(beyond));
        }
    }
}

/// The program that makes the robot act. It is started anew for every act with the act as its last
/// arguments: `travel_to STATION [BAY]`, `charge`, `stop_charging` or `resume`. It ends when that is
/// done, with exit status 0; the last line that it prints may say where the robot is then:
/// `mission`, `underway`, `at_station` or `in_bay`. Another act ends it before its time (SIGTERM).
#[derive(Debug)]
pub struct Hands {
    program: Vec<String>,
    running: Option<Doing>,
    place: Place,
    powered: bool,
    trouble: Option<String>,
}

impl Hands {
    /// The hands of a robot at work.
    #[must_use]
    pub fn new(program: Vec<String>) -> Self {
        if let Some(name) = program.first().filter(|name| !is_found(name)) {
            warn!("body.drive: there is no program {name}: the robot will do nothing that it is asked to");
        }
        Self { program, running: None, place: Place::Mission, powered: false, trouble: None }
    }

    /// Begins an act.
    pub fn begin(&mut self, act: &Act) {
        let arguments: Vec<String> = match act {
            Act::TravelTo { station, bay } => {
                let bay = bay.iter().map(ToString::to_string);
                ["travel_to".to_owned(), station.to_string()].into_iter().chain(bay).collect()
            }
            Act::Charge => vec!["charge".to_owned()],
            Act::StopCharging => vec!["stop_charging".to_owned()],
            Act::Resume => vec!["resume".to_owned()],
        };
        match act {
            Act::TravelTo { .. } => self.place = Place::Underway,
            Act::Resume if !self.powered => self.place = Place::Mission,
            _ => {}
        }
        let said = arguments.join(" ");
        self.stop();
        let Some((program, first)) = self.program.split_first() else {
            info!("asked to {said}: no body.drive is set, so nobody does it");
            return;
        };
        let command = Command::new(program).args(first).args(&arguments).stdin(Stdio::null()).stdout(Stdio::piped()).spawn();
        self.trouble = None;
        match command {
            Ok(child) => {
                if let Some(stdout) = &child.stdout {
                    let _ = rustix::io::ioctl_fionbio(stdout, true);
                }
                self.running = Some(Doing { said, child, printed: String::new() });
            }
            Err(error) => self.fail(format!("body.drive: {program} {said}: {error}")),
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

    /// Where the robot is.
    pub fn place(&mut self) -> Place {
        self.watch();
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
        let Some(doing) = &mut self.running else { return };
        let ended = doing.child.try_wait();
        doing.hear();
        let said = &doing.said;
        let ended = match ended {
            Ok(None) => return,
            Ok(Some(status)) if status.success() => Ok(()),
            Ok(Some(status)) => Err(format!("body.drive: `{said}` failed: {status}")),
            Err(error) => Err(format!("body.drive: `{said}`: {error}")),
        };
        let travelled = said.starts_with("travel_to");
        let told = doing.printed.lines().rev().find_map(|line| place_named(line.trim()));
        self.running = None;
        if let Err(what) = ended {
            return self.fail(what);
        }
        match told {
            Some(place) => self.place = place,
            None if travelled && self.place == Place::Underway => self.place = Place::AtStation,
            None => {}
        }
    }

    fn fail(&mut self, what: String) {
        warn!("{what}");
        self.trouble = Some(what);
    }

    /// Asks the program to end, and waits for it no longer than it needs.
    fn stop(&mut self) {
        let Some(Doing { said, mut child, .. }) = self.running.take() else { return };
        info!("`{said}` is not waited for any longer");
        if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
            let _ = kill_process(pid, Signal::TERM);
        }
        // Reaped apart, so that nobody waits for a program that does not listen.
        std::thread::spawn(move || child.wait());
    }
}

impl Drop for Hands {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Whether a program is there, by its path or in the folders of PATH.
fn is_found(name: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    name.contains('/') && Path::new(name).is_file()
        || !name.contains('/') && std::env::split_paths(&folders).any(|at| at.join(name).is_file())
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
