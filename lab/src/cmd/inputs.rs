//! Arguments that verbs share: the model, the logs and the facts about them.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use energy::document::hint;
use energy::{Channel, Model};
use lab::measurement::{Log, LogFacts, Mapping, Overrides, read_log};
use lab::prepare::{Prepared, predicted_channels, prepare_to_judge};
use lab::{ModelSource, load_model};

#[derive(Debug, clap::Args)]
pub(super) struct ModelArg {
    /// The model: a built-in name or the path of a TOML file.
    #[arg(long, value_name = "MODEL")]
    model: String,
}

impl ModelArg {
    pub(super) fn load(&self) -> anyhow::Result<ModelSource> {
        Ok(load_model(&self.model)?)
    }
}

#[derive(Debug, clap::Args)]
pub(super) struct LogArgs {
    /// Logs to read. Facts about L.csv are read from L.toml beside it.
    #[arg(long = "log", value_name = "LOG", required = true, num_args = 1..)]
    logs: Vec<PathBuf>,
    /// Only this of the channels that the model predicts; all that the logs hold when left out.
    #[arg(long = "target", value_name = "CHANNEL")]
    targets: Vec<String>,
    #[command(flatten)]
    facts: FactArgs,
}

#[derive(Debug, clap::Args)]
pub(super) struct FactArgs {
    /// Takes a channel from a column of another name or unit, e.g.
    /// temperature_degc=temp_K*1-273.15; a number alone stands for every row.
    #[arg(long = "column", value_name = "CANONICAL=SOURCE[*SCALE][+/-OFFSET]")]
    columns: Vec<Mapping>,
    /// State of charge at the first row, 0 to 1.
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
    /// A number that the logger writes when nothing was measured.
    #[arg(long, allow_negative_numbers = true)]
    missing: Vec<f64>,
}

impl FactArgs {
    fn overrides(&self) -> anyhow::Result<Overrides> {
        let overrides = Overrides {
            soc_initial: self.soc_initial,
            soc_initial_sigma: self.soc_initial_sigma,
            rest_voltage_v: self.rest_voltage_v,
            ambient_degc: self.ambient_degc,
            missing: self.missing.clone(),
            columns: self.columns.clone(),
        };
        overrides.check().map_err(anyhow::Error::msg)?;
        Ok(overrides)
    }

    pub(super) fn read(&self, path: &Path) -> anyhow::Result<Log> {
        let overrides = self.overrides()?;
        let file = path.display().to_string();
        let bytes = fs::read(path).with_context(|| format!("cannot read the log {file}"))?;
        let beside = path.with_extension("toml");
        let facts = if beside.is_file() {
            let name = beside.display().to_string();
            let text = fs::read_to_string(&beside).with_context(|| format!("cannot read {name}"))?;
            LogFacts::parse(&name, &text)?
        } else {
            LogFacts::default()
        };
        let log = read_log(&file, &bytes, overrides.over(facts))?;
        for note in &log.notes {
            eprintln!("lab: note: {note}");
        }
        Ok(log)
    }
}

impl LogArgs {
    /// Reads every log and makes it ready.
    pub(super) fn prepare(&self, model: &Model) -> anyhow::Result<Vec<Prepared>> {
        let targets = targets(model, &self.targets)?;
        let mut logs: Vec<Log> = Vec::new();
        for path in &self.logs {
            let log = self.facts.read(path)?;
            if logs.iter().any(|known| known.file == log.file) {
                bail!("the log {} is given twice; it would count twice", log.file);
            }
            logs.push(log);
        }
        // Logs of one name in several directories are told apart by their whole path.
        let names: Vec<String> = logs.iter().map(|log| log.name.clone()).collect();
        let twice = |name: &String| names.iter().filter(|other| *other == name).count() > 1;
        let named = |log: &Log| {
            let mut prepared = prepare_to_judge(model, log, &targets)?;
            if twice(&log.name) {
                prepared.name.clone_from(&log.file);
            }
            anyhow::Ok(prepared)
        };
        logs.iter().map(named).collect()
    }
}

/// The channels that the flags name.
fn targets(model: &Model, names: &[String]) -> anyhow::Result<Vec<Channel>> {
    let predicted = predicted_channels(model);
    let all = || predicted.iter().map(|channel| channel.name());
    let known = |name: &String| {
        let channel = predicted.iter().copied().find(|channel| channel.name() == name);
        channel.with_context(|| {
            let allowed = all().collect::<Vec<_>>().join(", ");
            format!("--target {name}: the model does not predict it{} It predicts: {allowed}", hint(name, all()))
        })
    };
    names.iter().map(known).collect()
}
