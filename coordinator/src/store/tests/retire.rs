//! What is old goes, what is new and what was decided stays, on both kinds of store.

use super::super::retire::{Retention, Sweep};
use super::cluster::Cluster;
use super::*;

const HOUR: i64 = 3_600;

/// Sweeps until nothing can be left to do.
async fn swept(store: &Store, now_s: i64) {
    let retention = Retention { fine: at(now_s - HOUR), coarse_s: 60.0, keep: at(now_s - 10 * HOUR) };
    let mut sweep = Sweep::default();
    for _ in 0..40 {
        store.retire(&retention, &mut sweep, || false).await.unwrap();
    }
}

async fn rows(store: &Store, table: &str) -> i64 {
    let sql = sqlx::AssertSqlSafe(format!("SELECT COUNT(*) FROM {table}"));
    sqlx::query_scalar(sql).fetch_one(&store.writer).await.unwrap()
}

/// Twelve hours of two robots, a row in ten seconds, and events.
async fn filled(store: &Store) {
    for robot in ["explorer-1", "explorer-2"] {
        let records: Vec<Record> = (0..12 * HOUR / 10).map(|n| robot_gauge(robot, 10 * n.cast_unsigned())).collect();
        store.append(&records).await.unwrap();
    }
    let packs: Vec<Record> = (0..12 * HOUR / 10).map(|n| pack_gauge(10 * n.cast_unsigned())).collect();
    store.append(&packs).await.unwrap();
    store.append(&events(1..=3)).await.unwrap();
    store.append(&[to_robot("c1-1", 60), to_station("c1-2", 11 * HOUR)]).await.unwrap();
}

async fn holds(store: &Store) {
    filled(store).await;
    swept(store, 12 * HOUR).await;
    // An hour at 10 s, nine at a minute, and nothing of the two before.
    let left = HOUR / 10 + 9 * 60;
    assert_eq!(rows(store, "pack_gauges").await, left);
    assert_eq!(rows(store, "robot_gauges").await, 2 * left);
    let numbers: Vec<u64> = store.reader.events(9).await.unwrap().iter().map(|event| event.seq).collect();
    assert_eq!(numbers, [3], "they go on from the newest");
    assert_eq!(rows(store, "commands").await, 1);
    // Nothing more happens until time passes; then a minute more is thinned: six rows become one.
    swept(store, 12 * HOUR).await;
    assert_eq!(rows(store, "pack_gauges").await, left);
    swept(store, 12 * HOUR + 60).await;
    assert_eq!(rows(store, "pack_gauges").await, left - 5 - 1, "and the oldest minute is gone");
}

/// A gauge that came `after_s` seconds into 2026, of a robot whose clock is so much ahead.
fn came(epoch: u64, number: i64, after_s: i64, robot: &str, ahead_s: i64) -> [Record; 2] {
    let gauge = Gauge { at: at(after_s + ahead_s), ..gauge(number.cast_unsigned()) };
    let what = What::RobotGauge(id(robot), gauge.at, gauge.seq);
    let line = Heard { epoch, number: number.cast_unsigned(), at: at(after_s), what };
    [Record::Heard(line), Record::RobotGauge { robot: id(robot), gauge }]
}

/// Twelve hours of robots whose clocks say 1970, years to come, and nearly the right time: they are kept as long as any other's.
async fn holds_whatever_clocks_say(store: &Store) {
    let robots = [("without-clock", -56 * 365 * 24 * HOUR), ("years-ahead", 4 * 365 * 24 * HOUR), ("a-little-late", -7)];
    for (epoch, (robot, ahead_s)) in (1..).zip(robots) {
        let of = |n: i64| came(epoch, n + 1, 10 * n, robot, ahead_s);
        store.append(&(0..12 * HOUR / 10).flat_map(of).collect::<Vec<_>>()).await.unwrap();
    }
    swept(store, 12 * HOUR).await;
    let left = HOUR / 10 + 9 * 60;
    for (robot, _) in robots {
        let count = sqlx::query_scalar::<_, i64>("SELECT COUNT(*) FROM robot_gauges WHERE robot = $1").bind(robot);
        // Of one that is late by its clock one more minute has begun to be old.
        assert!((left - 6..=left + 1).contains(&count.fetch_one(&store.writer).await.unwrap()), "{robot}");
    }
    // What a replay is told is there.
    let mut lines = Vec::new();
    for epoch in 1..=3 {
        lines.extend(store.heard(epoch, 0, usize::MAX).await.unwrap());
    }
    assert_eq!(lines.len() as i64, 3 * HOUR / 10);
    for line in lines.iter().filter(|line| !matches!(&line.what, What::RobotGauge(robot, ..) if robot.as_str() == "a-little-late")) {
        assert!(store.message_of(line).await.unwrap().is_some(), "{line:?}");
    }
    swept(store, 30 * HOUR).await;
    assert_eq!(rows(store, "robot_gauges").await, 0);
}

/// A coordinator began with a clock of years to come: what it was told then keeps nothing else.
async fn holds_after_a_start_in_the_future(store: &Store) {
    let years_s = 4 * 365 * 24 * HOUR;
    let ticks = |epoch: u64, from_s: i64| {
        (1..=50).map(move |number: i64| {
            Record::Heard(Heard { epoch, number: number.cast_unsigned(), at: at(from_s + number), what: What::Tick })
        })
    };
    let plan = |number, at_s| Record::Plan(Arc::new(Schedule { at: at(at_s), ..schedule(number) }));
    let capacity = |at_s| Record::Capacity(Capacity { at: at(at_s), ..capacity(1) });
    let event = |seq, at_s| Record::Event(Event { at: at(at_s), ..event(seq, "r1 joined") });
    // Of one start the clock was set back: what it was told before goes with what came after.
    let set_back = ticks(3, years_s).take(10).chain(ticks(3, 0).skip(10));
    let mut records: Vec<Record> = ticks(1, years_s).chain(ticks(2, 0)).chain(set_back).collect();
    records.extend([plan(1, years_s), plan(2, 0), plan(3, 0), capacity(years_s), capacity(0)]);
    records.extend((1..=3_000).map(|seq| event(seq, years_s)).chain([event(3_001, 0), event(3_002, 0)]));
    store.append(&records).await.unwrap();
    swept(store, 12 * HOUR).await;
    let left = [rows(store, "inputs").await, rows(store, "plans").await, rows(store, "capacities").await, rows(store, "events").await];
    // The newest plan and the newest event stay.
    assert_eq!(left, [50, 2, 1, 3_001]);
}

#[tokio::test]
async fn a_file_deletes_by_its_own_clock() {
    for number in 0..2 {
        let (_directory, path) = place();
        let store = open(&path).await;
        match number {
            0 => holds_whatever_clocks_say(&store).await,
            _ => holds_after_a_start_in_the_future(&store).await,
        }
        store.close().await;
    }
}

#[tokio::test]
async fn a_server_deletes_by_its_own_clock() {
    let Some(cluster) = Cluster::start() else { return };
    let store = open(&cluster.database().await).await;
    holds_whatever_clocks_say(&store).await;
    store.close().await;
    let store = open(&cluster.database().await).await;
    holds_after_a_start_in_the_future(&store).await;
    store.close().await;
}

#[tokio::test]
async fn a_file_keeps_less_of_what_is_older() {
    let (_directory, path) = place();
    let store = open(&path).await;
    holds(&store).await;
    store.close().await;
}

#[tokio::test]
async fn so_does_a_server() {
    let Some(cluster) = Cluster::start() else { return };
    let store = open(&cluster.database().await).await;
    holds(&store).await;
    store.close().await;
}
