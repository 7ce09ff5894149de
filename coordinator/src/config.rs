//! The live coordinator's configuration file.

mod telemetry;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, ensure};
use energy::units::S_PER_DAY;
use energy::{Model, System};
use node::files::{ModelRef, read_text};
use node::{Charging, ClockConfig, NetworkConfig};
use planner::{policies, policy};
use proto::{PackId, RobotId, SiteId, StationId};
use serde::{Deserialize, Serialize};

use crate::forecast::Handling;
use crate::models::{Kept, Models, Settings, ShortEnergy, StationModels};
use crate::web::WebConfig;

pub use telemetry::TelemetryConfig;

/// Everything a coordinator is told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Version of this file's format.
    pub schema: u32,
    /// The site.
    pub site: SiteId,
    /// The store; relative to this file.
    #[serde(default = "default_store")]
    pub store: PathBuf,
    /// How to decide.
    #[serde(default)]
    pub policy: PolicyConfig,
    /// Battery model of each robot.
    #[serde(default)]
    pub robots: BTreeMap<RobotId, ModelRef>,
    /// Battery models for robots that are not listed, by the name that they give.
    #[serde(default)]
    pub batteries: BTreeMap<String, ModelRef>,
    /// Models of each station.
    #[serde(default)]
    pub stations: BTreeMap<StationId, StationConfig>,
    /// Who may ask and listen with a certificate of its own: `ops` for `viewer.ops`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub viewers: Vec<String>,
    /// Where the others are.
    #[serde(default = "NetworkConfig::coordinator")]
    pub network: NetworkConfig,
    /// The dashboard.
    #[serde(default)]
    pub web: WebConfig,
    /// How much of what is told is taken in and kept.
    #[serde(default)]
    pub telemetry: TelemetryConfig,
    /// Faster time, for demonstrations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<ClockConfig>,
}

/// `[policy]`: how to decide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PolicyConfig {
    /// How plans are made.
    pub name: String,
    /// Probability with which a promised service must find its energy.
    pub confidence: f64,
    /// A robot wants a service when its state of charge is below this.
    pub serve_below_soc: f64,
    /// Level at which a recharge is done.
    pub charge_to_soc: f64,
    /// Where charging everybody to `charge_to_soc` would leave a robot without a place, a charge may end at this level
    /// already, and so may that of a robot for which the packs hold no more; at `charge_to_soc` none ever does.
    pub charge_at_least_soc: f64,
    /// Who gets the energy where it is not enough to charge everybody to `charge_to_soc`: as many whole charges as there can be, and
    /// who would be empty what these leave (`whole_charges`), or as many robots as there can be, also with less (`most_robots`).
    pub short_energy: ShortEnergy,
    /// A service must add at least this much charge.
    pub min_gain_soc: f64,
    /// A promised service is moved only if that saves this much work, s.
    pub loyalty_s: f64,
    /// Moves of the search per robot, for each plan; 400 to 10,000 in all. Where a plan is only mended there are
    /// 300, whatever is said here.
    pub moves_per_robot: u64,
    /// A plan is made anew after this time even if nothing has happened, s.
    pub replan_period_s: f64,
    /// An unanswered command is sent again after this time, s.
    pub resend_s: f64,
    /// A command that nobody has answered for this time is given up, s.
    pub deadline_s: f64,
    /// A service is given up when its robot is not in its bay this long after it was due, or takes no charge this long after its end, s.
    pub late_s: f64,
    /// The first plan waits this long for the robots and stations that are configured, s.
    pub patience_s: f64,
}

impl Default for PolicyConfig {
    fn default() -> Self {
        Self {
            name: policies()[0].name().to_owned(),
            confidence: 0.95,
            serve_below_soc: 0.2,
            charge_to_soc: 0.98,
            charge_at_least_soc: 0.5,
            short_energy: ShortEnergy::default(),
            min_gain_soc: 0.1,
            loyalty_s: 120.0,
            moves_per_robot: 100,
            replan_period_s: 60.0,
            resend_s: 5.0,
            deadline_s: 60.0,
            late_s: 1800.0,
            patience_s: 60.0,
        }
    }
}

/// `[stations.ID]`: the coordinator's models of a station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StationConfig {
    /// Its load on the active pack.
    pub load: ModelRef,
    /// Time to lift a robot into a bay, s.
    pub load_s: f64,
    /// Time to lift a robot out of a bay, s.
    pub unload_s: f64,
    /// Time to exchange a robot's pack, s.
    #[serde(default)]
    pub swap_s: f64,
    /// Battery model of each pack.
    pub packs: BTreeMap<PackId, ModelRef>,
    /// What its converters and chargers can do.
    #[serde(default)]
    pub charging: Charging,
}

/// Shortest and longest time that a configuration may state, s.
const TIME_MIN_S: f64 = 0.1;
const TIME_MAX_S: f64 = 30.0 * S_PER_DAY;

/// Most moves of the search per robot.
const MOVES_MAX: u64 = 1_000_000;

/// The only version of the file so far.
const SCHEMA: u32 = 1;

fn default_store() -> PathBuf {
    PathBuf::from("tender.db")
}

impl PolicyConfig {
    /// Checks every value and looks up the policy.
    ///
    /// # Errors
    /// Names the key and the allowed range.
    pub fn settings(&self) -> anyhow::Result<Settings> {
        let fraction = |key: &str, value: f64| {
            ensure!((0.0..=1.0).contains(&value), "policy.{key} = {value}: must be between 0 and 1");
            Ok(value)
        };
        let time = |key: &str, value: f64| {
            ensure!((TIME_MIN_S..=TIME_MAX_S).contains(&value), "policy.{key} = {value}: must be between {TIME_MIN_S} and {TIME_MAX_S}");
            Ok(value)
        };
        let names = || policies().iter().map(|policy| policy.name());
        let policy = policy(&self.name).with_context(|| {
            let hint = energy::document::hint(&self.name, names());
            format!("policy.name = \"{}\": there is no such policy{hint} Known: {}", self.name, names().collect::<Vec<_>>().join(", "))
        })?;
        ensure!((0.5..1.0).contains(&self.confidence), "policy.confidence = {}: must be at least 0.5 and below 1", self.confidence);
        let settings = Settings {
            policy,
            confidence: self.confidence,
            serve_below_soc: fraction("serve_below_soc", self.serve_below_soc)?,
            charge_to_soc: fraction("charge_to_soc", self.charge_to_soc)?,
            // Who charges everybody to less than the usual need not say that nobody is charged to less.
            charge_at_least_soc: fraction("charge_at_least_soc", self.charge_at_least_soc)?.min(self.charge_to_soc),
            short_energy: self.short_energy,
            min_gain_soc: fraction("min_gain_soc", self.min_gain_soc)?,
            loyalty_s: {
                ensure!(
                    (0.0..=TIME_MAX_S).contains(&self.loyalty_s),
                    "policy.loyalty_s = {}: must be between 0 and {TIME_MAX_S}",
                    self.loyalty_s
                );
                self.loyalty_s
            },
            moves_per_robot: {
                let moves = self.moves_per_robot;
                ensure!(moves <= MOVES_MAX, "policy.moves_per_robot = {moves}: must be between 0 and {MOVES_MAX}");
                moves
            },
            replan_period_s: time("replan_period_s", self.replan_period_s)?,
            resend_s: time("resend_s", self.resend_s)?,
            deadline_s: time("deadline_s", self.deadline_s)?,
            late_s: time("late_s", self.late_s)?,
            patience_s: time("patience_s", self.patience_s)?,
        };
        ensure!(
            settings.resend_s < settings.deadline_s,
            "policy.resend_s = {} must lie below policy.deadline_s = {}: after that a command is given up",
            settings.resend_s,
            settings.deadline_s
        );
        ensure!(
            settings.serve_below_soc < settings.charge_to_soc,
            "policy.serve_below_soc = {} must lie below policy.charge_to_soc = {}",
            settings.serve_below_soc,
            settings.charge_to_soc
        );
        ensure!(
            settings.min_gain_soc < settings.charge_to_soc,
            "policy.min_gain_soc = {} must lie below policy.charge_to_soc = {}: else no charge adds enough",
            settings.min_gain_soc,
            settings.charge_to_soc
        );
        Ok(settings)
    }
}

impl Config {
    /// Reads a file, with what the environment sets.
    ///
    /// # Errors
    /// Names file, line, key and the allowed range.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        Self::read_with(path, &[])
    }

    /// The same, with keys that are set before all: `KEY=VALUE`.
    ///
    /// # Errors
    /// Names file, line, key and the allowed range.
    pub fn read_with(path: &Path, sets: &[String]) -> anyhow::Result<Self> {
        let name = path.display().to_string();
        let mut config: Config = node::settings::read(&name, &read_text(path)?, sets, Self::check)?;
        config.network.beside(path);
        Ok(config)
    }

    /// Checks what types cannot, but for models and policy ([`Config::load`]).
    fn check(&self) -> anyhow::Result<()> {
        ensure!(self.schema == SCHEMA, "schema = {}: this program reads schema = {SCHEMA}", self.schema);
        self.network.check()?;
        self.web.check()?;
        self.telemetry.check()?;
        self.clock.map_or(Ok(()), |clock| clock.check())
    }

    /// Where the store is: beside this configuration unless it says an absolute path or an address.
    #[must_use]
    pub fn store_path(&self, path: Option<&Path>) -> PathBuf {
        if self.store.to_str().is_some_and(|text| text.contains("://")) {
            return self.store.clone();
        }
        path.and_then(Path::parent).map_or_else(|| self.store.clone(), |folder| folder.join(&self.store))
    }

    /// Loads settings and models; models are looked up beside `path`.
    ///
    /// # Errors
    /// When a value is out of range or a model cannot be read.
    pub fn load<'a>(&'a self, path: Option<&Path>) -> anyhow::Result<(Settings, Models)> {
        // A model that several name is one: what is worked out from it is worked out once.
        let mut loaded: Vec<(&ModelRef, Arc<Model>)> = Vec::new();
        let mut of = |system: System, reference: &'a ModelRef, key: String| {
            let model = match loaded.iter().find(|(known, _)| *known == reference) {
                Some((_, model)) => Arc::clone(model),
                None => {
                    let model = reference.load(path)?;
                    loaded.push((reference, Arc::clone(&model)));
                    model
                }
            };
            node::files::is_of(&model, system, &key).map(|()| model)
        };
        let store = self.store_path(path);
        let mut models = Models { kept: Kept::Store(crate::store::shown(&store).display().to_string()), ..Models::default() };
        for (robot, reference) in &self.robots {
            models.robots.insert(robot.clone(), of(System::Battery, reference, format!("robots.{robot}"))?);
        }
        for (name, reference) in &self.batteries {
            models.batteries.insert(name.clone(), of(System::Battery, reference, format!("batteries.{name}"))?);
        }
        for name in energy::built_in_names() {
            let model = node::files::model(name, None)?;
            if model.system == System::Battery {
                models.built_in.insert(name.to_owned(), model);
            }
        }
        for (station, config) in &self.stations {
            for (key, value) in [("load_s", config.load_s), ("unload_s", config.unload_s), ("swap_s", config.swap_s)] {
                ensure!((0.0..=TIME_MAX_S).contains(&value), "stations.{station}.{key} = {value}: must be between 0 and {TIME_MAX_S}");
            }
            ensure!(!config.packs.is_empty(), "stations.{station}.packs: at least one is needed");
            let mut packs = BTreeMap::new();
            for (pack, reference) in &config.packs {
                packs.insert(pack.clone(), of(System::Battery, reference, format!("stations.{station}.packs.{pack}"))?);
            }
            let handling = Handling { load_s: config.load_s, unload_s: config.unload_s, swap_s: config.swap_s };
            let load = of(System::Station, &config.load, format!("stations.{station}.load"))?;
            config.charging.check().with_context(|| format!("stations.{station}"))?;
            let (converter_w_max, recharge_w) = (config.charging.converter_w(), config.charging.recharge_w);
            let spare_battery = config.charging.load(path).with_context(|| format!("stations.{station}"))?;
            let (spare_ready_soc, wanted_soc) = (config.charging.spare_ready_soc, self.policy.serve_below_soc);
            ensure!(
                spare_ready_soc.is_none_or(|soc| soc > wanted_soc),
                "stations.{station}.charging.spare_ready_soc = {}: must lie above policy.serve_below_soc = {wanted_soc}: robots would come \
                 back for another at once",
                spare_ready_soc.unwrap_or_default()
            );
            let station_models = StationModels { load, handling, packs, converter_w_max, recharge_w, spare_battery, spare_ready_soc };
            models.stations.insert(station.clone(), station_models);
        }
        models.named = loaded.into_iter().map(|(reference, model)| (model, reference.named(path))).collect();
        Ok((self.policy.settings()?, models))
    }
}
