use energy::gauge::Kind;

use super::*;
use crate::Script;

fn explorer() -> Arc<Model> {
    Arc::new(energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap())
}

fn read_from(says: impl IntoIterator<Item = Vec<Report>, IntoIter: Send + 'static>) -> Reader {
    Reader::new(Script::new(says), explorer(), Unmeasured::default())
}

fn report(current_a: f64, soc: f64) -> Report {
    Report { voltage_v: Some(11.5), current_a: Some(current_a), soc: Some(soc), ..Report::default() }
}

/// Charge in all samples, As, and their time, s.
fn counted(reader: &mut Reader, seconds: usize) -> (f64, f64) {
    let samples = (0..seconds).filter_map(|_| reader.advance(1.0).sample);
    samples.fold((0.0, 0.0), |(charge, time), sample| (charge + sample.current_a * sample.dt_s, time + sample.dt_s))
}

#[test]
fn a_reading_a_second_is_a_sample_a_second_and_the_first_is_where_the_gauge_begins() {
    let mut reader = read_from((0..11).map(|_| vec![report(2.0, 0.6)]));
    let first = reader.advance(1.0);
    assert_eq!((first.sample.unwrap().current_a, first.exchanged), (2.0, Some(Estimate::new(0.6, 0.05))));
    assert_eq!(counted(&mut reader, 10), (20.0, 10.0));
}

#[test]
fn a_report_without_a_current_counts_what_has_flowed_since_the_one_before() {
    // An hour in the middle is counted by the current: then one report lacks it, and one has it again.
    let soc = |second: usize| 0.8 - 2.0 * second as f64 / 3600.0 / 1.32;
    let without = |second: usize| Report { current_a: None, ..report(0.0, soc(second)) };
    let says = (0..602).map(move |second| vec![if second == 600 { without(600) } else { report(2.0, soc(second)) }]);
    let mut reader = read_from(says.collect::<Vec<_>>());
    reader.advance(1.0);
    let (charge_as, time_s) = counted(&mut reader, 601);
    assert!((charge_as - 2.0 * 601.0).abs() < 1e-6 && time_s == 601.0, "{charge_as} As in {time_s} s");
}

#[test]
fn messages_that_come_late_and_together_are_counted_by_their_own_clock() {
    let at = |at_s: f64, current_a: f64| Report { at_s: Some(at_s), ..report(current_a, 0.6) };
    let late: Vec<Report> = vec![at(110.0, 1.0), at(120.0, 3.0), at(130.0, 3.0)];
    let mut reader = read_from([vec![at(100.0, 1.0)], vec![], vec![], late]);
    reader.advance(1.0);
    assert_eq!(counted(&mut reader, 3), (70.0, 30.0));
    // A clock that was set, or stamps of nothing: then ours counts.
    let mut reader = read_from([vec![at(100.0, 1.0)], vec![at(5.0, 1.0)], vec![at(1e6, 1.0)]]);
    reader.advance(1.0);
    assert_eq!(counted(&mut reader, 2), (2.0, 2.0));
}

#[test]
fn the_charge_of_a_device_whose_clock_stands_is_counted_by_ours() {
    let stands = |current_a: f64| Report { at_s: Some(7.0), ..report(current_a, 0.6) };
    let mut reader = read_from((0..31).map(move |_| vec![stands(2.0)]));
    reader.advance(1.0);
    assert_eq!(counted(&mut reader, 30), (60.0, 30.0));
    // One that says the same twice, and then what is new, is not counted twice.
    let at = |at_s: f64| Report { at_s: Some(at_s), ..report(2.0, 0.6) };
    for every in [2, 10] {
        let mut reader = read_from((0..31).map(move |second| vec![at(f64::from(second / every * every))]));
        reader.advance(1.0);
        assert_eq!(counted(&mut reader, 30), (60.0, 30.0), "a stamp every {every} s");
    }
}

#[test]
fn after_a_silence_the_gauge_starts_anew_from_what_the_device_says() {
    let silence = std::iter::repeat_n(Vec::new(), 90);
    let mut reader = read_from([vec![report(1.0, 0.6)]].into_iter().chain(silence).chain([vec![report(1.0, 0.4)], vec![report(1.0, 0.4)]]));
    reader.advance(1.0);
    let last = (0..90).map(|_| reader.advance(1.0)).last().unwrap();
    assert_eq!(last.silent.as_deref(), Some("no reading of script for 90 s"));
    let after = reader.advance(1.0);
    assert_eq!((after.sample.unwrap().dt_s, after.exchanged, after.silent), (1.0, Some(Estimate::new(0.4, 0.05)), None));
}

#[test]
fn a_sleep_of_hours_in_one_step_is_a_silence_and_no_charge() {
    // One report waited from before.
    let mut reader = read_from([vec![report(1.0, 0.6)], vec![report(1.0, 0.59), report(1.0, 0.4)], vec![report(1.0, 0.39)]]);
    reader.advance(1.0);
    let slept = reader.advance(28_800.0);
    assert_eq!((slept.sample, slept.exchanged), (None, None));
    let after = reader.advance(1.0);
    assert_eq!((after.sample.unwrap().dt_s, after.exchanged), (1.0, Some(Estimate::new(0.39, 0.05))));
}

#[test]
fn no_charge_is_lost_where_a_voltage_is_not_shown() {
    let without = |current_a: f64| Report { voltage_v: None, ..report(current_a, 0.6) };
    let mut reader = read_from([vec![report(1.0, 0.6)], vec![without(2.0)], vec![without(4.0)], vec![report(3.0, 0.6)]]);
    reader.advance(1.0);
    let seen: Vec<_> = (0..3).map(|_| reader.advance(1.0).sample).collect();
    assert_eq!(seen[..2], [None, None]);
    let sample = seen[2].unwrap();
    assert_eq!((sample.current_a * sample.dt_s, sample.dt_s, sample.voltage_v), (9.0, 3.0, 11.5));
}

#[test]
fn a_temperature_that_no_battery_has_is_not_measured() {
    let shows = |degc: f64| vec![Report { temperature_degc: Some(degc), ..report(1.0, 0.6) }];
    let shown_degc = [-273.15, -273.1, -60.0, 41.5, 100.0, 6280.35, f64::NAN];
    let mut reader = read_from(shown_degc.map(shows));
    let taken_degc = shown_degc.map(|_| reader.advance(1.0).sample.unwrap().temperature_degc);
    assert_eq!(taken_degc, [25.0, 25.0, -60.0, 41.5, 100.0, 25.0, 25.0]);
}

#[test]
fn what_a_device_says_of_its_charge_is_told_beside_what_is_counted() {
    let mut reader = read_from([vec![report(1.0, 0.2)], vec![], vec![report(1.0, 0.2), report(1.0, 0.95)]]);
    let said: Vec<_> =
        (0..3).map(|_| reader.advance(1.0)).map(|seen| (seen.said_soc.map(|soc| soc.value), seen.exchanged.is_some())).collect();
    assert_eq!(said, [(Some(0.2), true), (None, false), (Some(0.95), false)]);
}

#[test]
fn what_keeps_a_device_from_being_read_is_told() {
    let mut reader = read_from([]);
    let last = (0..61).map(|_| reader.advance(1.0)).last().unwrap();
    assert_eq!(last.silent.as_deref(), Some("no reading of script for 61 s: unplugged"));
}

#[test]
fn without_a_current_the_steps_of_the_charge_are_counted_and_none_is_lost() {
    // A percent every 90 s: 1.32 Ah * 0.01 in 90 s are 0.528 A.
    let soc = |second: usize| 0.8 - 0.01 * (second / 90) as f64;
    let mut reader = read_from((0..=900).map(move |s| vec![Report { current_a: None, ..report(0.0, soc(s)) }]));
    let mut gauge = Kind::CoulombCounter.open(explorer(), Estimate::new(0.5, 0.29), 25.0);
    let mut currents = Vec::new();
    for _ in 0..=900 {
        let seen = reader.advance(1.0);
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
    let mut reader = read_from((0..700).map(|_| vec![Report { current_a: None, ..report(0.0, 0.5) }]));
    assert_eq!(counted(&mut reader, 700), (0.0, 601.0));
}

#[test]
fn without_a_charge_of_its_own_the_voltage_tells_less_of_it_the_more_current_flows() {
    let model = explorer();
    let mut run = Run::new(Arc::clone(&model), Start::at_soc(0.6));
    let start = |voltage_v: f64, current_a: f64| {
        let said = Report { voltage_v: Some(voltage_v), current_a: Some(current_a), ..Report::default() };
        read_from([vec![said]]).advance(1.0).exchanged.unwrap()
    };
    let rested = start(run.channels[Channel::VoltageV], 0.0);
    assert!((rested.value - 0.6).abs() < 0.01, "{rested:?}");
    run.channels[Channel::CurrentA] = 1.3;
    run.step(60.0);
    let loaded = start(run.channels[Channel::VoltageV], 1.3);
    // A minute at 1C took 1.6 % of the charge out.
    assert!((loaded.value - 0.583).abs() < loaded.sigma && loaded.sigma > rested.sigma, "{loaded:?} {rested:?}");
}

/// A device that cannot be read where it says nothing.
struct Loose(Vec<Option<Report>>);

impl Device for Loose {
    fn name(&self) -> String {
        "loose".to_owned()
    }

    fn read(&mut self, _dt_s: f64) -> anyhow::Result<Vec<Report>> {
        Ok(vec![self.0.remove(0).ok_or_else(|| anyhow::anyhow!("no battery answers"))?])
    }
}

#[test]
fn a_battery_that_is_put_in_while_its_device_cannot_be_read_is_another_one_if_it_is_fuller_or_emptier() {
    let says =
        |soc: f64| Some(Report { voltage_v: Some(11.5), current_a: Some(1.0), soc: Some(soc), soc_sigma: Some(0.01), ..Report::default() });
    let begins = |says: &[Option<Report>]| {
        let model = Arc::new(energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap());
        let mut reader = Reader::new(Box::new(Loose(says.to_vec())), model, Unmeasured::default());
        says.iter().map(|_| reader.advance(1.0).exchanged.map(|soc| soc.value)).collect::<Vec<_>>()
    };
    assert_eq!(begins(&[says(0.2), None, None, says(0.95), says(0.95)]), [Some(0.2), None, None, Some(0.95), None]);
    // The same one: its contacts were loose for a moment; or it is said to have leapt by a gauge that never failed.
    assert_eq!(begins(&[says(0.2), None, says(0.21)]), [Some(0.2), None, None]);
    assert_eq!(begins(&[says(0.2), says(0.95)]), [Some(0.2), None]);
}
