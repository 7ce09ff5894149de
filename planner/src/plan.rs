//! A finished plan: who is serviced where, when and how, which packs pay, and what is proven.

use rayon::prelude::*;

use crate::draft::{Draft, NONE};
use crate::problem::Tick;
use crate::reasons::{self, Obstacle};
use crate::supply;
use crate::way::{Mode, SHARED_MIN};

/// A plan for every robot of a problem: a session, or the reasons why not.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// In order of station, start and robot.
    pub sessions: Vec<Session>,
    /// Robots without a session, in order.
    pub unserved: Vec<Unserved>,
    /// For each station the indices of its packs in the order in which they are drained; packs that
    /// are not needed are left out.
    pub pack_order: Vec<Vec<usize>>,
    /// What the plan amounts to.
    pub objective: Levels,
    /// What is proven: no plan is below the bound of a level if it keeps the levels before.
    pub bound: Levels,
}

/// The levels by which plans are judged, the first first; less is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Levels {
    /// Robots that run empty within mission and horizon.
    pub stranded: i64,
    /// Worth of missed work.
    pub cost: i64,
    /// Energy taken from packs within the horizon, mWh.
    pub energy: i64,
    /// Packs drawn from.
    pub packs: i64,
}

impl Levels {
    /// In order of importance.
    #[must_use]
    pub fn all(&self) -> [i64; 4] {
        [self.stranded, self.cost, self.energy, self.packs]
    }
}

/// One service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Session {
    /// Index of the robot.
    pub robot: usize,
    /// Index of the station.
    pub station: usize,
    /// How.
    pub mode: Mode,
    /// The tick in which the robot arrives.
    pub start: Tick,
    /// The tick in which it is let go.
    pub end: Tick,
    /// The bay, for a charge.
    pub bay: Option<u32>,
}

/// A robot without a service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unserved {
    /// Index of the robot.
    pub robot: usize,
    /// Whether it runs empty.
    pub stranded: bool,
    /// Whether packs could pay for a service, and only a place to have it in is missing.
    pub wants_place: bool,
    /// What stands in the way at each station in reach.
    pub obstacles: Vec<Obstacle>,
    /// Why, in words.
    pub reasons: Vec<String>,
}

impl Plan {
    /// How far each level may be from the best, as a share of its bound; zero is proven best.
    #[must_use]
    pub fn gaps(&self) -> [f64; 4] {
        let (values, bounds) = (self.objective.all(), self.bound.all());
        std::array::from_fn(|level| (values[level] - bounds[level]) as f64 / bounds[level].max(1) as f64)
    }

    /// Writes a draft out in full.
    pub(crate) fn new(draft: &Draft<'_, '_>, stranded_bound: i64, cost_bound: i64, service_energy_bound: i64) -> Self {
        let problem = draft.problem();
        let mut sessions = sessions(draft);
        assign_bays(draft, &mut sessions);
        let pack_order: Vec<Vec<usize>> = draft.books.iter().map(super::book::Book::packs).collect();
        let (mut objective, mut bound) = (Levels::default(), Levels::default());
        (objective.stranded, objective.cost) = (draft.score.stranded, draft.score.cost);
        (bound.stranded, bound.cost) = (stranded_bound, cost_bound);
        bound.energy = service_energy_bound.max(0);
        for (station, packs) in pack_order.iter().enumerate() {
            let switch_cost = problem.stations[station].switch_cost;
            let switches = |packs: usize| packs.saturating_sub(1) as i64 * switch_cost;
            objective.energy += draft.books[station].drawn_before(problem.horizon) + switches(packs.len());
            objective.packs += packs.len() as i64;
            // What the station takes without any service is the least that it ever takes.
            let there = &problem.stations[station];
            let load = problem.base_load(there);
            let drawn = |before: Tick| load[..before as usize].iter().sum();
            let least = supply::fewest_packs(there, problem.horizon, drawn).map_or(there.packs.len(), |packs| packs.len());
            bound.energy += drawn(problem.horizon) + switches(least);
            bound.packs += least as i64;
        }
        let unserved: Vec<usize> = (0..problem.robots.len()).filter(|&robot| draft.chosen[robot] == NONE).collect();
        let why = |&robot: &usize| {
            let obstacles = reasons::obstacles(draft, robot);
            let reasons = reasons::why_not(draft, robot, &obstacles);
            Unserved { robot, stranded: problem.strands(robot), wants_place: reasons::wants_place(draft, robot), obstacles, reasons }
        };
        let unserved =
            if unserved.len() < SHARED_MIN { unserved.iter().map(why).collect() } else { unserved.par_iter().map(why).collect() };
        Self { sessions, unserved, pack_order, objective, bound }
    }
}

fn sessions(draft: &Draft<'_, '_>) -> Vec<Session> {
    let served = (0..draft.chosen.len()).filter(|&robot| draft.chosen[robot] != NONE);
    let session = |robot: usize| {
        let way = &draft.ways.of(robot).ways[draft.chosen[robot] as usize];
        let (start, end) = (Tick::from(way.start), Tick::from(way.end));
        Session { robot, station: usize::from(way.station), mode: way.mode, start, end, bay: None }
    };
    let mut sessions: Vec<Session> = served.map(session).collect();
    sessions.sort_by_key(|session| (session.station, session.start, session.robot));
    sessions
}

/// Gives each charge a bay. Never more charges at once than bays, so in order of start the first
/// bay that is free will do.
fn assign_bays(draft: &Draft<'_, '_>, sessions: &mut [Session]) {
    let stations = &draft.problem().stations;
    let mut free: Vec<Vec<Tick>> = stations.iter().map(|station| vec![0; station.bays as usize]).collect();
    for (station, free) in stations.iter().zip(&mut free) {
        for ongoing in &station.ongoing {
            if let Some(bay) = ongoing.bay {
                free[bay as usize] = free[bay as usize].max(ongoing.until);
            }
        }
    }
    for session in sessions.iter_mut().filter(|session| matches!(session.mode, Mode::Charge(_))) {
        let bays = &mut free[session.station];
        let bay = bays.iter().position(|&until| until <= session.start).expect("no more charges at once than bays");
        bays[bay] = session.end;
        session.bay = Some(bay as u32);
    }
}
