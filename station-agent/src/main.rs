//! `station-agent`: the command line.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{CommandFactory as _, Parser, Subcommand};
use node::log::LogFormat;
use node::manual;
use station_agent::Config;

/// Tender's agent beside a docking station: publishes the gauges of its packs and the state of
/// its bays over Zenoh and carries out the coordinator's commands.
#[derive(Parser)]
#[command(version)]
struct Cli {
    /// How log lines look: text or json.
    #[arg(long, global = true, env = "TENDER_LOG_FORMAT", default_value_t, value_name = "FORMAT")]
    log_format: LogFormat,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs the agent until Ctrl-C.
    Run {
        /// Configuration file; flags come before the environment, that before the file.
        #[arg(long, value_name = "FILE", env = "TENDER_CONFIG")]
        config: PathBuf,
        /// Sets a key of the configuration, such as publish.gauge_period_s=5; before the environment's
        /// TENDER_SET_PUBLISH__GAUGE_PERIOD_S.
        #[arg(long, value_name = "KEY=VALUE")]
        set: Vec<String>,
        /// Address of the coordinator or router, such as tcp/127.0.0.1:7447.
        #[arg(long, value_name = "ADDRESS")]
        connect: Vec<String>,
        /// Folder for logs that `lab` reads: one for each pack, and the station's load where its inputs
        /// are known.
        #[arg(long, value_name = "DIR")]
        log: Option<PathBuf>,
    },
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
}

fn main() -> ExitCode {
    let Cli { log_format, command } = Cli::parse();
    match execute(log_format, command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("station-agent: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn execute(log_format: LogFormat, command: Command) -> anyhow::Result<()> {
    let (config, set, connect, log) = match command {
        Command::Run { config, set, connect, log } => (config, set, connect, log),
        Command::Completions { shell } => return manual::write_completions(Cli::command(), shell),
        Command::Man { dir } => return manual::write_manual(Cli::command(), &dir),
    };
    node::log::to_stderr("station_agent", log_format);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    runtime.block_on(run(config, &set, connect, log))
}

async fn run(path: PathBuf, set: &[String], connect: Vec<String>, log: Option<PathBuf>) -> anyhow::Result<()> {
    let mut config = Config::read_with(&path, set)?;
    if !connect.is_empty() {
        config.network.connect = connect;
        config.network.check().context("--connect")?;
    }
    node::begin_with_one_thread(&config.network)?;
    let (mut agent, mut source) = config.build(Some(&path))?;
    let memory = node::MemoryFile::new(config.id.as_str(), config.memory.as_deref(), Some(&path));
    if let Some(kept) = memory.read::<station_agent::Memory>()? {
        source.gave_out(&kept.depleted());
        agent.restore(kept);
    }
    station_agent::run(&config, agent, source, memory, log.map(node::LiveLog::new)).await
}
