//! The `lab` program: compares energy models with measurements.

mod cmd;

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    lab::output::leave_nothing_behind();
    cmd::main(cmd::Cli::parse())
}
