//! `coordinator demo`: a whole fleet of processes on this machine, on faster time.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{ExitCode, Stdio};
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use energy::units::S_PER_DAY;
use node::files::write_text;
use node::{ClockConfig, NetworkConfig};
use proto::{Key, Schedule};
use serde::Serialize;
use tokio::process::{Child, Command};

use crate::config::Config;
use crate::scenario::{Deployment, Scenario};
use crate::service;
use crate::web::WebConfig;

/// Longest demonstration, real seconds.
const SECONDS_MAX: f64 = 30.0 * S_PER_DAY;

/// The fleet that is started when no scenario is named.
const DEMO: &str = include_str!("../../../scenarios/demo.toml");

/// Starts a coordinator, stations and robots as separate processes with simulated bodies, and
/// shows the schedule as it changes.
#[derive(clap::Args)]
pub struct Args {
    /// The scenario file; a small fleet when none is named.
    scenario: Option<PathBuf>,
    /// Seconds of fleet time per real second.
    #[arg(long, default_value_t = 60.0, allow_negative_numbers = true)]
    speed: f64,
    /// Folder for the configurations and the store.
    #[arg(long, value_name = "DIR", default_value = "tender-demo")]
    dir: PathBuf,
    /// Another seed than the scenario's.
    #[arg(long, allow_negative_numbers = true, value_parser = super::seed)]
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
    match args.kind {
        Kind::Coordinator => service::run(&Config::read(&args.config)?, Some(&args.config), parent_ended()).await?,
        Kind::Robot => {
            let config = robot_agent::Config::read(&args.config)?;
            let (agent, source) = config.build(Some(&args.config))?;
            tokio::select! {
                ran = robot_agent::run(&config, agent, source, node::MemoryFile::new(config.id.as_str(), None, None), None) => ran?,
                () = parent_ended() => {}
            }
        }
        Kind::Station => {
            let config = station_agent::Config::read(&args.config)?;
            let (agent, source) = config.build_simulated(Some(&args.config))?;
            tokio::select! {
                ran = station_agent::run(&config, agent, Box::new(source), node::MemoryFile::new(config.id.as_str(), None, None), None) => ran?,
                () = parent_ended() => {}
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Waits until this process' standard input ends: `demo` holds the other end, and lets go of it
/// however it ends itself.
async fn parent_ended() {
    let (told, ended) = tokio::sync::oneshot::channel();
    std::thread::spawn(move || {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        let _ = told.send(());
    });
    let _ = ended.await;
}

/// Runs the command.
///
/// # Errors
/// When the scenario cannot be read, the folder cannot be written, or a process does not start.
pub async fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let clock = ClockConfig { speed: args.speed, origin_unix_ms: node::clock::unix_ms() };
    clock.check().context("--speed")?;
    let seconds = args.seconds.unwrap_or(SECONDS_MAX);
    ensure!((0.0..=SECONDS_MAX).contains(&seconds), "--seconds {seconds}: must be between 0 and {SECONDS_MAX}");
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
    deployment.place(&endpoint, clock);
    let web = &mut deployment.coordinator.web;
    web.port = if TcpListener::bind((web.address, WebConfig::PORT)).is_ok() { WebConfig::PORT } else { free_port()? };
    std::fs::create_dir_all(&args.dir).with_context(|| format!("cannot make {}", args.dir.display()))?;
    let files = write(&deployment, &args.dir)?;

    say!("{} at {} times real time; files in {}", scenario.name, args.speed, args.dir.display());
    say!("Dashboard: http://{}:{}/", deployment.coordinator.web.address, deployment.coordinator.web.port);
    say!("In another terminal:\n  coordinator schedule capacity --config {}", files.coordinator.display());
    say!(
        "  coordinator schedule explain {} --config {}\n",
        deployment.robots.first().map_or("ROBOT", |robot| robot.id.as_ref()),
        files.coordinator.display()
    );
    let mut children = start(&files)?;
    let watched = watch(&deployment.coordinator.network, &deployment.coordinator.site);
    let ended = tokio::select! {
        () = watched => None,
        () = tokio::time::sleep(Duration::from_secs_f64(seconds)) => None,
        () = node::told_to_stop() => None,
        ended = first_ended(&mut children) => Some(ended),
    };
    stop(children).await;
    match ended {
        Some(how) => bail!("a process of the fleet has ended by itself: {how}"),
        None => Ok(ExitCode::SUCCESS),
    }
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

fn start(files: &Files) -> anyhow::Result<Vec<(String, Child)>> {
    let own = std::env::current_exe().context("the path of this program")?;
    let spawn = |(kind, path): (&str, &Path)| {
        let mut command = Command::new(&own);
        command.args(["agent", kind]).arg(path).env("RUST_LOG", "error").stdin(Stdio::piped()).kill_on_drop(true);
        let child = command.spawn().with_context(|| format!("cannot start {} for {}", own.display(), path.display()))?;
        Ok((path.file_stem().unwrap_or_default().to_string_lossy().into_owned(), child))
    };
    let agents = files.agents.iter().map(|(kind, path)| (*kind, path.as_path()));
    std::iter::once(("coordinator", files.coordinator.as_path())).chain(agents).map(spawn).collect()
}

/// Waits until any process ends, and says which and how.
async fn first_ended(children: &mut [(String, Child)]) -> String {
    loop {
        for (name, child) in children.iter_mut() {
            if let Ok(Some(status)) = child.try_wait() {
                return format!("{name}, {status}");
            }
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
}

/// Ends every process by closing its input, and waits a little so that the store is closed.
async fn stop(mut children: Vec<(String, Child)>) {
    for (_, child) in &mut children {
        drop(child.stdin.take());
    }
    let all = async {
        for (_, child) in &mut children {
            let _ = child.wait().await;
        }
    };
    let _ = tokio::time::timeout(Duration::from_secs(3), all).await;
}

/// A port that nobody listens on now.
fn free_port() -> anyhow::Result<u16> {
    let listener = TcpListener::bind("127.0.0.1:0").context("no free port on 127.0.0.1")?;
    Ok(listener.local_addr()?.port())
}

/// Prints the schedule whenever it has changed.
async fn watch(network: &NetworkConfig, site: &proto::SiteId) {
    let asking = NetworkConfig { connect: network.listen.clone(), listen: Vec::new(), members: None, ..network.clone() };
    let mut shown = Vec::new();
    loop {
        tokio::time::sleep(Duration::from_millis(500)).await;
        let Ok(Some(schedule)) = service::ask::<Schedule>(&asking, site, &Key::Schedule).await else { continue };
        let state: Vec<_> = schedule.services.iter().map(|service| (service.robot.clone(), service.status)).collect();
        if schedule.plan > 0 && state != shown {
            shown = state;
            super::schedule::show(&schedule);
            say!();
        }
    }
}
