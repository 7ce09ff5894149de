//! No bay, lift movement, spare or joule is promised twice; the same seed gives the same plan.

use planner::draft::Draft;
use planner::problem::{Chance, Pack};
use planner::{Moves, Ways, capacity, plan, policies, renew, replan};
use proptest::prelude::*;

use crate::any;
use crate::checker::judged;
use crate::degenerate;

#[test]
fn what_begins_before_a_pack_comes_must_be_held_with_certainty_by_what_is_there() {
    // A robot that lasts four ticks and takes at least 650 units, over long before tick 30; what is there is known to 100.
    let served = |remaining: i64, comes: i64| {
        let mut station = degenerate::station();
        let pack = |name: &str, remaining, available_from| Pack { name: name.to_owned(), remaining, reserve: 0, available_from };
        (station.hotel, station.switch_cost, station.spares) = (0, 0, Vec::new());
        station.packs = vec![pack("0", remaining, 0), pack("1", 9000, comes)];
        let shared = [[0.0; 3]; 3];
        station.chance = Some(Chance { quantile: 1.645, quantile_held: 0.0, hotel: 0, begun: 0, variance: 100.0 * 100.0, shared });
        let problem = degenerate::problem(vec![degenerate::robot(200)], vec![station]);
        !plan(&problem, "optimise", 1, &mut Moves(400)).expect("a plan").sessions.is_empty()
    };
    // 650 and 1.645 x 100 are 815.
    assert_eq!([600, 700, 900].map(|remaining| served(remaining, 30)), [false, false, true]);
    assert!(served(700, 0), "both packs are there");
}

/// The deviation of a service of hundreds of kilowatt-hours, squared, is more than 63 bits hold.
#[test]
fn the_doubt_of_large_services_counts_in_full() {
    let served = |remaining: i64| {
        let mut station = degenerate::station();
        (station.hotel, station.switch_cost, station.spares) = (0, 0, Vec::new());
        station.packs = vec![Pack { name: "0".to_owned(), remaining, reserve: 0, available_from: 0 }];
        station.chance = Some(Chance { quantile: 1.645, quantile_held: 0.0, hotel: 0, begun: 0, variance: 0.0, shared: [[0.0; 3]; 3] });
        let robots = (0..2).map(|_| {
            let mut robot = degenerate::robot(200);
            robot.travel[0].variance = 5e9_f64.powi(2);
            robot
        });
        let problem = degenerate::problem(robots.collect(), vec![station]);
        plan(&problem, "optimise", 1, &mut Moves(400)).expect("a plan").sessions.len()
    };
    // 1.645 deviations of 5e9 for one, and of 7.07e9 for two.
    assert_eq!([7, 9, 11, 13].map(|remaining| served(remaining * 1_000_000_000)), [0, 1, 1, 2]);
}

/// What the station takes by itself until a pack comes is asked of the packs that are there for services that begin before, not for later ones.
#[test]
fn a_later_service_takes_nothing_from_an_earlier_one_before_its_pack_comes() {
    const COMES: u32 = 20;
    let problem = |remaining: i64| {
        let mut station = degenerate::station();
        let pack = |name: &str, remaining, available_from| Pack { name: name.to_owned(), remaining, reserve: 0, available_from };
        (station.hotel, station.switch_cost, station.spares) = (0, 0, Vec::new());
        station.packs = vec![pack("0", remaining, 0), pack("1", 9000, i64::from(COMES))];
        let shared = [[0.0; 3]; 3];
        station.chance = Some(Chance { quantile: 1.645, quantile_held: 0.0, hotel: 10, begun: 0, variance: 100.0 * 100.0, shared });
        // Little is known of the later one.
        let mut later = degenerate::robot(900);
        later.travel[0].variance = 300.0 * 300.0;
        degenerate::problem(vec![degenerate::robot(200), later], vec![station])
    };
    let rich = problem(9000);
    let ways = Ways::new(&rich);
    let early = ways.of(0).ways.iter().min_by_key(|way| (way.end, way.energy)).expect("a way");
    let needs = early.energy + 165 + 10 * i64::from(early.end);
    // Until the pack comes the station takes more than until the early service ends.
    assert!(u32::from(early.end) + 3 < COMES, "{early:?}");
    let scarce = problem(needs + 20);
    let ways = Ways::new(&scarce);
    let places = [
        ways.of(0).ways.iter().position(|way| (way.end, way.energy) == (early.end, early.energy)),
        ways.of(1).ways.iter().position(|way| u32::from(way.start) >= COMES),
    ];
    for [first, second] in [[0, 1], [1, 0]] {
        let mut draft = Draft::new(&ways);
        let place = |robot: usize| places[robot].expect("a way") as u32;
        draft.serve(first, place(first));
        let (choices, way) = (ways.of(second), &ways.of(second).ways[place(second) as usize]);
        assert!(draft.books[0].fits(choices, way), "robot {second} after robot {first}: {way:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 160, ..ProptestConfig::default() })]

    #[test]
    fn no_policy_ever_promises_anything_twice(problem in any::problem(), seed in 0_u64..4) {
        for policy in policies() {
            let plan = plan(&problem, policy.name(), seed, &mut Moves(600)).expect("a problem that can be planned");
            prop_assert_eq!(plan.objective.all(), judged(&problem, &plan), "policy {}", policy.name());
            prop_assert_eq!(plan.sessions.len() + plan.unserved.len(), problem.robots.len());
            prop_assert!(plan.unserved.iter().all(|one| !one.reasons.is_empty()), "{:?}", plan.unserved);
            for (level, (value, bound)) in plan.objective.all().into_iter().zip(plan.bound.all()).enumerate() {
                prop_assert!(bound <= value, "level {}: bound {} is above {}", level, bound, value);
            }
        }
    }

    #[test]
    fn what_is_promised_is_held_with_the_certainty_that_was_asked_for(problem in any::doubtful(), seed in 0_u64..4) {
        for policy in policies() {
            let plan = plan(&problem, policy.name(), seed, &mut Moves(400)).expect("stations that may go dark can always be planned");
            let ways = Ways::new(&problem);
            for (at, station) in problem.stations.iter().enumerate() {
                let chance = station.chance.as_ref().expect("a doubtful station");
                let sessions: Vec<_> = plan.sessions.iter().filter(|session| session.station == at).collect();
                let way = |session: &planner::Session| {
                    let choices = ways.of(session.robot);
                    choices.ways[choices.find(at, session.start, session.mode).expect("a way")]
                };
                let taken = sessions.iter().map(|session| way(session).energy).sum();
                // What services that begin before a tick may count on: those that begin later ask nothing of what is there until then,
                // and while nobody is served the station may go dark.
                let spare = |before: u32, taken: i64| {
                    let mut early = sessions.iter().filter(|session| session.start < before);
                    let last = station.ongoing.iter().map(|ongoing| ongoing.until).chain(early.clone().map(|session| session.end)).max().unwrap_or(0);
                    let variance = |robot: usize| problem.robots[robot].travel.iter().find(|travel| travel.station == at).expect("in reach").variance;
                    let own: f64 = early.clone().map(|session| variance(session.robot)).sum();
                    let asked = if early.all(|session| problem.robots[session.robot].held) { 0.0 } else { 1.645 };
                    let there = station.packs.iter().filter(|pack| pack.available_from < i64::from(before));
                    let held: i64 = there.map(|pack| (pack.remaining - pack.reserve).max(0)).sum();
                    let sigma = (chance.variance + own + chance.shared[2][2] * (taken as f64).powi(2)).sqrt();
                    // Variances are kept as whole numbers: a part in a thousand either way.
                    (held - chance.begun - taken - i64::from(last.min(before)) * chance.hotel) as f64 - 0.999 * asked * sigma
                };
                let end = spare(problem.horizon, taken);
                prop_assert!(sessions.is_empty() || end >= -1.0, "{}: {end}", policy.name());
                // Nor is anything drawn that only a pack holds which has still to come.
                for comes in station.packs.iter().map(|pack| pack.available_from).filter(|from| (1..40).contains(from)) {
                    let mut drawn = 0;
                    for session in sessions.iter().filter(|session| i64::from(session.start) < comes) {
                        ways.of(session.robot).draws(&way(session), station, problem.horizon, |from, to, draw| {
                            drawn += (to.min(comes as usize)).saturating_sub(from) as i64 * draw;
                        });
                    }
                    let before = spare(comes as u32, drawn);
                    prop_assert!(drawn == 0 || before >= -1.0, "{}: {before} before tick {comes}", policy.name());
                }
            }
        }
    }

    #[test]
    fn whoever_comes_later_breaks_nobodys_promise(mut problem in any::problem(), seed in 0_u64..4, loyalty in 0_u32..50) {
        let first = problem.robots.len() / 2;
        let mut early = problem.clone();
        early.robots[first..].iter_mut().for_each(|robot| robot.travel.clear());
        let before = plan(&early, "optimise", seed, &mut Moves(300)).expect("a plan").sessions;
        before.iter().for_each(|session| problem.robots[session.robot].held = true);
        let newcomers: Vec<usize> = (first..problem.robots.len()).collect();
        let mended = replan(&problem, &before, &newcomers, loyalty, seed, &mut Moves(600)).plan;
        let whole = renew(&problem, "optimise", &before, loyalty, seed, &mut Moves(600)).expect("a plan").plan;
        for plan in [mended, whole] {
            let broken: Vec<_> = plan.unserved.iter().filter(|one| problem.robots[one.robot].held).collect();
            prop_assert!(broken.is_empty(), "{:?} of {:?}", broken, before);
        }
    }

    #[test]
    fn a_seed_and_a_number_of_moves_make_the_plan(problem in any::problem(), seed in any::<u64>()) {
        let once = plan(&problem, "optimise", seed, &mut Moves(500)).expect("a plan");
        let again = plan(&problem, "optimise", seed, &mut Moves(500)).expect("a plan");
        prop_assert_eq!(once, again);
    }

    #[test]
    fn no_pack_pays_for_more_robots_than_it_can(problem in any::problem()) {
        let capacity = capacity(&problem);
        prop_assert!(capacity.atomic.len() <= capacity.atomic_bound);
        prop_assert!(capacity.atomic.len() <= capacity.split);
        prop_assert!(capacity.split <= capacity.split_bound);
        prop_assert!(capacity.packs.iter().all(|&(_, _, alone)| alone <= capacity.atomic_bound));
    }
}
