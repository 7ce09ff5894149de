//! A plan that is mended keeps its other promises.

use planner::{Instance, Moves, plan, replan};

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
