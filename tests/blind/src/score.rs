//! Judges one answer. Knows nothing of how the lab comes to it.

use energy::System;

use crate::answer::Answer;
use crate::case::{Bin, Case, Kind, Right};
use crate::class::{class_of, excused, same_class};

/// Classes that an answer may leave open where one effect is hidden, to count as a hit still.
const OPEN_MAX: usize = 3;
/// Half width of a 90 % interval in deviations.
const HALF_WIDTH: f64 = 1.645;

/// What an answer is worth.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// The kind of the case.
    pub kind: Kind,
    /// Its system.
    pub system: System,
    /// How visible the least visible part of what is hidden is.
    pub bin: Bin,
    /// Two effects that are easily taken for one another.
    pub confusable: bool,
    /// The lab's OCV table was wrong.
    pub wrong_ocv: bool,
    /// The answer is right, as the kind of the case asks for it.
    pub right: bool,
    /// The very effects that are hidden are named.
    pub exact: bool,
    /// Named effects that are neither of a hidden one's class nor excused.
    pub wrong: Vec<String>,
    /// Held-out RMS over floor at the end.
    pub holdout_over_floor: f64,
    /// The same over what the truth itself would leave, told what the lab is told.
    pub holdout_over_told: f64,
    /// Estimates of truly hidden effects' parameters: how many, and in how many of them the 90 %
    /// interval holds the truth.
    pub covered: (usize, usize),
    /// Time that the lab took, s.
    pub cpu_s: f64,
}

/// Judges an answer.
#[must_use]
pub fn judge(case: &Case, answer: &Answer, cpu_s: f64) -> Mark {
    let bin = case.truth.leaves().bin();
    let wrong = wrong_names(case, answer);
    let (right, exact) = match &case.truth.right {
        Right::Complete => (clean(answer), clean(answer)),
        Right::Unknown { .. } => (answer.verdict == "unknown" && wrong.is_empty(), answer.verdict == "unknown"),
        Right::Set { must, may, .. } => {
            let right = is_set(case, answer, must, may);
            (right, right)
        }
        Right::Effects(hidden) => {
            let ids: Vec<&str> = hidden.iter().map(|hidden| hidden.id).collect();
            (ids.iter().all(|id| hits(case.system, answer, id)), ids.iter().all(|id| answer.selected.iter().any(|named| named == id)))
        }
        Right::AnyOf { any, .. } => {
            let right = any.iter().any(|id| hits(case.system, answer, id));
            (right, right)
        }
    };
    // The sensor's own floor, whatever the lab counts to it.
    let holdout_over_floor = answer.main_holdout(case.system) / case.main_floor();
    Mark {
        kind: case.kind,
        system: case.system,
        bin,
        confusable: case.truth.confusable,
        wrong_ocv: case.truth.wrong_ocv,
        right: answered(answer) && right,
        exact: answered(answer) && exact,
        holdout_over_floor,
        holdout_over_told: holdout_over_floor / case.truth.told_over_floor,
        covered: coverage(case, answer),
        wrong,
        cpu_s,
    }
}

/// Whether there is a verdict at all.
fn answered(answer: &Answer) -> bool {
    ["complete", "missing", "ambiguous", "unknown"].contains(&answer.verdict.as_str())
}

/// Whether the answer says that nothing is missing.
fn clean(answer: &Answer) -> bool {
    answer.verdict == "complete" && answer.selected.is_empty()
}

/// Whether a hidden effect's class is named, or is one of a few that are left open.
fn hits(system: System, answer: &Answer, id: &str) -> bool {
    let named = answer.selected.iter().any(|named| same_class(system, named, id));
    let mut open: Vec<&str> = answer.equivalent.iter().map(|id| class_of(system, id)).collect();
    open.sort_unstable();
    open.dedup();
    let left_open = answer.verdict == "ambiguous" && open.len() <= OPEN_MAX && open.contains(&class_of(system, id));
    named || left_open
}

/// Whether exactly the effects that cannot be told are named as such, with an experiment. The
/// set may stand in `equivalent` alone, or with the one that was selected from it.
fn is_set(case: &Case, answer: &Answer, must: &[&str], may: &[&str]) -> bool {
    let named = |id: &str| answer.equivalent.contains(id) || answer.selected.iter().any(|named| named == id);
    let allowed = |id: &String| must.contains(&id.as_str()) || may.contains(&id.as_str());
    // Nothing of these logs asks for an answer where nothing is left to be seen.
    let seen = case.truth.leaves().bin() != Bin::Below;
    let is = answer.verdict == "ambiguous"
        && must.iter().all(|id| named(id))
        && answer.equivalent.iter().chain(&answer.selected).all(allowed)
        && !answer.experiment.is_empty();
    if seen { is } else { wrong_names(case, answer).is_empty() }
}

/// Named effects that the truth does not excuse. A set that holds the truth names nothing.
fn wrong_names(case: &Case, answer: &Answer) -> Vec<String> {
    let system = case.system;
    let accepted = |named: &str| match &case.truth.right {
        Right::Complete => false,
        Right::Unknown { may, .. } => may.contains(&named),
        Right::Effects(hidden) => hidden.iter().any(|h| same_class(system, h.id, named) || excused(system, h.id, named)),
        Right::AnyOf { any, may, .. } => any.iter().any(|id| same_class(system, id, named)) || may.contains(&named),
        Right::Set { must, may, .. } => must.contains(&named) || may.contains(&named),
    };
    let open = answer.verdict == "ambiguous" && !answer.equivalent.is_empty();
    let holds_the_truth = open && answer.equivalent.iter().any(|id| accepted(id));
    // One of a set stands for it in `selected`: the answer does not say that it is this one.
    let stands_for_the_truth = |named: &String| holds_the_truth && answer.equivalent.contains(named);
    let named = answer.selected.iter().filter(|named| !accepted(named) && !stands_for_the_truth(named));
    let mut wrong: Vec<String> = named.cloned().collect();
    // A set without the truth in it misleads as one wrong name does.
    if open && !holds_the_truth {
        wrong.push(answer.equivalent.iter().cloned().collect::<Vec<_>>().join("|"));
    }
    wrong
}

/// How many estimates of hidden effects' parameters there are, and how many intervals hold the
/// truth. Only where the very effect was named does its estimate mean anything, and only where
/// nothing else is named wrongly or hidden in another form is it the lab's to get right.
fn coverage(case: &Case, answer: &Answer) -> (usize, usize) {
    let off = deviations(case, answer);
    (off.len(), off.iter().filter(|(.., deviations)| deviations.abs() <= HALF_WIDTH).count())
}

/// How far the estimates of hidden effects' parameters lie from the truth: effect, parameter,
/// truth, estimate, and the difference in deviations.
#[must_use]
pub fn deviations(case: &Case, answer: &Answer) -> Vec<(&'static str, &'static str, f64, f64, f64)> {
    let Right::Effects(hidden) = &case.truth.right else { return Vec::new() };
    let mut all = Vec::new();
    for hidden in hidden.iter().filter(|hidden| answer.selected.iter().any(|named| named == hidden.id)) {
        for &(name, truth) in &hidden.parameters {
            let estimate = answer.parameters.iter().find(|(effect, parameter, ..)| effect == hidden.id && parameter == name);
            if let Some(&(.., value, sigma)) = estimate.filter(|(.., sigma)| *sigma > 0.0) {
                all.push((hidden.id, name, truth, value, (value - truth) / sigma));
            }
        }
    }
    all
}
