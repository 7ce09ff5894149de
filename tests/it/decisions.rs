//! The live fleet decides as the simulated one does.

use std::time::Duration;

use coordinator::scenario::Scenario;
use proto::{Event, EventKind};
use tests::{Fleet, workspace};

/// What was decided, without numbers of commands: who was told to do what, in which order.
fn decisions(events: &[Event]) -> Vec<String> {
    let sent = events.iter().filter(|event| event.kind == EventKind::CommandSent);
    sent.filter_map(|event| event.text.split_once(" to ").map(|(_, rest)| rest.to_owned())).collect()
}

#[test]
fn processes_over_zenoh_make_the_same_decisions_as_the_simulation() -> anyhow::Result<()> {
    let path = workspace().join("tests/fixtures/short-fleet.toml");
    let scenario = Scenario::parse(&path, &node::files::read_text(&path)?)?;
    let simulated = coordinator::sim::simulate(
        &scenario.deploy(&scenario.runs()[0], scenario.seed)?,
        *scenario.duration_s.get_ref(),
        scenario.temperature_degc,
        coordinator::models::Kept::Nowhere,
        &mut |_| {},
    )?;
    let expected = decisions(&simulated.events);
    assert_eq!(simulated.measured.metrics["robots_served"], 3.0, "{}", simulated.trace());

    let fleet = Fleet::new(&path, 100.0)?;
    let _coordinator = fleet.coordinator()?;
    let _agents = fleet.agents()?;
    fleet.wait_for("end of the third service", Duration::from_secs(120), |event| {
        event.kind == EventKind::ServiceDone && event.text.starts_with("explorer-3")
    })?;
    let events = fleet.events()?;
    let lived = decisions(&events);
    // Whether the pack was handed over before the last service ended may be a matter of seconds.
    assert_eq!(lived[..expected.len().min(lived.len())], expected[..expected.len().min(lived.len())]);
    assert!(lived.len() >= expected.len() - 1, "{lived:?}");

    let show = fleet.schedule(&["show"])?;
    assert!(show.status.success(), "{}", String::from_utf8_lossy(&show.stderr));
    let capacity = fleet.schedule(&["capacity", "--format", "json"])?;
    let capacity: proto::Capacity = proto::decode(&capacity.stdout)?;
    assert_eq!(capacity.packs.len(), 2);
    Ok(())
}
