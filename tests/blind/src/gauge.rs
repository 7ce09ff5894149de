//! A fuel-gauge IC between the truth and the log: noise, steps, a specimen's offset and gain.
//!
//! It has no dead band, and reads voltage and current at one time: both are effects of the
//! catalogue, so that a gauge that had them would hide them in every case, nulls among them.
//! (25 ms between the two readings move a 5 s log of a large pack by 2 mV at every step.)

use energy::{Channel, Sensor};

use crate::random::Stream;
use crate::world::on_shelf;

/// One specimen of a gauge: what it has of each sensor's stated spread stays the same in all logs.
#[derive(Debug, Clone)]
pub struct Gauge {
    sensors: Vec<(Channel, Sensor, f64, f64)>,
}

impl Gauge {
    /// Draws a specimen of the stated sensors. Offsets and gains stay within two deviations: what
    /// is further out is sorted out by the maker.
    #[must_use]
    pub fn draw(sensors: &[(Channel, Sensor)], random: &mut Stream) -> Self {
        let draw = |&(channel, sensor): &(Channel, Sensor)| {
            let (offset, gain) = (random.normal().clamp(-2.0, 2.0), random.normal().clamp(-2.0, 2.0));
            (channel, sensor, offset, gain)
        };
        Self { sensors: sensors.iter().map(draw).collect() }
    }

    /// What the log shows of a channel. A channel without a stated sensor is known exactly.
    #[must_use]
    pub fn shows(&self, channel: Channel, time_s: &[f64], truth: &[f64], random: &mut Stream) -> Vec<f64> {
        let Some((_, sensor, offset, gain)) = self.sensors.iter().find(|(known, ..)| *known == channel) else { return truth.to_vec() };
        let read = |row: usize| {
            // Over weeks on a shelf the noise of a current averages out.
            let long = row > 0 && on_shelf(time_s[row] - time_s[row - 1]);
            let noise = if channel == Channel::CurrentA && long { 0.0 } else { random.normal() };
            sensor.shows(truth[row], noise, *offset, *gain)
        };
        (0..truth.len()).map(read).collect()
    }
}
