//! What is believed at one moment, for planning. Times are seconds from `now`.

use std::ops::Range;
use std::sync::Arc;

use energy::units::S_PER_H;
use energy::{Estimate, Model, Need};
use proto::{BayId, PackId, RobotId, SpareId, StationId, Timestamp};
use statrs::distribution::{ContinuousCDF, Normal};

use super::carry::Part;
use super::charging::Table;
use super::recharging::Recharging;
use super::refill::Refill;
use crate::forecast::Handling;

/// Everything a plan is made from.
#[derive(Debug, Clone)]
pub struct View {
    /// The moment.
    pub now: Timestamp,
    /// Robots that may need a service, in order of id.
    pub robots: Vec<RobotView>,
    /// Stations, in order of id.
    pub stations: Vec<StationView>,
    /// At a station whose converters cannot feed all bays, so many robots more are taken in side by side than are fed at full current.
    pub crowd: usize,
}

/// A robot.
#[derive(Debug, Clone)]
pub struct RobotView {
    /// Which.
    pub robot: RobotId,
    /// Its battery.
    pub battery: Arc<Model>,
    /// Temperature of its battery, °C.
    pub temperature_degc: f64,
    /// The one that charging it is planned with, whole °C.
    pub charge_degc: f64,
    /// Its state of charge.
    pub soc: Estimate,
    /// How long it lasts if it goes on working and comes to no station.
    pub lasts: Lasts,
    /// Time from which a service is wanted, s: until then it has charge enough.
    pub wanted_s: f64,
    /// Whether that is before its charge falls to where the settings have it: it may be empty soon after, or sooner.
    pub is_hurried: bool,
    /// Charge that it loses while it works, SoC per s.
    pub drain_soc_per_s: f64,
    /// The same with the caution that promises need.
    pub drain_hi_soc_per_s: f64,
    /// Worth of a second of its work; 1 is usual.
    pub weight: f64,
    /// When its work ends, s, if that is known.
    pub until_s: Option<f64>,
    /// Whether the last plan promised it a service.
    pub held: bool,
    /// Ways to the stations in reach, in their order.
    pub ways: Vec<WayView>,
    /// Kinds of spares there that do not go into it.
    pub unfit: Vec<(usize, usize)>,
    /// Stations that it could reach and that take no part, with the reason.
    pub closed: Vec<(StationId, String)>,
}

/// How long a robot goes on, s from now; below zero where it has not even the energy for the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lasts {
    /// Until it may be empty, pessimistic at the confidence that is asked for, and with less caution for who was promised a service;
    /// infinite when it needs nothing.
    pub empty_s: f64,
    /// The same with all the caution of a new promise.
    pub surely_s: f64,
    /// As it is expected, with its standard deviation.
    pub expected_s: Estimate,
}

impl Lasts {
    /// What a plan counts on, s; where the robot comes to no station for certain, that it gets to the one it is sent to.
    #[must_use]
    pub fn counted_s(&self, is_in_reach: bool) -> f64 {
        if is_in_reach { self.empty_s } else { self.empty_s.max(self.expected_s.value) }
    }

    /// Probability that it goes on for so many seconds: 1 within the time that it lasts with the confidence that is asked for.
    #[must_use]
    pub fn for_s(&self, time_s: f64) -> f64 {
        if time_s <= self.surely_s {
            return 1.0;
        }
        // Without a spread nothing lies between the two, but where it draws nothing and may not have enough for the way.
        if self.expected_s.sigma <= 0.0 {
            return if self.surely_s.is_finite() { 1.0 } else { 0.0 };
        }
        Normal::standard().cdf((self.expected_s.value - time_s) / self.expected_s.sigma)
    }
}

/// A robot's way to a station.
#[derive(Debug, Clone)]
pub struct WayView {
    /// Index of the station.
    pub station: usize,
    /// Time to get there, s.
    pub time_s: f64,
    /// Charge that it takes beyond as much work, SoC; below zero where it takes less.
    pub extra_soc: Estimate,
    /// How long the robot can work and drive until a service there begins, when it has what the way takes and what it lives on until it is
    /// in the bay or has the other pack.
    pub lasts: Lasts,
    /// What charging takes there.
    pub table: Arc<Table>,
}

impl RobotView {
    /// The way to a station, if that is in reach.
    #[must_use]
    pub fn way(&self, station: usize) -> Option<&WayView> {
        self.ways.iter().find(|way| way.station == station)
    }

    /// Whether it gets to any station for certain, at the earliest. Who may be empty before that, but is not expected to be, is sent all the
    /// same: by waiting nothing gets better. What is promised so holds as long as that is so.
    #[must_use]
    pub fn is_in_reach(&self, stations: &[StationView]) -> bool {
        self.ways.iter().any(|way| way.lasts.surely_s >= way.time_s.max(stations[way.station].opens_s))
    }

    /// Whether a spare of this kind at a station goes into it.
    #[must_use]
    pub fn takes(&self, station: usize, kind: usize) -> bool {
        !self.unfit.contains(&(station, kind))
    }
}

/// A station.
#[derive(Debug, Clone)]
pub struct StationView {
    /// Which.
    pub station: StationId,
    /// Whether it takes part at all, or why not.
    pub out_of_order: Option<String>,
    /// When it is where it takes robots in, s: 0 or less unless it is on its way there.
    pub opens_s: f64,
    /// When it sets off again, and when it takes robots in once more, s: no service overlaps that. Empty where it stays.
    pub away_s: Vec<Range<f64>>,
    /// How long it takes to handle a robot.
    pub handling: Handling,
    /// Bays that work, are free or held by a service that has begun, and take part: no more than may charge side by side.
    pub bays: Vec<BayId>,
    /// Bays that are free and take no part, since the converters would not feed them.
    pub unfed: usize,
    /// Services that have begun.
    pub begun: Vec<Begun>,
    /// Its spares, charged ones first.
    pub spares: Vec<SpareView>,
    /// Whether packs that robots leave are charged and become spares.
    pub charges_spares: bool,
    /// State of charge that such a pack is counted on with once it is a spare again, 0..1.
    pub ready_soc: f64,
    /// Its packs, in the order in which they are to be drained.
    pub packs: Vec<PackView>,
    /// What services that have begun still take.
    pub committed: Need,
    /// When the last of these ends, s.
    pub committed_until_s: f64,
    /// Packs that robots left, or are about to leave to services that have begun.
    pub recharging: Vec<Recharging>,
    /// What the station takes in an hour beside services.
    pub overhead_per_h: Need,
    /// Change of what a Wh of service takes by one standard deviation of each shared parameter.
    pub shared_per_wh: Vec<f64>,
}

impl StationView {
    /// How long a robot lives on its own pack there before it is in a bay or has the other pack, s.
    #[must_use]
    pub fn taken_in_s(&self) -> f64 {
        if self.bays.is_empty() { self.handling.swap_s } else { self.handling.load_s }
    }

    /// Everything that is drawn for services that have begun and for packs that robots left, beside what the station takes.
    #[must_use]
    pub fn owed(&self) -> Need {
        self.recharging.iter().fold(self.committed.clone(), |sum, charged| sum.plus(&charged.need))
    }

    /// The part of that which is drawn until the services that have begun are over, with what the station takes.
    #[must_use]
    pub fn begun(&self) -> Need {
        let begun = self.committed.plus(&self.overhead_per_h.scaled(self.committed_until_s / S_PER_H));
        self.recharging.iter().fold(begun, |sum, charged| sum.plus(&charged.by(self.committed_until_s)))
    }

    /// What is drawn for services that have begun and for packs that robots left, as parts of a load.
    #[must_use]
    pub fn begun_parts(&self) -> Vec<Part> {
        let until_s = self.committed_until_s;
        let services = (until_s > 0.0).then(|| (0.0, until_s, self.committed.mean_wh / until_s * S_PER_H));
        services.into_iter().chain(self.recharging.iter().map(Recharging::part)).collect()
    }
}

/// A station is handed over when its active pack lasts no longer than this at the present power, s.
pub const HANDOVER_S: f64 = 60.0;

/// A service that has begun.
#[derive(Debug, Clone)]
pub struct Begun {
    /// The bay that is held for it; none for an exchange.
    pub bay: Option<BayId>,
    /// When it takes the lift or the place for exchanges, s; 0 when it has.
    pub from_s: f64,
    /// How long the lift still takes to bring the robot in, s; 0 when it has.
    pub load_s: f64,
    /// When the place is free again, s.
    pub until_s: f64,
}

/// A spare pack for robots.
#[derive(Debug, Clone)]
pub struct SpareView {
    /// Which.
    pub spare: SpareId,
    /// Its state of charge when it can be handed out.
    pub soc: f64,
    /// When that is, s.
    pub ready_s: f64,
    /// What it is: spares of one kind are the same number.
    pub kind: usize,
}

/// A pack to begin with.
#[derive(Debug, Clone)]
pub struct PackState {
    /// What it is.
    pub model: Arc<Model>,
    /// Its state of charge.
    pub soc: Estimate,
    /// Its temperature, °C.
    pub temperature_degc: f64,
    /// What comes into it from outside until it is its turn.
    pub refill: Refill,
}

impl PackState {
    /// As it stands now, whatever comes.
    #[must_use]
    pub fn now(&self) -> Self {
        Self { refill: Refill::default(), ..self.clone() }
    }

    /// What a standard deviation of its state of charge comes to, Wh.
    #[must_use]
    pub fn sigma_wh(&self) -> f64 {
        self.soc.sigma * self.model.battery().stored_wh()
    }
}

/// A pack of a station.
#[derive(Debug, Clone)]
pub struct PackView {
    /// Which.
    pub pack: PackId,
    /// What it still gives at the station's working power until the selector leaves it, Wh; the last pack, until
    /// that power has tapered off.
    pub usable_wh: Estimate,
    /// How much more it would give if it were the last, Wh.
    pub gain_wh: f64,
    /// The part of what it gives that was seen along the load of a plan, beyond what it gives at the station's working power, Wh.
    pub uncounted_wh: f64,
    /// What it is and how it stands, for stepping its model; none where that is not known.
    pub state: Option<PackState>,
    /// When it can feed the station, s: 0 when it is in its place, later while another one is brought there.
    pub available_s: f64,
}

impl PackView {
    /// What comes into it from outside until it is its turn.
    #[must_use]
    pub fn refill(&self) -> &Refill {
        static NOTHING: Refill = Refill::NOTHING;
        self.state.as_ref().map_or(&NOTHING, |state| &state.refill)
    }

    /// What it gives before that time, s from now, Wh.
    #[must_use]
    pub fn before_wh(&self, at_s: f64) -> f64 {
        self.usable_wh.value + self.refill().before_wh(at_s)
    }
}
