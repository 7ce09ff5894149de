//! `coordinator`: the command line.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};
use coordinator::cmd;
use node::log::LogFormat;
use node::manual;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Tender's coordinator: decides which robot docks where and when, recharge or exchange, from
/// which pack, and how many robots each pack can still service.
#[derive(Parser)]
#[command(version, after_help = AFTER)]
struct Cli {
    /// How log lines look: text or json.
    #[arg(long, global = true, env = "TENDER_LOG_FORMAT", default_value_t, value_name = "FORMAT")]
    log_format: LogFormat,
    #[command(subcommand)]
    command: Command,
}

const AFTER: &str = "Exit status: 0 yes, 1 no, 2 could not answer. Answers go to stdout, logs to stderr (RUST_LOG chooses how much).";

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
    /// Makes a scenario of another program's description of a fleet.
    Import(cmd::import::Args),
    /// Makes the certificates by which a site's processes know each other.
    Certs(cmd::certs::Args),
    /// Checks what a coordinator needs here, and says what to do.
    Doctor(cmd::doctor::Args),
    /// Starts a whole demonstration fleet on this machine.
    Demo(cmd::demo::Args),
    /// Prints a completion script for a shell.
    Completions {
        /// Which shell.
        shell: manual::Shell,
    },
    /// Writes manual pages into a folder.
    Man {
        /// The folder.
        dir: PathBuf,
    },
    #[command(hide = true)]
    Agent(cmd::demo::AgentArgs),
}

fn main() -> ExitCode {
    let Cli { log_format, command } = Cli::parse();
    node::log::to_stderr("coordinator", log_format);
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
        Command::Import(args) => cmd::import::execute(&args),
        Command::Certs(args) => cmd::certs::execute(&args),
        Command::Doctor(args) => live()?.block_on(cmd::doctor::execute(&args)),
        Command::Completions { shell } => manual::write_completions(Cli::command(), shell).map(|()| ExitCode::SUCCESS),
        Command::Man { dir } => manual::write_manual(Cli::command(), &dir).map(|()| ExitCode::SUCCESS),
        Command::Demo(args) => live()?.block_on(cmd::demo::execute(&args)),
        Command::Agent(args) => live()?.block_on(cmd::demo::agent(&args)),
    }
}
