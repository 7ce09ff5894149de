use node::mission::Stretch;

use super::*;

const ROOMBA: &str = "roomba-4s2p-2640mah";
const EXPLORER: &str = "explorer-3s1p-1320mah";

/// A selector that nobody notices.
const SEAMLESS: SelectorConfig = SelectorConfig {
    change: node::ChangeKind::BreakBeforeMake,
    gap_s: 0.0,
    overlap_s: 0.0,
    loop_ohm: 0.1,
    capacitance_f: 1.0,
    least_v: 1.0,
    restart_s: 0.0,
    leave_below_v: 0.0,
    take_above_v: 0.0,
};

fn model(name: &str) -> Arc<Model> {
    Arc::new(energy::load_model(name, &|_| unreachable!("built in")).unwrap())
}

fn robot(number: u32) -> RobotId {
    RobotId::new(format!("explorer-{number}")).unwrap()
}

fn spare() -> SpareId {
    SpareId::new("spare-1").unwrap()
}

fn world(socs: &[f64]) -> World {
    let pack = |(index, &soc): (usize, &f64)| WorldPack {
        pack: PackId::new(format!("pack-{}", index + 1)).unwrap(),
        battery: model("mds-3s4p-7600mah"),
        soc,
        age: Age::default(),
    };
    World {
        load: model("mds-station"),
        packs: socs.iter().enumerate().map(pack).collect(),
        spares: BTreeMap::from([(spare(), 0.98)]),
        load_s: 30.0,
        unload_s: 30.0,
        swap_s: 60.0,
        converter_w_max: f64::INFINITY,
        recharge_w: 0.0,
        spare_battery: None,
        spare_ready_soc: None,
        spare_batteries: BTreeMap::new(),
        selector: None,
        depot: None,
        vehicle: None,
        temperature_degc: 25.0,
        seed: 1,
    }
}

/// Robots that want these powers sit in bays and take what they may, for some seconds. Gives what
/// each takes at the end, W.
fn charge(body: &mut StationBody, wanted_w: &[f64], seconds: u32) -> Vec<f64> {
    let mut drawn_w = vec![0.0; wanted_w.len()];
    body.docked.extend((1..=wanted_w.len() as u32).map(|number| (robot(number), None)));
    for _ in 0..seconds {
        body.advance(1.0).unwrap();
        for (id, supply) in body.supplies() {
            let number = (1..=wanted_w.len()).find(|&number| robot(number as u32) == id).unwrap();
            let power_w = wanted_w[number - 1].min(supply.charge_w_max.unwrap_or(f64::INFINITY));
            drawn_w[number - 1] = power_w;
            let (at, current_a) = (supply.at, power_w / 12.0);
            body.draw(
                &id,
                &SimDraw {
                    at,
                    charge_power_w: power_w,
                    charge_current_a: current_a,
                    voltage_v: 12.0,
                    charging: true,
                    left_soc: None,
                    own_load_w: None,
                },
            );
        }
    }
    drawn_w
}

#[test]
fn an_exchange_draws_the_lift() {
    let mut body = StationBody::new(world(&[1.0]));
    body.advance(1.0);
    // By hand: 0.2 W + 5.5 W, and 8 W of the lift on top.
    assert!((body.truth(Channel::PackPowerW) - 5.7).abs() < 1e-9);
    body.act(&Act::Swap { robot: robot(1), spare: spare() });
    body.advance(1.0);
    assert!((body.truth(Channel::PackPowerW) - 13.7).abs() < 1e-9);
}

#[test]
fn converters_share_what_they_have_and_who_wants_less_gets_it_all() {
    let mut body = StationBody::new(World { converter_w_max: 50.0, ..world(&[1.0]) });
    let drawn_w = charge(&mut body, &[16.0, 4.0, 16.0], 30);
    // By hand: 50 W x 0.88 - 3 x 4.19 W = 31.43 W; 4 W to the second, 13.715 W to each of the others.
    for (drawn, shared) in drawn_w.iter().zip([13.715, 4.0, 13.715]) {
        assert!((drawn - shared).abs() < 1e-3, "{drawn_w:?}");
    }
    // (50 W + 0 W) / 0.84 + 5.7 W: the converters give their most.
    assert!((body.truth(Channel::PackPowerW) - (50.0 / 0.84 + 5.7)).abs() < 1e-2);
    // Without a limit everybody gets what he wants.
    assert_eq!(charge(&mut StationBody::new(world(&[1.0])), &[16.0, 4.0, 16.0], 3), [16.0, 4.0, 16.0]);
}

#[test]
fn the_log_has_what_the_effects_need() {
    let mut body = StationBody::new(world(&[1.0]));
    charge(&mut body, &[12.0, 0.0, 6.0], 3);
    let inputs = [Channel::RobotsDocked, Channel::RobotsCharging, Channel::BaySquaredCurrentA2].map(|channel| body.truth(channel));
    assert_eq!(inputs, [3.0, 2.0, 1.0 + 0.25]);
    assert!((body.truth(Channel::PackVoltageV) - 12.5).abs() < 0.5);
}

#[test]
fn a_supply_charges_the_pack_that_rests_and_a_depleted_one_counts_again() {
    let mut body = StationBody::new(World { recharge_w: 60.0, ..world(&[0.0, 0.9]) });
    let shown = |body: &mut StationBody| body.advance(1.0).unwrap();
    // The first gives out at once under the lift's power and is charged from then on.
    body.act(&Act::Swap { robot: robot(1), spare: spare() });
    let mut first = shown(&mut body);
    for _ in 0..420 {
        first = shown(&mut body);
    }
    assert!(first.packs[0].depleted && first.active_pack == Some(PackId::new("pack-2").unwrap()));
    let soc = body.true_socs().next().unwrap().1;
    // 60 W for 7 min are 7 Wh of some 86 Wh: not yet the tenth with which it counts again.
    assert!((0.07..0.09).contains(&soc), "{soc}");
    for _ in 0..2 * 3600 {
        first = shown(&mut body);
    }
    assert!(!first.packs[0].depleted && first.packs[0].sample.unwrap().current_a > -0.5);
    assert!(body.true_socs().next().unwrap().1 > 0.97);
    // Without a supply nothing comes back.
    let mut body = StationBody::new(world(&[0.0, 0.9]));
    (0..600).for_each(|_| drop(body.advance(1.0)));
    assert!(body.true_socs().next().unwrap().1 < 0.01);
}

/// A robot leaves a pack at a tenth of its charge for the spare, which is charged: its label, and the energy for that, Wh.
fn charged_again(body: &mut StationBody) -> (Estimate, f64) {
    let (charged, energy_wh, _) = charged_within_hours(body, 6);
    assert_eq!(charged[0].0, spare());
    (charged[0].1, energy_wh)
}

/// The same within some hours, and how long it took, s.
fn charged_within_hours(body: &mut StationBody, hours: u32) -> (Vec<(SpareId, Estimate)>, f64, u32) {
    body.act(&Act::Swap { robot: robot(1), spare: spare() });
    let (mut seconds, mut charged, mut energy_wh) = (0, Vec::new(), 0.0);
    while charged.is_empty() && seconds < hours * 3600 {
        let observation = body.advance(1.0).unwrap();
        if observation.swapped.is_some() {
            let at = Timestamp::from_unix_ms(0);
            let left = SimDraw {
                at,
                charge_power_w: 0.0,
                charge_current_a: 0.0,
                voltage_v: 10.5,
                charging: false,
                left_soc: Some(0.1),
                own_load_w: None,
            };
            body.draw(&robot(1), &left);
        }
        charged = observation.charged;
        energy_wh += (body.truth(Channel::PackPowerW) - 5.7) / 3600.0;
        seconds += 1;
    }
    (charged, energy_wh, seconds)
}

#[test]
fn a_pack_left_behind_that_gets_too_hot_rests_and_is_no_spare_before_it_is_full() {
    let at = |temperature_degc: f64| {
        let mut body = StationBody::new(World { spare_battery: Some(model(EXPLORER)), temperature_degc, ..world(&[1.0, 1.0]) });
        charged_within_hours(&mut body, 6)
    };
    let (mild, warm, hot) = (at(25.0), at(37.5), at(43.0));
    assert!(mild.0[0].1.value > 0.98 && warm.0[0].1.value > 0.98);
    // At 43 °C it takes what warms it by 2 K, and is never as cool as 40 °C again.
    assert!(hot.0.is_empty() && hot.1 < 0.5 * mild.1, "{hot:?} {mild:?}");
}

#[test]
fn a_pack_left_behind_is_charged_and_becomes_a_spare() {
    // By hand: 0.9 x 1.32 Ah at some 12 V through 0.88 and 0.84 is 19.3 Wh; 0.9 x 2.64 Ah at some 16 V, 51 Wh. The lift's minute
    // takes 0.13 Wh.
    let other = BTreeMap::from([(spare(), model(ROOMBA))]);
    for (spare_batteries, battery, least_wh, most_wh) in [(BTreeMap::new(), EXPLORER, 18.0, 21.0), (other, ROOMBA, 47.0, 55.0)] {
        let mut body = StationBody::new(World { spare_battery: Some(model(EXPLORER)), spare_batteries, ..world(&[1.0, 1.0]) });
        let (label, energy_wh) = charged_again(&mut body);
        assert!(label.value > 0.98, "{label:?}");
        assert!((least_wh..most_wh).contains(&energy_wh), "{battery}: {energy_wh}");
        // The forecast says the same.
        let forecast = energy::service::pack_energy(
            &model("mds-station"),
            &model(battery),
            Estimate::exact(0.1),
            body.spares[&spare()],
            &energy::service::Circumstances::ALONE,
        );
        assert!(((energy_wh - 8.0 / 60.0) / forecast.need.mean_wh - 1.0).abs() < 0.01, "{energy_wh} Wh against {:?}", forecast.need);
    }
}

#[test]
fn a_change_of_packs_is_counted_once_and_a_long_gap_takes_the_station_down() {
    let select = |body: &mut StationBody| body.act(&Act::Select { pack: PackId::new("pack-2").unwrap() });
    let mut body = StationBody::new(world(&[1.0, 1.0]));
    body.advance(1.0);
    select(&mut body);
    assert!(body.advance(1.0).unwrap().powered && body.truth(Channel::SelectorEvents) == 1.0);
    body.advance(1.0);
    assert_eq!(body.truth(Channel::SelectorEvents), 0.0);

    // By hand: 5.7 W for 50 ms are 0.285 J; 10 mF from 12.5 V to 8 V hold 0.46 J, 5 mF 0.23 J.
    for (capacitance_f, survives) in [(0.010, true), (0.005, false)] {
        let selector = SelectorConfig { gap_s: 0.05, capacitance_f, least_v: 8.0, restart_s: 20.0, ..SEAMLESS };
        let mut body = StationBody::new(World { selector: Some(selector), ..world(&[1.0, 1.0]) });
        body.advance(1.0);
        select(&mut body);
        assert_eq!(body.advance(1.0).unwrap().powered, survives);
        (0..20).for_each(|_| drop(body.advance(1.0)));
        assert!(body.advance(1.0).unwrap().powered, "it has started again");
    }
}

#[test]
fn the_selector_passes_a_pack_that_is_not_good_over_while_there_is_a_better_one() {
    let selector = SelectorConfig { leave_below_v: 9.0, take_above_v: 10.8, ..SEAMLESS };
    let mut body = StationBody::new(World { selector: Some(selector), ..world(&[0.0, 0.03, 1.0]) });
    body.act(&Act::Swap { robot: robot(1), spare: spare() });
    let active = (0..5).map(|_| body.advance(1.0).unwrap().active_pack.unwrap()).last();
    // The first gives out under the lift; the second would be next, the third is good.
    assert_eq!(active, Some(PackId::new("pack-3").unwrap()));
}

#[test]
fn for_a_moment_the_fuller_pack_feeds_the_emptier_one() {
    let makes = SelectorConfig { change: node::ChangeKind::MakeBeforeBreak, overlap_s: 10.0, loop_ohm: 1.0, ..SEAMLESS };
    let soc_after = |selector| {
        let mut body = StationBody::new(World { selector: Some(selector), ..world(&[0.2, 1.0]) });
        body.advance(1.0);
        body.act(&Act::Select { pack: PackId::new("pack-2").unwrap() });
        body.true_socs().map(|(_, soc)| soc).collect::<Vec<_>>()
    };
    let (seamless, fed) = (soc_after(SEAMLESS), soc_after(makes));
    // By hand: (12.5 V - 11.0 V) / 1 ohm for 10 s of 7.6 Ah: 0.055 % of a pack, an overlap of an odd length.
    assert!((fed[0] - seamless[0] - 0.00055).abs() < 1e-4 && (seamless[1] - fed[1] - 0.00055).abs() < 1e-4, "{seamless:?} {fed:?}");
}

#[test]
fn a_low_pack_goes_to_the_depot_and_another_comes_back() {
    let depot = Depot { below_soc: 0.2, away_s: 60.0, soc: 0.95, at_once: 1 };
    let mut body = StationBody::new(World { depot: Some(depot), ..world(&[1.0, 0.1, 0.15]) });
    let there = |body: &mut StationBody| body.advance(1.0).unwrap().packs.iter().map(|pack| pack.connected).collect::<Vec<_>>();
    assert_eq!(there(&mut body), [true, false, true], "one at a time");
    body.act(&Act::Select { pack: PackId::new("pack-2").unwrap() });
    assert_eq!(body.advance(1.0).unwrap().active_pack, Some(PackId::new("pack-1").unwrap()), "nobody can take what is not there");
    let back = (0..60).find_map(|_| body.advance(1.0).unwrap().packs[1].exchanged).unwrap();
    assert_eq!(back.value, 0.95);
    assert!((body.true_socs().nth(1).unwrap().1 - 0.95).abs() < 1e-3);
    assert_eq!(there(&mut body), [true, true, false]);
    // The active pack stays, however low it is, while it feeds the station.
    let mut alone = StationBody::new(World { depot: Some(depot), ..world(&[0.1]) });
    assert_eq!(there(&mut alone), [true]);
}

#[test]
fn own_loads_are_what_robots_say_and_the_other_path_is_reckoned_beside() {
    let mut body = StationBody::new(world(&[1.0]));
    body.docked.insert(robot(1), None);
    let told = |own_load_w| SimDraw {
        at: Timestamp::from_unix_ms(0),
        charge_power_w: 0.0,
        charge_current_a: 0.0,
        voltage_v: 12.0,
        charging: false,
        left_soc: None,
        own_load_w,
    };
    let mut power_w = |own_load_w| {
        body.draw(&robot(1), &told(own_load_w));
        body.advance(1.0);
        body.truth(Channel::PackPowerW)
    };
    // By hand: own load / 0.88 / 0.84 + 5.7 W.
    for (own_load_w, taken_w) in [(None, 4.19), (Some(2.0), 2.0), (Some(0.0), 0.0)] {
        assert!((power_w(own_load_w) - (taken_w / 0.88 / 0.84 + 5.7)).abs() < 1e-9);
    }
    let saved_wh = (4.19 + 2.0) * (1.0 / 0.88 - 1.0) / 0.84 / 3600.0;
    assert!((body.path_selection_saves_wh() - saved_wh).abs() < 1e-9);
}

/// A way of stretches at these speeds, m/s, and at the end a stay for good.
fn way(parts: &[(f64, f64)]) -> Vec<Part> {
    let part = |&(time_s, speed_mps): &(f64, f64)| Part {
        stretch: Stretch { time_s, distance_m: 0.0, inputs: vec![(Channel::SpeedMps, speed_mps)] },
        open: speed_mps == 0.0,
    };
    parts.iter().chain([&(f64::INFINITY, 0.0)]).map(part).collect()
}

#[test]
fn a_station_that_stays_between_two_drives_says_when_it_leaves_and_its_lift_moves_meanwhile() {
    let way = way(&[(3.0, 0.2), (2.0, 0.1), (60.0, 0.0), (40.0, 0.0), (10.0, 0.2), (20.0, 0.0), (5.0, 0.1)]);
    let mut body = StationBody::new(World { vehicle: Some((model("mds-vehicle"), way, 0.5)), ..world(&[1.0]) });
    let mut told = |steps: i32| {
        let seen = (0..steps).map(|_| body.advance(1.0).unwrap()).last().unwrap();
        (seen.arrives_s, seen.away_s, body.driving_w().is_some())
    };
    assert_eq!(told(1), (Some(4.0), vec![(104.0, Some(114.0)), (134.0, Some(139.0))], true));
    assert_eq!(told(4), (None, vec![(100.0, Some(110.0)), (130.0, Some(135.0))], false));
    assert_eq!(told(60), (None, vec![(40.0, Some(50.0)), (70.0, Some(75.0))], false), "a stay of two parts");
    assert_eq!(told(40), (Some(10.0), vec![(30.0, Some(35.0))], true));
    assert_eq!(told(35), (None, Vec::new(), false));
}

#[test]
fn a_station_that_drives_takes_it_from_its_pack_and_its_lift_waits() {
    let mut body = StationBody::new(World { vehicle: Some((model("mds-vehicle"), way(&[(10.0, 0.2)]), 0.5)), ..world(&[1.0]) });
    body.act(&Act::Swap { robot: robot(1), spare: spare() });
    assert_eq!(body.advance(1.0).unwrap().arrives_s, Some(9.0));
    // By hand: (12 kg x 9.80665 x 0.02 + 4 N) x 0.2 m/s / 0.5 + 0.5 W = 3.04 W.
    assert!((body.driving_w().unwrap() - 3.04).abs() < 0.05, "{:?}", body.driving_w());
    assert!((body.truth(Channel::PackPowerW) - 5.7).abs() < 1e-9, "the lift waits");
    let done = (1..100).find(|_| body.advance(1.0).unwrap().swapped.is_some()).unwrap();
    assert!((68..=72).contains(&done) && body.driving_w().is_none(), "{done}");
}

#[test]
fn the_plan_books_for_an_exchange_what_the_body_draws() {
    let mut body = StationBody::new(world(&[1.0]));
    body.act(&Act::Swap { robot: robot(1), spare: spare() });
    let mut drawn_wh = 0.0;
    for _ in 0..120 {
        body.advance(1.0);
        drawn_wh += (body.truth(Channel::PackPowerW) - 5.7) / 3600.0;
    }
    let handling = energy::service::Handling { load_s: 30.0, unload_s: 30.0, swap_s: 60.0 };
    let booked = energy::service::exchange(&model("mds-station"), handling, 12.0);
    // By hand: 8 W for a minute.
    assert!((drawn_wh - 8.0 / 60.0).abs() < 1e-9 && (booked.mean_wh - drawn_wh).abs() < 1e-9, "{drawn_wh} {booked:?}");
}
