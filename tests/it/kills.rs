//! Real processes, killed and started again at random moments, over a router.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration;

use coordinator::store::{Record, Store, What};
use node::{Link, NetworkConfig};
use proto::{EventKind, Outcome};
use tests::{Fleet, Running, patiently, program, start, workspace};

/// Kills in the test command; `TENDER_KILLS=50` for more.
const KILLS: u64 = 6;

/// The next of a fixed sequence of numbers below `below` (Knuth's linear congruence).
fn next(state: &mut u64, below: u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) % below
}

#[tokio::test(flavor = "multi_thread")]
async fn killed_at_random_moments_a_fleet_goes_on_and_its_journal_tells_one_story() -> anyhow::Result<()> {
    let kills = std::env::var("TENDER_KILLS").map_or(KILLS, |text| text.parse().expect("TENDER_KILLS is a number"));
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 100.0)?;
    let address = fleet.deployment.coordinator.network.listen.clone();
    let router = NetworkConfig { listen: address.clone(), ..NetworkConfig::coordinator() };
    let router = Link::open(&router, fleet.deployment.coordinator.site.clone()).await?;
    fleet.deployment.coordinator.network = NetworkConfig { connect: address, ..NetworkConfig::agent() };
    for station in &mut fleet.deployment.stations {
        station.memory = Some(PathBuf::from(format!("{}.memory.json", station.id)));
    }
    for robot in &mut fleet.deployment.robots {
        robot.memory = Some(PathBuf::from(format!("{}.memory.json", robot.id)));
    }
    fleet.write()?;
    tokio::task::block_in_place(|| torment(&fleet, kills))?;
    judge(&fleet).await?;
    drop(router);
    Ok(())
}

/// Times that the journal is replayed beside a coordinator that writes it.
const BESIDE: usize = 3;

fn agent(fleet: &Fleet, name: &'static str, id: &str) -> anyhow::Result<Running> {
    let mut command = program(name);
    command.args(["run", "--config"]).arg(fleet.path(&format!("{id}.toml")));
    start(command)
}

fn torment(fleet: &Fleet, kills: u64) -> anyhow::Result<()> {
    let mut processes: BTreeMap<String, (&'static str, Running)> = BTreeMap::new();
    for station in &fleet.deployment.stations {
        processes.insert(station.id.to_string(), ("station-agent", agent(fleet, "station-agent", station.id.as_ref())?));
    }
    for robot in &fleet.deployment.robots {
        processes.insert(robot.id.to_string(), ("robot-agent", agent(fleet, "robot-agent", robot.id.as_ref())?));
    }
    let mut coordinator = fleet.coordinator()?;
    fleet.wait_for("plan", Duration::from_secs(120), |event| event.kind == EventKind::PlanMade)?;
    let names: Vec<String> = processes.keys().cloned().collect();
    let mut state = 7;
    for _ in 0..kills {
        let pause = Duration::from_millis(300 + next(&mut state, 2_000));
        patiently(pause, || false);
        // Every other time the coordinator; it must be able to start again each time.
        if next(&mut state, 2) == 0 {
            coordinator.kill();
            coordinator = fleet.coordinator()?;
        } else {
            let name = &names[next(&mut state, names.len() as u64) as usize];
            let (kind, process) = processes.get_mut(name).expect("a process of the fleet");
            process.kill();
            *process = agent(fleet, kind, name)?;
        }
    }
    // After all that, the fleet still comes to the end of a service that it begins from now on.
    let so_far = patiently_events(fleet)?;
    fleet.wait_for("end of a service after the last kill", Duration::from_secs(180), |event| {
        event.seq > so_far && event.kind == EventKind::ServiceDone
    })?;
    anyhow::ensure!(!coordinator.ended(), "the coordinator runs");
    for (name, (_, process)) in &mut processes {
        anyhow::ensure!(!process.ended(), "{name} runs");
    }
    // A journal that still grows is read as it is.
    for _ in 0..BESIDE {
        replayed(fleet)?;
    }
    coordinator.kill();
    Ok(())
}

fn patiently_events(fleet: &Fleet) -> anyhow::Result<u64> {
    Ok(fleet.events()?.last().map_or(0, |event| event.seq))
}

/// What the store tells must be one story.
async fn judge(fleet: &Fleet) -> anyhow::Result<()> {
    let store = Store::open_read_only(&fleet.path("tender.db")).await?;
    let events = store.events(usize::MAX).await?;
    anyhow::ensure!(events.windows(2).all(|pair| pair[1].seq == pair[0].seq + 1), "the numbers of events have a gap");
    let starts = store.starts().await?;
    anyhow::ensure!(starts.windows(2).all(|pair| pair[1].epoch == pair[0].epoch + 1), "the numbers of starts have a gap");
    let mut accepted = BTreeSet::new();
    for begun in &starts {
        for heard in store.heard(begun.epoch, 0, usize::MAX).await? {
            let What::Reply(reply) = heard.what else { continue };
            if reply.outcome == Outcome::Accepted {
                accepted.insert(reply.id);
            }
        }
    }
    let mut spares: BTreeMap<String, String> = BTreeMap::new();
    for (index, begun) in starts.iter().enumerate() {
        for record in store.decisions(*begun, starts.get(index + 1).copied()).await? {
            let Record::StationCommand { command, .. } = record else { continue };
            if let (true, proto::StationAction::SwapPack { robot, spare }) = (accepted.contains(&command.id), command.action) {
                let holder = spares.insert(spare.to_string(), robot.to_string());
                anyhow::ensure!(holder.is_none(), "{spare} was issued to {robot} and to {holder:?}");
            }
        }
    }
    let told = replayed(fleet)?;
    anyhow::ensure!(told.lines().count() == starts.len(), "{told}");
    Ok(())
}

/// What `coordinator replay` says of the store, when nothing was decided otherwise.
fn replayed(fleet: &Fleet) -> anyhow::Result<String> {
    let mut replay = program("coordinator");
    let replay = replay.arg("replay").arg(fleet.path("tender.db")).arg("--config").arg(fleet.path("coordinator.toml")).output()?;
    let told = String::from_utf8_lossy(&replay.stdout).into_owned();
    anyhow::ensure!(replay.status.success(), "{told}{}", String::from_utf8_lossy(&replay.stderr));
    Ok(told)
}
