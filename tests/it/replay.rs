//! A measured log goes through agent, Zenoh, coordinator and store into the schedule.

use std::time::Duration;

use coordinator::store::{Record, Store, What};
use proto::{EventKind, RobotId, Schedule, ServiceStatus, StationId};
use tests::{Fleet, patiently, workspace};

/// The robot's battery is one measured Enertech cell, discharged at 1C in an hour.
#[test]
fn a_measured_discharge_becomes_a_planned_service() -> anyhow::Result<()> {
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 200.0)?;
    let robot = RobotId::new("cell-1c")?;
    let mut config = fleet.deployment.robots[0].clone();
    config.id = robot.clone();
    config.battery = node::files::ModelRef::Name("enertech-lco-2280mah".to_owned());
    config.load = None;
    config.travel_s = [(StationId::new("mds-1")?, 60.0)].into();
    config.source =
        robot_agent::SourceConfig::Replay { file: workspace().join("scenarios/measured/enertech-lco-2280mah/discharge-1c.csv") };
    fleet.deployment.coordinator.robots = [(robot.clone(), config.battery.clone())].into();
    fleet.deployment.robots = vec![config];
    fleet.write()?;
    let mut coordinator = fleet.coordinator()?;
    let _agents = fleet.agents()?;

    fleet.wait_for("plan", Duration::from_secs(60), |event| event.kind == EventKind::PlanMade)?;
    let plan = fleet.schedule(&["show", "--format", "json"])?;
    let plan: Schedule = proto::decode(&plan.stdout)?;
    assert_eq!(plan.services.len(), 1, "{plan:?}");
    assert_eq!(plan.services[0].robot, robot);
    // 1C from 4.18 V: 15 % of the capacity are left after about 50 minutes.
    let leaves_s = plan.services[0].leave.seconds_since(plan.at);
    assert!(plan.services[0].status == ServiceStatus::Planned && (1_500.0..3_600.0).contains(&leaves_s), "leaves in {leaves_s} s");

    // The gauge counts what the log holds: 2.28 A for the seconds between two messages.
    assert!(patiently(Duration::from_secs(30), || telemetry(&fleet, &robot).is_ok_and(|rows| rows.len() > 100)));
    coordinator.kill();
    let rows = telemetry(&fleet, &robot)?;
    let (first, last) = (&rows[0], &rows[rows.len() - 1]);
    let hours = last.at.seconds_since(first.at) / 3600.0;
    let drawn_ah = (first.soc.value - last.soc.value) * 2.3351;
    assert!((drawn_ah / (2.28 * hours) - 1.0).abs() < 0.05, "{drawn_ah} Ah in {hours} h");
    assert!(rows.iter().all(|gauge| gauge.source == "replay" && gauge.soc.sigma > 0.0));
    Ok(())
}

fn telemetry(fleet: &Fleet, robot: &RobotId) -> anyhow::Result<Vec<proto::Gauge>> {
    tokio::runtime::Runtime::new()?.block_on(async {
        let store = Store::open_read_only(&fleet.path("tender.db")).await?;
        let mut gauges = Vec::new();
        for heard in store.heard(1, 0, usize::MAX).await? {
            let is_its_own = matches!(&heard.what, What::RobotGauge(whose, ..) if whose == robot);
            if is_its_own && let Some(Record::RobotGauge { gauge, .. }) = store.message_of(&heard).await? {
                gauges.push(gauge);
            }
        }
        Ok(gauges)
    })
}

#[test]
fn a_robot_that_reaches_no_station_is_unserved_with_the_reason() -> anyhow::Result<()> {
    let fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 200.0)?;
    let _coordinator = fleet.coordinator()?;
    let mut agents = fleet.agents()?;
    agents.truncate(1);
    let log = workspace().join("scenarios/measured/enertech-lco-2280mah/discharge-0p5c.csv");
    let mut command = tests::program("robot-agent");
    command.args(["run", "--id", "explorer-1", "--site", "test", "--battery", "explorer-3s1p-1320mah", "--speed", "200"]);
    command.args(["--source", "replay"]).arg(log).args(["--connect", &fleet.network().connect[0]]);
    let _replay = tests::start(command)?;
    fleet.wait_for("plan", Duration::from_secs(60), |event| event.kind == EventKind::PlanMade)?;
    let explained = fleet.schedule(&["explain", "explorer-1"])?;
    let text = String::from_utf8_lossy(&explained.stdout).into_owned();
    assert!(text.contains("no station is in reach"), "{text}{}", String::from_utf8_lossy(&explained.stderr));
    Ok(())
}
