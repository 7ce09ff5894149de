//! Puts cases to a lab, one by one or many at a time.

use energy::System;
use rayon::prelude::*;

use crate::answer::Answer;
use crate::ask::{Ask, Formula, Question, formula};
use crate::case::{Case, Kind};
use crate::make::make;
use crate::plan::{Entry, plan};
use crate::score::{Mark, judge};

/// Which cases, and how.
#[derive(Debug, Clone, Default)]
pub struct Choice {
    /// Seed of the first place of the plan; each place has the next one.
    pub seed_from: u64,
    /// How many cases at most, spread over the plan; all when none. More than the plan has begin
    /// it again with other seeds.
    pub cases: Option<usize>,
    /// Only cases of this kind.
    pub kind: Option<Kind>,
    /// Only cases of this system.
    pub system: Option<System>,
    /// Only cases whose name contains this.
    pub only: Option<String>,
    /// Where something outside the catalogue is hidden, asks for a formula as well.
    pub formulas: bool,
    /// Many at a time: answers stay the same, times mean nothing.
    pub parallel: bool,
}

/// What became of a case.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The case.
    pub case: Case,
    /// The answer.
    pub answer: Answer,
    /// What it is worth.
    pub mark: Mark,
    /// What a formula makes of it, where one was asked for.
    pub formula: Option<Formula>,
}

/// The chosen places of the plan with their seeds.
#[must_use]
pub fn chosen(choice: &Choice) -> Vec<(Entry, u64)> {
    let plan = plan();
    let wanted = |entry: &Entry| {
        choice.kind.is_none_or(|kind| kind == entry.kind)
            && choice.system.is_none_or(|system| system == entry.system)
            && choice.only.as_ref().is_none_or(|part| entry.name.contains(part))
    };
    let all: Vec<(Entry, u64)> = plan.iter().cloned().zip(choice.seed_from..).filter(|(entry, _)| wanted(entry)).collect();
    let count = choice.cases.unwrap_or(all.len());
    if all.is_empty() || count == all.len() {
        return all;
    }
    if count < all.len() {
        return (0..count).map(|index| all[index * all.len() / count].clone()).collect();
    }
    let again = |index: usize| {
        let (entry, seed) = all[index % all.len()].clone();
        (entry, seed + (index / all.len() * plan.len()) as u64)
    };
    (0..count).map(again).collect()
}

/// Asks about every chosen case. `clock` reads the time that this thread has worked, s.
#[must_use]
pub fn run(choice: &Choice, ask: &Ask<'_>, clock: &(dyn Fn() -> f64 + Sync), each: &(dyn Fn(&Outcome) + Sync)) -> Vec<Outcome> {
    let one = |(entry, seed): (Entry, u64)| {
        let case = make(&entry, seed);
        let question = Question::of(&case);
        let begun_s = clock();
        let json = ask(&question);
        let cpu_s = clock() - begun_s;
        let answer = Answer::read(&json);
        let mark = judge(&case, &answer, cpu_s);
        let formula = if choice.formulas && case.kind == Kind::Outside { formula(&case, &question) } else { None };
        let outcome = Outcome { case, answer, mark, formula };
        each(&outcome);
        outcome
    };
    let chosen = chosen(choice);
    if choice.parallel { chosen.into_par_iter().map(one).collect() } else { chosen.into_iter().map(one).collect() }
}
