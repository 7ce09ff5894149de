//! A second plan, with what packs give beyond what was counted.
//!
//! Counted at full power in every bay, packs give less than they do to most plans. Where somebody is left out, the packs are
//! stepped along the load of the plan and on at its mean power, and it is planned once more with what they gave. That plan is taken
//! if it leaves out less and every new promise, stepped along its own load, is as certain as is asked.
//!
//! Where unlike robots come, a load can also be heavier than was counted: a plan whose new promises are then less certain than is asked is made
//! again with less.

use std::collections::{BTreeMap, BTreeSet};

use energy::Estimate;
use planner::Session;
use proto::RobotId;
use statrs::distribution::{ContinuousCDF, Normal};

use super::cover::Cover;
use super::plan::{Plan, Planned};
use super::problem::{PackState, View};
use super::solve::Solved;
use super::translate::KEEP_CONFIDENCE;

/// Less than this is not worth another plan, Wh.
const WORTH_IT_WH: f64 = 0.05;
/// Deviations by which less is counted on, again and again, where what the packs were counted to hold is less sure once they are stepped: so small
/// that a plan that is sure is not passed over, as often as it takes to be as sure as most are asked for.
const LESS_SIGMAS: f64 = 0.1;

/// Whoever is less sure than this lacks energy, and no deviation says how much.
const LEAST_SURE: f64 = 1e-9;

/// The view of a plan with what it shows not to have been counted, at all stations but some; none where that is nothing.
pub(super) fn with_the_uncounted(solved: &Solved, but: &BTreeSet<usize>) -> Option<View> {
    let task = &solved.task;
    let mut view = task.view.clone();
    let mut is_more = false;
    for (index, station) in view.stations.iter_mut().enumerate().filter(|(index, _)| !but.contains(index)) {
        let here: Vec<&Session> = solved.sessions.iter().filter(|session| session.station == index).collect();
        let more_wh = Cover::new(task, index, &here).uncounted_wh().filter(|more_wh| *more_wh > WORTH_IT_WH);
        let last = station.packs.iter_mut().rfind(|pack| pack.available_s <= 0.0);
        if let (Some(more_wh), Some(last)) = (more_wh, last) {
            // A pack that gives nothing at full power is not certain to give so much to less.
            let charge_wh = last.state.as_ref().map_or(0.0, PackState::sigma_wh);
            last.usable_wh = Estimate::new(last.usable_wh.value + more_wh, last.usable_wh.sigma.max(charge_wh));
            last.uncounted_wh = more_wh;
            is_more = true;
        }
    }
    is_more.then_some(view)
}

/// Robots that a plan promises anything new that is less certain than is asked, or what was promised less certainly than that
/// and than the plan that counts no more, or than promises must be to be kept.
pub(super) fn unsure(plan: &Plan, counted: &Plan, before: &Plan, confidence: f64) -> BTreeSet<RobotId> {
    let promised: BTreeSet<&RobotId> = before.planned.iter().map(|planned| &planned.robot).collect();
    let covered: BTreeMap<&RobotId, f64> = counted.planned.iter().map(|planned| (&planned.robot, planned.covered)).collect();
    let asked = |robot: &RobotId| match promised.contains(robot) {
        false => confidence,
        true => covered.get(robot).map_or(KEEP_CONFIDENCE, |counted| counted.min(confidence)),
    };
    let unsure = plan.planned.iter().filter(|planned| planned.covered < asked(&planned.robot));
    unsure.map(|planned| planned.robot.clone()).collect()
}

/// Counts on less, by so many deviations of what is left in the end, at the stations of those who are unsure; `sigmas` tells how many, where the
/// least sure of them is covered so surely.
pub(super) fn count_less(view: &mut View, plan: &Plan, unsure: &BTreeSet<RobotId>, sigmas: impl Fn(f64) -> f64) {
    for station in &mut view.stations {
        let here: Vec<&Planned> = plan.planned.iter().filter(|planned| planned.station == station.station).collect();
        let unsure = here.iter().filter(|planned| unsure.contains(&planned.robot)).map(|planned| planned.covered);
        let Some(least_sure) = unsure.reduce(f64::min) else { continue };
        let need = here.iter().fold(station.committed.clone(), |sum, planned| sum.plus(&planned.need)).estimate();
        let held = station.packs.iter().map(|pack| pack.usable_wh.sigma.powi(2)).sum::<f64>().sqrt();
        let mut less_wh = sigmas(least_sure) * need.sigma.hypot(held);
        // What is there first: what comes later does not help whoever is unsure before.
        let (there, later): (Vec<_>, Vec<_>) = station.packs.iter_mut().rev().partition(|pack| pack.available_s <= 0.0);
        for pack in there.into_iter().chain(later) {
            let of_pack = less_wh.min(pack.usable_wh.value.max(0.0));
            pack.usable_wh.value -= of_pack;
            less_wh -= of_pack;
        }
    }
}

/// By a small step, again and again.
pub(super) fn a_little(_covered: f64) -> f64 {
    LESS_SIGMAS
}

/// By what is lacking to be as sure as is asked for, and a small step.
pub(super) fn as_is_lacking(confidence: f64) -> impl Fn(f64) -> f64 {
    let quantile = |sure: f64| Normal::standard().inverse_cdf(sure.max(LEAST_SURE));
    move |covered| (quantile(confidence) - quantile(covered)).max(0.0) + LESS_SIGMAS
}
