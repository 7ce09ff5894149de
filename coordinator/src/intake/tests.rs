//! What comes out of the queue before the core, in which order, and what is left in it.

use proto::{Estimate, Gauge, Mission, RobotId, RobotPhase, Timestamp, encode};

use super::*;

const EVERY: Duration = Duration::from_millis(500);

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn robot(n: usize) -> RobotId {
    RobotId::new(format!("r{n}")).unwrap()
}

fn gauge(n: usize, seq: u64) -> Input {
    let one = Estimate::new(1.0, 0.1);
    let gauge = Gauge {
        at: Timestamp::from_unix_ms(seq.cast_signed()),
        seq,
        soc: Estimate::new(0.5, 0.01),
        remaining_wh: one,
        full_wh: one,
        time_to_empty_s: None,
        time_to_full_s: None,
        soh: one,
        cycles: None,
        voltage_v: 11.0,
        current_a: 0.4,
        temperature_degc: 25.0,
        power_w: 4.4,
        cells_series: 3,
        source: "coulomb_counter".to_owned(),
    };
    Input::RobotGauge(robot(n), gauge)
}

fn state(phase: RobotPhase, seq: u64) -> Input {
    state_of(0, phase, seq)
}

fn state_of(n: usize, phase: RobotPhase, seq: u64) -> Input {
    let state = RobotState {
        at: Timestamp::from_unix_ms(seq.cast_signed()),
        seq,
        phase,
        station: None,
        bay: None,
        drain_w: Estimate::new(4.0 + seq as f64 / 100.0, 0.1),
        travel: BTreeMap::new(),
        mission: Mission { weight: 1.0, until: None },
        battery: "b".to_owned(),
        load: None,
        last_command: None,
        note: None,
    };
    Input::RobotState(robot(n), state)
}

/// Says it, as it comes over the network.
fn offer(intake: &mut Intake, now: Duration, input: &Input) {
    let (key, payload) = match input {
        Input::RobotGauge(robot, gauge) => (Key::RobotGauge(robot.clone()), encode(gauge)),
        Input::RobotState(robot, state) => (Key::RobotState(robot.clone()), encode(state)),
        _ => unreachable!("only these are said here"),
    };
    intake.hear(now, &key.build(&"site".parse().unwrap()), &payload);
}

fn is_ready(intake: &Intake, now: Duration) -> bool {
    intake.ready_at().is_some_and(|at| at <= now)
}

fn drained(intake: &mut Intake, now: Duration) -> Vec<Input> {
    std::iter::from_fn(|| intake.next(now)).collect()
}

#[test]
fn of_a_flood_each_sender_has_its_newest_word() {
    let mut intake = Intake::new(EVERY);
    (0..10_000).for_each(|seq| (0..3).for_each(|n| offer(&mut intake, ms(1), &gauge(n, seq))));
    assert_eq!(drained(&mut intake, ms(2)), [gauge(0, 9_999), gauge(1, 9_999), gauge(2, 9_999)]);
    // What comes too soon waits, and the last of it is not lost.
    (0..100).for_each(|seq| offer(&mut intake, ms(3), &gauge(1, 10_000 + seq)));
    assert!(!is_ready(&intake, ms(501)) && drained(&mut intake, ms(501)).is_empty());
    assert!(is_ready(&intake, ms(502)));
    assert_eq!(drained(&mut intake, ms(502)), [gauge(1, 10_099)]);
}

#[test]
fn at_its_usual_pace_every_message_is_taken_at_once() {
    let mut intake = Intake::new(EVERY);
    for second in 0..100 {
        offer(&mut intake, ms(1000 * second), &gauge(0, second));
        assert_eq!(drained(&mut intake, ms(1000 * second)), [gauge(0, second)]);
    }
}

#[test]
fn every_change_of_state_comes_through_in_order_whatever_the_flood() {
    let mut intake = Intake::new(EVERY);
    let phases = [RobotPhase::Working, RobotPhase::Travelling, RobotPhase::Waiting, RobotPhase::Docked];
    for (n, phase) in (0..).zip(phases) {
        (0..1_000).for_each(|seq| offer(&mut intake, ms(n), &state(phase, 1_000 * n + seq)));
    }
    let told = drained(&mut intake, ms(4));
    let changes = (0..).zip(phases).map(|(n, phase)| state(phase, 1_000 * n));
    assert_eq!(told[..4], changes.collect::<Vec<_>>());
    // And the figures of the last one.
    assert_eq!(told[4..], [state(RobotPhase::Docked, 3_999)]);
    assert_eq!(intake.take_lost(), 0);
}

#[test]
fn what_cannot_be_read_is_refused_by_its_key_once_for_each_turn() {
    let mut intake = Intake::new(EVERY);
    let key = "tender/site/v1/robot/r0/gauge";
    (0..100).for_each(|_| intake.hear(ms(0), key, b"{}"));
    let [Input::Refused(why)] = &drained(&mut intake, ms(0))[..] else { panic!("one refusal") };
    assert!(why.starts_with("tender/site/v1/robot/r0/gauge: "), "{why}");
    intake.hear(ms(0), "tender/site/v1/robot/r0/state", b"nonsense");
    intake.hear(ms(0), "tender/site/v1/robot/r0/command", b"{}");
    intake.hear(ms(0), key, &vec![b' '; proto::MAX_MESSAGE_BYTES + 1]);
    intake.hear(ms(0), "tender/site/v1/robot/\u{1b}[2J\n/gauge", b"{}");
    let refused = drained(&mut intake, ms(0));
    let of = |n: usize| if let Input::Refused(why) = &refused[n] { why.as_str() } else { "" };
    assert!(of(0).starts_with("tender/site/v1/robot/r0/state: "), "{refused:?}");
    assert!(of(1).ends_with("command: nothing is expected under this key") && of(2).contains("allowed are at most"), "{refused:?}");
    // A terminal shall show a stranger's key, not obey it.
    assert!(of(3).contains("robot/\\u001b[2J\\n/gauge") && !of(3).contains(char::is_control), "{refused:?}");
}

#[test]
fn memory_is_bounded_by_senders_and_changes() {
    let mut intake = Intake::new(EVERY);
    (0..SENDERS_MAX + 5).for_each(|n| intake.hear(ms(0), &format!("tender/site/v1/robot/r{n}/gauge"), b"{}"));
    (0..STRANGERS_MAX + 7).for_each(|n| intake.hear(ms(0), &format!("tender/site/v1/{n}"), b"{}"));
    assert_eq!((intake.slots.len(), intake.strangers.len(), intake.take_lost()), (SENDERS_MAX, STRANGERS_MAX, 12));
    // Two thousand senders with all changes that one may have would be twice as many as wait: of the later ones fewer do,
    // but of each the last.
    for place in 0..2_000 {
        (0..CHANGES_OF_ONE + 3).for_each(|n| intake.change(place, Input::Replan(format!("{n}"))));
    }
    assert!((CHANGES_MAX..CHANGES_MAX + 2_000).contains(&intake.changes), "{}", intake.changes);
    assert_eq!(intake.changes, intake.slots.iter().map(|slot| slot.changes.len()).sum::<usize>());
    let last = Input::Replan(format!("{}", CHANGES_OF_ONE + 2));
    assert!(intake.slots[..2_000].iter().all(|slot| slot.changes.back() == Some(&last)));
    assert_eq!(intake.take_lost() as usize, 2_000 * (CHANGES_OF_ONE + 3) - intake.changes);
    let expected = SENDERS_MAX + STRANGERS_MAX + intake.changes;
    assert_eq!(drained(&mut intake, ms(0)).len(), expected);
    assert_eq!((intake.changes, intake.changed.len(), intake.ready.len()), (0, 0, 0));
    assert!(intake.slots.iter().all(|slot| slot.changes.capacity() == 0 && slot.payload.capacity() == 0));
}

#[test]
fn whoever_flips_its_state_or_talks_nonsense_takes_nobody_elses_place_or_turn() {
    let mut intake = Intake::new(EVERY);
    offer(&mut intake, ms(0), &state_of(1, RobotPhase::Working, 7));
    let phases = [RobotPhase::Working, RobotPhase::Travelling];
    const FLIPS: u64 = 5_000;
    for seq in 0..FLIPS {
        offer(&mut intake, ms(0), &state_of(0, phases[seq as usize % 2], seq));
        intake.hear(ms(0), "tender/site/v1/robot/r3/state", b"nonsense");
        intake.hear(ms(0), &format!("tender/site/v1/{seq}"), b"nonsense");
    }
    (4..7).for_each(|n| offer(&mut intake, ms(0), &gauge(n, 1)));
    assert_eq!(intake.take_lost(), (FLIPS - CHANGES_OF_ONE as u64) + (FLIPS - STRANGERS_MAX as u64));
    let told = drained(&mut intake, ms(0));
    // One turn each of four with changes, and as many of gauges in between.
    let place = |input: &Input| told.iter().position(|told| told == input).unwrap();
    assert!(place(&state_of(1, RobotPhase::Working, 7)) < 8);
    assert!((4..7).all(|n| place(&gauge(n, 1)) < 8), "{:?}", &told[..8]);
    let of_r3 = |input: &&Input| matches!(input, Input::Refused(why) if why.contains("robot/r3/state"));
    assert_eq!((told.iter().filter(of_r3).count(), told[..8].iter().filter(of_r3).count()), (1, 1));
    let flips = told
        .iter()
        .filter_map(|input| if let Input::RobotState(id, state) = input { (*id == robot(0)).then_some(state.seq) } else { None });
    assert!(flips.eq(FLIPS - CHANGES_OF_ONE as u64..FLIPS), "the newest, in order");
    // Nonsense under a key keeps back no word of whose key it is.
    offer(&mut intake, ms(600), &gauge(4, 2));
    let is_told = (0..4).any(|_| {
        intake.hear(ms(600), "tender/site/v1/robot/r4/gauge", &vec![b' '; proto::MAX_MESSAGE_BYTES + 1]);
        intake.next(ms(600)) == Some(gauge(4, 2))
    });
    assert!(is_told);
}

#[test]
fn whoever_changes_and_goes_on_by_turns_stands_in_each_queue_once() {
    let mut intake = Intake::new(EVERY);
    let phases = [RobotPhase::Working, RobotPhase::Travelling];
    let mut told = Vec::new();
    for seq in 0..2_000 {
        // A change, a word like it, and now and then one of them is taken.
        offer(&mut intake, ms(seq), &state(phases[(seq as usize / 2) % 2], seq));
        if seq % 50 == 0 {
            told.extend(intake.next(ms(seq)));
        }
        assert!(intake.changed.len() <= 1 && intake.ready.len() <= 1 && intake.resting.len() <= 1, "{intake:?}");
    }
    told.extend(drained(&mut intake, ms(3_000)));
    let seqs: Vec<u64> = told.iter().map(|input| if let Input::RobotState(_, state) = input { state.seq } else { 0 }).collect();
    assert!(seqs.is_sorted() && seqs.last() == Some(&1_999), "{seqs:?}");
}

#[test]
fn whoever_rests_is_taken_when_it_is_due_whoever_spoke_first() {
    let mut intake = Intake::new(EVERY);
    for (n, at) in [(0, 0), (1, 100)] {
        offer(&mut intake, ms(at), &gauge(n, 1));
        assert_eq!(drained(&mut intake, ms(at)), [gauge(n, 1)]);
    }
    offer(&mut intake, ms(200), &gauge(1, 2));
    offer(&mut intake, ms(300), &gauge(0, 2));
    assert_eq!(intake.ready_at(), Some(ms(500)));
    assert_eq!(drained(&mut intake, ms(500)), [gauge(0, 2)]);
    assert_eq!((intake.ready_at(), drained(&mut intake, ms(600))), (Some(ms(600)), vec![gauge(1, 2)]));
}

#[test]
fn who_is_gone_is_not_there_again_with_a_word_that_waited() {
    let (mut intake, key) = (Intake::new(EVERY), Key::RobotState(robot(0)).build(&"site".parse().unwrap()));
    let says = |intake: &mut Intake, phase, seq| (0..2).for_each(|n| offer(intake, ms(10 * seq), &state_of(n, phase, seq)));
    says(&mut intake, RobotPhase::Working, 0);
    assert_eq!(drained(&mut intake, ms(0)).len(), 2);
    // A state like the last waits for its time, and one that differs for its turn.
    says(&mut intake, RobotPhase::Working, 1);
    intake.withdraw(&key);
    assert_eq!(drained(&mut intake, ms(1000)), [state_of(1, RobotPhase::Working, 1)]);
    says(&mut intake, RobotPhase::Charging, 200);
    intake.hear(ms(2000), &key, b"nonsense");
    intake.withdraw(&key);
    let left = drained(&mut intake, ms(3000));
    assert_eq!(left.len(), 2, "{left:?}");
    assert!(left.contains(&state_of(1, RobotPhase::Charging, 200)) && left.iter().any(is_refusal), "{left:?}");
    assert_eq!((intake.changes, intake.changed.len()), (0, 0));
    // Back, it is heard at once, though it says what it said before.
    offer(&mut intake, ms(3001), &state_of(0, RobotPhase::Charging, 301));
    assert_eq!(drained(&mut intake, ms(3001)), [state_of(0, RobotPhase::Charging, 301)]);
}
