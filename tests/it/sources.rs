//! Robots that are not ours: real batteries' messages go in at one end of a live fleet, and what the
//! coordinator decides comes out at the other.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use device::{power_supply, ros2};
use proto::EventKind;
use robot_agent::SourceConfig;
use robot_agent::source::{Body, vda5050};
use rumqttc::{Client, Event, MqttOptions, Packet, QoS};
use serde_json::{Value, json};
use tests::{Fleet, Running, start, workspace};

/// One station and one robot in real time, whose battery is measured by this; its drive program writes
/// what it is told into the file `acts`.
fn fleet_of_one(source: SourceConfig, drive: &str) -> (Fleet, PathBuf) {
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 1.0).unwrap();
    let acts = fleet.path("acts");
    node::files::write_text(&fleet.path("drive.sh"), &format!("echo \"$@\" >> {}\n{drive}\n", acts.display())).unwrap();
    let deployment = &mut fleet.deployment;
    deployment.robots.truncate(1);
    let robot = &mut deployment.robots[0];
    robot.source = source;
    robot.load = None;
    robot.body = Body { drive: vec!["/bin/sh".to_owned(), fleet.folder.path().join("drive.sh").display().to_string()], ..Body::default() };
    robot.publish.gauge_period_s = 1.0;
    let id = robot.id.clone();
    deployment.coordinator.robots.retain(|robot, _| *robot == id);
    deployment.coordinator.clock = None;
    deployment.coordinator.policy.replan_period_s = 1.0;
    deployment.robots[0].clock = None;
    deployment.stations.iter_mut().for_each(|station| station.clock = None);
    fleet.write().unwrap();
    (fleet, acts)
}

fn said(acts: &Path) -> Vec<String> {
    std::fs::read_to_string(acts).unwrap_or_default().lines().map(str::to_owned).collect()
}

/// A Python that has these packages: `TENDER_PYTHON`, or the one of this machine.
fn python(packages: &str) -> Option<String> {
    let candidates = [std::env::var("TENDER_PYTHON").unwrap_or_default(), "python3".to_owned()];
    let works = |python: &String| {
        let asked = Command::new(python).args(["-c", &format!("import {packages}")]).stderr(Stdio::null()).status();
        !python.is_empty() && asked.is_ok_and(|status| status.success())
    };
    let found = candidates.into_iter().find(works);
    if found.is_none() {
        eprintln!("skipped: no Python with {packages}; name one by TENDER_PYTHON");
    }
    found
}

#[test]
fn a_ros_2_robot_is_a_robot_of_ours_without_code() {
    let Some(python) = python("zenoh, rosbags") else { return };
    let topic = "/robot_1/battery_state";
    let source = SourceConfig::Ros2(ros2::Config { topic: topic.to_owned(), domain: 0, connect: Vec::new(), invert_current: false });
    let (fleet, acts) = fleet_of_one(source, "if [ $1 = stop_charging ]; then echo at_station; fi");
    let _coordinator = fleet.coordinator().unwrap();
    let _agents = fleet.agents().unwrap();
    let mut robot = Command::new(python);
    robot.arg(workspace().join("tests/fixtures/ros2_robot.py")).arg(&fleet.network().connect[0]).arg(topic).arg(&acts);
    robot.arg(workspace().join("device/tests/data"));
    let _robot = start(robot).unwrap();

    let done = |event: &proto::Event| event.kind == EventKind::ServiceDone && event.text.starts_with("explorer-1");
    fleet.wait_for("service", Duration::from_secs(240), done).unwrap();
    // From 12 % it went to the bay that it was given, was charged by the gauge's word, and back to work.
    let acts = said(&acts);
    assert!(acts[0].starts_with("travel_to mds-1 bay-"), "{acts:?}");
    assert_eq!(acts[1..], ["charge", "stop_charging", "resume"]);
    let shown = fleet.schedule(&["explain", "explorer-1"]).unwrap();
    let shown = String::from_utf8_lossy(&shown.stdout).into_owned();
    assert!(shown.contains("working at 4"), "40 % was the target: {shown}");
}

#[test]
fn a_battery_of_the_kernels_is_gauged_and_what_it_lacks_is_told() {
    let root = tempfile::tempdir().unwrap();
    let battery = root.path().join("BAT0");
    std::fs::create_dir(&battery).unwrap();
    for (file, content) in [
        ("type", "Battery"),
        ("status", "Discharging"),
        ("voltage_now", "11400000"),
        // So little that a minute is a twentieth of a percent: a busy machine asks late.
        ("current_now", "40000"),
        ("charge_now", "792000"),
        ("charge_full", "1320000"),
    ] {
        std::fs::write(battery.join(file), format!("{content}\n")).unwrap();
    }
    let config = power_supply::Config { device: None, root: root.path().to_owned() };
    let (fleet, _) = fleet_of_one(SourceConfig::PowerSupply(config), "");
    let _coordinator = fleet.coordinator().unwrap();
    let _agents = fleet.agents().unwrap();
    let mut shown = String::new();
    let seen = tests::patiently(Duration::from_secs(60), || {
        let output = fleet.schedule(&["explain", "explorer-1"]).unwrap();
        shown = String::from_utf8_lossy(&output.stdout).into_owned();
        // 792 of 1320 mAh, known to 5 %.
        shown.contains("working at 60.0 ± 5.0 % charge")
    });
    assert!(seen, "{shown}");
}

/// A broker on a port of its own, and that port; none where Mosquitto is not installed.
fn broker(folder: &Path) -> Option<(Running, u16)> {
    let program = ["mosquitto", "/usr/sbin/mosquitto"].into_iter().find(|name| Command::new(name).arg("-h").output().is_ok());
    let Some(program) = program else {
        eprintln!("skipped: Mosquitto is not installed");
        return None;
    };
    let port = tests::free_port().unwrap();
    let config = folder.join("mosquitto.conf");
    std::fs::write(&config, format!("listener {port} 127.0.0.1\nallow_anonymous true\n")).unwrap();
    let mut command = Command::new(program);
    command.arg("-c").arg(config).stderr(Stdio::null());
    Some((start(command).unwrap(), port))
}

/// What a vehicle was told, in order.
type Told = std::sync::Arc<std::sync::Mutex<Vec<Value>>>;

/// A vehicle of VDA 5050: once it was told to, it charges by a percent in 50 s of its own time, which
/// runs five hundred times as fast as ours then.
fn vehicle(port: u16, version: &str, told: Told) {
    let root = if version.starts_with('2') { "uagv/v2/KIT/0001" } else { "vda5050/v3/KIT/0001" };
    let (client, mut events) = Client::new(MqttOptions::new(format!("vehicle-{version}"), "127.0.0.1", port), 100);
    client.subscribe(format!("{root}/instantActions"), QoS::AtMostOnce).unwrap();
    let heard = told.clone();
    std::thread::spawn(move || {
        for event in events.iter() {
            match event {
                Ok(Event::Incoming(Packet::Publish(publish))) => {
                    heard.lock().unwrap().push(serde_json::from_slice(&publish.payload).unwrap())
                }
                Ok(_) => {}
                Err(_) => std::thread::sleep(Duration::from_millis(50)),
            }
        }
    });
    let version = version.to_owned();
    std::thread::spawn(move || {
        let (mut percent, mut at_ms, mut header) = (12.0_f64, 1_767_225_600_000_i64, 0);
        loop {
            let actions: Vec<Value> =
                told.lock().unwrap().iter().flat_map(|message| message["actions"].as_array().unwrap().clone()).collect();
            let charging = actions.last().is_some_and(|action| action["actionType"] == "startCharging");
            (percent, at_ms) = if charging { (f64::min(percent + 1.0, 100.0), at_ms + 50_000) } else { (percent, at_ms + 100) };
            header += 1;
            let states: Vec<Value> =
                actions.iter().map(|action| json!({ "actionId": action["actionId"], "actionStatus": "FINISHED" })).collect();
            let mut state = json!({
                "headerId": header, "timestamp": proto::Timestamp::from_unix_ms(at_ms).to_string(), "version": version,
                "manufacturer": "KIT", "serialNumber": "0001", "orderId": "", "orderUpdateId": 0, "lastNodeId": "", "lastNodeSequenceId": 0,
                "nodeStates": [], "edgeStates": [], "driving": false, "operatingMode": "AUTOMATIC", "errors": [], "actionStates": [],
            });
            let fields = state.as_object_mut().unwrap();
            let volts = 10.5 + 0.019 * percent;
            if version.starts_with('2') {
                fields["actionStates"] = Value::from(states);
                fields.insert("batteryState".into(), json!({ "batteryCharge": percent, "batteryVoltage": volts, "charging": charging }));
            } else {
                // 1 % of 1.32 Ah in 50 s, by a vehicle that counts a current into the battery positive.
                let amperes = if charging { 0.95 } else { -0.4 };
                fields.insert("instantActionStates".into(), Value::from(states));
                let power = json!({ "stateOfCharge": percent, "batteryVoltage": volts, "batteryCurrent": amperes, "charging": charging });
                fields.insert("powerSupply".into(), power);
            }
            if client.publish(format!("{root}/state"), QoS::AtMostOnce, false, state.to_string()).is_err() {
                return;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    });
}

#[test]
fn a_vehicle_of_vda_5050_is_charged_by_instant_actions() {
    let folder = tempfile::tempdir().unwrap();
    let Some((_broker, port)) = broker(folder.path()) else { return };
    for (version, interface) in [("2.1.0", "uagv/v2"), ("3.0.0", "vda5050/v3")] {
        let told = Told::default();
        vehicle(port, version, told.clone());
        let config = vda5050::Config::of(&format!("mqtt://127.0.0.1:{port}/{interface}/KIT/0001")).unwrap();
        let drive = "case $1 in travel_to) echo in_bay;; stop_charging) echo at_station;; esac";
        let (fleet, acts) = fleet_of_one(SourceConfig::Vda5050(config), drive);
        let _coordinator = fleet.coordinator().unwrap();
        let _agents = fleet.agents().unwrap();
        let done = |event: &proto::Event| event.kind == EventKind::ServiceDone && event.text.starts_with("explorer-1");
        fleet.wait_for("service", Duration::from_secs(240), done).unwrap();
        let told = told.lock().unwrap();
        let types: Vec<&str> = told.iter().map(|message| message["actions"][0]["actionType"].as_str().unwrap()).collect();
        assert_eq!(types, ["startCharging", "stopCharging"], "{version}");
        for (number, message) in told.iter().enumerate() {
            assert_eq!((&message["headerId"], &message["version"]), (&json!(number), &json!(version)));
            assert_eq!((&message["manufacturer"], &message["serialNumber"]), (&json!("KIT"), &json!("0001")));
            assert_eq!(message["actions"][0]["blockingType"], "NONE");
        }
        assert!(said(&acts)[0].starts_with("travel_to mds-1 bay-"), "{:?}", said(&acts));
    }
}
