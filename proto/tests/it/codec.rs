//! Decoding bytes from strangers: tolerant to additions, exact about everything else.

use proptest::prelude::*;
use proto::*;
use serde_json::{Value, json};

use crate::examples::{self, each_message};

fn refused<M: Message + std::fmt::Debug>(bytes: &[u8]) -> CodecError {
    decode::<M>(bytes).expect_err("decoded what it should refuse")
}

/// The gauge example with one field replaced, as bytes.
fn gauge_with(field: &str, value: Value) -> Vec<u8> {
    let mut object: Value = serde_json::from_slice(&encode(&examples::gauge())).unwrap();
    object[field] = value;
    serde_json::to_vec(&object).unwrap()
}

#[test]
fn unknown_fields_are_ignored_at_every_level() {
    fn check<M: Message + PartialEq + std::fmt::Debug>(example: &M) {
        fn widen(value: &mut Value) {
            match value {
                Value::Object(fields) => {
                    fields.values_mut().for_each(widen);
                    // Maps from names to numbers or ways are data, not fields.
                    let is_data = fields.keys().any(|k| k == "north" || k == "conversion");
                    if !is_data {
                        fields.insert("from_the_future".to_owned(), json!({"a": [1, null]}));
                    }
                }
                Value::Array(items) => items.iter_mut().for_each(widen),
                _ => {}
            }
        }
        let mut value: Value = serde_json::from_slice(&encode(example)).unwrap();
        widen(&mut value);
        let bytes = serde_json::to_vec(&value).unwrap();
        assert_eq!(decode::<M>(&bytes).as_ref(), Ok(example));
    }
    macro_rules! run {
        ($name:literal, $example:expr) => {
            check(&$example)
        };
    }
    each_message!(run);
}

#[test]
fn another_version_is_refused_by_name_even_when_its_fields_differ() {
    let error = refused::<Gauge>(br#"{"schema":"tender.gauge/2","charge":"high"}"#);
    assert!(matches!(error, CodecError::OtherVersion { .. }));
    let text = error.to_string();
    assert!(text.contains("`tender.gauge/2`") && text.contains("tender.gauge/1"));
}

#[test]
fn another_kind_is_refused_by_name() {
    let error = refused::<RobotState>(&encode(&examples::gauge()));
    assert!(matches!(error, CodecError::OtherKind { .. }));
    let text = error.to_string();
    assert!(text.contains("`tender.gauge/1`") && text.contains("tender.robot-state/1"));
}

#[test]
fn no_text_of_a_message_reaches_a_terminal_raw() {
    const HOSTILE: &str = "\u{1b}[2J\nWARN all is well\u{9b}1m";
    let mut state = examples::robot_state();
    (state.note, state.battery) = (Some(HOSTILE.to_owned()), HOSTILE.to_owned());
    state.load = Some(NamedModel { model: HOSTILE.to_owned(), without: vec![HOSTILE.to_owned()] });
    let told = decode::<RobotState>(&encode(&state)).unwrap();
    let shown = "\\u001b[2J\\nWARN all is well\\u009b1m";
    assert_eq!((told.note.as_deref(), told.battery.as_str()), (Some(shown), shown));
    assert_eq!(told.load, Some(NamedModel { model: shown.to_owned(), without: vec![shown.to_owned()] }));
    // What was read, kept and read again is the same.
    assert_eq!(decode::<RobotState>(&encode(&told)).as_ref(), Ok(&told));
    // Neither do the words that refuse one.
    for bytes in [
        gauge_with("voltage_v", json!(HOSTILE)),
        gauge_with("schema", json!(HOSTILE)),
        [&b"{\r\t"[..], &gauge_with("soh", json!(HOSTILE))[1..]].concat(),
    ] {
        let text = refused::<Gauge>(&bytes).to_string();
        assert!(!text.contains(char::is_control), "{text:?}");
    }
}

#[test]
fn a_message_without_a_text_schema_is_refused() {
    for bytes in [&b"{}"[..], br#"{"schema":null}"#, br#"{"schema":1}"#] {
        let error = refused::<Gauge>(bytes);
        assert!(matches!(error, CodecError::NoSchema { .. }), "{error}");
    }
}

#[test]
fn what_is_not_one_json_object_is_refused() {
    let twice = [encode(&examples::gauge()), encode(&examples::gauge())].concat();
    let deep = format!("{{\"schema\":{}", "[".repeat(100_000));
    for bytes in [&b""[..], b"  ", b"\xff\xfe", b"null", br#"["tender.gauge/1"]"#, &twice, deep.as_bytes()] {
        let error = refused::<Gauge>(bytes);
        assert!(matches!(error, CodecError::NotJson { .. }), "{error}");
    }
}

#[test]
fn an_oversized_message_is_refused_unread() {
    let mut bytes = encode(&examples::gauge());
    bytes.resize(MAX_MESSAGE_BYTES, b' ');
    assert!(decode::<Gauge>(&bytes).is_ok());
    bytes.push(b' ');
    let bytes = bytes.len();
    assert_eq!(refused::<Gauge>(&vec![b' '; bytes]), CodecError::TooLong { bytes });
}

#[test]
fn a_missing_or_mistyped_field_is_named() {
    let mut object: Value = serde_json::from_slice(&encode(&examples::gauge())).unwrap();
    object.as_object_mut().unwrap().remove("soh");
    let text = refused::<Gauge>(&serde_json::to_vec(&object).unwrap()).to_string();
    assert!(text.contains("tender.gauge/1: missing field `soh`"), "{text}");
    let text = refused::<Gauge>(&gauge_with("voltage_v", json!("7.4"))).to_string();
    assert!(text.contains("expected f64") && text.contains("\"voltage_v\":"), "{text}");
    let bad_id = encode(&examples::robot_state());
    let bad_id = String::from_utf8(bad_id).unwrap().replace("\"b1\"", "\"b/1\"");
    let text = refused::<RobotState>(bad_id.as_bytes()).to_string();
    assert!(text.contains("`b/1` is not a bay id"), "{text}");
}

#[test]
fn nan_becomes_null_and_null_is_refused_with_its_likely_cause() {
    let mut gauge = examples::gauge();
    gauge.voltage_v = f64::NAN;
    let text = refused::<Gauge>(&encode(&gauge)).to_string();
    assert!(text.contains("\"voltage_v\":null"), "{text}");
    assert!(text.contains("NaN or infinity"), "{text}");

    let mut gauge = examples::gauge();
    gauge.time_to_empty_s = Some(Estimate::new(f64::INFINITY, 1.0));
    let text = refused::<Gauge>(&encode(&gauge)).to_string();
    assert!(text.contains("NaN or infinity"), "{text}");

    let mut schedule = examples::schedule();
    schedule.services[0].mode = Mode::Recharge { to_soc: f64::NAN };
    let text = refused::<Schedule>(&encode(&schedule)).to_string();
    assert!(text.contains("NaN or infinity"), "{text}");
}

#[test]
fn an_absent_optional_field_and_a_null_one_mean_the_same() {
    let expected = examples::gauge();
    assert_eq!(decode::<Gauge>(&gauge_with("time_to_full_s", Value::Null)), Ok(expected));
}

#[test]
fn every_shape_of_action_and_outcome_is_as_documented() {
    let command = |action| Command { action, ..examples::robot_command() };
    let json = |action| serde_json::to_value(command(action)).unwrap()["action"].take();
    let (station, spare) = (examples::id("north"), examples::id("s1"));
    assert_eq!(json(RobotAction::Dock { station: examples::id("north"), bay: None }), json!({"kind": "dock", "station": "north"}));
    assert_eq!(json(RobotAction::ChargeTo { soc: 0.8 }), json!({"kind": "charge_to", "soc": 0.8}));
    assert_eq!(json(RobotAction::SwapPack { station, spare }), json!({"kind": "swap_pack", "station": "north", "spare": "s1"}));
    assert_eq!(json(RobotAction::Undock), json!({"kind": "undock"}));
    assert_eq!(
        serde_json::to_value(StationAction::SelectPack { pack: examples::id("p1") }).unwrap(),
        json!({"kind": "select_pack", "pack": "p1"})
    );
    let accepted = CommandReply { outcome: Outcome::Accepted, ..examples::command_reply() };
    assert_eq!(
        String::from_utf8(encode(&accepted)).unwrap(),
        r#"{"schema":"tender.command-reply/1","id":"c8","at":1767225605000,"outcome":"accepted"}"#
    );
    assert_eq!(decode(&encode(&accepted)), Ok(accepted));
}

#[test]
fn enums_print_as_on_the_wire() {
    assert_eq!(EventKind::CommandUnanswered.to_string(), "command_unanswered");
    assert_eq!(Rejection::StaleEpoch.to_string(), "stale_epoch");
    assert_eq!(RobotPhase::Working.to_string(), "working");
    assert_eq!(BayPhase::Free.to_string(), "free");
    assert_eq!(ServiceStatus::Done.to_string(), "done");
}

#[test]
fn every_prefix_of_every_message_is_refused() {
    fn check<M: Message + std::fmt::Debug>(example: &M) {
        let bytes = encode(example);
        for end in 0..bytes.len() {
            assert!(decode::<M>(&bytes[..end]).is_err());
        }
    }
    macro_rules! run {
        ($name:literal, $example:expr) => {
            check(&$example)
        };
    }
    each_message!(run);
}

fn decode_as_anything(bytes: &[u8]) {
    fn check<M: Message>(_: &M, bytes: &[u8]) {
        let _ = decode::<M>(bytes);
    }
    macro_rules! run {
        ($name:literal, $example:expr) => {
            check(&$example, bytes)
        };
    }
    each_message!(run);
}

proptest! {
    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        decode_as_anything(&bytes);
    }

    #[test]
    fn damaged_messages_never_panic(at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        macro_rules! run {
            ($name:literal, $example:expr) => {{
                let mut bytes = encode(&$example);
                let at = at.index(bytes.len());
                bytes[at] = byte;
                decode_as_anything(&bytes);
            }};
        }
        each_message!(run);
    }

    #[test]
    fn numbers_arrive_exactly_as_sent(
        current_a in proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL | proptest::num::f64::ZERO,
        sigma in 0.0..1e9,
        at in any::<i64>(),
    ) {
        let mut gauge = examples::gauge();
        gauge.current_a = current_a;
        gauge.remaining_wh.sigma = sigma;
        gauge.at = Timestamp::from_unix_ms(at);
        let back = decode::<Gauge>(&encode(&gauge)).unwrap();
        prop_assert_eq!(back.current_a.to_bits(), current_a.to_bits());
        prop_assert_eq!(back, gauge);
    }
}

#[test]
fn messages_from_before_a_field_was_added_are_read() {
    let mut old: Value = serde_json::from_slice(&encode(&examples::gauge())).unwrap();
    old.as_object_mut().unwrap().remove("cycles");
    let gauge = decode::<Gauge>(&serde_json::to_vec(&old).unwrap()).unwrap();
    assert_eq!(gauge, Gauge { cycles: None, ..examples::gauge() });
    let mut old: Value = serde_json::from_slice(&encode(&examples::sim_draw())).unwrap();
    old.as_object_mut().unwrap().remove("own_load_w");
    let draw = decode::<SimDraw>(&serde_json::to_vec(&old).unwrap()).unwrap();
    assert_eq!(draw, SimDraw { own_load_w: None, ..examples::sim_draw() });
    assert!(refused::<Gauge>(&gauge_with("cycles", json!(-1.0))).to_string().contains("cycles"));
}
