//! Measured motor currents of an omnidirectional robot on three floors.
//!
//! 360 runs of a Robotino (github BrOleg5/research-wheel-slippage, Apache-2.0), each with its speed
//! and the mean currents of its three motors. A motor's current measures its torque, so their sum
//! is compared with the force that the effects of motion ask of the wheels, 1 A standing for 1 N.
//! Skipped where the data is absent.

use std::path::Path;
use std::sync::Arc;

use energy::{Channel, Model, Run, Start};

const FLOORS: [&str; 3] = ["table", "brown", "gray"];

struct Drive {
    floor: f64,
    speed_mps: f64,
    current_a: f64,
}

fn drives() -> Option<Vec<Drive>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/robotino_omni_surface_motor_current/steady_state_summary.csv");
    let text = std::fs::read_to_string(path).ok()?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next()?.split(',').collect();
    let column = |name: &str| header.iter().position(|&known| known == name).unwrap();
    let mut found = Vec::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |name: &str| cells[column(name)].parse::<f64>().unwrap();
        let floor = FLOORS.iter().position(|&floor| floor == cells[column("surface")]).unwrap() as f64;
        found.push(Drive { floor, speed_mps: number("wheel_speed_mps"), current_a: number("total_abs_current_a") });
    }
    Some(found)
}

/// Force at the wheels in each run, with the effects given as `id.parameter = value`.
fn forces_n(effects: &[(&str, &str, f64)], drives: &[&Drive]) -> Vec<f64> {
    let mut text = "schema = 1\nsystem = \"robot\"\nname = \"wheel\"\n".to_owned();
    for effect in ["dry_friction", "viscous_friction", "floor"] {
        text += &format!("[[effect]]\nid = \"{effect}\"\n");
        let null = match effect {
            "dry_friction" => vec!["force_n"],
            "viscous_friction" => vec!["viscous_n_s_per_m"],
            _ => vec!["extra_1_n", "extra_2_n", "extra_3_n"],
        };
        for name in null {
            let value = effects.iter().find(|(id, known, _)| *id == effect && *known == name).map_or(0.0, |(_, _, value)| *value);
            text += &format!("{name} = {{ value = {value:?}, source = \"test\" }}\n");
        }
    }
    let mut run = Run::new(Arc::new(Model::parse("wheel", &text, &|_| unreachable!()).unwrap()), Start::at_soc(0.0));
    let force_n = |drive: &&Drive| {
        run.channels[Channel::SpeedMps] = drive.speed_mps;
        run.channels[Channel::FloorClass] = drive.floor;
        run.step(1.0);
        run.channels[Channel::TractionN]
    };
    drives.iter().map(force_n).collect()
}

/// Current per unit of a parameter, by least squares.
fn fitted(unit: (&str, &str), drives: &[&Drive]) -> f64 {
    let forces_n = forces_n(&[(unit.0, unit.1, 1.0)], drives);
    let both: f64 = forces_n.iter().zip(drives).map(|(force, drive)| force * drive.current_a).sum();
    both / forces_n.iter().map(|force| force * force).sum::<f64>()
}

fn rmse_a(effects: &[(&str, &str, f64)], drives: &[&Drive]) -> f64 {
    let squares: f64 = forces_n(effects, drives).iter().zip(drives).map(|(force, drive)| (force - drive.current_a).powi(2)).sum();
    (squares / drives.len() as f64).sqrt()
}

#[test]
fn measured_motors_show_dry_friction_that_depends_on_the_floor() {
    let Some(drives) = drives() else { return };
    assert_eq!(drives.len(), 360);
    // Fit on every second run, judge on the others.
    let part = |which: usize, floor: Option<f64>| -> Vec<&Drive> {
        drives.iter().skip(which).step_by(2).filter(|drive| floor.is_none_or(|floor| drive.floor == floor)).collect()
    };
    const DRY: (&str, &str) = ("dry_friction", "force_n");
    const VISCOUS: (&str, &str) = ("viscous_friction", "viscous_n_s_per_m");
    let judged_a = |unit: (&'static str, &'static str), floor| {
        let value = fitted(unit, &part(0, floor));
        rmse_a(&[(unit.0, unit.1, value)], &part(1, floor))
    };

    // One floor at three speeds: a force that does not depend on speed leaves a fifth of the error.
    let (dry_a, viscous_a) = (judged_a(DRY, Some(2.0)), judged_a(VISCOUS, Some(2.0)));
    assert!(dry_a < 0.25 * viscous_a, "dry {dry_a}, viscous {viscous_a}");
    // All floors as one.
    let (dry_a, viscous_a) = (judged_a(DRY, None), judged_a(VISCOUS, None));
    assert!(dry_a < viscous_a, "dry {dry_a}, viscous {viscous_a}");

    // The floor: class 0 is the table, the others take extra.
    let table = fitted(DRY, &part(0, Some(0.0)));
    let extra = [1.0, 2.0].map(|floor| fitted(DRY, &part(0, Some(floor))) - table);
    let floors = [(DRY.0, DRY.1, table), ("floor", "extra_1_n", extra[0]), ("floor", "extra_2_n", extra[1])];
    let floors_a = rmse_a(&floors, &part(1, None));
    assert!(floors_a < 0.3 * dry_a, "floors {floors_a}, dry {dry_a}");
    assert!(extra[1] > extra[0] && extra[0] > 0.0, "{extra:?}");
}
