use device::{Report, Script};
use proto::StationId;

use super::*;
use crate::source::{Held, Place};

fn explorer() -> Arc<Model> {
    Arc::new(energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap())
}

fn measured(says: impl IntoIterator<Item = Vec<Report>, IntoIter: Send + 'static>) -> Measured {
    Measured::new(Script::new(says), explorer(), Body::default())
}

fn report(current_a: f64, soc: f64) -> Report {
    Report { voltage_v: Some(11.5), current_a: Some(current_a), soc: Some(soc), ..Report::default() }
}

/// Where it is, and whether it is fed, after so many seconds of each current.
fn felt(source: &mut Measured, seconds: usize) -> (Place, bool) {
    let seen = (0..seconds).map(|_| source.advance(1.0).unwrap()).last().unwrap();
    (seen.place, seen.powered)
}

fn seconds(currents: &[(f64, usize)]) -> Vec<Vec<Report>> {
    currents.iter().flat_map(|&(current_a, seconds)| std::iter::repeat_n(vec![report(current_a, 0.5)], seconds)).collect()
}

#[test]
fn a_charging_current_that_lasts_is_a_bay_and_a_load_after_the_charge_has_left_it() {
    // Brakes give current back for some seconds; a hot battery takes none for ten minutes.
    let mut source = measured(seconds(&[(1.0, 5), (-2.0, 9), (1.0, 5), (-1.0, 20), (0.0, 20), (1.0, 600), (-1.0, 20), (1.0, 129)]));
    assert_eq!(felt(&mut source, 19), (Place::Mission, false));
    assert_eq!(felt(&mut source, 20), (Place::InBay, true));
    // No current either way: as it was.
    assert_eq!(felt(&mut source, 20), (Place::InBay, true));
    source.act(&Act::Charge);
    assert_eq!(felt(&mut source, 600), (Place::InBay, false));
    assert_eq!(felt(&mut source, 20), (Place::InBay, true));
    source.act(&Act::StopCharging);
    assert_eq!(felt(&mut source, 9), (Place::InBay, true));
    // The lift lets it down meanwhile.
    assert_eq!(felt(&mut source, 100), (Place::InBay, false));
    assert_eq!(felt(&mut source, 20), (Place::AtStation, false));
}

#[test]
fn the_word_of_its_program_comes_before_what_was_felt_until_then() {
    let folder = tempfile::tempdir().unwrap();
    let drive = driver(folder.path(), "if [ $1 = stop_charging ]; then echo at_station; fi");
    // The gauge goes on to show the charge for a few seconds.
    let mut source = Measured::new(Script::new(seconds(&[(-1.0, 5000)])), explorer(), Body { drive, ..Body::default() });
    assert_eq!(felt(&mut source, 20), (Place::InBay, true));
    source.act(&Act::StopCharging);
    let left = wait_for(&mut source, |seen| seen.place != Place::InBay);
    assert_eq!((left.place, left.powered), (Place::AtStation, false));
    source.act(&Act::Resume);
    assert_eq!(felt(&mut source, 5), (Place::Mission, false));
}

#[test]
fn who_stands_at_a_station_is_in_a_bay_as_soon_as_something_feeds_it() {
    let mut source = measured(seconds(&[(1.0, 5), (-1.0, 1)]));
    source.stand(Place::AtStation);
    assert_eq!(felt(&mut source, 5), (Place::AtStation, false));
    assert_eq!(felt(&mut source, 1), (Place::InBay, true));
}

#[test]
fn who_is_not_fed_for_an_hour_has_left_its_bay() {
    let mut source = measured(seconds(&[(-1.0, 20), (1.0, 3700)]));
    assert_eq!(felt(&mut source, 20), (Place::InBay, true));
    source.act(&Act::Charge);
    assert_eq!(felt(&mut source, 3590), (Place::InBay, false));
    assert_eq!(felt(&mut source, 100), (Place::AtStation, false));
}

#[test]
fn one_word_and_then_silence_is_no_bay_nor_is_one_that_nothing_confirms() {
    let silent = [vec![report(-1.0, 0.5)]].into_iter().chain(std::iter::repeat_n(Vec::new(), 60)).collect::<Vec<_>>();
    assert_eq!(felt(&mut measured(silent), 60), (Place::Mission, false));
    let mut source = measured(seconds(&[(-1.0, 5), (0.0, 60)]));
    assert_eq!(felt(&mut source, 65), (Place::Mission, false));
    // A gauge that speaks every half minute says it with its second word.
    let seldom = (0..60).map(|second| if second % 30 == 0 { vec![report(-1.0, 0.5)] } else { Vec::new() }).collect::<Vec<_>>();
    assert_eq!(felt(&mut measured(seldom), 32), (Place::InBay, true));
}

#[test]
fn what_is_given_back_by_brakes_on_the_way_is_no_bay() {
    let folder = tempfile::tempdir().unwrap();
    let drive = driver(folder.path(), "sleep 100");
    let mut source = Measured::new(Script::new(seconds(&[(-2.0, 60)])), explorer(), Body { drive, ..Body::default() });
    source.act(&Act::TravelTo { station: StationId::new("mds-1").unwrap(), bay: None });
    assert_eq!(felt(&mut source, 60), (Place::Underway, false));
}

#[test]
fn where_its_station_is_heard_a_robot_has_left_its_bay_when_that_says_so_and_not_before() {
    let mut source = measured(seconds(&[(-1.0, 20), (1.0, 9000)]));
    source.held(Held::InBay);
    assert_eq!(felt(&mut source, 20), (Place::InBay, true));
    source.act(&Act::StopCharging);
    // The lift is busy, or has failed, for longer than any timer; then the station is not heard for a while.
    for (held, seconds) in [(Held::InBay, 4000), (Held::LetsOut, 4000), (Held::Unheard, 600), (Held::LetsOut, 10)] {
        source.held(held);
        assert_eq!(felt(&mut source, seconds), (Place::InBay, false));
    }
    source.held(Held::Out);
    assert_eq!(felt(&mut source, 1), (Place::AtStation, false));
}

#[test]
fn a_station_that_has_forgotten_its_robot_has_not_let_it_out() {
    let mut source = measured(seconds(&[(-1.0, 20), (1.0, 9000)]));
    source.held(Held::InBay);
    assert_eq!(felt(&mut source, 20), (Place::InBay, true));
    source.act(&Act::StopCharging);
    source.held(Held::No);
    assert_eq!(felt(&mut source, 100), (Place::InBay, false));
    assert_eq!(felt(&mut source, 30), (Place::AtStation, false));
}

#[test]
fn who_stands_where_its_station_says_that_it_has_it_is_in_that_bay_before_anything_feeds_it() {
    let mut source = measured(seconds(&[(1.0, 60)]));
    source.stand(Place::AtStation);
    for (held, place) in [(Held::No, Place::AtStation), (Held::TakesIn, Place::AtStation), (Held::InBay, Place::InBay)] {
        source.held(held);
        assert_eq!(felt(&mut source, 5), (place, false), "{held:?}");
    }
    // On its way it is not there yet, whatever the station says of its bay.
    source.act(&Act::TravelTo { station: StationId::new("mds-1").unwrap(), bay: None });
    assert_eq!(felt(&mut source, 5).0, Place::Underway);
}

#[test]
fn what_its_program_still_does_or_has_to_do_again_is_no_departure() {
    let folder = tempfile::tempdir().unwrap();
    let drive = driver(folder.path(), "if [ $1 = stop_charging ]; then exit 1; fi");
    let mut source = Measured::new(Script::new(seconds(&[(-1.0, 20), (1.0, 9000)])), explorer(), Body { drive, ..Body::default() });
    assert_eq!(felt(&mut source, 20), (Place::InBay, true));
    source.act(&Act::StopCharging);
    wait_for(&mut source, |seen| seen.why_down.is_some());
    // It fails for the second time, and the third, and the lift lets the robot out all the same.
    for _ in 0..3 {
        assert_eq!(felt(&mut source, 50).0, Place::InBay);
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    for (held, place) in [(Held::LetsOut, Place::InBay), (Held::Out, Place::AtStation)] {
        source.held(held);
        wait_for(&mut source, |seen| seen.place == place);
    }
}

#[test]
fn who_has_driven_out_by_its_programs_word_is_out_whatever_its_station_still_says() {
    let folder = tempfile::tempdir().unwrap();
    let drive = driver(folder.path(), "if [ $1 = stop_charging ]; then echo at_station; fi");
    let mut source = Measured::new(Script::new(seconds(&[(1.0, 9000)])), explorer(), Body { drive, ..Body::default() });
    source.stand(Place::AtStation);
    source.held(Held::InBay);
    assert_eq!(felt(&mut source, 5).0, Place::InBay);
    source.act(&Act::StopCharging);
    wait_for(&mut source, |seen| seen.place == Place::AtStation);
    assert_eq!(felt(&mut source, 5).0, Place::AtStation);
    // Sent to a bay again, it is in it when the station says so.
    source.act(&Act::GoOnTo { station: StationId::new("mds-1").unwrap(), bay: None });
    wait_for(&mut source, |seen| seen.place == Place::InBay);
}

#[test]
fn a_charge_that_is_asked_for_again_while_its_program_is_at_it_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let drive = driver(folder.path(), "if [ $1 = charge ]; then sleep 1; fi");
    let mut source = Measured::new(Script::new(std::iter::repeat_n(Vec::new(), 5000)), explorer(), Body { drive, ..Body::default() });
    let acts = || std::fs::read_to_string(folder.path().join("acts")).unwrap_or_default();
    source.act(&Act::Charge);
    wait_for(&mut source, |_| !acts().is_empty());
    source.act(&Act::Charge);
    wait_for(&mut source, |_| acts().lines().count() == 1);
    source.act(&Act::StopCharging);
    source.act(&Act::Charge);
    wait_for(&mut source, |_| acts().lines().last() == Some("charge") && acts().lines().count() >= 2);
}

#[test]
fn who_was_plugged_in_by_hand_is_free_two_minutes_after_it_was_pulled_out() {
    let mut source = measured(seconds(&[(-1.0, 600), (1.0, 9000)]));
    assert_eq!(felt(&mut source, 600), (Place::InBay, true));
    assert_eq!(felt(&mut source, 110), (Place::InBay, false));
    assert_eq!(felt(&mut source, 20), (Place::AtStation, false));
}

/// A program that notes its arguments, and prints where the robot is.
fn driver(folder: &std::path::Path, script: &str) -> Vec<String> {
    let path = folder.join("drive.sh");
    std::fs::write(&path, format!("echo \"$@\" >> {}/acts\n{script}\n", folder.display())).unwrap();
    vec!["/bin/sh".to_owned(), path.display().to_string()]
}

fn wait_for(source: &mut Measured, what: impl Fn(&Observation) -> bool) -> Observation {
    for _ in 0..1000 {
        let seen = source.advance(0.001).unwrap();
        if what(&seen) {
            return seen;
        }
        std::thread::yield_now();
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    panic!("it never came to be so")
}

#[test]
fn a_program_drives_the_robot_and_says_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let drive = driver(folder.path(), "case $1 in travel_to) echo on my way; echo in_bay;; charge) exit 3;; esac");
    let idle = std::iter::repeat_n(Vec::new(), 5000);
    let body = Body { drive, ..Body::default() };
    let mut source = Measured::new(Script::new(idle), explorer(), body);
    let to = |bay: Option<&str>| Act::TravelTo { station: StationId::new("mds-1").unwrap(), bay: bay.map(|bay| bay.parse().unwrap()) };
    source.act(&to(Some("bay-1")));
    wait_for(&mut source, |seen| seen.place == Place::InBay);
    source.act(&Act::GoOnTo { station: StationId::new("mds-1").unwrap(), bay: Some("bay-2".parse().unwrap()) });
    wait_for(&mut source, |seen| seen.place == Place::InBay);
    source.act(&Act::Charge);
    let failed = wait_for(&mut source, |seen| seen.why_down.is_some());
    assert_eq!(failed.why_down.as_deref(), Some("body.drive: `charge` failed: exit status: 3"));
    source.act(&Act::Resume);
    wait_for(&mut source, |seen| seen.place == Place::Mission && seen.why_down.is_none());
    let acts = || std::fs::read_to_string(folder.path().join("acts")).unwrap();
    wait_for(&mut source, |_| acts().lines().count() == 4);
    assert_eq!(acts(), "travel_to mds-1 bay-1\ntravel_to mds-1 bay-2\ncharge\nresume\n");
}

#[test]
fn a_program_is_told_to_end_when_something_else_is_asked_and_one_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let drive =
        driver(folder.path(), "if [ $1 = travel_to ]; then trap 'echo ended >> $0.ended; exit 1' TERM; while :; do sleep 0.05; done; fi");
    let mut hands = Hands::new(drive);
    let to = Act::TravelTo { station: StationId::new("mds-1").unwrap(), bay: None };
    hands.begin(&to);
    let begun = folder.path().join("acts");
    while !begun.exists() {
        std::thread::yield_now();
    }
    // The trap is set after the line is written: ask until it is heard.
    std::thread::sleep(std::time::Duration::from_millis(100));
    hands.begin(&Act::Resume);
    let ended = folder.path().join("drive.sh.ended");
    for _ in 0..1000 {
        if ended.exists() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(ended.exists(), "it never heard of it");
    let mut none = Hands::new(vec!["/no/such/program".to_owned()]);
    none.begin(&to);
    assert!(none.trouble().unwrap().starts_with("body.drive: /no/such/program travel_to mds-1: No such file"));
}

#[test]
fn what_failed_is_begun_again_after_ten_seconds_until_something_else_is_asked() {
    let folder = tempfile::tempdir().unwrap();
    let drive = driver(folder.path(), "[ $(wc -l < $(dirname $0)/acts) -ge 2 ]");
    let mut hands = Hands::new(drive);
    hands.begin(&Act::TravelTo { station: StationId::new("mds-1").unwrap(), bay: None });
    let mut until = |dt_s: f64, what: fn(&mut Hands, f64) -> bool| {
        let mut passed_s = 0.0;
        while !what(&mut hands, dt_s) {
            passed_s += dt_s;
            std::thread::sleep(std::time::Duration::from_millis(5));
            assert!(passed_s < 1000.0, "it never came to be so");
        }
    };
    until(0.001, |hands, dt_s| hands.place(dt_s) == Place::Underway && hands.trouble().is_some());
    until(0.5, |hands, dt_s| hands.place(dt_s) == Place::AtStation && hands.trouble().is_none());
    assert_eq!(std::fs::read_to_string(folder.path().join("acts")).unwrap(), "travel_to mds-1\ntravel_to mds-1\n");
}
