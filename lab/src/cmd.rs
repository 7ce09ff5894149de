//! The command line: one file per verb. Exit 0 yes, 1 no, 2 could not answer.

mod add;
mod busy;
mod case;
mod compare;
mod diagnose;
mod discover;
mod drive;
mod effects;
mod fit;
mod inputs;
mod ocv;
mod predict;
mod propose;
mod report;
mod save;

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{CommandFactory as _, Parser, Subcommand, ValueEnum};
use serde::Serialize;

/// Compares energy models of batteries, robots and stations with measurements, and calibrates
/// them.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
#[command(after_help = "Exit status: 0 yes, 1 no, 2 could not answer. Data goes to stdout, everything else to stderr.")]
pub(crate) struct Cli {
    /// How to print the answer.
    #[arg(long, value_enum, default_value_t, global = true)]
    format: Format,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum Format {
    /// Tables for people.
    #[default]
    Human,
    /// One JSON document.
    Json,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Print the catalogue of physical effects, or all about one of them.
    Effects(effects::Args),
    /// Make a first model of a battery of its own logs: capacity, open-circuit voltage, resistance.
    Ocv(ocv::Args),
    /// Make a first model of a robot of data sheets: what its drive takes, and what it can do.
    Drive(drive::Args),
    /// Predict the measured channels of a log, row by row.
    Predict(predict::Args),
    /// Compare a model with logs: error against the sensor floor, and where it lies.
    Compare(compare::Args),
    /// Calibrate the free parameters of a model on logs.
    Fit(fit::Args),
    /// Add one effect to a model, refit it, and say what that is worth.
    Add(add::Args),
    /// Say which physical effect a model lacks, by one look at all of them.
    Diagnose(diagnose::Args),
    /// Add the effects that a model lacks, one after the other, and show the error fall.
    Discover(discover::Args),
    /// Propose a formula for an error that no effect of the catalogue explains.
    Propose(propose::Args),
    /// Write what a comparison found into one HTML file that reads without a network.
    Report(report::Args),
    /// Print a completion script for a shell.
    Completions {
        /// Which shell.
        shell: clap_complete::Shell,
    },
    /// Write manual pages into a folder.
    Man {
        /// The folder.
        dir: PathBuf,
    },
}

/// What a verb found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Answer {
    Yes,
    No,
    /// It has said on stdout why it cannot tell.
    CannotTell,
}

pub(crate) fn main(cli: Cli) -> ExitCode {
    let result = match cli.verb {
        Verb::Effects(args) => effects::run(&args, cli.format),
        Verb::Ocv(args) => ocv::run(&args, cli.format),
        Verb::Drive(args) => drive::run(&args, cli.format),
        Verb::Predict(args) => predict::run(&args, cli.format),
        Verb::Compare(args) => compare::run(&args, cli.format),
        Verb::Fit(args) => fit::run(&args, cli.format),
        Verb::Add(args) => add::run(&args, cli.format),
        Verb::Diagnose(args) => diagnose::run(&args, cli.format),
        Verb::Discover(args) => discover::run(&args, cli.format),
        Verb::Propose(args) => propose::run(&args, cli.format),
        Verb::Report(args) => report::run(&args, cli.format),
        Verb::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "lab", &mut script);
            tell(&script).map(|()| Answer::Yes)
        }
        Verb::Man { dir } => write_manual(&dir),
    };
    match result {
        Ok(Answer::Yes) => ExitCode::SUCCESS,
        Ok(Answer::No) => ExitCode::from(1),
        Ok(Answer::CannotTell) => ExitCode::from(2),
        Err(error) => {
            eprintln!("lab: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn write_manual(dir: &Path) -> anyhow::Result<Answer> {
    let written = std::fs::create_dir_all(dir).and_then(|()| clap_mangen::generate_to(Cli::command(), dir));
    written.with_context(|| format!("cannot write manual pages into {}", dir.display()))?;
    Ok(Answer::Yes)
}

/// Prints text or JSON on stdout. A reader that has gone away (`| head`) is no error.
fn print(format: Format, json: &impl Serialize, human: impl FnOnce() -> String) -> anyhow::Result<()> {
    let text = match format {
        Format::Human => human(),
        Format::Json => serde_json::to_string_pretty(json)? + "\n",
    };
    tell(text.as_bytes())
}

fn tell(answer: &[u8]) -> anyhow::Result<()> {
    match io::stdout().lock().write_all(answer) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}
