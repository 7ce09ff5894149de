//! Ways to connect a fleet, and the configurations that users start from.

use std::time::Duration;

use anyhow::Context as _;
use node::session::decoded;
use node::{ClockConfig, Link, NetworkConfig, Tls};
use proto::{EventKind, Key, Schedule};
use tests::{Fleet, ask, free_port, patiently, program, start, workspace};

#[tokio::test(flavor = "multi_thread")]
async fn a_fleet_runs_through_a_router_of_its_own() -> anyhow::Result<()> {
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 100.0)?;
    let address = fleet.deployment.coordinator.network.listen.clone();
    // Coordinator and agents are all clients; what stands between them is another process' router.
    let router = NetworkConfig { listen: address.clone(), ..NetworkConfig::coordinator() };
    let router = Link::open(&router, fleet.deployment.coordinator.site.clone()).await?;
    fleet.deployment.coordinator.network = NetworkConfig { connect: address, ..NetworkConfig::agent() };
    let web = &mut fleet.deployment.coordinator.web;
    (web.enabled, web.port) = (true, free_port()?);
    let page = web.port;
    fleet.write()?;
    let (heard_in, mut heard) = tokio::sync::mpsc::unbounded_channel();
    let schedules = router.session.declare_subscriber(Key::Schedule.build(&router.site)).callback(move |sample| {
        let _ = heard_in.send(decoded::<Schedule>(sample.payload()));
    });
    let _schedules = schedules.await.map_err(|error| anyhow::anyhow!("{error}"))?;
    let _coordinator = fleet.coordinator()?;
    let _agents = fleet.agents()?;
    let schedule = tokio::time::timeout(Duration::from_secs(60), heard.recv()).await?.expect("the subscriber lives")?;
    assert_eq!(schedule.plan, 1, "each plan is told to who listens: {schedule:?}");
    tokio::task::block_in_place(|| {
        fleet.wait_for("command that was obeyed", Duration::from_secs(60), |event| {
            event.kind == EventKind::PhaseChanged && event.text.contains("working -> travelling")
        })?;
        let live = fleet.schedule(&["show"])?;
        anyhow::ensure!(live.status.success() && live.stderr.is_empty(), "{}", String::from_utf8_lossy(&live.stderr));
        let schedule = ask(page, "/api/v1/schedule").context("no dashboard")?;
        anyhow::ensure!(schedule["services"].as_array().is_some_and(|services| !services.is_empty()), "{schedule}");
        refusals_are_told_in_json(page)
    })?;
    drop(router);
    Ok(())
}

/// Whatever refuses, its own code or the framework's.
fn refusals_are_told_in_json(page: u16) -> anyhow::Result<()> {
    for (route, said) in [
        ("/api/v1/events?lst=3", "unknown field `lst`"),
        ("/api/v1/view?rows=-1", "rows: invalid digit"),
        ("/api/v1/view?rwos=1", "unknown field `rwos`"),
        ("/api/v1/explain/a%20b", "is not a robot id"),
        ("/api/v1/explain/nobody", "nobody"),
        ("/api/v1/replan", "no token is configured"),
        ("/api/v1/nothing", "there is no such page"),
    ] {
        let answer = ask(page, route).with_context(|| format!("{route}: no JSON"))?;
        anyhow::ensure!(answer["error"].as_str().is_some_and(|error| error.contains(said)), "{route}: {answer}");
    }
    Ok(())
}

#[test]
fn a_coordinator_that_waits_for_its_router_can_be_stopped() -> anyhow::Result<()> {
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 1.0)?;
    let nobody = format!("tcp/127.0.0.1:{}", free_port()?);
    fleet.deployment.coordinator.network = NetworkConfig { connect: vec![nobody], ..NetworkConfig::agent() };
    fleet.write()?;
    let mut coordinator = fleet.coordinator()?;
    std::thread::sleep(Duration::from_secs(3));
    anyhow::ensure!(!coordinator.ended(), "it does not wait");
    assert_eq!(coordinator.stop(Duration::from_secs(10)), Some(0));
    Ok(())
}

#[test]
fn an_agent_looks_after_its_robot_before_there_is_a_network_and_joins_it_when_there_is() -> anyhow::Result<()> {
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 1.0)?;
    let port = free_port()?;
    fleet.deployment.coordinator.web.port = port;
    fleet.write()?;
    let (said, log) = (fleet.path("said"), fleet.path("telemetry"));
    let mut command = program("robot-agent");
    command.args(["run", "--config"]).arg(fleet.path("explorer-1.toml")).arg("--log").arg(&log);
    let mut robot = start({
        command.stderr(std::fs::File::create(&said)?);
        command
    })?;
    let goes_on = || std::fs::read_to_string(&said).is_ok_and(|text| text.contains("goes on without the network"));
    anyhow::ensure!(patiently(Duration::from_secs(60), goes_on) && !robot.ended(), "it waits, or has ended");
    // Its gauge is fed, and what it shows is kept.
    let rows = || std::fs::read_dir(&log).into_iter().flatten().flatten().filter_map(|file| std::fs::read_to_string(file.path()).ok());
    anyhow::ensure!(patiently(Duration::from_secs(30), || rows().any(|text| text.lines().count() > 4)), "nothing was measured");
    let _coordinator = fleet.coordinator()?;
    let joined = || ask(port, "/api/v1/fleet").is_some_and(|fleet| fleet["robots"]["explorer-1"]["state"].is_object());
    anyhow::ensure!(patiently(Duration::from_secs(60), joined), "it never joined");
    Ok(())
}

#[test]
fn the_example_configurations_are_good_and_belong_together() -> anyhow::Result<()> {
    let live = |name: &str| workspace().join("scenarios/live").join(name);
    let path = live("coordinator.toml");
    let mut coordinator = coordinator::Config::read(&path)?;
    let (_, models) = coordinator.load(Some(&path))?;
    let path = live("station-mds-1.toml");
    let mut station = station_agent::Config::read(&path)?;
    station.build_simulated(Some(&path))?;
    // Its devices are not here, but what is said of them is good.
    assert_eq!(station_agent::Config::read(&live("station-measured.toml"))?.id, station.id);
    let path = live("robot-explorer-1.toml");
    let mut robot = robot_agent::Config::read(&path)?;
    robot.build(Some(&path))?;
    assert!(models.robots.contains_key(&robot.id) && models.stations.contains_key(&station.id));
    assert!(station.packs.iter().all(|pack| models.stations[&station.id].packs.contains_key(&pack.id)));
    assert!(robot.travel_s.contains_key(&station.id));
    assert!(robot.site == coordinator.site && station.site == coordinator.site);
    assert_eq!(robot.network.connect, coordinator.network.listen);
    // Tables that stand there as comments are no part of what was read.
    let tls = || Some(Tls { ca: "ca.pem".into(), certificate: "own.pem".into(), key: "own.key".into() });
    let clock = Some(ClockConfig { speed: 1.0, origin_unix_ms: 0 });
    (coordinator.clock, coordinator.network.tls) = (clock, tls());
    (station.clock, station.network.tls) = (clock, tls());
    (robot.clock, robot.network.tls) = (clock, tls());
    names_every_key(&live("coordinator.toml"), &serde_json::to_value(&coordinator)?);
    names_every_key(&live("station-mds-1.toml"), &serde_json::to_value(&station)?);
    names_every_key(&live("robot-explorer-1.toml"), &serde_json::to_value(&robot)?);
    Ok(())
}

/// They say that they have every key: what is left out would be known to nobody.
fn names_every_key(path: &std::path::Path, config: &serde_json::Value) {
    let text = std::fs::read_to_string(path).unwrap();
    for (key, value) in config.as_object().into_iter().flatten() {
        let named = ["=", " =", "]", "."].iter().any(|after| text.contains(&format!("{key}{after}")));
        assert!(named, "{} does not name `{key}`", path.display());
        // What is true of a simulated body is told beside the scenarios.
        if key != "source" {
            names_every_key(path, value);
        }
    }
}
