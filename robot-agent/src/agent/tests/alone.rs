//! A robot without a coordinator.

use super::*;

#[test]
fn without_a_coordinator_it_goes_to_charge_before_its_energy_gives_out_and_not_earlier() {
    let (mut rich, mut poor) = (bench_at(0.5), bench_at(0.08));
    for robot in [&mut rich, &mut poor] {
        robot.agent.handle(robot.now, Input::Coordinator(true));
        (0..120).for_each(|_| assert_eq!(robot.observe(|_| {}), []));
        robot.agent.handle(robot.now, Input::Coordinator(false));
        // A minute's silence may be a restart.
        (0..59).for_each(|_| assert_eq!(robot.observe(|_| {}), []));
    }
    (0..60).for_each(|_| assert_eq!(rich.observe(|_| {}), [], "there is energy for hours of work"));
    assert_eq!(poor.observe(|_| {}), [Act::TravelTo { station: station("mds-1"), bay: None }]);
    assert_eq!((poor.agent.phase, &poor.agent.bay), (RobotPhase::Travelling, &None));
    poor.observe(|observation| observation.place = Place::AtStation);
    assert_eq!(poor.agent.phase, RobotPhase::Waiting);
    // The station takes it in.
    let acts = poor.observe(|observation| (observation.place, observation.powered) = (Place::InBay, true));
    assert_eq!((acts, poor.agent.phase), (vec![Act::Charge], RobotPhase::Charging));
    // A coordinator is back: it goes on from here.
    assert_eq!(poor.ask(RobotAction::Undock), (Outcome::Accepted, vec![Act::StopCharging]));
}

#[test]
fn without_a_coordinator_a_gauge_that_falls_silent_does_not_keep_a_robot_at_work_until_it_strands() {
    // Seconds without a sample after which it goes.
    let goes = |bench: &mut Bench| {
        let is_sent = |bench: &mut Bench| bench.observe(|observation| observation.sample = None).len() == 1;
        (1..20_000).find(|_| is_sent(bench)).unwrap()
    };
    let mut silent = bench_at(0.2);
    silent.observe(|_| {});
    let reading = silent.agent.gauge.reading();
    // By hand: what lies above the way of 0.07 Wh, a reserve of a twentieth and 4.4 W until the next look, at 4.4 W and, within three
    // deviations, those of 0.3 W, of the gauge and of the way.
    let spare_wh = |hours: f64| {
        let sigma_wh = (reading.remaining_wh.sigma.powi(2) + (0.3 * hours).powi(2) + 0.01_f64.powi(2)).sqrt();
        reading.remaining_wh.value - 0.07 - 0.05 * reading.full_wh.value - 4.4 / 3600.0 - 4.4 * hours - 3.0 * sigma_wh
    };
    let after_s = f64::from(goes(&mut silent));
    assert!(after_s > 600.0, "{after_s} s");
    assert!(spare_wh((after_s - 1.0) / 3600.0) > 0.0 && spare_wh(after_s / 3600.0) <= 0.0, "{after_s} s");
    // One of whose charge nothing was ever heard is not sent off at once, nor never.
    let mut unheard = bench();
    let model = Arc::clone(unheard.agent.gauge.model());
    unheard.agent.gauge = Kind::CoulombCounter.open(model, energy::Estimate::new(0.5, 0.289), 25.0);
    let after_s = goes(&mut unheard);
    assert!((3600..6000).contains(&after_s), "{after_s} s");
}

#[test]
fn who_came_without_a_coordinator_hears_which_bay_is_meant_for_it() {
    let mut bench = bench_at(0.08);
    bench.agent.handle(bench.now, Input::Coordinator(false));
    let acts = (0..70).find_map(|_| Some(bench.observe(|_| {})).filter(|acts| !acts.is_empty()));
    assert_eq!(acts, Some(vec![Act::TravelTo { station: station("mds-1"), bay: None }]));
    let named = |bay| vec![Act::GoOnTo { station: station("mds-1"), bay }];
    // A coordinator is back before it has arrived.
    assert_eq!(bench.ask(dock()), (Outcome::Accepted, named(bay())));
    assert_eq!(bench.agent.phase, RobotPhase::Travelling);
    bench.observe(|observation| observation.place = Place::AtStation);
    assert_eq!(bench.ask(dock()).1, [], "it knows that bay");
    let other = || Some(BayId::new("bay-2").unwrap());
    for bay in [other(), None, bay()] {
        assert_eq!(bench.ask(RobotAction::Dock { station: station("mds-1"), bay: bay.clone() }).1, named(bay));
        assert_eq!(bench.agent.phase, RobotPhase::Waiting);
    }
    // It drives in by itself, and nothing feeds it yet.
    bench.observe(|observation| observation.place = Place::InBay);
    assert_eq!((bench.agent.phase, bench.agent.bay.clone()), (RobotPhase::Docked, bay()));
}

#[test]
fn a_charge_without_a_coordinator_is_not_over_because_the_one_before_it_was() {
    let mut bench = bench_at(0.7);
    bench.enter_bay();
    bench.ask(RobotAction::ChargeTo { soc: 1.0 });
    let takes = |bench: &mut Bench, current_a: f64| {
        bench.observe(|observation| {
            (observation.place, observation.powered) = (Place::InBay, true);
            observation.sample = Some(Sample { dt_s: SECOND, current_a, voltage_v: 12.0, temperature_degc: 25.0 });
        })
    };
    // A taper that falls off, of a pack that has aged.
    assert_eq!([-1.3, -0.1, -0.06].map(|current_a| takes(&mut bench, current_a)).concat(), [Act::StopCharging]);
    bench.ask(RobotAction::Undock);
    assert_eq!(bench.observe(|observation| observation.place = Place::AtStation), [Act::Resume]);
    // The next charge nobody asks for, and its first current comes a moment later.
    bench.agent.handle(bench.now, Input::Coordinator(false));
    (0..60).for_each(|_| drop(bench.observe(|observation| observation.place = Place::Mission)));
    assert_eq!(takes(&mut bench, 0.0), [Act::Charge]);
    (0..5).for_each(|_| assert_eq!(takes(&mut bench, 0.0), []));
    assert_eq!(bench.agent.phase, RobotPhase::Charging);
}
