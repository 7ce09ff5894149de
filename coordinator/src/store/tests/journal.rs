use super::*;

/// What is true of a journal, wherever it is kept.
macro_rules! bodies {
    ($($name:ident),* $(,)?) => {
        const NAMES: &[&str] = &[$(stringify!($name)),*];

        /// How many there are.
        pub(super) const BODIES: usize = NAMES.len();

        /// Runs one of them on an empty store.
        pub(super) async fn body(number: usize, path: &Path) {
            let mut next = 0;
            $(
                if number == next {
                    $name(path).await;
                }
                next += 1;
            )*
            assert!(number < next, "{NAMES:?}");
        }

        mod in_a_file {
            use super::*;
            $(
                #[tokio::test(flavor = "multi_thread")]
                async fn $name() {
                    let (_directory, path) = place();
                    super::$name(&path).await;
                }
            )*
        }
    };
}

bodies! {
    gives_back_what_was_appended,
    what_the_core_was_told_comes_back_as_the_same_inputs,
    an_empty_store_answers_with_nothing,
    numbers_from_the_network_may_be_as_large_as_they_like,
    the_last_events_come_oldest_first,
    the_latest_is_what_was_appended_last_even_at_the_same_instant,
    a_batch_appended_twice_is_kept_once,
    a_command_keeps_its_first_answer,
    an_answer_to_a_command_of_an_earlier_store_does_no_harm,
    a_batch_that_fails_half_way_leaves_nothing,
    refuses_what_it_could_not_give_back,
    many_tasks_append_and_read_at_once,
    an_append_that_is_given_up_leaves_all_or_nothing,
}

async fn gives_back_what_was_appended(path: &Path) {
    let store = open(path).await;
    store.append(&one_of_each()).await.unwrap();
    assert_eq!(store.latest_schedule().await.unwrap(), Some(schedule(1)));
    assert_eq!(store.latest_capacity().await.unwrap(), Some(capacity(8)));
    assert_eq!(store.latest_explanation(&id("r1")).await.unwrap(), Some(explanation("r1", "it runs empty first")));
    assert_eq!(store.events(10).await.unwrap(), [event(1, "r1 joined")]);
    for (what, record) in [
        (What::RobotGauge(id("r1"), at(1), 1), robot_gauge("r1", 1)),
        (What::PackGauge(id("north"), id("p1"), at(1), 1), pack_gauge(1)),
        (What::RobotState(id("r1"), at(1), 1), robot_state("r1", 1, RobotPhase::Working)),
        (What::StationState(id("north"), at(1), 1), station_state(1)),
    ] {
        assert_eq!(message(&store, what).await.unwrap(), Some(record));
    }
    assert_eq!(commands(&store).await, [to_robot("c1", 3)]);
    assert_eq!(reply_to(&store, "c1").await, Some(reply("c1", 5)));
    assert!(counts(&store).await.values().all(|&rows| rows == 1));
}

async fn what_the_core_was_told_comes_back_as_the_same_inputs(path: &Path) {
    use crate::core::Input;
    use crate::replay::Inputs;
    let store = open(path).await;
    let told = [
        Input::Tick,
        Input::Studied,
        Input::RobotGauge(id("r1"), gauge(1)),
        Input::PackGauge(id("north"), id("p1"), gauge(2)),
        Input::RobotAlive(id("r1"), false),
        Input::StationAlive(id("north"), true),
        Input::Reply(reply("c1", 5)),
    ];
    let mut records = Vec::new();
    for (index, input) in told.iter().enumerate() {
        let came: Vec<Record> = match input.clone() {
            Input::RobotGauge(robot, gauge) => vec![Record::RobotGauge { robot, gauge }],
            Input::PackGauge(station, pack, gauge) => vec![Record::PackGauge { station, pack, gauge }],
            _ => Vec::new(),
        };
        records.push(Record::Heard(Heard::of((store.epoch(), index as u64 + 1), at(index as i64), input.clone(), &came)));
        records.extend(came);
    }
    store.append(&records).await.unwrap();
    assert_eq!(store.starts().await.unwrap().len(), 1);
    let mut again = Vec::new();
    for heard in store.heard(store.epoch(), 0, 100).await.unwrap() {
        let message = store.message_of(&heard).await.unwrap();
        again.push(Inputs::of(&message).input(&heard).unwrap());
    }
    assert_eq!(again, told);
    assert_eq!(store.heard(store.epoch(), 4, 1).await.unwrap()[0].number, 5);
}

async fn an_empty_store_answers_with_nothing(path: &Path) {
    let store = open(path).await;
    store.append(&[]).await.unwrap();
    assert_eq!(store.latest_schedule().await.unwrap(), None);
    assert_eq!(store.latest_capacity().await.unwrap(), None);
    assert_eq!(store.latest_explanation(&id("r1")).await.unwrap(), None);
    assert_eq!(store.events(10).await.unwrap(), []);
    assert_eq!(message(&store, What::RobotGauge(id("r1"), at(1), 1)).await.unwrap(), None);
    assert_eq!(commands(&store).await, []);
    assert_eq!(rows(&store).await, 0);
}

async fn numbers_from_the_network_may_be_as_large_as_they_like(path: &Path) {
    let store = open(path).await;
    let far = Gauge { at: Timestamp::from_unix_ms(i64::MAX), seq: u64::MAX, ..gauge(0) };
    store.append(&[Record::RobotGauge { robot: id("r1"), gauge: far.clone() }]).await.unwrap();
    let told = message(&store, What::RobotGauge(id("r1"), far.at, far.seq)).await.unwrap();
    assert_eq!(told, Some(Record::RobotGauge { robot: id("r1"), gauge: far }));
}

async fn the_last_events_come_oldest_first(path: &Path) {
    let store = open(path).await;
    store.append(&events(1..=9)).await.unwrap();
    let last: Vec<u64> = store.events(3).await.unwrap().iter().map(|event| event.seq).collect();
    assert_eq!(last, [7, 8, 9]);
    assert_eq!(store.events(0).await.unwrap(), []);
    assert_eq!(store.events(usize::MAX).await.unwrap().len(), 9);
}

async fn the_latest_is_what_was_appended_last_even_at_the_same_instant(path: &Path) {
    let store = open(path).await;
    let explain = |reason| Record::Explanations(vec![explanation("r1", reason), explanation("r2", reason)]);
    store.append(&[Record::Capacity(capacity(8)), Record::Capacity(capacity(7)), explain("first")]).await.unwrap();
    store.append(&[Record::Capacity(capacity(6)), explain("second")]).await.unwrap();
    assert_eq!(store.latest_capacity().await.unwrap(), Some(capacity(6)));
    assert_eq!(store.latest_explanation(&id("r2")).await.unwrap(), Some(explanation("r2", "second")));
    assert_eq!(counts(&store).await["explanations"], 2);
}

async fn a_batch_appended_twice_is_kept_once(path: &Path) {
    let store = open(path).await;
    let batch: Vec<Record> = one_of_each().into_iter().filter(|record| !matches!(record, Record::Capacity(_))).collect();
    store.append(&batch).await.unwrap();
    let before = counts(&store).await;
    store.append(&batch).await.unwrap();
    store.append(&[batch.clone(), batch].concat()).await.unwrap();
    assert_eq!(counts(&store).await, before);
}

async fn a_command_keeps_its_first_answer(path: &Path) {
    let store = open(path).await;
    store.append(&[to_station("c2", 4), to_robot("c1", 3), to_robot("c3", 5)]).await.unwrap();
    let sent = commands(&store).await;
    assert!(
        sent.len() == 3 && [to_robot("c1", 3), to_station("c2", 4), to_robot("c3", 5)].iter().all(|one| sent.contains(one)),
        "{sent:?}"
    );
    assert_eq!(reply_to(&store, "c1").await, None);

    store.append(&[Record::Reply(reply("c1", 10)), Record::Reply(reply("c1", 11)), Record::Reply(reply("c3", 12))]).await.unwrap();
    // A repetition of the command does not make it unanswered again.
    store.append(&[to_robot("c1", 3), Record::Reply(reply("c1", 13))]).await.unwrap();
    for (name, answer) in [("c1", Some(reply("c1", 10))), ("c2", None), ("c3", Some(reply("c3", 12)))] {
        assert_eq!(reply_to(&store, name).await, answer);
    }
}

async fn an_answer_to_a_command_of_an_earlier_store_does_no_harm(path: &Path) {
    let store = open(path).await;
    store.append(&[Record::Reply(reply("c0", 10)), Record::Event(event(1, "r1 joined"))]).await.unwrap();
    assert_eq!((commands(&store).await, reply_to(&store, "c0").await), (Vec::new(), None));
    assert_eq!(rows(&store).await, 1);
}

async fn a_batch_that_fails_half_way_leaves_nothing(path: &Path) {
    let store = open(path).await;
    store.append(&[Record::Event(event(5, "r1 joined")), to_robot("c1", 3), Record::Plan(Arc::new(schedule(2)))]).await.unwrap();
    let before = counts(&store).await;
    let other_plan = Schedule { trigger: "r2 joined".to_owned(), ..schedule(2) };
    let other_target = Record::RobotCommand { robot: id("r2"), command: robot_command("c1", 3) };
    let taken = [
        (Record::Event(event(5, "r2 joined")), "event 5"),
        (Record::Plan(Arc::new(other_plan)), "plan 2"),
        (to_robot("c1", 4), "command c1"),
        (other_target, "command c1"),
    ];
    for (record, name) in taken {
        let batch = [robot_gauge("r1", 9), Record::Event(event(6, "r2 joined")), record, Record::Event(event(7, "r3 joined"))];
        let error = store.append(&batch).await.unwrap_err();
        assert!(matches!(&error, StoreError::Conflict { record, .. } if record == name), "{error}");
        assert_eq!(counts(&store).await, before);
    }
    // And the store goes on.
    store.append(&one_of_each()[..2]).await.unwrap();
    assert_eq!(rows(&store).await, before.values().sum::<i64>() + 2);
}

async fn refuses_what_it_could_not_give_back(path: &Path) {
    let store = open(path).await;
    let nan = Gauge { power_w: f64::NAN, ..gauge(1) };
    let bad_capacity = Capacity { confidence: f64::INFINITY, ..capacity(1) };
    let records = [
        (Record::RobotGauge { robot: id("r1"), gauge: nan.clone() }, "a gauge of robot r1 cannot be stored: `power_w` is NaN"),
        (Record::PackGauge { station: id("north"), pack: id("p1"), gauge: nan }, "a gauge of pack p1 of station north"),
        (Record::Capacity(bad_capacity), "the capacity at 2026-01-01T00:00:07.000Z cannot be stored: `confidence`"),
        (Record::Event(Event { seq: 1 << 63, ..event(1, "") }), "event 9223372036854775808 cannot be stored"),
    ];
    for (record, text) in records {
        let error = store.append(&[Record::Event(event(1, "r1 joined")), record]).await.unwrap_err().to_string();
        assert!(error.starts_with(text), "{error}");
    }
    assert_eq!(rows(&store).await, 0);
}

async fn many_tasks_append_and_read_at_once(path: &Path) {
    let store = Arc::new(open(path).await);
    let tasks: Vec<_> = (0..8_u64)
        .map(|task| {
            let store = store.clone();
            tokio::spawn(async move {
                for turn in 0..20 {
                    let first = (task * 20 + turn) * 5 + 1;
                    store.append(&events(first..=first + 4)).await.unwrap();
                    // Batches are seen whole.
                    assert_eq!(rows(&store).await % 5, 0);
                }
            })
        })
        .collect();
    for task in tasks {
        task.await.unwrap();
    }
    assert_eq!(rows(&store).await, 800);
}

async fn an_append_that_is_given_up_leaves_all_or_nothing(path: &Path) {
    let store = open(path).await;
    for patience in 0..40_u64 {
        let first = patience * 100 + 1;
        let batch = events(first..=first + 99);
        let yields = async {
            for _ in 0..patience * 8 {
                tokio::task::yield_now().await;
            }
        };
        tokio::select! {
            biased;
            () = yields => {}
            done = store.append(&batch) => done.unwrap(),
        }
        assert_eq!(rows(&store).await % 100, 0);
    }
    store.append(&events(1..=100)).await.unwrap();
}
