//! How many robots charge side by side where a station's converters cannot feed all of its bays at once.
//!
//! Robots that share what the converters give are all charged more slowly, miss more work, and live on the bays meanwhile. So no more are
//! planned side by side than are fed at full current, as long as nobody runs empty for that: who waits for a bay works. Where somebody would,
//! one more at a time is tried, and what loses least is taken.

use std::ops::RangeInclusive;

use planner::optimise;

use super::effort::Effort;
use super::plan::Plan;
use super::problem::View;
use super::solve::{Solved, solve};
use crate::models::Settings;

/// A charge that takes this much longer than that of a robot alone counts as one at full current.
const HARDLY_LONGER: f64 = 0.02;

/// Of so many robots, how many are charged as fast as one alone, when `charge_s` says how long it takes so many.
pub(super) fn fed(most: usize, charge_s: impl Fn(usize) -> f64) -> usize {
    let longest_s = (1.0 + HARDLY_LONGER) * charge_s(1);
    (2..=most).take_while(|&robots| charge_s(robots) <= longest_s).last().unwrap_or(1)
}

/// How many more than are fed at full current come into question, where `most` can: a policy that is told what to do takes in whoever there
/// is a bay for.
#[must_use]
pub fn crowds(settings: &Settings, most: usize) -> RangeInclusive<usize> {
    if settings.policy.name() == optimise::NAME { 0..=most } else { most..=most }
}

/// A whole plan for the first of these views (one at least), which differ in how many robots a station takes in side by side, or for one of
/// the next where somebody would run empty, or lose what was promised.
///
/// # Panics
///
/// Without a view.
#[must_use]
pub fn solve_side_by_side(views: impl IntoIterator<Item = View>, settings: &Settings, before: &Plan) -> Solved {
    let mut plans = views.into_iter().map(|view| solve(view, settings, before, Effort::Whole));
    let mut best = plans.next().expect("somebody asks for a plan of something");
    let serves_all = |plan: &Solved| plan.loss(before) < (0, 1, 0.0);
    while !serves_all(&best)
        && let Some(other) = plans.next()
    {
        if other.loss(before) < best.loss(before) {
            best = other;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 50 W for bays that want 20 W each.
    #[test]
    fn those_are_fed_who_are_charged_as_fast_as_one_alone() {
        let charge_s = |robots: usize| 3600.0 * (20.0 * robots as f64 / 50.0).max(1.0);
        assert_eq!(fed(1, charge_s), 1);
        assert_eq!(fed(2, charge_s), 2);
        assert_eq!(fed(6, charge_s), 2);
        assert_eq!(fed(3, |_| 3600.0), 3, "nothing limits it");
        assert_eq!(fed(3, |robots| 3600.0 * robots as f64), 1, "not even one alone");
    }
}
