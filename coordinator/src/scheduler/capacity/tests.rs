use std::sync::Arc;

use energy::load::Terminals as _;
use energy::pack::Battery as _;

use super::*;

fn question(usable_wh: &[f64], bays: usize) -> Question {
    let pack = |(n, wh): (usize, &f64)| {
        let (pack, wh) = (PackId::new(format!("p-{n}")).unwrap(), Estimate::exact(*wh));
        Holding { pack, remaining_wh: wh, alone: supply(wh), is_there: true }
    };
    Question {
        station: StationId::new("s").unwrap(),
        begun_until_s: 0.0,
        packs: usable_wh.iter().enumerate().map(pack).collect(),
        together: supply(Estimate::exact(usable_wh.iter().sum())),
        robots: Vec::new(),
        recharging: Vec::new(),
        service: wanted(20.0),
        breakdown_wh: BTreeMap::new(),
        bays_s: vec![0.0; bays],
        spares: Vec::new(),
        planned_short_wh: None,
        overhead_per_h: Need { mean_wh: 6.0, ..Need::default() },
        overhead_breakdown: BTreeMap::from([("hotel".to_owned(), 6.0)]),
    }
}

fn supply(usable_wh: Estimate) -> Supply {
    Supply { usable_wh, begun: Need::default(), parts: Vec::new(), overhead_from_s: 0.0, packs: None, comes: Vec::new() }
}

fn wanted(wh: f64) -> Wanted {
    Wanted {
        need: Need { mean_wh: wh, ..Need::default() },
        time_s: 3600.0,
        course: Course { even_wh: wh, ..Course::default() },
        place: Place::Bay,
        left: None,
    }
}

fn coming(name: &str, wh: f64, from_s: f64) -> Coming {
    Coming { robot: RobotId::new(name).unwrap(), wanted: wanted(wh), from_s, is_planned: false }
}

fn first(question: &Question) -> PackCapacity {
    capacity(Timestamp::from_unix_ms(0), std::slice::from_ref(question), 0.95).packs.remove(0)
}

#[test]
fn a_margin_of_one_sigma_holds_with_84_percent() {
    let (probability, short_wh) = margin(Estimate::new(50.0 - 45.0, 3.0_f64.hypot(4.0)), 0.95);
    assert!((probability - 0.8413).abs() < 1e-4);
    // 1.645 sigma are needed, one is there: 0.645 x 5 Wh short.
    assert!((short_wh - 0.6449 * 5.0).abs() < 1e-3);
}

#[test]
fn three_at_once_share_the_hotel_and_one_by_one_does_not() {
    // 3 x 20 + 6 = 66; one by one 3 x 26 = 78.
    assert_eq!(first(&question(&[70.0], 3)).robots_promised, 3);
    assert_eq!(first(&question(&[70.0], 1)).robots_promised, 2);
    let answer = first(&question(&[70.0], 3));
    // A fourth needs a second round: 4 x 20 + 2 x 6 = 92.
    assert!((answer.short_for_next_wh - 22.0).abs() < 1e-6);
    let sum: f64 = answer.breakdown_wh.values().sum();
    assert!((sum - 2.0).abs() < 1e-12, "a third of the hotel for each");
}

#[test]
fn what_two_packs_lack_alone_they_have_together() {
    // One by one: two services and two hours are 52 Wh; 40 + 40 Wh are three services together.
    let answer = capacity(Timestamp::from_unix_ms(0), &[question(&[40.0, 40.0], 1)], 0.95);
    assert_eq!(answer.packs.iter().map(|pack| pack.robots_promised).collect::<Vec<_>>(), [1, 1]);
    assert_eq!((answer.stations[0].robots_promised, answer.robots_promised), (3, 3));
}

#[test]
fn robots_come_first_and_each_with_its_own_need() {
    let mut asked = question(&[60.0], 3);
    let robot = |name: &str, wh: f64| coming(name, wh, 0.0);
    asked.robots = vec![robot("a", 10.0), robot("b", 24.0)];
    // 10 + 24 + 20 + 6 = 60.
    let told: Vec<(Option<String>, f64)> =
        first(&asked).promises.iter().map(|promise| (promise.robot.as_ref().map(ToString::to_string), promise.need_wh.value)).collect();
    assert_eq!(told, [(Some("a".to_owned()), 16.0), (Some("b".to_owned()), 40.0), (None, 60.0)]);
}

#[test]
fn a_station_that_waits_for_a_robot_pays_for_itself_meanwhile() {
    let mut asked = question(&[70.0], 3);
    let robot = |name: &str, from_s: f64| coming(name, 20.0, from_s);
    asked.robots = vec![robot("a", 0.0), robot("b", 1800.0), robot("c", 5.0 * 3600.0)];
    // Services of 20 Wh and an hour; the station takes 6 Wh in each of 1, 1.5 and 6 hours.
    let told: Vec<f64> = first(&asked).promises.iter().map(|promise| promise.need_wh.value).collect();
    assert_eq!((told, first(&asked).robots_promised), (vec![26.0, 49.0], 2));
}

#[test]
fn who_comes_later_leaves_the_free_bay_to_who_comes_now() {
    // The robot comes when the bay that is taken is free again: one more has the other bay at once, and another after that. All is over
    // after two hours of 6 Wh.
    let mut asked = question(&[75.0], 2);
    asked.bays_s = vec![0.0, 3600.0];
    asked.robots = vec![Coming { is_planned: true, ..coming("a", 20.0, 3600.0) }];
    let told: Vec<f64> = first(&asked).promises.iter().map(|promise| promise.need_wh.value).collect();
    assert_eq!(told, [32.0, 52.0, 72.0]);
}

#[test]
fn an_empty_pack_and_a_station_without_bays_serve_nobody() {
    assert_eq!(first(&question(&[0.0], 3)).robots_expected, 0);
    let without_bays = first(&question(&[70.0], 0));
    assert_eq!((without_bays.robots_expected, without_bays.lacks_bay), (0, true));
    // An exchange takes none: it is the charge after it that lacks one.
    let mut asked = question(&[70.0], 0);
    asked.robots = vec![coming("a", 20.0, 0.0)];
    asked.robots[0].wanted.place = Place::Spare(None);
    asked.spares = vec![(0, 0.0)];
    let answer = first(&asked);
    assert_eq!((answer.robots_promised, answer.lacks_bay), (1, true));
}

/// Exchanges of a minute that take a Wh, and these Wh in an hour to charge what is left if the station does that.
fn exchanges(usable_wh: f64, spares_s: &[f64], charge_wh: Option<f64>) -> Question {
    let charge = |wh| Recharging { from_s: 60.0, until_s: 3660.0, need: Need { mean_wh: wh, ..Need::default() } };
    let mut asked = question(&[usable_wh], 0);
    asked.service = Wanted { time_s: 60.0, place: Place::Spare(None), left: charge_wh.map(charge), ..wanted(1.0) };
    asked.spares = spares_s.iter().map(|&ready_s| (0, ready_s)).collect();
    asked
}

#[test]
fn of_spares_that_are_put_aside_there_are_as_many_exchanges_as_spares() {
    let answer = first(&exchanges(70.0, &[0.0, 1800.0], None));
    assert_eq!((answer.robots_promised, answer.lacks_spare, answer.lacks_bay), (2, true, false));
    // The second waits for its spare: two exchanges and 6 Wh an hour for half an hour and a minute.
    let told: Vec<f64> = answer.promises.iter().map(|promise| promise.need_wh.value).collect();
    assert!((told[0] - 1.1).abs() < 1e-9 && (told[1] - 5.1).abs() < 1e-9, "{told:?}");
    let nothing_charged = first(&exchanges(70.0, &[], None));
    assert_eq!((nothing_charged.robots_expected, nothing_charged.lacks_spare), (0, true));
}

#[test]
fn a_robot_counts_on_spares_of_its_own_kind_and_one_more_on_any() {
    // Two spares of the first kind, the second of them later, and one of another.
    let mut asked = exchanges(70.0, &[0.0, 1800.0], None);
    asked.spares.push((1, 0.0));
    let of = |name: &str, kind| {
        let mut robot = coming(name, 1.0, 0.0);
        robot.wanted = Wanted { place: Place::Spare(Some(kind)), ..asked.service.clone() };
        robot
    };
    let robots = [of("a", 0), of("b", 0)];
    let answer = first(&Question { robots: robots.to_vec(), ..asked.clone() });
    assert_eq!((answer.robots_promised, answer.lacks_spare), (3, true));
    // Two exchanges and 6 Wh an hour, until the second one's spare is there.
    assert!((answer.promises[1].need_wh.value - 5.1).abs() < 1e-9, "{:?}", answer.promises);
    let answer = first(&Question { robots: robots.into_iter().chain([of("c", 0)]).collect(), ..asked });
    assert_eq!((answer.robots_promised, answer.lacks_spare), (2, true));
}

#[test]
fn a_spare_that_is_charged_again_serves_as_long_as_the_energy_lasts() {
    // One spare, again and again: the k-th exchange ends 3660 s after the one before, with 20 Wh put into the pack before that.
    let answer = first(&exchanges(70.0, &[0.0], Some(20.0)));
    let needed = |k: f64| k + 20.0 * (k - 1.0) + 6.0 * ((k - 1.0) * 3660.0 + 60.0) / 3600.0;
    let told: Vec<f64> = answer.promises.iter().map(|promise| promise.need_wh.value).collect();
    assert!(told.iter().zip([needed(1.0), needed(2.0), needed(3.0)]).all(|(a, b)| (a - b).abs() < 1e-9), "{told:?}");
    assert_eq!((answer.robots_promised, answer.lacks_spare), (3, false));
    assert!((answer.short_for_next_wh - (needed(4.0) - 70.0)).abs() < 1e-6);
    // An exchange and the charge that follows it, and a minute of the hotel.
    assert!((answer.service_wh.value - 21.1).abs() < 1e-9);
}

#[test]
fn what_has_begun_is_paid_beside_the_services_that_follow_and_the_hotel_once() {
    // 30 Wh are drawn until the hour is over, with the station's own 6 Wh. A service that is planned from half past on takes its
    // 20 Wh and half an hour of the hotel after that; the next waits for the bay.
    let mut asked = question(&[70.0], 2);
    asked.begun_until_s = 3600.0;
    asked.together.begun = Need { mean_wh: 36.0, ..Need::default() };
    asked.bays_s = vec![3600.0, 0.0];
    asked.robots = vec![Coming { is_planned: true, ..coming("a", 20.0, 1800.0) }];
    let told = capacity(Timestamp::from_unix_ms(0), &[asked], 0.95).stations.remove(0);
    let needed: Vec<f64> = told.promises.iter().map(|promise| promise.need_wh.value).collect();
    assert_eq!((needed, told.usable_wh.value), (vec![23.0], 34.0));
    // Two hours in all: 40 Wh, and 6 for the second hour, of the 34 that are left.
    assert!((told.short_for_next_wh - 12.0).abs() < 1e-6, "{told:?}");
}

#[test]
fn a_pack_alone_tells_no_more_than_all_together() {
    // What has begun draws 36 of its 70 Wh; asked alone it would be as if nothing did.
    let mut asked = question(&[70.0, 10.0], 1);
    asked.together = supply(Estimate::exact(34.0));
    let answer = capacity(Timestamp::from_unix_ms(0), &[asked.clone()], 0.95);
    assert_eq!((answer.packs[0].robots_promised, answer.packs[0].usable_wh.value), (1, 34.0));
    assert_eq!(answer.packs[0].short_for_next_wh, answer.stations[0].short_for_next_wh);
    // One that is brought later is asked as if it were there.
    asked.packs[0].is_there = false;
    let answer = capacity(Timestamp::from_unix_ms(0), &[asked], 0.95);
    assert_eq!((answer.packs[0].robots_promised, answer.stations[0].robots_promised), (2, 1));
}

#[test]
fn what_is_short_for_one_more_is_so_for_whoever_the_plan_comes_closest_to() {
    // Services of 20 Wh, and the hotel beside them, of 50 Wh, or of 48 alone: who wants the next needs all of it.
    let mut asked = question(&[50.0, 48.0], 1);
    asked.together = supply(Estimate::exact(50.0));
    let wanted = capacity(Timestamp::from_unix_ms(0), &[asked.clone()], 0.95);
    let short = wanted.stations[0].short_for_next_wh;
    asked.planned_short_wh = Some(0.5);
    let planned = capacity(Timestamp::from_unix_ms(0), &[asked.clone()], 0.95);
    assert_eq!((planned.stations[0].short_for_next_wh, planned.packs[0].short_for_next_wh), (0.5, 0.5));
    assert_eq!(planned.stations[0].promises, wanted.stations[0].promises);
    // A pack that holds less alone and promises as many needs that much more still.
    assert_eq!(planned.packs[1].robots_promised, planned.stations[0].robots_promised);
    assert!((planned.packs[1].short_for_next_wh - 2.5).abs() < 1e-6, "{planned:?}");
    assert!((wanted.packs[1].short_for_next_wh - short - 2.0).abs() < 1e-6, "{wanted:?}");
    // What the plan knows to be short of more says nothing.
    asked.planned_short_wh = Some(short + 5.0);
    assert_eq!(capacity(Timestamp::from_unix_ms(0), &[asked], 0.95), wanted);
}

/// Whether a pack carries services of 20 W for half an hour and 8 W for ten minutes, begun at these seconds, and 6 W beside
/// them, by stepping it second by second.
fn carries(pack: &Arc<energy::Model>, soc: f64, begun_s: &[i32]) -> bool {
    let mut pack = energy::Pack::new(pack.clone(), energy::Start { temperature_degc: 25.0, ..energy::Start::at_soc(soc) });
    let drawn_w = |since_s: i32| match since_s {
        0..1800 => 20.0,
        1800..2400 => 8.0,
        _ => 0.0,
    };
    (0..begun_s.last().unwrap() + 2400).all(|second| {
        let power_w = 6.0 + begun_s.iter().map(|begun_s| drawn_w(second - begun_s)).sum::<f64>();
        pack.step_power(power_w, 1.0).is_ok() && !pack.is_empty()
    })
}

#[test]
fn a_pack_that_just_carries_two_services_is_enough_for_them_at_even_odds_whatever_was_counted() {
    let model = Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
    for (bays, begun_s) in [(2, [0, 0]), (1, [0, 2400])] {
        let (mut low, mut high) = (0.05, 0.9);
        for _ in 0..20 {
            let middle = f64::midpoint(low, high);
            if carries(&model, middle, &begun_s) { high = middle } else { low = middle }
        }
        let odds = |soc: f64, counted_wh: f64| {
            let mut asked = question(&[0.0], bays);
            let course = Course { charge: vec![(1800.0, 20.0), (600.0, 8.0)], ..Course::default() };
            asked.service = Wanted {
                need: Need { mean_wh: 10.0 + 8.0 / 6.0, ..Need::default() },
                time_s: 2400.0,
                course,
                place: Place::Bay,
                left: None,
            };
            let state = PackState {
                model: model.clone(),
                soc: Estimate::exact(soc),
                temperature_degc: 25.0,
                refill: crate::scheduler::Refill::default(),
            };
            asked.together = Supply { packs: Some(vec![(0.0, state)]), ..supply(Estimate::new(counted_wh, 1.0)) };
            asked.packs[0].alone = asked.together.clone();
            first(&asked).promises.get(1).map_or(0.0, |second| second.probability)
        };
        let needed_wh = 2.0 * (10.0 + 8.0 / 6.0) + 6.0 * f64::from(begun_s[1] + 2400) / S_PER_H;
        for counted_wh in [needed_wh - 5.0, needed_wh, needed_wh + 3.0] {
            let even = odds(high, counted_wh);
            assert!((even - 0.5).abs() < 0.06, "{bays} bays, {counted_wh} Wh counted: {even}");
        }
        // A hundredth of its charge more is 0.86 Wh, at a sigma of 1 Wh 80 %.
        let more = odds(high + 0.01, needed_wh);
        assert!((0.75..0.86).contains(&more), "{bays} bays: {more}");
    }
}
