//! Every way in which a robot can be serviced: where, from when, and to which level or by which
//! exchange. A way has a fixed cost and a fixed use of the station, tick by tick, so a plan is
//! nothing but a choice of at most one way for each robot.

mod charge;
mod others;
mod starts;

use std::sync::{Arc, OnceLock};

pub use charge::charge_need;
use charge::{From, Runs, taken};
pub(crate) use starts::{At, Starts};

use rayon::prelude::*;

use crate::problem::{LeftPacks, Problem, Station, Tick, Travel};

/// For [`Way::ready`]: it gives no spare back within the horizon.
pub const NEVER: u16 = u16::MAX;
/// The same, while it is charged beyond the horizon.
const LATE: u16 = u16::MAX - 1;
/// So many robots are looked at on several threads; fewer are done before others have begun.
pub(crate) const SHARED_MIN: usize = 128;

/// How a robot is serviced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mode {
    /// Charged in a bay to the level of this index.
    Charge(u8),
    /// Its pack is exchanged; the old one is left as it is.
    Swap,
    /// Its pack is exchanged; the old one is charged and becomes a spare.
    SwapAndRecharge,
}

/// One way to service a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// Worth of the work that the robot misses.
    pub cost: i32,
    /// How.
    pub mode: Mode,
    /// Index of the station.
    pub station: u16,
    /// Tick in which it begins.
    pub start: u16,
    /// Tick in which the robot is let go.
    pub end: u16,
    /// Tick from which the robot's old pack is a charged spare, or [`NEVER`].
    pub ready: u16,
    /// The kind of spares that it takes, at its station; 0 for a charge.
    pub spares: u16,
    /// Where its runs of charging lie.
    runs: u32,
    /// Variance of its energy that is its own, units².
    pub variance: f32,
    /// Energy from the station's packs within the horizon, mWh.
    pub energy: i64,
}

impl Way {
    /// Whether it charges in a bay, or else exchanges the pack.
    #[inline]
    pub(crate) fn charges(&self) -> bool {
        matches!(self.mode, Mode::Charge(_))
    }
}

/// The ways of one robot, the cheapest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Choices {
    /// By cost, then energy.
    pub ways: Vec<Way>,
    runs: Arc<Runs>,
    /// Whether it runs empty without a service.
    pub strands: bool,
    /// Worth of the work that it misses without a service.
    pub unserved_cost: i32,
    /// Whether an earlier plan promised it a service.
    pub held: bool,
    /// Whether ways that it has were left out, because it keeps the one that it was promised.
    keeps: bool,
    /// The ways once more, sorted otherwise when first asked for.
    starts: OnceLock<Starts>,
}

/// The ways of all robots, made when first asked for: a change of one robot touches few others.
#[derive(Debug)]
pub struct Ways<'p> {
    problem: &'p Problem,
    choices: Vec<OnceLock<Choices>>,
}

impl<'p> Ways<'p> {
    /// The ways of the problem's robots.
    #[must_use]
    pub fn new(problem: &'p Problem) -> Self {
        Self { problem, choices: vec![OnceLock::new(); problem.robots.len()] }
    }

    /// All of them at once.
    #[must_use]
    pub fn all(problem: &'p Problem) -> Self {
        Self::made(problem, |robot| choices(problem, robot, None))
    }

    /// All of them at once, where giving up a commitment costs `loyalty`: see [`Self::for_replanning`].
    #[must_use]
    pub(crate) fn all_loyal(problem: &'p Problem, committed: &[Option<Commitment>], loyalty: i32) -> Self {
        Self::made(problem, |robot| match &committed[robot] {
            Some(commitment) => loyal(problem, robot, commitment, loyalty),
            None => choices(problem, robot, None),
        })
    }

    /// Those of a large fleet are made on as many threads as there are.
    fn made(problem: &'p Problem, of: impl Fn(usize) -> Choices + Sync) -> Self {
        let robots = 0..problem.robots.len();
        let choices = if robots.len() < SHARED_MIN {
            robots.map(|robot| OnceLock::from(of(robot))).collect()
        } else {
            robots.into_par_iter().map(|robot| OnceLock::from(of(robot))).collect()
        };
        Self { problem, choices }
    }

    /// The ways that a replanning needs: a robot with a commitment has that alone, others none, and
    /// those that `free` names have all.
    ///
    /// Giving up a commitment costs `loyalty`: it is added to all other ways of a free robot that
    /// has one, and to no service at all. Ways that are `known` already are not made again.
    #[must_use]
    pub(crate) fn for_replanning(
        problem: &'p Problem,
        committed: &[Option<Commitment>],
        free: &[bool],
        loyalty: i32,
        known: Option<&Self>,
    ) -> Self {
        let made = Self::new(problem);
        let known = |robot: usize, commitment: &Commitment| {
            let choices = known?.choices[robot].get()?;
            (choices.keeps && choices.ways.iter().any(|way| commitment.is(way))).then(|| choices.clone())
        };
        for (robot, commitment) in committed.iter().enumerate() {
            if free[robot] {
                if let Some(commitment) = commitment {
                    made.leave(robot, loyal(problem, robot, commitment, loyalty));
                }
                continue;
            }
            let only = commitment.map_or(Only::Nothing, Only::This);
            let kept = commitment.as_ref().and_then(|commitment| known(robot, commitment));
            made.choices[robot].set(kept.unwrap_or_else(|| choices(problem, robot, Some(only)))).expect("set once");
        }
        made
    }

    /// The way that a robot was promised, or none where it can no longer have it.
    #[must_use]
    pub(crate) fn promised(&self, robot: usize, commitment: Commitment) -> Choices {
        choices(self.problem, robot, Some(Only::This(commitment)))
    }

    /// Leaves a robot whose ways nobody has asked for yet with these.
    pub(crate) fn leave(&self, robot: usize, choices: Choices) {
        self.choices[robot].set(choices).expect("nobody has asked for them yet");
    }

    /// Takes the ways of robots over from others of the same problem: those that are named.
    pub(crate) fn take_over(&mut self, other: &Self, robots: impl Iterator<Item = usize>) {
        robots.for_each(|robot| self.choices[robot] = other.choices[robot].clone());
    }

    /// The ways of one robot, by index.
    #[must_use]
    pub fn of(&self, robot: usize) -> &Choices {
        self.choices[robot].get_or_init(|| choices(self.problem, robot, None))
    }

    /// The problem.
    #[must_use]
    pub fn problem(&self) -> &'p Problem {
        self.problem
    }
}

impl Choices {
    /// Calls `each(from, to, draw)` for every stretch of equal draw of a way, within the horizon.
    #[inline]
    pub fn draws(&self, way: &Way, station: &Station, horizon: Tick, mut each: impl FnMut(usize, usize, i64)) {
        let (start, end) = (Tick::from(way.start), Tick::from(way.end));
        let (mut at, to) = if let Mode::Charge(_) = way.mode {
            each(start as usize, (start + station.load_ticks) as usize, station.load_draw);
            (start + station.load_ticks, end - station.unload_ticks)
        } else {
            each(start as usize, end as usize, station.swap_draw);
            (end, if way.mode == Mode::Swap { end } else { Tick::from(way.ready).min(horizon) })
        };
        for (ticks, draw) in self.runs.from(way.runs) {
            if at >= to {
                break;
            }
            let next = (at + ticks).min(to);
            each(at as usize, next as usize, draw);
            at = next;
        }
        if let Mode::Charge(_) = way.mode {
            each((end - station.unload_ticks) as usize, end as usize, station.unload_draw);
        }
    }

    /// The ways by how long they hold their place.
    pub(crate) fn starts(&self, horizon: Tick) -> &Starts {
        self.starts.get_or_init(|| Starts::new(&self.ways, horizon))
    }

    /// The place of the way with this station, start and mode.
    #[must_use]
    pub fn find(&self, station: usize, start: Tick, mode: Mode) -> Option<usize> {
        self.ways.iter().position(|way| usize::from(way.station) == station && Tick::from(way.start) == start && way.mode == mode)
    }
}

/// A service that a plan promised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Commitment {
    /// Index of the station.
    pub station: usize,
    /// The tick in which it begins.
    pub start: Tick,
    /// How.
    pub mode: Mode,
}

impl Commitment {
    fn is(&self, way: &Way) -> bool {
        usize::from(way.station) == self.station && Tick::from(way.start) == self.start && way.mode == self.mode
    }
}

/// Which ways are made.
#[derive(Debug, Clone, Copy)]
enum Only {
    Nothing,
    This(Commitment),
    /// All, also those that cost more than they give.
    Whatever,
}

/// Whether there is any way to service a robot, whatever it costs.
pub(crate) fn has_any_way(problem: &Problem, robot: usize) -> bool {
    !choices(problem, robot, Some(Only::Whatever)).ways.is_empty()
}

/// All ways of a robot, those but the one that it was promised dearer by `loyalty`.
fn loyal(problem: &Problem, robot: usize, commitment: &Commitment, loyalty: i32) -> Choices {
    let mut all = choices(problem, robot, None);
    let promised = all.ways.iter().position(|way| commitment.is(way)).map(|place| all.ways.remove(place));
    all.ways.iter_mut().for_each(|way| way.cost += loyalty);
    all.unserved_cost += loyalty;
    if let Some(promised) = promised {
        let place = all.ways.partition_point(|way| (way.cost, way.energy) < (promised.cost, promised.energy));
        all.ways.insert(place, promised);
    }
    all
}

/// All ways to service a robot that could be part of a best plan, or only one of them.
fn choices(problem: &Problem, robot: usize, only: Option<Only>) -> Choices {
    let (battery, horizon) = (problem.battery(robot), problem.horizon);
    let (strands, robot) = (problem.strands(robot), &problem.robots[robot]);
    let unserved = robot.missed_unserved(battery.floor);
    let keeps = matches!(only, Some(Only::This(_)));
    let least_gain = robot.least_gain(battery);
    let counts_cost = !strands && !matches!(only, Some(Only::Whatever));
    let mut runs = Runs::default();
    let mut made = Choices {
        ways: Vec::new(),
        runs: Arc::default(),
        strands,
        unserved_cost: unserved as i32,
        held: robot.held,
        keeps,
        starts: OnceLock::new(),
    };
    if robot.travel.is_empty() || horizon == 0 || (counts_cost && unserved == 0) || matches!(only, Some(Only::Nothing)) {
        return made;
    }
    let mut first = robot.travel.iter().map(|travel| problem.soonest(travel)).min().unwrap_or(0).max(robot.not_before);
    let last_there = robot.travel.iter().map(|travel| robot.last_start(travel, battery.floor)).max().unwrap_or(-1);
    let mut last = last_there.min(i64::from(horizon) - 1);
    if let Some(Only::This(commitment)) = only {
        (first, last) = (first.max(commitment.start), last.min(i64::from(commitment.start)));
    }
    let is_asked = |station: usize| !matches!(only, Some(Only::This(commitment)) if commitment.station != station);
    // Ways are made in the order in which equal ones stay: by start, station and mode.
    let mut travels: Vec<&Travel> = robot.travel.iter().filter(|travel| is_asked(travel.station)).collect();
    travels.sort_by_key(|travel| travel.station);
    let swaps = robot.travel.iter().any(|travel| problem.exchanges(travel));
    made.ways.reserve(usize::try_from(last - i64::from(first) + 1).unwrap_or(0) * robot.travel.len());
    for start in first.. {
        if i64::from(start) > last {
            break;
        }
        let in_reach = |travel: &&&Travel| problem.soonest(travel) <= start && i64::from(start) <= robot.last_start(travel, battery.floor);
        let mut at: Vec<(i64, From)> = Vec::new();
        for travel in travels.iter().filter(in_reach) {
            let station = &problem.stations[travel.station];
            let energy = robot.left_at(travel, start);
            let enough = battery.targets.partition_point(|target| target - energy < least_gain);
            let wanted = enough.max(robot.lowest_target.min(battery.targets.len()));
            let place = at.iter().position(|(left, from)| *left == energy && from.charger == station.charger).unwrap_or_else(|| {
                at.push((
                    energy,
                    From::new(battery, station.charger, energy, (&battery.targets[wanted..], swaps.then_some(least_gain)), &mut runs),
                ));
                at.len() - 1
            });
            let from = &at[place].1;
            let away = i64::from(travel.ticks);
            let in_time = robot.wanted.map_or(start, |wanted| wanted.max(travel.ticks));
            let works_until = i64::from(start.min(in_time)) - away;
            let [early, late] = [in_time.saturating_sub(start), start.saturating_sub(in_time)].map(i64::from);
            let owed = &battery.chargers[station.charger].owed;
            let cost = |mode: Mode, end: Tick, stored: i64| {
                let owed = if let Mode::Charge(level) = mode { owed.get(usize::from(level)).copied().unwrap_or(0) } else { 0 };
                let (from, to) =
                    (i64::from(end) + away, i64::from(end) + (stored - travel.extra - battery.floor).div_euclid(robot.drain_served));
                // What is late is missed already where the work that it gives ends with the mission.
                let amiss = early + late - (to - robot.mission_end).clamp(0, late);
                robot.weight * (amiss + i64::from(owed)) + robot.missed([(0, works_until), (from, to)])
            };
            let mut add = |mode, end: Tick, stored, ready, runs, energy| {
                let cost = cost(mode, end, stored);
                // Who can do without is not serviced to no gain: that holds at every level.
                if end <= horizon && station.is_there(start, end, robot.held) && (!counts_cost || cost < unserved) {
                    let (start, end, variance) = (start as u16, end as u16, travel.variance as f32);
                    let spares = if matches!(mode, Mode::Charge(_)) { 0 } else { travel.spares.unwrap_or(0) };
                    made.ways.push(Way {
                        cost: cost as i32,
                        spares,
                        mode,
                        station: travel.station as u16,
                        start,
                        end,
                        ready,
                        runs,
                        variance,
                        energy,
                    });
                }
            };
            let handling = i64::from(station.load_ticks) * station.load_draw + i64::from(station.unload_ticks) * station.unload_draw;
            if station.bays > 0 {
                for (level, &(ticks, stored)) in from.charged.reached.iter().enumerate() {
                    let end = start + station.load_ticks + ticks + station.unload_ticks;
                    // No time is no service.
                    if end == start {
                        continue;
                    }
                    let mode = Mode::Charge((wanted + level) as u8);
                    add(mode, end, stored, NEVER, from.charged_runs, handling + taken(&from.charged.runs, ticks));
                }
            }
            let Some(bare) = from.bare.as_ref().filter(|_| problem.exchanges(travel)) else { continue };
            let (end, stored) = (start + station.swap_ticks, battery.chargers[station.charger].swap_energy);
            let energy = i64::from(station.swap_ticks) * station.swap_draw;
            if station.left_packs != LeftPacks::Charged {
                add(Mode::Swap, end, stored, NEVER, from.bare_runs, energy);
            }
            let ready = end + bare.reached[0].0;
            // A spare that is charged too late helps nobody, but may be charged all the same.
            if station.left_packs == LeftPacks::Charged || (station.left_packs == LeftPacks::AsPlanned && ready < horizon) {
                let ready_at = if ready < horizon { ready as u16 } else { LATE };
                add(Mode::SwapAndRecharge, end, stored, ready_at, from.bare_runs, energy + taken(&bare.runs, ready - end));
            }
        }
    }
    if let Some(Only::This(commitment)) = only {
        made.ways.retain(|way| commitment.is(way));
    }
    made.ways = in_order(&made.ways);
    made.runs = Arc::new(runs.closed());
    made
}

/// Ways by cost, then energy; where both are equal the order stays. Whole numbers are sorted in place of ways,
/// since that is much of the work of making them.
fn in_order(ways: &[Way]) -> Vec<Way> {
    let rank = |(way, place): (&Way, u128)| (way.cost as u128) << 96 | (way.energy as u128) << 32 | place;
    let mut ranks: Vec<u128> = ways.iter().zip(0..).map(rank).collect();
    ranks.sort_unstable();
    ranks.into_iter().map(|rank| ways[rank as u32 as usize]).collect()
}
