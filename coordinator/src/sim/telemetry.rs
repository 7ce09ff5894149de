//! Logs of a run as the lab reads them: one CSV for each battery, robot load and station, with
//! a TOML of facts beside it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use energy::Estimate;
use energy::gauge::Sample;

/// Logs in the making, by file stem.
#[derive(Debug, Clone, Default)]
pub struct Telemetry {
    logs: BTreeMap<String, Log>,
}

#[derive(Debug, Clone, Default)]
struct Log {
    rows: String,
    facts: String,
}

impl Telemetry {
    /// Opens a battery's log at `time_s`; `soc` is what its gauge started from. The first row has
    /// no measurement: it says from when on charge is counted.
    pub(super) fn battery(&mut self, stem: &str, time_s: f64, soc: Estimate, ambient_degc: f64) {
        let facts = format!(
            "schema = 1\nid = \"{stem}\"\nsoc_initial = {}\nsoc_initial_sigma = {}\nambient_degc = {ambient_degc}\n",
            soc.value, soc.sigma
        );
        let rows = format!("time_s,current_a,voltage_v,temperature_degc,ambient_degc\n{time_s},,,,{ambient_degc}\n");
        self.logs.insert(stem.to_owned(), Log { rows, facts });
    }

    pub(super) fn battery_row(&mut self, stem: &str, time_s: f64, sample: &Sample, ambient_degc: f64) {
        let Sample { current_a, voltage_v, temperature_degc, .. } = sample;
        self.row(stem, format_args!("{time_s},{current_a:.4},{voltage_v:.4},{temperature_degc:.2},{ambient_degc}"));
    }

    /// Opens a log with these columns after `time_s`.
    pub(super) fn table(&mut self, stem: &str, columns: &str) {
        let facts = format!("schema = 1\nid = \"{stem}\"\n");
        self.logs.insert(stem.to_owned(), Log { rows: format!("time_s,{columns}\n"), facts });
    }

    pub(super) fn row(&mut self, stem: &str, row: std::fmt::Arguments<'_>) {
        if let Some(log) = self.logs.get_mut(stem) {
            writeln!(log.rows, "{row}").expect("a text can be written to");
        }
    }

    /// Writes every log into a folder, which is made when it is not there.
    ///
    /// # Errors
    /// When the folder cannot be made or written to.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        for (stem, log) in &self.logs {
            node::files::write_text(&folder.join(format!("{stem}.csv")), &log.rows)?;
            node::files::write_text(&folder.join(format!("{stem}.toml")), &log.facts)?;
        }
        Ok(())
    }
}
