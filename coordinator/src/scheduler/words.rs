//! Why a robot is serviced as it is, why not otherwise, and what would have to change.

use std::collections::BTreeMap;

use energy::Channel;
use planner::book::Clash;
use planner::problem::Tick;
use planner::reasons::Why;
use planner::{Explained, Explainer, Mode, Session, Unserved, Ways, explain::Other};
use proto::{PackId, RobotId, StationId, Timestamp};
use statrs::distribution::{ContinuousCDF, Normal};

use super::translate::{HORIZON_MAX_S, Task};

/// What can be told of a robot's place in a plan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Account {
    /// Why not earlier.
    pub earlier: Vec<String>,
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

/// Why a service is planned as it is, as far as it is told: figures as whole numbers of what is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Grounds {
    /// When it comes, against when it is wanted, min.
    comes: Comes,
    /// When the robot may be empty without it, or how likely it lasts until then, %.
    without: Without,
    /// Level at which a charge ends below the usual one, %.
    only_to: Option<i64>,
    /// Whether the packs may not last for charging what an exchange leaves.
    leaves_uncharged: bool,
    /// What it takes, tenths of a Wh.
    need: i64,
    /// How likely the packs hold that, tenths of a percent.
    covered: i64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Comes {
    Before(i64),
    After(i64),
    AtOnce,
    #[default]
    WhenWanted,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Without {
    /// Minutes since 1970.
    EmptyAt(i64),
    Lasts(i64),
}

impl Default for Without {
    fn default() -> Self {
        Self::EmptyAt(0)
    }
}

impl Grounds {
    /// Those of a service. Its packs cover it and the robot arrives with these probabilities.
    pub(super) fn new(task: &Task, session: &Session, need_wh: f64, covered: f64, arrives: f64) -> Self {
        let robot = &task.problem.robots[session.robot];
        let away = robot.travel.iter().find(|travel| travel.station == session.station).map_or(0, |travel| travel.ticks);
        let wanted = robot.wanted.unwrap_or(0).max(away);
        let minutes = |ticks: Tick| f64::from(ticks) * f64::from(task.grid.tick_s) / 60.0;
        let (before, after) = (minutes(wanted.saturating_sub(session.start)), minutes(session.start.saturating_sub(wanted)));
        let comes = if before >= 0.5 {
            Comes::Before(before.round() as i64)
        } else if after >= 0.5 {
            Comes::After(after.round() as i64)
        } else if robot.wanted.is_none_or(|wanted| away >= wanted) {
            Comes::AtOnce
        } else {
            Comes::WhenWanted
        };
        let empty = Tick::try_from(task.problem.endurance(session.robot)).unwrap_or(Tick::MAX).min(task.problem.horizon);
        let without = if arrives < 1.0 {
            Without::Lasts((arrives * 100.0).round() as i64)
        } else {
            let handled_s = task.view.robots[session.robot].handled_s;
            Without::EmptyAt(task.grid.time(empty).plus_s(handled_s).unix_ms().div_euclid(60_000))
        };
        let to_soc = task.to_soc(session.mode);
        let only_to =
            (session.mode != task.full_charge() && matches!(session.mode, Mode::Charge(_))).then(|| (to_soc * 100.0).round() as i64);
        let leaves_uncharged = session.mode == Mode::Swap && task.charge_after(session).is_some();
        Self {
            comes,
            without,
            only_to,
            leaves_uncharged,
            need: (need_wh * 10.0).round() as i64,
            covered: (covered * 1000.0).round() as i64,
        }
    }

    /// Why this service: what it saves, when it comes, and who pays.
    pub(super) fn words(&self, packs: &[PackId]) -> Vec<String> {
        let comes = match self.comes {
            Comes::Before(minutes) => format!("comes {minutes} min before it is wanted: later no place would be free in time"),
            Comes::After(minutes) => format!("comes {minutes} min after it is wanted"),
            Comes::AtOnce => "comes as soon as the robot can be there".to_owned(),
            Comes::WhenWanted => "comes when it is wanted".to_owned(),
        };
        let without = match self.without {
            Without::Lasts(percent) => format!("the robot may be empty before that, and lasts with probability {percent} %"),
            Without::EmptyAt(minute) => format!("without it the robot may be empty at {}", clock(Timestamp::from_unix_ms(minute * 60_000))),
        };
        let tenths = |figure: i64| format!("{:.1}", figure as f64 / 10.0);
        let from = list(packs.iter().map(AsRef::as_ref), "no pack");
        let (need, covered) = (tenths(self.need), tenths(self.covered));
        let only = self.only_to.map(|percent| {
            format!("is charged to {percent} % only: a whole charge would take place or energy from others, or more than there is")
        });
        let left = self.leaves_uncharged.then(|| "the pack that it leaves is charged as far as the station's packs last".to_owned());
        let takes = format!("takes {need} Wh from {from}; the packs hold it with probability {covered} %");
        [format!("{comes}; {without}")].into_iter().chain(only).chain([takes]).chain(left).collect()
    }
}

/// Why a robot has no service: one reason per station that it could reach.
pub(super) fn why_not(task: &Task, plan: &planner::Plan, unserved: &Unserved, confidence: f64) -> Vec<String> {
    let view = &task.view.robots[unserved.robot];
    let closed = view.closed.iter().map(|(station, why)| format!("{station} takes no part: {why}"));
    let told = |obstacle: &planner::reasons::Obstacle| {
        let station = &task.view.stations[obstacle.station].station;
        let why = match (obstacle.why, never_charged(task, unserved.robot, obstacle.station)) {
            (Why::TooLate { .. } | Why::Pointless, Some(why)) => why,
            (why, cold) => {
                let why = obstacle_in_words(task, plan, unserved.robot, obstacle.station, why, confidence);
                cold.map_or_else(|| why.clone(), |cold| format!("{why}, and {cold}"))
            }
        };
        format!("{station}: {why}")
    };
    if !unserved.stranded && unserved.obstacles.iter().all(|obstacle| obstacle.why == Why::Pointless) && view.closed.is_empty() {
        return vec![if view.travel.is_empty() { "no station is in reach" } else { "it needs none as far as is planned" }.to_owned()];
    }
    let mut reasons: Vec<String> = closed.chain(unserved.obstacles.iter().map(told)).collect();
    if reasons.is_empty() {
        reasons.push("no station is in reach".to_owned());
    }
    reasons
}

/// Why charging a robot there would never end.
fn never_charged(task: &Task, robot: usize, station: usize) -> Option<String> {
    let view = &task.view.robots[robot];
    if task.view.stations[station].bays.is_empty() {
        return None;
    }
    let table = view.travel.iter().find(|(index, ..)| *index == station).map(|(.., table)| table)?;
    let comes_soc = view.soc.value - view.drain_soc_per_s * view.wanted_s.min(HORIZON_MAX_S);
    let why = table.at(comes_soc).stopped?;
    let limit = view.battery.battery().protection.get(why);
    let doubt_degc = view.battery.sensor(Channel::TemperatureDegc).offset_sigma;
    let (is_degc, trip_degc, again_degc) = (view.temperature_degc, limit.trip, limit.release);
    let is_so = if why.is_lower() { is_degc < trip_degc } else { is_degc > trip_degc };
    Some(match why.is_lower() {
        true if is_so => format!("its battery is {why}: it is at {is_degc:.1} °C, and takes none below {trip_degc:.0} °C"),
        true => format!("its battery may be {why}: it is at {is_degc:.1} ± {doubt_degc:.1} °C, and takes none below {trip_degc:.0} °C"),
        false if is_so => format!("its battery is {why}: it is at {is_degc:.1} °C, and takes none above {trip_degc:.0} °C"),
        false => format!(
            "its battery would get {why}: it is at {is_degc:.1} ± {doubt_degc:.1} °C, passes {trip_degc:.0} °C while it is charged, and takes none again above {again_degc:.0} °C"
        ),
    })
}

fn obstacle_in_words(task: &Task, plan: &planner::Plan, robot: usize, station: usize, why: Why, confidence: f64) -> String {
    let minutes = |ticks: f64| ticks * f64::from(task.grid.tick_s) / 60.0;
    match why {
        Why::TooFar { away, endurance } => {
            let handled = task.view.robots[robot].handled_s / 60.0;
            let taken_in = if handled >= 1.0 { format!(", where it takes {handled:.0} min until it is served") } else { String::new() };
            let (away, empty) = (minutes(f64::from(away)), minutes(endurance as f64) + handled);
            format!("it is {away:.0} min away{taken_in}, and the robot may be empty in {empty:.0} min")
        }
        Why::NotThere { opens, endurance } => format!(
            "it is on its way and takes robots in from {}, and the robot may be empty in {:.0} min",
            clock(task.grid.time(opens)),
            minutes(endurance as f64) + task.view.robots[robot].handled_s / 60.0
        ),
        Why::NoPlace => "no bay works, and no charged spare is left".to_owned(),
        Why::NoFit => "no bay works, and none of the spares fits".to_owned(),
        Why::TooLate { .. } => "no service that adds enough ends in time".to_owned(),
        Why::Pointless => "a service there would cost more work than it gives".to_owned(),
        Why::Free { start, cost, unserved } => format!(
            "could begin at {}, but would miss {:.0} min of work where no service misses {:.0} min",
            clock(task.grid.time(start)),
            task.work_s(i64::from(cost)) / 60.0,
            task.work_s(i64::from(unserved)) / 60.0
        ),
        Why::Taken { start, mode, clash: Clash::Energy(_, short), .. } => {
            let (odds, asked) = odds(task, &plan.sessions, robot, station, (start, mode), short, confidence);
            let [odds, asked] = apart(odds * 100.0, asked * 100.0);
            format!("{}: enough with probability {odds} %, asked for {asked} %", energy(task, station, short, (start, mode)))
        }
        Why::Taken { start, mode, clash, .. } => clash_in_words(task, station, (start, mode), clash, &[]),
    }
}

/// Two figures, with as many decimals as it takes to tell them apart, up to three.
pub(crate) fn apart(one: f64, other: f64) -> [String; 2] {
    let told = |decimals: usize| [one, other].map(|figure| format!("{figure:.decimals$}"));
    (0..3).map(told).find(|[one, other]| one != other).unwrap_or_else(|| told(3))
}

/// Energy that is short, with as many decimals as it takes to be more than nothing, up to three.
pub(crate) fn short_of(wh: f64) -> String {
    let decimals = if wh > 0.0 { (1..3).find(|decimals| wh >= 0.5 * 0.1_f64.powi(*decimals)).unwrap_or(3) } else { 1 };
    format!("{wh:.0$}", decimals as usize)
}

/// Which packs are short of what for which service.
fn energy(task: &Task, station: usize, short: i64, (start, mode): (Tick, Mode)) -> String {
    let packs = &task.view.stations[station].packs;
    let is = if packs.len() == 1 { "is" } else { "are" };
    let names = list(packs.iter().map(|pack| pack.pack.as_ref()), "its empty packs");
    let service = match mode {
        Mode::Charge(_) if mode != task.full_charge() => format!("a charge to {:.0} %", task.to_soc(mode) * 100.0),
        _ => "a service".to_owned(),
    };
    format!("{names} {is} {} Wh short for {service} at {}", short_of(task.problem.wh(short)), clock(task.grid.time(start)))
}

/// Probability that the packs would do for this service as well, and the one that was asked for.
fn odds(
    task: &Task,
    sessions: &[Session],
    robot: usize,
    station: usize,
    (start, mode): (Tick, Mode),
    short: i64,
    confidence: f64,
) -> (f64, f64) {
    let Some(chance) = &task.problem.stations[station].chance else { return (0.0, 1.0) };
    let here = sessions.iter().filter(|session| session.station == station);
    let mut need = task.need(robot, station, start, mode);
    let mut last = start;
    for session in here.clone() {
        need = need.plus(&task.need(session.robot, station, session.start, session.mode));
        last = last.max(session.end);
    }
    let units = task.problem.units_per_wh as f64;
    let sigma = chance.sigma(last, (need.mean_wh * units) as i64, need.own_variance * units * units).max(1.0);
    let held = here.clone().all(|session| task.problem.robots[session.robot].held) && task.problem.robots[robot].held;
    let normal = Normal::standard();
    let (quantile, asked) = if held { (chance.quantile_held, normal.cdf(chance.quantile_held)) } else { (chance.quantile, confidence) };
    (normal.cdf(quantile - short as f64 / sigma), asked)
}

fn clash_in_words(task: &Task, station: usize, service: (Tick, Mode), clash: Clash, blockers: &[usize]) -> String {
    let at = |tick: Tick| clock(task.grid.time(tick));
    let by = || {
        let names: Vec<&RobotId> = blockers.iter().map(|&robot| &task.view.robots[robot].robot).collect();
        if names.is_empty() { String::new() } else { format!(", planned for {}", list(names.iter().map(|name| name.as_ref()), "")) }
    };
    match clash {
        Clash::Bay(tick) => format!("every bay is taken at {}{}", at(tick), by()),
        Clash::Lift(tick) => format!("the lift is taken at {}{}", at(tick), by()),
        Clash::Slot(tick) => format!("the place for exchanges is taken at {}{}", at(tick), by()),
        Clash::Spare(tick, _) => format!("no charged spare{} is left at {}{}", that_fits(task, station), at(tick), by()),
        Clash::Power(tick, short) => format!("the station may not draw {:.1} Wh more at {}{}", task.problem.wh(short), at(tick), by()),
        Clash::Energy(_, short) => format!("{}{}", energy(task, station, short, service), by()),
    }
}

/// Where spares are of several kinds, it is one that fits that is meant.
fn that_fits(task: &Task, station: usize) -> &'static str {
    if task.problem.stations[station].kinds_of_spares() > 1 { " that fits it" } else { "" }
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
        let Explained { cost, others, earlier, .. } = self.explainer.explain(index);
        let others = others.iter().map(|other| alternative(self.task, other, cost));
        let session = self.sessions.get(&index);
        Account {
            others: others.collect(),
            earlier: session.map_or_else(Vec::new, |session| vec![self.why_not_earlier(session, earlier.as_ref())]),
        }
    }

    /// What would have to change for a robot to be serviced earlier.
    fn why_not_earlier(&self, session: &Session, earlier: Option<&Other>) -> String {
        let task = self.task;
        let robot = &task.problem.robots[session.robot];
        match earlier {
            Some(other) => match other.clash {
                Some(clash) => format!(
                    "to begin at {} instead: {}",
                    clock(task.grid.time(other.start)),
                    clash_in_words(task, other.station, (other.start, other.mode), clash, &other.blockers)
                ),
                None => {
                    let more_s = task.work_s(other.cost - self.cost_of(session));
                    let why = if more_s < 0.0 { NOT_MOVED } else { "a service is wanted later" };
                    format!("it could begin at {}, and would miss {}: {why}", clock(task.grid.time(other.start)), missed(more_s))
                }
            },
            None if robot.not_before >= session.start => {
                format!(
                    "no: it is wanted at {}, when its charge falls to where [policy] serve_below_soc has it",
                    clock(task.grid.time(robot.wanted.unwrap_or(0)))
                )
            }
            None => "no: the robot is on its way as soon as it can be".to_owned(),
        }
    }

    fn cost_of(&self, session: &Session) -> i64 {
        let choices = self.ways.of(session.robot);
        let way = choices.find(session.station, session.start, session.mode);
        way.map_or(i64::from(choices.unserved_cost), |way| i64::from(choices.ways[way].cost))
    }
}

fn alternative(task: &Task, other: &Other, cost: i64) -> Alternative {
    let mode = if matches!(other.mode, Mode::Charge(_)) { "recharge" } else { "swap" };
    let beyond = match other.clash {
        Some(clash) => clash_in_words(task, other.station, (other.start, other.mode), clash, &other.blockers),
        None => {
            let more_s = task.work_s(other.cost - cost);
            let but = if more_s < 0.0 { format!(": {NOT_MOVED}") } else { String::new() };
            format!("it would miss {} and takes {:.1} Wh{but}", missed(more_s), task.problem.wh(other.energy))
        }
    };
    Alternative {
        station: task.view.stations[other.station].station.clone(),
        mode,
        start: other.clash.is_none().then(|| task.grid.time(other.start)),
        why_not: vec![beyond],
    }
}

/// Why what is better by itself is not chosen: the planner weighs what it moves (`planner::replan`).
const NOT_MOVED: &str = "too little to move a service for that was told already";

fn missed(more_s: f64) -> String {
    format!("{:.1} min {} of work", more_s.abs() / 60.0, if more_s < 0.0 { "less" } else { "more" })
}

/// The time of day, to the minute.
pub(crate) fn clock(at: Timestamp) -> String {
    let minute = at.unix_ms().div_euclid(60_000);
    format!("{:02}:{:02}", minute.div_euclid(60).rem_euclid(24), minute.rem_euclid(60))
}

fn list<'a>(names: impl Iterator<Item = &'a str>, none: &str) -> String {
    let names: Vec<&str> = names.collect();
    if names.is_empty() { none.to_owned() } else { names.join(" and ") }
}
