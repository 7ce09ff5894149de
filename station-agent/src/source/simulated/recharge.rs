//! Chargers of a simulated station for packs: its own that do not feed it, and those that robots
//! left behind.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::charger::{self, Charger, PowerPath, Stage};
use energy::gauge::Sample;
use energy::{Channel, Model};
use node::Age;
use node::body::{PackBody, Task};
use proto::{RobotId, SpareId};

/// A pack's own charger.
pub(super) struct PackCharger {
    charger: Charger,
    charging: charger::Charging,
    /// What it asks for in this step, A.
    asked_a: f64,
}

impl PackCharger {
    pub(super) fn new(model: &Model) -> Self {
        let charger = Charger::for_pack(model.battery(), PowerPath::Selected);
        Self { charging: charger.begin(), charger, asked_a: 0.0 }
    }

    /// What it asks for, W.
    pub(super) fn asks_w(&mut self, pack: &PackBody) -> f64 {
        let facts = pack.model().battery();
        let request = pack.charge_request();
        let voltage_v = pack.truth(Channel::TerminalVoltageV);
        self.asked_a = self.charger.asks_a(&mut self.charging, &request, voltage_v / f64::from(facts.series));
        self.asked_a * voltage_v
    }

    /// Charges with what it was given.
    pub(super) fn step(&mut self, pack: &mut PackBody, given_w: f64, dt_s: f64) -> Sample {
        let limit_a = self.asked_a.min(given_w / pack.truth(Channel::TerminalVoltageV).max(0.1));
        let task = if limit_a > 0.0 { Task::Charge { current_a_max: limit_a } } else { Task::Rest };
        // Neither charging nor rest can fail.
        let sample = pack.step(dt_s, task).unwrap_or_else(|_| pack.sample(dt_s));
        let current_a = (-pack.truth(Channel::CurrentA)).max(0.0);
        self.charger.saw(&mut self.charging, current_a < 0.999 * limit_a, current_a, dt_s);
        sample
    }

    pub(super) fn done(&self) -> bool {
        self.charging.stage == Stage::Done
    }
}

/// A pack that a robot left behind.
struct Left {
    body: PackBody,
    charger: PackCharger,
}

/// Packs that robots left behind, on chargers, one for each place.
pub(super) struct Shelf {
    /// What is left, where it is charged at all, and where that is of another kind.
    battery: Option<Arc<Model>>,
    others: BTreeMap<SpareId, Arc<Model>>,
    /// State of charge at which one is charged; none for when its charger has ended.
    ready_soc: Option<f64>,
    temperature_degc: f64,
    seed: u64,
    /// Robots whose pack was exchanged and that have not said what they left.
    awaited: BTreeMap<RobotId, SpareId>,
    left: BTreeMap<SpareId, Left>,
}

impl Shelf {
    pub(super) fn new(
        (battery, others): (Option<Arc<Model>>, BTreeMap<SpareId, Arc<Model>>),
        ready_soc: Option<f64>,
        temperature_degc: f64,
        seed: u64,
    ) -> Self {
        Self { battery, others, ready_soc, temperature_degc, seed, awaited: BTreeMap::new(), left: BTreeMap::new() }
    }

    /// A robot's pack is now in the place of a spare.
    pub(super) fn awaits(&mut self, robot: RobotId, place: SpareId) {
        if self.battery.is_some() {
            self.awaited.insert(robot, place);
        }
    }

    /// A robot says how full the pack was that it left.
    pub(super) fn arrived(&mut self, robot: &RobotId, soc: f64) {
        let (Some(battery), Some(place)) = (&self.battery, self.awaited.remove(robot)) else { return };
        let battery = self.others.get(&place).unwrap_or(battery);
        self.seed = self.seed.wrapping_add(104_729);
        let body = PackBody::new(Arc::clone(battery), Age::default().start(soc, self.temperature_degc), self.seed);
        self.left.insert(place, Left { charger: PackCharger::new(battery), body });
    }

    /// What each asks for, W, in a fixed order.
    pub(super) fn asks_w(&mut self) -> Vec<f64> {
        self.left.values_mut().map(|left| left.charger.asks_w(&left.body)).collect()
    }

    /// Charges each with what it was given, W.
    pub(super) fn step(&mut self, given_w: &[f64], dt_s: f64) {
        for (left, &given_w) in self.left.values_mut().zip(given_w) {
            left.charger.step(&mut left.body, given_w, dt_s);
        }
    }

    /// What flows into those that charge now: (W, A) of each.
    pub(super) fn draws(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let of = |left: &Left| [Channel::PowerW, Channel::CurrentA].map(|channel| (-left.body.truth(channel)).max(0.0));
        self.left.values().map(of).filter(|[power_w, _]| *power_w > 0.0).map(|[power_w, current_a]| (power_w, current_a))
    }

    /// Those that are charged now leave the chargers, with their true state of charge.
    pub(super) fn charged(&mut self) -> Vec<(SpareId, f64)> {
        let is_ready = |left: &Left| self.ready_soc.is_some_and(|soc| left.body.truth(Channel::Soc) >= soc);
        let done = self.left.iter().filter(|(_, left)| left.charger.done() || is_ready(left));
        let done: Vec<SpareId> = done.map(|(place, _)| place.clone()).collect();
        done.into_iter().filter_map(|place| Some((place.clone(), self.left.remove(&place)?.body.truth(Channel::Soc)))).collect()
    }
}
