use energy::Channel;

use super::*;
use crate::charger::Path;

fn model(name: &str) -> Arc<Model> {
    Arc::new(energy::load_model(name, &|_| unreachable!("built in")).unwrap())
}

fn stretch(inputs: &[(Channel, f64)]) -> Stretch {
    Stretch { time_s: f64::INFINITY, distance_m: 50.0, inputs: inputs.to_vec() }
}

fn station() -> StationId {
    StationId::new("mds-1").unwrap()
}

fn world(battery: &str, load: Arc<Model>, soc: f64) -> World {
    World {
        battery: model(battery),
        load,
        work: vec![stretch(&[(Channel::SpeedMps, 0.1)])],
        ways: BTreeMap::new(),
        travel_s: BTreeMap::from([(station(), 60.0)]),
        charger: None,
        radio: None,
        soc,
        age: Age::default(),
        temperature_degc: 25.0,
        seed: 1,
    }
}

fn explorer(charger: Option<ChargerConfig>) -> RobotBody {
    RobotBody::new(World { charger, ..world("explorer-3s1p-1320mah", model("explorer-robot"), 0.5) })
}

fn bay(charge_w_max: Option<f64>) -> SimSupply {
    SimSupply { at: Timestamp::from_unix_ms(0), powered: true, exchanged: None, docked: true, charge_w_max }
}

/// What flows after half a minute in a bay: current into the battery, A, and own load from the bay, W.
fn charged(mut body: RobotBody, charge_w_max: Option<f64>) -> (f64, f64) {
    body.supply(&bay(charge_w_max));
    body.act(&Act::Charge);
    for _ in 0..30 {
        body.advance(1.0);
    }
    let draw = body.draw().unwrap();
    (draw.charge_current_a, draw.own_load_w.unwrap_or(f64::NAN))
}

#[test]
fn on_one_node_the_robots_own_current_is_missing_in_its_battery() {
    let on = |path, output_a_max| charged(explorer(Some(ChargerConfig { path, output_a_max })), None);
    let (selected_a, bypass_w) = on(Path::Selected, None);
    assert!((selected_a - 1.32).abs() < 1e-9 && (bypass_w - 4.19).abs() < 0.02, "{selected_a} {bypass_w}");
    // By hand: 4.19 W at some 11.9 V are 0.35 A of the 1.32 A.
    let (direct_a, own_w) = on(Path::Direct, None);
    assert!((direct_a - 0.97).abs() < 0.02 && (own_w - 4.19).abs() < 0.02, "{direct_a} {own_w}");
    // A charger with enough for both gives the battery its rated current all the same.
    assert!((on(Path::Direct, Some(2.0)).0 - 1.32).abs() < 1e-9);
    // Without the key: rated current, and the station's model says the own load.
    let (plain_a, told_w) = charged(explorer(None), None);
    assert!((plain_a - 1.32).abs() < 1e-9 && told_w.is_nan());
}

#[test]
fn a_bays_share_is_for_the_battery_on_either_path() {
    for path in [Path::Direct, Path::Selected] {
        let (current_a, own_w) = charged(explorer(Some(ChargerConfig { path, output_a_max: Some(3.0) })), Some(6.0));
        // By hand: 6 W at some 11.7 V.
        assert!((current_a - 0.51).abs() < 0.02 && own_w > 4.0, "{path:?}: {current_a} A, {own_w} W");
    }
}

#[test]
fn a_robot_on_one_node_lives_on_its_battery_once_its_charger_is_off() {
    let mut body = explorer(Some(ChargerConfig { path: Path::Direct, output_a_max: None }));
    body.supply(&bay(None));
    let before = body.true_soc();
    (0..600).for_each(|_| drop(body.advance(1.0)));
    // By hand: 4.19 W for ten minutes of 15.2 Wh.
    assert!((before - body.true_soc() - 0.046).abs() < 0.005, "{before} {}", body.true_soc());
    assert!(body.draw().unwrap().own_load_w.unwrap() < 1e-6);
}

#[test]
fn a_converter_that_needs_more_than_the_pack_gives_takes_the_robot_down_with_a_reason() {
    let text = energy::built_in("aquapod-robot").unwrap().replace("input_min_v = 5.8", "input_min_v = 7.2");
    let load = Arc::new(Model::parse("aquapod", &text, &|_| unreachable!()).unwrap());
    let mut body = RobotBody::new(World { work: vec![stretch(&[])], ..world("aquapod-2s1p-1900mah", load, 0.3) });
    let down = (0..200_000).find_map(|_| body.advance(1.0).unwrap().why_down).expect("it browns out before it is empty");
    assert!(down.starts_with("browned out: rail `5v` cannot deliver:") && down.contains("7.200 V needed"), "{down}");
    assert!(body.true_soc() > 0.05 && body.stranded() && body.browned_out(), "{}", body.true_soc());
    // The bay brings it back.
    body.supply(&bay(None));
    body.act(&Act::Charge);
    assert_eq!(body.advance(1.0).unwrap().why_down, None);
    assert!(!body.stranded());
}

#[test]
fn a_pack_that_is_too_cold_takes_the_robot_down_with_a_reason() {
    let cold = |temperature_degc: f64| World { temperature_degc, ..world("explorer-3s1p-1320mah", model("explorer-robot"), 0.9) };
    let mut body = RobotBody::new(cold(-30.0));
    let down = (0..600).find_map(|_| body.advance(1.0).unwrap().why_down).expect("its protection opens");
    assert_eq!(down, "the protection of its pack has opened: too cold to discharge");
    assert!(body.stranded());
    // An empty pack is no news.
    let mut body = RobotBody::new(World { soc: 0.01, ..cold(25.0) });
    let empty = (0..20_000).map(|_| body.advance(1.0).unwrap()).find(|seen| seen.depleted).expect("it runs empty");
    assert_eq!(empty.why_down, None);
}

#[test]
fn a_robot_that_comes_home_comes_into_reach() {
    let radio = Radio { frequency_hz: 2.4e9, robot_gain_db: 0.0, coordinator_gain_db: 0.0, loss_db: 30.0, sensitivity_dbm: -80.0 };
    // By hand: 10 dBm - 30 dB + 80 dB = 60 dB of free-space loss, 40.05 dB of them over the first metre: 9.95 m.
    let work = vec![stretch(&[(Channel::RadioTxDbm, 10.0)])];
    let mut body = RobotBody::new(World { work, radio: Some(radio), ..world("explorer-3s1p-1320mah", model("explorer-robot"), 0.5) });
    body.advance(1.0);
    assert!(!body.in_reach());
    body.act(&Act::TravelTo { station: station(), bay: None });
    let seconds = (1..=60)
        .find(|_| {
            body.advance(1.0);
            body.in_reach()
        })
        .unwrap();
    // 50 m in a minute: below 9.95 m after 48.06 s.
    assert_eq!(seconds, 49);
    while body.place != Place::AtStation {
        body.advance(1.0);
    }
    assert!(body.in_reach());
}

#[test]
fn the_way_home_takes_what_the_trip_says() {
    let ways: crate::way::Ways = toml::from_str(
        "to.mds-1 = [{ length_m = 20, speed_mps = 0.3, pitch_rad = 0.1 }, { length_m = 9, speed_mps = 0.5, turn_rad = 1.5 }]",
    )
    .unwrap();
    let mission = node::mission::Mission::default();
    let trip = ways.trip(&station(), &mission, &model("explorer-robot")).unwrap().unwrap();
    let both = ways.stretches(&station(), &mission).unwrap().unwrap();
    let mut body =
        RobotBody::new(World { ways: BTreeMap::from([(station(), both)]), ..world("explorer-3s1p-1320mah", model("explorer-robot"), 0.8) });
    body.advance(1.0);
    body.act(&Act::TravelTo { station: station(), bay: None });
    let (mut energy_wh, mut seconds) = (0.0, 0);
    while body.place != Place::AtStation {
        body.advance(1.0);
        energy_wh += body.pack.truth(Channel::PowerW) / 3600.0;
        seconds += 1;
    }
    assert_eq!(f64::from(seconds), trip.time_s.ceil());
    // The last step is stood, not driven.
    assert!((energy_wh / trip.energy_wh.value - 1.0).abs() < 0.02, "{energy_wh} {:?}", trip.energy_wh);
}

#[test]
fn who_is_sent_back_to_work_once_more_drives_no_way_twice() {
    let mut body = explorer(None);
    let passes = |body: &mut RobotBody, seconds: usize| (0..seconds).for_each(|_| drop(body.advance(1.0)));
    body.act(&Act::TravelTo { station: station(), bay: None });
    passes(&mut body, 70);
    body.act(&Act::Resume);
    passes(&mut body, 20);
    assert_eq!(body.journey.back_s, 40.0);
    body.act(&Act::Resume);
    assert_eq!(body.journey.back_s, 40.0, "it goes on with its way");
    passes(&mut body, 50);
    body.act(&Act::Resume);
    assert_eq!(body.journey.back_s, 0.0, "it has arrived");
}
