//! Plans of instance files within a CPU time: robots, time, levels, bound, gap.
//!
//! `cargo bench -p planner -- FILE.json SECONDS ...` plans pairs of file and time, or number of moves
//! (`FILE.json 2000m`); without arguments it plans the small instances of the tests, rolls fifty robots through two hundred
//! services, and mends the plan of a thousand. `PLAN_SEED` names another seed than 1.

#![allow(clippy::disallowed_methods, reason = "a bench measures time")]

use std::path::Path;
use std::time::Instant;

use planner::problem::{Problem, Robot, Travel};
use planner::{Budget, Instance, Moves, Session, plan, policies, replan};
use rustix::time::{ClockId, clock_gettime};

/// Fleets of this size are planned on several threads: their budget is time, that of smaller ones CPU time.
const LARGE: usize = 128;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    println!(
        "{:<26} {:>8} {:>18} {:>9} {:>9} {:>9} {:>10} {:>10} {:>8}",
        "instance", "robots", "policy", "time s", "CPU s", "stranded", "missed", "bound", "gap %"
    );
    if arguments.is_empty() {
        for name in ["6-1-1", "8-1-1", "12-2-1", "16-2-1"] {
            let path = format!("{}/tests/instances/{name}.json", env!("CARGO_MANIFEST_DIR"));
            show(&read(Path::new(&path)).problem, 0.2, "optimise");
        }
        for policy in policies() {
            show(&fleet(1000, 50), 1.0, policy.name());
        }
        for (robots, stations) in [(1000, 50), (10_000, 200)] {
            show(&fleet(robots, stations), 0.0, "optimise");
        }
        roll();
        mend();
    }
    for pair in arguments.chunks(2) {
        let (problem, limit) = (read(Path::new(&pair[0])).problem, pair.get(1).map_or("1", String::as_str));
        match limit.strip_suffix('m') {
            Some(moves) => planned(&problem, "optimise", &mut Moves(moves.parse().expect("a number of moves"))),
            None => show(&problem, limit.parse().expect("seconds"), "optimise"),
        }
    }
}

/// CPU time of all threads, s: a busy machine does not count.
fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn read(path: &Path) -> Instance {
    Instance::parse(&std::fs::read_to_string(path).expect("an instance file")).expect("a valid instance")
}

fn show(problem: &Problem, budget_s: f64, policy: &str) {
    let (begin, start) = (Instant::now(), cpu_s());
    let took = || if problem.robots.len() < LARGE { cpu_s() - start } else { begin.elapsed().as_secs_f64() };
    let mut used = |_: u64| if budget_s == 0.0 { 1.0 } else { took() / budget_s };
    planned(problem, policy, &mut used);
}

fn planned(problem: &Problem, policy: &str, budget: &mut dyn Budget) {
    let (begin, start) = (Instant::now(), cpu_s());
    let seed = std::env::var("PLAN_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(1);
    let plan = plan(problem, policy, seed, budget).expect("a plan");
    let (levels, robots) = (plan.objective, problem.robots.len());
    println!(
        "{:<26} {robots:>8} {policy:>18} {:>9.4} {:>9.4} {:>9} {:>9} {:>10} {:>8.2}",
        problem.name,
        begin.elapsed().as_secs_f64(),
        cpu_s() - start,
        levels.stranded,
        levels.cost,
        plan.bound.cost,
        100.0 * plan.gaps()[1]
    );
}

/// A fleet made of the stations and robots of a test's instance, copied and varied.
fn fleet(robots: usize, stations: usize) -> Problem {
    let base = read(Path::new(&format!("{}/tests/instances/16-2-1.json", env!("CARGO_MANIFEST_DIR")))).problem;
    let mut problem = Problem { name: format!("copies-{robots}/{stations}"), stations: Vec::new(), robots: Vec::new(), ..base.clone() };
    for number in 0..stations {
        let mut station = base.stations[number % base.stations.len()].clone();
        station.packs.iter_mut().for_each(|pack| pack.remaining += (number as i64 * 2711) % 20_000);
        station.name = number.to_string();
        problem.stations.push(station);
    }
    for number in 0..robots {
        let like = &base.robots[number % base.robots.len()];
        let home = number * stations / robots.max(1);
        let travel = (0..3.min(stations)).map(|next| Travel {
            station: (home + next) % stations,
            ticks: (2 + (number * 7 + next * 5) % 9) as u32,
            extra: 0,
            extra_hi: 0,
            variance: 0.0,
            spares: Some(0),
        });
        let energy = (like.energy + (number as i64 * 977) % 3000).min(base.batteries[0].capacity);
        problem.robots.push(Robot { name: number.to_string(), energy, travel: travel.collect(), ..like.clone() });
    }
    problem
}

/// Plans, lets some time pass, plans again, until two hundred services have begun.
fn roll() {
    const STEP: u32 = 15;
    let mut problem = fleet(50, 6);
    for station in &mut problem.stations {
        station.packs.iter_mut().for_each(|pack| (pack.remaining, pack.available_from) = (2_000_000, 0));
        station.ongoing.clear();
    }
    problem.robots.iter_mut().for_each(|robot| robot.mission_end = 100_000);
    let (mut services, mut plans, mut stranded) = (0, 0, 0);
    let start = cpu_s();
    while services < 200 && plans < 100 {
        let plan = plan(&problem, "optimise", 1, &mut Moves(0)).expect("a plan");
        plans += 1;
        let mut begun: Vec<Option<Session>> = vec![None; problem.robots.len()];
        for session in plan.sessions.iter().filter(|session| session.start < STEP) {
            begun[session.robot] = Some(*session);
            services += 1;
        }
        for (robot, begun) in problem.robots.iter_mut().zip(begun) {
            // A service that has begun is taken as done; what matters here is how fast plans come.
            robot.energy = match begun {
                Some(_) => problem.batteries[0].targets[2],
                None => (robot.energy - i64::from(STEP) * robot.drain).max(0),
            };
            stranded += i64::from(robot.energy <= problem.batteries[0].floor);
        }
    }
    println!("rolling: 50 robots, {services} services, {plans} plans, {:.4} CPU s, {stranded} robots found empty", cpu_s() - start);
}

/// One robot of a thousand changes.
fn mend() {
    let mut problem = fleet(1000, 50);
    let before = plan(&problem, "optimise", 1, &mut Moves(200_000)).expect("a plan");
    let (mut worst, mut sum, mut moved, mut stranded) = (0.0_f64, 0.0, 0, 0);
    for round in 0..40 {
        let changed = before.sessions[(round * 37) % before.sessions.len()].robot;
        let energy = problem.robots[changed].energy;
        problem.robots[changed].energy -= energy / 20;
        let start = cpu_s();
        let mended = replan(&problem, &before.sessions, &[changed], 5, 1, &mut Moves(200));
        let took = cpu_s() - start;
        (worst, sum) = (worst.max(took), sum + took);
        moved += mended.moved.len();
        stranded += mended.plan.objective.stranded - before.objective.stranded;
        problem.robots[changed].energy = energy;
    }
    println!(
        "mending: 1 of 1000 robots changes, {:.2} ms on average, {:.2} ms at most, {:.1} commitments moved, {:.2} more stranded",
        sum * 25.0,
        worst * 1e3,
        f64::from(moved as u32) / 40.0,
        stranded as f64 / 40.0
    );
}
