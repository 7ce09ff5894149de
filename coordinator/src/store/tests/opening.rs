use super::*;

use sqlx::{ConnectOptions, Connection, SqliteConnection};

async fn raw(path: &Path) -> SqliteConnection {
    sqlx::sqlite::SqliteConnectOptions::new().filename(path).create_if_missing(true).connect().await.unwrap()
}

async fn run(path: &Path, sql: &'static str) {
    let mut connection = raw(path).await;
    sqlx::raw_sql(sql).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}

#[tokio::test]
async fn a_second_coordinator_is_refused_while_the_first_lives() {
    let (directory, path) = place();
    let first = open(&path).await;
    let error = Store::open(&path).await.unwrap_err();
    assert!(matches!(&error, StoreError::InUse { owner, .. } if *owner == format!("process {}", std::process::id())), "{error}");
    let text = error.to_string();
    assert!(text.contains("journal.db is in use by process") && text.contains("journal.db.lock"), "{text}");

    // Nor by another spelling of the same place.
    let detour = directory.path().join(".").join("journal.db");
    assert!(matches!(Store::open(&detour).await.unwrap_err(), StoreError::InUse { .. }));
    #[cfg(unix)]
    {
        let link = directory.path().join("link.db");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert!(matches!(Store::open(&link).await.unwrap_err(), StoreError::InUse { .. }));
    }

    // The refused ones changed nothing.
    assert_eq!(first.starts().await.unwrap().len(), 1);
    drop(first);
    assert_eq!(open(&path).await.epoch(), 2);
}

#[tokio::test]
async fn a_lock_file_left_by_a_dead_process_does_not_matter() {
    let (directory, path) = place();
    std::fs::write(directory.path().join("journal.db.lock"), "4711\n4711\n").unwrap();
    let _first = open(&path).await;
    let error = Store::open(&path).await.unwrap_err().to_string();
    assert!(error.contains(&format!("process {}:", std::process::id())), "{error}");
}

#[tokio::test]
async fn reopening_continues_epoch_and_numbering() {
    let (_directory, path) = place();
    let store = open(&path).await;
    assert_eq!((store.epoch(), store.next_event_seq().await.unwrap(), store.next_plan().await.unwrap()), (1, 1, 1));
    store.append(&events(1..=41)).await.unwrap();
    store.append(&[Record::Plan(Arc::new(schedule(12)))]).await.unwrap();
    store.close().await;
    let store = open(&path).await;
    assert_eq!((store.epoch(), store.next_event_seq().await.unwrap(), store.next_plan().await.unwrap()), (2, 42, 13));
    assert_eq!(store.latest_schedule().await.unwrap(), Some(schedule(12)));
}

#[tokio::test]
async fn what_was_appended_survives_a_killed_process() {
    let (directory, path) = place();
    let store = open(&path).await;
    store.append(&one_of_each()).await.unwrap();
    // The files as they stand at this moment, with nobody to tidy them up.
    let after = directory.path().join("after.db");
    for suffix in ["", "-wal"] {
        let name = |path: &Path| PathBuf::from(format!("{}{suffix}", path.display()));
        std::fs::copy(name(&path), name(&after)).unwrap();
    }
    let reader = Store::open_read_only(&after).await.unwrap();
    assert_eq!(reader.starts().await.unwrap().len(), 1);
    reader.close().await;
    let restarted = open(&after).await;
    assert_eq!(restarted.epoch(), 2);
    assert!(counts(&restarted).await.values().all(|&rows| rows == 1));
}

#[tokio::test]
async fn reading_works_beside_the_coordinator_and_without_one() {
    let (directory, path) = place();
    let store = open(&path).await;
    let reader = Store::open_read_only(&path).await.unwrap();
    store.append(&events(1..=3)).await.unwrap();
    assert_eq!(reader.events(10).await.unwrap().len(), 3);
    assert_eq!(reader.starts().await.unwrap().len(), 1);
    store.append(&events(4..=5)).await.unwrap();
    assert_eq!(reader.events(10).await.unwrap().len(), 5);
    store.close().await;
    assert_eq!(reader.events(10).await.unwrap().len(), 5);
    reader.close().await;

    let reader = Store::open_read_only(&path).await.unwrap();
    assert_eq!((reader.events(10).await.unwrap().len(), reader.starts().await.unwrap().len()), (5, 1));
    // A reader does not keep a coordinator out.
    assert_eq!(open(&path).await.epoch(), 2);
    drop(directory);
}

#[tokio::test]
async fn reading_a_missing_store_is_an_error_that_names_it() {
    let (directory, path) = place();
    let error = Store::open_read_only(&path).await.unwrap_err();
    assert!(matches!(error, StoreError::Missing { .. }) && error.to_string().contains("journal.db"), "{error}");
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
}

#[tokio::test]
async fn a_missing_directory_is_named_and_not_created() {
    let (directory, _) = place();
    let path = directory.path().join("not").join("there.db");
    for error in [Store::open(&path).await.unwrap_err(), Store::open_read_only(&path).await.unwrap_err()] {
        assert!(matches!(&error, StoreError::MissingDirectory { directory, .. } if directory.ends_with("not")), "{error}");
    }
    assert!(!directory.path().join("not").exists());
    // A file is not a directory, and a directory is not a file.
    std::fs::write(directory.path().join("not"), "").unwrap();
    assert!(matches!(Store::open(&path).await.unwrap_err(), StoreError::MissingDirectory { .. }));
    let folder = Store::open(directory.path()).await.unwrap_err();
    assert!(matches!(folder, StoreError::NotAStore { .. }) && folder.to_string().contains("it is a folder"), "{folder}");
}

#[tokio::test]
async fn names_that_sqlite_would_treat_in_a_special_way_are_plain_files() {
    let (directory, _) = place();
    for name in [":memory:", "file:a?mode=memory", "sqlite::memory:", "100%20 ü.db"] {
        let path = directory.path().join(name);
        let store = open(&path).await;
        store.append(&events(1..=1)).await.unwrap();
        store.close().await;
        assert!(path.is_file(), "{name}");
        assert_eq!(open(&path).await.events(9).await.unwrap().len(), 1, "{name}");
    }
}

#[tokio::test]
async fn an_address_of_no_store_and_a_server_that_refuses_are_told_as_such() {
    for error in
        [open_error(Path::new("mysql://me:secret@db/x")).await, Store::open_read_only(Path::new("mysql://db/x")).await.unwrap_err()]
    {
        assert!(matches!(error, StoreError::UnknownAddress { .. }) && !error.to_string().contains("secret"), "{error}");
    }
    // Nobody listens on port 1.
    let server = Path::new("postgres://me:secret@127.0.0.1:1/x");
    for error in [open_error(server).await, Store::open_read_only(server).await.unwrap_err()] {
        assert!(matches!(error, StoreError::Unreachable { .. }) && !error.to_string().contains("secret"), "{error}");
        assert!(error.to_string().contains("refused") && error.to_string().contains("is it running"), "{error}");
    }
}

#[tokio::test]
async fn a_store_that_lacks_a_table_is_damaged_and_says_so_once() {
    let (_directory, path) = place();
    open(&path).await.close().await;
    run(&path, "DROP TABLE plans").await;
    let error = Store::open_read_only(&path).await.unwrap().latest_schedule().await.unwrap_err();
    let told = format!("{:#}", anyhow::Error::from(error));
    assert!(told.contains("is damaged: reading plans: no such table: plans; restore it"), "{told}");
}

#[tokio::test]
async fn an_empty_file_becomes_a_store() {
    let (_directory, path) = place();
    std::fs::write(&path, "").unwrap();
    assert!(matches!(Store::open_read_only(&path).await.unwrap_err(), StoreError::Older { found: 0, .. }));
    assert_eq!(open(&path).await.epoch(), 1);
}

#[tokio::test]
async fn other_files_are_refused_and_left_as_they_are() {
    let (directory, path) = place();
    let text = b"time_s,current_a,voltage_v\n0,1.1,7.4\n".repeat(300);
    let almost = [b"SQLite format 3\0".as_slice(), &[0x55; 8_000]].concat();
    for contents in [b"x".as_slice(), b"SQLite format 3", &text, &almost] {
        std::fs::write(&path, contents).unwrap();
        for error in [Store::open(&path).await.unwrap_err(), Store::open_read_only(&path).await.unwrap_err()] {
            assert!(matches!(error, StoreError::NotAStore { .. }) && error.to_string().contains("journal.db"), "{error}");
        }
        assert_eq!(std::fs::read(&path).unwrap(), contents);
    }

    let foreign = directory.path().join("places.db");
    run(&foreign, "CREATE TABLE bookmarks (url TEXT); INSERT INTO bookmarks VALUES ('here');").await;
    let other_steps = directory.path().join("steps.db");
    run(
        &other_steps,
        "CREATE TABLE _sqlx_migrations (version BIGINT PRIMARY KEY, checksum BLOB NOT NULL); \
         INSERT INTO _sqlx_migrations VALUES (20260101, x'00');",
    )
    .await;
    for path in [foreign, other_steps] {
        let before = std::fs::read(&path).unwrap();
        for error in [Store::open(&path).await.unwrap_err(), Store::open_read_only(&path).await.unwrap_err()] {
            assert!(matches!(error, StoreError::NotAStore { .. }), "{error}");
        }
        assert_eq!(std::fs::read(&path).unwrap(), before);
    }
}

#[tokio::test]
async fn a_store_of_a_newer_coordinator_is_refused_and_left_as_it_is() {
    let (_directory, path) = place();
    open(&path).await.close().await;
    run(
        &path,
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) VALUES (9, 'later', TRUE, x'00', 0)",
    )
    .await;
    let before = std::fs::read(&path).unwrap();
    for error in [Store::open(&path).await.unwrap_err(), Store::open_read_only(&path).await.unwrap_err()] {
        assert!(matches!(error, StoreError::Newer { found: 9, known: 6, .. }), "{error}");
        assert!(error.to_string().contains("journal.db has format 9"), "{error}");
    }
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[tokio::test]
async fn a_file_with_two_names_is_refused_and_a_store_of_another_site_too() {
    let (directory, path) = place();
    let store = Store::open_for(&path, "north").await.unwrap();
    store.close().await;
    let error = Store::open_for(&path, "south").await.unwrap_err();
    assert!(matches!(error, StoreError::OtherSite { .. }) && error.to_string().contains("belongs to site north"), "{error}");
    // A refusal leaves the store free.
    Store::open_for(&path, "north").await.unwrap().close().await;
    let other = directory.path().join("other.db");
    std::fs::hard_link(&path, &other).unwrap();
    for name in [&path, &other] {
        let error = open_error(name).await;
        assert!(matches!(error, StoreError::Linked { names: 2, .. }), "{error}");
    }
}

#[tokio::test]
async fn a_writer_whose_successor_has_counted_a_start_writes_nothing_more() {
    let (_directory, path) = place();
    let store = open(&path).await;
    run(&path, "UPDATE meta SET value = value + 1 WHERE name = 'epoch'").await;
    let error = store.append(&events(1..=1)).await.unwrap_err();
    assert!(matches!(error, StoreError::Deposed { .. }), "{error}");
    assert_eq!(store.events(9).await.unwrap(), []);
}

async fn open_error(path: &Path) -> StoreError {
    Store::open(path).await.unwrap_err()
}
