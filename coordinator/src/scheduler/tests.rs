//! Small fleets by hand, through the whole of the translation.

mod harder;
mod heat;
mod kept;
mod needs;
mod racks;
mod rounding;
mod shed;
mod stepped;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use energy::{Estimate, Model, Need};
use proto::{BayId, PackId, RobotId, SpareId, StationId, Timestamp};

use super::charging::{Point, Table};
use super::*;
use crate::config::PolicyConfig;
use crate::forecast::Handling;
use crate::models::{Settings, ShortEnergy};

const HOUR: f64 = 3600.0;

/// 1C without a taper: an hour and 26 Wh from empty to 98 %, with a lift of 0.1 Wh.
fn table() -> Arc<Table> {
    let point = |step: u32| {
        let soc = 0.98 * f64::from(step) / 10.0;
        let left = 1.0 - f64::from(step) / 10.0;
        Point {
            soc,
            charge_s: HOUR * left,
            need_wh: 0.1 + 26.0 * left,
            own_variance: 0.01,
            bare_wh: 19.0 * left,
            bare_s: HOUR * left,
            stopped: None,
        }
    };
    Arc::new(Table {
        points: (0..=10).map(point).collect(),
        lift_wh: 0.1,
        shared_per_wh: vec![0.01],
        breakdown_wh: BTreeMap::new(),
        reaches_soc: 0.0,
    })
}

fn station(name: &str, bays: usize, usable_wh: &[f64], spares: &[f64]) -> StationView {
    let bay = |n: usize| BayId::new(format!("bay-{n}")).unwrap();
    let pack = |(n, wh): (usize, &f64)| PackView {
        pack: PackId::new(format!("pack-{n}")).unwrap(),
        usable_wh: Estimate::new(*wh, 0.01 * wh),
        gain_wh: 0.0,
        uncounted_wh: 0.0,
        state: None,
        available_s: 0.0,
    };
    let spare =
        |(n, soc): (usize, &f64)| SpareView { spare: SpareId::new(format!("spare-{n}")).unwrap(), soc: *soc, ready_s: 0.0, kind: 0 };
    StationView {
        station: StationId::new(name).unwrap(),
        out_of_order: None,
        opens_s: 0.0,
        away_s: Vec::new(),
        handling: Handling { load_s: 30.0, unload_s: 40.0, swap_s: 60.0 },
        bays: (0..bays).map(bay).collect(),
        unfed: 0,
        begun: Vec::new(),
        spares: spares.iter().enumerate().map(spare).collect(),
        charges_spares: false,
        ready_soc: 0.98,
        packs: usable_wh.iter().enumerate().map(pack).collect(),
        committed: Need::default(),
        committed_until_s: 0.0,
        recharging: Vec::new(),
        overhead_per_h: Need { mean_wh: 6.0, shared_wh: vec![0.2], own_variance: 0.0 },
        shared_per_wh: vec![0.01],
    }
}

fn battery() -> Arc<Model> {
    Arc::new(energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap())
}

/// A robot that loses 30 % an hour.
fn robot(name: &str, soc: f64, stations: &[(usize, f64)]) -> RobotView {
    let drain_soc_per_s = 0.3 / HOUR;
    let surely_s = (soc - 0.02) / drain_soc_per_s;
    let lasts = Lasts { empty_s: surely_s, surely_s, expected_s: Estimate::new(soc / drain_soc_per_s, 0.02 / 1.645 / drain_soc_per_s) };
    let way = |&(station, time_s): &(usize, f64)| WayView { station, time_s, extra_soc: Estimate::exact(0.0), lasts, table: table() };
    RobotView {
        robot: RobotId::new(name).unwrap(),
        battery: battery(),
        temperature_degc: 25.0,
        charge_degc: 25.0,
        soc: Estimate::new(soc, 0.01),
        lasts,
        wanted_s: ((soc - 0.1) / drain_soc_per_s).max(0.0),
        is_hurried: false,
        drain_soc_per_s,
        drain_hi_soc_per_s: drain_soc_per_s,
        weight: 1.0,
        until_s: None,
        held: false,
        ways: stations.iter().map(way).collect(),
        unfit: Vec::new(),
        closed: Vec::new(),
    }
}

fn settings() -> Settings {
    PolicyConfig { serve_below_soc: 0.1, ..PolicyConfig::default() }.settings().unwrap()
}

/// Every charge ends at the usual level.
fn whole_charges() -> Settings {
    Settings { charge_at_least_soc: 0.98, ..settings() }
}

fn view(robots: Vec<RobotView>, stations: Vec<StationView>) -> View {
    View { now: Timestamp::from_unix_ms(1_767_225_603_000), robots, stations, crowd: 0 }
}

fn solved(robots: Vec<RobotView>, stations: Vec<StationView>) -> Solved {
    solve(view(robots, stations), &settings(), &Plan::default(), Effort::Whole)
}

fn names(plan: &Plan) -> Vec<&str> {
    plan.planned.iter().map(|planned| planned.robot.as_ref()).collect()
}

#[test]
fn no_robots_no_stations_and_no_packs_are_answers() {
    assert_eq!(solved(Vec::new(), Vec::new()).plan.planned, []);
    assert_eq!(solved(Vec::new(), vec![station("s", 1, &[80.0], &[])]).plan.planned, []);
    let nowhere = solved(vec![robot("r", 0.12, &[])], Vec::new()).plan;
    assert_eq!(nowhere.rejected[0].reasons, ["no station is in reach"]);
    // 10.3 Wh and 6 W for 25 min, and what certainty takes.
    let dark = solved(vec![robot("r", 0.12, &[(0, 60.0)])], vec![station("s", 1, &[], &[])]).plan;
    assert!(dark.rejected[0].reasons[0].contains("its empty packs are 13.5 Wh short for a charge to 50 %"), "{:?}", dark.rejected);
    let bare = solved(vec![robot("r", 0.12, &[(0, 60.0)])], vec![station("s", 0, &[80.0], &[])]).plan;
    assert_eq!(bare.rejected[0].reasons, ["s: no bay works, and no charged spare is left"]);
}

#[test]
fn a_station_out_of_order_takes_nobody_and_says_why() {
    let mut alone = robot("r", 0.12, &[]);
    alone.closed.push((StationId::new("s").unwrap(), "it has no power".to_owned()));
    let plan = solved(vec![alone], vec![station("s", 1, &[80.0], &[])]).plan;
    assert_eq!(plan.rejected[0].reasons, ["s takes no part: it has no power"]);
}

#[test]
fn promises_are_given_as_far_as_the_energy_goes_with_certainty() {
    // From 10 %: 23.4 Wh each, and 6 W for the hour. 54 Wh do for two, but not at 95 %; 58 do.
    let robots = || ["a", "b", "c"].map(|name| robot(name, 0.1, &[(0, 60.0)])).to_vec();
    let plan = |wh: f64, settings: &Settings| {
        solve(view(robots(), vec![station("s", 3, &[wh], &[])]), settings, &Plan::default(), Effort::Whole).plan
    };
    let served = |wh: f64| plan(wh, &whole_charges()).planned.len();
    assert_eq!([served(28.0), served(54.0), served(58.0), served(90.0)], [0, 1, 2, 3]);
    let short = plan(58.0, &whole_charges());
    let why = &short.rejected[0].reasons[0];
    assert!(why.starts_with("s: pack-0 is ") && why.contains("Wh short for a service at 00:0") && why.ends_with("asked for 95 %"), "{why}");
    // A charge to 50 % takes 10.7 Wh, beside a whole one little of the 6 W: what whole ones leave goes to whoever would be empty.
    let levels = |wh: f64, settings: &Settings| {
        let mut levels: Vec<f64> = plan(wh, settings).planned.iter().map(|planned| planned.to_soc).collect();
        levels.sort_by(f64::total_cmp);
        levels
    };
    assert!(levels(10.0, &settings()).is_empty());
    assert!(levels(18.0, &settings()).len() == 1 && levels(18.0, &settings())[0] < 0.98);
    assert_eq!(levels(58.0, &settings()), [0.98, 0.98]);
    let [less, whole @ ..] = &levels(72.0, &settings())[..] else { panic!("nobody") };
    assert!(*less < 0.98 && whole == [0.98, 0.98], "{less} {whole:?}");
    let why = &plan(58.0, &settings()).rejected[0].reasons[0];
    assert!(why.contains("Wh short for a charge to 50 % at 00:0"), "{why}");
    // A site that wants as many robots as possible has three where there are two whole charges.
    let most = Settings { short_energy: ShortEnergy::MostRobots, ..settings() };
    assert_eq!(levels(58.0, &most).len(), 3);
}

#[test]
fn who_may_be_empty_before_it_is_there_is_sent_all_the_same_and_at_once() {
    // A minute of what it is expected to have, and none to be sure of; the way takes half of it.
    let low = |soc: f64| solved(vec![robot("low", soc, &[(0, 30.0)])], vec![station("s", 1, &[80.0], &[])]).plan;
    let plan = low(0.3 / 60.0);
    let [sent] = &plan.planned[..] else { panic!("{:?}", plan.rejected) };
    assert_eq!(sent.leave, Timestamp::from_unix_ms(1_767_225_603_000), "{sent:?}");
    assert!((0.5..0.9).contains(&sent.probability) && sent.why[0].contains("and lasts with probability"), "{sent:?}");
    // Whoever cannot be expected to arrive either is not.
    let lost = low(0.1 / 60.0);
    assert!(lost.rejected[0].stranded && lost.rejected[0].reasons[0].contains("min away"), "{lost:?}");
}

#[test]
fn a_promise_is_kept_at_even_odds_and_not_given_at_them() {
    // 23.4 Wh and 6 W for 0.92 h are 29 Wh: 29.4 Wh do, but not at 95 %.
    let tight = |held: bool| {
        let robots = vec![RobotView { held, ..robot("r", 0.1, &[(0, 60.0)]) }];
        solve(view(robots, vec![station("s", 1, &[29.4], &[])]), &whole_charges(), &Plan::default(), Effort::Whole).plan.planned.len()
    };
    assert_eq!((tight(false), tight(true)), (0, 1));
}

#[test]
fn who_would_strand_in_a_queue_comes_before_it_is_wanted() {
    let robots: Vec<RobotView> = ["a", "b"].map(|name| robot(name, 0.30, &[(0, 60.0)])).to_vec();
    // At 10 % both would come after 40 min, and the second could not wait for the first.
    let plan = solved(robots.clone(), vec![station("s", 1, &[80.0], &[])]).plan;
    assert_eq!(plan.planned.len(), 2, "{:?}", plan.rejected);
    assert!(plan.planned[0].why[0].contains("min before it is wanted"), "{:?}", plan.planned[0].why);
    let threshold = Settings { policy: planner::policy("threshold").unwrap(), ..settings() };
    let fleets_today = solve(view(robots, vec![station("s", 1, &[80.0], &[])]), &threshold, &Plan::default(), Effort::Whole).plan;
    assert_eq!(fleets_today.planned.len(), 1);
}

#[test]
fn the_work_that_is_worth_more_is_served_when_not_all_can_be() {
    let heavy = RobotView { weight: 5.0, ..robot("b", 0.12, &[(0, 60.0)]) };
    let plan = solved(vec![robot("a", 0.12, &[(0, 60.0)]), heavy], vec![station("s", 2, &[32.0], &[])]).plan;
    assert_eq!(names(&plan), ["b"]);
}

#[test]
fn the_fullest_spare_goes_out_and_one_that_adds_nothing_does_not() {
    let with = |spares: &[f64]| solved(vec![robot("r", 0.12, &[(0, 60.0)])], vec![station("s", 0, &[80.0], spares)]).plan;
    assert_eq!(with(&[0.4, 0.9, 0.7]).planned[0].spare.as_ref().unwrap().as_str(), "spare-1");
    assert_eq!(with(&[0.12]).planned, []);
}

#[test]
fn packs_pay_in_the_order_in_which_they_are_drained() {
    let robots: Vec<RobotView> = ["a", "b"].map(|name| robot(name, 0.1, &[(0, 60.0)])).to_vec();
    let plan = solved(robots, vec![station("s", 2, &[20.0, 60.0], &[])]).plan;
    let paying: Vec<Vec<&str>> = plan.planned.iter().map(|planned| planned.packs.iter().map(AsRef::as_ref).collect()).collect();
    assert_eq!(paying, [vec!["pack-0", "pack-1"], vec!["pack-1"]]);
    assert!(plan.planned.iter().all(|planned| planned.probability > 0.95));
}

#[test]
fn a_pack_that_is_brought_later_pays_for_what_begins_later() {
    // Each takes 23.4 Wh and the station 6 W: the pack that is there does for one, until another one comes. "b" wants nothing before.
    let mut with = station("s", 2, &[36.0, 60.0], &[]);
    with.packs[1].available_s = 2.0 * HOUR;
    let robots = |soc: [f64; 2]| vec![robot("a", soc[0], &[(0, 60.0)]), robot("b", soc[1], &[(0, 60.0)])];
    let plan = solved(robots([0.12, 0.8]), vec![with.clone()]).plan;
    let told: Vec<(&str, Vec<&str>)> =
        plan.planned.iter().map(|planned| (planned.robot.as_ref(), planned.packs.iter().map(AsRef::as_ref).collect())).collect();
    assert_eq!(told, [("a", vec!["pack-0"]), ("b", vec!["pack-1"])]);
    assert!(plan.planned.iter().all(|planned| planned.probability > 0.95), "{:?}", plan.planned);
    // Both at once is more than what is there, though not than what comes.
    let plan = solved(robots([0.11, 0.115]), vec![with]).plan;
    assert_eq!(names(&plan), ["a"]);
    assert!(plan.rejected[0].reasons[0].contains("Wh short for a charge to 50 % at"), "{:?}", plan.rejected);
}

#[test]
fn where_not_all_have_room_for_a_whole_charge_some_leave_with_less() {
    // All are empty in 56 min. From 30 % a whole charge takes 42 min with the lift, one to 50 % takes 14: two whole ones leave none for a third.
    let robots = |count: usize| ["a", "b", "c"][..count].iter().map(|name| robot(name, 0.3, &[(0, 60.0)])).collect::<Vec<_>>();
    let levels = |plan: &Plan| plan.planned.iter().map(|planned| planned.to_soc).collect::<Vec<_>>();
    let both = solved(robots(2), vec![station("s", 1, &[90.0], &[])]).plan;
    assert_eq!((levels(&both), both.rejected.len()), (vec![0.98, 0.98], 0));
    let all = solved(robots(3), vec![station("s", 1, &[90.0], &[])]).plan;
    assert_eq!(all.rejected, []);
    assert!(levels(&all).iter().all(|soc| (0.5..=0.98).contains(soc)) && levels(&all).iter().any(|soc| *soc < 0.98), "{:?}", levels(&all));
    let less = all.planned.iter().find(|planned| planned.to_soc < 0.98).unwrap();
    assert!(less.why.iter().any(|why| why.contains("a whole charge would take place or energy")), "{:?}", less.why);
    // Nobody is asked to where the site does not want it.
    let plan = solve(view(robots(3), vec![station("s", 1, &[90.0], &[])]), &whole_charges(), &Plan::default(), Effort::Whole).plan;
    assert_eq!((levels(&plan), plan.rejected.len()), (vec![0.98, 0.98], 1));
}

#[test]
fn a_station_on_its_way_takes_robots_in_when_it_is_there() {
    let moving = |opens_s: f64| StationView { opens_s, ..station("s", 1, &[90.0], &[]) };
    let now = view(Vec::new(), Vec::new()).now;
    // At 12 % a robot wants a service in 4 min and is empty in 20.
    let plan = solved(vec![robot("r", 0.12, &[(0, 60.0)])], vec![moving(600.0)]).plan;
    assert!((600.0..630.0).contains(&plan.planned[0].start.seconds_since(now)), "{:?}", plan.planned);
    assert!((540.0..570.0).contains(&plan.planned[0].leave.seconds_since(now)), "it works until it must leave");
    // Another one that stands where it is is better, unless it is far.
    let both = |travel_s: f64| {
        let plan = solved(vec![robot("r", 0.12, &[(0, 60.0), (1, travel_s)])], vec![moving(600.0), station("t", 1, &[90.0], &[])]).plan;
        plan.planned[0].station.to_string()
    };
    assert_eq!((both(120.0), both(1100.0)), ("t".to_owned(), "s".to_owned()));
    let late = solved(vec![robot("r", 0.12, &[(0, 60.0)])], vec![moving(1800.0)]).plan;
    assert!(late.rejected[0].reasons[0].starts_with("s: it is on its way and takes robots in from 00:30"), "{:?}", late.rejected);
}

#[test]
fn what_was_promised_stays_where_it_is_as_long_as_it_can() {
    let first = solved(vec![robot("a", 0.2, &[(0, 60.0)]), robot("b", 0.22, &[(0, 60.0)])], vec![station("s", 2, &[90.0], &[])]);
    // Half a minute later the gauges say a little else.
    let mut later = view(vec![robot("a", 0.199, &[(0, 60.0)]), robot("b", 0.216, &[(0, 60.0)])], vec![station("s", 2, &[89.9], &[])]);
    later.now = later.now.plus_s(27.0);
    let again = solve(later, &settings(), &first.plan, Effort::Whole);
    assert_eq!(again.plan.moved, []);
    let starts = |plan: &Plan| plan.planned.iter().map(|planned| (planned.robot.clone(), planned.start)).collect::<Vec<_>>();
    assert_eq!(starts(&again.plan), starts(&first.plan));
}

#[test]
fn what_a_promise_is_worth_goes_with_the_mean_weight_of_those_that_have_one() {
    let task = |weights: &[f64]| {
        let robots = weights.iter().map(|&weight| RobotView { weight, ..robot("r", 0.2, &[(0, 60.0)]) });
        Task::new(view(robots.collect(), vec![station("s", 1, &[90.0], &[])]), &settings(), &[], translate::Offer::Usual)
    };
    let loyalty = |weights: &[f64]| task(weights).loyalty(120.0);
    let one = loyalty(&[1.0, 1.0]);
    assert!(one > 0);
    assert_eq!([loyalty(&[10.0, 10.0]), loyalty(&[2.0, 4.0]), loyalty(&[1.0, 0.0]), loyalty(&[0.0, 0.0])], [10 * one, 3 * one, one, one]);
    // A fleet may weigh its robots in whatever it likes: 12 ticks of work are worth 12 ticks of work.
    for weights in [[0.02, 0.02], [1e5, 1e5], [2e3, 5e5]] {
        let task = task(&weights);
        let units: Vec<i64> = task.problem.robots.iter().map(|robot| robot.weight).collect();
        assert_eq!(i64::from(task.loyalty(120.0)), 12 * (units[0] + units[1]) / 2, "{units:?}");
        assert_eq!(units[0] as f64 / units[1] as f64, weights[0] / weights[1], "{units:?}");
    }
}

#[test]
fn an_account_names_who_is_in_the_way_and_what_else_would_cost() {
    let robots: Vec<RobotView> = ["a", "b"].map(|name| robot(name, 0.12, &[(0, 60.0), (1, 900.0)])).to_vec();
    let solved = solved(robots, vec![station("near", 1, &[90.0], &[]), station("far", 1, &[90.0], &[])]);
    let far = solved.plan.planned.iter().find(|planned| planned.station.as_str() == "far").expect("one goes far");
    let ways = planner::Ways::new(&solved.task.problem);
    let mut accounts = Accounts::new(&solved.task, &ways, &solved.sessions);
    let told = accounts.of(&far.robot);
    let near = told.others.iter().find(|other| other.station.as_str() == "near").expect("the other station");
    let blocker = if far.robot.as_str() == "a" { "b" } else { "a" };
    assert!(near.why_not[0].contains(&format!("planned for {blocker}")), "{near:?}");
    let settled = accounts.of(&RobotId::new(blocker).unwrap());
    assert!(!settled.earlier.is_empty(), "{settled:?}");
}

/// One bay for two who want it at once: the later one is told of the earlier one, in the last slot before its own.
#[test]
fn who_comes_late_is_told_who_stands_before_it_and_who_comes_early_what_it_lacks_later() {
    let told = |solved: &Solved, robot: &RobotId| {
        let ways = planner::Ways::new(&solved.task.problem);
        Accounts::new(&solved.task, &ways, &solved.sessions).of(robot)
    };
    let crowd = solved(["a", "b"].map(|name| robot(name, 0.15, &[(0, 60.0)])).into(), vec![station("s", 1, &[90.0], &[])]);
    let [first, second] = &crowd.plan.planned[..] else { panic!("both are served: {:?}", crowd.plan) };
    let late = told(&crowd, &second.robot).earlier.concat();
    assert!(late.contains("every bay is taken") && late.ends_with(&format!("planned for {}", first.robot)), "{late}");
    // Whoever comes in time is told that.
    let alone = solved(vec![robot("a", 0.4, &[(0, 60.0)])], vec![station("s", 1, &[90.0], &[])]);
    let in_time = told(&alone, &alone.plan.planned[0].robot);
    assert!(in_time.earlier[0].starts_with("no: it is wanted at") && in_time.when_wanted.is_none(), "{in_time:?}");
    // A station that is still on its way is waited for, and one that is away.
    for (opens_s, away_s, what) in
        [(600.0, Vec::new(), "s takes robots in from 00:10 on"), (0.0, vec![0.0..600.0], "s is away until 00:10")]
    {
        let place = StationView { opens_s, away_s, ..station("s", 1, &[90.0], &[]) };
        let waits = solved(vec![robot("a", 0.12, &[(0, 60.0)])], vec![place]);
        let told = told(&waits, &waits.plan.planned[0].robot).earlier.concat();
        assert!(told.contains(what), "{told}");
    }
    // One of two who would be wanted at the same time comes early, and later the other one has the bay.
    let queue = solved(["a", "b"].map(|name| robot(name, 0.3, &[(0, 60.0)])).into(), vec![station("s", 1, &[90.0], &[])]);
    let early = queue.plan.planned.iter().map(|planned| told(&queue, &planned.robot)).find_map(|told| told.when_wanted);
    assert!(
        early.as_ref().is_some_and(|why| why.contains("nearer to when it is wanted: every bay is taken")),
        "{early:?} {:?}",
        queue.plan
    );
}

/// A plan a second, from a begin that lies anywhere in a tick: nobody is put off from plan to plan.
#[test]
fn who_is_wanted_leaves_within_a_tick_however_often_is_planned() {
    // 60 s away; late already, and wanted in 500 s. With a plan until it is empty, a tick is 15 s here.
    for (soc, latest_s) in [(0.099, 0.0), (0.1 + 0.3 * 500.0 / HOUR, 440.0 + 15.0)] {
        let (mut before, mut left_s) = (Plan::default(), None);
        for second in 0..600 {
            let passed_s = f64::from(second);
            let late = robot("r", soc - 0.3 / HOUR * passed_s, &[(0, 60.0)]);
            let mut view = view(vec![late], vec![station("s", 1, &[80.0], &[])]);
            view.now = view.now.plus_s(0.35 + passed_s);
            let found = solve(view.clone(), &settings(), &before, Effort::Whole);
            if found.plan.planned[0].leave <= view.now {
                left_s = Some(passed_s);
                break;
            }
            before = found.plan;
        }
        assert!(left_s.is_some_and(|left_s| left_s <= latest_s), "{left_s:?} of {latest_s}");
    }
}
