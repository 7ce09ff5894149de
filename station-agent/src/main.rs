//! `station-agent`: the command line.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use node::files::log_to_stderr;
use station_agent::Config;

/// Tender's agent beside a docking station: publishes the gauges of its packs and the state of
/// its bays over Zenoh and carries out the coordinator's commands.
#[derive(Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs the agent until Ctrl-C.
    Run {
        /// Configuration file.
        #[arg(long, value_name = "FILE")]
        config: PathBuf,
        /// Address of the coordinator or router, such as tcp/127.0.0.1:7447.
        #[arg(long, value_name = "ADDRESS")]
        connect: Vec<String>,
        /// Folder for logs that `lab` reads: one for each pack, and the station's load where its inputs
        /// are known.
        #[arg(long, value_name = "DIR")]
        log: Option<PathBuf>,
    },
}

fn main() -> ExitCode {
    let Command::Run { config, connect, log } = Cli::parse().command;
    log_to_stderr("station_agent");
    let runtime = match tokio::runtime::Builder::new_multi_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => {
            eprintln!("station-agent: {error}");
            return ExitCode::from(2);
        }
    };
    match runtime.block_on(run(config, connect, log)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("station-agent: {error:#}");
            ExitCode::from(2)
        }
    }
}

async fn run(path: PathBuf, connect: Vec<String>, log: Option<PathBuf>) -> anyhow::Result<()> {
    let mut config = Config::read(&path)?;
    if !connect.is_empty() {
        config.network.connect = connect;
    }
    let (mut agent, source) = config.build_simulated(Some(&path))?;
    let memory = node::MemoryFile::new(config.memory.as_deref(), Some(&path));
    if let Some(kept) = memory.read()? {
        agent.restore(kept);
    }
    station_agent::run(&config, agent, Box::new(source), memory, log.map(node::LiveLog::new)).await
}
