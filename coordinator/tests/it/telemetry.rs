//! Logs of a run as `lab` reads them: what the simulator did is what the models predict.

use std::path::Path;
use std::sync::Arc;

use energy::{Channel, Model};
use lab::compare::{Comparison, Verdict};
use lab::measurement::read_log;
use lab::prepare::prepare_to_judge;
use lab::{Log, LogFacts, compare, load_model};

use super::{scenario_folder, simulate};

const EXPLORER: &str = "explorer-3s1p-1320mah";
const PACK: &str = "mds-3s4p-7600mah";

fn log(folder: &Path, stem: &str) -> Log {
    let (csv, toml) = (folder.join(format!("{stem}.csv")), folder.join(format!("{stem}.toml")));
    let facts = LogFacts::parse(&toml.display().to_string(), &std::fs::read_to_string(&toml).unwrap()).unwrap();
    let log = read_log(&csv.display().to_string(), &std::fs::read(&csv).unwrap(), facts).unwrap_or_else(|error| panic!("{error}"));
    assert!(log.notes.is_empty(), "{:?}", log.notes);
    log
}

fn compared(model: &Arc<Model>, log: &Log, channel: Channel) -> Comparison {
    let prepared = prepare_to_judge(model, log, &[channel]).unwrap_or_else(|error| panic!("{error}"));
    compare(model, &model.values(), &[prepared])
}

fn rms(model: &Arc<Model>, log: &Log, channel: Channel) -> f64 {
    compared(model, log, channel).errors[0].size.rms
}

/// Simulates a scenario that is given as changes to another, with logs, and gives their folder.
fn logs(folder: &Path, file: &str, changes: &[(&str, &str)], arguments: &[&str]) {
    let mut text = std::fs::read_to_string(scenario_folder().join(file)).unwrap();
    for (old, new) in changes {
        assert!(text.contains(old), "{file}: {old}");
        text = text.replace(old, new);
    }
    std::fs::write(folder.join("scenario.toml"), text).unwrap();
    let answer = simulate(folder, &[&["scenario.toml", "--telemetry", "logs"], arguments].concat());
    // Exit 1: the short run is not what the whole scenario expects.
    assert!(answer.code <= 1, "{}", answer.stderr);
}

/// A built-in battery whose gauge IC has noise and rounding but neither offset nor gain error, and
/// whose gauge knows where it starts.
fn without_specimens(folder: &Path, name: &str) -> Arc<Model> {
    let unwanted = |line: &&str| !["offset_sigma", "gain_sigma", "soc_initial_sigma"].iter().any(|key| line.starts_with(key));
    let text: Vec<&str> = energy::built_in(name).unwrap().lines().filter(unwanted).collect();
    let path = folder.join(format!("{name}.toml"));
    std::fs::write(&path, text.join("\n")).unwrap();
    let table = "enertech-lco-2280mah-ocv.csv";
    std::fs::write(folder.join(table), energy::built_in(table).unwrap()).unwrap();
    load_model(&path.display().to_string()).unwrap().model
}

/// Twenty minutes: robots work, travel and are lifted; two get a spare, one is recharged.
const SHORT_HOT_SWAP: &[(&str, &str)] = &[
    ("duration_s = 9000", "duration_s = 1500"),
    ("count = 5", "count = 3"),
    ("soc = [0.12, 0.13, 0.14, 0.15, 0.16]", "soc = [0.105, 0.11, 0.12]"),
    ("[60, 90, 120, 150, 180]", "[60, 90, 120]"),
    (
        "spares = [{ id = \"spare-1\", soc = 0.98 }, { id = \"spare-2\", soc = 0.98 }, { id = \"spare-3\", soc = 0.97 }]",
        "spares = [{ id = \"spare-1\", soc = 0.98 }]",
    ),
];

#[test]
fn with_perfectly_calibrated_gauges_every_battery_log_is_at_the_sensor_floor() {
    let folder = tempfile::tempdir().unwrap();
    let (robot, pack) = (without_specimens(folder.path(), EXPLORER), without_specimens(folder.path(), PACK));
    let files = [("\"explorer-3s1p-1320mah\"", "\"explorer-3s1p-1320mah.toml\""), ("\"mds-3s4p-7600mah\"", "\"mds-3s4p-7600mah.toml\"")];
    logs(folder.path(), "hot-swap.toml", &[SHORT_HOT_SWAP, &files].concat(), &[]);
    let at = folder.path().join("logs");
    let mut stems: Vec<String> = std::fs::read_dir(&at)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "csv"))
        .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
        .filter(|stem| !stem.ends_with("-load") && stem != "depot")
        .collect();
    stems.sort();
    let swapped = stems.iter().filter(|stem| stem.ends_with("-pack-2")).count();
    assert_eq!((stems.len(), swapped), (5, 1), "three robots, a second pack of one of them, the station's pack: {stems:?}");
    for stem in stems {
        let model = if stem.starts_with("depot") { &pack } else { &robot };
        // Charge is counted from the row before the first measurement.
        let log = log(&at, &stem);
        assert!(log.channels[&Channel::VoltageV][0].is_nan() && log.channels[&Channel::VoltageV][1].is_finite(), "{stem}");
        for channel in [Channel::VoltageV, Channel::TemperatureDegc] {
            let comparison = compared(model, &log, channel);
            assert_eq!(comparison.verdict, Verdict::WithinFloor, "{stem}: {:?}", comparison.words);
        }
    }
}

#[test]
fn what_a_real_gauge_adds_is_its_start_and_its_specimen() {
    let folder = tempfile::tempdir().unwrap();
    logs(folder.path(), "hot-swap.toml", SHORT_HOT_SWAP, &[]);
    let robot = load_model(EXPLORER).unwrap().model;
    let facts = robot.battery();
    let sensor = robot.sensor(Channel::VoltageV);
    for stem in ["explorer-1", "explorer-2", "explorer-3"] {
        let mut log = log(&folder.path().join("logs"), stem);
        let as_remembered = rms(&robot, &log, Channel::VoltageV);
        // The gauge's memory of its start is wrong by up to three deviations of 1 %: at 5 % to 30 %
        // charge, where three cells' OCV climbs by up to 9 V per unit of SoC, that is up to 0.3 V.
        let remembered = log.facts.soc_initial.unwrap();
        let slope_v = (1..=6).map(|n| facts.ocv.slope_v(0.05 * f64::from(n))).fold(0.0, f64::max) * f64::from(facts.series);
        let explained_v = (3.0 * robot.uncertainty.soc_initial_sigma * slope_v).hypot(3.0 * sensor.offset_sigma);
        assert!(as_remembered < explained_v, "{stem}: {as_remembered} V RMS; a wrong start explains {explained_v} V");
        // From the best start within that, what is left is the specimen: offset of the voltage
        // sensor, gain and offset of the current sensor.
        let best = (-30..=30)
            .map(|n| {
                log.facts.soc_initial = Some((remembered + 0.001 * f64::from(n)).clamp(0.0, 1.0));
                rms(&robot, &log, Channel::VoltageV)
            })
            .fold(f64::INFINITY, f64::min);
        let specimen_v = sensor.floor().hypot(3.0 * sensor.offset_sigma) + 0.0005 * slope_v;
        assert!(best < specimen_v, "{stem}: {best} V RMS from the best start; a specimen explains {specimen_v} V");
    }
}

#[test]
fn the_station_log_shows_the_robots_own_load_to_whoever_does_not_know_it() {
    let folder = tempfile::tempdir().unwrap();
    let models = format!("\"{}/", scenario_folder().join("models").display());
    let changes = [("duration_s = 5400", "duration_s = 1500"), ("\"models/", models.as_str())];
    logs(folder.path(), "hidden-own-load.toml", &changes, &["--run", "own load unknown"]);
    let log = log(&folder.path().join("logs"), "mds-1");
    let whole = load_model("mds-station").unwrap().model;
    let known = compared(&whole, &log, Channel::PackPowerW);
    // Current and voltage are those of the pack's gauge: its gain error of up to 0.5 % of some 75 W
    // comes on top of the floor.
    let ratio = known.errors[0].ratio.unwrap();
    assert!(ratio < 6.0, "{:?}", known.words);
    let reduced = Arc::new(whole.without(|id| id == "robot_own_load"));
    let unknown = compared(&reduced, &log, Channel::PackPowerW);
    assert_eq!(unknown.verdict, Verdict::LeavesError);
    let missing = unknown.errors[0].ratio.unwrap();
    assert!(missing > 100.0 && missing > 20.0 * ratio, "{missing} against {ratio}: {:?}", unknown.words);
    // Three robots of 4.19 W through charger and converter: 17 W while all are docked.
    let residual_w = unknown.errors[0].size.max_abs;
    assert!((16.0..19.0).contains(&residual_w), "{residual_w}");
}

#[test]
fn the_load_log_of_a_robot_is_what_its_load_model_says() {
    let folder = tempfile::tempdir().unwrap();
    logs(folder.path(), "hot-swap.toml", SHORT_HOT_SWAP, &[]);
    let log = log(&folder.path().join("logs"), "explorer-1-load");
    let model = load_model("explorer-robot").unwrap().model;
    let comparison = compared(&model, &log, Channel::PowerW);
    // Again the gain of a pack gauge: 0.5 % of 4 W, as large as the floor.
    assert!(comparison.errors[0].ratio.unwrap() < 3.0, "{:?}", comparison.words);
}

#[test]
fn the_log_of_a_live_agent_is_read_as_the_simulations_is() {
    let folder = tempfile::tempdir().unwrap();
    let model = without_specimens(folder.path(), EXPLORER);
    let mut body = node::body::PackBody::new(Arc::clone(&model), energy::Start::at_soc(0.8), 1);
    let mut live = node::LiveLog::new(folder.path().join("logs"));
    for second in 1..=600 {
        let sample = body.step(1.0, node::body::Task::Power(4.0)).unwrap();
        live.battery(f64::from(second), "r1", &sample, energy::Estimate::new(0.8, 0.001), None);
    }
    live.flush();
    let log = log(&folder.path().join("logs"), "r1");
    let comparison = compared(&model, &log, Channel::VoltageV);
    assert_eq!(comparison.verdict, Verdict::WithinFloor, "{:?}", comparison.words);
}
