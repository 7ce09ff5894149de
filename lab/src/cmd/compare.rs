//! `lab compare`: where a model fails.

use lab::compare::{Verdict, compare};
use lab::report::comparison::human;

use super::inputs::{LogArgs, ModelArg};
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    model: ModelArg,
    #[command(flatten)]
    logs: LogArgs,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    let source = args.model.load()?;
    let logs = args.logs.prepare(&source.model)?;
    let result = compare(&source.model, &source.model.values(), &logs);
    print(format, &result, || human(&result))?;
    Ok(match result.verdict {
        Verdict::WithinFloor => Answer::Yes,
        Verdict::LeavesError => Answer::No,
        Verdict::FloorUnknown => Answer::CannotTell,
    })
}
