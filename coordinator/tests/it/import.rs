//! `coordinator import rmf`, and what it writes simulated.

use std::process::{Command, Output};

use super::simulate;

/// A fleet whose robots begin low enough to be charged within an hour or two.
const FLEET: &str = r#"
rmf_fleet:
  name: "deliveryRobot"
  limits: { linear: [0.7, 0.5], angular: [0.6, 1.0] }
  battery_system: { voltage: 24.0, capacity: 10.0, charging_current: 10.0 }
  mechanical_system: { mass: 70.0, moment_of_inertia: 40.0, friction_coefficient: 0.15 }
  ambient_system: { power: 20.0 }
  tool_system: { power: 0.0 }
  recharge_threshold: 0.2
  recharge_soc: 0.9
  robots:
    deliveryRobot1: { charger: "charger_a" }
    deliveryRobot2: { charger: "charger_b" }
"#;

fn import(folder: &std::path::Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_coordinator"));
    command.current_dir(folder).args(["import", "rmf"]).args(arguments).output().unwrap()
}

#[test]
fn an_open_rmf_fleet_becomes_a_scenario_that_runs() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("fleet.yaml"), FLEET).unwrap();
    let made = import(folder.path(), &["fleet.yaml", "--output", "made", "--hours", "3"]);
    let said = String::from_utf8(made.stdout).unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    assert!(said.contains("not modelled by RMF:") && said.contains("run it: coordinator simulate made/deliveryRobot.toml"), "{said}");
    let answer = simulate(&folder.path().join("made"), &["deliveryRobot.toml", "--format", "json"]);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    let json: serde_json::Value = serde_json::from_str(&answer.stdout).unwrap();
    let metrics = &json["runs"][0]["metrics"];
    // By hand: 240 Wh at 20 W + 0.15 * 70 kg * 9.81 m/s2 * 0.7 m/s = 92 W from 37.5 and 72.5 % to 20 %:
    // both are due within 1.4 h, and an hour of charging lasts for 70 %.
    assert_eq!((&metrics["robots_served"], &metrics["robots_stranded"]), (&2.0.into(), &0.0.into()), "{metrics}");
}

#[test]
fn nothing_is_overwritten_and_a_mistake_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("fleet.yaml"), FLEET).unwrap();
    assert!(import(folder.path(), &["fleet.yaml"]).status.success());
    let again = import(folder.path(), &["fleet.yaml"]);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("deliveryRobot.toml is there already"));
    std::fs::write(folder.path().join("wrong.yaml"), FLEET.replace("capacity: 10.0", "capacity: ten")).unwrap();
    let wrong = import(folder.path(), &["wrong.yaml", "--output", "other"]);
    assert_eq!(wrong.status.code(), Some(2));
    let said = String::from_utf8_lossy(&wrong.stderr).into_owned();
    assert!(said.contains("wrong.yaml: rmf_fleet.battery_system.capacity: \"ten\" is not a number"), "{said}");
    assert!(!folder.path().join("other").exists());
}
