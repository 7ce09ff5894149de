//! The station agent's configuration file; `measured.rs` has the `[source]` of a real station.

mod measured;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail, ensure};
use energy::System;
use energy::gauge::Kind;
use energy::selector::Rule;
use node::files::{ModelRef, read_text};
use node::{Age, Charging, ClockConfig, Depot, NetworkConfig, Publish, SelectorConfig, UNTIL_EMPTY, Vehicle};
use proto::{BayId, PackId, SiteId, SpareId, SpareState, StationId};
use serde::{Deserialize, Serialize};

pub use self::measured::{GaugeConfig, MeasuredConfig};
use crate::agent::{Agent, Alone, Profile};
use crate::source::{Source, StationBody, World, WorldPack, label};

/// Everything a station agent is told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Version of this file's format.
    pub schema: u32,
    /// The station.
    pub id: StationId,
    /// The site it belongs to.
    pub site: SiteId,
    /// Its bays.
    pub bays: Vec<BayId>,
    /// Its packs, in the selector's order.
    pub packs: Vec<PackConfig>,
    /// Its spares for robots.
    #[serde(default)]
    pub spares: Vec<SpareConfig>,
    /// How often it speaks.
    #[serde(default)]
    pub publish: Publish,
    /// What it does while no coordinator is heard.
    #[serde(default)]
    pub alone: Alone,
    /// File for what a restart must not forget; relative to this file. Without it, a restarted agent
    /// believes that its bays are free and might carry out a command a second time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<PathBuf>,
    /// Where samples come from.
    pub source: SourceConfig,
    /// Where the others are.
    #[serde(default = "NetworkConfig::agent")]
    pub network: NetworkConfig,
    /// Faster time, for demonstrations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<ClockConfig>,
}

/// A pack and the model that its gauge believes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackConfig {
    /// Which.
    pub id: PackId,
    /// How its gauge estimates.
    #[serde(default)]
    pub gauge: Kind,
    /// The gauge's battery model.
    pub battery: ModelRef,
}

/// A charged spare pack for robots.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpareConfig {
    /// Which.
    pub id: SpareId,
    /// Its state of charge.
    pub soc: f64,
    /// Name of the battery model that describes it, as robots name theirs; what packs of robots are where they are charged, or
    /// whatever fits, when this is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub battery: Option<String>,
}

impl SpareConfig {
    /// What the agent says of it at first: what is written on it. One that is measured is not handed out before its device has spoken.
    fn stated(&self, measured: bool) -> SpareState {
        SpareState { spare: self.id.clone(), soc: node::wire(label(self.soc)), ready: !measured, battery: self.battery.clone() }
    }
}

/// `[source]`: where samples come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
#[allow(clippy::large_enum_variant, reason = "there is one to a station")]
pub enum SourceConfig {
    /// A simulated station; what is true of it may differ from what the gauges believe.
    Sim {
        /// The true load on the active pack.
        load: ModelRef,
        /// The true packs.
        packs: BTreeMap<PackId, TruePack>,
        /// True models of spares that are of another kind than what robots leave (`charging.spare_battery`): that is charged in their
        /// places.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
        spares: BTreeMap<SpareId, ModelRef>,
        /// Time to lift a robot into a bay, s.
        load_s: f64,
        /// Time to lift a robot out of a bay, s.
        unload_s: f64,
        /// Time to exchange a robot's pack, s.
        swap_s: f64,
        /// What its converters and chargers can do.
        #[serde(default)]
        charging: Charging,
        /// When it changes packs, and what happens meanwhile; when one gives out, and nothing, when this
        /// is left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        selector: Option<SelectorConfig>,
        /// Where its packs are exchanged; they stay when this is left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        depot: Option<Depot>,
        /// What it drives; it stands when this is left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        vehicle: Option<Vehicle>,
        /// Temperature of the surroundings, °C.
        temperature_degc: f64,
        /// Chooses the gauge ICs' specimens and noise.
        seed: u64,
    },
    /// A real station: a device beside each of its packs, and a program that works it.
    Measured(MeasuredConfig),
}

/// What is true of a pack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TruePack {
    /// What it is.
    pub battery: ModelRef,
    /// State of charge at the start.
    pub soc: f64,
    /// What it has lived through.
    #[serde(default)]
    pub age: Age,
}

/// Checks a share.
fn fraction(key: &str, value: f64) -> anyhow::Result<()> {
    ensure!((0.0..=1.0).contains(&value), "{key} = {value}: must be between 0 and 1");
    Ok(())
}

/// Longest time that a configuration may state, s: a day.
const TIME_MAX_S: f64 = 86_400.0;

/// The only version of the file so far.
const SCHEMA: u32 = 1;

impl Config {
    /// Reads and checks a file, with what the environment sets.
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

    /// Checks what types cannot.
    ///
    /// # Errors
    /// Names the key and the allowed range.
    pub fn check(&self) -> anyhow::Result<()> {
        ensure!(self.schema == SCHEMA, "schema = {}: this program reads schema = {SCHEMA}", self.schema);
        self.network.check()?;
        self.clock.map_or(Ok(()), |clock| clock.check())?;
        ensure!(!self.packs.is_empty(), "packs: a station needs at least one");
        let distinct = |key: &str, names: Vec<&str>| {
            let twice = names.iter().enumerate().find(|(index, name)| names[..*index].contains(name));
            ensure!(twice.is_none(), "{key}: `{}` appears twice", twice.map_or("", |(_, name)| name));
            Ok(())
        };
        distinct("bays", self.bays.iter().map(AsRef::as_ref).collect())?;
        distinct("packs", self.packs.iter().map(|pack| pack.id.as_ref()).collect())?;
        distinct("spares", self.spares.iter().map(|spare| spare.id.as_ref()).collect())?;
        for spare in &self.spares {
            fraction(&format!("spares.{}.soc", spare.id), spare.soc)?;
        }
        match &self.source {
            SourceConfig::Sim { .. } => self.check_simulated()?,
            SourceConfig::Measured(measured) => measured.check(self).map_err(|error| anyhow!("source.{error:#}"))?,
        }
        self.alone.check()?;
        self.publish.check()
    }

    fn check_simulated(&self) -> anyhow::Result<()> {
        let SourceConfig::Sim { packs, spares, load_s, unload_s, swap_s, charging, selector, depot, vehicle, temperature_degc, .. } =
            &self.source
        else {
            return Ok(());
        };
        charging.check().context("source")?;
        selector.map_or(Ok(()), |selector| selector.check()).context("source")?;
        depot.map_or(Ok(()), |depot| depot.check()).context("source")?;
        vehicle.as_ref().map(Vehicle::parts).transpose().context("source")?;
        ensure!((-60.0..=100.0).contains(temperature_degc), "source.temperature_degc = {temperature_degc}: must be between -60 and 100");
        for (key, value) in [("load_s", load_s), ("unload_s", unload_s), ("swap_s", swap_s)] {
            ensure!((0.0..=TIME_MAX_S).contains(value), "source.{key} = {value}: must be between 0 and {TIME_MAX_S}");
        }
        for pack in &self.packs {
            let truth = packs.get(&pack.id).with_context(|| format!("source.packs: pack {} is missing", pack.id))?;
            fraction(&format!("source.packs.{}.soc", pack.id), truth.soc)?;
            truth.age.check().with_context(|| format!("source.packs.{}", pack.id))?;
        }
        let unknown = spares.keys().find(|id| !self.spares.iter().any(|spare| spare.id == **id));
        ensure!(unknown.is_none(), "source.spares: there is no spare {}", unknown.map_or("", AsRef::as_ref));
        Ok(())
    }

    /// Makes agent and source. Models and logs are looked up beside `path`.
    ///
    /// # Errors
    /// When a model cannot be read or a device not be opened.
    pub fn build(&self, path: Option<&Path>) -> anyhow::Result<(Agent, Box<dyn Source>)> {
        match &self.source {
            SourceConfig::Sim { .. } => {
                let (agent, body) = self.build_simulated(path)?;
                Ok((agent, Box::new(body)))
            }
            SourceConfig::Measured(measured) => measured.build(self, path),
        }
    }

    /// Makes agent and simulated body.
    ///
    /// # Errors
    /// When a model cannot be read or the source is not a simulated one.
    pub fn build_simulated(&self, path: Option<&Path>) -> anyhow::Result<(Agent, StationBody)> {
        let SourceConfig::Sim { load, packs, spares, load_s, unload_s, swap_s, charging, selector, depot, vehicle, temperature_degc, seed } =
            &self.source
        else {
            bail!("station {} has no simulated body", self.id)
        };
        let mut true_packs = Vec::new();
        for pack in &self.packs {
            let truth = packs.get(&pack.id).with_context(|| format!("source.packs: pack {} is missing", pack.id))?;
            let battery = truth.battery.load_as(System::Battery, &format!("source.packs.{}.battery", pack.id), path)?;
            true_packs.push(WorldPack { pack: pack.id.clone(), battery, soc: truth.soc, age: truth.age });
        }
        let mut body = StationBody::new(World {
            load: load.load_as(System::Station, "source.load", path)?,
            packs: true_packs,
            spares: self.spares.iter().map(|spare| (spare.id.clone(), spare.soc)).collect(),
            load_s: *load_s,
            unload_s: *unload_s,
            swap_s: *swap_s,
            converter_w_max: charging.converter_w(),
            recharge_w: charging.recharge_w,
            spare_battery: charging.load(path)?,
            spare_ready_soc: charging.spare_ready_soc,
            spare_batteries: spares
                .iter()
                .map(|(id, battery)| Ok((id.clone(), battery.load_as(System::Battery, &format!("source.spares.{id}"), path)?)))
                .collect::<anyhow::Result<_>>()?,
            selector: *selector,
            depot: *depot,
            vehicle: match vehicle {
                Some(vehicle) => Some((vehicle.model(path)?, vehicle.parts()?, vehicle.robot_kg)),
                None => None,
            },
            temperature_degc: *temperature_degc,
            seed: *seed,
        });
        Ok((self.agent_of(&mut body, path)?, body))
    }

    /// Makes a new agent for a simulated body that is there already, as a restart does: the chips
    /// that count its packs' charge were not restarted with it.
    ///
    /// # Errors
    /// When a model cannot be read or the source is not a simulated one.
    pub fn agent_of(&self, body: &mut StationBody, path: Option<&Path>) -> anyhow::Result<Agent> {
        let SourceConfig::Sim { selector, temperature_degc, .. } = &self.source else { bail!("station {} has no simulated body", self.id) };
        let mut gauges = Vec::new();
        for (pack, soc) in self.packs.iter().zip(body.remembered_socs()) {
            let battery = pack.battery.load_for_gauge(&format!("packs.{}.battery", pack.id), path)?;
            gauges.push((pack.id.clone(), pack.gauge.open(battery, soc, *temperature_degc)));
        }
        Ok(Agent::new(self.profile(selector.map_or(UNTIL_EMPTY, |selector| selector.rule()), "sim"), gauges))
    }

    fn profile(&self, rule: Rule, source: &str) -> Profile {
        let measured = |id: &SpareId| matches!(&self.source, SourceConfig::Measured(measured) if measured.spares.contains_key(id));
        Profile {
            id: self.id.clone(),
            alone: self.alone,
            bays: self.bays.clone(),
            spares: self.spares.iter().map(|spare| spare.stated(measured(&spare.id))).collect(),
            rule,
            publish: self.publish,
            source: source.to_owned(),
        }
    }
}
