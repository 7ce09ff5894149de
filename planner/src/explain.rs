//! Why a robot is serviced as it is: what else there was at which cost, and what stands in the way of
//! anything earlier, while everybody else keeps what was planned.

use std::ops::Range;

use crate::book::Clash;
use crate::draft::{Draft, NONE};
use crate::plan::Session;
use crate::problem::{Problem, Tick};
use crate::replan::commitments;
use crate::way::{Choices, Mode, Way, Ways};

/// What can be said of a robot's place in a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Explained {
    /// Worth of the work that it misses as planned, or without a service.
    pub cost: i64,
    /// The same if it had no service.
    pub unserved_cost: i64,
    /// At each station and by each kind of service the best way that is free, the least cost first, and
    /// then those that are not.
    pub others: Vec<Other>,
    /// Where the service comes after it is wanted: the last way before it, of its kind and at its station, with what stands in the way; none
    /// when it comes in time, or nothing earlier is to be had by the rules.
    pub earlier: Option<Other>,
    /// Where it comes before it is wanted: the same of the way that is nearest to when it is.
    pub later: Option<Other>,
}

/// Another way to service the robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Other {
    /// Index of the station.
    pub station: usize,
    /// How.
    pub mode: Mode,
    /// When it would begin.
    pub start: Tick,
    /// When it would end.
    pub end: Tick,
    /// Worth of the work that the robot would miss.
    pub cost: i64,
    /// Energy from the station's packs.
    pub energy: i64,
    /// What is missing for it; nothing when it is free.
    pub lacks: Vec<Clash>,
    /// Robots that would have to give way.
    pub blockers: Vec<usize>,
}

impl<'p> Ways<'p> {
    /// The ways that it takes to explain some robots' places among these sessions: all of theirs, and of
    /// the others the one that was chosen.
    #[must_use]
    pub fn for_explaining(problem: &'p Problem, sessions: &[Session], asked: impl Fn(usize) -> bool) -> Self {
        let free: Vec<bool> = (0..problem.robots.len()).map(asked).collect();
        Self::for_replanning(problem, &commitments(problem, sessions), &free, 0, None)
    }
}

/// A plan of which one can ask why it is as it is.
#[derive(Debug)]
pub struct Explainer<'w, 'p> {
    draft: Draft<'w, 'p>,
}

impl<'w, 'p> Explainer<'w, 'p> {
    /// Opens the plan with these sessions.
    #[must_use]
    pub fn new(ways: &'w Ways<'p>, sessions: &[Session]) -> Self {
        let mut draft = Draft::new(ways);
        for session in sessions {
            if let Some(way) = ways.of(session.robot).find(session.station, session.start, session.mode) {
                draft.serve(session.robot, way as u32);
            }
        }
        draft.keep();
        Self { draft }
    }

    /// Explains a robot's place in the plan.
    pub fn explain(&mut self, robot: usize) -> Explained {
        let draft = &mut self.draft;
        let (ways, problem) = (draft.ways, draft.problem());
        let (choices, chosen, cost) = (ways.of(robot), draft.chosen[robot], draft.cost_of(robot));
        let planned = (chosen != NONE).then(|| choices.ways[chosen as usize]);
        if planned.is_some() {
            draft.release(robot);
        }
        let mut others = Vec::new();
        for travel in &problem.robots[robot].travel {
            for charges in [true, false] {
                let here = |way: &&Way| usize::from(way.station) == travel.station && charges == matches!(way.mode, Mode::Charge(_));
                let other = |way: &&Way| planned.is_none_or(|planned| **way != planned);
                let free = choices.ways.iter().filter(here).filter(other).find(|way| draft.books[travel.station].fits(choices, way));
                let Some(best) = free.or_else(|| choices.ways.iter().find(here)) else { continue };
                if other(&best) {
                    others.push(described(draft, robot, best));
                }
            }
        }
        others.sort_by_key(|other| (!other.lacks.is_empty(), other.cost, other.energy, other.start));
        let (earlier, later) = planned.map_or((None, None), |planned| {
            let (start, wanted) = (Tick::from(planned.start), problem.robots[robot].in_time(usize::from(planned.station)));
            let last = |from: Tick, to: Tick| last_between(choices, &planned, from..to).map(|way| described(draft, robot, way));
            (last(wanted, start), last(start + 1, wanted + 1))
        });
        draft.undo(0);
        Explained { cost, unserved_cost: i64::from(choices.unserved_cost), others, earlier, later }
    }
}

/// The last of a robot's ways of the kind of one, at its station, that begins in these ticks; to the same level where there is such.
fn last_between<'c>(choices: &'c Choices, like: &Way, ticks: Range<Tick>) -> Option<&'c Way> {
    let kind = std::mem::discriminant(&like.mode);
    let is_alike = |way: &&Way| way.station == like.station && std::mem::discriminant(&way.mode) == kind;
    let alike = choices.ways.iter().filter(is_alike).filter(|way| ticks.contains(&Tick::from(way.start)));
    alike.max_by_key(|way| (way.mode == like.mode, way.start, std::cmp::Reverse((way.cost, way.energy))))
}

fn described(draft: &Draft<'_, '_>, robot: usize, way: &Way) -> Other {
    let station = usize::from(way.station);
    let book = &draft.books[station];
    let choices = draft.ways.of(robot);
    let lacks = book.lacks(choices, way);
    let in_the_way = |other: &&u32| {
        let other = **other as usize;
        let theirs = &draft.ways.of(other).ways[draft.chosen[other] as usize];
        lacks.iter().any(|&clash| book.takes_part(clash, theirs))
    };
    let mut blockers: Vec<usize> = book.robots.iter().filter(in_the_way).map(|&other| other as usize).collect();
    blockers.sort_unstable();
    let (start, end) = (Tick::from(way.start), Tick::from(way.end));
    Other { station, mode: way.mode, start, end, cost: i64::from(way.cost), energy: way.energy, lacks, blockers }
}
