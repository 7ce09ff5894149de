//! Energy of driving: per metre at a speed, at the best speed, and along a way.
//!
//! Everything is found by stepping the robot's model, so every effect that it has counts, and its
//! sigma comes from those of its parameters. Per metre, `(P_stand + P_drive(v)) / v`: what a robot
//! takes at a standstill weighs the more the slower it drives, what grows faster than the speed
//! (viscous friction) weighs at the other end. Kottas, Fig. 5.7, shows the slow end.

use std::ops::RangeInclusive;
use std::sync::Arc;

use crate::forecast::propagate_loads;
use crate::units::S_PER_H;
use crate::{Channel, Estimate, Model, Run, Start};

/// Steps in which a change of speed is followed: power is at most cubic in the speed, so the
/// midpoint rule is then right to 0.1 %.
const RAMP_STEPS: u32 = 16;
/// Longest step at constant speed, s.
const STEP_MAX_S: f64 = 10.0;
/// Width at which the search for the best speed ends, as a share of its range.
const SEARCH_WIDTH: f64 = 1e-4;
/// Slowest speed that a way may ask for, m/s.
const SLOWEST_MPS: f64 = 1e-3;

/// A piece of a way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Length, m, >= 0.
    pub length_m: f64,
    /// Speed wanted, m/s; slower than 1 mm/s counts as that.
    pub speed_mps: f64,
    /// Slope, uphill positive, rad.
    pub pitch_rad: f64,
    /// Class of the floor; 0 is the reference floor.
    pub floor_class: u32,
    /// Angle turned on the spot before it, rad, either sign.
    pub turn_rad: f64,
    /// Load carried, kg.
    pub payload_kg: f64,
}

impl Segment {
    /// A straight, level piece of the reference floor without load.
    #[must_use]
    pub fn level(length_m: f64, speed_mps: f64) -> Self {
        Segment { length_m, speed_mps, pitch_rad: 0.0, floor_class: 0, turn_rad: 0.0, payload_kg: 0.0 }
    }
}

/// How a robot changes its motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Acceleration and deceleration, m/s², > 0.
    pub accel_mps2: f64,
    /// Yaw rate of turns on the spot, rad/s, > 0.
    pub yaw_rate_radps: f64,
}

/// What a way costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trip {
    /// Energy from the robot's battery, Wh.
    pub energy_wh: Estimate,
    /// Time it takes, s.
    pub time_s: f64,
    /// Distance, m.
    pub distance_m: f64,
}

/// A speed and what a metre costs at it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Economy {
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Energy per metre from the robot's battery, J/m.
    pub energy_j_per_m: Estimate,
}

/// Runs a robot's model at parameters drawn about its own.
fn run_at(model: &Arc<Model>, values: &[f64], inputs: &[(Channel, f64)]) -> Run<f64> {
    let parameters = values.iter().zip(model.parameters()).map(|(&value, p)| value.clamp(p.min, p.max)).collect();
    let mut run = Run::with_parameters(Arc::clone(model), parameters, Start::at_soc(0.0));
    for &(channel, value) in inputs {
        run.channels[channel] = value;
    }
    run
}

fn per_metre_j(run: &mut Run<f64>, speed_mps: f64) -> f64 {
    run.channels[Channel::SpeedMps] = speed_mps;
    run.step(1.0);
    run.channels[Channel::PowerW] / speed_mps
}

/// Energy per metre at a constant speed (> 0), J/m, with its deviation. `inputs` hold throughout:
/// pitch, floor, payload, states of the computer.
#[must_use]
pub fn energy_per_metre(model: &Arc<Model>, inputs: &[(Channel, f64)], speed_mps: f64) -> Estimate {
    propagate_loads(model, |model, values| per_metre_j(&mut run_at(model, values, inputs), speed_mps))
}

/// The speed within the range (both > 0) at which a metre costs least.
///
/// By golden section: `P(v) / v` has one minimum for any power that is convex in the speed, as
/// the sum of these effects is. Where more speed always pays, that is the fastest allowed.
#[must_use]
pub fn most_economical(model: &Arc<Model>, inputs: &[(Channel, f64)], speeds_mps: RangeInclusive<f64>) -> Economy {
    let mut run = run_at(model, &model.values(), inputs);
    let mut cost = |speed_mps: f64| per_metre_j(&mut run, speed_mps);
    let (slowest, fastest) = (*speeds_mps.start(), *speeds_mps.end());
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let (mut low, mut high) = (slowest, fastest);
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut left_j, mut right_j) = (cost(left), cost(right));
    while high - low > SEARCH_WIDTH * (fastest - slowest) {
        if left_j <= right_j {
            (high, right, right_j) = (right, left, left_j);
            left = high - golden * (high - low);
            left_j = cost(left);
        } else {
            (low, left, left_j) = (left, right, right_j);
            right = low + golden * (high - low);
            right_j = cost(right);
        }
    }
    let found = [slowest, f64::midpoint(low, high), fastest].into_iter().min_by(|a, b| cost(*a).total_cmp(&cost(*b)));
    let speed_mps = found.expect("three speeds");
    Economy { speed_mps, energy_j_per_m: energy_per_metre(model, inputs, speed_mps) }
}

/// A stretch of constant acceleration, or of turning on the spot.
#[derive(Debug, Clone, Copy)]
enum Stretch {
    Drive { from_mps: f64, to_mps: f64, length_m: f64 },
    Turn { time_s: f64 },
}

/// The stretches of one segment that is entered at `enter_mps` and left at `leave_mps`.
fn ramps(segment: &Segment, accel_mps2: f64, enter_mps: f64, leave_mps: f64) -> [Stretch; 3] {
    let cruise_mps = segment.speed_mps.max(SLOWEST_MPS);
    let ramp_m = |from: f64, to: f64| ((to * to - from * from) / (2.0 * accel_mps2)).abs();
    let (mut up_m, mut down_m) = (ramp_m(enter_mps, cruise_mps), ramp_m(cruise_mps, leave_mps));
    let mut top_mps = cruise_mps;
    if up_m + down_m > segment.length_m {
        // Too short for the speed wanted: meet in the middle, or brake all the way.
        let square = (enter_mps.powi(2) + leave_mps.powi(2)) / 2.0 + accel_mps2 * segment.length_m;
        top_mps = square.sqrt().min(cruise_mps.max(enter_mps)).max(enter_mps.max(leave_mps));
        let share = segment.length_m / (ramp_m(enter_mps, top_mps) + ramp_m(top_mps, leave_mps)).max(1e-12);
        (up_m, down_m) = (ramp_m(enter_mps, top_mps) * share, ramp_m(top_mps, leave_mps) * share);
    }
    [
        Stretch::Drive { from_mps: enter_mps, to_mps: top_mps, length_m: up_m },
        Stretch::Drive { from_mps: top_mps, to_mps: top_mps, length_m: (segment.length_m - up_m - down_m).max(0.0) },
        Stretch::Drive { from_mps: top_mps, to_mps: leave_mps, length_m: down_m },
    ]
}

/// The speeds at the ends of all segments: as fast as the next one, or a standstill before it turns on the spot and at the end, but no
/// faster than the pace allows to get there from the end before, and to slow down to the next.
fn speeds_at_ends(pace: Pace, way: &[Segment]) -> Vec<f64> {
    let driven_m = |segment: &Segment| segment.length_m.max(0.0);
    let reachable = |from_mps: f64, segment: &Segment| (from_mps.powi(2) + 2.0 * pace.accel_mps2 * driven_m(segment)).sqrt();
    let wanted = |(index, segment): (usize, &Segment)| match way.get(index + 1) {
        Some(next) if next.turn_rad == 0.0 && next.length_m > 0.0 => next.speed_mps.clamp(SLOWEST_MPS, segment.speed_mps.max(SLOWEST_MPS)),
        _ => 0.0,
    };
    let mut ends: Vec<f64> = way.iter().enumerate().map(wanted).collect();
    let mut now_mps = 0.0;
    for (end_mps, segment) in ends.iter_mut().zip(way) {
        *end_mps = end_mps.min(reachable(now_mps, segment));
        now_mps = *end_mps;
    }
    for index in (1..way.len()).rev() {
        ends[index - 1] = ends[index - 1].min(reachable(ends[index], &way[index]));
    }
    ends
}

/// All stretches of a way that begins and ends at a standstill, each with its segment. The robot
/// stops before it turns on the spot, and otherwise carries its speed on.
fn stretches(pace: Pace, way: &[Segment]) -> Vec<(Stretch, &Segment)> {
    let mut found = Vec::with_capacity(4 * way.len());
    let mut now_mps = 0.0;
    for (segment, leave_mps) in way.iter().zip(speeds_at_ends(pace, way)) {
        if segment.turn_rad != 0.0 {
            found.push((Stretch::Turn { time_s: segment.turn_rad.abs() / pace.yaw_rate_radps }, segment));
        }
        if segment.length_m <= 0.0 {
            continue;
        }
        for stretch in ramps(segment, pace.accel_mps2, now_mps, leave_mps) {
            if matches!(stretch, Stretch::Drive { length_m, .. } if length_m > 0.0) {
                found.push((stretch, segment));
            }
        }
        now_mps = leave_mps;
    }
    found
}

/// What a robot does for a while of its way: inputs that hold for `time_s`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// How long, s.
    pub time_s: f64,
    /// Speed, acceleration, yaw rate, pitch, floor and payload, by channel of the robot's model.
    pub inputs: [(Channel, f64); 6],
}

/// A way as what the robot does, one moment after the other; it begins and ends at a standstill.
/// While the speed changes, a moment's is that of its middle.
///
/// # Panics
/// When the pace is not above zero.
#[must_use]
pub fn moments(pace: Pace, way: &[Segment]) -> Vec<Moment> {
    assert!(pace.accel_mps2 > 0.0 && pace.yaw_rate_radps > 0.0, "a pace above zero: {pace:?}");
    let mut moments = Vec::new();
    for (stretch, segment) in stretches(pace, way) {
        let (time_s, steps, from_mps, to_mps, yaw_rate_radps) = match stretch {
            Stretch::Turn { time_s } => {
                (time_s, (time_s / STEP_MAX_S).ceil() as u32, 0.0, 0.0, pace.yaw_rate_radps.copysign(segment.turn_rad))
            }
            Stretch::Drive { from_mps, to_mps, length_m } => {
                let time_s = 2.0 * length_m / (from_mps + to_mps);
                let steps = if from_mps == to_mps { (time_s / STEP_MAX_S).ceil() as u32 } else { RAMP_STEPS };
                (time_s, steps, from_mps, to_mps, 0.0)
            }
        };
        let steps = steps.max(1);
        for step in 0..steps {
            let share = (f64::from(step) + 0.5) / f64::from(steps);
            let inputs = [
                (Channel::SpeedMps, from_mps + (to_mps - from_mps) * share),
                (Channel::AccelMps2, (to_mps - from_mps) / time_s),
                (Channel::YawRateRadps, yaw_rate_radps),
                (Channel::PitchRad, segment.pitch_rad),
                (Channel::FloorClass, f64::from(segment.floor_class)),
                (Channel::PayloadKg, segment.payload_kg),
            ];
            moments.push(Moment { time_s: time_s / f64::from(steps), inputs });
        }
    }
    moments
}

/// Energy and time of a way that begins and ends at a standstill. `inputs` hold throughout: states
/// of the computer, angle of the tail, voltage.
///
/// Sigma holds for parameters that are known independently of each other; what the floor or
/// other traffic adds is not in it.
///
/// # Panics
/// When the pace is not above zero.
#[must_use]
pub fn trip(model: &Arc<Model>, inputs: &[(Channel, f64)], pace: Pace, way: &[Segment]) -> Trip {
    let moments = moments(pace, way);
    let energy_wh = propagate_loads(model, |model, values| {
        let mut run = run_at(model, values, inputs);
        let mut energy_j = 0.0;
        for moment in &moments {
            for (channel, value) in moment.inputs {
                run.channels[channel] = value;
            }
            run.step(moment.time_s);
            energy_j += run.channels[Channel::PowerW] * moment.time_s;
        }
        energy_j / S_PER_H
    });
    let time_s = moments.iter().map(|moment| moment.time_s).sum();
    Trip { energy_wh, time_s, distance_m: way.iter().map(|segment| segment.length_m.max(0.0)).sum() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(effects: &str) -> Arc<Model> {
        let text = format!("schema = 1\nsystem = \"robot\"\nname = \"test\"\n{effects}");
        Arc::new(Model::parse("test", &text, &|_| unreachable!()).unwrap())
    }

    const IDLE: &str = "[[effect]]\nid = \"idle\"\nidle_w = { value = 4.0, sigma = 0.2, source = \"\" }\n";
    const DRY: &str = "[[effect]]\nid = \"dry_friction\"\nforce_n = { value = 2.0, sigma = 0.3, source = \"\" }\n";
    const VISCOUS: &str = "[[effect]]\nid = \"viscous_friction\"\nviscous_n_s_per_m = { value = 25.0, source = \"\" }\n";

    #[test]
    fn the_best_speed_is_where_standing_load_and_viscous_loss_are_equal() {
        // (P + F v + b v²) / v is least at v = sqrt(P / b) = sqrt(4 / 25) = 0.4.
        let best = most_economical(&robot(&format!("{IDLE}{DRY}{VISCOUS}")), &[], 0.01..=1.0);
        assert!((best.speed_mps - 0.4).abs() < 1e-3, "{}", best.speed_mps);
        // 4 / 0.4 + 2 + 25 x 0.4 = 22 J/m; sigma: 0.2 / 0.4 and 0.3 in quadrature.
        assert!((best.energy_j_per_m.value - 22.0).abs() < 1e-3);
        assert!((best.energy_j_per_m.sigma - 0.25f64.hypot(0.0).hypot(0.3).max(0.5f64.hypot(0.3))).abs() < 1e-3);
        // Without viscous friction more speed always pays.
        assert_eq!(most_economical(&robot(&format!("{IDLE}{DRY}")), &[], 0.01..=0.5).speed_mps, 0.5);
    }

    #[test]
    fn a_way_costs_standing_power_by_time_and_friction_by_distance() {
        let model = robot(&format!("{IDLE}{DRY}"));
        let pace = Pace { accel_mps2: 0.5, yaw_rate_radps: 1.0 };
        let turn = Segment { turn_rad: -1.5, ..Segment::level(2.0, 0.5) };
        let trip = trip(&model, &[], pace, &[Segment::level(3.0, 0.5), turn]);
        // By hand: each leg takes L / v + v / a, the turn 1.5 s.
        let time_s = (6.0 + 1.0) + 1.5 + (4.0 + 1.0);
        assert!((trip.time_s - time_s).abs() < 1e-9, "{}", trip.time_s);
        assert!((trip.energy_wh.value - (4.0 * time_s + 2.0 * 5.0) / 3600.0).abs() < 1e-9);
        assert!((trip.energy_wh.sigma - (0.2 * time_s).hypot(0.3 * 5.0) / 3600.0).abs() < 1e-9);
        assert_eq!(trip.distance_m, 5.0);
    }

    #[test]
    fn a_climb_costs_its_height_and_braking_gives_back_only_what_is_recovered() {
        let slope = "[[effect]]\nid = \"slope\"\nmass_kg = { value = 2.0, source = \"\" }\n";
        let accel = "[[effect]]\nid = \"acceleration\"\nmass_kg = { value = 2.0, source = \"\" }\n";
        let recover = |share: f64| format!("[[effect]]\nid = \"regeneration\"\nshare = {{ value = {share:.1}, source = \"\" }}\n");
        let pace = Pace { accel_mps2: 0.4, yaw_rate_radps: 1.0 };
        let climb = Segment { pitch_rad: 0.2, ..Segment::level(5.0, 0.5) };
        let joule = |effects: &str, way: &[Segment]| trip(&robot(effects), &[], pace, way).energy_wh.value * 3600.0;
        let height_j = 2.0 * 9.806_65 * 0.2f64.sin() * 5.0;
        assert!((joule(slope, &[climb]) - height_j).abs() < 1e-6 * height_j);
        // Kinetic energy m v²/2 once for start and stop; all of it comes back when all is recovered.
        let level = Segment::level(5.0, 0.5);
        assert!((joule(accel, &[level]) - 0.25).abs() < 1e-9);
        assert!(joule(&format!("{accel}{}", recover(1.0)), &[level]).abs() < 1e-9);
        assert!((joule(&format!("{accel}{}", recover(0.4)), &[level]) - 0.6 * 0.25).abs() < 1e-9);
    }

    #[test]
    fn short_legs_and_changes_of_speed_keep_their_distance() {
        let pace = Pace { accel_mps2: 0.5, yaw_rate_radps: 1.0 };
        let way = [Segment::level(0.1, 0.5), Segment::level(2.0, 0.2), Segment::level(1.0, 0.6), Segment::level(0.05, 0.6)];
        let driven_m: f64 = stretches(pace, &way)
            .iter()
            .map(|(stretch, _)| match stretch {
                Stretch::Drive { length_m, from_mps, to_mps } => {
                    assert!(from_mps.min(*to_mps) >= 0.0 && from_mps.max(*to_mps) <= 0.6 + 1e-12 && from_mps + to_mps > 0.0);
                    *length_m
                }
                Stretch::Turn { .. } => 0.0,
            })
            .sum();
        assert!((driven_m - 3.15).abs() < 1e-9, "{driven_m}");
        assert!(trip(&robot(IDLE), &[], pace, &way).time_s > 2.0 / 0.2 + 1.0 / 0.6);
        // A leg of 5 cm gets to sqrt(2 x 0.5 x 0.05) = 0.22 m/s, and one of 5 cm at the end stops from no more.
        let short = [Segment::level(0.05, 0.5), Segment::level(1.0, 0.5), Segment::level(0.05, 0.5)];
        for moment in moments(pace, &[way.as_slice(), &short].concat()).iter().chain(&moments(pace, &short)) {
            let (_, accel_mps2) = moment.inputs[1];
            assert!(accel_mps2.abs() <= 0.5 * (1.0 + 1e-9), "{moment:?}");
        }
        assert_eq!(trip(&robot(IDLE), &[], pace, &[]).energy_wh.value, 0.0);
    }
}
