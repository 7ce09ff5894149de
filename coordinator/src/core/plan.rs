//! When to plan, how much of the plan, and what follows from a new one.
//!
//! A small fleet is planned as a whole at once. Of a large one a plan is mended at once, and planned anew
//! beside the core: what has changed by the time that is done is mended into it.

use std::collections::BTreeSet;
use std::sync::Arc;

use proto::{EventKind, RobotId, Schedule, StationId, Timestamp};

use super::study::Study;
use super::{Core, Output};
use crate::answers;
use crate::counted::counted;
use crate::scheduler::{Effort, Plan, Solved, View, WHOLE_FLEET_MAX, crowds, solve, solve_side_by_side};
use crate::store::Record;
use crate::view::Basis;
use crate::when::second_from;

/// The trigger of a plan that nothing but the clock asked for.
const TIME_PASSED: &str = "time passed";

/// So many are named for whom the first plan waits.
const SILENT_NAMED: usize = 5;

/// Shortest time between two plans, s: a burst of news is one trigger. It is several times what a plan of
/// a small fleet takes, and what a mended plan of a large one takes.
const APART_S: f64 = 1.0;
const MENDED_APART_S: f64 = 0.1;
/// Mended plans that may follow each other at once, where there were fewer before.
const MENDED_AT_ONCE: usize = 5;

impl Core {
    /// Asks for a plan. Of several reasons the first is told; that time has passed is none beside what happened,
    /// for which a large fleet's plan is mended at once.
    pub(super) fn replan(&mut self, why: String) {
        if self.trigger.as_deref().is_none_or(|known| known == TIME_PASSED) {
            self.trigger = Some(why);
        }
    }

    /// A plan is due when something happened or the last whole one is old; the first waits until everybody has spoken who is configured, or was
    /// promised something by the coordinator before, but not for ever.
    pub(super) fn plan_due(&mut self, now: Timestamp) -> bool {
        if self.planned.is_none() {
            return self.trigger.is_some() && (now >= self.waits_until(now) || self.silent().next().is_none());
        }
        if self.is_old(now) {
            self.replan(TIME_PASSED.to_owned());
        }
        let mended = self.is_large();
        let (apart_s, at_once) = if mended { (MENDED_APART_S, MENDED_AT_ONCE) } else { (APART_S, 1) };
        let first = self.lately.iter().rev().nth(at_once - 1);
        self.trigger.is_some() && first.is_none_or(|first| now.seconds_since(*first) >= apart_s * at_once as f64)
    }

    /// Until when the first plan waits for all who are configured.
    fn waits_until(&self, now: Timestamp) -> Timestamp {
        self.started.unwrap_or(now).plus_s(self.settings.patience_s)
    }

    /// Who is configured, or was promised something, and has not said yet how it stands.
    fn silent(&self) -> impl Iterator<Item = &str> {
        let stations = self.models.stations.keys().filter(|id| self.fleet.stations.get(id).is_none_or(|one| one.known().is_none()));
        let robots = self.models.robots.keys().filter(|id| self.fleet.robots.get(id).is_none_or(|one| one.known().is_none()));
        let promised = self.silent_promised().filter(|id| !self.models.robots.contains_key(*id));
        stations.map(StationId::as_str).chain(robots.chain(promised).map(RobotId::as_str))
    }

    /// Says in the place of a plan for whom the first one waits.
    pub(super) fn tell_whom_it_waits_for(&mut self, now: Timestamp) {
        let trigger = waits_for(now, &self.silent().collect::<Vec<_>>(), self.waits_until(now));
        self.tell_in_place_of_a_plan(trigger);
    }

    fn tell_in_place_of_a_plan(&mut self, trigger: String) {
        if self.schedule.plan == 0 && self.schedule.trigger != trigger {
            self.schedule = Arc::new(Schedule { trigger, ..Schedule::clone(&self.schedule) });
        }
    }

    /// Whether plans of this fleet are mended, and made beside the core.
    fn is_large(&self) -> bool {
        self.plan.robots().count() > WHOLE_FLEET_MAX
    }

    /// A plan is made now.
    fn plans(&mut self, now: Timestamp) {
        self.planned = Some(now);
        self.lately.push_back(now);
        if self.lately.len() > MENDED_AT_ONCE {
            self.lately.pop_front();
        }
    }

    /// Whether everything is to be planned anew because nobody has for so long.
    fn is_old(&self, now: Timestamp) -> bool {
        self.studying.is_none() && self.renewed.is_none_or(|renewed| now.seconds_since(renewed) >= self.settings.replan_period_s)
    }

    pub(super) fn make_plan(&mut self, now: Timestamp) {
        let trigger = self.trigger.take().unwrap_or_default();
        let view = self.basis(now).view();
        let needed = Effort::needed(&view, self.plan_before(), &self.settings);
        let effort = if self.is_old(now) { Effort::Whole } else { needed };
        if effort == Effort::Whole && Effort::takes_long(&view, &self.settings) {
            self.study(now, view, trigger, needed);
            return;
        }
        if effort == Effort::Whole {
            self.renewed = Some(now);
        }
        self.plans(now);
        let solved = match effort {
            Effort::Whole => solve_side_by_side(self.views(now, view), &self.settings, self.plan_before()),
            Effort::Mend => solve(view, &self.settings, self.plan_before(), effort),
        };
        self.take_plan(now, solved, trigger, effort);
    }

    /// What is believed, as one view for each number of robots that may be taken in side by side, the fewest first. One of these views is
    /// `known` already and not made again: that takes long for a large fleet.
    fn views(&self, now: Timestamp, known: View) -> impl Iterator<Item = View> {
        let (crowds, mut known) = (crowds(&self.settings, self.basis(now).crowd_max()), Some(known));
        let made = move |crowd| Basis { crowd, ..self.basis(now) }.view();
        crowds.map(move |crowd| known.take_if(|known| known.crowd == crowd).unwrap_or_else(|| made(crowd)))
    }

    /// Has a whole plan made beside the core.
    fn study(&mut self, now: Timestamp, view: View, trigger: String, needed: Effort) {
        if self.studying.is_some() {
            // More robots are new than can be mended in: they come into the next study.
            self.plans(now);
            self.trigger = Some(trigger);
            return;
        }
        self.renewed = Some(now);
        self.tell_in_place_of_a_plan("the first plan is being made".to_owned());
        // The first plan is on its way.
        self.planned.get_or_insert(now);
        let study = Arc::new(Study::new(self.views(now, view.clone()).collect(), self.settings, self.plan_before().clone()));
        self.outputs.push_back(Output::Study(Arc::clone(&study)));
        self.studying = Some((study, trigger.clone()));
        // What happened cannot wait that long.
        if needed == Effort::Mend && trigger != TIME_PASSED {
            self.plans(now);
            let solved = solve(view, &self.settings, self.plan_before(), Effort::Mend);
            self.take_plan(now, solved, trigger, Effort::Mend);
        }
    }

    /// Takes in a whole plan that was made beside the core, with what has changed since; false when none was
    /// asked for.
    pub(super) fn studied(&mut self, now: Timestamp) -> bool {
        let Some((study, trigger)) = self.studying.take() else { return false };
        let whole = study.run().plan.clone().with_newer(&self.plan);
        let mut view = Basis { crowd: whole.crowd, ..self.basis(now) }.view();
        let settings = &self.settings;
        if Effort::takes_long(&view, settings) && Effort::needed(&view, &whole, settings) == Effort::Whole {
            let known: BTreeSet<&RobotId> = whole.robots().collect();
            view.robots.retain(|robot| known.contains(&robot.robot));
            self.replan("many robots joined".to_owned());
        }
        let mut solved = solve(view.clone(), &self.settings, &whole, Effort::Mend);
        // What was promised meanwhile is not broken for a plan that did not know of it.
        let broken = |plan: &Plan| plan.rejected.iter().filter(|rejected| self.promised.contains(&rejected.robot)).count();
        if broken(&solved.plan) > 0 {
            let mended = solve(view, &self.settings, &self.plan, Effort::Mend);
            if broken(&mended.plan) < broken(&solved.plan) {
                solved = mended;
            }
        }
        solved.plan.moved = solved.plan.moved_from(self.plan_before());
        self.take_plan(now, solved, trigger, Effort::Whole);
        true
    }

    /// Puts a new plan in force.
    fn take_plan(&mut self, now: Timestamp, mut solved: Solved, trigger: String, effort: Effort) {
        self.plan = std::mem::take(&mut solved.plan);
        self.solved = Some(solved);
        let number = self.numbering.plan;
        self.numbering.plan += 1;
        let schedule = Arc::new(answers::schedule(&self.basis(now), &self.plan, number, trigger));
        for service in &schedule.services {
            self.promised.insert(service.robot.clone());
        }
        for unserved in &schedule.unserved {
            if self.promised.remove(&unserved.robot) {
                let why = unserved.reasons.join("; ");
                self.event(now, EventKind::PromiseBroken, Some(&unserved.robot), None, None, format!("{}: {why}", unserved.robot));
            }
        }
        self.settle_promises(&schedule);
        self.gave_up_waiting = false;
        let empty = |schedule: &Schedule| schedule.unserved.iter().filter(|unserved| unserved.runs_empty).count();
        let said = |schedule: &Schedule| (schedule.services.len(), schedule.unserved.len(), empty(schedule));
        if said(&schedule) != said(&self.schedule) || self.schedule.plan == 0 {
            let (services, unserved, empty) = said(&schedule);
            let of_these = match empty {
                0 => String::new(),
                1 => ", 1 of whom runs empty".to_owned(),
                _ => format!(", {empty} of whom run empty"),
            };
            let text = format!("plan {number}: {}, {unserved} unserved{of_these} ({})", counted(services, "service"), schedule.trigger);
            self.event(now, EventKind::PlanMade, None, None, None, text);
        }
        self.note_changes(&schedule, effort);
        self.record(Record::Plan(Arc::clone(&schedule)));
        self.schedule = schedule;
        if effort == Effort::Whole {
            self.shed(now);
        }
        // Of a large fleet that is told with the next tick: who joins meanwhile does not wait for it.
        if effort == Effort::Whole && !self.is_large() {
            self.tell_capacity(now);
        }
    }

    /// Keeps what is different for each robot, and which message brought it about. A plan that was only
    /// mended changes little for the others.
    fn note_changes(&mut self, new: &Schedule, effort: Effort) {
        let changes = answers::changes(&self.schedule, new);
        self.untold.plan(changes.iter().map(|(robot, _)| robot));
        if effort == Effort::Whole {
            self.untold.plan_of_all(self.fleet.robots.keys());
        }
        self.changed.extend(changes.into_iter().map(|(robot, text)| (robot, vec![text])));
    }

    fn tell_capacity(&mut self, now: Timestamp) {
        self.untold.capacity_told(now);
        self.record(Record::Capacity(self.capacity(now)));
    }

    /// What packs can still service, and why robots are serviced as they are, for those who ask when no
    /// coordinator answers.
    pub(super) fn tell_answers(&mut self, now: Timestamp) {
        if self.untold.capacity_due(now) {
            self.tell_capacity(now);
            // Of a large fleet each of the two takes long: one at a time.
            if self.is_large() {
                return;
            }
        }
        let now_told = self.untold.robots();
        if !now_told.is_empty() {
            let told = self.explain_all(now, now_told.iter());
            self.record(Record::Explanations(told.into_iter().flatten().collect()));
        }
    }

    pub(super) fn refresh_schedule(&mut self, now: Timestamp) {
        let (number, trigger) = (self.schedule.plan, self.schedule.trigger.clone());
        self.schedule = Arc::new(answers::schedule(&self.basis(self.planned.unwrap_or(now)), &self.plan, number, trigger));
    }
}

/// What stands in the place of a plan while the first one waits for these.
fn waits_for(now: Timestamp, silent: &[&str], until: Timestamp) -> String {
    let until = if silent.is_empty() || now >= until { String::new() } else { format!(", until {} at most", second_from(now, until)) };
    match (silent, silent.len().saturating_sub(SILENT_NAMED)) {
        ([], _) => "nobody has spoken yet".to_owned(),
        (all, 0) => format!("waits for {}{until}", all.join(", ")),
        (all, more) => format!("waits for {} and {more} more{until}", all[..SILENT_NAMED].join(", ")),
    }
}
