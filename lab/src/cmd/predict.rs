//! `lab predict`: what a model says about every row of a log.

use std::path::PathBuf;

use lab::output::{check_writable, write_whole};
use lab::predict::predict;
use lab::prepare::prepare;
use lab::report::prediction::{Predicted, csv_text};

use super::inputs::{Answered, FactArgs, ModelArg, spare};
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    model: ModelArg,
    /// The log to predict. Facts about L.csv are read from L.toml beside it.
    #[arg(long, value_name = "LOG")]
    log: PathBuf,
    #[command(flatten)]
    facts: FactArgs,
    /// Where to write the prediction as CSV; stdout when left out.
    #[arg(short, long, value_name = "OUT.csv")]
    output: Option<PathBuf>,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    if let Some(path) = &args.output {
        check_writable(path)?;
        spare(&args.log, path)?;
        args.model.spare(Some(path), Answered::Other)?;
    }
    let source = args.model.load()?;
    let log = args.facts.read(&args.log)?;
    let prepared = prepare(&source.model, &log)?;
    let prediction = predict(&source.model, &prepared, &source.model.values());
    let predicted = Predicted::of(&source.model, &prepared, &prediction);
    match &args.output {
        None => print(format, &predicted, || csv_text(&predicted))?,
        Some(path) => {
            write_whole(path, csv_text(&predicted).as_bytes())?;
            let summary = predicted.summary(path.display().to_string());
            print(format, &summary, || format!("{summary}\n"))?;
        }
    }
    Ok(Answer::Yes)
}
