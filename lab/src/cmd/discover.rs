//! `lab discover`: effect after effect, until the model explains the logs or nothing does.

use std::sync::Arc;

use lab::infer::answer::{Discovery, Verdict};
use lab::infer::discover::{Search, search_and_tell};
use lab::report::discovery::Reach;

use super::busy::while_telling;
use super::case::Case;
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
    let case = Case::read(&args.model, &args.logs)?;
    let search = searched(&case);
    let found = case.learned(search.last.told(), args.save.output(), args.save.date())?;
    if let Some(path) = args.save.output() {
        found.save(path)?;
    }
    let report = case.report(Discovery::of(&search), search.last.told(), &found, Reach::Whole, args.save.told());
    print(format, &report, || report.human())?;
    Ok(if report.discovery.verdict == Verdict::Unknown { Answer::No } else { Answer::Yes })
}

/// The whole search.
pub(super) fn searched(case: &Case<'_>) -> Search {
    while_telling(format!("looking for what {} lacks", case.source.model.name), |told| {
        search_and_tell(Arc::clone(&case.source.model), Arc::clone(&case.evidence), case.held.as_ref(), told)
    })
}
