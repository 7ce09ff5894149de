//! What else there was for a robot, and what would have to change.

use std::collections::BTreeMap;

use planner::problem::Tick;
use planner::{Explained, Explainer, Mode, Session, Ways, explain::Other};
use proto::{RobotId, StationId, Timestamp};

use super::{clash_in_words, list, on_clock};
use crate::scheduler::translate::Task;

/// What can be told of a robot's place in a plan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Account {
    /// Why not earlier.
    pub earlier: Vec<String>,
    /// What it lacks when it is wanted, where it comes before.
    pub when_wanted: Option<String>,
    /// What else there was, the best first.
    pub others: Vec<Alternative>,
}

/// Another way to service a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// Where.
    pub station: StationId,
    /// `recharge` or `swap`.
    pub mode: &'static str,
    /// When it could begin; none when it cannot be had.
    pub start: Option<Timestamp>,
    /// Why it is worse, or what stands in its way.
    pub why_not: Vec<String>,
}

/// A plan of which one can ask for every robot what else there was, and why its service does not come
/// earlier. Opening it takes as long as a few robots' answers: it serves for all of them.
#[derive(Debug)]
pub struct Accounts<'w, 'p> {
    task: &'p Task,
    ways: &'w Ways<'p>,
    explainer: Explainer<'w, 'p>,
    sessions: BTreeMap<usize, Session>,
    robots: BTreeMap<&'p RobotId, usize>,
}

impl<'w, 'p> Accounts<'w, 'p> {
    /// Opens the plan of these sessions; `ways` are those of the task's problem.
    #[must_use]
    pub fn new(task: &'p Task, ways: &'w Ways<'p>, sessions: &[Session]) -> Self {
        Self {
            task,
            ways,
            explainer: Explainer::new(ways, sessions),
            sessions: sessions.iter().map(|session| (session.robot, *session)).collect(),
            robots: task.view.robots.iter().enumerate().map(|(index, view)| (&view.robot, index)).collect(),
        }
    }

    /// What can be told of a robot; nothing of one that the plan did not concern.
    pub fn of(&mut self, robot: &RobotId) -> Account {
        let Some(&index) = self.robots.get(robot) else { return Account::default() };
        let Explained { cost, others, earlier, later, .. } = self.explainer.explain(index);
        let session = self.sessions.get(&index);
        let others = others.iter().map(|other| alternative(self.task, index, session, other, cost));
        // Who has no service is told of these as reasons.
        let closed =
            session.into_iter().flat_map(|_| self.task.view.robots[index].closed.iter().map(|closed| takes_no_part(self.task, closed)));
        Account {
            others: others.chain(closed).collect(),
            earlier: session.map_or_else(Vec::new, |session| vec![self.why_not_earlier(session, earlier.as_ref())]),
            when_wanted: later.filter(|other| !other.lacks.is_empty()).map(|other| {
                format!("at {}, nearer to when it is wanted: {}", on_clock(self.task, other.start), lacks_in_words(self.task, &other))
            }),
        }
    }

    /// What would have to change for a robot to be serviced earlier.
    fn why_not_earlier(&self, session: &Session, earlier: Option<&Other>) -> String {
        let task = self.task;
        let (robot, view) = (&task.problem.robots[session.robot], &task.view.robots[session.robot]);
        let in_time = robot.in_time(session.station);
        match earlier {
            Some(other) if other.lacks.is_empty() => {
                let more_s = task.work_s(other.cost - self.cost_of(session));
                let why = if more_s < 0.0 { not_taken(task, session.robot) } else { "that is no gain" };
                format!("it could begin at {}, and would miss {}: {why}", on_clock(task, other.start), missed(more_s))
            }
            Some(other) => format!("to begin at {} instead: {}", on_clock(task, other.start), lacks_in_words(task, other)),
            None if session.start <= in_time && robot.wanted == Some(in_time) && in_time > 0 => {
                let at = on_clock(task, in_time);
                if view.is_hurried {
                    format!("no: it is wanted at {at}, while a tenth of the time is left until it may be empty")
                } else {
                    format!("no: it is wanted at {at}, when its charge falls to where [policy] serve_below_soc has it")
                }
            }
            None => self.what_it_waits_for(session, in_time),
        }
    }

    /// Why there is no earlier way at all.
    fn what_it_waits_for(&self, session: &Session, in_time: Tick) -> String {
        let task = self.task;
        let (robot, station) = (&task.problem.robots[session.robot], &task.problem.stations[session.station]);
        let travel = robot.travel.iter().find(|travel| travel.station == session.station);
        let there = travel.map_or(session.start, |travel| travel.ticks).max(robot.not_before);
        let soonest = travel.map_or(session.start, |travel| task.problem.soonest(travel)).max(robot.not_before);
        let name = &station.name;
        let away = station.away.iter().rev().find(|away| away.end > in_time && away.end <= session.start);
        match away {
            Some(away) => format!("no: {name} is away until {}", on_clock(task, away.end)),
            None if soonest > there => format!("no: {name} takes robots in from {} on", on_clock(task, soonest)),
            None if session.start > soonest && task.problem.strands(session.robot) => {
                "no: the robot would have too much charge left for a service to add enough".to_owned()
            }
            None if session.start > soonest => "no: it would add too little, or cost more work than it gives".to_owned(),
            None if soonest > travel.map_or(0, |travel| travel.ticks) => format!("no: it is not asked before {}", on_clock(task, soonest)),
            None => "no: the robot is on its way as soon as it can be".to_owned(),
        }
    }

    fn cost_of(&self, session: &Session) -> i64 {
        let choices = self.ways.of(session.robot);
        let way = choices.find(session.station, session.start, session.mode);
        way.map_or(i64::from(choices.unserved_cost), |way| i64::from(choices.ways[way].cost))
    }
}

fn alternative(task: &Task, robot: usize, session: Option<&Session>, other: &Other, cost: i64) -> Alternative {
    let is_charge = matches!(other.mode, Mode::Charge(_));
    // A robot that strands beside a way that counts as free: the packs were stepped, and are not sure enough. Other policies do not step
    // them, and have reasons of their own.
    let is_unsure = session.is_none() && task.problem.strands(robot) && task.policy.searches();
    let is_free = other.lacks.is_empty() && !is_unsure;
    let beyond = match () {
        () if !other.lacks.is_empty() => lacks_in_words(task, other),
        () if is_unsure => "the packs are not sure enough to last for it".to_owned(),
        () => {
            let more_s = task.work_s(other.cost - cost);
            let but = if more_s < 0.0 { format!(": {}", not_taken(task, robot)) } else { String::new() };
            let also = match other.mode {
                mode @ Mode::Charge(_) if mode != task.full_charge() => format!(", charges it to {:.0} %", task.to_soc(mode) * 100.0),
                Mode::Swap if task.view.stations[other.station].charges_spares => ", leaves its pack uncharged".to_owned(),
                _ => String::new(),
            };
            format!("it would miss {}{also} and takes {:.1} Wh{but}", missed(more_s), task.problem.wh(other.energy))
        }
    };
    Alternative {
        station: task.view.stations[other.station].station.clone(),
        mode: if is_charge { "recharge" } else { "swap" },
        start: is_free.then(|| task.grid.time(other.start)),
        why_not: vec![beyond],
    }
}

/// A station that the robot could reach and that takes no part, or not for it.
fn takes_no_part(task: &Task, (station, why): &(StationId, String)) -> Alternative {
    let known = task.view.stations.iter().find(|view| view.station == *station);
    let exchanges = known.is_some_and(|view| view.bays.is_empty() && !view.spares.is_empty());
    let mode = if exchanges { "swap" } else { "recharge" };
    Alternative { station: station.clone(), mode, start: None, why_not: vec![why.clone()] }
}

/// Why what is better by itself is not chosen: the planner weighs what it moves (`planner::replan`), or its search has not come by.
fn not_taken(task: &Task, robot: usize) -> &'static str {
    match task.policy.searches() {
        true if task.view.robots[robot].held => "too little to move a service for that was told already",
        true => "the search did not come by it",
        false => "the policy goes by a rule of its own",
    }
}

fn missed(more_s: f64) -> String {
    format!("{:.1} min {} of work", more_s.abs() / 60.0, if more_s < 0.0 { "less" } else { "more" })
}

/// All that another way lacks, and for whom it is planned.
fn lacks_in_words(task: &Task, other: &Other) -> String {
    let lacks = other.lacks.iter().map(|&clash| clash_in_words(task, other.station, (other.start, other.mode), clash));
    let lacks: Vec<String> = lacks.collect();
    let names = other.blockers.iter().map(|&robot| task.view.robots[robot].robot.as_ref());
    let by = if other.blockers.is_empty() { String::new() } else { format!(", planned for {}", list(names, "")) };
    format!("{}{by}", lacks.join(", and "))
}
