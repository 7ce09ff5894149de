//! A measured log, replayed as a gauge would have seen it.
//!
//! Columns `time_s`, `current_a`, `voltage_v` and, where it was measured, `temperature_degc`.
//! The current at row k flowed over (t[k-1], t[k]]. A row without a voltage shows nothing, but its charge counts with the next one that has
//! one; over a row without a current flowed what the others say.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use energy::document::hint;
use energy::gauge::Sample;
use energy::units::REFERENCE_DEGC;

use crate::report::{Device, Report};

/// Beyond this, a number in a log is no time, current, voltage or temperature.
const READING_MAX: f64 = 1e9;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    time_s: f64,
    current_a: f64,
    voltage_v: f64,
    temperature_degc: Option<f64>,
}

/// What flowed since the last row that showed a voltage.
#[derive(Debug, Clone, Copy, Default)]
struct Waits {
    charge_as: f64,
    passed_s: f64,
    last_a: Option<f64>,
}

impl Waits {
    /// One row more, with its current where it has one.
    fn and(self, current_a: Option<f64>, time_s: f64, last_s: Option<f64>) -> Self {
        let Some(current_a) = current_a else { return self };
        let passed_s = last_s.map_or(0.0, |last_s| time_s - last_s);
        Self { charge_as: self.charge_as + current_a * passed_s, passed_s: self.passed_s + passed_s, last_a: Some(current_a) }
    }

    /// The mean of these currents, A; none where no row had one.
    fn mean_a(self) -> Option<f64> {
        self.last_a.map(|last_a| if self.passed_s > 0.0 { self.charge_as / self.passed_s } else { last_a })
    }
}

/// A log being replayed.
#[derive(Debug, Clone)]
pub struct Log {
    path: PathBuf,
    rows: Vec<Row>,
    next: usize,
    time_s: f64,
}

impl Log {
    /// Reads a log.
    ///
    /// # Errors
    /// Names file, line and column of what is missing, not a number, or backwards in time.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path);
        let mut reader = reader.with_context(|| format!("cannot read {}", path.display()))?;
        let header = reader.headers().with_context(|| format!("{}:1: no header row", path.display()))?.clone();
        let find = |name: &str| header.iter().position(|column| column == name);
        let need = |name: &str| {
            find(name).with_context(|| {
                let have = header.iter().collect::<Vec<_>>().join(", ");
                format!("{}:1: no column `{name}`, which a replay needs{} The log has: {have}", path.display(), hint(name, header.iter()))
            })
        };
        let [time, current, voltage] = [need("time_s")?, need("current_a")?, need("voltage_v")?];
        let temperature = find("temperature_degc");
        let mut rows: Vec<Row> = Vec::new();
        let (mut waits, mut last_s) = (Waits::default(), None);
        for record in reader.records() {
            let record = record.with_context(|| format!("{}", path.display()))?;
            let line = record.position().map_or(0, csv::Position::line);
            let number = |column: usize| -> anyhow::Result<Option<f64>> {
                let text = &record[column];
                if text.is_empty() {
                    return Ok(None);
                }
                let at = || format!("{}:{line}: column `{}`: `{text}` is not a number", path.display(), &header[column]);
                let value: f64 = text.parse().ok().with_context(at)?;
                ensure!(
                    value.abs() <= READING_MAX,
                    "{}:{line}: column `{}`: {text} is no reading: beyond ±{READING_MAX}",
                    path.display(),
                    &header[column]
                );
                Ok(Some(value))
            };
            let time_s = number(time)?.with_context(|| format!("{}:{line}: `time_s` is empty", path.display()))?;
            let temperature_degc = temperature.map(number).transpose()?.flatten();
            let (current, voltage_v) = (number(current)?, number(voltage)?);
            if current.is_none() && voltage_v.is_none() {
                continue;
            }
            if let Some(last_s) = last_s.filter(|last_s| time_s <= *last_s) {
                bail!("{}:{line}: time_s = {time_s} after {last_s}; time must increase", path.display());
            }
            waits = waits.and(current, time_s, last_s);
            last_s = Some(time_s);
            let (Some(current_a), Some(voltage_v)) = (waits.mean_a(), voltage_v) else { continue };
            waits = Waits::default();
            rows.push(Row { time_s, current_a, voltage_v, temperature_degc });
        }
        ensure!(rows.len() >= 2, "{}: {} rows with current and voltage; at least 2 are needed", path.display(), rows.len());
        let time_s = rows[0].time_s;
        Ok(Self { path: path.to_owned(), rows, next: 1, time_s })
    }

    /// Voltage of the first row, before any interval of current: the rested voltage.
    #[must_use]
    pub fn rest_voltage_v(&self) -> f64 {
        self.rows[0].voltage_v
    }

    /// Temperature of the first row, °C.
    #[must_use]
    pub fn temperature_degc(&self) -> f64 {
        self.rows[0].temperature_degc.unwrap_or(REFERENCE_DEGC)
    }

    /// Mean power over the log, W (discharge positive).
    #[must_use]
    pub fn mean_power_w(&self) -> f64 {
        let span_s = self.rows[self.rows.len() - 1].time_s - self.rows[0].time_s;
        let energy_ws: f64 = self.rows.windows(2).map(|w| w[1].current_a * w[1].voltage_v * (w[1].time_s - w[0].time_s)).sum();
        energy_ws / span_s
    }
}

impl Log {
    /// Whether all of it was shown.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.next >= self.rows.len()
    }

    /// Moves on by `dt_s` seconds of the log; what was measured in rows that these have come to.
    pub fn advance(&mut self, dt_s: f64) -> Option<Sample> {
        let (mut charge_as, mut passed_s, mut last) = (0.0, 0.0, None);
        for (row, interval_s) in self.pass(dt_s) {
            charge_as += row.current_a * interval_s;
            passed_s += interval_s;
            last = Some(*row);
        }
        last.map(|row| Sample {
            dt_s: passed_s,
            current_a: charge_as / passed_s,
            voltage_v: row.voltage_v,
            temperature_degc: row.temperature_degc.unwrap_or(REFERENCE_DEGC),
        })
    }

    /// The rows of the next `dt_s` seconds, each with the time since the one before.
    fn pass(&mut self, dt_s: f64) -> impl Iterator<Item = (&Row, f64)> {
        self.time_s += dt_s;
        let first = self.next;
        self.next += self.rows[first..].iter().take_while(|row| row.time_s <= self.time_s).count();
        self.rows[first - 1..self.next].windows(2).map(|pair| (&pair[1], pair[1].time_s - pair[0].time_s))
    }
}

/// A log stands in for a device; it says nothing after its end.
impl Device for Log {
    fn name(&self) -> String {
        format!("log {}", self.path.display())
    }

    fn read(&mut self, dt_s: f64) -> anyhow::Result<Vec<Report>> {
        ensure!(!self.has_ended(), "the log has ended");
        let report = |(row, _): (&Row, f64)| Report {
            at_s: Some(row.time_s),
            voltage_v: Some(row.voltage_v),
            current_a: Some(row.current_a),
            temperature_degc: row.temperature_degc,
            ..Report::default()
        };
        Ok(self.pass(dt_s).map(report).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn log(text: &str) -> anyhow::Result<Log> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        Log::read(file.path())
    }

    #[test]
    fn charge_is_kept_whatever_the_step() {
        let text = "time_s,current_a,voltage_v\n0,9,4\n10,1,3.9\n30,2,3.8\n40,0,3.85\n";
        for dt_s in [1.0, 7.0, 40.0] {
            let mut replay = log(text).unwrap();
            let mut charge_as = 0.0;
            while !replay.has_ended() {
                charge_as += replay.advance(dt_s).map_or(0.0, |s| s.current_a * s.dt_s);
            }
            // The first row's current flowed before the log: 10 s of 1 A and 20 s of 2 A.
            assert!((charge_as - 50.0).abs() < 1e-9, "{dt_s}: {charge_as}");
        }
    }

    #[test]
    fn what_flowed_in_rows_without_a_voltage_is_not_lost_and_not_taken_for_what_the_next_row_says() {
        // 60 s of 3 A of which nothing but the charge is known, and 20 s of 1 A; over the 10 s without a current flows their mean.
        let mut replay = log("time_s,current_a,voltage_v\n0,1,4\n60,3,\n70,,3.8\n90,1,3.8\n").unwrap();
        let shown: Vec<[f64; 2]> = std::iter::from_fn(|| (!replay.has_ended()).then(|| replay.advance(10.0)))
            .flatten()
            .map(|sample| [sample.dt_s, sample.current_a])
            .collect();
        assert_eq!(shown, [[70.0, 3.0], [20.0, 1.0]]);
    }

    #[test]
    fn bad_logs_are_refused_with_the_place() {
        let message = |text| format!("{:#}", log(text).unwrap_err());
        assert!(message("time_s,current_a,volts\n0,1,4\n").contains("no column `voltage_v`"));
        assert!(message("time_s,current_a,voltage_v\n0,1,4\n5,one,4\n").contains(":3: column `current_a`: `one` is not a number"));
        assert!(message("time_s,current_a,voltage_v\n5,1,4\n4,1,4\n").contains(":3: time_s = 4 after 5"));
        assert!(message("time_s,current_a,voltage_v\n5,NaN,4\n").contains("NaN is no reading"));
        assert!(message("").contains("no column"));
    }
}
