//! What the whole-system tests share: the real programs, a fleet of them, and patience.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use coordinator::scenario::{Deployment, Scenario};
use node::{ClockConfig, NetworkConfig};
use serde::Serialize;

/// Root of the workspace.
#[must_use]
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace holds this crate").to_owned()
}

/// A program of the workspace, built when it is not; or the one in the folder `TENDER_PROGRAMS`, where
/// programs that were built elsewhere are to be tested.
///
/// # Panics
/// When it does not build.
#[must_use]
pub fn program(name: &str) -> Command {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let built = || std::env::var_os("TENDER_PROGRAMS").map_or_else(build, PathBuf::from);
    Command::new(FOLDER.get_or_init(built).join(name))
}

/// Builds all programs beside this test and gives their folder. Built together with all tests they share
/// the features of every dependency with them, so after `cargo test --workspace` hardly anything is left
/// to do.
fn build() -> PathBuf {
    let this = std::env::current_exe().expect("a test is a file");
    let folder = this.ancestors().nth(2).expect("tests are built two folders deep").to_owned();
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--quiet", "--workspace", "--bins", "--tests", "--target-dir"]).arg(folder.parent().expect("a target folder"));
    cargo.current_dir(workspace());
    if !cfg!(debug_assertions) {
        cargo.arg("--release");
    }
    assert!(cargo.status().is_ok_and(|status| status.success()), "the programs do not build");
    folder
}

/// A program at work, ended when the test is.
#[derive(Debug)]
pub struct Running(Child);

impl Running {
    /// Names of the process' threads, where the system tells them.
    #[must_use]
    pub fn threads(&self) -> Option<Vec<String>> {
        let names = std::fs::read_dir(format!("/proc/{}/task", self.0.id())).ok()?.flatten();
        Some(
            names
                .filter_map(|thread| std::fs::read_to_string(thread.path().join("comm")).ok())
                .map(|name| name.trim().to_owned())
                .collect(),
        )
    }

    /// Kills the process at once, as a power cut would.
    pub fn kill(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }

    /// Tells the process to stop, as a service manager would; its exit code, when it has ended in time by itself.
    pub fn stop(&mut self, within: Duration) -> Option<i32> {
        let told = Command::new("kill").args(["-TERM", &self.0.id().to_string()]).status();
        let ended = told.is_ok_and(|status| status.success()) && patiently(within, || self.ended());
        if ended { self.0.wait().ok()?.code() } else { None }
    }

    /// Whether the process has ended.
    pub fn ended(&mut self) -> bool {
        self.0.try_wait().is_ok_and(|status| status.is_some())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Starts a program in the background.
///
/// # Errors
/// When it cannot be started.
pub fn start(mut command: Command) -> anyhow::Result<Running> {
    command.stdin(Stdio::null()).stdout(Stdio::null());
    Ok(Running(command.spawn().with_context(|| format!("{command:?}"))?))
}

/// A port that nobody has now, and that nobody else gets before the program that it is for listens on it.
///
/// A port that the system gave for a moment would be anybody's again by then: another test's, or either
/// end of some connection. So it is one below those that systems give out by themselves (Linux from
/// 32768, others from 49152), and each is given once.
///
/// # Errors
/// When this machine has none.
pub fn free_port() -> anyhow::Result<u16> {
    const FIRST: u16 = 20_000;
    const COUNT: u16 = 12_000;
    static GIVEN: AtomicU32 = AtomicU32::new(0);
    // Another test program at the same time begins elsewhere.
    let begin = std::process::id().wrapping_mul(97);
    let next = || FIRST + (begin.wrapping_add(GIVEN.fetch_add(1, Ordering::Relaxed)) % u32::from(COUNT)) as u16;
    let free = |port: &u16| TcpListener::bind(("127.0.0.1", *port)).is_ok();
    (0..COUNT).map(|_| next()).find(free).context("no port from 20000 to 31999 is free")
}

/// What a dashboard on this machine answers on a route, if it does and that is JSON.
#[must_use]
pub fn ask(port: u16, route: &str) -> Option<serde_json::Value> {
    let answer = read(port, route)?;
    // One chunk or several: the JSON lies between the first brace and the last.
    let (from, to) = (answer.find('{')?, answer.rfind('}')?);
    serde_json::from_str(&answer[from..=to]).ok()
}

/// The same, as it comes: head and all.
#[must_use]
pub fn read(port: u16, route: &str) -> Option<String> {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
    write!(stream, "GET {route} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n").ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    Some(answer)
}

/// A fleet described by a scenario, as files of real programs.
#[derive(Debug)]
pub struct Fleet {
    /// Folder of configurations and store.
    pub folder: tempfile::TempDir,
    /// What the files say.
    pub deployment: Deployment,
    /// One fleet at a time: its clock is fast, and a machine busy with others would make it miss
    /// what lies seconds apart.
    _alone: MutexGuard<'static, ()>,
}

/// Held by the fleet that runs.
static ALONE: Mutex<()> = Mutex::new(());

impl Fleet {
    /// Writes a fleet's configurations, on a free port and a clock of this speed.
    ///
    /// # Errors
    /// When the scenario or a file is not good.
    pub fn new(scenario: &Path, speed: f64) -> anyhow::Result<Self> {
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        // Built before the clock begins.
        let _ = program("coordinator");
        let scenario = Scenario::parse(scenario, &node::files::read_text(scenario)?)?;
        let runs = scenario.runs();
        let mut deployment = scenario.deploy(runs.last().context("no run")?, scenario.seed)?;
        let port = free_port()?;
        let clock = ClockConfig { speed, origin_unix_ms: node::clock::unix_ms() };
        deployment.place(&format!("tcp/127.0.0.1:{port}"), clock);
        let fleet = Self { folder: tempfile::tempdir()?, deployment, _alone: alone };
        fleet.write()?;
        Ok(fleet)
    }

    /// Writes the configurations again, after a change.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self) -> anyhow::Result<()> {
        self.put("coordinator.toml", &self.deployment.coordinator)?;
        for station in &self.deployment.stations {
            self.put(&format!("{}.toml", station.id), station)?;
        }
        for robot in &self.deployment.robots {
            self.put(&format!("{}.toml", robot.id), robot)?;
        }
        Ok(())
    }

    fn put<T: Serialize>(&self, name: &str, config: &T) -> anyhow::Result<()> {
        node::files::write_text(&self.path(name), &toml::to_string(config)?)
    }

    /// A file of the fleet.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Starts the coordinator.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn coordinator(&self) -> anyhow::Result<Running> {
        let mut command = program("coordinator");
        command.args(["run", "--config"]).arg(self.path("coordinator.toml"));
        start(command)
    }

    /// Starts every station and robot.
    ///
    /// # Errors
    /// When one cannot be started.
    pub fn agents(&self) -> anyhow::Result<Vec<Running>> {
        let stations = self.deployment.stations.iter().map(|station| ("station-agent", station.id.to_string()));
        let robots = self.deployment.robots.iter().map(|robot| ("robot-agent", robot.id.to_string()));
        let agent = |(name, id): (&'static str, String)| {
            let mut command = program(name);
            command.args(["run", "--config"]).arg(self.path(&format!("{id}.toml")));
            start(command)
        };
        stations.chain(robots).map(agent).collect()
    }

    /// How a program of the test's own reaches the fleet.
    #[must_use]
    pub fn network(&self) -> NetworkConfig {
        NetworkConfig { connect: self.deployment.coordinator.network.listen.clone(), ..NetworkConfig::agent() }
    }

    /// Runs `coordinator schedule ...` and waits for it.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn schedule(&self, arguments: &[&str]) -> anyhow::Result<Output> {
        let mut command = program("coordinator");
        command.arg("schedule").args(arguments).arg("--config").arg(self.path("coordinator.toml"));
        Ok(command.stdin(Stdio::null()).output()?)
    }

    /// Everything that the store says has happened.
    ///
    /// # Errors
    /// When the store cannot be read.
    pub fn events(&self) -> anyhow::Result<Vec<proto::Event>> {
        let output = self.schedule(&["history", "--events", "100000", "--format", "json"])?;
        ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        Ok(serde_json::from_slice(&output.stdout)?)
    }

    /// Waits until the history holds such an event.
    ///
    /// # Errors
    /// When it does not in time; the error holds the history.
    pub fn wait_for(&self, what: &str, limit: Duration, found: impl Fn(&proto::Event) -> bool) -> anyhow::Result<()> {
        let mut last = Vec::new();
        let came = patiently(limit, || {
            last = self.events().unwrap_or_default();
            last.iter().any(&found)
        });
        let texts: Vec<String> = last.iter().map(|event| format!("{} {}", event.kind, event.text)).collect();
        ensure!(came, "no {what} within {limit:?}; what happened:\n{}", texts.join("\n"));
        Ok(())
    }
}

/// Looks again and again until it is so, or the time is up.
#[allow(clippy::disallowed_methods, reason = "tests of real processes wait in real time")]
pub fn patiently(limit: Duration, mut so: impl FnMut() -> bool) -> bool {
    let begin = Instant::now();
    while begin.elapsed() < limit {
        if so() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    so()
}
