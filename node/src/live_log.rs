//! Logs of a running agent: what its source showed, row by row on disk, as the lab reads it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use energy::gauge::Sample;
use energy::{Channel, Estimate};
use proto::Gauge;
use tracing::{info, warn};

use crate::Telemetry;

/// Rows that wait for a disk on which they find no place, bytes for each log: some hours of one row a second.
const WAITING_BYTES_MAX: usize = 1024 * 1024;

/// A folder of logs in the making. Times are given by a clock that nobody sets (see [`Pace`](crate::Pace)), and written from the first row of
/// all on.
#[derive(Debug)]
pub struct LiveLog {
    folder: PathBuf,
    telemetry: Telemetry,
    start_s: Option<f64>,
    batteries: BTreeMap<String, Battery>,
    tables: Vec<String>,
    /// What is new could not be written, and this was said.
    failing: bool,
}

#[derive(Debug, Default)]
struct Battery {
    /// Packs that were put in so far: each has its own log.
    exchanges: u32,
    /// Full-equivalent cycles, by the last word of its gauge.
    cycles: f64,
    opened: bool,
}

impl LiveLog {
    /// Logs into this folder, which is made with the first row.
    #[must_use]
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, telemetry: Telemetry::default(), start_s: None, batteries: BTreeMap::new(), tables: Vec::new(), failing: false }
    }

    fn time_s(&mut self, now_s: f64, dt_s: f64) -> f64 {
        let time_s = now_s - *self.start_s.get_or_insert(now_s - dt_s);
        // To the millisecond, as clocks are read.
        (time_s * 1000.0).round() / 1000.0
    }

    /// A battery's sample, before its gauge has seen it: `soc` is what the gauge starts from, and
    /// `exchanged` the charge of another pack that was just put in.
    pub fn battery(&mut self, now_s: f64, name: &str, sample: &Sample, soc: Estimate, exchanged: Option<Estimate>) {
        let time_s = self.time_s(now_s, sample.dt_s);
        let battery = self.batteries.entry(name.to_owned()).or_default();
        battery.exchanges += u32::from(exchanged.is_some() && battery.opened);
        let stem = stem(name, battery.exchanges);
        if !battery.opened || exchanged.is_some() {
            self.telemetry.live_battery(&stem, time_s - sample.dt_s, exchanged.unwrap_or(soc), sample.temperature_degc);
            battery.opened = true;
        }
        self.telemetry.live_battery_row(&stem, time_s, sample, battery.cycles);
    }

    /// What a battery's gauge says: the cycles that it has counted.
    pub fn gauge(&mut self, name: &str, gauge: &Gauge) {
        if let (Some(battery), Some(cycles)) = (self.batteries.get_mut(name), gauge.cycles) {
            battery.cycles = cycles;
        }
    }

    /// A row of any other log: channels with their values, then further columns as text.
    pub fn row(&mut self, now_s: f64, dt_s: f64, stem: &str, channels: &[(Channel, f64)], further: &[(String, String)]) {
        let time_s = self.time_s(now_s, dt_s);
        if !self.tables.iter().any(|known| known == stem) {
            let names: Vec<&str> =
                channels.iter().map(|(channel, _)| channel.name()).chain(further.iter().map(|(name, _)| name.as_str())).collect();
            self.telemetry.table(stem, &names.join(","));
            self.tables.push(stem.to_owned());
        }
        let mut row = format!("{time_s}");
        for (_, value) in channels {
            write!(row, ",{:.5}", value + 0.0).expect("a text can be written to");
        }
        for (_, text) in further {
            write!(row, ",{text}").expect("a text can be written to");
        }
        self.telemetry.row(stem, format_args!("{row}"));
    }

    /// Puts what is new on disk. What finds no place there waits, and this is said once: a log is no reason for an agent to end. A log of
    /// which too much waits goes on in a new file, without what waited.
    pub fn flush(&mut self) {
        let Err(error) = self.telemetry.append(&self.folder) else {
            if std::mem::take(&mut self.failing) {
                info!("logs in {} are written again", self.folder.display());
            }
            return;
        };
        if !std::mem::replace(&mut self.failing, true) {
            warn!("{error:#}: what is to be logged waits");
        }
        let left_out = self.telemetry.leave_out_beyond(WAITING_BYTES_MAX);
        if left_out.is_empty() {
            return;
        }
        warn!("too much waits to be logged, and is left out: {}", left_out.join(", "));
        self.tables.retain(|table| !left_out.contains(table));
        for (name, battery) in &mut self.batteries {
            battery.opened &= !left_out.contains(&stem(name, battery.exchanges));
        }
    }
}

fn stem(name: &str, exchanges: u32) -> String {
    if exchanges == 0 { name.to_owned() } else { format!("{name}-pack-{}", exchanges + 1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_pack_has_another_log_and_cycles_are_those_of_the_gauge() {
        let folder = tempfile::tempdir().unwrap();
        let mut log = LiveLog::new(folder.path().to_owned());
        let sample = Sample { dt_s: 1.0, current_a: 0.4, voltage_v: 11.5, temperature_degc: 25.0 };
        let soc = Estimate::new(0.5, 0.01);
        log.battery(500.0, "r1", &sample, soc, None);
        log.battery(501.0, "r1", &sample, soc, None);
        log.battery(502.0, "r1", &sample, soc, Some(Estimate::new(0.98, 0.02)));
        log.row(502.0, 1.0, "r1-load", &[(Channel::PowerW, 4.6), (Channel::SpeedMps, 0.1)], &[("note".to_owned(), "x".to_owned())]);
        log.flush();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        assert_eq!(read("r1.csv").lines().count(), 4);
        assert!(read("r1-pack-2.csv").ends_with("\n2,,,,\n3,0.4000,11.5000,25.00,0.0000\n"), "{}", read("r1-pack-2.csv"));
        assert!(read("r1-pack-2.toml").contains("soc_initial = 0.98\n"));
        assert_eq!(read("r1-load.csv"), "time_s,power_w,speed_mps,note\n3,4.60000,0.10000,x\n");
    }

    #[test]
    fn a_disk_that_takes_nothing_ends_no_agent_and_what_waited_too_long_is_left_out_whole() {
        let folder = tempfile::tempdir().unwrap();
        let logs = folder.path().join("logs");
        // A file where the folder should be.
        std::fs::write(&logs, "").unwrap();
        let mut log = LiveLog::new(logs.clone());
        let sample = Sample { dt_s: 1.0, current_a: 0.4, voltage_v: 11.5, temperature_degc: 25.0 };
        let row = |log: &mut LiveLog, second: u32, soc: f64| {
            log.battery(f64::from(second), "r1", &sample, Estimate::new(soc, 0.01), None);
            log.row(f64::from(second), 1.0, "r1-load", &[(Channel::PowerW, 4.6)], &[]);
        };
        (1..=10).for_each(|second| row(&mut log, second, 0.9));
        log.flush();
        assert!(log.failing);
        (11..=40_000).for_each(|second| row(&mut log, second, 0.9));
        log.flush();
        row(&mut log, 40_001, 0.5);
        std::fs::remove_file(&logs).unwrap();
        log.flush();
        assert!(!log.failing);
        // The battery's log was too long to wait, that of the load was not.
        let read = |name: &str| std::fs::read_to_string(logs.join(name)).unwrap();
        assert!(read("r1.csv").ends_with("\n40000,,,,\n40001,0.4000,11.5000,25.00,0.0000\n"), "{}", read("r1.csv"));
        assert_eq!(read("r1.csv").lines().count(), 3);
        assert!(read("r1.toml").contains("soc_initial = 0.5\n"));
        assert_eq!(read("r1-load.csv").lines().count(), 40_002);
    }
}
