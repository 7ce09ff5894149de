//! The models and facts that the coordinator plans with: its own, whatever agents believe.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::{Estimate, Model};
use planner::Policy;
use proto::{NamedModel, PackId, RobotId, StationId};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

use crate::forecast::Handling;

/// How the coordinator decides.
#[derive(Clone, Copy)]
pub struct Settings {
    /// How plans are made.
    pub policy: &'static dyn Policy,
    /// Probability with which a promised service must find its energy.
    pub confidence: f64,
    /// A robot wants a service when its state of charge is below this.
    pub serve_below_soc: f64,
    /// Level at which a recharge is done.
    pub charge_to_soc: f64,
    /// Lowest level at which one may end where there is no room for all.
    pub charge_at_least_soc: f64,
    /// Who gets the energy where it is not enough for all.
    pub short_energy: ShortEnergy,
    /// A service must add at least this much charge.
    pub min_gain_soc: f64,
    /// A promised service is moved only if that saves this much work, s.
    pub loyalty_s: f64,
    /// Moves of the search per robot, for each plan.
    pub moves_per_robot: u64,
    /// A plan is made anew after this time even if nothing has happened, s.
    pub replan_period_s: f64,
    /// An unanswered command is sent again after this time, s.
    pub resend_s: f64,
    /// A command that nobody has answered for this time is given up, s.
    pub deadline_s: f64,
    /// A service is given up when its robot is not in its bay this long after it was due, s.
    pub late_s: f64,
    /// The first plan waits this long for the robots and stations that are configured, s.
    pub patience_s: f64,
}

impl Settings {
    /// By how many standard deviations less than expected of a quantity plans count on, so that there is as much with the probability
    /// that is asked for ([`Settings::confidence`]).
    #[must_use]
    pub fn caution(&self) -> f64 {
        Normal::standard().inverse_cdf(self.confidence)
    }
}

/// Who gets the packs' energy where it is not enough to charge everybody to the usual level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShortEnergy {
    /// As many whole charges as there can be, and what these leave whoever would be empty without it.
    #[default]
    WholeCharges,
    /// As many robots as there can be: anybody may leave with less, so that others get something.
    MostRobots,
}

/// One station's models.
#[derive(Debug, Clone)]
pub struct StationModels {
    /// Its load on the active pack.
    pub load: Arc<Model>,
    /// How long it takes to handle a robot.
    pub handling: Handling,
    /// Its packs.
    pub packs: BTreeMap<PackId, Arc<Model>>,
    /// Most power that its converters give to all bays together, W; infinite for none.
    pub converter_w_max: f64,
    /// Power of an external supply that charges what does not feed the station, W; 0 for none.
    pub recharge_w: f64,
    /// What packs of robots are, where they are charged and become spares; none where they are put
    /// aside.
    pub spare_battery: Option<Arc<Model>>,
    /// State of charge from which on they are spares again, 0..1; none for when their charger has ended.
    pub spare_ready_soc: Option<f64>,
}

/// Stations that are alike in all that decides what a service takes there: models by address, figures by their bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Alike {
    models: [usize; 3],
    figures: [u64; 6],
}

impl StationModels {
    /// Which stations it is like.
    #[must_use]
    pub fn alike(&self) -> Alike {
        let address = |model: Option<&Arc<Model>>| model.map_or(0, |model| Arc::as_ptr(model).addr());
        let Handling { load_s, unload_s, swap_s } = self.handling;
        Alike {
            // Of its packs the first stands for their voltage.
            models: [address(Some(&self.load)), address(self.packs.values().next()), address(self.spare_battery.as_ref())],
            figures: [load_s, unload_s, swap_s, self.converter_w_max, self.recharge_w, self.spare_ready_soc.unwrap_or(f64::INFINITY)]
                .map(f64::to_bits),
        }
    }
}

/// All models.
#[derive(Debug, Clone, Default)]
pub struct Models {
    /// Battery of each configured robot.
    pub robots: BTreeMap<RobotId, Arc<Model>>,
    /// Batteries by the name that a robot's state message gives, for robots not configured.
    pub batteries: BTreeMap<String, Arc<Model>>,
    /// Batteries that come with the program, for robots that name one of these.
    pub built_in: BTreeMap<String, Arc<Model>>,
    /// Stations.
    pub stations: BTreeMap<StationId, StationModels>,
    /// What the configuration names each of them.
    pub named: Vec<(Arc<Model>, NamedModel)>,
    /// Where measurements are kept.
    pub kept: Kept,
}

/// Where measurements are kept, for commands that are told to read them.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Kept {
    /// Nowhere.
    #[default]
    Nowhere,
    /// In the journal.
    Store(String),
    /// In logs in this folder.
    Logs(String),
}

impl Models {
    /// The battery model of that name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<&Arc<Model>> {
        self.batteries.get(name).or_else(|| self.built_in.get(name))
    }

    /// What the configuration names a model; its own name where that is built in.
    #[must_use]
    pub fn name_of(&self, model: &Arc<Model>) -> NamedModel {
        let named = self.named.iter().find(|(known, _)| Arc::ptr_eq(known, model)).map(|(_, name)| name.clone());
        named.unwrap_or_else(|| NamedModel { model: model.name.clone(), without: Vec::new() })
    }

    /// The battery model of a robot that says it has a battery of that name.
    #[must_use]
    pub fn battery(&self, robot: &RobotId, name: &str) -> Option<&Arc<Model>> {
        self.robots.get(robot).or_else(|| self.named(name))
    }
}

/// An estimate from the wire.
#[must_use]
pub fn from_wire(estimate: proto::Estimate) -> Estimate {
    Estimate::new(estimate.value, estimate.sigma)
}
