//! Rest: when a pack's voltage tells its state of charge.
//!
//! A pack rests when no current flows and its voltage has stopped moving: |dV/dt| < 4 uV/s per
//! cell (Kottas, section 3.2). The slope is that of a straight line through the samples of five
//! minutes: with steps of 1 mV a shorter window cannot tell a slope below the limit from none.

use super::Sample;
use crate::{BatteryFacts, Sensor};

/// Rested when the voltage moves less than this, V/s per cell (Kottas, section 3.2).
const SLOPE_V_PER_S: f64 = 4e-6;
/// Time over which the slope is taken, s.
const WINDOW_S: f64 = 300.0;
/// A current below this share of capacity per hour counts as none.
pub(crate) const CURRENT_SHARE: f64 = 0.005;

/// A pack at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rested {
    /// Voltage of one cell, V: the fitted line's end.
    pub(crate) cell_v: f64,
    /// Variance that noise and what is left of the relaxation give it, V².
    pub(crate) noise_v2: f64,
}

/// Watches for rest; sums over the window under way.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RestDetector {
    count: f64,
    time_s: f64,
    time2: f64,
    volt: f64,
    time_volt: f64,
    lasted_s: f64,
}

impl RestDetector {
    /// Takes in a sample; says so at the end of every window in which the pack was at rest.
    pub(crate) fn update(&mut self, facts: &BatteryFacts, sensor: &Sensor, sample: &Sample) -> Option<Rested> {
        if sample.current_a.abs() > CURRENT_SHARE * facts.capacity_ah {
            *self = Self::default();
            return None;
        }
        let series = f64::from(facts.series);
        let cell_v = sample.voltage_v / series;
        self.lasted_s += sample.dt_s;
        self.count += 1.0;
        self.time_s += self.lasted_s;
        self.time2 += self.lasted_s * self.lasted_s;
        self.volt += cell_v;
        self.time_volt += self.lasted_s * cell_v;
        if self.lasted_s < WINDOW_S || self.count < 3.0 {
            return None;
        }
        let (mean_s, mean_v) = (self.time_s / self.count, self.volt / self.count);
        let spread = self.time2 / self.count - mean_s * mean_s;
        let slope = (self.time_volt / self.count - mean_s * mean_v) / spread;
        let end_v = mean_v + slope * (self.lasted_s - mean_s);
        // A line's end is known half as well as its middle; and what still moves will go on for
        // about as long again.
        let noise_v = 2.0 * sensor.floor() / series / self.count.sqrt();
        let left_v = slope * WINDOW_S;
        *self = Self::default();
        (slope.abs() < SLOPE_V_PER_S).then_some(Rested { cell_v: end_v, noise_v2: noise_v * noise_v + left_v * left_v })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rested(slope_v_per_s: f64, current_a: f64) -> Option<Rested> {
        let model = crate::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap();
        let mut detector = RestDetector::default();
        let at = |second: u32| Sample {
            dt_s: 1.0,
            current_a,
            voltage_v: 3.0 * (3.8 + slope_v_per_s * f64::from(second)),
            temperature_degc: 25.0,
        };
        (1..=300).filter_map(|second| detector.update(model.battery(), &Sensor::PERFECT, &at(second))).last()
    }

    #[test]
    fn the_limit_is_four_microvolts_per_second_and_cell() {
        assert!(rested(5e-6, 0.0).is_none());
        let rest = rested(3e-6, 0.0).unwrap();
        assert!((rest.cell_v - (3.8 + 300.0 * 3e-6)).abs() < 1e-9);
    }

    #[test]
    fn a_pack_under_load_does_not_rest_however_steady_its_voltage() {
        assert!(rested(0.0, 0.1).is_none());
    }
}
