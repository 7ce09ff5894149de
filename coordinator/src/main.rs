//! `coordinator`: the command line.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use coordinator::cmd;

/// Tender's coordinator: decides which robot docks where and when, recharge or exchange, from
/// which pack, and how many robots each pack can still service.
#[derive(Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs a scenario faster than real time and checks what it expects.
    Simulate(cmd::simulate::Args),
}

fn main() -> ExitCode {
    node::files::log_to_stderr("coordinator");
    let result = match Cli::parse().command {
        Command::Simulate(args) => cmd::simulate::execute(&args),
    };
    result.unwrap_or_else(|error| {
        eprintln!("coordinator: {error:#}");
        ExitCode::from(2)
    })
}
