//! Logs out of a coordinator's store, made with the coordinator's own tables.

use std::fs;
use std::path::{Path, PathBuf};

use energy::Channel;
use lab::measurement::{Log, LogFacts, StoreQuery, Subject, instant, read_store};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode};
use sqlx::{AssertSqlSafe, ConnectOptions as _, Connection as _, SqliteConnection, raw_sql};

use crate::commands::lab_in;

/// 2026-01-01T00:00:00Z
const BEGIN_MS: i64 = 1_767_225_600_000;

/// A store as a coordinator leaves it while it works: a write-ahead log, and one more row that is
/// not committed.
async fn store(folder: &Path) -> (PathBuf, SqliteConnection) {
    let path = folder.join("tender.db");
    let options = SqliteConnectOptions::new().filename(&path).create_if_missing(true).journal_mode(SqliteJournalMode::Wal);
    let mut connection = options.connect().await.unwrap();
    let migrations = Path::new(env!("CARGO_MANIFEST_DIR")).join("../coordinator/migrations");
    let mut files: Vec<PathBuf> = fs::read_dir(migrations).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    for file in files {
        raw_sql(AssertSqlSafe(fs::read_to_string(file).unwrap())).execute(&mut connection).await.unwrap();
    }
    let gauge = |table: &str, key: &str, second: i64| {
        let (at_ms, soc, voltage_v) = (BEGIN_MS + 1000 * second, 0.9 - 0.001 * second as f64, 12.0 - 0.01 * second as f64);
        format!(
            "INSERT INTO {table} VALUES ({key}, {at_ms}, {second}, {soc}, 0.02, 10, 1, 12, 1, NULL, NULL, NULL, NULL, 1, 0.01, {voltage_v}, \
             {}, 25, 9, 3, 'test', 3, NULL);",
            if table == "pack_gauges" { 1.5 } else { -0.5 }
        )
    };
    let mut all = String::new();
    for second in 0..60 {
        all += &gauge("robot_gauges", "'explorer-1'", second);
        all += &gauge("pack_gauges", "'mds', 'pack-a'", second);
        let (phase, lift) = if second < 40 { ("occupied", false) } else { ("unloading", true) };
        let body = format!(
            r#"{{"schema":"tender.station-state/1","at":{},"seq":{second},"bays":[{{"bay":"bay-1","phase":"{phase}","robot":"explorer-1"}},{{"bay":"bay-2","phase":"free"}}],"lift_busy":{lift},"packs":[{{"pack":"pack-a","connected":true,"depleted":false}}],"active_pack":"pack-a","powered":{},"pack_power_w":7.5,"spares":[]}}"#,
            BEGIN_MS + 1000 * second,
            second < 55
        );
        all += &format!(
            "INSERT INTO station_states VALUES ('mds', {}, {second}, 'pack-a', 1, 0, 7.5, '{body}', NULL);",
            BEGIN_MS + 1000 * second
        );
    }
    all += &format!(
        "INSERT INTO robot_states VALUES ('explorer-1', {}, 0, 'charging', 'mds', 'bay-1', 1, 0.1, 'b', '{{}}', NULL);",
        BEGIN_MS + 30_000
    );
    raw_sql(AssertSqlSafe(all)).execute(&mut connection).await.unwrap();
    raw_sql("BEGIN IMMEDIATE").execute(&mut connection).await.unwrap();
    raw_sql(AssertSqlSafe(gauge("robot_gauges", "'explorer-2'", 0))).execute(&mut connection).await.unwrap();
    (path, connection)
}

/// Runs a test with a store whose writer is in the middle of a transaction, and lets it finish.
fn with_store(test: impl FnOnce(&Path)) {
    let folder = tempfile::tempdir().unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let (path, mut writer) = runtime.block_on(store(folder.path()));
    test(&path);
    runtime.block_on(async {
        raw_sql("COMMIT").execute(&mut writer).await.unwrap();
        writer.close().await.unwrap();
    });
}

fn read(path: &Path, subject: Subject, from: Option<&str>, to: Option<&str>) -> Result<Log, String> {
    let [from, to] = [from, to].map(|text| text.map(|text| instant(text).unwrap()));
    read_store(path, &StoreQuery { subject, from, to }, LogFacts::default()).map_err(|error| error.to_string())
}

fn robot(name: &str) -> Subject {
    Subject::Robot(name.to_owned())
}

#[test]
fn a_robots_battery_is_read_while_the_coordinator_writes() {
    with_store(|path| {
        let log = read(path, robot("explorer-1"), None, None).unwrap();
        assert_eq!((log.rows(), log.name.as_str(), log.time_s[59]), (60, "explorer-1", 59.0));
        assert_eq!((log.facts.soc_initial, log.facts.soc_initial_sigma), (Some(0.9), Some(0.02)));
        assert_eq!(log.channels[&Channel::CurrentA][1], -0.5);
        assert!((log.channels[&Channel::PowerW][1] + 0.5 * 11.99).abs() < 1e-12);
        assert!(log.notes.iter().any(|note| note.ends_with("time 0 is 2026-01-01T00:00:00.000Z")), "{:?}", log.notes);
        let part = read(path, robot("explorer-1"), Some("2026-01-01T00:00:10Z"), Some("1767225620")).unwrap();
        assert_eq!((part.rows(), part.channels[&Channel::Soc][0]), (11, 0.89));
    });
}

#[test]
fn packs_and_stations_are_read_too() {
    with_store(|path| {
        let pack = read(path, Subject::Pack { station: "mds".into(), pack: "pack-a".into() }, None, None).unwrap();
        assert_eq!((pack.rows(), pack.channels[&Channel::CurrentA][0]), (60, 1.5));
        let station = read(path, Subject::Station("mds".into()), None, None).unwrap();
        let at = |channel, row: usize| station.channels[&channel][row];
        assert_eq!((at(Channel::PackPowerW, 5), at(Channel::RobotsDocked, 5), at(Channel::LiftActive, 5)), (7.5, 1.0, 0.0));
        assert!((at(Channel::ChargePowerW, 5) - 0.5 * 11.95).abs() < 1e-12);
        assert!((at(Channel::PackVoltageV, 5) - 11.95).abs() < 1e-12, "as the gauge of its active pack says");
        // Let out from second 40 on: it hangs on its bay until it is out, and the power is compared again five seconds later.
        assert_eq!((at(Channel::RobotsDocked, 50), at(Channel::LiftActive, 50), at(Channel::BaySquaredCurrentA2, 50)), (1.0, 1.0, 0.25));
        let compared: Vec<bool> = (38..47).map(|row| !at(Channel::PackPowerW, row).is_nan()).collect();
        assert_eq!(compared, [true, true, false, false, false, false, false, true, true]);
        // In the dark nothing is drawn, whatever would be.
        let dark: Vec<bool> = (54..60).map(|row| at(Channel::PackPowerW, row).is_nan()).collect();
        assert_eq!(dark, [false, true, true, true, true, true]);
    });
}

#[test]
fn the_coolest_battery_tells_how_warm_it_is_around_all_of_them() {
    with_store(|path| {
        let log = read(path, robot("explorer-1"), None, None).unwrap();
        assert_eq!((log.facts.ambient_degc, log.facts.ambient_is_read), (Some(25.0), true));
        assert!(log.notes.iter().any(|note| note.contains("taken as 25.0 degC, the coolest that one was there then (")), "{:?}", log.notes);
        let query = StoreQuery { subject: robot("explorer-1"), from: None, to: None };
        let known = read_store(path, &query, LogFacts { ambient_degc: Some(21.0), ..LogFacts::default() }).unwrap();
        assert_eq!((known.facts.ambient_degc, known.facts.ambient_is_read), (Some(21.0), false));
    });
}

#[test]
fn what_is_not_in_the_store_is_told_with_what_is() {
    with_store(|path| {
        let error = read(path, robot("explorer-7"), None, None).unwrap_err();
        assert!(error.contains("no robot `explorer-7`; did you mean `explorer-1`? It holds: explorer-1"), "{error}");
        let error = read(path, robot("explorer-1"), Some("2027-01-01T00:00:00Z"), None).unwrap_err();
        assert!(error.contains("its rows reach from 2026-01-01T00:00:00.000Z to 2026-01-01T00:00:59.000Z"), "{error}");
        let error = read(path, Subject::Pack { station: "mds".into(), pack: "pack-b".into() }, None, None).unwrap_err();
        assert!(error.contains("no pack `pack-b`; did you mean `pack-a`?"), "{error}");
        let folder = path.parent().unwrap();
        let error = read(&folder.join("other.db"), robot("a"), None, None).unwrap_err();
        assert!(error.contains("there is no store"), "{error}");
        fs::write(folder.join("other.db"), "time_s\n").unwrap();
        let error = read(&folder.join("other.db"), robot("a"), None, None).unwrap_err();
        assert!(error.contains("is not a coordinator's store"), "{error}");
    });
}

#[test]
fn the_flags_reach_the_store() {
    with_store(|path| {
        let folder = path.parent().unwrap();
        let compare = ["compare", "--model", "explorer-3s1p-1320mah", "--column", "ambient_degc=25", "--column", "cycle_count=0"];
        let run = |more: &[&str]| lab_in(folder, &[&compare, more].concat());
        let outcome = run(&["--store", "tender.db", "--robot", "explorer-1", "--to", "2026-01-01T00:00:30Z"]);
        assert!(outcome.code < 2 && outcome.stdout.contains("explorer-1"), "{}{}", outcome.stdout, outcome.stderr);
        let refused = |more: &[&str], words: &str| {
            let outcome = run(more);
            assert_eq!(outcome.code, 2, "{}", outcome.stdout);
            assert!(outcome.stderr.contains(words), "{}", outcome.stderr);
        };
        refused(&["--store", "tender.db"], "say whose log with --robot or --station");
        refused(&["--store", "tender.db", "--robot", "explorer-1", "--from", "noon"], "--from: `noon` is neither an instant like");
        refused(&["--store", "tender.db", "--robot", "explorer-1", "--from", "2", "--to", "1"], "is after --to");
        refused(&[], "--log");
    });
}

/// An exchanged battery is another one: its charge and voltage jump, and no model of one battery explains that.
#[test]
fn an_exchange_ends_the_log_of_a_battery() {
    let folder = tempfile::tempdir().unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let (path, mut writer) = runtime.block_on(store(folder.path()));
    let state = |second: i64, phase: &str| {
        let at_ms = BEGIN_MS + 1000 * second;
        format!("INSERT INTO robot_states VALUES ('explorer-1', {at_ms}, {second}, '{phase}', 'mds', 'bay-1', 1, 0.1, 'b', '{{}}', NULL);")
    };
    runtime.block_on(async {
        raw_sql("COMMIT").execute(&mut writer).await.unwrap();
        raw_sql(AssertSqlSafe(state(20, "swapping") + &state(25, "working"))).execute(&mut writer).await.unwrap();
        writer.close().await.unwrap();
    });
    let log = read(&path, robot("explorer-1"), None, None).unwrap();
    assert_eq!((log.rows(), log.time_s[34], log.facts.soc_initial), (35, 34.0, Some(0.9 - 0.025)), "from second 25 on");
    let told = "the battery was exchanged at 2026-01-01T00:00:20.000Z: these are the rows from 2026-01-01T00:00:25.000Z to \
                2026-01-01T00:00:59.000Z, the longest stretch of one battery; --from and --to choose another";
    assert!(log.notes.iter().any(|note| note.ends_with(told)), "{:?}", log.notes);
    let before = read(&path, robot("explorer-1"), None, Some("2026-01-01T00:00:22Z")).unwrap();
    assert_eq!((before.rows(), before.facts.soc_initial), (20, Some(0.9)));
    let during = read(&path, robot("explorer-1"), Some("2026-01-01T00:00:21Z"), Some("2026-01-01T00:00:23Z"));
    assert!(during.unwrap_err().contains("all 3 rows of robot `explorer-1` between --from and --to are of an exchange"));
}
