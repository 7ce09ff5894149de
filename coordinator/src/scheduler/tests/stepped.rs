//! Where it is close: packs stepped along the load of a plan.

use planner::Mode;

use super::*;

/// Whether a pack carries a robot's way and service, by stepping it: 6 W all the time, a lift of 0.1 Wh for half a minute and
/// then 40 s, and 26 W for as long as the charge takes.
fn carries(soc: f64) -> bool {
    use energy::load::Terminals as _;
    use energy::pack::Battery as _;
    let mut pack = energy::Pack::new(station_pack(), energy::Start { temperature_degc: 25.0, ..energy::Start::at_soc(soc) });
    // It sets off with 10 % and begins on the grid of 10 s, 3 s of which are over.
    let way_s = 67;
    let charge_s = (HOUR * (0.98 - (0.1 - 0.3 * f64::from(way_s) / HOUR)) / 0.98) as i32;
    let until_s = way_s + 30 + charge_s + 40;
    let lift_w = 0.1 * HOUR / f64::from(30 + charge_s + 40);
    (0..until_s).all(|second| {
        let charging_w = if (way_s + 30..way_s + 30 + charge_s).contains(&second) { 26.0 } else { 0.0 };
        let lift_w = if second < way_s { 0.0 } else { lift_w };
        pack.step_power(6.0 + charging_w + lift_w, 1.0).is_ok() && !pack.is_empty()
    })
}

pub(super) fn station_pack() -> Arc<Model> {
    Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap())
}

/// A plan of whole charges at one station.
fn planned(robots: Vec<RobotView>, station: StationView) -> Plan {
    solve(view(robots, vec![station]), &whole_charges(), &Plan::default(), Effort::Whole).plan
}

#[test]
fn how_sure_a_service_is_follows_from_the_packs_own_discharge_however_it_was_counted() {
    let (mut low, mut high) = (0.1, 0.9);
    for _ in 0..20 {
        let middle = f64::midpoint(low, high);
        if carries(middle) { high = middle } else { low = middle }
    }
    let said = |soc: f64, usable_wh: f64, held: bool| {
        let mut with = station("s", 1, &[usable_wh], &[]);
        with.overhead_per_h.shared_wh = vec![0.0];
        with.packs[0].usable_wh.sigma = 1.0;
        with.packs[0].state =
            Some(PackState { model: station_pack(), soc: Estimate::exact(soc), temperature_degc: 25.0, refill: Refill::default() });
        let robots = vec![RobotView { held, ..robot("r", 0.1, &[(0, 60.0)]) }];
        let plan = planned(robots, with);
        plan.planned.iter().map(|planned| planned.probability).next()
    };
    let told = |soc: f64, usable_wh: f64| said(soc, usable_wh, true);
    // 29 Wh are taken, with a sigma of 1 Wh: however much above that was counted, these packs do or do not at even odds.
    for counted_wh in [29.6, 30.5, 32.0] {
        let even = told(high, counted_wh).expect("promised before");
        assert!((even - 0.5).abs() < 0.06, "{counted_wh} Wh counted: {even}");
    }
    // A hundredth of its charge more is 0.86 Wh: with the doubts of service and pack, 1.06 Wh together, 79 %.
    let more = told(high + 0.01, 29.6).expect("promised before");
    assert!((0.7..0.88).contains(&more), "{more}");
    // Where much more is counted than six of these, nothing is stepped.
    assert!(told(high, 45.0).expect("promised before") > 0.999);
    // A new promise is given for what the packs give, not for what was counted: not at even odds, but with 2.6 Wh more.
    assert_eq!(said(high, 28.0, false), None);
    assert!(said(high + 0.03, 28.0, false).is_some_and(|sure| sure > 0.95), "{:?}", said(high + 0.03, 28.0, false));
}

/// Counting is for the mean of unlike robots, and may say far more than the packs give to one of them.
#[test]
fn where_unlike_robots_come_a_new_promise_is_as_sure_as_asked_however_much_was_counted() {
    let leaf = Arc::new(energy::load_model("nissan-leaf-33ah", &|_| unreachable!("built in")).unwrap());
    let said = |soc: f64, is_mixed: bool| {
        let mut with = station("s", 1, &[80.0], &[]);
        with.packs[0].state =
            Some(PackState { model: station_pack(), soc: Estimate::exact(soc), temperature_degc: 25.0, refill: Refill::default() });
        // The other one has all that it needs until its work ends.
        let mut other = RobotView { until_s: Some(600.0), ..robot("other", 0.9, &[(0, 60.0)]) };
        if is_mixed {
            other.battery = Arc::clone(&leaf);
        }
        let plan = planned(vec![other, robot("r", 0.1, &[(0, 60.0)])], with);
        let why = plan.rejected.iter().find(|left| left.robot.as_str() == "r").map_or_else(Vec::new, |left| left.reasons.clone());
        (plan.planned.iter().map(|planned| planned.probability).next(), why)
    };
    // 84 Wh when full; the charge and what the station takes meanwhile are 29.
    assert!(said(0.6, true).0.is_some_and(|sure| sure > 0.95), "{:?}", said(0.6, true));
    let (none, why) = said(0.3, true);
    assert_eq!((none, &why[..]), (None, &["the packs are not sure enough to last for it".to_owned()][..]));
    // Alike, what is counted is taken to err on the safe side.
    assert!(said(0.3, false).0.is_some_and(|sure| sure > 0.95));
}

#[test]
fn while_nothing_is_drawn_a_station_may_wait_in_the_dark_for_its_next_pack() {
    // Two packs of which the first cannot last until the second comes in three hours; the service is after that.
    let mut with = station("s", 1, &[12.0, 60.0], &[]);
    let state =
        |soc: f64| Some(PackState { model: station_pack(), soc: Estimate::exact(soc), temperature_degc: 25.0, refill: Refill::default() });
    (with.packs[0].state, with.packs[1].state) = (state(0.15), state(0.8));
    with.packs[1].available_s = 3.0 * HOUR;
    with.overhead_per_h.mean_wh = 3.0;
    let plan = |soc: f64| planned(vec![robot("r", soc, &[(0, 60.0)])], with.clone());
    // Wanted in three hours and a third.
    assert!(plan(1.0).planned[0].probability > 0.99, "{:?}", plan(1.0).planned);
    // Now it would have to do with 12 Wh.
    assert_eq!(plan(0.15).planned, []);
}

#[test]
fn what_comes_into_a_resting_pack_from_outside_pays_for_what_begins_later_and_for_nothing_before() {
    // 8 and 2 Wh, and 14 W from outside into the second: 24 Wh in an hour, 45 in two and a half.
    let plan = |soc: f64, is_charged: bool| {
        let mut with = station("s", 1, &[8.0, 2.0], &[]);
        let course = crate::forecast::refill(&station_pack(), 14.0, 25.0);
        let charged = Refill::along(course.clone().into(), 0.076, [600.0, 600.0], |soc| 84.0 * soc - 4.4);
        let [active, resting] = if is_charged { [Refill::later(course.into()), charged] } else { [Refill::NOTHING; 2] };
        let state = |soc: f64, refill| Some(PackState { model: station_pack(), soc: Estimate::exact(soc), temperature_degc: 25.0, refill });
        (with.packs[0].state, with.packs[1].state) = (state(0.14, active), state(0.076, resting));
        planned(vec![robot("r", soc, &[(0, 60.0)])], with)
    };
    // A service takes 23.4 Wh in an hour, and the station 6 W: 29 Wh now, 38 in an hour and a half, when this robot wants it.
    let later = plan(0.55, true);
    assert!(later.planned[0].probability > 0.95, "{:?}", later.planned);
    assert_eq!([plan(0.55, false), plan(0.12, true)].map(|plan| plan.planned), [vec![], vec![]]);
}

/// The least energy at which both robots get a service, beside each other if there is room, and how sure these are.
fn just_enough_for_both(bays: usize, socs: [f64; 2]) -> Vec<f64> {
    let robots = || vec![robot("a", socs[0], &[(0, 60.0)]), robot("b", socs[1], &[(0, 60.0)])];
    let plans = (0..200).map(|step| planned(robots(), station("s", bays, &[40.0 + 0.25 * f64::from(step)], &[])));
    let is_beside = |plan: &Plan| plan.planned[1].start.seconds_since(plan.planned[0].start) < 60.0;
    let both = plans.into_iter().find(|plan| plan.planned.len() == 2 && is_beside(plan) == (bays == 2)).unwrap();
    both.planned.iter().map(|planned| planned.probability).collect()
}

#[test]
fn who_charges_beside_another_is_as_sure_as_that_one_and_who_came_before_is_surer() {
    // The lift lets the first out some 40 s before the second.
    let beside = just_enough_for_both(2, [0.2, 0.2]);
    assert!(beside.iter().all(|sure| (0.95..0.99).contains(sure)) && (beside[0] - beside[1]).abs() < 0.03, "{beside:?}");
    let after = just_enough_for_both(1, [0.2, 0.7]);
    assert!(after[0] > 0.999 && (0.95..0.99).contains(&after[1]), "{after:?}");
}

#[test]
fn the_pack_that_an_exchange_leaves_is_charged_over_an_hour_not_while_the_robot_is_exchanged() {
    // A whole charge is 19 Wh. Drawn within the minute of the exchange it were 1.1 kW, which no pack gives.
    let mut with = station("s", 0, &[40.0], &[0.98]);
    with.charges_spares = true;
    with.packs[0].usable_wh.sigma = 4.0;
    with.packs[0].state =
        Some(PackState { model: station_pack(), soc: Estimate::exact(0.5), temperature_degc: 25.0, refill: Refill::default() });
    let plan = planned(vec![robot("r", 0.1, &[(0, 60.0)])], with);
    let exchange = plan.planned.first().expect("there is a spare");
    assert_eq!(exchange.mode, Mode::SwapAndRecharge);
    assert!(exchange.probability > 0.999, "{}", exchange.probability);
    // Told is all that the packs give for it.
    assert!((17.0..20.0).contains(&exchange.need.mean_wh), "{}", exchange.need.mean_wh);
}

#[test]
fn a_charged_spare_is_handed_out_though_the_packs_do_not_last_for_charging_what_is_left() {
    // 5 Wh: an exchange takes next to nothing, a whole charge 19 Wh. The second robot could come only when the first one's pack has
    // emptied the station's.
    let mut with = station("s", 0, &[5.0], &[0.98, 0.98]);
    with.charges_spares = true;
    with.packs[0].state =
        Some(PackState { model: station_pack(), soc: Estimate::exact(0.08), temperature_degc: 25.0, refill: Refill::default() });
    let robots = |later: f64| vec![robot("r", 0.1, &[(0, 60.0)]), robot("t", later, &[(0, 60.0)])];
    let told = |plan: &Plan| plan.planned.iter().map(|planned| (planned.robot.to_string(), planned.mode)).collect::<Vec<_>>();
    let plan = planned(robots(0.11), with.clone());
    assert_eq!(told(&plan), [("r".to_owned(), Mode::Swap), ("t".to_owned(), Mode::Swap)]);
    assert!(plan.planned.iter().all(|exchange| exchange.probability > 0.95 && exchange.need.mean_wh < 1.0));
    assert!(plan.planned[0].why.iter().any(|why| why.contains("as far as the station's packs last")), "{:?}", plan.planned[0].why);
    let plan = planned(robots(0.6), with);
    let sure = plan.planned.iter().all(|exchange| exchange.probability > 0.95);
    assert!(sure && plan.planned.iter().any(|exchange| exchange.robot.as_ref() == "r"), "{plan:?}");
}

#[test]
fn who_was_promised_a_spare_keeps_it_as_long_as_all_goes_as_foreseen() {
    // One may charge in the bay or get one of the spares, the other comes for what is left; the packs hold from hardly anything to enough
    // for charging all that is left.
    for soc in [0.06, 0.2, 0.35, 0.5, 0.65] {
        let mut before = Plan::default();
        for minute in 0..50 {
            let passed_h = f64::from(minute) / 60.0;
            let mut with = station("s", 1, &[84.0 * soc - 0.1 * 6.0 * passed_h], &[0.98, 0.98]);
            with.charges_spares = true;
            with.packs[0].state = Some(PackState {
                model: station_pack(),
                soc: Estimate::exact(soc - 0.07 * passed_h),
                temperature_degc: 25.0,
                refill: Refill::default(),
            });
            let held = |name: &str| before.planned.iter().any(|planned| planned.robot.as_str() == name);
            let there = |(name, full): (&str, f64)| RobotView { held: held(name), ..robot(name, full - 0.3 * passed_h, &[(0, 60.0)]) };
            let mut view = view([("a", 0.4), ("b", 0.5), ("c", 0.6)].map(there).into(), vec![with]);
            view.now = view.now.plus_s(3600.0 * passed_h);
            // Nobody leaves here: from when somebody should have, nothing goes as foreseen.
            if before.planned.iter().any(|planned| planned.leave <= view.now) {
                assert!(minute > 20, "at {soc}, minute {minute}: {before:?}");
                break;
            }
            let found = solve(view.clone(), &settings(), &before, Effort::Whole).plan;
            for promised in &before.planned {
                let is_kept = found.planned.iter().any(|planned| planned.robot == promised.robot);
                assert!(is_kept, "at {soc}, minute {minute}: {} loses {promised:?}", promised.robot);
            }
            before = found;
        }
    }
}

#[test]
fn a_pack_that_is_charged_takes_its_energy_before_the_next_robots_come() {
    // 22 Wh for a pack that a robot left, drawn in the next hour: nothing of it is there for services after that.
    let pays = |until_s: f64| {
        let mut with = station("s", 1, &[60.0], &[]);
        let need = Need { mean_wh: 22.0, ..Need::default() };
        with.recharging = vec![Recharging { from_s: 0.0, until_s, need }];
        with.packs[0].state =
            Some(PackState { model: station_pack(), soc: Estimate::exact(0.7), temperature_degc: 25.0, refill: Refill::default() });
        with.committed_until_s = 1800.0;
        let left = packs_after_begun(&with).expect("its pack is known").remove(0).soc.value;
        (with.begun().mean_wh, with.owed().mean_wh, left)
    };
    // 6 W by itself for half an hour are 3 Wh; of the charge half is drawn by then.
    let (begun_wh, owed_wh, left) = pays(3600.0);
    assert!((begun_wh - 14.0).abs() < 1e-9 && (owed_wh - 22.0).abs() < 1e-9);
    let (whole_wh, _, less) = pays(1800.0);
    assert!((whole_wh - 25.0).abs() < 1e-9);
    // 11 Wh of some 86.
    assert!((0.1..0.16).contains(&(left - less)), "{left} {less}");
}
