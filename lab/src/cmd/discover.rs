//! `lab discover`: effect after effect, until the model explains the logs or nothing does.

use std::path::PathBuf;
use std::sync::Arc;

use lab::infer::answer::{Discovery, Verdict};
use lab::infer::discover::{Search, search};
use lab::output::check_writable;
use lab::report::discovery::Reach;

use super::case::{Case, busy};
use super::fit::date;
use super::inputs::{LogInputs, ModelArg};
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    model: ModelArg,
    #[command(flatten)]
    logs: LogInputs,
    /// Where to write the model with what was found; nothing is written when left out.
    #[arg(short, long, value_name = "MODEL2")]
    output: Option<PathBuf>,
    /// Date to record as the origin of the numbers, YYYY-MM-DD.
    #[arg(long, value_name = "DATE", value_parser = date)]
    date: Option<String>,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    if let Some(path) = &args.output {
        check_writable(path)?;
    }
    let case = Case::read(&args.model, &args.logs)?;
    let search = searched(&case);
    let found = case.learned(&search.last, args.output.as_deref(), args.date.as_deref())?;
    if let Some(path) = &args.output {
        found.save(path)?;
    }
    let report = case.report(
        Discovery::of(&search),
        &search.last,
        &found,
        Reach::Whole,
        args.output.as_ref().map(|path| path.display().to_string()),
    );
    print(format, &report, || report.human())?;
    Ok(if report.discovery.verdict == Verdict::Unknown { Answer::No } else { Answer::Yes })
}

/// The whole search.
pub(super) fn searched(case: &Case<'_>) -> Search {
    let bar = busy(format!("looking for what {} lacks", case.source.model.name));
    let search = search(Arc::clone(&case.source.model), Arc::clone(&case.evidence), case.held.as_ref());
    bar.finish_and_clear();
    search
}
