//! `coordinator replay`: the journal told to a core again.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;

use super::Format;
use crate::config::Config;
use crate::core::Core;
use crate::replay::{Inputs, Replay};
use crate::store::{Reader, Store};

/// Tells a core what the coordinators of a store were told, and checks that it decides the same.
#[derive(clap::Args)]
pub struct Args {
    /// The store: a file, or postgres://...
    store: PathBuf,
    /// Configuration with which the coordinators ran.
    #[arg(long, value_name = "FILE", default_value = "coordinator.toml")]
    config: PathBuf,
    /// Only this start of a coordinator, counted from 1.
    #[arg(long, value_name = "NUMBER")]
    epoch: Option<u64>,
    /// How to print.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// What came of one start.
#[derive(serde::Serialize)]
struct Told {
    epoch: u64,
    inputs: u64,
    same_decisions: usize,
    difference: Option<String>,
}

/// Lines that are read at a time.
const LINES: usize = 10_000;

/// Runs the command. Exit 0: everything was decided the same; 1: something was not.
///
/// # Errors
/// When store or configuration cannot be read.
pub async fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let reader = Store::open_read_only(&args.store).await?;
    let starts = reader.starts().await?;
    anyhow::ensure!(!starts.is_empty(), "store {}: no start of a coordinator is in it", reader.path().display());
    let config = Config::read(&args.config)?;
    let mut told = Vec::new();
    for (index, start) in starts.iter().enumerate().filter(|(_, start)| args.epoch.is_none_or(|epoch| start.epoch == epoch)) {
        told.push(replayed(&reader, &config, &args.config, *start, starts.get(index + 1).copied()).await?);
    }
    anyhow::ensure!(
        !told.is_empty(),
        "--epoch {}: store {} holds the starts {} to {}",
        args.epoch.unwrap_or_default(),
        reader.path().display(),
        starts[0].epoch,
        starts[starts.len() - 1].epoch
    );
    let same = told.iter().all(|told| told.difference.is_none());
    match args.format {
        Format::Json => say!("{}", serde_json::to_string_pretty(&told)?),
        Format::Table => told.iter().for_each(say_told),
    }
    Ok(ExitCode::from(u8::from(!same)))
}

fn say_told(told: &Told) {
    let Told { epoch, inputs, same_decisions, difference } = told;
    match difference {
        None => say!("start {epoch}: {inputs} inputs, {same_decisions} decisions, all the same"),
        Some(difference) => say!("start {epoch}: {inputs} inputs; not the same: {difference}"),
    }
}

async fn replayed(
    reader: &Reader,
    config: &Config,
    path: &Path,
    start: crate::core::Numbering,
    next: Option<crate::core::Numbering>,
) -> anyhow::Result<Told> {
    let (settings, models) = config.load(Some(path))?;
    let mut replay = Replay::new(Core::new(settings, models, start), start.epoch);
    let mut difference = None;
    // A coordinator that still writes may keep decisions between two of these reads: those read are at least the ones
    // that followed the inputs counted before, and at most those that followed the inputs read after.
    let whole = reader.heard_last(start.epoch).await?;
    let kept = reader.decisions(start, next).await.context("the decisions to compare with")?;
    'lines: loop {
        let lines = reader.heard(start.epoch, replay.told(), LINES).await?;
        for heard in &lines {
            let mut inputs = Inputs::of(&reader.message_of(heard).await?);
            if let Err(missing) = inputs.input(heard).and_then(|input| replay.tell(heard, input)) {
                difference = Some(missing);
                break 'lines;
            }
        }
        if lines.len() < LINES {
            break;
        }
    }
    let compared = replay.compare(&kept, whole);
    let same_decisions = *compared.as_ref().unwrap_or(&0);
    Ok(Told { epoch: start.epoch, inputs: replay.told(), same_decisions, difference: difference.or(compared.err()) })
}
