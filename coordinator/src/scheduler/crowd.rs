//! How many robots charge side by side where a station's converters cannot feed all of its bays at once.
//!
//! Robots that share what the converters give are all charged more slowly, miss more work, and live on the bays meanwhile. So no more are
//! planned side by side than are fed at full current, as long as nobody runs empty for that: who waits for a bay works. Where somebody would,
//! one more at a time is tried, as long as that loses less.

use std::ops::RangeInclusive;

use energy::forecast::TIME_MAX_S;

use super::effort::Effort;
use super::plan::Plan;
use super::problem::View;
use super::solve::{Solved, solve};
use crate::models::Settings;

/// A charge that takes this much longer than that of a robot alone counts as one at full current.
const HARDLY_LONGER: f64 = 0.02;

/// How many robots a station's converters charge side by side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fed {
    /// So many as fast as one alone.
    pub full: usize,
    /// Each of these in this time, s.
    pub charge_s: f64,
    /// Up to so many, more of them get more altogether; beyond that, the own loads of those who are added take away more than is given to these.
    pub gaining: usize,
}

impl Fed {
    /// Of at most so many, when `charge_s` says how long it takes each of some.
    pub(super) fn of(most: usize, charge_s: impl Fn(usize) -> f64) -> Self {
        let longest_s = (1.0 + HARDLY_LONGER) * charge_s(1);
        let is_fed = |robots: usize| charge_s(robots) <= longest_s && longest_s < TIME_MAX_S;
        let full = (2..=most).take_while(|&robots| is_fed(robots)).last().unwrap_or(1);
        let per_robot_s = |robots: usize| charge_s(robots) / robots as f64;
        let gains = |robots: usize| per_robot_s(robots) < per_robot_s(robots - 1) && charge_s(robots) < TIME_MAX_S;
        let gaining = (full + 1..=most).take_while(|&robots| gains(robots)).last().unwrap_or(full);
        Self { full, charge_s: charge_s(full), gaining }
    }
}

/// How many more than are fed at full current come into question, where `most` can: a policy that is told what to do takes in whoever there
/// is a bay for.
#[must_use]
pub fn crowds(settings: &Settings, most: usize) -> RangeInclusive<usize> {
    if settings.policy.searches() { 0..=most } else { most..=most }
}

/// A whole plan for the first of these views (one at least), which differ in how many robots a station takes in side by side, or for one of
/// the next where somebody would run empty, or lose what was promised, as long as each of them loses less than the one before.
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
        && let Some(other) = plans.next().filter(|other| other.loss(before) < best.loss(before))
    {
        best = other;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 50 W for bays that want 20 W each, of which each takes so much (W) by itself.
    fn shared_s(own_w: f64) -> impl Fn(usize) -> f64 {
        move |robots| {
            let left_w = (50.0 - own_w * robots as f64).max(0.0) / robots as f64;
            (3600.0 * 20.0 / left_w.min(20.0)).min(TIME_MAX_S)
        }
    }

    #[test]
    fn those_are_fed_who_are_charged_as_fast_as_one_alone() {
        let full = |most: usize, charge_s: &dyn Fn(usize) -> f64| Fed::of(most, charge_s).full;
        assert_eq!([1, 2, 6].map(|most| full(most, &shared_s(0.0))), [1, 2, 2]);
        assert_eq!(full(3, &|_| 3600.0), 3, "nothing limits it");
        assert_eq!(full(3, &|robots| 3600.0 * robots as f64), 1, "not even one alone");
        assert_eq!(full(3, &|_| TIME_MAX_S), 1, "there is nothing for any of them");
    }

    #[test]
    fn beyond_what_is_given_own_loads_only_take() {
        // One takes 20 W of 44, two 38; three share 32, four 26.
        assert_eq!(Fed::of(6, shared_s(6.0)), Fed { full: 1, charge_s: 3600.0, gaining: 2 });
        // One takes 20 W, two are fed 40, three as much as they.
        assert_eq!(Fed::of(6, shared_s(0.0)).full, 2);
        assert_eq!(Fed::of(6, |robots| 3600.0 * (1.0 + robots as f64)).gaining, 6, "each that is added costs the others less than it gets");
    }
}
