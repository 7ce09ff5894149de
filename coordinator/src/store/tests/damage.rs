use super::*;

/// A batch that needs several hundred pages of 4 KiB.
fn large(first: u64) -> Vec<Record> {
    let text = "r1 joined ".repeat(100);
    (first..first + 1_000).map(|seq| Record::Event(event(seq, &text))).collect()
}

#[tokio::test]
async fn a_full_disk_loses_the_batch_and_nothing_else_until_there_is_room() {
    let (_directory, path) = place();
    let store = open(&path).await;
    store.append(&one_of_each()).await.unwrap();
    let before = counts(&store).await;
    for _ in 0..3 {
        store.limit_pages(100).await;
        let error = store.append(&large(100)).await.unwrap_err();
        assert!(matches!(error, StoreError::Full { .. }) && error.to_string().contains("journal.db cannot be written"), "{error}");
        assert_eq!(counts(&store).await, before);
        // What is small enough still goes in.
        store.append(&one_of_each()[..2]).await.unwrap();
    }
    store.limit_pages(1_000_000).await;
    store.append(&large(100)).await.unwrap();
    assert_eq!(rows(&store).await, before.values().sum::<i64>() + 1_000);
    store.close().await;
    assert_eq!(open(&path).await.next_event_seq().await.unwrap(), 1_100);
}

/// A store with some pages of content, as bytes.
async fn file_of_a_store(path: &Path) -> Vec<u8> {
    let store = open(path).await;
    store.append(&one_of_each()).await.unwrap();
    store.append(&large(100)).await.unwrap();
    store.close().await;
    std::fs::read(path).unwrap()
}

#[tokio::test]
async fn a_file_that_was_cut_off_is_an_error_and_stays_as_it_is() {
    let (directory, path) = place();
    let whole = file_of_a_store(&path).await;
    let lengths = [1, 15, 16, 17, 99, 100, 101, 511, 512, 1_000, 4_095, 4_096, 4_097, 8_192];
    let lengths = lengths.into_iter().chain((1..8).map(|part| whole.len() * part / 8)).chain([whole.len() - 4_096, whole.len() - 1]);
    for length in lengths {
        let cut = directory.path().join(format!("cut-{length}.db"));
        std::fs::write(&cut, &whole[..length]).unwrap();
        for error in [Store::open_read_only(&cut).await.unwrap_err(), Store::open(&cut).await.unwrap_err()] {
            assert!(matches!(error, StoreError::NotAStore { .. } | StoreError::Damaged { .. }), "{length}: {error}");
            assert!(error.to_string().contains("cut-"), "{length}: {error}");
        }
        assert!(std::fs::read(&cut).unwrap() == whole[..length], "{length}");
    }
}

#[tokio::test]
async fn an_overwritten_page_is_an_error_wherever_it_is_read() {
    let (directory, path) = place();
    let whole = file_of_a_store(&path).await;
    let pages = whole.len() / 4_096;
    let mut errors = 0;
    for page in (0..pages.min(60)).chain(pages - 3..pages) {
        let mut bytes = whole.clone();
        bytes[page * 4_096 + 16..(page + 1) * 4_096].fill(0x55);
        let path = directory.path().join(format!("page-{page}.db"));
        std::fs::write(&path, bytes).unwrap();
        let Ok(store) = Store::open(&path).await else {
            errors += 1;
            continue;
        };
        // An error or not, as the page is needed or not; never a panic.
        let answers = [
            store.events(usize::MAX).await.is_ok(),
            store.latest_schedule().await.is_ok(),
            store.decisions(Numbering::default(), None).await.is_ok(),
            message(&store, What::RobotGauge(id("r1"), at(1), 1)).await.is_ok(),
            message(&store, What::StationState(id("north"), at(1), 1)).await.is_ok(),
            store.latest_explanation(&id("r1")).await.is_ok(),
            store.latest_capacity().await.is_ok(),
            store.starts().await.is_ok(),
            store.heard(1, 0, 9).await.is_ok(),
            store.append(&events(5_000..=5_000)).await.is_ok(),
        ];
        errors += usize::from(answers.contains(&false));
    }
    assert!(errors > 30, "only {errors} pages were missed");
}

#[tokio::test]
async fn a_row_that_no_coordinator_wrote_is_an_error_that_names_the_table() {
    let (_directory, path) = place();
    let store = open(&path).await;
    store.append(&one_of_each()).await.unwrap();
    for sql in [
        "UPDATE plans SET body = '{'",
        "UPDATE events SET body = 'null'",
        "UPDATE robot_states SET body = '[]'",
        "UPDATE pack_gauges SET cells_series = -1",
        "UPDATE commands SET robot = 'no robot'",
    ] {
        sqlx::query(sql).execute(&store.writer).await.unwrap();
    }
    let errors = [
        (store.latest_schedule().await.unwrap_err(), "plans"),
        (store.events(9).await.unwrap_err(), "events"),
        (message(&store, What::RobotState(id("r1"), at(1), 1)).await.unwrap_err(), "robot_states"),
        (message(&store, What::PackGauge(id("north"), id("p1"), at(1), 1)).await.unwrap_err(), "what a line points to"),
        (store.decisions(Numbering { plan: 9, event: 9, epoch: 1 }, None).await.unwrap_err(), "commands"),
    ];
    for (error, table) in errors {
        assert!(matches!(error, StoreError::Damaged { .. }) && error.to_string().contains(table), "{error}");
    }
}

/// A power cut tears what was being written: any part of the log's end may be missing, or be something
/// else. What was appended before stands, what was being appended is there as a whole or not at all.
#[tokio::test]
async fn a_log_whose_end_is_torn_loses_nothing_that_was_appended_before() {
    let (directory, path) = place();
    let log = path.with_file_name("journal.db-wal");
    let store = open(&path).await;
    store.append(&one_of_each()).await.unwrap();
    store.append(&events(2..=5)).await.unwrap();
    let before = std::fs::metadata(&log).unwrap().len() as usize;
    store.append(&events(6..=40)).await.unwrap();
    let (database, whole) = (std::fs::read(&path).unwrap(), std::fs::read(&log).unwrap());
    assert!(whole.len() > before + 4_096, "the last batch is in the log: {} after {before}", whole.len());
    let mut seen = std::collections::BTreeSet::new();
    let step = (whole.len() - before) / 20;
    for cut in (before..=whole.len()).step_by(step.max(1)).chain([whole.len() - 1, whole.len()]) {
        for garbage in [None, Some(0x00), Some(0x55)] {
            let torn = directory.path().join(format!("torn-{cut}-{garbage:?}.db"));
            let mut bytes = whole[..cut].to_vec();
            if let Some(byte) = garbage {
                bytes.resize(whole.len(), byte);
            }
            std::fs::write(&torn, &database).unwrap();
            std::fs::write(torn.with_file_name(format!("torn-{cut}-{garbage:?}.db-wal")), bytes).unwrap();
            let store = open(&torn).await;
            let next = store.next_event_seq().await.unwrap();
            assert!(next == 6 || next == 41, "cut at {cut} of {}: the next event is {next}", whole.len());
            assert!(commands(&store).await.len() == 1 && reply_to(&store, "c1").await.is_some());
            seen.insert(next);
            store.close().await;
        }
    }
    assert_eq!(seen, [6, 41].into(), "torn before and after the end of the last batch");
}
