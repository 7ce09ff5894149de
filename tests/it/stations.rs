//! A station that is not ours: packs that the kernel shows, and a program of its own for the lift.

use std::path::{Path, PathBuf};
use std::time::Duration;

use device::power_supply;
use proto::EventKind;
use robot_agent::source::Body;
use station_agent::{GaugeConfig, MeasuredConfig};
use tests::{Fleet, workspace};

/// A battery as the kernel shows it: file and content.
fn battery(root: &Path, name: &str, files: &[(&str, &str)]) {
    std::fs::create_dir_all(root.join(name)).unwrap();
    for (file, content) in [("type", "Battery")].iter().chain(files) {
        std::fs::write(root.join(name).join(file), format!("{content}\n")).unwrap();
    }
}

fn supply(root: &Path, name: &str) -> power_supply::Config {
    power_supply::Config { device: Some(name.to_owned()), root: root.to_owned() }
}

/// A program that notes what it is asked, and then does as the script says with `$1` and those after it.
fn program(folder: &Path, name: &str, script: &str) -> (Vec<String>, PathBuf) {
    let (path, acts) = (folder.join(format!("{name}.sh")), folder.join(format!("{name}.acts")));
    std::fs::write(&path, format!("echo \"$@\" >> {}\n{script}\n", acts.display())).unwrap();
    (vec!["/bin/sh".to_owned(), path.display().to_string()], acts)
}

fn said(acts: &Path) -> Vec<String> {
    std::fs::read_to_string(acts).unwrap_or_default().lines().map(str::to_owned).collect()
}

#[test]
fn a_real_robot_is_charged_at_a_real_station_that_comes_first_and_whose_lift_fails_once() {
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 60.0).unwrap();
    let root = fleet.path("power_supply");
    let station_pack = |soc: &str, current: &str| {
        [("status", "Discharging"), ("voltage_now", "12100000"), ("current_now", current), ("capacity", soc)]
            .map(|(a, b)| (a.to_owned(), b.to_owned()))
    };
    for (name, soc, current) in [("PACK1", "80", "-600000"), ("PACK2", "90", "0")] {
        let files = station_pack(soc, current);
        battery(&root, name, &files.each_ref().map(|(file, content)| (file.as_str(), content.as_str())));
    }
    battery(&root, "ROBOT", &[("status", "Discharging"), ("voltage_now", "11000000"), ("current_now", "-100000"), ("capacity", "12")]);
    let robot_shows = |status: &str, current: &str, volts: &str| {
        let at = root.join("ROBOT");
        format!("echo {status} > {0}/status; echo {current} > {0}/current_now; echo {volts} > {0}/voltage_now", at.display())
    };
    // In its bay it feels the supply; it charges by 1.3 A when it is asked to; outside it is on its own again.
    let drive = format!(
        "case $1 in charge) {};; stop_charging) {};; esac",
        robot_shows("Charging", "1300000", "12000000"),
        robot_shows("'Not charging'", "0", "11600000")
    );
    let (failed, asked) = (fleet.path("failed"), fleet.path("asked"));
    let operate = format!(
        "case $1 in place) if [ -e {3} ]; then echo here 90000 90600; else touch {3}; echo arrives 60; fi;; load) if [ ! -e {0} ]; then touch {0}; exit 3; fi; {1};; unload) {2};; esac",
        failed.display(),
        robot_shows("'Not charging'", "0", "11300000"),
        robot_shows("Discharging", "-100000", "11500000"),
        asked.display()
    );
    let (drive, driven) = program(fleet.folder.path(), "drive", &drive);
    let (operate, operated) = program(fleet.folder.path(), "operate", &operate);

    let deployment = &mut fleet.deployment;
    deployment.robots.truncate(1);
    let robot = &mut deployment.robots[0];
    robot.source = robot_agent::SourceConfig::PowerSupply(supply(&root, "ROBOT"));
    (robot.load, robot.body) = (None, Body { drive, ..Body::default() });
    let id = robot.id.clone();
    deployment.coordinator.robots.retain(|robot, _| *robot == id);
    let station = &mut deployment.stations[0];
    let packs = station.packs.iter().zip(["PACK1", "PACK2"]);
    let packs = packs.map(|(pack, name)| (pack.id.clone(), GaugeConfig::PowerSupply(supply(&root, name)))).collect();
    station.source = station_agent::SourceConfig::Measured(MeasuredConfig {
        packs,
        spares: Default::default(),
        operate,
        operate_max_s: 900.0,
        drives: true,
        leave_below_v: 0.0,
        take_above_v: 0.0,
        ready_soc: 0.95,
        ambient_degc: 25.0,
        soc_sigma: 0.03,
    });
    fleet.write().unwrap();
    let _coordinator = fleet.coordinator().unwrap();
    let _agents = fleet.agents().unwrap();

    let done = |event: &proto::Event| event.kind == EventKind::ServiceDone && event.text.starts_with("explorer-1");
    fleet.wait_for("service", Duration::from_secs(180), done).unwrap();
    let (asked, operated): (Vec<String>, Vec<String>) = said(&operated).into_iter().partition(|act| act == "place");
    assert!(asked.len() > 1, "it drives, and is asked where it is again and again");
    assert_eq!(operated[0], operated[1], "the lift failed once and was asked again: {operated:?}");
    assert!(operated[0].starts_with("load explorer-1 bay-"), "{operated:?}");
    assert_eq!(operated[2..], [operated[0].replace("load", "unload")]);
    let driven = said(&driven);
    assert!(driven[0].starts_with("travel_to mds-1 bay-"), "{driven:?}");
    assert_eq!(driven[1..], ["charge", "stop_charging", "resume"]);
    // What its packs can still do is counted from what the devices said: 80 and 90 % of 84 Wh.
    let capacity = String::from_utf8(fleet.schedule(&["capacity", "--format", "json"]).unwrap().stdout).unwrap();
    let capacity: serde_json::Value = serde_json::from_str(&capacity).unwrap();
    let remaining = |pack: usize| capacity["packs"][pack]["remaining_wh"]["value"].as_f64().unwrap();
    assert!((remaining(0) - 65.0).abs() < 12.0 && remaining(1) > remaining(0), "{capacity}");
}
