//! `lab fit`: calibrates a model on logs.

use std::io::{IsTerminal as _, stderr};
use std::path::Path;
use std::time::Duration;

use anyhow::Context as _;
use energy::Model;
use indicatif::ProgressBar;
use lab::ModelSource;
use lab::compare::compare;
use lab::fit::calibrated::fit_calibrated;
use lab::fit::{Step, fit, free_parameters};
use lab::infer::calibrate::taken_as_exact;
use lab::measurement::Log;
use lab::model_edit::{Change, edit, ocv_of_file};
use lab::model_source::{Origin, parse_beside};
use lab::output::write_whole;
use lab::prepare::Prepared;
use lab::report::fitted::FitReport;

use super::case::{origin, same_directory, unlike};
use super::inputs::{Answered, LogInputs, ModelArg};
use super::save::SaveArgs;
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    model: ModelArg,
    #[command(flatten)]
    inputs: LogInputs,
    /// Also fit this parameter (or all of this effect), whatever the model says.
    #[arg(long, value_name = "EFFECT.PARAMETER", num_args = 1..)]
    free: Vec<String>,
    /// Leave this parameter (or all of this effect) as it is, whatever the model says.
    #[arg(long, value_name = "EFFECT.PARAMETER", num_args = 1..)]
    fix: Vec<String>,
    /// Fit with it the offsets, gains and delays of sensors and how each log begins, within what the model and the logs state of them: the numbers are
    /// as uncertain as these leave them.
    #[arg(long)]
    calibrate: bool,
    #[command(flatten)]
    save: SaveArgs,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    args.save.check()?;
    args.inputs.spare(args.save.output())?;
    args.model.spare(args.save.output(), Answered::Model)?;
    let source = args.model.load()?;
    let model = &source.model;
    let free = free_parameters(model, &args.free, &args.fix)?;
    let ready = |logs: &[Log]| args.inputs.ready(model, logs);
    let (train, mut holdout) = (args.inputs.train(model)?, args.inputs.holdout(model)?);
    unlike(&train, &mut holdout)?;
    let (logs, held) = (ready(&train)?, ready(&holdout)?);
    let before = compare(model, &model.values(), &logs);
    let bar = progress_bar();
    let mut told = |step: Step| bar.set_message(format!("step {}, weighted squared error {:.4e}", step.iteration, step.cost));
    let (fitted, logs, words) = if args.calibrate {
        let calibrated = fit_calibrated(model, &logs, &free, &mut told)?;
        let words = calibrated.words().into_iter().chain(as_exact(model, &logs, true)).collect();
        (calibrated.fit, calibrated.logs, words)
    } else {
        (fit(model, &logs, &free, &mut told)?, logs.clone(), as_exact(model, &logs, false))
    };
    bar.finish_and_clear();
    let after = compare(model, &fitted.values, &logs);
    let mut report = FitReport::of(model, &fitted, &before, &after);
    if !held.is_empty() {
        let error = |values: &[f64]| compare(model, values, &held);
        report = report.with_holdout(&error(&model.values()), &error(&fitted.values));
    }
    report.words.extend(words);
    if let Some(path) = args.save.output() {
        let changes = report.changes(&fitted, &format!("fitted by {}", origin(&logs, args.save.date())));
        write_model(&source, path, &changes)?;
        report.output = Some(path.display().to_string());
    }
    print(format, &report, || report.human())?;
    Ok(if report.converged { Answer::Yes } else { Answer::No })
}

/// Says what was taken as exact that is stated not to be.
fn as_exact(model: &Model, logs: &[Prepared], is_calibrated: bool) -> Vec<String> {
    let stated = taken_as_exact(model, logs, is_calibrated);
    let who = if is_calibrated {
        "discover moves them"
    } else {
        "--calibrate fits what is known of sensors and starts, discover the table and the capacity too"
    };
    let words = || format!("Taken as exact, though stated to be known only roughly: {} ({who}).", stated.join(", "));
    (!stated.is_empty()).then(words).into_iter().collect()
}

/// A spinner on a terminal, and nothing elsewhere.
fn progress_bar() -> ProgressBar {
    if !stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner();
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

fn write_model(source: &ModelSource, path: &Path, changes: &[Change]) -> anyhow::Result<()> {
    let stays = stays_beside(source, path);
    let inline = if stays { None } else { ocv_of_file(&source.model, &source.text) };
    let text = edit(&source.text, changes, inline)?;
    parse_beside(path, &text).with_context(|| format!("the fitted model would not load again, so {} was not written", path.display()))?;
    write_whole(path, text.as_bytes())?;
    Ok(())
}

/// Whether a table that the model names by a relative path is where a file at `path` looks for it.
pub(super) fn stays_beside(source: &ModelSource, path: &Path) -> bool {
    match &source.origin {
        Origin::BuiltIn(_) => false,
        Origin::File(from) => same_directory(from, path),
    }
}
