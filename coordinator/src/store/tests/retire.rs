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
        store.retire(&retention, &mut sweep).await.unwrap();
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
