//! The clients in `examples/python` at a running coordinator, with the public `eclipse-zenoh` package.

use std::process::{Command, Output};
use std::time::Duration;

use proto::EventKind;
use tests::{Fleet, patiently, workspace};

/// A Python that has the package: `TENDER_PYTHON`, or the one of this machine.
fn python() -> Option<String> {
    let candidates = [std::env::var("TENDER_PYTHON").unwrap_or_default(), "python3".to_owned()];
    let works = |python: &String| {
        let asked = Command::new(python).args(["-c", "import zenoh; zenoh.Query"]).output();
        !python.is_empty() && asked.is_ok_and(|asked| asked.status.success())
    };
    let found = candidates.into_iter().find(works);
    if found.is_none() {
        eprintln!("skipped: no Python with the package eclipse-zenoh; name one by TENDER_PYTHON");
    }
    found
}

fn example(python: &str, fleet: &Fleet, name: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(python);
    command.arg(workspace().join("examples/python").join(name)).args(["--site", "test", "--connect"]);
    command.arg(&fleet.network().connect[0]).args(arguments).output().unwrap()
}

#[test]
fn python_clients_follow_the_schedule_and_get_a_service() {
    let Some(python) = python() else { return };
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 1.0).unwrap();
    // Real time, and nobody but the station and the visitor: its clock is not a fast one.
    fleet.deployment.robots.clear();
    fleet.deployment.coordinator.robots.clear();
    fleet.deployment.coordinator.clock = None;
    fleet.deployment.stations.iter_mut().for_each(|station| station.clock = None);
    fleet.write().unwrap();
    let _coordinator = fleet.coordinator().unwrap();
    let _agents = fleet.agents().unwrap();
    let joined = |event: &proto::Event| event.kind == EventKind::Joined && event.station.is_some();
    fleet.wait_for("station", Duration::from_secs(60), joined).unwrap();

    let asked = example(&python, &fleet, "ask_for_service.py", &["--id", "visitor-1", "--patience", "60"]);
    let (said, wrong) = (String::from_utf8_lossy(&asked.stdout), String::from_utf8_lossy(&asked.stderr));
    assert!(asked.status.success(), "{said}{wrong}");
    assert!(said.starts_with("visitor-1 is told: dock {\"station\": \"mds-1\""), "{said}");

    let mut shown = String::new();
    let seen = patiently(Duration::from_secs(20), || {
        shown = String::from_utf8_lossy(&example(&python, &fleet, "watch_schedule.py", &["--count", "1"]).stdout).into_owned();
        shown.contains("visitor-1")
    });
    assert!(seen && shown.starts_with("plan "), "{shown}");
}
