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

/// The lab's logs out of a store in a file and out of one on a server, written alike.
#[tokio::test]
async fn the_lab_reads_a_store_on_a_server_as_it_reads_one_in_a_file() {
    use lab::measurement::{Log, LogFacts, StoreQuery, Subject, read_store};
    let Some(cluster) = Cluster::start() else { return };
    let ((_directory, file), server) = (place(), cluster.database().await);
    for path in [&file, &server] {
        let store = open(path).await;
        let of = |seq| [robot_gauge("r1", seq), pack_gauge(seq), robot_state("r1", seq, RobotPhase::Charging), station_state(seq)];
        store.append(&(0..20).flat_map(of).collect::<Vec<_>>()).await.unwrap();
        store.close().await;
    }
    let read = async |path: &Path, subject: Subject, to_s: Option<i64>| {
        let (path, query) = (path.to_owned(), StoreQuery { subject, from: None, to: to_s.map(at) });
        tokio::task::spawn_blocking(move || read_store(&path, &query, LogFacts::default())).await.unwrap()
    };
    let subjects = [
        Subject::Robot("r1".to_owned()),
        Subject::Pack { station: "north".to_owned(), pack: "p1".to_owned() },
        Subject::Station("north".to_owned()),
    ];
    for subject in subjects {
        let told = |log: Log| (log.time_s, log.channels, log.extra, log.name, log.facts);
        let (of_file, of_server) = (read(&file, subject.clone(), Some(15)).await, read(&server, subject.clone(), Some(15)).await);
        let (of_file, of_server) = (told(of_file.unwrap()), told(of_server.unwrap()));
        assert_eq!((of_file.0.len(), format!("{of_file:?}")), (16, format!("{of_server:?}")), "{subject:?}");
    }
    let unknown = read(&server, Subject::Robot("r2".to_owned()), None).await.unwrap_err().to_string();
    assert!(unknown.starts_with("site0 on /") && unknown.ends_with("no robot `r2`. It holds: r1"), "{unknown}");
    let before = read(&server, Subject::Robot("r1".to_owned()), Some(-1)).await.unwrap_err().to_string();
    assert!(before.contains("its rows reach from 2026-01-01T00:00:00"), "{before}");
    // Another database is no store, and one that is not there is not made.
    let other = cluster.database().await;
    let other = read(&other, Subject::Robot("r1".to_owned()), None).await.unwrap_err().to_string();
    assert!(other.contains("it has other tables"), "{other}");
    let nowhere = PathBuf::from(server.to_str().unwrap().replace("/site0?", "/nowhere?"));
    let nowhere = read(&nowhere, Subject::Robot("r1".to_owned()), None).await.unwrap_err().to_string();
    assert!(nowhere.contains("cannot be opened") && nowhere.contains("does not exist"), "{nowhere}");
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
    assert_eq!(commands(&second).await, []);
    assert_eq!(second.events(10).await.unwrap().len(), 5);
    // One that ends in order lets the next one in at once.
    second.close().await;
    let third = tokio::time::timeout(std::time::Duration::from_secs(2), open(&path)).await.expect("at once");
    assert_eq!(third.epoch(), 3);
}

#[tokio::test]
async fn who_stands_by_waits_for_a_server_that_is_away() {
    let Some(mut cluster) = Cluster::start() else { return };
    let path = cluster.database().await;
    let first = open(&path).await;
    let waiting = {
        let path = path.clone();
        tokio::spawn(async move { Store::open(&path).await })
    };
    tokio::time::sleep(RENEWAL).await;
    cluster.stop();
    let lost = first.renew().await.unwrap_err();
    assert!(lost.is_of_the_moment(), "{lost:?}");
    tokio::time::sleep(3 * RENEWAL).await;
    assert!(!waiting.is_finished(), "{:?}", waiting.await);
    // Nobody who starts now is told to look at the configuration.
    let refused = Store::open(&path).await.unwrap_err();
    assert!(refused.is_of_the_moment(), "{refused:?}");
    cluster.begin_again();
    let second = tokio::time::timeout(std::time::Duration::from_secs(20), waiting).await.expect("it leads again").unwrap().unwrap();
    assert_eq!(second.epoch(), 2);
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

/// Somebody builds an index, or looks after the database otherwise: what is to be kept waits for that, and the lead does not.
#[tokio::test]
async fn a_table_that_is_locked_keeps_records_waiting_and_costs_nobody_the_lead() {
    let Some(cluster) = Cluster::start() else { return };
    let path = cluster.database().await;
    let store = Arc::new(open(&path).await);
    let options = crate::store::place::any(path.to_str().unwrap()).unwrap();
    let mut somebody = <sqlx::AnyConnection as sqlx::Connection>::connect_with(&options).await.unwrap();
    let mut lock = sqlx::Connection::begin(&mut somebody).await.unwrap();
    sqlx::query("LOCK TABLE events IN SHARE MODE").execute(&mut *lock).await.unwrap();
    let waiting = {
        let store = Arc::clone(&store);
        tokio::spawn(async move { store.append(&events(1..=3)).await })
    };
    for _ in 0..3 {
        tokio::time::sleep(RENEWAL).await;
        store.renew().await.unwrap();
    }
    assert!(!waiting.is_finished());
    lock.commit().await.unwrap();
    waiting.await.unwrap().unwrap();
    assert_eq!(store.events(9).await.unwrap().len(), 3);
}
