//! Values outside their ranges are refused with field, value and range.

use proto::*;

use crate::examples;

/// Changes an example and returns the refusal of the result.
fn refusal<M: Message>(mut message: M, change: impl FnOnce(&mut M)) -> String {
    message.validate().expect("examples are valid");
    change(&mut message);
    message.validate().expect_err("must be refused").to_string()
}

#[test]
fn gauges_out_of_range_are_refused_by_field() {
    let gauge = |change: fn(&mut Gauge)| refusal(examples::gauge(), change);
    assert_eq!(gauge(|g| g.soc.value = 42.0), "`soc.value` is 42, allowed is -0.05 to 1.05");
    assert_eq!(gauge(|g| g.soc.sigma = -0.1), "`soc.sigma` is -0.1, allowed is zero or more, and finite");
    assert_eq!(gauge(|g| g.temperature_degc = 293.15), "`temperature_degc` is 293.15, allowed is -80 to 200");
    assert_eq!(gauge(|g| g.current_a = f64::NAN), "`current_a` is NaN, allowed is a finite number");
    type Change = fn(&mut Gauge);
    let fields: [(&str, Change); 8] = [
        ("remaining_wh.value", |g| g.remaining_wh.value = f64::INFINITY),
        ("full_wh.value", |g| g.full_wh.value = 0.0),
        ("time_to_empty_s.value", |g| g.time_to_empty_s = Some(Estimate::exact(-1.0))),
        ("time_to_full_s.sigma", |g| g.time_to_full_s = Some(Estimate::new(1.0, f64::NAN))),
        ("soh.value", |g| g.soh.value = 93.0),
        ("voltage_v", |g| g.voltage_v = -1.0),
        ("power_w", |g| g.power_w = f64::NEG_INFINITY),
        ("cells_series", |g| g.cells_series = 0),
    ];
    for (field, change) in fields {
        let text = gauge(change);
        assert!(text.starts_with(&format!("`{field}` is ")), "{text}");
    }
}

#[test]
fn robot_states_out_of_range_are_refused_by_field() {
    let robot = |change: fn(&mut RobotState)| refusal(examples::robot_state(), change);
    assert_eq!(robot(|r| r.station = None), "`bay` is b1, allowed is a bay only together with `station`");
    let slower: fn(&mut RobotState) = |r| {
        r.travel.values_mut().for_each(|way| way.time_s = -1.0);
    };
    assert!(robot(slower).starts_with("`travel.north.time_s` is -1"));
    assert!(robot(|r| r.mission.weight = -1.0).starts_with("`mission.weight`"));
    assert!(robot(|r| r.drain_w.sigma = -1.0).starts_with("`drain_w.sigma`"));
}

#[test]
fn station_states_that_contradict_themselves_are_refused() {
    let station = |change: fn(&mut StationState)| refusal(examples::station_state(), change);
    assert_eq!(station(|s| s.bays[1].bay = s.bays[0].bay.clone()), "`bays` is b1, allowed is every name at most once");
    assert_eq!(station(|s| s.packs.truncate(1)), "`active_pack` is p2, allowed is one of `packs`");
    assert!(station(|s| s.spares[0].soc.value = 2.0).starts_with("`spares.s1.soc.value`"));
}

#[test]
fn commands_and_plans_out_of_range_are_refused_by_field() {
    assert_eq!(
        refusal(examples::station_command(), |c| c.deadline = c.at.plus_ms(-1)),
        "`deadline` is 2026-01-01T00:00:03.999Z, allowed is not before `at`"
    );
    let to_percent = |c: &mut RobotCommand| c.action = RobotAction::ChargeTo { soc: 80.0 };
    assert!(refusal(examples::robot_command(), to_percent).starts_with("`action.soc` is 80,"));
    let backwards = |s: &mut Schedule| s.services[1].end = s.services[1].start.plus_s(-1.0);
    assert!(refusal(examples::schedule(), backwards).starts_with("`services[1].end`"));
    let certain = |c: &mut Capacity| c.packs[0].confidence = 95.0;
    assert!(refusal(examples::capacity(), certain).starts_with("`packs[0].confidence`"));
    let feeding = |d: &mut SimDraw| d.charge_power_w = -1.0;
    assert!(refusal(examples::sim_draw(), feeding).starts_with("`charge_power_w`"));
}

#[test]
fn decoding_refuses_a_value_out_of_range() {
    let mut gauge = examples::gauge();
    gauge.soc.value = 42.0;
    let error = decode::<Gauge>(&encode(&gauge)).unwrap_err();
    assert_eq!(error.to_string(), "tender.gauge/1: `soc.value` is 42, allowed is -0.05 to 1.05");
}
