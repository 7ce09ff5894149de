//! Keys survive the round trip, and subscriptions cover the keys they are meant for.

use proptest::prelude::*;
use proto::{Key, KeyError, PackId, Pattern, RobotId, SiteId, StationId};

/// One key of every kind.
pub fn every_key(robot: &RobotId, station: &StationId, pack: &PackId) -> Vec<Key> {
    let (r, s) = (|| robot.clone(), || station.clone());
    let keys = vec![
        Key::RobotGauge(r()),
        Key::RobotState(r()),
        Key::RobotAlive(r()),
        Key::RobotCommand(r()),
        Key::StationState(s()),
        Key::PackGauge(s(), pack.clone()),
        Key::StationAlive(s()),
        Key::StationCommand(s()),
        Key::CoordinatorAlive,
        Key::Schedule,
        Key::Capacity,
        Key::Explain(r()),
        Key::SimSupply(s(), r()),
        Key::SimDraw(s(), r()),
    ];
    for key in &keys {
        // A new kind of key stops this from compiling: add it to the list above as well.
        match key {
            Key::RobotGauge(_) | Key::RobotState(_) | Key::RobotAlive(_) => {}
            Key::RobotCommand(_) | Key::StationState(_) | Key::PackGauge(..) => {}
            Key::StationAlive(_) | Key::StationCommand(_) | Key::CoordinatorAlive => {}
            Key::Schedule | Key::Capacity | Key::Explain(_) => {}
            Key::SimSupply(..) | Key::SimDraw(..) => {}
        }
    }
    keys
}

fn any_id<T: std::str::FromStr<Err: std::fmt::Debug> + std::fmt::Debug>() -> impl Strategy<Value = T> {
    "[A-Za-z0-9][A-Za-z0-9_-]{0,63}".prop_map(|text| text.parse().unwrap())
}

proptest! {
    #[test]
    fn every_key_of_any_ids_parses_back(
        site in any_id::<SiteId>(),
        robot in any_id::<RobotId>(),
        station in any_id::<StationId>(),
        pack in any_id::<PackId>(),
    ) {
        for key in every_key(&robot, &station, &pack) {
            let text = key.build(&site);
            prop_assert_eq!(Key::parse(&text), Ok((site.clone(), key)));
        }
    }

    #[test]
    fn any_text_that_parses_is_what_its_key_builds(text in "(tender/)?[a-z/*$.]{0,12}(v1/)?[a-z0-9/*]{0,30}") {
        if let Ok((site, key)) = Key::parse(&text) {
            prop_assert_eq!(key.build(&site), text);
        }
    }
}

#[test]
fn a_key_that_does_not_parse_says_why() {
    let error = |text: &str| Key::parse(text).unwrap_err();
    assert!(matches!(error(""), KeyError::NotOurs(_)));
    assert!(matches!(error("other/lab/v1/robot/r1/gauge"), KeyError::NotOurs(_)));
    let other = error("tender/lab/v2/robot/r1/gauge");
    assert!(matches!(other, KeyError::OtherVersion { .. }));
    let text = other.to_string();
    assert!(text.contains("v2") && text.contains("v1"), "{text}");
    for text in [
        "tender",
        "tender/lab",
        "tender/lab/v1",
        "tender/lab/robot/r1/gauge",
        "tender/lab/v1/robot/r1",
        "tender/lab/v1/robot/r1/gauge/",
        "tender/lab/v1/station/n/pack/p",
        "/tender/lab/v1/coordinator/alive",
    ] {
        let error = error(text);
        let expected = match text.starts_with('/') {
            true => matches!(error, KeyError::NotOurs(_)),
            false => matches!(error, KeyError::UnknownShape(_)),
        };
        assert!(expected, "{text}: {error}");
        assert!(error.to_string().contains(text));
    }
    for (text, kind) in [
        ("tender/*/v1/coordinator/alive", "site"),
        ("tender/lab/v1/robot/*/gauge", "robot"),
        ("tender/lab/v1/station//state", "station"),
        ("tender/lab/v1/station/n/pack/p$/gauge", "pack"),
    ] {
        let error = error(text);
        assert!(matches!(error, KeyError::BadId { .. }), "{text}: {error}");
        assert!(error.to_string().contains(&format!("not a {kind} id")));
    }
}

/// The part of Zenoh's matching that the patterns use: `*` is any one chunk.
fn covers(pattern: &str, key: &str) -> bool {
    let (pattern, key) = (pattern.split('/'), key.split('/'));
    pattern.clone().count() == key.clone().count() && pattern.zip(key).all(|(p, k)| p == "*" || p == k)
}

#[test]
fn every_pattern_covers_exactly_the_keys_it_names() {
    let (site, robot, station) = ("lab".parse().unwrap(), "r1".parse().unwrap(), "n".parse().unwrap());
    let other_robot: RobotId = "r2".parse().unwrap();
    let keys = every_key(&robot, &station, &"p".parse().unwrap());
    let covered = |pattern: Pattern| -> Vec<Key> {
        let pattern = pattern.build(&site);
        let hits = keys.iter().filter(|key| covers(&pattern, &key.build(&site)));
        hits.cloned().collect()
    };
    let (r, s) = (|| robot.clone(), || station.clone());
    assert_eq!(covered(Pattern::AllRobotGauges), [Key::RobotGauge(r())]);
    assert_eq!(covered(Pattern::AllRobotStates), [Key::RobotState(r())]);
    assert_eq!(covered(Pattern::AllStationStates), [Key::StationState(s())]);
    let pack_gauge = Key::PackGauge(s(), "p".parse().unwrap());
    assert_eq!(covered(Pattern::AllPackGauges), [pack_gauge]);
    let alive = [Key::RobotAlive(r()), Key::StationAlive(s())];
    assert_eq!(covered(Pattern::AllAlive), alive);
    assert_eq!(covered(Pattern::AllExplains), [Key::Explain(r())]);
    assert_eq!(covered(Pattern::SimSupplyTo(r())), [Key::SimSupply(s(), r())]);
    assert_eq!(covered(Pattern::SimDrawAt(s())), [Key::SimDraw(s(), r())]);
    assert_eq!(covered(Pattern::SimSupplyTo(other_robot)), []);
}
