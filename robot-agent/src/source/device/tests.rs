use std::collections::VecDeque;

use energy::gauge::Kind;
use proto::StationId;

use super::*;
use crate::source::Place;

/// A device that says what the test has laid out: one entry a second.
struct Script(VecDeque<Vec<Report>>);

impl Device for Script {
    fn name(&self) -> String {
        "script".to_owned()
    }

    fn read(&mut self) -> anyhow::Result<Vec<Report>> {
        self.0.pop_front().ok_or_else(|| anyhow::anyhow!("unplugged"))
    }
}

fn explorer() -> Arc<Model> {
    Arc::new(energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap())
}

fn measured(script: impl IntoIterator<Item = Vec<Report>>) -> Measured {
    Measured::new(Box::new(Script(script.into_iter().collect())), explorer(), Body::default())
}

fn report(current_a: f64, soc: f64) -> Report {
    Report { voltage_v: Some(11.5), current_a: Some(current_a), soc: Some(soc), ..Report::default() }
}

/// Charge in all samples, As, and their time, s.
fn counted(source: &mut Measured, seconds: usize) -> (f64, f64) {
    let samples = (0..seconds).filter_map(|_| source.advance(1.0).unwrap().sample);
    samples.fold((0.0, 0.0), |(charge, time), sample| (charge + sample.current_a * sample.dt_s, time + sample.dt_s))
}

#[test]
fn a_reading_a_second_is_a_sample_a_second_and_the_first_is_where_the_gauge_begins() {
    let mut source = measured((0..11).map(|_| vec![report(2.0, 0.6)]));
    let first = source.advance(1.0).unwrap();
    assert_eq!((first.sample.unwrap().current_a, first.exchanged), (2.0, Some(Estimate::new(0.6, 0.05))));
    assert_eq!(counted(&mut source, 10), (20.0, 10.0));
}

#[test]
fn messages_that_come_late_and_together_are_counted_by_their_own_clock() {
    let at = |at_s: f64, current_a: f64| Report { at_s: Some(at_s), ..report(current_a, 0.6) };
    let late: Vec<Report> = vec![at(110.0, 1.0), at(120.0, 3.0), at(130.0, 3.0)];
    let mut source = measured([vec![at(100.0, 1.0)], vec![], vec![], late]);
    source.advance(1.0);
    assert_eq!(counted(&mut source, 3), (70.0, 30.0));
    // A clock that was set, or stamps of nothing: then ours counts.
    let mut source = measured([vec![at(100.0, 1.0)], vec![at(5.0, 1.0)], vec![at(1e6, 1.0)]]);
    source.advance(1.0);
    assert_eq!(counted(&mut source, 2), (2.0, 2.0));
}

#[test]
fn after_a_silence_the_gauge_starts_anew_from_what_the_device_says() {
    let silence = std::iter::repeat_n(Vec::new(), 90);
    let mut source = measured([vec![report(1.0, 0.6)]].into_iter().chain(silence).chain([vec![report(1.0, 0.4)], vec![report(1.0, 0.4)]]));
    source.advance(1.0);
    let last = (0..90).map(|_| source.advance(1.0).unwrap()).last().unwrap();
    assert_eq!(last.why_down.as_deref(), Some("no reading of script for 90 s"));
    let after = source.advance(1.0).unwrap();
    assert_eq!((after.sample.unwrap().dt_s, after.exchanged, after.why_down), (1.0, Some(Estimate::new(0.4, 0.05)), None));
}

#[test]
fn what_keeps_a_device_from_being_read_is_told() {
    let mut source = measured([]);
    let last = (0..61).map(|_| source.advance(1.0).unwrap()).last().unwrap();
    assert_eq!(last.why_down.as_deref(), Some("no reading of script for 61 s: unplugged"));
}

#[test]
fn without_a_current_the_steps_of_the_charge_are_counted_and_none_is_lost() {
    // A percent every 90 s: 1.32 Ah * 0.01 in 90 s are 0.528 A.
    let soc = |second: usize| 0.8 - 0.01 * (second / 90) as f64;
    let mut source = measured((0..=900).map(|s| vec![Report { current_a: None, ..report(0.0, soc(s)) }]));
    let mut gauge = Kind::CoulombCounter.open(explorer(), Estimate::new(0.5, 0.29), 25.0);
    let mut currents = Vec::new();
    for _ in 0..=900 {
        let seen = source.advance(1.0).unwrap();
        if let Some(sample) = seen.sample {
            gauge.update(&sample);
            currents.push(sample.current_a);
        }
        if let Some(soc) = seen.exchanged {
            gauge.exchange(soc);
        }
    }
    // The first says that the robot is there.
    assert_eq!((currents.len(), currents.remove(0)), (11, 0.0));
    assert!(currents.iter().all(|current_a| (current_a - 0.528).abs() < 1e-9), "{currents:?}");
    assert!((gauge.soc().value - 0.7).abs() < 1e-4, "{:?}", gauge.soc());
    // At rest the charge does not move: a sample of nothing every five minutes.
    let mut source = measured((0..700).map(|_| vec![Report { current_a: None, ..report(0.0, 0.5) }]));
    assert_eq!(counted(&mut source, 700), (0.0, 601.0));
}

#[test]
fn without_a_charge_of_its_own_the_voltage_tells_less_of_it_the_more_current_flows() {
    let model = explorer();
    let mut run = Run::new(Arc::clone(&model), Start::at_soc(0.6));
    let start = |voltage_v: f64, current_a: f64| {
        let said = Report { voltage_v: Some(voltage_v), current_a: Some(current_a), ..Report::default() };
        measured([vec![said]]).advance(1.0).unwrap().exchanged.unwrap()
    };
    let rested = start(run.channels[Channel::VoltageV], 0.0);
    assert!((rested.value - 0.6).abs() < 0.01, "{rested:?}");
    run.channels[Channel::CurrentA] = 1.3;
    run.step(60.0);
    let loaded = start(run.channels[Channel::VoltageV], 1.3);
    // A minute at 1C took 1.6 % of the charge out.
    assert!((loaded.value - 0.583).abs() < loaded.sigma && loaded.sigma > rested.sigma, "{loaded:?} {rested:?}");
}

#[test]
fn a_charging_current_is_a_bay_and_a_load_has_left_it() {
    let mut source = measured([-1.0, -1.0, 0.0, 1.0, 1.0].map(|current_a| vec![report(current_a, 0.5)]));
    let mut places = (0..5).map(|_| source.advance(1.0).unwrap()).map(|seen| (seen.place, seen.powered));
    assert_eq!(places.next(), Some((Place::InBay, true)));
    assert_eq!(places.next(), Some((Place::InBay, true)));
    // No current either way: as it was.
    assert_eq!(places.next(), Some((Place::InBay, true)));
    assert_eq!(places.next(), Some((Place::AtStation, false)));
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
    let mut source = Measured::new(Box::new(Script(idle.collect())), explorer(), body);
    let to = |bay: Option<&str>| Act::TravelTo { station: StationId::new("mds-1").unwrap(), bay: bay.map(|bay| bay.parse().unwrap()) };
    source.act(&to(Some("bay-2")));
    wait_for(&mut source, |seen| seen.place == Place::InBay);
    source.act(&Act::Charge);
    let failed = wait_for(&mut source, |seen| seen.why_down.is_some());
    assert_eq!(failed.why_down.as_deref(), Some("body.drive: `charge` failed: exit status: 3"));
    source.act(&Act::Resume);
    wait_for(&mut source, |seen| seen.place == Place::Mission && seen.why_down.is_none());
    let acts = || std::fs::read_to_string(folder.path().join("acts")).unwrap();
    wait_for(&mut source, |_| acts().lines().count() == 3);
    assert_eq!(acts(), "travel_to mds-1 bay-2\ncharge\nresume\n");
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
