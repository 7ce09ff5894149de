//! What a way costs, and what is said where there is none.

use planner::Ways;
use planner::problem::{Robot, Spare, Station};
use planner::reasons::Why;
use planner::{Mode, Moves, plan};

use crate::degenerate::{problem, robot, station};

/// A robot that lasts for 33 ticks and wants a service in tick 10.
fn wants(mission_end: i64) -> Robot {
    Robot { wanted: Some(10), mission_end, ..robot(900) }
}

fn stays() -> Station {
    Station { away: Vec::new(), spares: vec![Spare { ready: 0, kind: 0 }], ..station() }
}

/// By how much each exchange costs more than that a tick before, from when one is wanted on.
fn later_costs(mission_end: i64) -> Vec<i64> {
    let problem = problem(vec![wants(mission_end)], vec![stays()]);
    let ways = Ways::all(&problem);
    let late = ways.of(0).ways.iter().filter(|way| !matches!(way.mode, Mode::Charge(_)) && way.start >= 10);
    let mut costs: Vec<(u16, i64)> = late.map(|way| (way.start, i64::from(way.cost))).collect();
    costs.sort_unstable();
    costs.dedup();
    costs.windows(2).filter(|pair| pair[1].0 == pair[0].0 + 1).map(|pair| pair[1].1 - pair[0].1).collect()
}

#[test]
fn each_tick_that_a_service_is_late_counts_once_whether_or_not_its_work_outlasts_the_mission() {
    for mission_end in [60, 100, 1000] {
        let costs = later_costs(mission_end);
        assert!(costs.len() > 10 && costs.iter().all(|cost| *cost == 1), "mission until {mission_end}: {costs:?}");
    }
}

#[test]
fn who_could_do_without_a_service_and_has_no_time_for_one_is_not_told_that_it_would_cost_too_much() {
    let reason = |horizon: u32| {
        let mut problem = problem(vec![wants(30)], vec![stays()]);
        problem.horizon = horizon;
        let plan = plan(&problem, "optimise", 1, &mut Moves(100)).expect("a plan");
        plan.unserved.first().map(|unserved| (unserved.stranded, unserved.obstacles[0].why.clone()))
    };
    assert_eq!(reason(40), None, "there is time");
    let (stranded, why) = reason(3).expect("nothing ends by then");
    assert!(!stranded && matches!(why, Why::TooLate { .. }), "{why:?}");
}
