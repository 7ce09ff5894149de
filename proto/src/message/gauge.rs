//! The fuel gauge of one battery: a robot's, or a station's pack.

use serde::{Deserialize, Serialize};

use super::check::{self, MessageError};
use crate::codec::Message;
use crate::estimate::Estimate;
use crate::time::Timestamp;

/// What a gauge knows about one battery at one instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gauge {
    /// Instant of the underlying samples.
    pub at: Timestamp,
    /// Counts up by one per message, from the start of the sender; gaps are losses.
    pub seq: u64,
    /// State of charge, a fraction (-0.05 to 1.05; the overshoot shows the gauge's error).
    pub soc: Estimate,
    /// Energy left until empty at the recent load, Wh.
    pub remaining_wh: Estimate,
    /// Energy from full to empty at the recent load, Wh (above zero).
    pub full_wh: Estimate,
    /// Time until empty at the recent load, s (zero or more); none while not discharging.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_to_empty_s: Option<Estimate>,
    /// Time until full, s (zero or more); none while not charging.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_to_full_s: Option<Estimate>,
    /// State of health: present over rated capacity (0 to 1.5).
    pub soh: Estimate,
    /// Full-equivalent cycles since the gauge began: charge drawn over capacity (zero or more); none
    /// from a device that does not count them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cycles: Option<f64>,
    /// Terminal voltage, V (0 to 2000).
    pub voltage_v: f64,
    /// Terminal current, A; discharge positive.
    pub current_a: f64,
    /// Battery temperature, °C (-80 to 200).
    pub temperature_degc: f64,
    /// Recent mean drawn power, W; discharge positive.
    pub power_w: f64,
    /// Cells in series (one or more).
    pub cells_series: u32,
    /// Which estimator or device this comes from.
    pub source: String,
}

/// Most energy that a battery may hold, Wh.
const ENERGY_WH_MAX: f64 = 1e9;

impl Message for Gauge {
    const SCHEMA: &'static str = "tender.gauge/1";

    fn validate(&self) -> Result<(), MessageError> {
        check::soc_estimate("soc", self.soc)?;
        check::estimate_within("remaining_wh", self.remaining_wh, ENERGY_WH_MAX)?;
        check::estimate_within("full_wh", self.full_wh, ENERGY_WH_MAX)?;
        let full_wh = self.full_wh.value;
        check::require(full_wh > 0.0, "full_wh.value", full_wh, "above zero")?;
        if let Some(time_s) = self.time_to_empty_s {
            check::estimate_not_negative("time_to_empty_s", time_s)?;
        }
        if let Some(time_s) = self.time_to_full_s {
            check::estimate_not_negative("time_to_full_s", time_s)?;
        }
        check::estimate("soh", self.soh)?;
        check::within("soh.value", self.soh.value, 0.0, 1.5)?;
        if let Some(cycles) = self.cycles {
            check::not_negative("cycles", cycles)?;
        }
        check::within("voltage_v", self.voltage_v, 0.0, 2_000.0)?;
        check::finite("current_a", self.current_a)?;
        // Narrow enough that room temperature in kelvin does not pass for Celsius.
        check::within("temperature_degc", self.temperature_degc, -80.0, 200.0)?;
        check::finite("power_w", self.power_w)?;
        let cells = self.cells_series;
        check::require(cells > 0, "cells_series", cells, "one or more")
    }
}
