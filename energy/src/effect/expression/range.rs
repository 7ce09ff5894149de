//! Whether a formula gives a number wherever a system may come.

use super::{Definition, ExpressionError, Name, Part, Parts, wrong};
use crate::{Channel, Channels, Facts};

/// Points within the ranges at which a formula is tried, beside their corners.
const POINTS: usize = 64;
/// Longest run, s.
const LONG_S: f64 = 1e5;

/// Values between which a channel lies in use, for a thing with these facts.
fn range(channel: Channel, facts: &Facts) -> (f64, f64) {
    if let Facts::Battery(battery) = facts {
        let cell_a = 3.0 * battery.capacity_ah / f64::from(battery.parallel);
        let cell_v = (battery.eod_v_per_cell, battery.full_v_per_cell);
        match channel {
            Channel::CurrentA | Channel::TerminalCurrentA => return (-3.0 * battery.capacity_ah, 3.0 * battery.capacity_ah),
            Channel::CellCurrentA => return (-cell_a, cell_a),
            Channel::VoltageV | Channel::TerminalVoltageV => return (battery.eod_v(), battery.full_v()),
            Channel::CellVoltageV | Channel::OcvV | Channel::CellMinV | Channel::CellMaxV => return cell_v,
            Channel::CapacityAh => return (0.5 * battery.capacity_ah, battery.capacity_ah),
            _ => {}
        }
    }
    match channel {
        Channel::Soc | Channel::CpuUtil | Channel::RadioDuty | Channel::CameraOn => (0.0, 1.0),
        Channel::History => (-1.0, 1.0),
        Channel::TemperatureDegc | Channel::AmbientDegc | Channel::CellDegc => (-20.0, 60.0),
        Channel::CycleCount => (0.0, 1000.0),
        Channel::AgeDays => (0.0, 3650.0),
        Channel::SpeedMps | Channel::YawRateRadps | Channel::AccelMps2 => (-2.0, 2.0),
        Channel::PitchRad => (-0.5, 0.5),
        Channel::TailAngleRad => (-3.2, 3.2),
        Channel::RadioTxDbm => (-20.0, 30.0),
        Channel::CpuMhz => (0.0, 3000.0),
        Channel::PackVoltageV | Channel::VoltageV => (3.0, 60.0),
        Channel::PackCurrentA => (-20.0, 100.0),
        Channel::EntropyVPerK => (-1e-3, 1e-3),
        Channel::OverpotentialV => (-0.5, 0.5),
        Channel::LostCurrentA => (-0.1, 0.1),
        Channel::TractionN => (-100.0, 100.0),
        Channel::FloorClass | Channel::RobotsDocked | Channel::RobotsCharging | Channel::SelectorEvents | Channel::LiftActive => (0.0, 5.0),
        _ => (0.0, 100.0),
    }
}

/// Tries a formula at rest, at the corners of what its channels may hold, and in between; and that
/// it vanishes where its parameters say that it does.
pub(super) fn check_finite(facts: &Facts, definition: &Definition, parts: &Parts) -> Result<(), ExpressionError> {
    let channels: Vec<Channel> = Channel::ALL.iter().copied().filter(|channel| parts.used.contains(&Name::Channel(*channel))).collect();
    let values: Vec<f64> = definition.parameters.iter().map(|parameter| parameter.value).collect();
    let nulls: Vec<f64> = definition.parameters.iter().map(|parameter| parameter.null.unwrap_or(parameter.value)).collect();
    let vanishes = definition.parameters.iter().any(|parameter| parameter.null.is_some());
    for point in 0..POINTS + 4 {
        let mut now = Channels::filled(0.0);
        for (place, &channel) in channels.iter().enumerate() {
            let (low, high) = range(channel, facts);
            now[channel] = match point {
                0 => 0_f64.clamp(low, high),
                1 => low,
                2 => high,
                3 => 0.5 * (low + high),
                // Steps by irrational shares fill the box evenly.
                _ => low + (high - low) * ((point as f64) * (2.0 + place as f64).sqrt()).fract(),
            };
        }
        let time_s = LONG_S * point as f64 / POINTS as f64;
        let place = || {
            let at: Vec<String> = channels.iter().map(|&channel| format!("{} = {:.4}", channel.name(), now[channel])).collect();
            if at.is_empty() { format!("time_s = {time_s}") } else { at.join(", ") }
        };
        let share = parts.settled(&now, &values, time_s);
        if !share.is_finite() {
            let message = format!(
                "the formula is not finite ({share}) at {}: keep what is divided by, and what a logarithm or root is taken of, above 0",
                place()
            );
            return wrong(Part::Formula, message);
        }
        if vanishes {
            let rest = parts.settled(&now, &nulls, time_s);
            // A null outside the formula's range (0 * ln 0) leaves nothing all the same.
            if rest.is_finite() && rest.abs() > 1e-12 * (1.0 + share.abs()) {
                let nulls: Vec<String> =
                    definition.parameters.iter().filter_map(|p| p.null.map(|null| format!("{} = {null}", p.name))).collect();
                return wrong(
                    Part::Formula,
                    format!("the formula is {rest} at {}, not 0, where {} says that it vanishes", place(), nulls.join(", ")),
                );
            }
        }
    }
    Ok(())
}
