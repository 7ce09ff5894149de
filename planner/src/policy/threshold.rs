//! What fleets do today: a robot whose charge falls below a threshold drives to the nearest
//! station, waits for a bay, and charges to a fixed level. First come, first served.

use super::{Policy, with_bound};
use crate::draft::Draft;
use crate::optimise::Budget;
use crate::plan::Plan;
use crate::problem::Problem;
use crate::way::{Mode, Ways};

/// Recharge below this share of the capacity.
const BELOW: f64 = 0.30;
/// To the highest level that is not above this share.
const UP_TO: f64 = 0.90;

/// By the time at which the charge falls below the threshold.
#[derive(Debug)]
pub(super) struct Threshold;

impl Policy for Threshold {
    fn name(&self) -> &'static str {
        "threshold"
    }

    fn plan(&self, ways: &Ways<'_>, _: u64, budget: &mut dyn Budget) -> Plan {
        let problem = ways.problem();
        let mut order: Vec<(i64, usize)> = (0..problem.robots.len()).map(|robot| (due(problem, robot), robot)).collect();
        order.sort_unstable();
        let mut draft = Draft::new(ways);
        for (due, robot) in order {
            if let Some(way) = first_come(&draft, robot, due) {
                draft.serve(robot, way);
            }
        }
        draft.keep();
        with_bound(ways, &draft, budget)
    }
}

/// The tick in which the robot arrives if it sets off when its charge falls below the threshold.
fn due(problem: &Problem, robot: usize) -> i64 {
    let who = &problem.robots[robot];
    let spare = who.energy - (BELOW * problem.battery(robot).capacity as f64) as i64;
    let leaves = if who.drain == 0 { i64::from(problem.horizon) } else { spare.max(0) / who.drain };
    let arrives = leaves + who.travel.iter().map(|travel| i64::from(travel.ticks)).min().unwrap_or(0);
    // A site may have its own threshold.
    arrives.max(i64::from(who.not_before))
}

/// The first free charge at the nearest station from then on.
fn first_come(draft: &Draft<'_, '_>, robot: usize, due: i64) -> Option<u32> {
    let problem = draft.problem();
    let nearest = problem.robots[robot].travel.iter().min_by_key(|travel| (travel.ticks, travel.station))?.station;
    let battery = problem.battery(robot);
    let limit = (UP_TO * battery.capacity as f64) as i64;
    // The lowest level, if there is none below.
    let level = battery.targets.partition_point(|&target| target <= limit).saturating_sub(1);
    let level = level.max(problem.robots[robot].lowest_target);
    let choices = draft.ways.of(robot);
    let wanted = choices
        .ways
        .iter()
        .zip(0..)
        .filter(|(way, _)| usize::from(way.station) == nearest && way.mode == Mode::Charge(level as u8) && i64::from(way.start) >= due);
    let free = wanted.filter(|(way, _)| draft.books[nearest].fits(choices, way));
    free.min_by_key(|(way, _)| way.start).map(|(_, place)| place)
}
