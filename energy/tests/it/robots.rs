//! Robots that drive: what the thesis measured, and what measured motors say of friction.

use std::sync::Arc;

use energy::drive::explorer::{CASTER, MOTOR, MOTORS, PACK_V, SERVO, SPEED_MAX_MPS, WHEELS};
use energy::drive::travel::{Pace, Segment, energy_per_metre, most_economical, trip};
use energy::forecast::power_w;
use energy::{Channel, Model, Run, Start};

use crate::built_in;

/// Speed of an Explorer at work, m/s: a guess, something over half of its greatest.
const EXPLORER_USUAL_MPS: f64 = 0.3;

fn shares(model: &Arc<Model>, inputs: &[(Channel, f64)]) -> Vec<(&'static str, f64)> {
    let mut run = Run::new(Arc::clone(model), Start::at_soc(0.0));
    for &(channel, value) in inputs {
        run.channels[channel] = value;
    }
    run.step_explained(1.0)
}

fn value(model: &Model, effect: &str, name: &str) -> f64 {
    model.parameter(effect, name).unwrap().value
}

#[test]
fn the_explorers_motors_take_less_than_five_percent_of_its_power() {
    // Kottas, section 5.2: less than 5 % of the total discharge current.
    let explorer = built_in("explorer-robot");
    let shares = shares(&explorer, &[(Channel::SpeedMps, EXPLORER_USUAL_MPS)]);
    let of_motors = |id: &str| ["motion", "dry_friction", "acceleration", "motor_copper", "floor"].contains(&id);
    let motors_w: f64 = shares.iter().filter(|(id, _)| of_motors(id)).map(|(_, share)| share).sum();
    let converter_in_w: f64 = shares.iter().map(|(_, share)| share).sum();
    assert!(motors_w > 0.02 * converter_in_w && motors_w < 0.05 * converter_in_w, "{motors_w} of {converter_in_w}");
    // The caster's servo burns more than they do (4.2.2).
    assert!(shares.iter().find(|(id, _)| *id == "caster_hold").unwrap().1 > motors_w);
}

#[test]
fn the_explorers_parameters_follow_from_its_dimensions() {
    let explorer = built_in("explorer-robot");
    let close = |effect, name, expected: f64, share: f64| {
        let given = value(&explorer, effect, name);
        assert!((given / expected - 1.0).abs() < share, "{effect}.{name}: {given} against {expected}");
    };
    let lever = MOTOR.gear.ratio / WHEELS.wheel_radius_m;
    close("dry_friction", "force_n", MOTORS * MOTOR.motor.friction_nm * lever, 0.01);
    let copper = MOTOR.motor.resistance_ohm / MOTORS / (lever * MOTOR.motor.torque_nm_per_a).powi(2);
    close("motor_copper", "copper_w_per_n2", copper, 0.01);
    close("acceleration", "mass_kg", WHEELS.equivalent_mass_kg(0.0), 0.01);
    let (worst_rad, worst_nm) = CASTER.worst(-0.15, 0.7).unwrap();
    close("caster_hold", "worst_rad", worst_rad, 0.05);
    close("caster_hold", "hold_w", SERVO.hold_w(worst_nm), 0.01);
    // And the power of the whole drive is that of the motor model, at two speeds.
    for speed_mps in [0.1, EXPLORER_USUAL_MPS] {
        let wheel_nm = 0.02 * 0.5 * 9.806_65 * WHEELS.wheel_radius_m / MOTORS;
        let by_motor_w = MOTORS * MOTOR.at(wheel_nm, speed_mps / WHEELS.wheel_radius_m).electrical_w;
        let standing_w = power_w(&explorer, &[]).value;
        let driving_w = power_w(&explorer, &[(Channel::SpeedMps, speed_mps)]).value - standing_w;
        assert!((driving_w / by_motor_w - 1.0).abs() < 0.03, "{speed_mps}: {driving_w} against {by_motor_w}");
    }
}

#[test]
fn an_explorer_drives_a_metre_cheapest_at_its_top_speed() {
    // Kottas, Fig. 5.7: more energy per metre when slow. Computing dominates, so the best speed
    // of the whole robot is its greatest.
    let explorer = built_in("explorer-robot");
    let best = most_economical(&explorer, &[], 0.02..=SPEED_MAX_MPS);
    assert_eq!(best.speed_mps, SPEED_MAX_MPS);
    // By hand: 4.19 W / 0.52 m/s and the motors' 0.14 / 0.7 x 0.0981 + 0.437 + ... = 0.58 J/m.
    assert!((best.energy_j_per_m.value - (4.19 / 0.52 + 0.59)).abs() < 0.03, "{:?}", best.energy_j_per_m);
    assert!(energy_per_metre(&explorer, &[], 0.05).value > 8.0 * best.energy_j_per_m.value);
    assert!(best.energy_j_per_m.sigma > 0.3 && best.energy_j_per_m.sigma < 2.0);
}

#[test]
fn an_explorer_reaches_its_top_speed_on_the_mean_voltage_of_its_pack() {
    let wheel_nm = 0.02 * 0.5 * 9.806_65 * WHEELS.wheel_radius_m / MOTORS;
    // Kottas, section 5.2: approximately 520 mm/s.
    let speed_mps = MOTOR.speed_at(PACK_V, wheel_nm) * WHEELS.wheel_radius_m;
    assert!((speed_mps - 0.52).abs() < 0.01, "{speed_mps}");
}

#[test]
fn a_vacuum_robot_cleans_for_about_two_hours_on_three_ampere_hours() {
    // HowStuffWorks, How Robotic Vacuums Work: a 3 Ah pack (14.4 V) gives about two hours.
    let roomba = built_in("roomba-robot");
    let drawn = power_w(&roomba, &[(Channel::SpeedMps, 0.3)]);
    let hours = 3.0 * 14.4 / drawn.value;
    assert!((hours - 2.0).abs() < 0.4, "{hours} h at {drawn:?}");
    // Kurt, Hacking Roomba: 300 mA at the slowest and 1000 mA at normal speed for the drive.
    let drive_a = |speed_mps| (power_w(&roomba, &[(Channel::SpeedMps, speed_mps)]).value - power_w(&roomba, &[]).value) / 14.4;
    assert!((drive_a(0.01) - 0.3).abs() < 0.01 && (drive_a(0.5) - 1.0).abs() < 0.02, "{} {}", drive_a(0.01), drive_a(0.5));
}

#[test]
fn the_station_stands_as_a_vehicle_as_it_stands_as_a_station() {
    let standing = |name: &str| power_w(&built_in(name), &[]).value;
    assert!((standing("mds-vehicle") - standing("mds-station")).abs() < 0.3, "{} {}", standing("mds-vehicle"), standing("mds-station"));
    // Six robots aboard roll and climb with it: 3 kg at 12 kg, through gears of 50 %.
    let vehicle = built_in("mds-vehicle");
    let climb = [(Channel::SpeedMps, 0.2), (Channel::PitchRad, 0.1)];
    let loaded = [climb[0], climb[1], (Channel::PayloadKg, 3.0)];
    let more_w = power_w(&vehicle, &loaded).value - power_w(&vehicle, &climb).value;
    let by_hand_w = 3.0 * 9.806_65 * (0.02 * 0.1f64.cos() + 0.1f64.sin()) * 0.2 / 0.5;
    assert!((more_w - by_hand_w).abs() < 1e-9, "{more_w} {by_hand_w}");
}

#[test]
fn the_way_home_costs_what_its_parts_cost_and_says_how_well_it_is_known() {
    let explorer = built_in("explorer-robot");
    let pace = Pace { accel_mps2: 0.5, yaw_rate_radps: 2.0 };
    let level = Segment::level(20.0, 0.3);
    let carpet = Segment { floor_class: 2, turn_rad: 1.57, ..Segment::level(5.0, 0.3) };
    let ramp = Segment { pitch_rad: 0.1, payload_kg: 0.2, ..Segment::level(2.0, 0.2) };
    let home = |way: &[Segment]| trip(&explorer, &[], pace, way);
    let (whole, part) = (home(&[level, carpet, ramp]), home(&[level]));
    assert!(whole.energy_wh.value > part.energy_wh.value && whole.time_s > part.time_s);
    // By hand, within 2 %: 4.19 W for the time, 0.58 J/m on the level, 0.25 N and 0.7 kg x g sin
    // through 70 % on top; ramps of speed and the turn are small.
    let by_hand_j = 4.19 * whole.time_s + 0.58 * 27.0 + 0.25 * 5.0 + 0.7 * 9.806_65 * 0.1f64.sin() * 2.0 / 0.7;
    assert!((whole.energy_wh.value * 3600.0 / by_hand_j - 1.0).abs() < 0.02, "{} {by_hand_j}", whole.energy_wh.value * 3600.0);
    // Idle power is known to 8 %, and it is most of it.
    let relative = whole.energy_wh.sigma / whole.energy_wh.value;
    assert!((0.05..0.15).contains(&relative), "{relative}");
}
