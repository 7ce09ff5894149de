//! The scenario file as it is written.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use energy::DocumentError;
use energy::document::Document;
use energy::gauge::Kind;
use node::Publish;
use proto::{PackId, RobotId, SiteId, SpareId, StationId};
use serde::Deserialize;
use toml::Spanned;

use super::expect::{self, Expectation, Verdict};
use crate::config::PolicyConfig;

/// A scenario.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    schema: Spanned<u32>,
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
}

/// A charged spare pack for robots.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpareEntry {
    /// Its id.
    pub id: SpareId,
    /// Its state of charge.
    pub soc: f64,
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
    /// Seconds of travel to each station: one for all or one each.
    pub travel_s: BTreeMap<StationId, OneOrEach>,
    /// Its work.
    #[serde(default)]
    pub mission: robot_agent::Mission,
}

/// One number for all robots of an entry, or one for each.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
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

    fn all(&self) -> &[f64] {
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
}

/// The only version of the file so far.
const SCHEMA: u32 = 1;
/// Longest run, s: a year.
const DURATION_MAX_S: f64 = 365.0 * 86_400.0;
/// Most bays or robots in one entry.
const COUNT_MAX: u32 = 100_000;

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

impl RobotEntry {
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

    fn check(&self, document: &Document<'_>) -> Result<(), DocumentError> {
        if *self.schema.get_ref() != SCHEMA {
            let message = format!("schema = {}: this program reads schema = {SCHEMA}", self.schema.get_ref());
            return Err(document.error_at(self.schema.span(), message));
        }
        let duration_s = *self.duration_s.get_ref();
        if !(duration_s > 0.0 && duration_s <= DURATION_MAX_S) {
            let message = format!("duration_s = {duration_s}: must be above 0 and at most {DURATION_MAX_S}");
            return Err(document.error_at(self.duration_s.span(), message));
        }
        if !(-60.0..=100.0).contains(&self.temperature_degc) {
            return Err(document.error(format!("temperature_degc = {}: must be between -60 and 100", self.temperature_degc)));
        }
        self.publish.check().map_err(|error| document.error(error.to_string()))?;
        if let Some(policy) = &self.policy {
            policy.get_ref().settings().map_err(|error| document.error_at(policy.span(), format!("{error:#}")))?;
        }
        let mut ids = BTreeSet::new();
        for station in &self.station {
            let at = |message: String| document.error_at(station.span(), message);
            check_station(station.get_ref()).map_err(at)?;
            if !ids.insert(station.get_ref().id.to_string()) {
                return Err(at(format!("station {} appears twice", station.get_ref().id)));
            }
        }
        let stations: Vec<&str> = self.station.iter().map(|station| station.get_ref().id.as_ref()).collect();
        let mut ids = BTreeSet::new();
        for robot in &self.robot {
            let at = |message: String| document.error_at(robot.span(), message);
            check_robot(robot.get_ref(), &stations).map_err(at)?;
            for index in 0..robot.get_ref().len() {
                let id = robot.get_ref().robot(index).map_err(|error| at(error.to_string()))?;
                if !ids.insert(id.clone()) {
                    return Err(at(format!("robot {id} appears twice")));
                }
            }
        }
        let alone = self.station.len() == 1;
        let name =
            |station: &StationEntry, pack: &PackEntry| if alone { pack.id.to_string() } else { format!("{}.{}", station.id, pack.id) };
        let stations = self.station.iter().map(Spanned::get_ref);
        let packs: Vec<String> = stations.flat_map(|station| station.packs.iter().map(move |pack| name(station, pack))).collect();
        let packs: Vec<&str> = packs.iter().map(String::as_str).collect();
        let mut folders = BTreeSet::new();
        for run in &self.run {
            let (name, folder) = (&run.get_ref().name, run.get_ref().folder());
            if folder.is_empty() || !folders.insert(folder) {
                let message = format!("run \"{name}\": a run needs a name that differs from the others' in letters and digits");
                return Err(document.error_at(run.span(), message));
            }
        }
        for expected in self.run.iter().map(|run| &run.get_ref().expect).chain([&self.expect]) {
            for (metric, expectation) in expected {
                let at = |message: String| document.error_at(metric.span(), message);
                expect::check(metric.get_ref(), expectation, &packs).map_err(at)?;
            }
        }
        Ok(())
    }

    /// What came of the expectations of a run: its own and those of every run.
    #[must_use]
    pub fn verdicts(&self, run: &RunEntry, measured: &BTreeMap<String, f64>) -> Vec<Verdict> {
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

fn fraction(key: &str, value: f64) -> Result<(), String> {
    if (0.0..=1.0).contains(&value) { Ok(()) } else { Err(format!("{key} = {value}: must be between 0 and 1")) }
}

fn not_negative(key: &str, value: f64) -> Result<(), String> {
    if (0.0..=DURATION_MAX_S).contains(&value) { Ok(()) } else { Err(format!("{key} = {value}: must be between 0 and {DURATION_MAX_S}")) }
}

fn check_station(station: &StationEntry) -> Result<(), String> {
    let id = &station.id;
    if station.bays > COUNT_MAX {
        return Err(format!("station {id}: bays = {}: at most {COUNT_MAX}", station.bays));
    }
    for (key, value) in [("load_s", station.load_s), ("unload_s", station.unload_s), ("swap_s", station.swap_s)] {
        not_negative(&format!("station {id}: {key}"), value)?;
    }
    if station.packs.is_empty() {
        return Err(format!("station {id}: packs: at least one is needed"));
    }
    let mut ids = BTreeSet::new();
    for pack in &station.packs {
        fraction(&format!("station {id}: pack {}: soc", pack.id), pack.soc)?;
        if !ids.insert(&pack.id) {
            return Err(format!("station {id}: pack {} appears twice", pack.id));
        }
    }
    let mut ids = BTreeSet::new();
    for spare in &station.spares {
        fraction(&format!("station {id}: spare {}: soc", spare.id), spare.soc)?;
        if !ids.insert(&spare.id) {
            return Err(format!("station {id}: spare {} appears twice", spare.id));
        }
    }
    Ok(())
}

fn check_robot(robot: &RobotEntry, stations: &[&str]) -> Result<(), String> {
    let id = &robot.id;
    if robot.count.is_some_and(|count| count == 0 || count > COUNT_MAX) {
        return Err(format!("robot {id}: count = {}: must be between 1 and {COUNT_MAX}", robot.len()));
    }
    let each = |key: &str, values: &OneOrEach| match values {
        OneOrEach::Each(values) if values.len() != robot.len() => {
            Err(format!("robot {id}: {key} has {} numbers for {} robots", values.len(), robot.len()))
        }
        _ => Ok(()),
    };
    each("soc", &robot.soc)?;
    for &soc in robot.soc.all() {
        fraction(&format!("robot {id}: soc"), soc)?;
    }
    for (station, values) in &robot.travel_s {
        if !stations.contains(&station.as_ref()) {
            let hint = energy::document::hint(station.as_ref(), stations.iter().copied());
            return Err(format!("robot {id}: travel_s names the unknown station {station}{hint} Known: {}", stations.join(", ")));
        }
        each(&format!("travel_s.{station}"), values)?;
        for &value in values.all() {
            not_negative(&format!("robot {id}: travel_s.{station}"), value)?;
        }
    }
    not_negative(&format!("robot {id}: mission.weight"), robot.mission.weight)
}
