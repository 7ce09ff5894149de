//! `lab report`: one self-contained HTML file.

use std::path::PathBuf;

use energy::Model;
use lab::compare::{Comparison, compare};
use lab::output::{check_writable, write_whole};
use lab::prepare::{Prepared, prepare_to_judge};
use lab::report::html::{page_of, render};
use serde::Serialize;

use super::compare::answer;
use super::fit::date;
use super::inputs::{FactArgs, ModelArg};
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    model: ModelArg,
    /// Logs to read. Facts about L.csv are read from L.toml beside it.
    #[arg(long = "log", value_name = "LOG", required = true, num_args = 1..)]
    logs: Vec<PathBuf>,
    /// Logs that were held out: judged apart from the others.
    #[arg(long, value_name = "LOG", num_args = 1..)]
    holdout: Vec<PathBuf>,
    #[command(flatten)]
    facts: FactArgs,
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
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    check_writable(&args.output)?;
    let source = args.model.load()?;
    let (model, values) = (&source.model, source.model.values());
    let logs = args.prepare(model, &args.logs)?;
    let held_out = args.prepare(model, &args.holdout)?;
    let comparison = compare(model, &values, &logs);
    let holdout = (!held_out.is_empty()).then(|| compare(model, &values, &held_out));
    let mut page = page_of(model, &values, &logs, &comparison, args.date.as_deref());
    if let Some(holdout) = &holdout {
        page.add_holdout(model, &values, &held_out, holdout);
    }
    write_whole(&args.output, render(&page).as_bytes())?;
    let verdicts = [Some(&comparison), holdout.as_ref()].into_iter().flatten().map(|comparison| answer(comparison.verdict));
    let verdict = verdicts.max_by_key(|answer| match answer {
        Answer::Yes => 0,
        Answer::CannotTell => 1,
        Answer::No => 2,
    });
    let written = Written { schema: 1, output: args.output.display().to_string(), comparison, holdout };
    print(format, &written, || format!("{}\nWritten to {}\n", written.comparison.words.join("\n"), written.output))?;
    Ok(verdict.unwrap_or(Answer::CannotTell))
}

impl Args {
    fn prepare(&self, model: &Model, paths: &[PathBuf]) -> anyhow::Result<Vec<Prepared>> {
        paths.iter().map(|path| Ok(prepare_to_judge(model, &self.facts.read(path)?, &[])?)).collect()
    }
}
