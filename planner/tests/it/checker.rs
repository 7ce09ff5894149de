//! Simulates a plan tick by tick by the rules of the format. Shares no code with the planner.

use planner::problem::{Problem, Station};
use planner::{Mode, Plan};

/// Stored energy and the draws of each tick while charging from `energy` to `target`.
fn charged(problem: &Problem, mut energy: i64, target: i64, bare: bool) -> (i64, Vec<i64>) {
    let mut draws = Vec::new();
    while energy < target {
        let segment = problem.batteries[0].chargers[0].curve.iter().find(|segment| energy < segment.below).expect("a segment");
        energy = (energy + segment.gain).min(problem.batteries[0].capacity);
        draws.push(if bare { segment.draw_bare } else { segment.draw });
    }
    (energy, draws)
}

/// The plan's four levels.
///
/// # Panics
/// When the plan breaks a rule.
pub fn judged(problem: &Problem, plan: &Plan) -> [i64; 4] {
    let horizon = problem.horizon as usize;
    let battery = &problem.batteries[0];
    let swap_energy = battery.chargers[0].swap_energy;
    let (mut energy, mut packs) = (0, 0);
    let mut owed = vec![0; problem.robots.len()];
    let mut outcome: Vec<Option<(i64, i64, i64, i64)>> = vec![None; problem.robots.len()];
    for (at, station) in problem.stations.iter().enumerate() {
        let mut load = vec![station.hotel; horizon];
        let (mut lift, mut slot) = (vec![0; horizon], vec![0; horizon]);
        let mut bays = vec![vec![0; horizon]; station.bays as usize];
        let mut ready: Vec<(u16, usize)> = station.spares.iter().map(|spare| (spare.kind, spare.ready as usize)).collect();
        let mut handed_out: Vec<(u16, usize)> = Vec::new();
        for ongoing in &station.ongoing {
            for tick in 0..horizon.min(ongoing.until as usize) {
                load[tick] += ongoing.draw;
                bays[ongoing.bay.expect("a charge") as usize][tick] += 1;
                lift[tick] += i64::from(tick + ongoing.unload_ticks as usize >= ongoing.until as usize);
            }
        }
        for session in plan.sessions.iter().filter(|session| session.station == at) {
            let robot = &problem.robots[session.robot];
            let travel = robot.travel.iter().find(|travel| travel.station == at).expect("in reach");
            let start = session.start as usize;
            assert!(session.start >= travel.ticks, "arrives before it can");
            assert!(session.start >= station.opens, "is taken in before the station is there");
            assert!(robot.energy - travel.extra_hi - robot.drain_hi * start as i64 >= battery.floor, "may be empty before");
            assert!(outcome[session.robot].is_none(), "serviced twice");
            let least_gain = if robot.held { battery.min_gain / 2 } else { battery.min_gain };
            let arrived = robot.energy - travel.extra - robot.drain * start as i64;
            let (stored, end) = if let Mode::Charge(level) = session.mode {
                let target = battery.targets[usize::from(level)];
                assert!(usize::from(level) >= robot.lowest_target, "ends below what is on offer");
                owed[session.robot] = battery.chargers[0].owed.get(usize::from(level)).map_or(0, |&ticks| i64::from(ticks));
                assert!(target - arrived >= least_gain, "gains too little");
                let (stored, draws) = charged(problem, arrived, target, false);
                let (loading, unloading) = (station.load_ticks as usize, station.unload_ticks as usize);
                let end = start + loading + draws.len() + unloading;
                assert!(end <= horizon, "ends too late");
                for tick in start..end {
                    let moved = tick < start + loading || tick >= end - unloading;
                    lift[tick] += i64::from(moved);
                    bays[session.bay.expect("a bay") as usize][tick] += 1;
                    load[tick] += if tick < start + loading {
                        station.load_draw
                    } else if moved {
                        station.unload_draw
                    } else {
                        draws[tick - start - loading]
                    };
                }
                (stored, end)
            } else {
                assert!(swap_energy - arrived >= least_gain, "gains too little");
                let end = start + station.swap_ticks as usize;
                assert!(end <= horizon, "ends too late");
                for tick in start..end {
                    slot[tick] += 1;
                    load[tick] += station.swap_draw;
                }
                let kind = travel.spares.expect("a spare that fits");
                handed_out.push((kind, start));
                if session.mode == Mode::SwapAndRecharge {
                    let (_, draws) = charged(problem, arrived, battery.chargers[0].again_energy, true);
                    for (tick, draw) in (end..horizon).zip(&draws) {
                        load[tick] += draw;
                    }
                    ready.push((kind, end + draws.len()));
                }
                (swap_energy, end)
            };
            assert_eq!(session.end as usize, end, "the end as told");
            for away in &station.away {
                let leaves = away.start + if robot.held { station.away_slack } else { 0 };
                assert!((session.start..session.end).all(|tick| !(leaves..away.end).contains(&tick)), "is there while the station is not");
            }
            outcome[session.robot] = Some((start as i64, i64::from(travel.ticks), end as i64, stored - travel.extra));
        }
        for tick in 0..horizon {
            assert!(bays.iter().all(|bay| bay[tick] <= 1), "a bay is booked twice in tick {tick} of station {at}");
            assert!(lift[tick] <= station.lift_slots, "the lift is booked twice in tick {tick} of station {at}");
            assert!(slot[tick] <= station.swap_slots, "the place for exchanges is booked twice in tick {tick} of station {at}");
            assert!(load[tick] <= station.p_max, "station {at} draws too much in tick {tick}");
            for kind in 0..station.kinds_of_spares() as u16 {
                let by_now = |events: &[(u16, usize)]| events.iter().filter(|&&(of, at)| of == kind && at <= tick).count();
                assert!(by_now(&handed_out) <= by_now(&ready), "a spare of kind {kind} of station {at} is handed out twice");
            }
        }
        let (taken, touched) = drained(station, &plan.pack_order[at], &load);
        energy += taken;
        packs += touched;
    }
    let (mut stranded, mut cost) = (0, 0);
    for ((robot, outcome), owed) in problem.robots.iter().zip(&outcome).zip(owed) {
        cost += robot.weight * owed;
        let until_empty = |energy: i64| (energy - battery.floor).div_euclid(robot.drain_hi);
        let alone = until_empty(robot.energy).max(0);
        stranded += i64::from(outcome.is_none() && alone < robot.mission_end.min(i64::from(problem.horizon)));
        for tick in 0..robot.mission_end {
            let works = outcome.map_or(tick < alone, |(start, travel, end, stored)| {
                tick < start - travel || (tick >= end + travel && tick < end + until_empty(stored))
            });
            let critical = robot.critical.filter(|critical| (critical.from..critical.to).contains(&tick));
            cost += i64::from(!works) * (robot.weight + critical.map_or(0, |critical| critical.weight));
        }
    }
    [stranded, cost, energy, packs]
}

/// Drains packs in order; what is taken from them and how many are touched.
fn drained(station: &Station, order: &[usize], load: &[i64]) -> (i64, i64) {
    let first = &station.packs[*order.first().expect("a pack on line")];
    assert!(first.available_from <= 0, "the first pack is not there");
    let (mut place, mut left, mut taken) = (0, first.remaining - first.reserve, 0);
    for (tick, &draw) in load.iter().enumerate() {
        let mut draw = draw;
        taken += draw;
        while draw > left {
            draw -= left;
            place += 1;
            let next = &station.packs[*order.get(place).unwrap_or_else(|| panic!("blackout in tick {tick}"))];
            assert!(next.available_from <= tick as i64 && next.remaining - next.reserve >= station.switch_cost, "blackout in tick {tick}");
            left = next.remaining - next.reserve - station.switch_cost;
            taken += station.switch_cost;
        }
        left -= draw;
    }
    (taken, place as i64 + 1)
}
