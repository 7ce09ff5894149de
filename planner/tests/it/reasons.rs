//! What a robot is told to lack is what it lacks: with just that, and all others as planned, it can be serviced.

use planner::book::Clash;
use planner::draft::Draft;
use planner::problem::{Pack, Problem, Spare};
use planner::reasons::{Obstacle, Why};
use planner::way::Way;
use planner::{Moves, Plan, Ways, plan};
use proptest::prelude::*;

use crate::any;

/// The problem with one thing more at a station; none where nothing there could take it.
fn with(mut problem: Problem, station: usize, lack: Clash) -> Option<Problem> {
    let there = &mut problem.stations[station];
    match lack {
        Clash::Bay(_) => there.bays += 1,
        Clash::Lift(_) => there.lift_slots += 1,
        Clash::Slot(_) => there.swap_slots += 1,
        Clash::Spare(_, kind) => there.spares.push(Spare { ready: 0, kind }),
        Clash::Power(_, short) => there.p_max += short,
        Clash::Energy(_, short) => {
            let switch_cost = there.switch_cost;
            let takes_part = |pack: &&mut Pack| pack.available_from <= 0 && pack.usable() >= switch_cost;
            there.packs.iter_mut().find(takes_part)?.remaining += short;
        }
    }
    Some(problem)
}

/// Whether the robot has a way that is asked for beside the services of a plan that was made for less.
fn finds_a_way(problem: &Problem, plan: &Plan, robot: usize, is_asked: impl Fn(&Way) -> bool) -> bool {
    let ways = Ways::all(problem);
    let mut draft = Draft::new(&ways);
    for session in &plan.sessions {
        let way = ways.of(session.robot).find(session.station, session.start, session.mode).expect("what there was, and more");
        draft.serve(session.robot, way as u32);
    }
    let choices = ways.of(robot);
    choices.ways.iter().filter(|way| is_asked(way)).any(|way| draft.books[usize::from(way.station)].fits(choices, way))
}

/// Whether a robot has any way at a station, however full that is.
fn finds_a_way_at(problem: &Problem, robot: usize, station: usize) -> bool {
    Ways::all(problem).of(robot).ways.iter().any(|way| usize::from(way.station) == station)
}

fn checked(problem: &Problem, seed: u64) -> Result<(), TestCaseError> {
    let plan = plan(problem, "optimise", seed, &mut Moves(300)).expect("a problem that can be planned");
    for unserved in &plan.unserved {
        for Obstacle { station, why } in &unserved.obstacles {
            if let Why::Leaves { away } = why {
                let mut stays = problem.clone();
                let told = std::mem::take(&mut stays.stations[*station].away);
                prop_assert!(told.contains(away));
                prop_assert!(finds_a_way_at(&stays, unserved.robot, *station) && !finds_a_way_at(problem, unserved.robot, *station));
            }
            let Why::Taken { start, mode, lacks, .. } = why else { continue };
            let is_it = |way: &Way| usize::from(way.station) == *station && u32::from(way.start) == *start && way.mode == *mode;
            let mut there = Some(problem.clone());
            for &lack in lacks {
                let Some(richer) = there else { break };
                prop_assert!(!finds_a_way(&richer, &plan, unserved.robot, is_it), "{lacks:?}, but {lack:?} is there");
                there = with(richer, *station, lack);
            }
            if let Some(richer) = there {
                prop_assert!(finds_a_way(&richer, &plan, unserved.robot, is_it), "robot {}: {lacks:?} is not all", unserved.robot);
            }
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn with_what_is_named_there_would_be_a_way(problem in any::problem(), seed in 0_u64..4) {
        checked(&problem, seed)?;
    }

    #[test]
    fn with_what_is_named_packs_would_hold_it_as_surely_as_is_asked(problem in any::doubtful(), seed in 0_u64..4) {
        checked(&problem, seed)?;
    }
}
