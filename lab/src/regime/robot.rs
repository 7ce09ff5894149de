//! Regimes of a robot.

use energy::Channel;

use super::bands::{Scale, by_number, named};
use super::{Columns, Dimension, Seen};

/// Below this speed a robot stands still, m/s.
const STILL_MPS: f64 = 0.01;
/// Below this acceleration its speed is steady, m/s².
const STEADY_MPS2: f64 = 0.05;
/// Below this turn rate it goes straight, rad/s.
const STRAIGHT_RADPS: f64 = 0.05;
/// Below this slope the ground is level, degrees.
const LEVEL_DEG: f64 = 1.0;
/// Above this slope it is steep, degrees.
const STEEP_DEG: f64 = 5.0;

pub(super) fn dimensions(seen: &Seen<'_>) -> Vec<Dimension> {
    let number = |channel, scale| by_number(scale, &seen.channel(channel)?);
    let three = |name, channel, bands: [(&str, &str); 3], edge: f64| {
        let of = |value: f64| if value.abs() <= edge { 1 } else { usize::from(value > 0.0) * 2 };
        Some(named(name, &bands, &seen.channel(channel)?, of))
    };
    let on_off =
        |name, channel, bands: [(&str, &str); 2]| Some(named(name, &bands, &seen.channel(channel)?, |value| usize::from(value > 0.5)));
    let braking = [("braking", "while braking"), ("steady", "at steady speed"), ("accelerating", "while accelerating")];
    let turning = [("clockwise", "in clockwise turns"), ("straight", "going straight"), ("anticlockwise", "in anticlockwise turns")];
    let camera = [("camera off", "with the camera off"), ("camera on", "with the camera on")];
    let all = [
        seen.channel(Channel::SpeedMps).map(|speed_mps| speed(&speed_mps)),
        three("acceleration", Channel::AccelMps2, braking, STEADY_MPS2),
        three("turning", Channel::YawRateRadps, turning, STRAIGHT_RADPS).map(any_turn),
        seen.channel(Channel::PitchRad).map(|pitch_rad| slope(&pitch_rad)),
        number(Channel::CpuUtil, Scale::percent("cpu", " % CPU use")),
        number(Channel::CpuMhz, Scale::of("cpu clock", " MHz")),
        number(Channel::RadioDuty, Scale::percent("radio", " % of the time sending")),
        number(Channel::RadioTxDbm, Scale::of("radio power", " dBm")),
        on_off("camera", Channel::CameraOn, camera),
        number(Channel::PayloadKg, Scale::of("payload", " kg of payload")),
        number(Channel::FloorClass, Scale::of("floor", " as floor class")),
        number(Channel::TailAngleRad, Scale::of("tail", " rad of tail angle")),
        number(Channel::VoltageV, Scale::of("voltage", " V of supply")),
        number(Channel::AmbientDegc, Scale::of("ambient", " degC around it")),
    ];
    all.into_iter().flatten().collect()
}

/// Standing still, and bands of speed while driving.
fn speed(speed_mps: &Columns<'_>) -> Dimension {
    let sizes: Vec<Option<Vec<f64>>> =
        speed_mps.iter().map(|column| Some(column.as_ref()?.iter().map(|speed| speed.abs()).collect())).collect();
    let moving = |column: &Option<Vec<f64>>| {
        let speeds = column.as_ref()?.iter().map(|&speed| if speed < STILL_MPS { f64::NAN } else { speed });
        Some(speeds.collect::<Vec<f64>>())
    };
    let moving: Vec<Option<Vec<f64>>> = sizes.iter().map(moving).collect();
    let still = |value: f64| usize::from(value >= STILL_MPS);
    let sizes: Columns<'_> = sizes.iter().map(Option::as_deref).collect();
    let two = named("speed", &[("standing still", "standing still"), ("driving", "while driving")], &sizes, still);
    let Some(driving) = by_number(Scale::of("speed", " m/s"), &moving.iter().map(Option::as_deref).collect()) else { return two };
    // Band 0 stands still, the bands of speed follow.
    let shift = |(bands, words): (Vec<usize>, String)| (bands.into_iter().map(|band| band + 1).collect(), format!("driving {words}"));
    let all = (1..=driving.bands.len()).collect();
    let groups = [(vec![0], "standing still".to_owned()), (all, "while driving".to_owned())];
    let of_row = two.of_row.iter().zip(&driving.of_row).map(|(two, bands)| {
        let row = |(two, band): (&Option<usize>, &Option<usize>)| if *two == Some(0) { Some(0) } else { band.map(|band| band + 1) };
        two.iter().zip(bands).map(row).collect()
    });
    Dimension {
        name: "speed",
        of_row: of_row.collect(),
        bands: std::iter::once("standing still".to_owned()).chain(driving.bands).collect(),
        groups: groups.into_iter().chain(driving.groups.into_iter().map(shift)).collect(),
    }
}

fn any_turn(mut turning: Dimension) -> Dimension {
    turning.groups.push((vec![0, 2], "in turns".to_owned()));
    turning
}

fn slope(pitch_rad: &Columns<'_>) -> Dimension {
    let bands = [
        ("steep downhill", "steeply downhill"),
        ("downhill", "gently downhill"),
        ("level", "on level ground"),
        ("uphill", "gently uphill"),
        ("steep uphill", "steeply uphill"),
    ];
    let edges = [-STEEP_DEG, -LEVEL_DEG, LEVEL_DEG, STEEP_DEG];
    let mut slope = named("slope", &bands, pitch_rad, |pitch_rad| edges.partition_point(|&edge| edge < pitch_rad.to_degrees()));
    let more = [(vec![0, 1], "downhill"), (vec![3, 4], "uphill"), (vec![0, 1, 3, 4], "on slopes"), (vec![0, 4], "on steep slopes")];
    slope.groups.extend(more.map(|(bands, words)| (bands, words.to_owned())));
    slope
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standing_robot_is_told_from_slow_and_fast_ones() {
        let speed_mps: Vec<f64> = (0..60).map(|k| f64::from(k / 2) * -0.01).collect();
        let dimension = speed(&vec![Some(&speed_mps)]);
        assert_eq!(dimension.bands[..2], ["standing still", "< 0.1 m/s"]);
        assert_eq!((dimension.of_row[0][0], dimension.of_row[0][4]), (Some(0), Some(1)));
        let dimension = speed(&vec![Some(&[0.0, 0.3, 0.3])]);
        assert_eq!((dimension.bands.len(), &dimension.of_row[0]), (2, &vec![Some(0), Some(1), Some(1)]));
    }

    #[test]
    fn slopes_have_a_sign() {
        let pitch_rad: Vec<f64> = [-8.0_f64, -2.0, 0.0, 2.0, 8.0].map(f64::to_radians).to_vec();
        assert_eq!(slope(&vec![Some(&pitch_rad)]).of_row, [[0, 1, 2, 3, 4].map(Some)]);
    }
}
