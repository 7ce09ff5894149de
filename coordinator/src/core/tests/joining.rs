//! What is told when a robot joins.

use super::*;

/// What was said when `r0`, which the configuration gives that model, joined.
fn joined(configured: &str) -> String {
    let mut core = core();
    let model = core.models.built_in[configured].clone();
    core.models.robots.insert(id("r0"), model);
    joins(&mut core, 0.0, 0);
    let events = std::iter::from_fn(|| core.poll()).filter_map(|output| match output {
        Output::Record(Record::Event(event)) if event.kind == EventKind::Joined => Some(event.text),
        _ => None,
    });
    events.collect::<Vec<_>>().join("; ")
}

#[test]
fn a_robot_that_counts_by_another_battery_model_than_it_is_planned_with_is_told_of() {
    assert_eq!(joined("explorer-3s1p-1320mah"), "r0 joined");
    let told = joined("mds-3s4p-7600mah");
    let both =
        told.contains("by the battery model `explorer-3s1p-1320mah`") && told.contains("planned with `mds-3s4p-7600mah` (robots.r0)");
    assert!(both, "{told}");
}
