//! Arguments that verbs share: the model, the logs and the facts about them.

mod facts;
mod spare;
mod store;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use energy::document::hint;
use energy::{Channel, Model};
use lab::measurement::{Log, LogFacts, Role, Thinning, leave_out_edges, leave_out_settling, shared_rows, thin, uneven_sampling};
use lab::prepare::{Prepared, counted_as_zero, odd_current, odd_voltage, predicted_channels, prepare_to_judge};
use lab::{ModelSource, load_model};

pub(super) use facts::FactArgs;
use spare::spare_store;
pub(super) use spare::{Answered, same_file, spare};
use store::StoreArgs;

#[derive(Debug, clap::Args)]
pub(super) struct ModelArg {
    /// The model: a built-in name or the path of a TOML file.
    #[arg(long, value_name = "MODEL")]
    model: String,
    /// Effects of it to leave out, to see what they are worth; '*' for all.
    #[arg(long, value_name = "EFFECT", value_delimiter = ',')]
    without: Vec<String>,
}

impl ModelArg {
    pub(super) fn load(&self) -> anyhow::Result<ModelSource> {
        load_model(&self.model)?.without(&self.without)
    }
}

/// Logs of any role.
#[derive(Debug, clap::Args)]
pub(super) struct LogArgs {
    /// Logs to read. Facts about L.csv are read from L.toml beside it; a file of facts that says
    /// log = "L.csv" is a log too, so that one file can hold many.
    #[arg(long = "log", value_name = "LOG", required_unless_present = "store", num_args = 1..)]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    store: StoreArgs,
    /// Only this of the channels that the model predicts; all that the logs hold when left out.
    #[arg(long = "target", value_name = "CHANNEL")]
    targets: Vec<String>,
    #[command(flatten)]
    facts: FactArgs,
    #[command(flatten)]
    rows: RowArgs,
}

/// Logs to fit models, and logs to judge them.
#[derive(Debug, clap::Args)]
pub(super) struct LogInputs {
    #[command(flatten)]
    logs: LogArgs,
    /// Logs that only judge: nothing is fitted to them. So are logs whose facts say
    /// role = "holdout".
    #[arg(long, value_name = "LOG", num_args = 1..)]
    holdout: Vec<PathBuf>,
}

/// How many rows of long logs count.
#[derive(Debug, clap::Args)]
struct RowArgs {
    /// Make one row of all within so many seconds: inputs become means, states are those at its
    /// end.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, conflicts_with = "no_decimation")]
    every: Option<f64>,
    /// Keep every row of a long log, also those in which nothing changes.
    #[arg(long)]
    no_decimation: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    let given = text.parse::<f64>().ok().filter(|seconds| seconds.is_finite() && *seconds > 0.0);
    given.ok_or_else(|| "must be a number of seconds above 0".to_owned())
}

impl RowArgs {
    fn thinning(&self) -> Thinning {
        match self.every {
            Some(step_s) => Thinning::Every(step_s),
            None if self.no_decimation => Thinning::None,
            None => Thinning::WhereNothingChanges,
        }
    }
}

impl LogArgs {
    /// Reads the logs of these files that have a role, and thins the long ones.
    fn read(&self, model: &Model, files: &[(&Path, Option<Role>)], role: Option<Role>) -> anyhow::Result<Vec<Log>> {
        for (index, (path, _)) in files.iter().enumerate() {
            ensure!(
                files[..index].iter().all(|(known, _)| !same_file(known, path)),
                "the log {} is given twice; it would count twice",
                path.display()
            );
        }
        let mut logs = Vec::new();
        for (path, given) in files {
            let facts = self.facts.of(path)?;
            let is = given.or(facts.role).unwrap_or(Role::Train);
            if role.is_none_or(|role| role == is) {
                let mut log = self.facts.read_with(path, facts)?;
                log.facts.role = Some(is);
                logs.push(log);
            }
        }
        // What the coordinator saw is there to learn from.
        if role != Some(Role::Holdout) {
            logs.extend(self.store.read(self.facts.overrides()?.over(LogFacts::default()))?);
        }
        for log in &mut logs {
            let told = log.notes.len();
            leave_out_settling(log, model);
            if let Some(odd) = odd_current(model, log) {
                // Whatever is learned from it would be the wrong sign by another name.
                ensure!(role.is_none(), "{odd}. Nothing is learned from such a log; `lab compare` shows it as it is");
                log.notes.push(odd);
            } else {
                log.notes.extend(odd_voltage(model, log));
            }
            leave_out_edges(log, model);
            thin(log, model, self.rows.thinning());
            say(&log.notes[told..]);
        }
        let twice = if role == Some(Role::Train) { counted_twice(&logs) } else { Vec::new() };
        let of_all: Vec<String> = twice.into_iter().chain(uneven_sampling(&logs)).chain(counted_as_zero(model, &logs)).collect();
        say(&of_all);
        // Reports tell what was noticed from the logs.
        if let Some(first) = logs.first_mut() {
            first.notes.extend(of_all);
        }
        Ok(logs)
    }

    /// Refuses to write over a log, or over the facts beside it.
    pub(super) fn spare(&self, output: Option<&Path>) -> anyhow::Result<()> {
        let Some(output) = output else { return Ok(()) };
        self.logs.iter().try_for_each(|log| spare(log, output))?;
        self.store.store.iter().try_for_each(|store| spare_store(store, output))
    }

    fn files(&self) -> impl Iterator<Item = (&Path, Option<Role>)> {
        self.logs.iter().map(|path| (path.as_path(), None))
    }

    /// Reads every log, whatever its role, and makes it ready.
    pub(super) fn prepare(&self, model: &Model) -> anyhow::Result<Vec<Prepared>> {
        self.ready(model, &self.read(model, &self.files().collect::<Vec<_>>(), None)?)
    }

    fn ready(&self, model: &Model, logs: &[Log]) -> anyhow::Result<Vec<Prepared>> {
        let targets = targets(model, &self.targets)?;
        // Logs of one name in several directories are told apart by their whole path.
        let twice = |log: &Log| logs.iter().filter(|other| other.name == log.name).count() > 1;
        let named = |log: &Log| {
            let mut prepared = prepare_to_judge(model, log, &targets)?;
            if twice(log) {
                prepared.name.clone_from(&log.file);
            }
            anyhow::Ok(prepared)
        };
        logs.iter().map(named).collect()
    }
}

impl LogInputs {
    /// Refuses to write over a log, or over the facts beside it.
    pub(super) fn spare(&self, output: Option<&Path>) -> anyhow::Result<()> {
        self.logs.spare(output)?;
        output.map_or(Ok(()), |output| self.holdout.iter().try_for_each(|log| spare(log, output)))
    }

    fn files(&self) -> Vec<(&Path, Option<Role>)> {
        self.logs.files().chain(self.holdout.iter().map(|path| (path.as_path(), Some(Role::Holdout)))).collect()
    }

    /// The logs that models may be fitted to: at least one.
    pub(super) fn train(&self, model: &Model) -> anyhow::Result<Vec<Log>> {
        let logs = self.logs.read(model, &self.files(), Some(Role::Train))?;
        ensure!(!logs.is_empty(), "no log to fit to: the facts of each say role = \"holdout\"");
        Ok(logs)
    }

    /// The logs that models are judged on, and never fitted to; perhaps none.
    pub(super) fn holdout(&self, model: &Model) -> anyhow::Result<Vec<Log>> {
        self.logs.read(model, &self.files(), Some(Role::Holdout))
    }

    /// Makes logs ready for a model, with the channels that the flags name.
    pub(super) fn ready(&self, model: &Model, logs: &[Log]) -> anyhow::Result<Vec<Prepared>> {
        self.logs.ready(model, logs)
    }
}

/// Logs to learn from that hold rows of each other.
pub(super) fn counted_twice(logs: &[Log]) -> Vec<String> {
    let pairs = logs.iter().enumerate().flat_map(|(index, log)| logs[..index].iter().map(move |before| (before, log)));
    let shared = pairs.map(|(before, log)| (before, log, shared_rows(log, before))).filter(|(.., rows)| *rows > 0);
    let words = |(before, log, rows): (&Log, &Log, usize)| {
        format!("{}: {rows} of its {} rows hold the times and readings of {}: they count twice", log.file, log.rows(), before.file)
    };
    shared.map(words).collect()
}

/// Tells the user what stops nothing.
pub(super) fn say(notes: &[String]) {
    for note in notes {
        eprintln!("lab: note: {note}");
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

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::Parser as _;

    use super::*;

    #[derive(Debug, clap::Parser)]
    struct Verb {
        #[command(flatten)]
        inputs: LogInputs,
    }

    #[test]
    fn logs_for_judging_come_from_the_flag_and_from_the_facts() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        for name in ["a", "b", "c"] {
            fs::write(path(&format!("{name}.csv")), "time_s,current_a,voltage_v\n0,1,4.1\n1,1,4.0\n").unwrap();
        }
        fs::write(path("b.toml"), "schema = 1\nrole = \"holdout\"\n").unwrap();
        // The flag wins over the facts.
        fs::write(path("c.toml"), "schema = 1\nrole = \"train\"\n").unwrap();
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        let verb = |more: &[&str]| Verb::try_parse_from([&["verb", "--soc-initial", "1", "--log"], more].concat()).unwrap().inputs;
        let (a, b, c) = (path("a.csv"), path("b.csv"), path("c.csv"));
        let inputs = verb(&[&a, &b, "--holdout", &c]);
        let names = |logs: Vec<Log>| logs.into_iter().map(|log| (log.name, log.facts.role)).collect::<Vec<_>>();
        assert_eq!(names(inputs.train(&model).unwrap()), [("a".to_owned(), Some(Role::Train))]);
        let judged = inputs.holdout(&model).unwrap();
        assert_eq!(inputs.ready(&model, &judged).unwrap().len(), 2);
        assert_eq!(names(judged), [("b".to_owned(), Some(Role::Holdout)), ("c".to_owned(), Some(Role::Holdout))]);
        let twice = verb(&[&a, "--holdout", &a]).train(&model).unwrap_err().to_string();
        assert!(twice.contains("is given twice"), "{twice}");
        assert!(verb(&[&b]).train(&model).unwrap_err().to_string().contains("no log to fit to"));
    }
}
