//! Packs that are taken to a depot and brought back.

use proto::PackReturn;

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
    core.handle(at(0.0), Input::PackGauge(id("s"), id("p"), gauge(0.0, 0.03, 84.0)));
    joins(&mut core, 0.0, 0);
    pack_is(&mut core, 1.0, false, Some(600.0));
    let promised = |core: &mut Core, time_s: f64| {
        core.handle(at(time_s), Input::Tick);
        core.schedule().services.iter().any(|service| service.robot == id("r0"))
    };
    assert!(promised(&mut core, 70.0), "the pack that comes is counted on: {:?}", core.schedule().unserved);
    pack_is(&mut core, 600.0, true, None);
    assert!(promised(&mut core, 602.0), "its gauge has not spoken since: {:?}", core.schedule().unserved);
    let broken = |output: &Output| matches!(output, Output::Record(Record::Event(event)) if event.kind == EventKind::PromiseBroken);
    assert!(!std::iter::from_fn(|| core.poll()).any(|output| broken(&output)));
    // From then on the gauge counts.
    core.handle(at(603.0), Input::PackGauge(id("s"), id("p"), gauge(603.0, 0.5, 84.0)));
    assert_eq!(core.fleet.stations[&id::<StationId>("s")].packs[&id::<PackId>("p")].soc.value, 0.5);
}
