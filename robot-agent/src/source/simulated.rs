//! A simulated robot: a pack, its load, a charger and a place.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::load::CannotDeliver;
use energy::{Channel, Estimate, Model, Run, Start};
use node::Age;
use node::body::{PackBody, Task};
use proto::{SimDraw, SimSupply, StationId, Timestamp};

use super::{Act, Observation, Place, Source};

/// What is true of a simulated robot, whatever its agent believes.
#[derive(Debug, Clone)]
pub struct World {
    /// Its pack.
    pub battery: Arc<Model>,
    /// Its loads.
    pub load: Arc<Model>,
    /// Load inputs while it works or travels, such as its speed.
    pub working: Vec<(Channel, f64)>,
    /// Seconds of travel to each station.
    pub travel_s: BTreeMap<StationId, f64>,
    /// True state of charge at the start.
    pub soc: f64,
    /// What its pack has lived through.
    pub age: Age,
    /// Temperature of pack and surroundings, °C.
    pub temperature_degc: f64,
    /// Chooses the gauge IC's specimen and noise.
    pub seed: u64,
}

/// A robot's body.
pub struct RobotBody {
    pack: PackBody,
    load: Run<f64>,
    working: Vec<(Channel, f64)>,
    travel_s: BTreeMap<StationId, f64>,
    place: Place,
    underway_s: f64,
    returning_s: f64,
    last_travel_s: f64,
    charger_on: bool,
    bay: Option<SimSupply>,
    exchanged: Option<Estimate>,
    /// How full the pack was that it left at its last exchange.
    left_soc: Option<f64>,
    depleted: bool,
    now_s: f64,
}

impl RobotBody {
    /// A robot at work.
    #[must_use]
    pub fn new(world: World) -> Self {
        Self {
            pack: PackBody::new(world.battery, world.age.start(world.soc, world.temperature_degc), world.seed),
            load: Run::new(world.load, Start::at_soc(0.0)),
            working: world.working,
            travel_s: world.travel_s,
            place: Place::Mission,
            underway_s: 0.0,
            returning_s: 0.0,
            last_travel_s: 0.0,
            charger_on: false,
            bay: None,
            exchanged: None,
            left_soc: None,
            depleted: false,
            now_s: 0.0,
        }
    }

    /// What a gauge that watched the pack before would start from.
    pub fn remembered_soc(&mut self) -> Estimate {
        self.pack.remembered_soc()
    }

    /// True state of charge.
    #[must_use]
    pub fn true_soc(&self) -> f64 {
        self.pack.truth(Channel::Soc)
    }

    /// Where the robot is.
    #[must_use]
    pub fn place(&self) -> Place {
        self.place
    }

    /// Whether the robot is on its mission (not travelling, waiting, or dead).
    #[must_use]
    pub fn at_work(&self) -> bool {
        self.place == Place::Mission && self.returning_s <= 0.0 && !self.depleted
    }

    /// Whether the robot ran empty outside a bay.
    #[must_use]
    pub fn stranded(&self) -> bool {
        self.depleted && self.place != Place::InBay
    }

    /// Load inputs of the last step.
    #[must_use]
    pub fn inputs<const N: usize>(&self, channels: [Channel; N]) -> [f64; N] {
        channels.map(|channel| self.load.channels[channel])
    }

    fn load_w(&mut self, dt_s: f64, moving: bool) -> f64 {
        for &(channel, value) in &self.working {
            self.load.channels[channel] = if moving { value } else { 0.0 };
        }
        self.load.step(dt_s);
        self.load.channels[Channel::PowerW]
    }

    /// The charger takes no more than the bay has for it.
    fn charge_task(&self) -> Task {
        let bay_w = self.bay.as_ref().and_then(|bay| bay.charge_w_max).unwrap_or(f64::INFINITY);
        Task::Charge { current_a_max: bay_w / self.pack.truth(Channel::TerminalVoltageV).max(0.1) }
    }

    fn powered(&self) -> bool {
        self.place == Place::InBay && self.bay.as_ref().is_some_and(|bay| bay.powered)
    }

    fn travel(&mut self, dt_s: f64) {
        if self.depleted {
            return;
        }
        if self.place == Place::Underway {
            self.underway_s -= dt_s;
            if self.underway_s <= 0.0 {
                self.place = Place::AtStation;
            }
        }
        self.returning_s = (self.returning_s - dt_s).max(0.0);
    }
}

impl Source for RobotBody {
    fn act(&mut self, act: &Act) {
        match act {
            Act::TravelTo { station } => {
                self.left_soc = None;
                self.last_travel_s = self.travel_s.get(station).copied().unwrap_or(0.0);
                (self.place, self.underway_s) = (Place::Underway, self.last_travel_s);
            }
            Act::Charge => self.charger_on = true,
            Act::StopCharging => self.charger_on = false,
            Act::Resume => {
                (self.place, self.returning_s, self.charger_on) = (Place::Mission, self.last_travel_s, false);
            }
        }
    }

    fn advance(&mut self, dt_s: f64) -> Option<Observation> {
        self.now_s += dt_s;
        self.travel(dt_s);
        let moving = matches!(self.place, Place::Mission | Place::Underway);
        // In the direct-connection power path the bay feeds the robot's own load through the
        // charger; its share is part of the station's model, and the pack sees the charge alone.
        let task = if self.powered() {
            if self.charger_on { self.charge_task() } else { Task::Rest }
        } else if self.depleted {
            Task::Rest
        } else {
            Task::Power(self.load_w(dt_s, moving))
        };
        let stepped = self.pack.step(dt_s, task);
        if let Err(CannotDeliver { .. }) = stepped {
            self.depleted = true;
        } else if self.powered() && self.charger_on {
            self.depleted = false;
        }
        let sample = stepped.unwrap_or_else(|_| self.pack.sample(dt_s));
        let observation = Observation {
            sample: Some(sample),
            place: self.place,
            powered: self.powered(),
            exchanged: self.exchanged.take(),
            depleted: self.depleted,
        };
        Some(observation)
    }

    fn supply(&mut self, supply: &SimSupply) {
        if let Some(soc) = supply.exchanged {
            self.left_soc = Some(self.true_soc());
            self.pack.exchange(soc.value);
            self.exchanged = Some(Estimate::new(soc.value, soc.sigma));
            self.depleted = false;
        }
        if supply.docked {
            self.place = Place::InBay;
        } else if self.place == Place::InBay {
            self.place = Place::AtStation;
        }
        self.bay = supply.docked.then(|| supply.clone());
    }

    fn draw(&self) -> Option<SimDraw> {
        // Without a bay there is only the pack to be told of that it left.
        if self.bay.is_none() && self.left_soc.is_none() {
            return None;
        }
        let charging = self.powered() && self.charger_on;
        let [current_a, power_w] = [Channel::CurrentA, Channel::PowerW].map(|channel| self.pack.truth(channel));
        Some(SimDraw {
            at: Timestamp::from_unix_ms((self.now_s * 1000.0) as i64),
            charge_power_w: if charging { (-power_w).max(0.0) } else { 0.0 },
            charge_current_a: if charging { (-current_a).max(0.0) } else { 0.0 },
            voltage_v: self.pack.truth(Channel::VoltageV),
            charging,
            left_soc: self.left_soc,
        })
    }
}
