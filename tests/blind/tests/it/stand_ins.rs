//! What a collinear case cannot tell is found by the scorer's own least squares.

use blind::plan::{DEVELOPMENT_SEED as SEED, plan};
use blind::{Right, make};

fn may(name: &str) -> (Vec<&'static str>, Vec<&'static str>) {
    let (index, entry) = plan().into_iter().enumerate().find(|(_, entry)| entry.name == name).expect("a case of the plan");
    match make(&entry, SEED + index as u64).truth.right {
        Right::Set { must, may, .. } => (must, may),
        other => panic!("{other:?}"),
    }
}

/// A cell that has lost the share f of its capacity goes from its start z0 to `z0 - q / (C (1 - f))`. Over the charge that was counted
/// with C, `z = z0 - q / C`, that is a straight line in z: the open-circuit curve of `electrode_balance`, whose ends both move.
#[test]
fn lost_capacity_is_an_axis_that_was_stretched() {
    let (_, may) = may("collinear/battery/gain-or-fade");
    assert!(may.contains(&"electrode_balance"), "{may:?}");
    assert!(!may.contains(&"hysteresis") && !may.contains(&"ohmic_soc") && !may.contains(&"voltage_gain"), "{may:?}");
}

/// A camera that sends what it sees works whenever the radio does; nothing else of a robot does.
#[test]
fn a_camera_that_sends_is_a_radio_and_nothing_else() {
    let (must, may) = may("collinear/robot/camera-or-radio");
    assert!(must.iter().all(|id| may.contains(id)) && may.len() == 2, "{must:?} {may:?}");
}
