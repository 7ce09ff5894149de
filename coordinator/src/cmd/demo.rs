//! `coordinator demo`: a whole fleet of processes on this machine, on faster time.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{ExitCode, Stdio};
use std::time::Duration;

use anyhow::{Context, ensure};
use node::files::write_text;
use node::{ClockConfig, NetworkConfig};
use proto::{Key, Schedule};
use serde::Serialize;
use tokio::process::{Child, Command};

use crate::config::Config;
use crate::scenario::{Deployment, Scenario};
use crate::service;

/// The fleet that is started when no scenario is named.
const DEMO: &str = include_str!("../../../scenarios/demo.toml");

/// Starts a coordinator, stations and robots as separate processes with simulated bodies, and
/// shows the schedule as it changes.
#[derive(clap::Args)]
pub struct Args {
    /// The scenario file; a small fleet when none is named.
    scenario: Option<PathBuf>,
    /// Seconds of fleet time per real second.
    #[arg(long, default_value_t = 60.0)]
    speed: f64,
    /// Folder for the configurations and the store.
    #[arg(long, value_name = "DIR", default_value = "tender-demo")]
    dir: PathBuf,
    /// Another seed than the scenario's.
    #[arg(long)]
    seed: Option<u64>,
    /// Only the run of this name.
    #[arg(long, value_name = "NAME")]
    run: Option<String>,
    /// Stop after this many real seconds.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
}

/// One process of a demonstration, which ends when `demo` does, however that ends.
#[derive(clap::Args)]
pub struct AgentArgs {
    /// Which process.
    kind: Kind,
    /// Its configuration file.
    config: PathBuf,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Kind {
    Coordinator,
    Robot,
    Station,
}

/// Runs one process of a demonstration.
///
/// # Errors
/// When its configuration cannot be read or the coordinator is lost.
pub async fn agent(args: &AgentArgs) -> anyhow::Result<ExitCode> {
    end_with_parent();
    match args.kind {
        Kind::Coordinator => service::run(&Config::read(&args.config)?, Some(&args.config)).await?,
        Kind::Robot => {
            let config = robot_agent::Config::read(&args.config)?;
            let (agent, source) = config.build(Some(&args.config))?;
            robot_agent::run(&config, agent, source).await?;
        }
        Kind::Station => {
            let config = station_agent::Config::read(&args.config)?;
            let (agent, source) = config.build_simulated(Some(&args.config))?;
            station_agent::run(&config, agent, Box::new(source)).await?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Ends this process when its standard input does: `demo` holds the other end.
fn end_with_parent() {
    std::thread::spawn(|| {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        std::process::exit(0);
    });
}

/// Runs the command.
///
/// # Errors
/// When the scenario cannot be read, the folder cannot be written, or a process does not start.
pub async fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    ensure!(args.speed.is_finite() && args.speed > 0.0, "--speed {}: must be a positive number", args.speed);
    let scenario = match &args.scenario {
        Some(path) => Scenario::parse(path, &node::files::read_text(path)?)?,
        None => Scenario::parse(Path::new("demo.toml"), DEMO)?,
    };
    let runs = scenario.runs();
    let chosen = match &args.run {
        Some(name) => runs.iter().find(|run| run.name == *name).with_context(|| format!("--run {name}: there is no such run"))?,
        None => runs.last().context("the scenario has no run")?,
    };
    let mut deployment = scenario.deploy(chosen, args.seed.unwrap_or(scenario.seed))?;
    let endpoint = format!("tcp/127.0.0.1:{}", free_port()?);
    deployment.place(&endpoint, ClockConfig { speed: args.speed, origin_unix_ms: node::clock::unix_ms() });
    std::fs::create_dir_all(&args.dir).with_context(|| format!("cannot make {}", args.dir.display()))?;
    let files = write(&deployment, &args.dir)?;

    println!("{} at {} times real time; files in {}", scenario.name, args.speed, args.dir.display());
    println!("In another terminal:\n  coordinator schedule capacity --config {}", files.coordinator.display());
    println!(
        "  coordinator schedule explain {} --config {}\n",
        deployment.robots.first().map_or("ROBOT", |robot| robot.id.as_ref()),
        files.coordinator.display()
    );
    let _children = start(&files)?;
    let watched = watch(&deployment.coordinator.network, &deployment.coordinator.site);
    let limit = tokio::time::sleep(args.seconds.map_or(Duration::MAX / 4, Duration::from_secs_f64));
    tokio::select! {
        () = watched => {}
        () = limit => {}
        () = node::told_to_stop() => {}
    }
    Ok(ExitCode::SUCCESS)
}

struct Files {
    coordinator: PathBuf,
    agents: Vec<(&'static str, PathBuf)>,
}

/// Writes one configuration per process: the files that a real fleet would have.
fn write(deployment: &Deployment, folder: &Path) -> anyhow::Result<Files> {
    let put = |name: String, text: String| -> anyhow::Result<PathBuf> {
        let path = folder.join(name);
        write_text(&path, &text)?;
        Ok(path)
    };
    let coordinator = put("coordinator.toml".to_owned(), toml(&deployment.coordinator)?)?;
    let mut agents = Vec::new();
    for station in &deployment.stations {
        agents.push(("station", put(format!("station-{}.toml", station.id), toml(station)?)?));
    }
    for robot in &deployment.robots {
        agents.push(("robot", put(format!("robot-{}.toml", robot.id), toml(robot)?)?));
    }
    Ok(Files { coordinator, agents })
}

fn toml<T: Serialize>(config: &T) -> anyhow::Result<String> {
    Ok(toml::to_string(config)?)
}

fn start(files: &Files) -> anyhow::Result<Vec<Child>> {
    let own = std::env::current_exe().context("the path of this program")?;
    let spawn = |(kind, path): (&str, &Path)| {
        let mut command = Command::new(&own);
        command.args(["agent", kind]).arg(path).env("RUST_LOG", "error").stdin(Stdio::piped()).kill_on_drop(true);
        command.spawn().with_context(|| format!("cannot start {} for {}", own.display(), path.display()))
    };
    let agents = files.agents.iter().map(|(kind, path)| (*kind, path.as_path()));
    std::iter::once(("coordinator", files.coordinator.as_path())).chain(agents).map(spawn).collect()
}

/// A port that nobody listens on now.
fn free_port() -> anyhow::Result<u16> {
    let listener = TcpListener::bind("127.0.0.1:0").context("no free port on 127.0.0.1")?;
    Ok(listener.local_addr()?.port())
}

/// Prints the schedule whenever it has changed.
async fn watch(network: &NetworkConfig, site: &proto::SiteId) {
    let asking = NetworkConfig { connect: network.listen.clone(), listen: Vec::new(), lease_s: network.lease_s };
    let mut shown = Vec::new();
    loop {
        tokio::time::sleep(Duration::from_millis(500)).await;
        let Ok(Some(schedule)) = service::ask::<Schedule>(&asking, site, &Key::Schedule).await else { continue };
        let state: Vec<_> = schedule.services.iter().map(|service| (service.robot.clone(), service.status)).collect();
        if schedule.plan > 0 && state != shown {
            shown = state;
            super::schedule::show(&schedule);
            println!();
        }
    }
}
