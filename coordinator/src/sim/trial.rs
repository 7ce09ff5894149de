//! A small fleet in which things go wrong, all of it drawn by one seed, and what must hold then.

use std::ops::RangeInclusive;

use anyhow::Context;
use proto::EventKind;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

use super::check::{self, Checks};
use super::faults::Faults;
use super::host::STEP_S;
use super::net::Host;
use super::run::{START, trace};
use super::world::World;
use crate::models::Kept;
use crate::scenario::{Deployment, Scenario};

/// What came of a trial.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The seed that drew it.
    pub seed: u64,
    /// Every promise that was broken; empty when all held.
    pub violations: Vec<String>,
    /// What went wrong, one line each.
    pub faults: Vec<String>,
    /// What the coordinators noted, one line each.
    pub trace: String,
    /// How many services were done.
    pub services: usize,
    /// How many coordinators there were, one after the other.
    pub coordinators: usize,
}

/// What a trial is drawn from.
struct Size {
    robots: RangeInclusive<u32>,
    stations: RangeInclusive<u32>,
    duration_s: f64,
}

/// A few robots, for an hour and a half, in which every one needs a service.
const SMALL: Size = Size { robots: 1..=4, stations: 1..=2, duration_s: 5_400.0 };
/// More robots than are planned for as a whole at once, long enough for some whole plans beside the core.
const LARGE: Size = Size { robots: 66..=80, stations: 10..=12, duration_s: 1_500.0 };
/// Charge between one robot and the next: those who come first must not wait for all others in one bay.
const STEP_SOC: f64 = 0.1;
/// What all steps together come to at most.
const STEPS_SOC_MAX: f64 = 0.7;

/// Seeds of what the fleet is differ from those of what goes wrong in it.
const FLEET_STREAM: u64 = 0x9e37_79b9_7f4a_7c15;

/// The fleet of a seed: robots whose need, ways and times differ, stations with bays or spares, and
/// energy enough for all.
fn fleet(seed: u64, size: &Size) -> anyhow::Result<Deployment> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ FLEET_STREAM);
    let (robots, stations) = (rng.random_range(size.robots.clone()), rng.random_range(size.stations.clone()));
    let step_soc = STEP_SOC.min(STEPS_SOC_MAX / f64::from(robots));
    let mut text = format!(
        "schema = 1\nname = \"trial\"\nseed = {}\nduration_s = {}\n\
         [policy]\nserve_below_soc = 0.25\ncharge_to_soc = 0.45\npatience_s = 60\nreplan_period_s = 600\n\
         [publish]\ngauge_period_s = 5\nstate_period_s = 10\n",
        seed % 1_000_000,
        size.duration_s
    );
    for number in 1..=stations {
        let spares: Vec<String> = (1..=rng.random_range(0..=2)).map(|n| format!("{{ id = \"spare-{n}\", soc = 0.95 }}")).collect();
        text += &format!(
            "[[station]]\nid = \"mds-{number}\"\nload = \"mds-station\"\nbays = {}\nload_s = {}\nunload_s = {}\nswap_s = 60\n\
             packs = [{{ id = \"pack-1\", battery = \"mds-3s4p-7600mah\", soc = {:.2} }}, \
             {{ id = \"pack-2\", battery = \"mds-3s4p-7600mah\", soc = 0.95 }}]\nspares = [{}]\n",
            rng.random_range(1..=2),
            rng.random_range(5..40),
            rng.random_range(5..40),
            rng.random_range(0.1..0.9),
            spares.join(", ")
        );
    }
    for number in 1..=robots {
        text += &format!(
            "[[robot]]\nid = \"explorer-{number}\"\nbattery = \"explorer-3s1p-1320mah\"\nload = \"explorer-robot\"\n\
             soc = {:.3}\nmission.inputs = {{ speed_mps = 0.1 }}\n",
            0.2 + step_soc * f64::from(number) + rng.random_range(0.0..0.05)
        );
        for station in 1..=stations {
            text += &format!("travel_s.mds-{station} = {}\n", rng.random_range(30..180));
        }
    }
    let scenario = Scenario::parse("trial.toml".as_ref(), &text).context("the drawn fleet")?;
    scenario.deploy(&scenario.runs()[0], scenario.seed)
}

/// Runs the trial of a seed.
///
/// # Errors
/// When a model cannot be read.
pub fn trial(seed: u64) -> anyhow::Result<Trial> {
    run(seed, &SMALL, false)
}

/// The same with a fleet that is planned for beside the core.
///
/// # Errors
/// When a model cannot be read.
pub fn large_trial(seed: u64) -> anyhow::Result<Trial> {
    run(seed, &LARGE, false)
}

/// The same with agents that lose their memory when they are killed, which breaks promises: so it is
/// seen that the checks see.
///
/// # Errors
/// When a model cannot be read.
pub fn forgetful_trial(seed: u64) -> anyhow::Result<Trial> {
    run(seed, &SMALL, true)
}

fn run(seed: u64, size: &Size, forgetful: bool) -> anyhow::Result<Trial> {
    let deployment = fleet(seed, size)?;
    let robots = deployment.robots.iter().map(|config| Host::Robot(config.id.clone()));
    let stations = deployment.stations.iter().map(|config| Host::Station(config.id.clone()));
    let faults = Faults { forgetful, ..Faults::draw(seed, size.duration_s, &robots.chain(stations).collect::<Vec<_>>()) };
    let told = faults.lines();
    let mut world = World::new(&deployment, faults, Kept::Nowhere, energy::units::REFERENCE_DEGC, START)?;
    world.checks = Some(Checks::default());
    for step in 1..=(size.duration_s / STEP_S) as u64 {
        world.step(START.plus_s(step as f64 * STEP_S))?;
    }
    let violations = judged(&mut world)?;
    let services = world.events.iter().filter(|event| event.kind == EventKind::ServiceDone).count();
    let coordinators = world.desk.disk.reigns.len();
    Ok(Trial { seed, violations, faults: told, trace: trace(&world.events), services, coordinators })
}

/// Everything that was broken in a run that is over.
fn judged(world: &mut World) -> anyhow::Result<Vec<String>> {
    let mut checks = world.checks.take().context("a trial is watched")?;
    let disk = &world.desk.disk;
    checks.found.extend(disk.conflicts.iter().cloned());
    // While the disk takes nothing the fleet is served on: commands leave that are not kept.
    if !disk.refused {
        checks.commands.all_kept(|id| disk.holds(id));
    }
    checks.balance.close();
    for (id, robot) in world.robots.iter().filter(|(_, robot)| robot.body.stranded()) {
        let phase = robot.agent.is_some();
        checks.found.push(format!("{id} is stranded (its agent runs: {phase}), although there is energy for all"));
    }
    let settings = world.desk.settings();
    for (index, reign) in disk.reigns.iter().enumerate() {
        match check::replays(settings, world.desk.models(), reign) {
            // The last one still runs: its replay must hold the same beliefs and the same plan.
            Ok(core) if index + 1 == disk.reigns.len() => {
                if let Some(own) = world.desk.core().filter(|_| !disk.full) {
                    if own.schedule() != core.schedule() {
                        checks.found.push("the journal replays to another plan".to_owned());
                    }
                    if format!("{:?}", own.fleet()) != format!("{:?}", core.fleet()) {
                        checks.found.push("the journal replays to other beliefs".to_owned());
                    }
                }
            }
            Ok(_) => {}
            // What was dropped for want of room cannot be told again.
            Err(_) if disk.refused => {}
            Err(difference) => checks.found.push(format!("the journal of coordinator {} does not replay: {difference}", index + 1)),
        }
    }
    Ok(checks.violations())
}
