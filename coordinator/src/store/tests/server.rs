//! The same journal on a PostgreSQL server, and who leads there.

use super::cluster::Cluster;
use super::*;

#[tokio::test]
async fn the_journal_on_a_server_is_the_journal_in_a_file() {
    let Some(cluster) = Cluster::start() else { return };
    for number in 0..journal::BODIES {
        let path = cluster.database().await;
        journal::body(number, &path).await;
    }
}

#[tokio::test]
async fn one_leads_another_takes_over_within_five_seconds_and_the_first_can_write_nothing_more() {
    let Some(cluster) = Cluster::start() else { return };
    let path = cluster.database().await;
    let first = open(&path).await;
    first.append(&events(1..=3)).await.unwrap();
    // A second one stands by as long as the first renews.
    let waiting = {
        let path = path.clone();
        tokio::spawn(async move { Store::open(&path).await })
    };
    for _ in 0..5 {
        tokio::time::sleep(RENEWAL).await;
        first.renew().await.unwrap();
        assert!(!waiting.is_finished(), "two lead at once");
    }
    // The first falls silent, as a killed or frozen process does.
    let second = tokio::time::timeout(std::time::Duration::from_secs(5), waiting).await.expect("taken over within 5 s").unwrap().unwrap();
    assert_eq!((first.epoch(), second.epoch()), (1, 2));
    assert_eq!(second.next_event_seq().await.unwrap(), 4);
    second.append(&events(4..=5)).await.unwrap();
    // The first wakes up: neither its records nor its lease are taken.
    let error = first.append(&[to_robot("c1-9", 3)]).await.unwrap_err();
    assert!(matches!(error, StoreError::Deposed { .. }), "{error}");
    assert!(matches!(first.renew().await.unwrap_err(), StoreError::Deposed { .. }));
    assert_eq!(second.command(&id("c1-9")).await.unwrap(), None);
    assert_eq!(second.events(10).await.unwrap().len(), 5);
    // One that ends in order lets the next one in at once.
    second.close().await;
    let third = tokio::time::timeout(std::time::Duration::from_secs(2), open(&path)).await.expect("at once");
    assert_eq!(third.epoch(), 3);
}

#[tokio::test]
async fn two_that_start_at_once_do_not_both_lead() {
    let Some(cluster) = Cluster::start() else { return };
    let path = cluster.database().await;
    let race = |path: PathBuf| tokio::spawn(async move { tokio::time::timeout(RENEWAL, Store::open(&path)).await });
    let (one, two) = (race(path.clone()), race(path.clone()));
    let leads = [one.await.unwrap(), two.await.unwrap()].into_iter().filter(|opened| matches!(opened, Ok(Ok(_)))).count();
    assert_eq!(leads, 1);
}
