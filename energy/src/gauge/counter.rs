//! What every gauge that counts charge is made of: the [ledger](super::ledger) of the count, a run
//! of the model that follows the pack, and the watch for rests.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::follow::{Followed, Follower, leak_per_s};
use super::ledger::{CAPACITY, Ledger, SOC};
use super::prediction::Watch;
use super::rest::{RestDetector, Rested};
use super::{Sample, equilibrium};
use crate::units::S_PER_H;
use crate::{Channel, Estimate, Model, OcvTable};

/// See the module's text.
#[derive(Debug, Clone)]
pub(crate) struct Counter {
    pub(crate) model: Arc<Model>,
    pub(crate) ledger: Ledger,
    pub(crate) watch: Watch,
    /// The curve that a rest is read by.
    pub(crate) ocv: OcvTable,
    follower: Follower,
    rest: RestDetector,
}

impl Counter {
    /// Starts at a known state of charge. `resistance` is the covariance of what is to be learned
    /// of it, ohm² of a cell, if anything is.
    pub(crate) fn new(model: Arc<Model>, soc: Estimate, temperature_degc: f64, resistance: Option<&DMatrix<f64>>) -> Self {
        Self {
            ledger: Ledger::new(&model, soc, leak_per_s(&model, temperature_degc).sigma, resistance),
            follower: Follower::new(&model, soc.value, temperature_degc),
            watch: Watch::new(temperature_degc),
            rest: RestDetector::default(),
            ocv: equilibrium::curve(&model),
            model,
        }
    }

    /// The same sensors and load on another pack, whose count is `fresh`.
    pub(crate) fn exchanged(&self, fresh: Counter) -> Self {
        let mut ledger = self.ledger.clone();
        ledger.exchange(&fresh.ledger);
        Self { ledger, watch: self.watch.exchanged(), ..fresh }
    }

    /// State of charge.
    pub(crate) fn soc(&self) -> Estimate {
        let soc = self.ledger.state(SOC);
        Estimate::new(soc.value.clamp(0.0, 1.0), soc.sigma)
    }

    /// Counts the charge of a sample; asleep, what the current sensor shows is not counted.
    /// Returns what the model did, and the share of capacity that was drawn.
    pub(crate) fn count(&mut self, sample: &Sample, asleep: bool) -> (Followed, f64) {
        let shown_a = (!asleep).then_some(sample.current_a);
        let current_a = shown_a.map_or(0.0, |shown_a| self.ledger.current_a(shown_a));
        let capacity = 1.0 + self.ledger.state(CAPACITY).value;
        let scaled_a = current_a / capacity;
        let mut followed = self.follower.step(sample, scaled_a, self.ledger.state(SOC).value, self.watch.cycles.full());
        self.ledger.count(sample.dt_s, followed.moved, shown_a, followed.capacity_ah);
        // The run has the current per capacity of the model, its resistances have the pack's own.
        followed.drop_v *= capacity;
        followed.cell_a *= capacity;
        followed.shift_v = self.ocv.voltage_v(followed.soc) - followed.ocv_v;
        let drawn = current_a * sample.dt_s / S_PER_H / followed.capacity_ah;
        self.watch.update(sample, self.soc().value, drawn);
        (followed, drawn)
    }

    /// Whether the pack has come to rest with this sample.
    pub(crate) fn rested(&mut self, sample: &Sample) -> Option<Rested> {
        self.rest.update(self.model.battery(), &self.model.sensor(Channel::VoltageV), sample)
    }
}
