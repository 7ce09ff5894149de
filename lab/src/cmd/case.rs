//! A model with the logs that a search learns from and those that it is judged by.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, bail, ensure};
use energy::Model;
use lab::ModelSource;
use lab::compare::{compare, floors_too_small};
use lab::decision::{Decisions, Seen};
use lab::infer::answer::{Discovery, Verdict};
use lab::infer::candidate::held_at_defaults;
use lab::infer::evidence::Evidence;
use lab::infer::floors::fitted;
use lab::infer::frame::Frame;
use lab::infer::judges::Unpredicted;
use lab::infer::state::State;
use lab::infer::{other_numbers, other_starts, stated};
use lab::learned;
use lab::measurement::{Log, shared_rows};
use lab::model_source::{Origin, parse_beside};
use lab::output::{directory_of, write_whole};
use lab::prepare::Prepared;
use lab::report::discovery::{DiscoveryReport, FileErrors, Reach, Unexplained, rms_of};

use super::inputs::{LogInputs, ModelArg, say};

/// What a search is about.
pub(super) struct Case<'a> {
    inputs: &'a LogInputs,
    pub(super) source: ModelSource,
    train: Vec<Log>,
    holdout: Vec<Log>,
    /// Logs to learn from, ready for the model as given.
    pub(super) evidence: Arc<Evidence>,
    /// Logs to judge by, if any.
    pub(super) held: Option<Arc<Evidence>>,
}

/// A model that was learned, as its file says it.
pub(super) struct Written {
    text: String,
    pub(super) model: Arc<Model>,
    /// Logs to learn from, ready for it.
    pub(super) train: Vec<Prepared>,
    /// Logs to judge by, ready for it.
    pub(super) holdout: Vec<Prepared>,
    /// Those that it cannot predict.
    pub(super) unpredicted: Vec<Unpredicted>,
}

impl<'a> Case<'a> {
    pub(super) fn read(model: &ModelArg, inputs: &'a LogInputs) -> anyhow::Result<Case<'a>> {
        let source = model.load()?;
        let (train, mut holdout) = (inputs.train(&source.model)?, inputs.holdout(&source.model)?);
        unlike(&train, &mut holdout)?;
        if let Some(held) = held_at_defaults(&source.model) {
            eprintln!("lab: note: {held}");
        }
        let evidence = |logs: &[Log]| {
            let prepared = inputs.ready(&source.model, logs)?;
            anyhow::Ok(Evidence::new(&source.model, prepared))
        };
        let (seen, held) = (evidence(&train)?, if holdout.is_empty() { None } else { Some(Arc::new(evidence(&holdout)?)) });
        let seen = Arc::new(match &held {
            Some(held) => seen.judged_by(held),
            None => seen,
        });
        // Where every number can be fitted exactly, nothing is ever seen to be missing.
        let rows: usize = seen.segments.iter().map(|segment| segment.rows.len()).sum();
        let unknowns = Frame::new(Arc::clone(&source.model), Arc::clone(&seen)).unknowns();
        ensure!(
            rows > unknowns,
            "{}: {rows} rows count, and {unknowns} numbers are free or only roughly known (free parameters, [uncertainty], sensors' \
             offsets and gains): too few to say what is missing. Give a longer log, or look at `lab compare`",
            seen.logs.iter().map(|log| log.name.as_str()).collect::<Vec<_>>().join(", ")
        );
        Ok(Case { inputs, train, holdout, evidence: seen, held, source })
    }

    /// The model as given, its free parameters and all that is roughly known at their best.
    pub(super) fn fitted(&mut self) -> State {
        let (state, held) = fitted(&self.source.model, Arc::clone(&self.evidence), self.held.as_ref());
        (self.evidence, self.held) = (Arc::clone(&state.frame.evidence), held);
        state
    }

    /// What was noticed while its logs were read.
    pub(super) fn notes(&self) -> Vec<String> {
        self.train.iter().chain(&self.holdout).flat_map(|log| log.notes.iter().cloned()).collect()
    }

    /// The model as given, as a written one: what a comparison begins with.
    pub(super) fn given(&self) -> anyhow::Result<Written> {
        self.as_written(self.source.text.clone(), Arc::clone(&self.source.model))
    }

    /// What the state learned, in the given model's text. `path` is where it will stand, if it is to
    /// be written.
    pub(super) fn learned(&self, state: &State, path: Option<&Path>, date: Option<&str>) -> anyhow::Result<Written> {
        // Elsewhere, a table named by a relative path is not where the new file would look for it.
        let beside = matches!((&self.source.origin, path), (Origin::File(from), Some(path)) if same_directory(from, path));
        let text = learned::write(&self.source.text, &self.source.model, state, &origin(&self.evidence.logs, date), !beside)?;
        let place = path.unwrap_or_else(|| Path::new("the model found"));
        let model =
            parse_beside(place, &text).with_context(|| format!("{} would not load again, so it was not written", place.display()))?;
        self.as_written(text, Arc::new(model))
    }

    fn as_written(&self, text: String, model: Arc<Model>) -> anyhow::Result<Written> {
        let as_given = self.held.as_ref().map_or(&[][..], |held| &held.logs[..]);
        let (mut unpredicted, mut predicted) = (Vec::new(), Vec::new());
        for (log, as_given) in self.holdout.iter().zip(as_given) {
            match Unpredicted::of(&model, as_given) {
                Some(one) => unpredicted.push(one),
                None => predicted.push(log.clone()),
            }
        }
        let (train, holdout) = (self.inputs.ready(&model, &self.train)?, self.inputs.ready(&model, &predicted)?);
        Ok(Written { text, model, train, holdout, unpredicted })
    }

    /// What a search found, for people and programs. `last` is its last state, `written` the same as
    /// a model file.
    pub(super) fn report(
        &self,
        discovery: Discovery,
        last: &State,
        written: &Written,
        reach: Reach,
        output: Option<String>,
    ) -> DiscoveryReport {
        let compared = |model: &Arc<Model>, logs: &[Prepared]| compare(model, &model.values(), logs);
        let rms = |model: &Arc<Model>, logs: &[Prepared]| rms_of(&compared(model, logs));
        let given = &self.source.model;
        let found = compared(&written.model, &written.train);
        let file_rms = rms_of(&found);
        let mut holdout_unexplained = Vec::new();
        let mut files = FileErrors::of(&rms(given, &self.evidence.logs), &file_rms, false);
        if let Some(held) = self.held.as_ref().and_then(|held| held.that_judges(&written.model)) {
            let found = compared(&written.model, &written.holdout);
            files.extend(FileErrors::of(&rms(given, &held.logs), &rms_of(&found), true));
            holdout_unexplained = Unexplained::of(&discovery, &found, true);
        }
        let unexplained = Unexplained::of(&discovery, &found, false);
        let (decision, left_out) = (self.decisions(written), learned::left_out(last));
        let mut doubted = Vec::new();
        let (mut other_starts, mut other_numbers, mut within_stated) = (Vec::new(), Vec::new(), Vec::new());
        if discovery.verdict != Verdict::Complete {
            doubted = floors_too_small(&found.errors);
            other_starts = other_starts::other_starts(given, &self.evidence.logs, last);
            other_numbers = other_numbers::other_numbers(given, &self.evidence.logs, last);
            within_stated = stated::within_stated(given, &self.evidence.logs, last);
        }
        DiscoveryReport {
            discovery,
            decision,
            left_out,
            file_rms,
            files,
            unexplained,
            holdout_unexplained,
            holdout_unpredicted: written.unpredicted.clone(),
            other_starts,
            other_numbers,
            within_stated,
            floors_too_small: doubted,
            reach,
            output,
        }
    }

    /// What it changes to plan with that model instead of the given one.
    pub(super) fn decisions(&self, after: &Written) -> Decisions {
        let before = Seen { model: &self.source.model, logs: &self.evidence.logs };
        Decisions::between(before, Seen { model: &after.model, logs: &after.train })
    }
}

impl Written {
    /// Writes the whole file, or leaves what was there.
    pub(super) fn save(&self, path: &Path) -> anyhow::Result<()> {
        Ok(write_whole(path, self.text.as_bytes())?)
    }
}

/// Refuses a log to judge by that is one to learn from, under whatever name.
pub(super) fn unlike(train: &[Log], holdout: &mut [Log]) -> anyhow::Result<()> {
    // What is missing in both is the same.
    let alike = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
    let same = |a: &Log, b: &Log| {
        let channels = a.channels.len() == b.channels.len() && a.channels.keys().eq(b.channels.keys());
        alike(&a.time_s, &b.time_s) && channels && a.channels.iter().all(|(channel, values)| alike(values, &b.channels[channel]))
    };
    for held in holdout {
        if let Some(seen) = train.iter().find(|log| same(log, held)) {
            bail!("{} holds the same readings as {}: a log that was learned from cannot judge", held.file, seen.file);
        }
        let mut notes = Vec::new();
        for (seen, rows) in train.iter().map(|seen| (seen, shared_rows(held, seen))).filter(|(_, rows)| *rows > 0) {
            ensure!(
                rows < held.rows_compared(),
                "{}: all of its {rows} rows hold the times and readings of {}: a log that was learned from cannot judge",
                held.file,
                seen.file
            );
            notes.push(format!(
                "{}: {rows} of its {} rows hold the times and readings of {}: what was learned from cannot judge, so cut them out of one of \
                 the two",
                held.file,
                held.rows_compared(),
                seen.file
            ));
        }
        say(&notes);
        held.notes.extend(notes);
    }
    Ok(())
}

/// What a model file says about where its numbers come from.
pub(super) fn origin(logs: &[Prepared], date: Option<&str>) -> String {
    let names: Vec<&str> = logs.iter().map(|log| log.name.as_str()).collect();
    let date = date.map_or_else(String::new, |date| format!(", {date}"));
    format!("lab {} on {}{date}", env!("CARGO_PKG_VERSION"), names.join(", "))
}

/// Whether two paths lie in one directory.
pub(super) fn same_directory(one: &Path, other: &Path) -> bool {
    let whole = |path: &Path| directory_of(path).canonicalize();
    matches!((whole(one), whole(other)), (Ok(one), Ok(other)) if one == other)
}
