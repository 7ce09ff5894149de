//! A plan in the fleet's terms: every robot serviced, or with the reasons why not.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use energy::Need;
use energy::units::S_PER_H;
use planner::book::Clash;
use planner::reasons::Why;
use planner::{Levels, Mode, Session};
use proto::{BayId, PackId, RobotId, SpareId, StationId, Timestamp};

use super::cover::Cover;
use super::problem::{SpareView, StationView};
use super::translate::{HORIZON_MAX_S, Task};
use super::words::{self, Grounds};

/// A plan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// Services, in order of start.
    pub planned: Vec<Planned>,
    /// Robots without one.
    pub rejected: Vec<Rejected>,
    /// Robots that the plan before had promised another service, or one at all.
    pub moved: Vec<RobotId>,
    /// What it amounts to.
    pub quality: Quality,
    /// So many robots more than the converters feed at full current charge side by side in it ([`super::View::crowd`]).
    pub crowd: usize,
}

/// A planned service.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The robot.
    pub robot: RobotId,
    /// Where.
    pub station: StationId,
    /// How, as the planner calls it.
    pub mode: Mode,
    /// The bay, for a recharge.
    pub bay: Option<BayId>,
    /// The spare, for an exchange.
    pub spare: Option<SpareId>,
    /// Level at which a recharge is done.
    pub to_soc: f64,
    /// When the robot leaves its work.
    pub leave: Timestamp,
    /// When the service begins.
    pub start: Timestamp,
    /// When the robot is let go.
    pub end: Timestamp,
    /// Energy from the station's packs.
    pub need: Need,
    /// Packs that pay, in order.
    pub packs: Vec<PackId>,
    /// Probability that the packs hold enough for all that is drawn until it ends, also by services beside it, and
    /// that the robot lasts until then where that is not sure enough.
    pub probability: f64,
    /// That the packs hold enough until it ends, and until all ends that has begun.
    pub covered: f64,
    /// Why so.
    pub why: Arc<[String]>,
    /// The figures in that: as long as they stay the same, so do the words.
    pub grounds: Grounds,
}

/// A robot without a service.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejected {
    /// The robot.
    pub robot: RobotId,
    /// Whether it runs empty.
    pub stranded: bool,
    /// Why: one reason per station in reach, if there is any.
    pub reasons: Vec<String>,
    /// The station whose packs are short of least for it, and of how much, Wh, where it lacks nothing else there.
    pub short: Option<(StationId, f64)>,
}

/// What a plan amounts to, and what is proven about it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quality {
    /// Robots that run empty.
    pub stranded: i64,
    /// No plan strands fewer.
    pub stranded_bound: i64,
    /// Work that is missed, weighted, s.
    pub missed_s: f64,
    /// No plan that strands as few misses less, s.
    pub missed_bound_s: f64,
}

impl Quality {
    /// Takes back what is proven beyond what another plan has proven of a problem that offers somebody else's spares.
    pub fn no_more_is_proven_than(&mut self, other: Self) {
        self.stranded_bound = self.stranded_bound.min(other.stranded_bound);
        self.missed_bound_s = self.missed_bound_s.min(other.missed_bound_s);
    }
}

/// The station whose packs are short of least for a robot that lacks nothing else there, and of how much, Wh.
fn least_short(task: &Task, unserved: &planner::Unserved) -> Option<(StationId, f64)> {
    let of = |obstacle: &planner::reasons::Obstacle| match &obstacle.why {
        Why::Taken { lacks, .. } => match lacks.as_slice() {
            [Clash::Energy(_, short)] => Some((*short, obstacle.station)),
            _ => None,
        },
        _ => None,
    };
    let (short, station) = unserved.obstacles.iter().filter_map(of).min()?;
    Some((task.view.stations[station].station.clone(), task.problem.wh(short)))
}

impl Plan {
    /// The planner's plan in the fleet's terms. Who has no service as before, and was not asked about, has
    /// none for the reasons that `before` holds.
    #[must_use]
    pub fn new(task: &Task, found: &planner::Replanned, before: &Self, confidence: f64) -> Self {
        let plan = &found.plan;
        let moved = found.moved.iter().map(|&robot| task.view.robots[robot].robot.clone()).collect();
        let mut planned: Vec<Planned> = Vec::new();
        let promised: BTreeMap<&RobotId, &Planned> = before.planned.iter().map(|planned| (&planned.robot, planned)).collect();
        for (index, station) in task.view.stations.iter().enumerate() {
            let mut here: Vec<&Session> = plan.sessions.iter().filter(|session| session.station == index).collect();
            here.sort_by_key(|session| (session.start, session.robot));
            let mut ledger = Ledger::new(task, station, index, &here, &promised);
            planned.extend(here.into_iter().map(|session| ledger.planned(session)));
        }
        planned.sort_by(|a, b| a.start.cmp(&b.start).then_with(|| a.robot.cmp(&b.robot)));
        let told: BTreeMap<&RobotId, &Rejected> = before.rejected.iter().map(|rejected| (&rejected.robot, rejected)).collect();
        let rejected = plan.unserved.iter().map(|unserved| {
            let robot = task.view.robots[unserved.robot].robot.clone();
            let (reasons, short) = match told.get(&robot) {
                Some(told) if found.unasked.contains(&unserved.robot) => (told.reasons.clone(), told.short.clone()),
                _ => (words::why_not(task, plan, unserved, confidence), least_short(task, unserved)),
            };
            Rejected { robot, stranded: unserved.stranded, reasons, short }
        });
        let quality = Quality::new(task, plan.objective, plan.bound);
        Self { rejected: rejected.collect(), planned, moved, quality, crowd: task.view.crowd }
    }

    /// Everybody that it is about.
    pub fn robots(&self) -> impl Iterator<Item = &RobotId> {
        self.planned.iter().map(|planned| &planned.robot).chain(self.rejected.iter().map(|rejected| &rejected.robot))
    }

    /// This plan, and for those that it does not know what another holds.
    #[must_use]
    pub fn with_newer(mut self, other: &Self) -> Self {
        let known: BTreeSet<RobotId> = self.robots().cloned().collect();
        self.planned.extend(other.planned.iter().filter(|planned| !known.contains(&planned.robot)).cloned());
        self.rejected.extend(other.rejected.iter().filter(|rejected| !known.contains(&rejected.robot)).cloned());
        self
    }

    /// Robots that `before` promised another service, or one at all.
    #[must_use]
    pub fn moved_from(&self, before: &Self) -> Vec<RobotId> {
        let promise = |planned: &Planned| (planned.station.clone(), planned.mode, planned.start);
        let now: BTreeMap<&RobotId, _> = self.planned.iter().map(|planned| (&planned.robot, Some(promise(planned)))).collect();
        let now_without: BTreeMap<&RobotId, _> = self.rejected.iter().map(|rejected| (&rejected.robot, None)).collect();
        let now = |robot: &RobotId| now.get(robot).or_else(|| now_without.get(robot));
        let is_moved = |planned: &&Planned| now(&planned.robot).is_some_and(|now| *now != Some(promise(planned)));
        before.planned.iter().filter(is_moved).map(|planned| planned.robot.clone()).collect()
    }
}

impl Quality {
    fn new(task: &Task, objective: Levels, bound: Levels) -> Self {
        Self {
            stranded: objective.stranded,
            stranded_bound: bound.stranded,
            missed_s: task.work_s(objective.cost),
            missed_bound_s: task.work_s(bound.cost),
        }
    }
}

/// What a station gives, service by service, in order of start.
struct Ledger<'a> {
    task: &'a Task,
    station: &'a StationView,
    index: usize,
    /// What the plan before told of each robot.
    told: &'a BTreeMap<&'a RobotId, &'a Planned>,
    spares: Vec<SpareView>,
    /// How surely the packs last.
    cover: Cover<'a>,
    /// Everything that is promised so far.
    need: Need,
    /// When the last of it ends, s from now.
    until_s: f64,
}

impl<'a> Ledger<'a> {
    fn new(
        task: &'a Task,
        station: &'a StationView,
        index: usize,
        here: &[&Session],
        told: &'a BTreeMap<&'a RobotId, &'a Planned>,
    ) -> Self {
        let mut spares = station.spares.clone();
        spares.sort_by(|a, b| b.soc.total_cmp(&a.soc).then_with(|| a.spare.cmp(&b.spare)));
        let cover = Cover::new(task, index, here);
        Self { task, station, index, told, spares, cover, need: station.owed(), until_s: station.committed_until_s }
    }

    /// The next service in order.
    fn planned(&mut self, session: &Session) -> Planned {
        let (task, now) = (self.task, self.task.view.now);
        let robot = &task.view.robots[session.robot];
        let [start, end] = [session.start, session.end].map(|tick| task.grid.time(tick));
        let way = robot.way(self.index);
        let travel_s = way.map_or(0.0, |way| way.time_s);
        let who = &task.problem.robots[session.robot];
        let first = who.travel.iter().find(|travel| travel.station == self.index).map_or(0, |travel| travel.ticks);
        // Who comes in the first tick in which it can be there, and is late already, leaves at once: the
        // rest of a tick is the planner's rounding, and each new plan would round up anew.
        let at_once = session.start <= first && who.not_before < first;
        let need = task.need(session.robot, self.index, session.start, session.mode);
        let need_wh = need.mean_wh;
        let (start_s, end_s) = (start.seconds_since(now), end.seconds_since(now));
        let before_wh = self.need.mean_wh + self.overhead(self.until_s.max(start_s)).mean_wh;
        self.need = self.need.plus(&need);
        self.until_s = self.until_s.max(end_s);
        let total = self.need.plus(&self.overhead(self.until_s));
        let packs = self.paying(before_wh, total.mean_wh);
        let (lasts, arrives) = (self.cover.until(end_s), way.map_or(1.0, |way| way.lasts.for_s(start_s)));
        // What has begun and ends later must not pay for it, but what never ends.
        let begun_s = Some(self.station.committed_until_s).filter(|&until_s| until_s < HORIZON_MAX_S);
        let covered = begun_s.map_or(lasts, |until_s| self.cover.until(end_s.max(until_s)).min(lasts));
        let spare = if session.mode == Mode::Swap || session.mode == Mode::SwapAndRecharge { self.spare(session) } else { None };
        let mut planned = Planned {
            robot: robot.robot.clone(),
            station: self.station.station.clone(),
            mode: session.mode,
            bay: session.bay.and_then(|bay| self.station.bays.get(bay as usize).cloned()),
            spare,
            to_soc: task.to_soc(session.mode),
            leave: if at_once { now } else { start.plus_s(-travel_s).max(now) },
            start,
            end,
            need,
            packs,
            probability: lasts * arrives,
            covered,
            why: Arc::default(),
            grounds: Grounds::new(task, session, need_wh, lasts, arrives),
        };
        let told = self.told.get(&planned.robot).filter(|told| told.grounds == planned.grounds && told.packs == planned.packs);
        planned.why = told.map_or_else(|| planned.grounds.words(&planned.packs).into(), |told| Arc::clone(&told.why));
        planned
    }

    fn overhead(&self, until_s: f64) -> Need {
        self.station.overhead_per_h.scaled(until_s / S_PER_H)
    }

    /// The fullest spare of its kind that is there by then, or else within the tick, by which the planner rounds. Where packs are charged again, it
    /// comes back as the pack that the robot leaves.
    fn spare(&mut self, session: &Session) -> Option<SpareId> {
        let start_s = self.task.grid.time(session.start).seconds_since(self.task.view.now);
        let ways = &self.task.problem.robots[session.robot].travel;
        let kind = ways.iter().find(|travel| travel.station == self.index)?.spares?;
        let there_by =
            |by_s: f64| self.spares.iter().position(|spare| spare.ready_s <= by_s && self.task.racks.kind(self.index, spare) == kind);
        let place = there_by(start_s).or_else(|| there_by(start_s + f64::from(self.task.grid.tick_s)))?;
        let spare = self.spares.remove(place);
        if session.mode == Mode::SwapAndRecharge {
            self.spares.push(SpareView { ready_s: start_s + self.recharged_s(session), ..spare.clone() });
        }
        Some(spare.spare)
    }

    /// Until the pack that the robot leaves is charged, s from the beginning of the exchange.
    fn recharged_s(&self, session: &Session) -> f64 {
        let soc = self.task.soc_at(session.robot, self.index, session.start);
        let way = self.task.view.robots[session.robot].way(self.index);
        self.station.handling.swap_s + way.map_or(0.0, |way| way.table.at(soc).bare_s)
    }

    /// Packs over which what is taken between two totals falls when all are drained in order.
    fn paying(&self, from_wh: f64, to_wh: f64) -> Vec<PackId> {
        let mut start_wh = 0.0;
        let mut paying = Vec::new();
        for pack in &self.station.packs {
            let end_wh = start_wh + pack.before_wh(f64::INFINITY);
            if from_wh < end_wh && to_wh > start_wh {
                paying.push(pack.pack.clone());
            }
            start_wh = end_wh;
        }
        paying
    }
}
