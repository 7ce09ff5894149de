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
    /// Runs beside a fleet: the live service.
    Run(cmd::run::Args),
    /// Shows the schedule, what each pack can still service, and why.
    Schedule(cmd::schedule::Args),
    /// Plans an instance of the docking problem and proves how good the plan is.
    Plan(cmd::plan::Args),
    /// Tells a core again what a store's coordinators were told: does it decide the same?
    Replay(cmd::replay::Args),
    /// Makes the certificates by which a site's processes know each other.
    Certs(cmd::certs::Args),
    /// Starts a whole demonstration fleet on this machine.
    Demo(cmd::demo::Args),
    #[command(hide = true)]
    Agent(cmd::demo::AgentArgs),
}

fn main() -> ExitCode {
    let command = Cli::parse().command;
    node::files::log_to_stderr("coordinator");
    execute(command).unwrap_or_else(|error| {
        eprintln!("coordinator: {error:#}");
        ExitCode::from(2)
    })
}

fn execute(command: Command) -> anyhow::Result<ExitCode> {
    let live = || tokio::runtime::Builder::new_multi_thread().enable_all().build();
    match command {
        Command::Simulate(args) => cmd::simulate::execute(&args),
        Command::Run(args) => live()?.block_on(cmd::run::execute(&args)),
        Command::Schedule(args) => live()?.block_on(cmd::schedule::execute(&args)),
        Command::Plan(args) => cmd::plan::execute(&args),
        Command::Replay(args) => live()?.block_on(cmd::replay::execute(&args)),
        Command::Certs(args) => cmd::certs::execute(&args),
        Command::Demo(args) => live()?.block_on(cmd::demo::execute(&args)),
        Command::Agent(args) => live()?.block_on(cmd::demo::agent(&args)),
    }
}
