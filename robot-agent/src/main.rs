//! `robot-agent`: the command line.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, bail};
use clap::{CommandFactory as _, Parser, Subcommand};
use node::files::ModelRef;
use node::log::LogFormat;
use node::{ClockConfig, NetworkConfig, manual};
use proto::{RobotId, SiteId, StationId};
use robot_agent::{Config, SourceConfig, SourceKind};

/// Tender's agent beside a robot: publishes its fuel gauge and state over Zenoh and carries out
/// the coordinator's commands.
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
    /// Runs the agent until the source ends or Ctrl-C.
    Run(Box<RunArgs>),
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

#[derive(clap::Args)]
struct RunArgs {
    /// Configuration file; flags come before the environment, that before the file.
    #[arg(long, value_name = "FILE", env = "TENDER_CONFIG")]
    config: Option<PathBuf>,
    /// Sets a key of the configuration, such as publish.gauge_period_s=5; before the environment's
    /// TENDER_SET_PUBLISH__GAUGE_PERIOD_S.
    #[arg(long, value_name = "KEY=VALUE", requires = "config")]
    set: Vec<String>,
    /// The robot's id.
    #[arg(long)]
    id: Option<RobotId>,
    /// The site.
    #[arg(long)]
    site: Option<SiteId>,
    /// Battery model of the gauge: a built-in name or a file.
    #[arg(long, value_name = "MODEL")]
    battery: Option<String>,
    /// Where samples come from.
    #[arg(long, value_enum)]
    source: Option<SourceKind>,
    /// What the source reads: see --source.
    #[arg(value_name = "WHAT")]
    what: Option<String>,
    /// A station in reach and the seconds it takes to get there, such as mds-1=60.
    #[arg(long, value_name = "STATION=SECONDS", value_parser = travel)]
    travel: Vec<(StationId, f64)>,
    /// Address of the coordinator or router, such as tcp/127.0.0.1:7447.
    #[arg(long, value_name = "ADDRESS")]
    connect: Vec<String>,
    /// Folder for logs that `lab` reads: the battery's, and the load's where its inputs are known.
    #[arg(long, value_name = "DIR")]
    log: Option<PathBuf>,
    /// Seconds of fleet time per real second, for demonstrations and replays.
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    speed: Option<f64>,
}

fn main() -> ExitCode {
    let Cli { log_format, command } = Cli::parse();
    match execute(log_format, command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("robot-agent: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn execute(log_format: LogFormat, command: Command) -> anyhow::Result<()> {
    let args = match command {
        Command::Run(args) => args,
        Command::Completions { shell } => return manual::write_completions(Cli::command(), shell),
        Command::Man { dir } => return manual::write_manual(Cli::command(), &dir),
    };
    node::log::to_stderr("robot_agent", log_format);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    runtime.block_on(run(*args))
}

async fn run(args: RunArgs) -> anyhow::Result<()> {
    let log = args.log.clone().map(node::LiveLog::new);
    let (config, path) = configured(args)?;
    node::begin_with_one_thread(&config.network)?;
    let (mut agent, mut source) = config.build(path.as_deref())?;
    let memory = node::MemoryFile::new(config.id.as_str(), config.memory.as_deref(), path.as_deref());
    if let Some(kept) = memory.read::<robot_agent::Memory>()? {
        kept.place().into_iter().for_each(|place| source.stand(place));
        agent.restore(kept);
    }
    robot_agent::run(&config, agent, source, memory, log).await
}

/// The configuration file with the flags laid over it; or the flags alone.
fn configured(args: RunArgs) -> anyhow::Result<(Config, Option<PathBuf>)> {
    let mut config = match &args.config {
        Some(path) => Config::read_with(path, &args.set)?,
        None => {
            let id = args.id.clone().context("--id is needed when there is no --config")?;
            let source = SourceConfig::of(args.source.unwrap_or(SourceKind::Sim), args.what.as_deref())?;
            let battery = args.battery.clone().context("--battery is needed when there is no --config: the gauge needs a model")?;
            Config {
                schema: 1,
                id,
                site: args.site.clone().unwrap_or_else(default_site),
                gauge: energy::gauge::Kind::default(),
                battery: ModelRef::Name(battery),
                load: None,
                mission: node::mission::Mission::default(),
                travel_s: Default::default(),
                way: None,
                publish: node::Publish::default(),
                alone: robot_agent::Alone::default(),
                memory: None,
                source,
                body: robot_agent::source::Body::default(),
                network: NetworkConfig::agent(),
                clock: None,
            }
        }
    };
    if let Some(id) = args.id {
        config.id = id;
    }
    if let Some(site) = args.site {
        config.site = site;
    }
    if args.config.is_some() {
        match (args.source, &args.what) {
            // What the file says of it.
            (Some(SourceKind::Sim), None) if matches!(config.source, SourceConfig::Sim { .. }) => {}
            (Some(kind), what) => config.source = SourceConfig::of(kind, what.as_deref())?,
            (None, Some(what)) => bail!("{what}: goes with --source"),
            (None, None) => {}
        }
        if let Some(battery) = args.battery {
            config.battery = ModelRef::Name(battery);
        }
    }
    config.travel_s.extend(args.travel);
    if !args.connect.is_empty() {
        config.network.connect = args.connect;
    }
    if let Some(speed) = args.speed {
        anyhow::ensure!(speed.is_finite() && speed > 0.0, "--speed {speed}: must be a positive number");
        config.clock = Some(ClockConfig { speed, origin_unix_ms: node::clock::unix_ms() });
    }
    config.check()?;
    Ok((config, args.config))
}

/// `mds-1=60`.
fn travel(text: &str) -> Result<(StationId, f64), String> {
    let (station, time_s) = text.split_once('=').ok_or("expected STATION=SECONDS, such as mds-1=60")?;
    let time_s = time_s.parse().map_err(|_| format!("`{time_s}` is not a number of seconds"))?;
    Ok((StationId::new(station).map_err(|error| error.to_string())?, time_s))
}

fn default_site() -> SiteId {
    SiteId::new("site").expect("a valid id")
}
