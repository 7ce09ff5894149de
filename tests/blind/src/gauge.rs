//! A fuel-gauge IC between the truth and the log: noise, steps, skew, a specimen's offset and gain.
//!
//! It has no dead band: that is an effect of the catalogue, and a gauge that had one beside its
//! offset would hide that effect in every case, nulls among them.

use energy::units::S_PER_H;
use energy::{Channel, Sensor};

use crate::random::Stream;

/// One specimen of a gauge: what it has of each sensor's stated spread stays the same in all logs.
#[derive(Debug, Clone)]
pub struct Gauge {
    sensors: Vec<(Channel, Sensor, f64, f64)>,
    /// V is read this much later than I, s; either sign.
    skew_s: f64,
}

/// Standard deviation of the time between the readings of I and V, s; the typical +-50 ms.
const SKEW_SIGMA_S: f64 = 0.025;

impl Gauge {
    /// Draws a specimen of the stated sensors. Offsets and gains stay within two deviations: what
    /// is further out is sorted out by the maker.
    #[must_use]
    pub fn draw(sensors: &[(Channel, Sensor)], random: &mut Stream) -> Self {
        let draw = |&(channel, sensor): &(Channel, Sensor)| {
            let (offset, gain) = (random.normal().clamp(-2.0, 2.0), random.normal().clamp(-2.0, 2.0));
            (channel, sensor, offset, gain)
        };
        let sensors = sensors.iter().map(draw).collect();
        Self { sensors, skew_s: SKEW_SIGMA_S * random.normal().clamp(-2.0, 2.0) }
    }

    /// What the log shows of a channel. A channel without a stated sensor is known exactly.
    #[must_use]
    pub fn shows(&self, channel: Channel, time_s: &[f64], truth: &[f64], random: &mut Stream) -> Vec<f64> {
        let Some((_, sensor, offset, gain)) = self.sensors.iter().find(|(known, ..)| *known == channel) else { return truth.to_vec() };
        let read = |row: usize| {
            let value = if channel == Channel::VoltageV { self.skewed(time_s, truth, row) } else { truth[row] };
            // Over weeks on a shelf the noise of a current averages out.
            let long = row > 0 && time_s[row] - time_s[row - 1] > S_PER_H;
            let noise = if channel == Channel::CurrentA && long { 0.0 } else { random.normal() };
            sensor.shows(value, noise, *offset, *gain)
        };
        (0..truth.len()).map(read).collect()
    }

    /// The value a little before or after a row, on the line between rows.
    fn skewed(&self, time_s: &[f64], truth: &[f64], row: usize) -> f64 {
        let other = if self.skew_s > 0.0 { row + 1 } else { row.wrapping_sub(1) };
        match (truth.get(other), time_s.get(other)) {
            (Some(value), Some(time)) => truth[row] + (value - truth[row]) * (self.skew_s / (time - time_s[row])),
            _ => truth[row],
        }
    }
}
