//! Nothing to plan, nothing to plan with, and what cannot be planned or read.

use planner::problem::{Problem, Robot, Travel};
use planner::{Instance, Moves, NoPlan, plan};

use crate::any;
use crate::checker::judged;

pub fn station() -> planner::problem::Station {
    use proptest::strategy::{Strategy as _, ValueTree as _};
    let mut station = any::station().new_tree(&mut proptest::test_runner::TestRunner::deterministic()).expect("a station").current();
    station.ongoing.clear();
    (station.opens, station.bays, station.lift_slots, station.swap_slots, station.p_max) = (0, 2, 1, 1, 400);
    (station.load_ticks, station.unload_ticks, station.swap_ticks) = (1, 1, 2);
    station.packs[0].remaining = 9000;
    station
}

pub fn robot(energy: i64) -> Robot {
    let travel = vec![Travel { station: 0, ticks: 2, extra: 0, extra_hi: 0, variance: 0.0, spares: Some(0) }];
    Robot {
        name: "r".to_owned(),
        battery: 0,
        energy,
        drain: 20,
        drain_hi: 24,
        drain_served: 24,
        mission_end: 50,
        weight: 1,
        critical: None,
        not_before: 0,
        wanted: None,
        held: false,
        lowest_target: 0,
        travel,
        beyond: Vec::new(),
    }
}

pub fn problem(robots: Vec<Robot>, stations: Vec<planner::problem::Station>) -> Problem {
    let batteries = vec![any::battery()];
    Problem { name: "degenerate".to_owned(), tick_s: 60, units_per_wh: 1000, horizon: 40, capacity_target: 1, batteries, stations, robots }
}

fn planned(problem: &Problem) -> planner::Plan {
    let plan = plan(problem, "optimise", 1, &mut Moves(2000)).expect("a plan");
    assert_eq!(plan.objective.all(), judged(problem, &plan));
    plan
}

#[test]
fn without_robots_only_the_stations_themselves_draw() {
    assert_eq!(planned(&problem(Vec::new(), vec![station()])).objective.all(), [0, 0, 200, 1]);
    assert_eq!(planned(&problem(Vec::new(), Vec::new())).objective.all(), [0, 0, 0, 0]);
}

#[test]
fn without_stations_everybody_is_told_why() {
    let mut alone = robot(500);
    alone.travel.clear();
    let plan = planned(&problem(vec![alone], Vec::new()));
    assert_eq!(plan.objective.stranded, 1);
    assert_eq!(plan.unserved[0].reasons, ["no station is in reach"]);
}

#[test]
fn who_is_empty_reaches_nobody() {
    let plan = planned(&problem(vec![robot(100), robot(90), robot(0)], vec![station()]));
    assert_eq!(plan.objective.stranded, 3);
    let told = [0, 1].map(|robot: usize| plan.unserved[robot].reasons[0].clone());
    assert!(told[0].contains("enough for 0 only") && told[1].contains("takes more than the robot may have"), "{told:?}");
}

#[test]
fn without_bays_and_spares_nobody_is_serviced() {
    let mut bare = station();
    (bare.bays, bare.spares) = (0, Vec::new());
    let plan = planned(&problem(vec![robot(500)], vec![bare]));
    assert_eq!(plan.unserved[0].reasons, ["station any: it has neither bay nor spare"]);
}

#[test]
fn equal_robots_take_turns() {
    let plan = planned(&problem(vec![robot(500); 6], vec![station()]));
    assert!(plan.sessions.len() >= 2, "{:?}", plan.sessions);
}

/// A full bay, and a robot that is at its target already, where nothing takes any time.
#[test]
fn a_service_of_no_time_is_none() {
    let mut quick = station();
    (quick.load_ticks, quick.unload_ticks, quick.bays, quick.spares) = (0, 0, 1, Vec::new());
    quick.ongoing = vec![planner::problem::Ongoing { bay: Some(0), from: 0, load_ticks: 0, until: 20, draw: 60, unload_ticks: 0 }];
    let mut full = problem(vec![robot(600)], vec![quick]);
    full.batteries[0].min_gain = 0;
    full.robots[0].drain = 0;
    full.robots[0].travel[0].ticks = 0;
    assert!(planned(&full).sessions.iter().all(|session| session.end > session.start));
}

/// A robot that is at its target needs nothing; a pack below its reserve gives nothing all the same.
#[test]
fn a_pack_below_its_reserve_serves_nobody_who_needs_nothing() {
    let served = |remaining: i64| {
        let mut free = station();
        (free.load_draw, free.unload_draw) = (0, 0);
        free.packs = vec![planner::problem::Pack { name: "0".to_owned(), remaining, reserve: 100, available_from: 0 }];
        let mut full = problem(vec![robot(1000)], vec![free]);
        full.batteries[0].min_gain = 0;
        full.robots[0].drain = 0;
        (full.capacity_target, full.batteries[0].targets) = (0, vec![900]);
        full.robots[0].energy = 900;
        planner::capacity(&full).atomic.len()
    };
    assert_eq!([99, 100].map(served), [0, 1]);
}

/// With hundreds of places on the lift and as many slots there are millions of ways to handle robots at a time: to go through them took minutes.
#[test]
fn a_station_of_very_many_places_is_planned_at_once() {
    let mut large = station();
    (large.bays, large.lift_slots, large.swap_slots, large.p_max) = (400, 400, 400, 1_000_000);
    (large.load_draw, large.unload_draw, large.swap_draw) = (90, 90, 90);
    large.spares = vec![planner::problem::Spare { ready: 0, kind: 0 }; 400];
    assert_eq!(planned(&problem(vec![robot(500); 2], vec![large])).sessions.len(), 2);
}

#[test]
fn what_the_packs_cannot_feed_is_said_in_words() {
    let mut hungry = station();
    hungry.packs.truncate(1);
    hungry.packs[0].remaining = hungry.packs[0].reserve + 150;
    let Err(NoPlan::Impossible(why)) = plan(&problem(vec![robot(500)], vec![hungry]), "optimise", 1, &mut Moves(10)) else {
        panic!("a plan although nothing feeds the station");
    };
    assert!(why[0].contains("take 200 mWh before tick 40") && why[0].contains("50 mWh short"), "{why:?}");
    let mut dark = station();
    dark.packs.clear();
    let why = plan(&problem(Vec::new(), vec![dark]), "optimise", 1, &mut Moves(10)).expect_err("no pack").to_string();
    assert!(why.contains("no pack on line"), "{why}");
}

#[test]
fn mistakes_are_named_with_what_was_meant() {
    let text = include_str!("../instances/6-1-1.json");
    let error = |from: &str, to: &str| Instance::parse(&text.replacen(from, to, 1)).expect_err("a mistake").to_string();
    assert!(error("\"horizon\"", "\"horizn\"").contains("did you mean `horizon`"));
    assert!(error("\"bays\":", "\"bays\":-").contains("allowed are 0 to"));
    let targets = text.find("\"targets\":[").expect("targets");
    let end = targets + text[targets..].find(']').expect("their end");
    let none = error(&text[targets..=end], "\"targets\":[]");
    assert_eq!(none, "number of battery.targets is 0, allowed are 1 to 250");
    assert!(error("\"travel\":[[0,", "\"travel\":[[7,").contains("no station has the id 7; the nearest id is 0"));
    assert!(error("mds-inst-1", "mds-inst-9").contains("\"mds-inst-1\" can"));
    assert!(error("\"horizon\":", "\"horizon\":0.5,\"x\":").contains("horizon: invalid type"));
    let mut robots: serde_json::Value = serde_json::from_str(text).unwrap();
    let mut changed = |key: &str, to: serde_json::Value| {
        let was = std::mem::replace(&mut robots["robots"][1][key], to);
        let said = Instance::parse(&robots.to_string()).expect_err("a mistake").to_string();
        robots["robots"][1][key] = was;
        said
    };
    assert!(changed("drain", serde_json::Value::Null).contains("robots[1].drain: invalid type"));
    assert!(changed("energy", 1_000_000.into()).contains("robot 1: energy is 1000000, allowed are 0 to"));
    assert!(changed("critical", serde_json::json!([20, 5])).contains("robot 1: critical: it ends at 5, before it begins at 20"));
    let unknown = plan(&problem(Vec::new(), Vec::new()), "optimize", 1, &mut Moves(10)).expect_err("no such policy");
    assert!(unknown.to_string().contains("did you mean \"optimise\""), "{unknown}");
}

#[test]
fn what_packs_could_serve_does_not_hang_on_where_the_horizon_ends() {
    let text = include_str!("../instances/6-1-1.json");
    let far = planner::capacity(&Instance::parse(text).unwrap().problem);
    let mut short: serde_json::Value = serde_json::from_str(text).unwrap();
    short["horizon"] = 1.into();
    let near = Instance::parse(&short.to_string()).unwrap().problem;
    assert!(near.robots.iter().all(|robot| robot.travel.is_empty()), "nobody arrives in one tick");
    assert_eq!(planner::capacity(&near), far);
    assert!(far.split > 0);
}
