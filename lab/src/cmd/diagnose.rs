//! `lab diagnose`: one look at every effect that a model lacks.

use lab::infer::answer::{Discovery, Verdict};
use lab::infer::discover::Search;
use lab::infer::look::{Outcome, Step};
use lab::report::discovery::Reach;

use super::busy::while_telling;
use super::case::Case;
use super::inputs::{LogInputs, ModelArg};
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    model: ModelArg,
    #[command(flatten)]
    logs: LogInputs,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    let mut case = Case::read(&args.model, &args.logs)?;
    let step = while_telling(format!("looking at what {} lacks", case.source.model.name), |told| {
        let base = case.fitted();
        Step::look_and_tell(base, case.held.as_ref(), told)
    });
    // One look says whether something is missing, and what is the best of it: whether that is all is
    // for the whole search to say.
    let (verdict, last) = match &step.outcome {
        Outcome::Complete => (Verdict::Complete, step.base.clone()),
        Outcome::Unknown => (Verdict::Unknown, step.base.clone()),
        Outcome::Missing(alike) if alike.is_empty() => (Verdict::Missing, step.trials[0].state.clone()),
        Outcome::Missing(_) => (Verdict::Ambiguous, step.trials[0].state.clone()),
    };
    let search = Search { steps: vec![step], last: last.undiluted() };
    let found = case.learned(search.last.told(), None, None)?;
    let report = case.report(Discovery { verdict, ..Discovery::of(&search) }, search.last.told(), &found, Reach::OneLook, None);
    print(format, &report, || report.human())?;
    Ok(if verdict == Verdict::Complete { Answer::Yes } else { Answer::No })
}
