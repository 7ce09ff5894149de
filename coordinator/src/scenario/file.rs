//! The scenario file as it is written.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use energy::document::Document;
use energy::gauge::Kind;
use energy::{DocumentError, System};
use node::mission::Mission;
use node::{Age, Charging, Depot, Publish, SelectorConfig, Vehicle};
use proto::{PackId, RobotId, SiteId, SpareId, StationId};
use robot_agent::{ChargerConfig, Radio, Ways};
use serde::Deserialize;
use toml::Spanned;

use super::expect::{self, Expectation, Verdict};
use crate::config::PolicyConfig;

/// A scenario.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    pub(super) schema: Spanned<u32>,
    /// Name, for people.
    pub name: String,
    /// What it shows, for people.
    #[serde(default)]
    pub note: String,
    /// Site of the fleet.
    #[serde(default = "default_site")]
    pub site: SiteId,
    /// Seed of every random stream.
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// Simulated time, s.
    pub duration_s: Spanned<f64>,
    /// Temperature of the surroundings, °C.
    #[serde(default = "default_temperature_degc")]
    pub temperature_degc: f64,
    /// How the coordinator decides.
    #[serde(default)]
    pub policy: Option<Spanned<PolicyConfig>>,
    /// How often agents speak.
    #[serde(default)]
    pub publish: Publish,
    /// How the true models differ from those that stations and robots name.
    #[serde(default)]
    pub world: Changes,
    /// How the believed models differ from those that stations and robots name.
    #[serde(default)]
    pub believed: Changes,
    /// Stations.
    #[serde(default)]
    pub station: Vec<Spanned<StationEntry>>,
    /// Robots.
    #[serde(default)]
    pub robot: Vec<Spanned<RobotEntry>>,
    /// Runs to lay side by side; one plain run when none is listed.
    #[serde(default)]
    pub run: Vec<Spanned<RunEntry>>,
    /// What is expected of every run.
    #[serde(default)]
    pub expect: BTreeMap<Spanned<String>, Expectation>,
    /// Folder of the file: paths in it are relative to that.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Changes to models, by the model's name.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Changes {
    /// Effects left out, `"*"` for all; the key `"*"` means every model.
    pub without: BTreeMap<String, Vec<String>>,
    /// Another model in its place: a built-in name or a file.
    pub replace: BTreeMap<String, String>,
}

/// `[[station]]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StationEntry {
    /// Its id.
    pub id: StationId,
    /// Model of its load.
    pub load: String,
    /// How many bays it has.
    pub bays: u32,
    /// Time to lift a robot into a bay, s.
    pub load_s: f64,
    /// Time to lift a robot out of a bay, s.
    pub unload_s: f64,
    /// Time to exchange a robot's pack, s.
    #[serde(default = "default_swap_s")]
    pub swap_s: f64,
    /// Its packs, in the selector's order.
    pub packs: Vec<PackEntry>,
    /// Its spares for robots.
    #[serde(default)]
    pub spares: Vec<SpareEntry>,
    /// What its converters and chargers can do.
    #[serde(default)]
    pub charging: Charging<String>,
    /// When it changes packs, and what happens meanwhile.
    #[serde(default)]
    pub selector: Option<SelectorConfig>,
    /// Where its packs are exchanged; they stay when this is left out.
    #[serde(default)]
    pub depot: Option<Depot>,
    /// What it drives; it stands when this is left out.
    #[serde(default)]
    pub vehicle: Option<Vehicle<String>>,
}

/// A pack of a station.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackEntry {
    /// Its id.
    pub id: PackId,
    /// Model of it.
    pub battery: String,
    /// How its gauge estimates.
    #[serde(default)]
    pub gauge: Kind,
    /// True state of charge at the start.
    pub soc: f64,
    /// What it has lived through in truth.
    #[serde(default)]
    pub age: Age,
}

/// A charged spare pack for robots.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpareEntry {
    /// Its id.
    pub id: SpareId,
    /// Its state of charge.
    pub soc: f64,
    /// Model of it; left out, it is what packs of robots are where the station charges these, or else fits whoever comes.
    #[serde(default)]
    pub battery: Option<String>,
}

/// `[[robot]]`: one robot, or several of a kind.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotEntry {
    /// Its id; with `count`, ids are `ID-1`, `ID-2`, ...
    pub id: String,
    /// How many robots of this kind.
    #[serde(default)]
    pub count: Option<u32>,
    /// Model of its battery.
    pub battery: String,
    /// How the battery's gauge estimates.
    #[serde(default)]
    pub gauge: Kind,
    /// Model of its loads.
    pub load: String,
    /// True state of charge at the start: one for all or one each.
    pub soc: OneOrEach,
    /// What its pack has lived through in truth.
    #[serde(default)]
    pub age: Age,
    /// The charger on board; without it the battery takes its rated charge in any case.
    #[serde(default)]
    pub charger: Option<ChargerConfig>,
    /// Its radio; without it the coordinator hears it everywhere.
    #[serde(default)]
    pub radio: Option<Radio>,
    /// Seconds of travel to each station: one for all or one each.
    pub travel_s: BTreeMap<StationId, OneOrEach>,
    /// Ways to stations of which more than the time is known.
    #[serde(default)]
    pub way: Option<Ways>,
    /// Its work.
    #[serde(default)]
    pub mission: Mission,
}

/// One number for all robots of an entry, or one for each.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "expected one number for all robots, or a list with one for each")]
pub enum OneOrEach {
    /// For all.
    One(f64),
    /// For each.
    Each(Vec<f64>),
}

impl OneOrEach {
    /// The number of the robot at `index`.
    #[must_use]
    pub fn at(&self, index: usize) -> f64 {
        match self {
            OneOrEach::One(value) => *value,
            OneOrEach::Each(values) => values[index],
        }
    }

    pub(super) fn all(&self) -> &[f64] {
        match self {
            OneOrEach::One(value) => std::slice::from_ref(value),
            OneOrEach::Each(values) => values,
        }
    }
}

/// `[[run]]`: one way of believing, for comparison.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunEntry {
    /// Name, for people.
    pub name: String,
    /// Changes to the believed models, on top of `[believed]`.
    #[serde(default)]
    pub believed: Changes,
    /// Another policy.
    #[serde(default)]
    pub policy: Option<String>,
    /// What is expected of this run.
    #[serde(default)]
    pub expect: BTreeMap<Spanned<String>, Expectation>,
    /// Whether it is made with another policy than the scenario's: nothing is expected of it.
    #[serde(skip)]
    pub is_other: bool,
}

fn default_site() -> SiteId {
    SiteId::new("site").expect("a valid id")
}

fn default_seed() -> u64 {
    1
}

fn default_temperature_degc() -> f64 {
    energy::units::REFERENCE_DEGC
}

fn default_swap_s() -> f64 {
    60.0
}

/// A model that an entry names.
pub(super) struct Named<'a> {
    /// By which key.
    pub(super) key: String,
    /// Built in or a path.
    pub(super) model: &'a str,
    /// Of what it must be the model.
    pub(super) of: System,
}

impl<'a> Named<'a> {
    fn new(key: impl Into<String>, model: &'a str, of: System) -> Self {
        Named { key: key.into(), model, of }
    }
}

impl StationEntry {
    /// Every model that it names.
    pub(super) fn models(&self) -> impl Iterator<Item = Named<'_>> {
        let load = Named::new("load", &self.load, System::Station);
        let packs = self.packs.iter().map(|pack| Named::new(format!("pack {}: battery", pack.id), &pack.battery, System::Battery));
        let spare = |spare: &'_ SpareEntry| format!("spare {}: battery", spare.id);
        let spares = self.spares.iter().filter_map(move |one| Some(Named::new(spare(one), one.battery.as_deref()?, System::Battery)));
        let of_spares = self.charging.spare_battery.as_deref().map(|model| Named::new("spare_battery", model, System::Battery));
        let vehicle = self.vehicle.as_ref().map(|vehicle| Named::new("vehicle: load", &vehicle.load, System::Robot));
        std::iter::once(load).chain(packs).chain(spares).chain(of_spares).chain(vehicle)
    }
}

impl RobotEntry {
    /// Every model that it names.
    pub(super) fn models(&self) -> impl Iterator<Item = Named<'_>> {
        [Named::new("battery", &self.battery, System::Battery), Named::new("load", &self.load, System::Robot)].into_iter()
    }

    /// How many robots the entry stands for.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count.unwrap_or(1) as usize
    }

    /// Whether it stands for none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Id of the robot at `index`.
    ///
    /// # Errors
    /// When the text is no id.
    pub fn robot(&self, index: usize) -> Result<RobotId, proto::IdError> {
        match self.count {
            None => RobotId::new(self.id.clone()),
            Some(_) => RobotId::new(format!("{}-{}", self.id, index + 1)),
        }
    }
}

impl RunEntry {
    /// Name of the folder for what the run writes.
    #[must_use]
    pub fn folder(&self) -> String {
        self.name.replace(|c: char| !c.is_ascii_alphanumeric(), "-")
    }
}

impl Scenario {
    /// Reads a scenario from a text; `file` is its path, for errors and for relative paths.
    ///
    /// # Errors
    /// With line and column, what is allowed, and for unknown keys the nearest known one.
    pub fn parse(file: &Path, text: &str) -> Result<Self, DocumentError> {
        let name = file.display().to_string();
        let document = Document { file: &name, text };
        let mut scenario: Scenario = document.parse()?;
        scenario.folder = file.parent().unwrap_or(Path::new("")).to_owned();
        scenario.check(&document)?;
        Ok(scenario)
    }

    /// The policy of a run.
    #[must_use]
    pub fn policy_of(&self, run: &RunEntry) -> String {
        let of_all = || self.policy.as_ref().map_or_else(PolicyConfig::default, |policy| policy.get_ref().clone()).name;
        run.policy.clone().unwrap_or_else(of_all)
    }

    /// What came of the expectations of a run: its own and those of every run.
    #[must_use]
    pub fn verdicts(&self, run: &RunEntry, measured: &BTreeMap<String, f64>) -> Vec<Verdict> {
        if run.is_other {
            return Vec::new();
        }
        let all = self.expect.iter().chain(&run.expect).map(|(metric, expected)| (metric.get_ref().as_str(), expected));
        expect::verdicts(all, measured)
    }

    /// The runs to make: those listed, or one plain run.
    #[must_use]
    pub fn runs(&self) -> Vec<RunEntry> {
        if self.run.is_empty() {
            vec![RunEntry { name: self.name.clone(), ..RunEntry::default() }]
        } else {
            self.run.iter().map(|run| run.get_ref().clone()).collect()
        }
    }
}
