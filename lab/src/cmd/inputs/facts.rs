//! Facts about logs given as flags, and reading a log with them.

use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use lab::measurement::{GapCurrent, LOG_BYTES_MAX, Log, LogFacts, Mapping, Mark, Overrides, Selection, read_log_from};

use super::say;

#[derive(Debug, clap::Args)]
pub(in crate::cmd) struct FactArgs {
    /// Takes a channel from a column of another name or unit, e.g.
    /// temperature_degc=temp_K*1-273.15; a number alone stands for every row.
    #[arg(long = "column", value_name = "CANONICAL=SOURCE[*SCALE][+/-OFFSET]")]
    columns: Vec<Mapping>,
    /// Reads only rows in which this column holds this number or text, or lies within this range, e.g. cycle=3, mode=CC or
    /// time_s=3600..7200; several must all be so.
    #[arg(long, value_name = "COLUMN=VALUE|FROM..TO")]
    rows: Vec<Selection>,
    /// Takes the current to flow into the battery in rows in which this column holds this, e.g. State=C: for cyclers that write currents
    /// without a sign. Given several times, each says some of these rows.
    #[arg(long, value_name = "COLUMN=VALUE|FROM..TO")]
    charging: Vec<Selection>,
    /// State of charge at the first row that is read, 0 to 1.
    #[arg(long, allow_negative_numbers = true)]
    soc_initial: Option<f64>,
    /// Standard deviation of it.
    #[arg(long, allow_negative_numbers = true)]
    soc_initial_sigma: Option<f64>,
    /// Pack voltage after a long rest before the log, V.
    #[arg(long, allow_negative_numbers = true, conflicts_with = "soc_initial")]
    rest_voltage_v: Option<f64>,
    /// Temperature of the surroundings, degC, where no column holds it.
    #[arg(long, allow_negative_numbers = true)]
    ambient_degc: Option<f64>,
    /// Standard deviation of it, K: as if it were known exactly when left out.
    #[arg(long, allow_negative_numbers = true)]
    ambient_sigma_k: Option<f64>,
    /// Whether the current of the row after a gap held over all of it, as where a battery was
    /// stored, or nobody knows what flowed, as without this.
    #[arg(long)]
    gap_current: Option<GapCurrent>,
    /// Time from the first row over which a battery that was under load before may still show it, s:
    /// nothing is compared there.
    #[arg(long, allow_negative_numbers = true)]
    settling_s: Option<f64>,
    /// A number that the logger writes when nothing was measured, in any column or in one, e.g. voltage_v=0.
    #[arg(long, value_name = "[COLUMN=]NUMBER", allow_negative_numbers = true)]
    missing: Vec<Mark>,
    /// Which topic of an MCAP recording with several batteries.
    #[arg(long)]
    topic: Option<String>,
}

/// The MCAP files of a recording that rosbag2 made, in the order in which it wrote them.
fn parts(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let doing = || format!("cannot read the log {}", folder.display());
    let files: Vec<PathBuf> = fs::read_dir(folder).and_then(|all| all.map(|one| Ok(one?.path())).collect()).with_context(doing)?;
    let ending = |end: &str| files.iter().filter(|file| file.extension().is_some_and(|of| of == end)).cloned().collect::<Vec<_>>();
    let mut parts = ending("mcap");
    ensure!(
        !parts.is_empty() || ending("db3").is_empty(),
        "{}: a recording of rosbag2 in its SQLite format; `ros2 bag convert` makes MCAP of it",
        doing()
    );
    ensure!(!parts.is_empty(), "{}: it is a directory without MCAP files; name a file", doing());
    // run_2.mcap comes before run_10.mcap.
    parts.sort_by_key(|file| (file.as_os_str().len(), file.clone()));
    Ok(parts)
}

/// Whether a log is named by the facts about it.
fn is_facts(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// The file that holds the rows of a log which is named by the facts about it. What is wrong with them is told when they are read.
pub(super) fn named_by_facts(path: &Path) -> Option<PathBuf> {
    let facts: toml::Table = if is_facts(path) { fs::read_to_string(path).ok()?.parse().ok()? } else { return None };
    Some(path.with_file_name(facts.get("log")?.as_str()?))
}

impl FactArgs {
    pub(super) fn overrides(&self) -> anyhow::Result<Overrides> {
        let overrides = Overrides {
            soc_initial: self.soc_initial,
            soc_initial_sigma: self.soc_initial_sigma,
            rest_voltage_v: self.rest_voltage_v,
            ambient_degc: self.ambient_degc,
            ambient_sigma_k: self.ambient_sigma_k,
            gap_current: self.gap_current,
            settling_s: self.settling_s,
            rows: self.rows.clone(),
            charging: self.charging.clone(),
            missing: self.missing.clone(),
            topic: self.topic.clone(),
            columns: self.columns.clone(),
        };
        overrides.check().map_err(anyhow::Error::msg)?;
        Ok(overrides)
    }

    /// What is known about a log: from the file beside it, and from the flags, which win.
    pub(super) fn of(&self, path: &Path) -> anyhow::Result<LogFacts> {
        let beside = if is_facts(path) { path.to_owned() } else { path.with_extension("toml") };
        let overrides = self.overrides()?;
        if !beside.is_file() {
            return Ok(overrides.over(LogFacts::default()));
        }
        let (name, log) = (beside.display(), path.display());
        let text = fs::read_to_string(&beside).with_context(|| format!("cannot read {name}"))?;
        let is_model = toml::from_str::<toml::Table>(&text).is_ok_and(|table| table.contains_key("system"));
        ensure!(!is_model || !is_facts(path), "{name} is a model, no log");
        ensure!(!is_model, "{name} is a model, and would be read as the facts of the log {log} beside it: give one of them another name");
        let facts = LogFacts::parse(&beside.display().to_string(), &text)?;
        match &facts.log {
            None => ensure!(!is_facts(path), "{name} does not say of which log it is: write log = \"FILE.csv\" into it, or name the log"),
            Some(of) => {
                ensure!(!is_facts(of), "{name}: log = \"{}\" names facts, no log", of.display());
                ensure!(is_facts(path), "{name} is of another log, {}, and stands beside {log}: name {name} as the log", of.display());
            }
        }
        Ok(overrides.over(facts))
    }

    /// Reads a log of which the facts are known, and says what is not as it should be.
    pub(super) fn read_with(&self, path: &Path, facts: LogFacts) -> anyhow::Result<Log> {
        let named = path;
        let data = facts.log.as_ref().map(|log| named.with_file_name(log));
        let path = data.as_deref().unwrap_or(named);
        let doing = || format!("cannot read the log {}", path.display());
        let parts = if fs::metadata(path).with_context(doing)?.is_dir() { parts(path)? } else { vec![path.to_owned()] };
        let file = parts[0].display().to_string();
        let (mut bytes, mut all): (u64, Box<dyn Read>) = (0, Box::new(io::empty()));
        for part in &parts {
            let opened = File::open(part).with_context(|| format!("cannot read the log {}", part.display()))?;
            bytes += opened.metadata().with_context(doing)?.len();
            all = Box::new(all.chain(opened));
        }
        ensure!(
            bytes <= LOG_BYTES_MAX,
            "{} has {:.1} GiB; at most {} GiB are read as one log: cut it, or thin it out",
            path.display(),
            bytes as f64 / f64::from(1 << 30),
            LOG_BYTES_MAX >> 30
        );
        let mut log = read_log_from(&file, &mut BufReader::with_capacity(1 << 16, all), facts)?;
        if parts.len() > 1 {
            log.notes.push(format!("{}: {} files, read as one recording", path.display(), parts.len()));
        }
        if data.is_some() {
            log.name = named.file_stem().map_or(log.name, |stem| stem.to_string_lossy().into_owned());
            log.file = named.display().to_string();
        }
        say(&log.notes);
        Ok(log)
    }

    /// Reads a log with the facts beside it.
    pub(in crate::cmd) fn read(&self, path: &Path) -> anyhow::Result<Log> {
        self.read_with(path, self.of(path)?)
    }
}
