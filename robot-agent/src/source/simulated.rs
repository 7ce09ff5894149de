//! A simulated robot: a pack, its load, a charger and a place.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::charger::{Charger, Charging, PowerPath, Surroundings};
use energy::gauge::Sample;
use energy::load::CannotDeliver;
use energy::power::RailCannotDeliver;
use energy::protection::Trip;
use energy::{Channel, Estimate, Model, Run, Start};
use node::Age;
use node::body::{PackBody, Task};
use node::mission::{Course, Stretch};
use proto::{SimDraw, SimSupply, StationId, Timestamp};

use super::{Act, Observation, Place, Source};
use crate::charger::ChargerConfig;
use crate::radio::Radio;

/// What is true of a simulated robot, whatever its agent believes.
#[derive(Debug, Clone)]
pub struct World {
    /// Its pack.
    pub battery: Arc<Model>,
    /// Its loads.
    pub load: Arc<Model>,
    /// Its work, over and over; also what it does on ways of which only the time is known.
    pub work: Vec<Stretch>,
    /// Ways to stations and back, where more than a time is known of them.
    pub ways: BTreeMap<StationId, [Vec<Stretch>; 2]>,
    /// Seconds of travel to each station.
    pub travel_s: BTreeMap<StationId, f64>,
    /// The charger on board; none for one that leaves the battery its rated charge in any case.
    pub charger: Option<ChargerConfig>,
    /// Its radio; none for one that reaches everywhere.
    pub radio: Option<Radio>,
    /// True state of charge at the start.
    pub soc: f64,
    /// What its pack has lived through.
    pub age: Age,
    /// Temperature of pack and surroundings, °C.
    pub temperature_degc: f64,
    /// Chooses the gauge IC's specimen and noise.
    pub seed: u64,
}

/// Where a robot's travelling stands.
#[derive(Debug, Clone, Default)]
struct Journey {
    /// Time left on the way to a station, s.
    there_s: f64,
    /// Time left on the way back, s.
    back_s: f64,
    /// Time of the last way, s.
    whole_s: f64,
    /// What it does on the way there and back; none for what it does at work.
    courses: Option<[Course; 2]>,
}

/// A robot's body.
pub struct RobotBody {
    pack: PackBody,
    load: Run<f64>,
    work: Course,
    ways: BTreeMap<StationId, [Course; 2]>,
    travel_s: BTreeMap<StationId, f64>,
    /// Channels that work and ways set: at nothing while it stands.
    moved: Vec<Channel>,
    place: Place,
    journey: Journey,
    charger: Option<(Charger, Charging)>,
    charger_on: bool,
    /// Power that it took from its bay beside its battery in the last step, W.
    own_w: Option<f64>,
    radio: Option<Radio>,
    bay: Option<SimSupply>,
    exchanged: Option<Estimate>,
    /// How full the pack was that it left at its last exchange.
    left_soc: Option<f64>,
    depleted: bool,
    /// The rail that could not deliver, when that is why it stands still.
    browned_out: Option<RailCannotDeliver>,
    now_s: f64,
}

impl RobotBody {
    /// A robot at work.
    #[must_use]
    pub fn new(world: World) -> Self {
        let work = Course::new(world.work);
        let ways: BTreeMap<_, _> = world.ways.into_iter().map(|(station, both)| (station, both.map(Course::new))).collect();
        let moved = work.channels().chain(ways.values().flatten().flat_map(Course::channels)).collect();
        let charger = world.charger.map(|config| config.device(world.battery.battery())).map(|charger| (charger, charger.begin()));
        Self {
            pack: PackBody::new(world.battery, world.age.start(world.soc, world.temperature_degc), world.seed),
            load: Run::new(world.load, Start { temperature_degc: world.temperature_degc, ..Start::at_soc(0.0) }),
            work,
            ways,
            travel_s: world.travel_s,
            moved,
            place: Place::Mission,
            journey: Journey::default(),
            charger,
            charger_on: false,
            own_w: None,
            radio: world.radio,
            bay: None,
            exchanged: None,
            left_soc: None,
            depleted: false,
            browned_out: None,
            now_s: 0.0,
        }
    }

    /// What a gauge that watched the pack before would start from.
    pub fn remembered_soc(&mut self) -> Estimate {
        self.pack.remembered_soc()
    }

    /// The true value of a channel of its pack at the end of the last step.
    #[must_use]
    pub fn truth(&self, channel: Channel) -> f64 {
        self.pack.truth(channel)
    }

    /// True state of charge.
    #[must_use]
    pub fn true_soc(&self) -> f64 {
        self.pack.truth(Channel::Soc)
    }

    /// Whether the robot is on its mission (not travelling, waiting, or dead).
    #[must_use]
    pub fn at_work(&self) -> bool {
        self.place == Place::Mission && self.journey.back_s <= 0.0 && !self.depleted
    }

    /// Whether the robot ran empty outside a bay.
    #[must_use]
    pub fn stranded(&self) -> bool {
        self.depleted && self.place != Place::InBay
    }

    /// Whether it stands still because a rail could not deliver.
    #[must_use]
    pub fn browned_out(&self) -> bool {
        self.browned_out.is_some()
    }

    /// Whether the coordinator hears it, and it the coordinator, by the link budget.
    #[must_use]
    pub fn in_reach(&self) -> bool {
        let Some(radio) = &self.radio else { return true };
        radio.margin_db(self.load.channels[Channel::RadioTxDbm], self.distance_m()) >= 0.0
    }

    /// Distance from the coordinator's radio, m. It stands at the station.
    fn distance_m(&self) -> f64 {
        let evenly = |left_s: f64| if self.journey.whole_s > 0.0 { left_s / self.journey.whole_s } else { 0.0 };
        match (self.place, &self.journey.courses) {
            (Place::AtStation | Place::InBay, _) => 0.0,
            (Place::Underway, Some([there, _])) => there.distance_m(),
            (Place::Underway, None) => self.work.distance_m() * evenly(self.journey.there_s),
            (Place::Mission, Some([_, back])) if self.journey.back_s > 0.0 => back.distance_m(),
            (Place::Mission, None) if self.journey.back_s > 0.0 => self.work.distance_m() * (1.0 - evenly(self.journey.back_s)),
            (Place::Mission, _) => self.work.distance_m(),
        }
    }

    /// Load inputs of the last step.
    #[must_use]
    pub fn inputs<const N: usize>(&self, channels: [Channel; N]) -> [f64; N] {
        channels.map(|channel| self.load.channels[channel])
    }

    /// What the robot draws in this step, W, at its pack's voltage. A rail that cannot deliver takes
    /// the robot down.
    fn load_w(&mut self, dt_s: f64, moving: bool) -> Result<f64, RailCannotDeliver> {
        self.load.channels[Channel::VoltageV] = self.pack.truth(Channel::TerminalVoltageV);
        let power_w = if moving {
            let course = match &mut self.journey.courses {
                Some([there, _]) if self.place == Place::Underway => there,
                Some([_, back]) if self.journey.back_s > 0.0 => back,
                _ => &mut self.work,
            };
            course.step(&mut self.load, dt_s)
        } else {
            // The radio stays on.
            self.moved
                .iter()
                .filter(|channel| self.radio.is_none() || **channel != Channel::RadioTxDbm)
                .for_each(|&channel| self.load.channels[channel] = 0.0);
            self.load.step(dt_s);
            self.load.channels[Channel::PowerW]
        };
        let tree = self.load.model().facts.tree();
        match tree.and_then(|tree| tree.refused(&self.load.rails()?)) {
            Some(refused) => Err(refused),
            None => Ok(power_w),
        }
    }

    /// The charger takes no more than the bay has for it.
    fn charge_task(&self) -> Task {
        Task::Charge { current_a_max: self.bay_w_max() / self.pack.truth(Channel::TerminalVoltageV).max(0.1) }
    }

    fn bay_w_max(&self) -> f64 {
        self.bay.as_ref().and_then(|bay| bay.charge_w_max).unwrap_or(f64::INFINITY)
    }

    fn powered(&self) -> bool {
        self.place == Place::InBay && self.bay.as_ref().is_some_and(|bay| bay.powered)
    }

    /// A step in a powered bay, on the charger on board.
    fn step_on_charger(&mut self, mut at: (Charger, Charging), dt_s: f64) -> Result<Sample, CannotDeliver> {
        // Power comes back: whatever it stopped for is over.
        let own_load_w = self.load_w(dt_s, false).unwrap_or(0.0);
        let (charger, charging) = &mut at;
        let facts = self.pack.model().battery();
        let mut request = self.pack.charge_request();
        if !self.charger_on {
            // The gauge ends a charge, as it must where the robot hangs on the charger too.
            request.current_a = 0.0;
        }
        // The bay's share is what it has for batteries; in the direct path the own load passes the same
        // output.
        let direct = charger.path == PowerPath::Direct;
        let output_w_max = self.bay_w_max() + if direct { own_load_w } else { 0.0 };
        let around = Surroundings { request, series: facts.series, own_load_w, output_w_max };
        let stepped = self.pack.step_on(charger, charging, &around, dt_s);
        let into_battery_w = (-self.pack.truth(Channel::PowerW)).max(0.0);
        self.own_w = stepped.as_ref().ok().map(|(flow, _)| flow.bypass_w + (flow.output_w - into_battery_w).max(0.0));
        self.charger = Some(at);
        stepped.map(|(_, sample)| sample)
    }

    fn travel(&mut self, dt_s: f64) {
        if self.depleted {
            return;
        }
        if self.place == Place::Underway {
            self.journey.there_s -= dt_s;
            if self.journey.there_s <= 0.0 {
                self.place = Place::AtStation;
            }
        }
        self.journey.back_s = (self.journey.back_s - dt_s).max(0.0);
    }

    /// What took the robot down, where it is not that its pack is empty.
    fn why_down(&self) -> Option<String> {
        let browned_out = self.browned_out.as_ref().map(|refused| format!("browned out: {refused}"));
        let open = || self.pack.protection().allowed().discharge.err().filter(|trip| self.depleted && *trip != Trip::UnderVoltage);
        browned_out.or_else(|| open().map(|trip| format!("the protection of its pack has opened: {trip}")))
    }
}

impl Source for RobotBody {
    fn act(&mut self, act: &Act) {
        match act {
            Act::TravelTo { station, .. } => {
                self.left_soc = None;
                let mut courses = self.ways.get(station).cloned();
                courses.iter_mut().flatten().for_each(Course::restart);
                let whole_s = courses.as_ref().map(|[there, _]| there.time_s()).or(self.travel_s.get(station).copied()).unwrap_or(0.0);
                self.journey = Journey { there_s: whole_s, back_s: 0.0, whole_s, courses };
                self.place = Place::Underway;
            }
            // Its bay is before a lift.
            Act::GoOnTo { .. } => {}
            Act::Charge => {
                self.charger_on = true;
                if let Some((charger, charging)) = &mut self.charger {
                    *charging = charger.begin();
                }
            }
            Act::StopCharging => self.charger_on = false,
            Act::Resume => {
                // Who is on its way back, or there, drives no way twice.
                if self.place != Place::Mission {
                    self.journey.back_s = self.journey.whole_s;
                }
                (self.place, self.charger_on) = (Place::Mission, false);
            }
        }
    }

    fn advance(&mut self, dt_s: f64) -> Option<Observation> {
        self.now_s += dt_s;
        self.travel(dt_s);
        self.own_w = None;
        let moving = matches!(self.place, Place::Mission | Place::Underway);
        let (powered, charger) = (self.powered(), self.charger);
        let stepped = match charger {
            Some(at) if powered => self.step_on_charger(at, dt_s),
            // The bay feeds the robot's own load; its share is part of the station's model, and the
            // pack sees the charge alone.
            None if powered => self.pack.step(dt_s, if self.charger_on { self.charge_task() } else { Task::Rest }),
            _ if self.depleted => self.pack.step(dt_s, Task::Rest),
            _ => match self.load_w(dt_s, moving) {
                Ok(power_w) => self.pack.step(dt_s, Task::Power(power_w)),
                Err(refused) => {
                    self.browned_out = Some(refused);
                    self.depleted = true;
                    self.pack.step(dt_s, Task::Rest)
                }
            },
        };
        if let Err(CannotDeliver { .. }) = stepped {
            self.depleted = true;
        } else if self.powered() && self.charger_on {
            (self.depleted, self.browned_out) = (false, None);
        }
        let sample = stepped.unwrap_or_else(|_| self.pack.sample(dt_s));
        Some(Observation {
            sample: Some(sample),
            place: self.place,
            powered: self.powered(),
            exchanged: self.exchanged.take(),
            said_soc: None,
            depleted: self.depleted,
            why_down: self.why_down(),
        })
    }

    fn stand(&mut self, place: Place) {
        self.place = place;
    }

    fn supply(&mut self, supply: &SimSupply) {
        if let Some(soc) = supply.exchanged {
            self.left_soc = Some(self.true_soc());
            self.pack.exchange(soc.value);
            self.exchanged = Some(Estimate::new(soc.value, soc.sigma));
            (self.depleted, self.browned_out) = (false, None);
        }
        if supply.docked {
            self.place = Place::InBay;
        } else if self.place == Place::InBay {
            self.place = Place::AtStation;
        }
        self.bay = supply.docked.then(|| supply.clone());
    }

    fn load_inputs(&self, channels: &[Channel]) -> Option<Vec<f64>> {
        Some(channels.iter().map(|&channel| self.load.channels[channel]).collect())
    }

    fn draw(&self) -> Option<SimDraw> {
        // Without a bay there is only the pack to be told of that it left.
        if self.bay.is_none() && self.left_soc.is_none() {
            return None;
        }
        let [current_a, power_w] = [Channel::CurrentA, Channel::PowerW].map(|channel| self.pack.truth(channel));
        // What it took in the last step, even if its charger was switched off since.
        let charging = self.powered() && (self.charger_on || power_w < 0.0);
        Some(SimDraw {
            at: Timestamp::from_unix_ms((self.now_s * 1000.0) as i64),
            charge_power_w: if charging { (-power_w).max(0.0) } else { 0.0 },
            charge_current_a: if charging { (-current_a).max(0.0) } else { 0.0 },
            voltage_v: self.pack.truth(Channel::VoltageV),
            charging,
            left_soc: self.left_soc,
            own_load_w: self.own_w,
        })
    }
}

#[cfg(test)]
mod tests;
