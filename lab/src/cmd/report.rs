//! `lab report`: one self-contained HTML file.

use std::path::PathBuf;

use lab::compare::{Comparison, compare};
use lab::infer::answer::Discovery;
use lab::output::{check_writable, write_whole};
use lab::report::discovery::{DiscoveryReport, Reach};
use lab::report::html::{page_of, render};
use serde::Serialize;

use super::case::Case;
use super::compare::answer;
use super::discover::searched;
use super::inputs::{Answered, LogInputs, ModelArg};
use super::save::date;
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    model: ModelArg,
    #[command(flatten)]
    logs: LogInputs,
    /// Say only where the model fails, and do not look for what it lacks.
    #[arg(long)]
    no_discover: bool,
    /// Where to write the report.
    #[arg(short, long, value_name = "OUT.html")]
    output: PathBuf,
    /// Date to print on it, YYYY-MM-DD.
    #[arg(long, value_name = "DATE", value_parser = date)]
    date: Option<String>,
}

/// What was written, and what it says.
#[derive(Debug, Serialize)]
struct Written {
    /// Version of this structure.
    schema: u32,
    /// The file.
    output: String,
    /// The comparison in it, as `lab compare` prints it.
    comparison: Comparison,
    /// The same for the held-out logs; null when there are none.
    holdout: Option<Comparison>,
    /// The search in it, as `lab discover` prints it; null with `--no-discover`.
    discovery: Option<DiscoveryReport>,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    check_writable(&args.output)?;
    args.logs.spare(Some(&args.output))?;
    args.model.spare(Some(&args.output), Answered::Other)?;
    let case = Case::read(&args.model, &args.logs)?;
    let given = case.given()?;
    let (model, values) = (&given.model, given.model.values());
    let comparison = compare(model, &values, &given.train).with_calibration(model, &values, &given.train);
    let holdout =
        (!given.holdout.is_empty()).then(|| compare(model, &values, &given.holdout).with_calibration(model, &values, &given.holdout));
    let mut page = page_of(model, &values, &given.train, &comparison, args.date.as_deref());
    if let Some(holdout) = &holdout {
        page.add_holdout(model, &values, &given.holdout, holdout);
    }
    page.header.notes = case.notes();
    let mut discovery = None;
    if !args.no_discover {
        let search = searched(&case);
        let found = case.learned(search.last.told(), None, args.date.as_deref())?;
        let report = case.report(Discovery::of(&search), search.last.told(), &found, Reach::Whole, None);
        page.add_discovery(&report, &search.steps[0].scores);
        discovery = Some(report);
    }
    write_whole(&args.output, render(&page).as_bytes())?;
    let verdicts = [Some(&comparison), holdout.as_ref()].into_iter().flatten().map(|comparison| answer(comparison.verdict));
    let verdict = verdicts.max_by_key(|answer| match answer {
        Answer::Yes => 0,
        Answer::CannotTell => 1,
        Answer::No => 2,
    });
    let words = page.verdict.map_or_else(Vec::new, |answer| std::iter::once(answer.headline).chain(answer.words).collect());
    let written = Written { schema: 1, output: args.output.display().to_string(), comparison, holdout, discovery };
    print(format, &written, || format!("{}\nWritten to {}\n", words.join("\n"), written.output))?;
    Ok(verdict.unwrap_or(Answer::CannotTell))
}
