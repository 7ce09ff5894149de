//! What every gauge that counts charge is made of: the [ledger](super::ledger) of the count, a run
//! of the model that follows the pack, and the watch for rests.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::follow::{Followed, Follower, branch_v, leak_per_s};
use super::ledger::{CAPACITY, Ledger, SOC};
use super::prediction::Watch;
use super::rest::{RestDetector, Rested};
use super::{Sample, equilibrium};
use crate::units::S_PER_H;
use crate::{Channel, Estimate, Model, OcvTable, Run};

/// Difference of voltages below which it matters no more how a pack came to its charge, V: less than gauges resolve.
const BRANCH_V: f64 = 1e-4;

/// See the module's text.
#[derive(Debug, Clone)]
pub(crate) struct Counter {
    pub(crate) model: Arc<Model>,
    pub(crate) ledger: Ledger,
    pub(crate) watch: Watch,
    /// The curve that a rest is read by.
    pub(crate) ocv: OcvTable,
    follower: Follower,
    /// The same pack had it been discharged before, while it matters whether it was.
    discharged: Option<Follower>,
    /// Whether a rest was read while it did: the same branch read twice is no second reading.
    read_open: bool,
    rest: RestDetector,
}

impl Counter {
    /// Starts at a known state of charge. `resistance` is the covariance of what is to be learned
    /// of it, ohm² of a cell, if anything is.
    pub(crate) fn new(model: Arc<Model>, soc: Estimate, temperature_degc: f64, resistance: Option<&DMatrix<f64>>) -> Self {
        Self {
            ledger: Ledger::new(&model, soc, leak_per_s(&model, temperature_degc).sigma, resistance),
            follower: Follower::new(&model, soc.value, temperature_degc, 0.0),
            discharged: (branch_v(&model, 0.5) > BRANCH_V).then(|| Follower::new(&model, soc.value, temperature_degc, 1.0)),
            watch: Watch::new(temperature_degc),
            read_open: false,
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
        if let Some(discharged) = &mut self.discharged {
            let other = discharged.step(sample, scaled_a, self.ledger.state(SOC).value, self.watch.cycles.full());
            followed.branch_v = (other.drop_v - followed.drop_v).abs();
            if followed.branch_v < BRANCH_V {
                self.discharged = None;
            }
        }
        // The run has the current per capacity of the model, its resistances have the pack's own.
        followed.drop_v *= capacity;
        followed.cell_a *= capacity;
        followed.shift_v = self.ocv.voltage_v(followed.soc) - followed.ocv_v;
        let drawn = current_a * sample.dt_s / S_PER_H / followed.capacity_ah;
        self.watch.update(sample, self.soc().value, drawn);
        (followed, drawn)
    }

    /// The run that follows the pack.
    pub(crate) fn run(&self) -> &Run<f64> {
        self.follower.run()
    }

    /// Whether the pack has come to rest with this sample.
    pub(crate) fn rested(&mut self, sample: &Sample) -> Option<Rested> {
        let rested = self.rest.update(self.model.battery(), &self.model.sensor(Channel::VoltageV), sample)?;
        let is_open = self.discharged.is_some();
        (!(is_open && std::mem::replace(&mut self.read_open, is_open))).then_some(rested)
    }
}
