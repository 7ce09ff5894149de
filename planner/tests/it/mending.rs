//! A plan that is mended keeps its other promises.

use planner::{Instance, Mode, Moves, Session, plan, replan};

use crate::checker::judged;

#[test]
fn a_change_of_one_robot_moves_no_more_than_it_must() {
    let instance = Instance::parse(include_str!("../instances/16-2-1.json")).expect("an instance");
    let mut problem = instance.problem;
    let before = plan(&problem, "optimise", 1, &mut Moves(20_000)).expect("a plan");
    let same = replan(&problem, &before.sessions, &[], 5, 1, &mut Moves(0));
    assert_eq!(same.plan.sessions, before.sessions);
    assert!(same.moved.is_empty());

    let changed = before.sessions[0].robot;
    problem.robots[changed].energy -= 400;
    let mended = replan(&problem, &before.sessions, &[changed], 1000, 1, &mut Moves(400));
    assert_eq!(mended.plan.objective.all(), judged(&problem, &mended.plan));
    assert!(mended.moved.len() <= 3, "{:?}", mended.moved);
}

#[test]
fn a_bay_that_fails_moves_its_robots() {
    let instance = Instance::parse(include_str!("../instances/12-2-1.json")).expect("an instance");
    let mut problem = instance.problem;
    let before = plan(&problem, "optimise", 1, &mut Moves(20_000)).expect("a plan");
    problem.stations[0].bays -= 1;
    let mended = replan(&problem, &before.sessions, &[], 5, 1, &mut Moves(2000));
    assert_eq!(mended.plan.objective.all(), judged(&problem, &mended.plan));
    assert!(!mended.moved.is_empty());
    assert_eq!(mended, replan(&problem, &before.sessions, &[], 5, 1, &mut Moves(2000)));
}

#[test]
fn a_charge_that_takes_a_tick_more_makes_those_behind_it_slip_and_breaks_no_promise() {
    let instance = Instance::parse(include_str!("../instances/16-2-1.json")).expect("an instance");
    let mut problem = instance.problem;
    // Bays are what is scarce, and nobody can come much later.
    for station in &mut problem.stations {
        station.bays = 1;
        station.spares.clear();
        station.ongoing.clear();
        station.packs.iter_mut().for_each(|pack| pack.remaining *= 10);
    }
    let before = plan(&problem, "optimise", 1, &mut Moves(20_000)).expect("a plan");
    before.sessions.iter().for_each(|session| problem.robots[session.robot].held = true);
    let mut first: Vec<_> = before.sessions.iter().collect();
    first.sort_by_key(|session| (session.station, session.start));
    first.dedup_by_key(|session| session.station);
    assert!(!first.is_empty());
    // Who has a little time waits.
    problem.robots.iter_mut().for_each(|robot| robot.energy += 2 * robot.drain_hi);
    for session in first {
        let robot = &mut problem.robots[session.robot];
        let gain = problem.batteries[robot.battery].chargers[problem.stations[session.station].charger].curve[0].gain;
        robot.energy -= gain + 2 * robot.drain_hi;
    }
    let mended = replan(&problem, &before.sessions, &[], 5, 1, &mut Moves(0));
    assert_eq!(mended.plan.objective.all(), judged(&problem, &mended.plan));
    assert!(!mended.moved.is_empty());
    let broken: Vec<_> = mended.plan.unserved.iter().filter(|one| problem.robots[one.robot].held).collect();
    assert!(broken.is_empty(), "{broken:?}");
}

#[test]
fn a_robot_that_lasts_a_little_longer_keeps_the_service_that_it_was_promised() {
    let instance = Instance::parse(include_str!("../instances/16-2-1.json")).expect("an instance");
    let before = plan(&instance.problem, "optimise", 1, &mut Moves(20_000)).expect("a plan");
    let charge = |session: &Session| if let Mode::Charge(level) = session.mode { Some((*session, usize::from(level))) } else { None };
    let (promised, level) = before.sessions.iter().find_map(charge).expect("a charge");
    // Whether it keeps its service where that gains so many parts of twelve of what a new one must.
    let keeps = |twelfths: i64, held: bool| {
        let mut problem = instance.problem.clone();
        let battery = problem.battery(promised.robot);
        let (target, gain) = (battery.targets[level], battery.min_gain * twelfths / 12);
        let robot = &mut problem.robots[promised.robot];
        let travel = robot.travel.iter().find(|travel| travel.station == promised.station).expect("in reach");
        robot.energy += target - gain - robot.left_at(travel, promised.start);
        robot.held = held;
        let after = replan(&problem, &before.sessions, &[], 5, 1, &mut Moves(0));
        after.plan.sessions.iter().any(|session| session.robot == promised.robot && session.start == promised.start)
    };
    assert_eq!([13, 11, 7, 5].map(|twelfths| keeps(twelfths, false)), [true, false, false, false]);
    assert_eq!([13, 11, 7, 5].map(|twelfths| keeps(twelfths, true)), [true, true, true, false]);
}
