//! Packs that are taken to a depot and brought back.

use proto::{PackReturn, StationAction};

use super::*;

/// The station says whether its pack is in its place, and when it comes back full.
fn pack_is(core: &mut Core, time_s: f64, connected: bool, back_s: Option<f64>) {
    let back = back_s.map(|back_s| PackReturn { at: at(back_s), soc: Estimate::new(1.0, 0.01) });
    let packs = vec![PackState { pack: id("p"), connected, depleted: false, back }];
    let active_pack = connected.then(|| id("p"));
    let state = StationState { at: at(time_s), seq: (time_s * 1e3) as u64 + 2, packs, active_pack, ..ready(time_s) };
    core.handle(at(time_s), Input::StationState(id("s"), state));
}

#[test]
fn what_a_pack_said_before_it_was_taken_away_holds_no_longer_once_it_is_back() {
    let mut core = core();
    core.handle(at(0.0), Input::StationState(id("s"), ready(0.0)));
    let worn = Gauge { soh: Estimate::new(0.6, 0.01), cycles: Some(800.0), ..gauge(0.0, 0.03, 84.0) };
    core.handle(at(0.0), Input::PackGauge(id("s"), id("p"), worn));
    joins(&mut core, 0.0, 0);
    pack_is(&mut core, 1.0, false, Some(600.0));
    let promised = |core: &mut Core, time_s: f64| {
        core.handle(at(time_s), Input::Tick);
        core.schedule().services.iter().any(|service| service.robot == id("r0"))
    };
    assert!(promised(&mut core, 70.0), "the pack that comes is counted on: {:?}", core.schedule().unserved);
    pack_is(&mut core, 600.0, true, None);
    let brought = &core.fleet.stations[&id::<StationId>("s")].packs[&id::<PackId>("p")];
    assert_eq!((brought.soh.value, brought.cycles), (1.0, None), "it may be another pack");
    assert!(promised(&mut core, 602.0), "its gauge has not spoken since: {:?}", core.schedule().unserved);
    let broken = |output: &Output| matches!(output, Output::Record(Record::Event(event)) if event.kind == EventKind::PromiseBroken);
    assert!(!std::iter::from_fn(|| core.poll()).any(|output| broken(&output)));
    // From then on the gauge counts.
    core.handle(at(603.0), Input::PackGauge(id("s"), id("p"), gauge(603.0, 0.5, 84.0)));
    assert_eq!(core.fleet.stations[&id::<StationId>("s")].packs[&id::<PackId>("p")].soc.value, 0.5);
}

#[test]
fn a_resting_pack_is_counted_on_with_what_comes_into_it_as_long_as_its_gauge_shows_that_it_is_charged() {
    let text = "schema = 1\nsite = \"test\"\n[stations.s]\nload = \"mds-station\"\nload_s = 30\nunload_s = 30\nswap_s = 60\n\
                packs = { p = \"mds-3s4p-7600mah\", q = \"mds-3s4p-7600mah\" }\ncharging = { recharge_w = 30 }\n";
    let (settings, models) = toml::from_str::<Config>(text).unwrap().load(None).unwrap();
    let mut core = Core::new(settings, models, Numbering::default());
    let packs = ["p", "q"].map(|pack| PackState { pack: id(pack), connected: true, depleted: false, back: None }).to_vec();
    core.handle(at(0.0), Input::StationState(id("s"), StationState { packs, ..ready(0.0) }));
    let comes_wh = |core: &mut Core, time_s: f64, power_w: [f64; 2]| {
        for (pack, power_w) in ["p", "q"].into_iter().zip(power_w) {
            core.handle(at(time_s), Input::PackGauge(id("s"), id(pack), Gauge { current_a: power_w / 11.1, ..gauge(time_s, 0.3, 84.0) }));
        }
        let view = core.basis(at(time_s)).view();
        let of = |pack: &str| view.stations[0].packs.iter().find(|known| known.pack == id(pack)).unwrap().refill().before_wh(4.5 * 3600.0);
        [of("p"), of("q")]
    };
    assert_eq!(comes_wh(&mut core, 1.0, [6.0, 0.1]), [0.0, 0.0], "that is noise");
    // 70 % of 7.6 Ah at 11.4 to 12 V, as long as it lasts at the station's working power; nothing into the one that feeds the station.
    let [fed, charged] = comes_wh(&mut core, 2.0, [6.0, -29.0]);
    assert!(fed == 0.0 && (58.0..64.0).contains(&charged), "{charged}");
    assert_eq!(comes_wh(&mut core, 3.0, [-20.0, 0.0]), [0.0, 0.0], "the supply is gone");
    assert_eq!(comes_wh(&mut core, 4.0, [6.0, 20.0]), [0.0, 0.0], "something else draws from it");
    // A fifth of what was stated takes five times as long.
    let [_, weak] = comes_wh(&mut core, 5.0, [6.0, -5.8]);
    assert!((20.0..30.0).contains(&weak), "{weak}");
    // Relieved, it is what is charged next, before its gauge shows that, and not for ever.
    let relieved = |time_s: f64, depleted: bool| {
        let packs = ["p", "q"].map(|pack| PackState { pack: id(pack), connected: true, depleted: depleted && pack == "p", back: None });
        let seq = (time_s * 1e3) as u64 + 2;
        Input::StationState(
            id("s"),
            StationState { at: at(time_s), seq, packs: packs.to_vec(), active_pack: Some(id("q")), ..ready(time_s) },
        )
    };
    core.handle(at(6.0), relieved(6.0, false));
    assert!(comes_wh(&mut core, 7.0, [6.0, 6.0])[0] > 50.0);
    assert_eq!(comes_wh(&mut core, 70.0, [0.0, 6.0]), [0.0, 0.0]);
    // Where it gave out, it gives nothing until it has a tenth of its charge again.
    core.handle(at(4_000.0), relieved(4_000.0, true));
    let low = Gauge { current_a: -2.7, ..gauge(4_001.0, 0.05, 84.0) };
    core.handle(at(4_001.0), Input::PackGauge(id("s"), id("p"), low));
    let view = core.basis(at(4_001.0)).view();
    let of_p = view.stations[0].packs.iter().find(|known| known.pack == id("p")).unwrap();
    // 5 % of 84 Wh take 8.4 min at 30 W.
    assert_eq!([of_p.usable_wh.value, of_p.refill().before_wh(450.0)], [0.0, 0.0]);
    assert!(of_p.refill().before_wh(1200.0) > 3.0, "{:?}", of_p.refill());
}

#[test]
fn what_gauges_have_learned_of_their_batteries_is_what_is_planned_with() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    let believed = |core: &mut Core, time_s: f64, of_pack: Estimate, of_robot: Estimate| {
        core.handle(at(time_s), Input::PackGauge(id("s"), id("p"), Gauge { soh: of_pack, ..gauge(time_s, 1.0, 84.0) }));
        core.handle(at(time_s), Input::RobotGauge(id("r0"), Gauge { soh: of_robot, ..gauge(time_s, 0.3, 14.6) }));
        let view = core.basis(at(time_s)).view();
        let charge = view.robots[0].ways[0].table.at(0.3);
        (view.stations[0].packs[0].usable_wh, charge.need_wh, charge.charge_s)
    };
    let new = believed(&mut core, 1.0, Estimate::new(1.0, 0.01), Estimate::new(1.0, 0.01));
    let worn = believed(&mut core, 2.0, Estimate::new(0.7, 0.02), Estimate::new(0.8, 0.01));
    // By hand: 70 % of what a new pack gives, a little less by the greater current, 3 % of that uncertain.
    let (pack, of_new) = (worn.0, worn.0.value / new.0.value);
    assert!((0.675..0.702).contains(&of_new) && (0.027..0.045).contains(&(pack.sigma / pack.value)), "{:?}, {pack:?}", new.0);
    // Four fifths of a robot's charge take four fifths of the time and, beside the lift, of the energy.
    assert!((worn.2 / new.2 - 0.8).abs() < 1e-9 && (0.8..0.83).contains(&(worn.1 / new.1)), "{worn:?} {new:?}");
    let why = core.explain(at(2.0), &id("r0")).unwrap().reasons;
    let told = "the gauge of r0 finds 80.0 ± 1.0 % of the rated capacity, which is planned with";
    assert!(why.iter().any(|reason| reason == told), "{why:?}");
    // One that says that it knows nothing takes nothing back of the model.
    let unsure = believed(&mut core, 3.0, Estimate::new(0.97, 0.05), Estimate::new(1.0, 0.3));
    assert_eq!((unsure.0.value, unsure.1), (new.0.value, new.1));
}

#[test]
fn a_pack_whose_gauge_falls_silent_is_told_of_and_counts_for_less_until_it_speaks_again() {
    let mut core = core();
    station_joins(&mut core, 0.0);
    joins(&mut core, 0.0, 0);
    let held_wh = |core: &mut Core, time_s: f64| {
        core.handle(at(time_s), Input::RobotGauge(id("r0"), gauge(time_s, 0.3, 14.6)));
        // The station itself goes on to speak.
        core.handle(at(time_s), Input::StationState(id("s"), StationState { at: at(time_s), ..ready(time_s) }));
        core.handle(at(time_s), Input::Tick);
        core.basis(at(time_s)).view().stations[0].packs[0].usable_wh
    };
    let told = |core: &mut Core, kind: EventKind| {
        let of_pack =
            |output: &Output| matches!(output, Output::Record(Record::Event(event)) if event.kind == kind && event.pack == Some(id("p")));
        std::iter::from_fn(|| core.poll()).filter(of_pack).count()
    };
    let fresh_wh = held_wh(&mut core, 61.0);
    assert_eq!(told(&mut core, EventKind::GaugeDoubted), 0);
    let stale_wh = held_wh(&mut core, 3_600.0);
    assert_eq!(told(&mut core, EventKind::GaugeDoubted), 1);
    // It gives 6 W, by what its station said: as much as its usable share of that is gone, and nearly a third of it is not known.
    assert!((4.0..6.5).contains(&(fresh_wh.value - stale_wh.value)), "{fresh_wh:?}, {stale_wh:?}");
    assert!(stale_wh.sigma > fresh_wh.sigma.hypot(1.2), "{fresh_wh:?}, {stale_wh:?}");
    let why = core.explain(at(3_600.0), &id("r0")).unwrap().reasons;
    assert!(why.iter().any(|reason| reason.starts_with("the gauge of p of s has not been heard since 00:00:00")), "{why:?}");
    core.handle(at(3_601.0), Input::PackGauge(id("s"), id("p"), gauge(3_601.0, 0.9, 84.0)));
    assert_eq!(told(&mut core, EventKind::GaugeTrusted), 1);
    // Silent once more, and taken away: what comes in its place is doubted of nothing.
    core.handle(at(3_602.0), Input::PackGauge(id("s"), id("p"), gauge(3_602.0, 0.9, 84.0)));
    held_wh(&mut core, 7_200.0);
    pack_is(&mut core, 7_201.0, false, None);
    assert_eq!(told(&mut core, EventKind::GaugeTrusted), 1);
}

#[test]
fn a_station_whose_clock_is_ahead_is_asked_until_a_deadline_on_its_own_clock() {
    let mut core = core();
    core.handle(at(0.0), Input::StationState(id("s"), ready(3_600.0)));
    let told = |core: &mut Core| {
        let of_clock =
            |output: &Output| matches!(output, Output::Record(Record::Event(event)) if event.text.starts_with("the clock of s is"));
        std::iter::from_fn(|| core.poll()).filter(of_clock).count()
    };
    (0..3).for_each(|n| core.handle(at(f64::from(n)), Input::PackGauge(id("s"), id("p"), gauge(3_600.0 + f64::from(n), 1.0, 84.0))));
    core.handle(at(3.0), Input::PackGauge(id("s"), id("q"), gauge(3_603.0, 1.0, 84.0)));
    assert_eq!(told(&mut core), 1, "once, however many packs it has");
    core.ask_station(at(3.0), &id("s"), StationAction::SelectPack { pack: id("p") }, None);
    let command = std::iter::from_fn(|| core.poll()).find_map(|output| match output {
        Output::ToStation(_, command) => Some(command),
        _ => None,
    });
    let left_s = command.unwrap().deadline.seconds_since(at(3_603.0));
    assert!((left_s - core.settings.deadline_s).abs() < 2.0, "{left_s}");
}
