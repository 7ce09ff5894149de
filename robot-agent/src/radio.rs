//! How far a robot's radio reaches: the same keys in scenarios and in the agent's configuration.

use energy::power::radio::Link;
use node::mission::within;
use serde::{Deserialize, Serialize};

/// `[radio]`: the link to the coordinator; its power is the load model's input `radio_tx_dbm`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Radio {
    /// Carrier frequency, Hz.
    pub frequency_hz: f64,
    /// Gain of the robot's antenna over an isotropic one, dB.
    #[serde(default)]
    pub robot_gain_db: f64,
    /// Gain of the coordinator's antenna, dB.
    #[serde(default)]
    pub coordinator_gain_db: f64,
    /// Everything else lost on the way, dB.
    #[serde(default)]
    pub loss_db: f64,
    /// Least power that a receiver understands, dBm.
    pub sensitivity_dbm: f64,
}

impl Radio {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn check(&self) -> anyhow::Result<()> {
        within("radio.frequency_hz", self.frequency_hz, 1e5, 1e12)?;
        within("radio.robot_gain_db", self.robot_gain_db, -100.0, 100.0)?;
        within("radio.coordinator_gain_db", self.coordinator_gain_db, -100.0, 100.0)?;
        within("radio.loss_db", self.loss_db, 0.0, 300.0)?;
        within("radio.sensitivity_dbm", self.sensitivity_dbm, -200.0, 100.0)
    }

    /// What is left above the sensitivity over a distance, dB; negative when the link does not hold.
    /// Within a wavelength of the antenna it counts as at its end: nearer there is no free space.
    #[must_use]
    pub fn margin_db(&self, transmit_dbm: f64, distance_m: f64) -> f64 {
        let link = Link {
            frequency_hz: self.frequency_hz,
            transmit_dbm,
            transmit_gain_db: self.robot_gain_db,
            receive_gain_db: self.coordinator_gain_db,
            loss_db: self.loss_db,
            sensitivity_dbm: self.sensitivity_dbm,
        };
        link.margin_db(distance_m.max(link.wavelength_m()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_holds_up_to_its_range_and_not_beyond() {
        let radio = Radio { frequency_hz: 2.4e9, robot_gain_db: 2.0, coordinator_gain_db: 2.0, loss_db: 20.0, sensitivity_dbm: -85.0 };
        // By hand: 15 dBm + 4 dB - 20 dB + 85 dB = 84 dB of free-space loss; 40.05 dB at 1 m leave 20 log10(d) = 43.95 dB.
        let range_m = 10f64.powf((84.0 - 40.05) / 20.0);
        assert!(radio.margin_db(15.0, 0.99 * range_m) > 0.0 && radio.margin_db(15.0, 1.01 * range_m) < 0.0, "{range_m}");
        assert!(radio.margin_db(15.0, 0.0).is_finite());
    }
}
