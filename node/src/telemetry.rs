//! Logs as the lab reads them: one CSV for each battery, robot load and station, with a TOML of facts
//! beside it. The simulator writes them at its end, an agent as it goes.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use energy::gauge::Sample;
use energy::{Channel, Estimate};

use crate::log_file::LogFile;

/// Inputs of a station's model, as its log has them.
pub const STATION_INPUTS: [Channel; 6] = [
    Channel::ChargePowerW,
    Channel::RobotsDocked,
    Channel::RobotsCharging,
    Channel::BaySquaredCurrentA2,
    Channel::SelectorEvents,
    Channel::LiftActive,
];

/// What a robot's load log holds beside its power: whatever an effect of a robot may ask for.
pub const LOAD_INPUTS: [Channel; 13] = [
    Channel::VoltageV,
    Channel::SpeedMps,
    Channel::AccelMps2,
    Channel::PitchRad,
    Channel::PayloadKg,
    Channel::YawRateRadps,
    Channel::FloorClass,
    Channel::TailAngleRad,
    Channel::CpuMhz,
    Channel::CpuUtil,
    Channel::RadioTxDbm,
    Channel::RadioDuty,
    Channel::CameraOn,
];

/// Columns of a robot's load log after its time.
#[must_use]
pub fn load_columns() -> String {
    format!("power_w,{}", LOAD_INPUTS.map(Channel::name).join(","))
}

/// Logs in the making, by file stem.
#[derive(Debug, Clone, Default)]
pub struct Telemetry {
    logs: BTreeMap<String, Log>,
    /// Which run of its agent this is, by the files in the folder; 0 before the first is begun.
    run: u32,
}

#[derive(Debug, Clone, Default)]
struct Log {
    /// Rows that are not on disk yet; the header is the first of them.
    rows: String,
    facts: String,
    /// Where it is written, once that has been begun.
    file: Option<LogFile>,
}

impl Telemetry {
    /// Opens a battery's log at `time_s`; `soc` is what its gauge started from. The first row has
    /// no measurement: it says from when on charge is counted.
    pub fn battery(&mut self, stem: &str, time_s: f64, soc: Estimate, ambient_degc: f64) {
        let facts = format!(
            "schema = 1\nid = \"{stem}\"\nsoc_initial = {}\nsoc_initial_sigma = {}\nambient_degc = {ambient_degc}\n",
            soc.value, soc.sigma
        );
        let rows = format!("time_s,current_a,voltage_v,temperature_degc,ambient_degc\n{time_s},,,,{ambient_degc}\n");
        self.logs.insert(stem.to_owned(), Log { rows, facts, file: None });
    }

    /// A row of a battery's log: what its sensors showed at `time_s`.
    pub fn battery_row(&mut self, stem: &str, time_s: f64, sample: &Sample, ambient_degc: f64) {
        let Sample { current_a, voltage_v, temperature_degc, .. } = sample;
        self.row(stem, format_args!("{time_s},{current_a:.4},{voltage_v:.4},{temperature_degc:.2},{ambient_degc}"));
    }

    /// Opens a log with these columns after `time_s`.
    pub fn table(&mut self, stem: &str, columns: &str) {
        let facts = format!("schema = 1\nid = \"{stem}\"\n");
        self.logs.insert(stem.to_owned(), Log { rows: format!("time_s,{columns}\n"), facts, file: None });
    }

    /// Opens a log with these columns unless it is open.
    pub fn table_once(&mut self, stem: &str, columns: &str) {
        if !self.logs.contains_key(stem) {
            self.table(stem, columns);
        }
    }

    /// A row of any log; nothing when no such log was opened.
    pub fn row(&mut self, stem: &str, row: std::fmt::Arguments<'_>) {
        if let Some(log) = self.logs.get_mut(stem) {
            writeln!(log.rows, "{row}").expect("a text can be written to");
        }
    }

    /// Opens a live battery's log: as [`Telemetry::battery`], with the cycles that its gauge counted.
    /// Nobody measures the surroundings: they are taken to be as warm as the pack was when the log
    /// began, and the facts say so.
    pub fn live_battery(&mut self, stem: &str, time_s: f64, soc: Estimate, temperature_degc: f64) {
        let facts = format!(
            "schema = 1\nid = \"{stem}\"\nsoc_initial = {}\nsoc_initial_sigma = {}\nambient_degc = {temperature_degc}\n\
             source = \"ambient_degc is the pack's temperature when the log began\"\n",
            soc.value, soc.sigma
        );
        let rows = format!("time_s,current_a,voltage_v,temperature_degc,cycle_count\n{time_s},,,,\n");
        self.logs.insert(stem.to_owned(), Log { rows, facts, file: None });
    }

    /// A row of a live battery's log.
    pub fn live_battery_row(&mut self, stem: &str, time_s: f64, sample: &Sample, cycles: f64) {
        let Sample { current_a, voltage_v, temperature_degc, .. } = sample;
        self.row(stem, format_args!("{time_s},{current_a:.4},{voltage_v:.4},{temperature_degc:.2},{cycles:.4}"));
    }

    /// Adds what is new to the files of every log in a folder, which is made when it is not there. Logs of another run stay as they are:
    /// this one's files are numbered then, `r1.2.csv` (two runs in one log would be one run that never was).
    ///
    /// # Errors
    /// When the folder or a file cannot be written: what was to be written waits for the next time.
    pub fn append(&mut self, folder: &Path) -> anyhow::Result<()> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let mut all = Ok(());
        for (stem, log) in self.logs.iter_mut().filter(|(_, log)| !log.rows.is_empty()) {
            all = all.and(log.append(folder, stem, &mut self.run));
        }
        all
    }

    /// Leaves out every log of which more than `bytes` wait to be written, and says which: it is to be opened anew, for what flowed
    /// between its last row and the next would be told wrongly.
    pub fn leave_out_beyond(&mut self, bytes: usize) -> Vec<String> {
        let beyond: Vec<String> = self.logs.iter().filter(|(_, log)| log.rows.len() > bytes).map(|(stem, _)| stem.clone()).collect();
        self.logs.retain(|stem, _| !beyond.contains(stem));
        beyond
    }

    /// Writes every log into a folder, which is made when it is not there.
    ///
    /// # Errors
    /// When the folder cannot be made or written to.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        for (stem, log) in &self.logs {
            crate::files::write_text(&folder.join(format!("{stem}.csv")), &log.rows)?;
            crate::files::write_text(&folder.join(format!("{stem}.toml")), &log.facts)?;
        }
        Ok(())
    }
}

impl Log {
    fn append(&mut self, folder: &Path, stem: &str, run: &mut u32) -> anyhow::Result<()> {
        let file = match &mut self.file {
            Some(file) => file,
            None => {
                let (file, number) = LogFile::begin(folder, stem, *run, &self.facts)?;
                *run = number.max(*run);
                self.file.insert(file)
            }
        };
        file.add(&self.rows)?;
        self.rows.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_grows_as_it_goes_and_that_of_another_run_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let mut telemetry = Telemetry::default();
        telemetry.live_battery("r1", 0.0, Estimate::new(0.8, 0.01), 25.0);
        let sample = Sample { dt_s: 1.0, current_a: 0.4, voltage_v: 11.5, temperature_degc: 25.0 };
        telemetry.live_battery_row("r1", 1.0, &sample, 3.25);
        telemetry.append(folder.path()).unwrap();
        telemetry.live_battery_row("r1", 2.0, &sample, 3.25);
        telemetry.append(folder.path()).unwrap();
        telemetry.append(folder.path()).unwrap();
        let text = std::fs::read_to_string(folder.path().join("r1.csv")).unwrap();
        assert_eq!(
            text,
            "time_s,current_a,voltage_v,temperature_degc,cycle_count\n0,,,,\n1,0.4000,11.5000,25.00,3.2500\n2,0.4000,11.5000,25.00,3.2500\n"
        );
        assert!(std::fs::read_to_string(folder.path().join("r1.toml")).unwrap().contains("soc_initial = 0.8\n"));
        // Another run, of which the second log begins later: one number is for all of it.
        let mut other = Telemetry::default();
        other.live_battery("r1", 0.0, Estimate::new(0.5, 0.01), 25.0);
        other.append(folder.path()).unwrap();
        other.table("r1-load", "power_w");
        other.append(folder.path()).unwrap();
        let names = ["r1.csv", "r1.toml", "r1.2.csv", "r1.2.toml", "r1-load.2.csv", "r1-load.2.toml"];
        assert!(names.iter().all(|name| folder.path().join(name).is_file()));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), names.len());
        assert_eq!(std::fs::read_to_string(folder.path().join("r1.csv")).unwrap(), text);
    }
}
