//! What one robot more costs the core that plans: from its first gauge to the schedule that tells of it, without
//! network and store.
//!
//! ```console
//! $ cargo bench -p coordinator --bench mend
//! ```
//!
//! `TENDER_MEND_ROBOTS` (1000) robots are planned for as a whole; then `TENDER_MEND_NEWCOMERS` (200) join, one a second.

#![allow(clippy::disallowed_methods, reason = "a bench measures time")]

mod fleet;

use std::time::Instant;

use coordinator::config::Config;
use coordinator::core::{Core, Input, Numbering, Output};
use fleet::{NEWCOMER_SOC, gauge, id, pack, pack_gauge, soc_of, state, station_state, stations};
use proto::{RobotId, Timestamp};

/// As in the program.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> anyhow::Result<()> {
    let setting = |name: &str, usual: usize| std::env::var(name).map_or(usual, |text| text.parse().expect("a number"));
    let (robots, newcomers) = (setting("TENDER_MEND_ROBOTS", 1000), setting("TENDER_MEND_NEWCOMERS", 200));
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("coordinator.toml");
    std::fs::write(&path, fleet::config("replan_period_s = 86400"))?;
    let (settings, models) = Config::read(&path)?.load(Some(&path))?;
    let mut core = Core::new(settings, models, Numbering::default());
    let at = |second: usize| Timestamp::from_unix_ms(1_767_225_600_000).plus_s(second as f64);
    let stations = stations();

    say(&mut core, at(0), 0, robots, &stations);
    for second in 1..20 {
        core.handle(at(second), Input::Tick);
        if drain(&mut core) {
            core.handle(at(second), Input::Studied);
        }
    }
    anyhow::ensure!(core.schedule().plan > 0, "no plan was made");
    let (mut times_ms, mut ticks_ms) = (Vec::new(), Vec::new());
    for newcomer in 0..newcomers {
        let (second, robot) = (20 + newcomer, id::<RobotId>(&format!("n{newcomer}")));
        say(&mut core, at(second), second, robots, &stations);
        drain(&mut core);
        let begin = Instant::now();
        core.handle(at(second), Input::Tick);
        ticks_ms.push(begin.elapsed().as_secs_f64() * 1e3);
        if drain(&mut core) {
            anyhow::bail!("a plan of everybody was asked for");
        }
        let now = at(second).plus_s(0.5);
        core.handle(now, Input::RobotState(robot.clone(), state(now, second as u64, newcomer, &stations)));
        let begin = Instant::now();
        core.handle(now, Input::RobotGauge(robot.clone(), gauge(now, second as u64, NEWCOMER_SOC, 0.0)));
        times_ms.push(begin.elapsed().as_secs_f64() * 1e3);
        drain(&mut core);
        let schedule = core.schedule();
        let told = schedule.services.iter().any(|service| service.robot == robot) || schedule.unserved.iter().any(|one| one.robot == robot);
        anyhow::ensure!(told, "plan {} does not tell of {robot}", schedule.plan);
    }
    println!("{newcomers} robots join {robots} one by one, a second apart ({} plans); ms", core.schedule().plan);
    for (what, times_ms) in [("until a plan tells of one", &mut times_ms), ("a tick of the clock between", &mut ticks_ms)] {
        times_ms.sort_by(f64::total_cmp);
        let share = |share: f64| times_ms[((times_ms.len() as f64 * share) as usize).min(times_ms.len() - 1)];
        println!("  {what:30} p50 {:5.1}  p90 {:5.1}  p99 {:5.1}", share(0.5), share(0.9), share(0.99));
    }
    Ok(())
}

/// Everybody tells everything once.
fn say(core: &mut Core, now: Timestamp, second: usize, robots: usize, stations: &[proto::StationId]) {
    let seq = second as u64 + 1;
    for station in stations {
        core.handle(now, Input::StationState(station.clone(), station_state(now, seq)));
        for n in 0..fleet::PACKS {
            core.handle(now, Input::PackGauge(station.clone(), pack(n), pack_gauge(now, seq)));
        }
    }
    for n in 0..robots {
        let robot: RobotId = id(&format!("r{n}"));
        core.handle(now, Input::RobotState(robot.clone(), state(now, seq, n, stations)));
        core.handle(now, Input::RobotGauge(robot, gauge(now, seq, soc_of(n, robots), second as f64)));
    }
}

/// Whether a whole plan is asked for.
fn drain(core: &mut Core) -> bool {
    std::iter::from_fn(|| core.poll()).filter(|output| matches!(output, Output::Study(_))).count() > 0
}
