//! The simulator and its command, from outside.

mod calibration;
mod capacity;
mod commands;
mod faults;
mod fuzz;
mod import;
mod plan;
mod scenarios;
mod settings;
mod stories;
mod telemetry;
mod watch;

use std::path::{Path, PathBuf};
use std::process::Command;

use coordinator::models::Kept;
use coordinator::scenario::{RunEntry, Scenario};
use coordinator::sim::{self, Outcome};

/// A small scenario of five seconds; tests put mistakes into it.
const SMALL: &str = r#"schema = 1
name = "small"
duration_s = 5
[policy]
name = "least_slack"
[[station]]
id = "mds-1"
load = "mds-station"
bays = 1
load_s = 30
unload_s = 30
packs = [{ id = "pack-1", battery = "mds-3s4p-7600mah", soc = 1.0 }]
[[robot]]
id = "explorer"
count = 2
battery = "explorer-3s1p-1320mah"
load = "explorer-robot"
soc = 0.5
travel_s.mds-1 = 60
[[run]]
name = "plain"
believed.without = { "mds-station" = ["lift"] }
[expect]
robots_served = 0
"#;

/// The folder of scenario files.
fn scenario_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios")
}

fn read(file: &Path) -> Scenario {
    let text = std::fs::read_to_string(file).unwrap();
    Scenario::parse(file, &text).unwrap_or_else(|error| panic!("{error}"))
}

fn run(scenario: &Scenario, run: &RunEntry, seed: u64, telemetry: bool) -> Outcome {
    let deployment = scenario.deploy(run, seed).unwrap_or_else(|error| panic!("{error:#}"));
    let duration_s = *scenario.duration_s.get_ref();
    let kept = if telemetry { Kept::Logs("logs".to_owned()) } else { Kept::Nowhere };
    sim::simulate(&deployment, duration_s, scenario.temperature_degc, kept, &mut |_| {}).unwrap()
}

/// What `coordinator` answered.
struct Answer {
    code: i32,
    stdout: String,
    stderr: String,
}

fn simulate(folder: &Path, arguments: &[&str]) -> Answer {
    coordinator(folder, &[&["simulate"], arguments].concat())
}

fn coordinator(folder: &Path, arguments: &[&str]) -> Answer {
    let output = Command::new(env!("CARGO_BIN_EXE_coordinator"))
        .current_dir(folder)
        .env_remove("RUST_LOG")
        .env_remove("TENDER_CONFIG")
        .args(arguments)
        .output()
        .expect("the program starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    Answer { code: output.status.code().expect("an exit code"), stdout: text(output.stdout), stderr: text(output.stderr) }
}
