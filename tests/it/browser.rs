//! The dashboard in a real browser: `tests/browser/page.mjs` looks at what these serve.
//!
//! Needs Chromium and Node, which are told to be absent otherwise; the driver comes from npm once.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

use anyhow::{Context, ensure};
use tests::{Fleet, ask, free_port, patiently, program, start, workspace};

/// The browser, if this machine has one, and Node with the driver.
fn browser() -> Option<(PathBuf, PathBuf)> {
    let found = |name: &str| {
        let path = std::env::var_os("PATH")?;
        std::env::split_paths(&path).map(|folder| folder.join(name)).find(|file| file.is_file())
    };
    let chromium = ["chromium", "chromium-browser", "google-chrome"].into_iter().find_map(found);
    let (Some(chromium), Some(_), Some(_)) = (chromium, found("node"), found("npm")) else {
        eprintln!("skipped: the dashboard is looked at where chromium, node and npm are installed");
        return None;
    };
    // Tests run side by side, and npm takes away what it puts anew: one of them fetches the driver for all.
    static DRIVER: OnceLock<PathBuf> = OnceLock::new();
    let driver = DRIVER.get_or_init(|| driver().expect("the browser's driver comes from npm"));
    Some((chromium, driver.clone()))
}

/// A copy of `tests/browser` with what npm installs, made once.
fn driver() -> anyhow::Result<PathBuf> {
    let (from, folder) = (workspace().join("tests/browser"), PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("browser"));
    std::fs::create_dir_all(&folder)?;
    for file in ["package.json", "package-lock.json", "page.mjs"] {
        std::fs::copy(from.join(file), folder.join(file)).with_context(|| file.to_owned())?;
    }
    if !folder.join("node_modules/playwright-core/package.json").is_file() {
        let installed = Command::new("npm").arg("ci").current_dir(&folder).stdin(Stdio::null()).output()?;
        ensure!(installed.status.success(), "npm ci: {}", String::from_utf8_lossy(&installed.stderr));
    }
    Ok(folder)
}

/// Runs the script; what does not hold is in the error. Screenshots stay in the target folder.
fn look(browser: &(PathBuf, PathBuf), arguments: &[&str]) {
    let (chromium, driver) = browser;
    let shots = driver.join("shots");
    std::fs::create_dir_all(&shots).unwrap();
    let mut command = Command::new("node");
    command.arg(driver.join("page.mjs")).args(&arguments[..2]).arg(&shots).args(&arguments[2..]).env("CHROMIUM", chromium);
    let seen = command.output().unwrap();
    assert!(seen.status.success(), "{}{}", String::from_utf8_lossy(&seen.stdout), String::from_utf8_lossy(&seen.stderr));
}

fn short_scenario(folder: &Path) -> PathBuf {
    let text = std::fs::read_to_string(workspace().join("scenarios/mds-four-packs.toml")).unwrap();
    let path = folder.join("scenario.toml");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn an_ended_simulation_and_its_report_show_what_the_api_says() {
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (scenario, port) = (short_scenario(folder.path()), free_port().unwrap());
    let mut command = program("coordinator");
    command.arg("simulate").arg(scenario).arg("--out").arg(folder.path().join("out"));
    command.args(["--serve", "--speed", "100000", "--port", &port.to_string()]);
    let _running = start(command).unwrap();
    let report = folder.path().join("out/report.html");
    // The report is written when all runs have ended; from then on nothing changes.
    assert!(patiently(Duration::from_secs(120), || report.is_file()), "no report");
    assert!(patiently(Duration::from_secs(10), || ask(port, "/api/v1/capacity").is_some()), "no answer");
    look(&browser, &["frozen", &format!("http://127.0.0.1:{port}/")]);
    look(&browser, &["report", &format!("file://{}", report.display())]);
}

#[test]
fn a_live_fleet_moves_on_the_page_and_only_the_token_changes_it() {
    let Some(browser) = browser() else { return };
    const TOKEN: &str = "a-token-of-this-test";
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 20.0).unwrap();
    let web = &mut fleet.deployment.coordinator.web;
    (web.port, web.token) = (free_port().unwrap(), Some(TOKEN.to_owned()));
    let port = web.port;
    fleet.write().unwrap();
    let _coordinator = fleet.coordinator().unwrap();
    let mut agents = fleet.agents().unwrap();
    let planned = || ask(port, "/api/v1/schedule").is_some_and(|schedule| schedule["plan"].as_u64() > Some(0));
    assert!(patiently(Duration::from_secs(60), planned), "no plan");
    // The last agent is that of the last robot.
    let gone = fleet.deployment.robots.last().unwrap().id.to_string();
    drop(agents.pop());
    look(&browser, &["live", &format!("http://127.0.0.1:{port}/"), TOKEN, &gone]);
}
