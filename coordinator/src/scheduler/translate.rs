//! A view as a `planner::Problem`: seconds become ticks of a grid, Wh become whole units.

mod battery;
mod station;

pub(crate) use battery::levels_soc;
pub(super) use station::KEEP_CONFIDENCE;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use energy::units::S_PER_H;
use energy::{Estimate, Need};
use planner::problem::{Battery, Problem, Robot, Station, Tick, Travel};
use planner::{Mode, Policy, Session};
use proto::{RobotId, Timestamp};

use super::charging::{Point, Table};
use super::plan::Planned;
use super::problem::{Lasts, RobotView, View};
use super::racks::Racks;
use crate::models::Settings;

/// Units of energy in a Wh: a robot that charges at 15 W takes some 4,000 of them in a tick of 10 s.
const UNITS_PER_WH: f64 = 1e5;
/// Parts of a second's worth of work that costs are counted in.
const WORTH: f64 = 10.0;
/// The most of them that a robot's second counts.
const WEIGHT_MAX: f64 = 1e4;
/// What the greatest weight of a fleet counts whose weights are not usual ones.
const GREATEST: f64 = 1e3;
/// Lengths of a tick, s: the shortest that is fine enough for the fleet.
const TICKS_S: [u32; 8] = [10, 15, 20, 30, 60, 120, 300, 600];
/// Ticks times stations that a plan may look at.
const BOOKED_MAX: f64 = 20_000.0;
/// Ticks of a horizon: at most, and as many as there may be for any number of stations.
const TICKS_MAX: [f64; 2] = [300.0, 3000.0];
/// Nobody plans farther ahead, s.
pub(crate) const HORIZON_MAX_S: f64 = 48.0 * S_PER_H;
/// Services after each other that are looked at beyond that.
const QUEUE_MAX: Tick = 6;

/// Where ticks lie in time: on the same grid for every plan, so that plans can be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    /// Begin of tick 0, at or before the moment of planning.
    pub origin: Timestamp,
    /// Length of a tick, s.
    pub tick_s: u32,
}

impl Grid {
    fn at(now: Timestamp, tick_s: u32) -> Self {
        let tick_ms = 1000 * i64::from(tick_s);
        Self { origin: Timestamp::from_unix_ms(now.unix_ms().div_euclid(tick_ms) * tick_ms), tick_s }
    }

    /// Begin of a tick.
    #[must_use]
    pub fn time(&self, tick: Tick) -> Timestamp {
        self.origin.plus_s(f64::from(tick) * f64::from(self.tick_s))
    }

    /// The tick that begins nearest to a time; none before the grid.
    #[must_use]
    pub fn tick(&self, time: Timestamp) -> Option<Tick> {
        let ticks = (time.seconds_since(self.origin) / f64::from(self.tick_s)).round();
        (ticks >= 0.0).then_some(ticks as Tick)
    }

    /// The last tick that begins by then.
    fn down(self, seconds: f64) -> Tick {
        (seconds / f64::from(self.tick_s) + 1e-9).max(0.0) as Tick
    }

    fn up(self, seconds: f64) -> Tick {
        (seconds / f64::from(self.tick_s) - 1e-9).ceil().max(0.0) as Tick
    }
}

/// A problem and what its numbers stand for.
#[derive(Debug, Clone)]
pub struct Task {
    /// The view that it was made from.
    pub view: View,
    /// For the planner. Robots and stations have the same indices as in the view.
    pub problem: Problem,
    /// Its ticks in time.
    pub grid: Grid,
    /// Levels at which a charge may end, ascending; the last is the usual one.
    pub levels_soc: Vec<f64>,
    /// Kinds of spares.
    pub racks: Racks,
    /// The policy that plans it.
    pub policy: &'static dyn Policy,
    /// Units of cost in a second's worth of usual work.
    worth: f64,
}

/// What is on offer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offer<'a> {
    /// Nobody is serviced before it wants to be, or charged to less than the usual level, but for who was promised that.
    Usual,
    /// There is no room for all in that way: everybody may come earlier.
    Early,
    /// Not in that way either: everybody may also leave with less.
    Scarce,
    /// There is not the energy for all: these, for whom there is none, may come earlier and leave with less.
    Rest(&'a BTreeSet<RobotId>),
    /// The packs that robots leave are charged as far as the energy lasts: these may come for a spare although it may not last for that.
    Spares(&'a BTreeSet<RobotId>),
}

impl Task {
    /// The problem of a view, after a plan that promised the services of `before`.
    #[must_use]
    pub fn new(view: View, settings: &Settings, before: &[Planned], offer: Offer<'_>) -> Self {
        let tick_s = tick_s(&view);
        let grid = Grid::at(view.now, tick_s);
        let racks = Racks::new(&view);
        let (kind_of, members) = battery::kinds(&view, &racks);
        let tables_of = |robots: &Vec<&RobotView>| {
            let mut tables: BTreeMap<usize, Arc<Table>> = BTreeMap::new();
            for way in robots.iter().flat_map(|robot| &robot.ways) {
                tables.entry(way.station).or_insert_with(|| Arc::clone(&way.table));
            }
            tables
        };
        let tables: Vec<BTreeMap<usize, Arc<Table>>> = members.iter().map(tables_of).collect();
        let batteries =
            members.iter().zip(&tables).map(|(robots, tables)| battery::battery(robots, tables, (&view, &racks), settings, tick_s));
        let mut batteries: Vec<Battery> = batteries.collect();
        let charger_of = battery::share_chargers(&mut batteries, view.stations.len());
        let stations = (0..view.stations.len()).map(|index| {
            let lift_wh = tables.iter().find_map(|tables| tables.get(&index)).map_or(0.0, |table| table.lift_wh);
            station::station((&view, &racks), index, charger_of[index], lift_wh, settings, grid, offer)
        });
        let stations: Vec<Station> = stations.collect();
        let before_of = before.iter().map(|planned| (&planned.robot, planned)).collect();
        let levels_soc = levels_soc(settings);
        let worth = worth(&view);
        let places = Places { view: &view, racks: &racks, grid, offer, levels_soc: &levels_soc, before: before_of, worth };
        let robots: Vec<Robot> = view.robots.iter().zip(kind_of).map(|(robot, kind)| places.robot(robot, kind, &batteries[kind])).collect();
        let mut problem = Problem {
            name: String::new(),
            tick_s,
            units_per_wh: UNITS_PER_WH as i64,
            horizon: 0,
            capacity_target: levels_soc.len() - 1,
            batteries,
            stations,
            robots,
        };
        close_horizon(&mut problem, &view, grid);
        let mut task = Self { view, problem, grid, levels_soc, racks, policy: settings.policy, worth };
        let sessions = task.sessions(before);
        planner::hold(&mut task.problem, &sessions);
        task
    }

    /// Services of an earlier plan that this problem can still have, as sessions of it.
    #[must_use]
    pub fn sessions(&self, before: &[Planned]) -> Vec<Session> {
        // Both are in order of id.
        let session = |planned: &Planned| {
            let robot = self.view.robots.binary_search_by(|view| view.robot.cmp(&planned.robot)).ok()?;
            let station = self.view.stations.binary_search_by(|view| view.station.cmp(&planned.station)).ok()?;
            let start = self.grid.tick(planned.start)?;
            Some(Session { robot, station, mode: planned.mode, start, end: start, bay: None })
        };
        before.iter().filter_map(session).collect()
    }

    /// State of charge that a robot is expected to come to a station in reach with, at a tick.
    #[must_use]
    pub fn soc_at(&self, robot: usize, station: usize, tick: Tick) -> f64 {
        let who = &self.problem.robots[robot];
        let way = who.travel.iter().find(|travel| travel.station == station);
        let left = way.map_or(who.energy - who.drain * i64::from(tick), |way| who.left_at(way, tick));
        left as f64 / self.problem.battery(robot).capacity as f64
    }

    /// What a service takes: its energy with its doubt. That of the robot's state of charge counts in full for a charge, wherever it ends;
    /// lifting and exchanging take what they take, whatever the robot has left.
    #[must_use]
    pub fn need(&self, robot: usize, station: usize, start: Tick, mode: Mode) -> Need {
        let view = &self.view.robots[robot];
        let Some(way) = view.way(station) else { return Need::default() };
        let table = &way.table;
        let soc = Estimate::new(self.soc_at(robot, station, start).max(0.0), view.soc.sigma.hypot(way.extra_soc.sigma));
        let there = &self.problem.stations[station];
        let swap_wh = self.problem.wh(i64::from(there.swap_ticks) * there.swap_draw);
        let drawn = match mode {
            Mode::Charge(_) => table.need_to(soc, self.to_soc(mode), 1.0),
            Mode::Swap => Need { mean_wh: swap_wh, ..Need::default() },
            Mode::SwapAndRecharge => {
                let bare = table.bare(soc, 1.0);
                Need { mean_wh: swap_wh + bare.mean_wh, ..bare }
            }
        };
        let shared = &self.view.stations[station].shared_per_wh;
        Need { shared_wh: shared.iter().map(|change| change * drawn.mean_wh).collect(), ..drawn }
    }

    /// The charge of the pack that an exchange leaves, once that is over; none where none follows, or not from the station's packs.
    #[must_use]
    pub fn charge_after(&self, session: &Session) -> Option<Point> {
        let table = &self.view.robots[session.robot].way(session.station)?.table;
        let charges = self.view.stations[session.station].charges_spares && !matches!(session.mode, Mode::Charge(_));
        charges.then(|| table.at(self.soc_at(session.robot, session.station, session.start))).filter(|charge| charge.bare_wh > 0.0)
    }

    /// Level at which a service ends, if it is a charge: else the usual one.
    #[must_use]
    pub fn to_soc(&self, mode: Mode) -> f64 {
        let level = if let Mode::Charge(level) = mode { usize::from(level) } else { self.levels_soc.len() - 1 };
        self.levels_soc[level.min(self.levels_soc.len() - 1)]
    }

    /// A charge to the usual level.
    #[must_use]
    pub fn full_charge(&self) -> Mode {
        Mode::Charge((self.levels_soc.len() - 1) as u8)
    }

    /// Worth of work in seconds of it.
    #[must_use]
    pub fn work_s(&self, cost: i64) -> f64 {
        cost as f64 / self.worth * f64::from(self.grid.tick_s)
    }

    /// What moving a promise costs that is worth so many seconds of a robot's work: of its work as the fleet's is weighed on the mean, so
    /// that weights say how robots compare, and nothing else.
    #[must_use]
    pub fn loyalty(&self, work_s: f64) -> u32 {
        let weighed = self.problem.robots.iter().map(|robot| robot.weight).filter(|weight| *weight > 0);
        let (sum, count) = weighed.fold((0, 0), |(sum, count), weight| (sum + weight, count + 1));
        let mean = if count > 0 { sum as f64 / f64::from(count) } else { WORTH };
        (work_s / f64::from(self.grid.tick_s) * mean).round().clamp(0.0, 1e6) as u32
    }
}

/// Units of cost in a second's worth of usual work: [`WORTH`], unless the weights of a fleet are so large or small that these would not tell
/// them apart. Then the greatest counts [`GREATEST`].
fn worth(view: &View) -> f64 {
    let weighed = || view.robots.iter().map(|robot| robot.weight).filter(|weight| *weight > 0.0);
    let is_usual = |weight: f64| (1.0..=WEIGHT_MAX).contains(&(WORTH * weight));
    if weighed().all(is_usual) { WORTH } else { GREATEST / weighed().fold(0.0, f64::max) }
}

/// The shortest tick with which the books of all stations stay small.
fn tick_s(view: &View) -> u32 {
    let farthest_s = view.robots.iter().map(|robot| robot.lasts.empty_s.min(HORIZON_MAX_S).max(robot.wanted_s.min(HORIZON_MAX_S)));
    let ticks = (BOOKED_MAX / view.stations.len().max(1) as f64).clamp(TICKS_MAX[0], TICKS_MAX[1]);
    let wanted_s = farthest_s.fold(S_PER_H, f64::max) / ticks;
    TICKS_S.into_iter().find(|&tick_s| f64::from(tick_s) >= wanted_s).unwrap_or(TICKS_S[TICKS_S.len() - 1])
}

/// Ends the horizon when everybody who may be empty within it could have been serviced. Work that has no
/// end counts until then: a later service adds as much work as an earlier one, but who knows what comes.
fn close_horizon(problem: &mut Problem, view: &View, grid: Grid) {
    let most = Tick::try_from((HORIZON_MAX_S / f64::from(problem.tick_s)) as i64).unwrap_or(Tick::MAX);
    let charging = |battery: &Battery, station: &Station| {
        let curve = &battery.chargers[station.charger].curve;
        let ticks: i64 =
            curve.iter().scan(0, |from, segment| Some((segment.below - std::mem::replace(from, segment.below)) / segment.gain + 1)).sum();
        ticks as Tick + station.load_ticks + station.unload_ticks + station.swap_ticks
    };
    let services = problem.batteries.iter().flat_map(|battery| problem.stations.iter().map(move |station| charging(battery, station)));
    // Nobody waits for a charge that never ends.
    let service = services.filter(|&ticks| ticks < most).max().unwrap_or(0);
    let until = |robot: usize| problem.endurance(robot).min(i64::from(most)).max(problem.robots[robot].wanted.map_or(0, i64::from));
    let empty = (0..problem.robots.len()).map(until).max().unwrap_or(0);
    let ends = problem.stations.iter().flat_map(|station| &station.ongoing).map(|ongoing| ongoing.until);
    let begun = ends.filter(|&until| until < most).max().unwrap_or(0);
    // Who never gets empty may come one after the other, all the same.
    let lasting = (0..problem.robots.len()).filter(|&robot| problem.endurance(robot) >= i64::from(most)).count() as Tick;
    let queue = service * (1 + lasting.min(QUEUE_MAX));
    // Ways count their ticks in 16 bits.
    problem.horizon = (empty as Tick + queue + 2).max(begun + 1).min(Tick::from(u16::MAX));
    for ongoing in problem.stations.iter_mut().flat_map(|station| &mut station.ongoing) {
        ongoing.until = ongoing.until.min(problem.horizon - 1);
        ongoing.from = ongoing.from.min(ongoing.until);
    }
    let end = i64::from(problem.horizon);
    let ahead_s = view.now.seconds_since(grid.origin);
    for (robot, view) in problem.robots.iter_mut().zip(&view.robots) {
        let until = view.until_s.map_or(end, |until_s| i64::from(grid.down(until_s + ahead_s)));
        robot.mission_end = until.min(end);
    }
}

/// What robots are translated with.
struct Places<'a> {
    view: &'a View,
    racks: &'a Racks,
    grid: Grid,
    offer: Offer<'a>,
    levels_soc: &'a [f64],
    before: BTreeMap<&'a RobotId, &'a Planned>,
    worth: f64,
}

impl Places<'_> {
    fn robot(&self, robot: &RobotView, kind: usize, battery: &Battery) -> Robot {
        let grid = self.grid;
        let (tick_s, ahead_s) = (f64::from(grid.tick_s), self.view.now.seconds_since(grid.origin));
        let capacity = battery.capacity as f64;
        let per_tick = |soc_per_s: f64| ((soc_per_s * tick_s * capacity).round() as i64).max(0);
        let drain = per_tick(robot.drain_soc_per_s);
        // At the begin of the grid a little more was stored.
        let energy = ((robot.soc.value.max(0.0) + robot.drain_soc_per_s * ahead_s) * capacity) as i64;
        let whole = |time_s: f64| ((time_s + ahead_s) / tick_s).clamp(-1.0, 1e9).floor() as i64;
        // In whole ticks, as the planner counts: who has less than a tick to spare is sent by what is expected.
        let is_in_reach = robot.ways.iter().any(|way| {
            let station = &self.view.stations[way.station];
            let serves = !station.bays.is_empty() || self.racks.given(self.view, robot, way.station).is_some();
            serves && whole(way.lasts.surely_s) >= i64::from(grid.up(way.time_s.max(station.opens_s) + ahead_s))
        });
        let last_tick = |lasts: &Lasts| whole(lasts.counted_s(is_in_reach));
        let endures = last_tick(&robot.lasts).max(0);
        // The least drain by which it is empty after that many whole ticks.
        let drain_hi = if endures < 1_000_000_000 { energy / (endures + 1) + 1 } else { 1 };
        let drain_hi = drain_hi.max(drain).max(1);
        // Everybody's next service is planned: who lasts longer than anybody plans ahead gets it at the end. Where that time lies between the last
        // tick in which a service can begin and the next one, it is wanted in that last one.
        let last_start = robot.ways.iter().map(|way| last_tick(&way.lasts)).max().filter(|&last| last >= 0);
        let last_start = last_start.map_or(Tick::MAX, |last| last.min(i64::from(Tick::MAX)) as Tick);
        let wanted = grid.up(robot.wanted_s.min(HORIZON_MAX_S) + ahead_s).min(last_start);
        let promised = self.before.get(&robot.robot).and_then(|planned| Some((grid.tick(planned.start)?, planned.mode)));
        let full = self.levels_soc.len() - 1;
        let was_promised = promised.and_then(|(_, mode)| if let Mode::Charge(level) = mode { Some(usize::from(level)) } else { None });
        let (may_come_early, may_leave_early) = match self.offer {
            Offer::Usual => (false, false),
            Offer::Early => (true, false),
            Offer::Scarce => (true, true),
            Offer::Rest(robots) | Offer::Spares(robots) => [robots.contains(&robot.robot); 2].into(),
        };
        let lowest_target = if may_leave_early { 0 } else { was_promised.map_or(full, |level| level.min(full)) };
        let gate = if may_come_early { 0 } else { promised.map_or(wanted, |(start, _)| start.min(wanted)) };
        let from_soc = robot.soc.value - robot.drain_soc_per_s * robot.wanted_s.min(HORIZON_MAX_S);
        let travel = robot.ways.iter().map(|way| {
            let arrives = Estimate::new((from_soc - way.extra_soc.value).max(0.0), robot.soc.sigma.hypot(way.extra_soc.sigma));
            // By so much more it must begin earlier than the pack is empty by work alone.
            let earlier = energy.div_euclid(drain_hi) - last_tick(&way.lasts);
            Travel {
                station: way.station,
                ticks: grid.up(way.time_s + ahead_s),
                extra: (way.extra_soc.value * capacity).round() as i64,
                extra_hi: drain_hi * earlier,
                variance: way.table.own_variance(arrives) * UNITS_PER_WH.powi(2),
                spares: self.racks.given(self.view, robot, way.station),
            }
        });
        let least = if robot.weight > 0.0 { 1.0 } else { 0.0 };
        let weight = (robot.weight * self.worth).round().clamp(least, WEIGHT_MAX) as i64;
        Robot {
            name: robot.robot.to_string(),
            battery: kind,
            energy,
            drain,
            drain_hi,
            drain_served: per_tick(robot.drain_hi_soc_per_s).max(drain).max(1),
            mission_end: 0,
            weight,
            critical: None,
            not_before: gate,
            wanted: Some(wanted),
            held: robot.held,
            lowest_target,
            travel: travel.collect(),
            beyond: Vec::new(),
        }
    }
}
