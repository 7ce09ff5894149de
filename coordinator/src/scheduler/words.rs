//! Why a robot is serviced as it is, why not otherwise, and what would have to change.

mod accounts;
mod grounds;

use energy::Channel;
use planner::book::Clash;
use planner::problem::Tick;
use planner::reasons::Why;
use planner::{Mode, Session, Unserved};
use statrs::distribution::{ContinuousCDF, Normal};

pub use accounts::{Account, Accounts};
pub use grounds::Grounds;

use super::translate::{HORIZON_MAX_S, Task};
use crate::when::minute_from;

/// Why a robot has no service: one reason per station that it could reach.
pub(super) fn why_not(task: &Task, plan: &planner::Plan, unserved: &Unserved, confidence: f64) -> Vec<String> {
    let view = &task.view.robots[unserved.robot];
    let closed = view.closed.iter().map(|(station, why)| format!("{station} takes no part: {why}"));
    let told = |obstacle: &planner::reasons::Obstacle| {
        let station = &task.view.stations[obstacle.station].station;
        let why = match (&obstacle.why, never_charged(task, unserved.robot, obstacle.station)) {
            (Why::TooLate { .. } | Why::Pointless, Some(why)) => why,
            (why, cold) => {
                let why = obstacle_in_words(task, plan, unserved.robot, obstacle.station, why, confidence);
                cold.map_or_else(|| why.clone(), |cold| format!("{why}, and {cold}"))
            }
        };
        format!("{station}: {why}")
    };
    if !unserved.stranded && unserved.obstacles.iter().all(|obstacle| matches!(obstacle.why, Why::Pointless)) && view.closed.is_empty() {
        return vec![if view.ways.is_empty() { "no station is in reach" } else { "it needs none as far as is planned" }.to_owned()];
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
    let table = &view.way(station)?.table;
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

fn obstacle_in_words(task: &Task, plan: &planner::Plan, robot: usize, station: usize, why: &Why, confidence: f64) -> String {
    let minutes = |ticks: f64| ticks * f64::from(task.grid.tick_s) / 60.0;
    match *why {
        Why::TooFar { last: ..0, .. } | Why::NotThere { last: ..0, .. } => "the way there takes more than the robot may have".to_owned(),
        Why::TooFar { away, last } => {
            let handled = task.view.stations[station].taken_in_s() / 60.0;
            let taken_in = if handled >= 1.0 { format!(", where it takes {handled:.0} min until it is served") } else { String::new() };
            // As it is, not as ticks round it.
            let view = &task.view.robots[robot];
            let way = view.way(station);
            let away = way.map_or(minutes(f64::from(away)), |way| way.time_s / 60.0);
            let last = way.map_or(minutes(last as f64), |way| way.lasts.counted_s(view.is_in_reach(&task.view.stations)).max(0.0) / 60.0)
                + handled;
            format!("it is {away:.0} min away{taken_in}, and with that way the robot may be empty in {last:.0} min")
        }
        Why::NotThere { opens, last } => format!(
            "it is on its way and takes robots in from {}, and with the way there the robot may be empty in {:.0} min",
            on_clock(task, opens),
            minutes(last as f64) + task.view.stations[station].taken_in_s() / 60.0
        ),
        Why::Leaves { ref away } => {
            let back = match away.end < task.problem.horizon {
                true => format!(" or begins in time once it is back at {}", on_clock(task, away.end)),
                false => String::new(),
            };
            let (told, all) = (&task.view.stations[station].away_s, &task.problem.stations[station].away);
            let leaves_s = all.iter().position(|one| one == away).and_then(|place| told.get(place)).map_or(0.0, |away_s| away_s.start);
            let leaves = minute_from(task.view.now, task.view.now.plus_s(leaves_s));
            format!("it leaves at {leaves}, and no service that adds enough ends before{back}")
        }
        Why::NoPlace => "no bay works, and no charged spare is left".to_owned(),
        Why::NoFit => "no bay works, and none of the spares fits".to_owned(),
        Why::TooLate { .. } => "no service that adds enough ends in time".to_owned(),
        Why::Pointless => "a service there would cost more work than it gives".to_owned(),
        Why::Free { start, cost, unserved } => {
            let (misses, none) = (task.work_s(i64::from(cost)) / 60.0, task.work_s(i64::from(unserved)) / 60.0);
            let (but, own) = if task.policy.searches() {
                (", but would miss", String::new())
            } else {
                (" and would miss", format!(": the policy {} does not ask for that", task.policy.name()))
            };
            format!("could begin at {}{but} {misses:.0} min of work where no service misses {none:.0} min{own}", on_clock(task, start))
        }
        Why::Taken { start, mode, ref lacks, .. } => {
            let in_words = |clash: &Clash| match *clash {
                Clash::Energy(before, short) => {
                    let (odds, asked) = odds(task, &plan.sessions, robot, station, (start, mode), (before, short), confidence);
                    let [odds, asked] = apart(odds * 100.0, asked * 100.0);
                    format!("{}: enough with probability {odds} %, asked for {asked} %", energy(task, station, short, (start, mode)))
                }
                clash => clash_in_words(task, station, (start, mode), clash),
            };
            lacks.iter().map(in_words).collect::<Vec<_>>().join(", and ")
        }
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
    format!("{names} {is} {} Wh short for {service} at {}", short_of(task.problem.wh(short)), on_clock(task, start))
}

/// Probability that the packs would do for this service as well, and the one that was asked for.
fn odds(
    task: &Task,
    sessions: &[Session],
    robot: usize,
    station: usize,
    (start, mode): (Tick, Mode),
    (before, short): (Tick, i64),
    confidence: f64,
) -> (f64, f64) {
    let Some(chance) = &task.problem.stations[station].chance else { return (0.0, 1.0) };
    // What a pack that comes then has to do with is not short before.
    let here = sessions.iter().filter(|session| session.station == station && session.start < before);
    let mut need = task.need(robot, station, start, mode);
    let mut last = start;
    for session in here.clone() {
        need = need.plus(&task.need(session.robot, station, session.start, session.mode));
        last = last.max(session.end);
    }
    let units = task.problem.units_per_wh as f64;
    let sigma = chance.sigma(last.min(before), (need.mean_wh * units) as i64, need.own_variance * units * units).max(1.0);
    let held = here.clone().all(|session| task.problem.robots[session.robot].held) && task.problem.robots[robot].held;
    let normal = Normal::standard();
    let (quantile, asked) = if held { (chance.quantile_held, normal.cdf(chance.quantile_held)) } else { (chance.quantile, confidence) };
    (normal.cdf(quantile - short as f64 / sigma), asked)
}

fn clash_in_words(task: &Task, station: usize, service: (Tick, Mode), clash: Clash) -> String {
    let at = |tick: Tick| on_clock(task, tick);
    match clash {
        Clash::Bay(tick) if task.view.stations[station].unfed > 0 => {
            format!("every bay that the converters feed at once is taken at {}", at(tick))
        }
        Clash::Bay(tick) => format!("every bay is taken at {}", at(tick)),
        Clash::Lift(tick) => format!("the lift is taken at {}", at(tick)),
        Clash::Slot(tick) => format!("the place for exchanges is taken at {}", at(tick)),
        Clash::Spare(tick, _) => format!("no charged spare{} is left at {}", that_fits(task, station), at(tick)),
        Clash::Power(tick, short) => format!("the station may not draw {:.1} Wh more at {}", task.problem.wh(short), at(tick)),
        Clash::Energy(_, short) => energy(task, station, short, service),
    }
}

/// Where spares are of several kinds, it is one that fits that is meant.
fn that_fits(task: &Task, station: usize) -> &'static str {
    if task.problem.stations[station].kinds_of_spares() > 1 { " that fits it" } else { "" }
}

/// When a tick begins, to the minute.
fn on_clock(task: &Task, tick: Tick) -> String {
    minute_from(task.view.now, task.grid.time(tick))
}

fn list<'a>(names: impl Iterator<Item = &'a str>, none: &str) -> String {
    let names: Vec<&str> = names.collect();
    if names.is_empty() { none.to_owned() } else { names.join(" and ") }
}
