//! What a battery gauge of the world outside says, whichever it is.

use std::ops::RangeInclusive;

use energy::Estimate;

/// State of charge of a battery of which nothing is known: uniform from 0 to 1, the deviation of which is 1 / sqrt(12).
pub const UNKNOWN_SOC: Estimate = Estimate::new(0.5, 0.288_675_134_594_812_9);

/// Temperatures that a battery at work may have, °C. Data sheets of cells end between -40 and 85 at the widest; the rest is left for sensors that
/// are off. What shows anything else is no battery: a register that nobody has written (0 is absolute zero on an SMBus), a thermistor that is
/// broken off or shorted.
pub(crate) const PLAUSIBLE_DEGC: RangeInclusive<f64> = -60.0..=100.0;

/// Whether something outside feeds what the battery feeds, as far as the device can tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Supply {
    /// A charger or another supply is connected.
    Connected,
    /// The battery feeds it alone.
    Absent,
    /// The current decides.
    #[default]
    Unknown,
}

/// What a device says of its battery at one instant. What it does not measure is none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Report {
    /// When, by the device's clock, s since any instant; none where it has no clock.
    pub at_s: Option<f64>,
    /// Terminal voltage, V.
    pub voltage_v: Option<f64>,
    /// Current, A (discharge positive).
    pub current_a: Option<f64>,
    /// Temperature, °C.
    pub temperature_degc: Option<f64>,
    /// State of charge by the device's own gauge, 0..1.
    pub soc: Option<f64>,
    /// How far that may be off (standard deviation), when the device says so.
    pub soc_sigma: Option<f64>,
    /// Whether something feeds what it feeds.
    pub supply: Supply,
}

/// A battery gauge of the world outside.
pub trait Device: Send {
    /// What it is, for people: `power_supply BAT0`.
    fn name(&self) -> String;

    /// What it has said since the last call, `dt_s` seconds ago, oldest first; called about once a second.
    /// It must not wait.
    ///
    /// # Errors
    /// Why nothing can be read now: told to people, and tried again.
    fn read(&mut self, dt_s: f64) -> anyhow::Result<Vec<Report>>;

    /// Switches the charger on or off, where the device can.
    fn charge(&mut self, _on: bool) {}

    /// Nothing of that is wanted any more.
    fn leave(&mut self) {}

    /// What went wrong with that.
    fn trouble(&self) -> Option<String> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_is_spread_evenly_over_all_that_it_can_be() {
        // The mean square of what lies evenly from 0 to 1 is 1/3, that of its mean 1/4.
        assert!((UNKNOWN_SOC.sigma.powi(2) - (1.0 / 3.0 - UNKNOWN_SOC.value.powi(2))).abs() < 1e-15);
    }
}
