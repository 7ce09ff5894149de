//! `lab propose`: a formula for what no effect of the catalogue explains.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, ensure};
use energy::Model;
use lab::ModelSource;
use lab::compare::compare;
use lab::infer::evidence::Evidence;
use lab::infer::propose::{Proposal, propose};
use lab::measurement::Log;
use lab::model_edit::{edit, ocv_of_file, put_number};
use lab::model_source::parse_beside;
use lab::output::write_whole;
use lab::report::discovery::{FileErrors, rms_of};
use lab::report::proposal::{ProposalReport, Status};

use super::case::unlike;
use super::fit::stays_beside;
use super::inputs::{Answered, LogInputs, ModelArg};
use super::save::SaveArgs;
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    model: ModelArg,
    #[command(flatten)]
    logs: LogInputs,
    #[command(flatten)]
    save: SaveArgs,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    args.save.check()?;
    args.logs.spare(args.save.output())?;
    args.model.spare(args.save.output(), Answered::Model)?;
    let source = args.model.load()?;
    let model = &source.model;
    let (train, mut holdout) = split(args.logs.train(model)?, args.logs.holdout(model)?)?;
    unlike(&train, &mut holdout)?;
    let names: Vec<String> = train.iter().map(|log| log.name.clone()).collect();
    let evidence = |logs: &[Log]| anyhow::Ok(Evidence::new(model, args.logs.ready(model, logs)?));
    let held = Arc::new(evidence(&holdout)?);
    let seen = Arc::new(evidence(&train)?.judged_by(&held));
    let proposal = propose(Arc::clone(model), &seen, &held);
    let mut report = ProposalReport::of(&proposal);
    if report.status == Status::Proposal {
        let date = args.save.date().map_or_else(String::new, |date| format!(", {date}"));
        let origin = format!("proposed by lab {} from {}{date}", env!("CARGO_PKG_VERSION"), names.join(", "));
        let (text, written) = written(&source, args.save.output(), &report, &proposal, &origin)?;
        let rms = |model: &Arc<Model>, logs: &[Log]| anyhow::Ok(rms_of(&compare(model, &model.values(), &args.logs.ready(model, logs)?)));
        for (logs, holdout) in [(&train, false), (&holdout, true)] {
            report.files.extend(FileErrors::of(&rms(model, logs)?, &rms(&written, logs)?, holdout));
        }
        if let Some(path) = args.save.output() {
            write_whole(path, text.as_bytes())?;
            report.output = Some(path.display().to_string());
        }
    }
    print(format, &report, || report.human())?;
    Ok(if report.status == Status::Proposal { Answer::Yes } else { Answer::No })
}

/// Logs to fit to, and at least one to judge by.
fn split(mut train: Vec<Log>, mut holdout: Vec<Log>) -> anyhow::Result<(Vec<Log>, Vec<Log>)> {
    if holdout.is_empty() {
        ensure!(
            train.len() > 1,
            "a formula is proposed only when it helps on a log that it was not fitted to: give another log, or --holdout"
        );
        holdout.extend(train.pop());
        eprintln!("lab: note: no --holdout: {} is kept to judge by", holdout[0].name);
    }
    Ok((train, holdout))
}

/// The model file with the proposal, as text and as a model. `path` is where it will stand, if it is to be written.
fn written(
    source: &ModelSource,
    path: Option<&Path>,
    report: &ProposalReport,
    proposal: &Proposal,
    origin: &str,
) -> anyhow::Result<(String, Arc<Model>)> {
    let inline = if path.is_some_and(|path| stays_beside(source, path)) { None } else { ocv_of_file(&source.model, &source.text) };
    let mut text = edit(&source.text, &report.changes(proposal, origin), inline)?;
    let clock_sigma_s = proposal.state.frame.model.uncertainty.clock_sigma_s;
    if clock_sigma_s > source.model.uncertainty.clock_sigma_s {
        let comment = "A log may find what has a period at any phase.";
        text = put_number(&text, "uncertainty", "clock_sigma_s", clock_sigma_s, comment)?;
    }
    text += &report.entries(proposal, origin);
    let place = path.unwrap_or_else(|| Path::new("the model proposed"));
    let model = parse_beside(place, &text).with_context(|| format!("{} would not load, so it was not written", place.display()))?;
    Ok((text, Arc::new(model)))
}
