//! The robot agent's configuration file; `source.rs` has its `[source]`.

mod source;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, ensure};
use device::{Log, UNKNOWN_SOC};
use energy::gauge::{Kind, soc_at_rest};
use energy::{Channel, Model, System};
use node::files::{ModelRef, read_text};
use node::mission::Mission;
use node::{ClockConfig, NetworkConfig, Publish, wire};
use proto::{RobotId, SiteId, StationId, Travel};
use serde::{Deserialize, Serialize};

pub use self::source::{SourceConfig, SourceKind};
use crate::agent::{Agent, Alone, Profile, unmeasured_w};
use crate::source::{Body, Measured, Replay, RobotBody, Source, World};
use crate::way::Ways;

/// Everything a robot agent is told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Version of this file's format.
    pub schema: u32,
    /// The robot.
    pub id: RobotId,
    /// The site it belongs to.
    pub site: SiteId,
    /// How the gauge estimates.
    #[serde(default)]
    pub gauge: Kind,
    /// The gauge's battery model.
    pub battery: ModelRef,
    /// The model of its loads; without it, the drain is measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load: Option<ModelRef>,
    /// Its work.
    #[serde(default)]
    pub mission: Mission,
    /// Seconds of travel to each station in reach.
    #[serde(default)]
    pub travel_s: BTreeMap<StationId, f64>,
    /// Ways to stations of which more than the time is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub way: Option<Ways>,
    /// How often it speaks.
    #[serde(default)]
    pub publish: Publish,
    /// What it does while no coordinator is heard.
    #[serde(default)]
    pub alone: Alone,
    /// File for what a restart must not forget; relative to this file. Without it, a restarted agent
    /// begins at work and might carry out a command a second time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<PathBuf>,
    /// Where samples come from.
    pub source: SourceConfig,
    /// What is true of a real robot, whatever measures its battery.
    #[serde(default, skip_serializing_if = "Body::is_default")]
    pub body: Body,
    /// Where the others are.
    #[serde(default = "NetworkConfig::agent")]
    pub network: NetworkConfig,
    /// Faster time, for demonstrations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<ClockConfig>,
}

/// Longest time that a configuration may state, s: a year.
const TIME_MAX_S: f64 = 365.0 * 86_400.0;

/// The only version of the file so far.
pub const SCHEMA: u32 = 1;

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
        self.publish.check()?;
        self.alone.check()?;
        self.mission.check()?;
        self.way.as_ref().map_or(Ok(()), Ways::check)?;
        for station in self.way.iter().flat_map(|way| way.to.keys()) {
            ensure!(
                !self.travel_s.contains_key(station),
                "way.to.{station}: travel_s.{station} is given too; one of them says how long it takes"
            );
        }
        for (station, time_s) in &self.travel_s {
            ensure!((0.0..=TIME_MAX_S).contains(time_s), "travel_s.{station} = {time_s}: must be between 0 and {TIME_MAX_S}");
        }
        self.body.check()?;
        self.source.check()?;
        Ok(())
    }

    /// Makes agent and source. Models are looked up beside `path`.
    ///
    /// # Errors
    /// When a model or log cannot be read.
    pub fn build(&self, path: Option<&Path>) -> anyhow::Result<(Agent, Box<dyn Source>)> {
        match &self.source {
            SourceConfig::Sim { .. } => {
                let (agent, body) = self.build_simulated(path)?;
                Ok((agent, Box::new(body)))
            }
            SourceConfig::Replay { file } => {
                let battery = self.battery.load_for_gauge("battery", path)?;
                let file = path.and_then(Path::parent).map_or_else(|| file.clone(), |folder| folder.join(file));
                let replay = Log::read(&file)?;
                let soc = soc_at_rest(&battery, replay.rest_voltage_v());
                let gauge = self.gauge.open(Arc::clone(&battery), soc, replay.temperature_degc());
                let drain_w = energy::Estimate::new(replay.mean_power_w(), 0.1 * replay.mean_power_w().abs());
                let load = self.load.as_ref().map(|load| load.load_as(System::Robot, "load", path)).transpose()?;
                Ok((Agent::new(self.profile(path, &battery, load.as_ref(), Some(drain_w), "replay")?, gauge), Box::new(Replay(replay))))
            }
            _ => self.build_measured(path),
        }
    }

    /// Makes the agent of a real robot, and its gauge's source.
    fn build_measured(&self, path: Option<&Path>) -> anyhow::Result<(Agent, Box<dyn Source>)> {
        let device = self.source.device(&self.network, &self.site, &self.id)?.context("source: no device")?;
        let battery = self.battery.load_for_gauge("battery", path)?;
        let load = self.load.as_ref().map(|load| load.load_as(System::Robot, "load", path)).transpose()?;
        let drain_w = load.as_ref().map(|load| self.mission.drain_w(load)).transpose()?;
        // Anything, until the device has said what it knows.
        let gauge = self.gauge.open(Arc::clone(&battery), UNKNOWN_SOC, self.body.ambient_degc);
        let profile = self.profile(path, &battery, load.as_ref(), drain_w, &device.name())?;
        Ok((Agent::new(profile, gauge), Box::new(Measured::new(device, battery, self.body.clone()))))
    }

    /// Makes agent and simulated body.
    ///
    /// # Errors
    /// When a model cannot be read or the source is not a simulated one.
    pub fn build_simulated(&self, path: Option<&Path>) -> anyhow::Result<(Agent, RobotBody)> {
        let SourceConfig::Sim { battery: true_battery, load: true_load, soc, age, charger, radio, temperature_degc, seed } = &self.source
        else {
            anyhow::bail!("robot {} has no simulated body", self.id)
        };
        let mut ways = BTreeMap::new();
        for station in self.way.iter().flat_map(|way| way.to.keys()) {
            if let Some(both) = self.way.as_ref().map(|way| way.stretches(station, &self.mission)).transpose()?.flatten() {
                ways.insert(station.clone(), both);
            }
        }
        let others: Vec<Channel> =
            ways.values().flatten().flatten().flat_map(|stretch| stretch.inputs.iter().map(|(channel, _)| *channel)).collect();
        let mut body = RobotBody::new(World {
            battery: true_battery.load_as(System::Battery, "source.battery", path)?,
            load: true_load.load_as(System::Robot, "source.load", path)?,
            work: self.mission.stretches(&others)?,
            ways,
            travel_s: self.travel_s.clone(),
            charger: *charger,
            radio: *radio,
            soc: *soc,
            age: *age,
            temperature_degc: *temperature_degc,
            seed: *seed,
        });
        Ok((self.agent_of(&mut body, path)?, body))
    }

    /// Makes a new agent for a simulated body that is there already, as a restart does: the chip that
    /// counts its charge was not restarted with it.
    ///
    /// # Errors
    /// When a model cannot be read or the source is not a simulated one.
    pub fn agent_of(&self, body: &mut RobotBody, path: Option<&Path>) -> anyhow::Result<Agent> {
        let SourceConfig::Sim { load: true_load, temperature_degc, .. } = &self.source else {
            anyhow::bail!("robot {} has no simulated body", self.id)
        };
        let battery = self.battery.load_for_gauge("battery", path)?;
        let load = self.believed_load().unwrap_or(true_load).load_as(System::Robot, "load", path)?;
        let drain_w = self.mission.drain_w(&load)?;
        let gauge = self.gauge.open(Arc::clone(&battery), body.remembered_soc(), *temperature_degc);
        Ok(Agent::new(self.profile(path, &battery, Some(&load), Some(drain_w), "sim")?, gauge))
    }

    /// The model of its loads that it goes by, if any.
    fn believed_load(&self) -> Option<&ModelRef> {
        let true_load = match &self.source {
            SourceConfig::Sim { load, .. } => Some(load),
            _ => None,
        };
        self.load.as_ref().or(true_load)
    }

    fn profile(
        &self,
        path: Option<&Path>,
        battery: &Model,
        load: Option<&Arc<Model>>,
        drain_w: Option<energy::Estimate>,
        source: &str,
    ) -> anyhow::Result<Profile> {
        let measure_drain = drain_w.is_none();
        let drain_w = drain_w.map_or_else(|| unmeasured_w(battery), wire);
        let timed = self.travel_s.iter().map(|(station, &time_s)| {
            let energy_wh = drain_w.scaled(time_s / energy::units::S_PER_H);
            (station.clone(), Travel { time_s, energy_wh })
        });
        let mut travel: BTreeMap<StationId, Travel> = timed.collect();
        for (way, station) in self.way.iter().flat_map(|way| way.to.keys().map(move |station| (way, station))) {
            let load = load.with_context(|| format!("way.to.{station}: what it costs needs the model of the loads, `load`"))?;
            if let Some(trip) = way.trip(station, &self.mission, load)? {
                travel.insert(station.clone(), Travel { time_s: trip.time_s, energy_wh: wire(trip.energy_wh) });
            }
        }
        Ok(Profile {
            id: self.id.clone(),
            battery: battery.name.clone(),
            load: self.believed_load().map(|load| load.named(path)),
            cells_series: battery.battery().series,
            charge_cutoff_a: battery.battery().charge.cutoff_a,
            drain_w,
            measure_drain,
            travel,
            mission: proto::Mission { weight: self.mission.weight, until: None },
            publish: self.publish,
            alone: self.alone,
            source: source.to_owned(),
        })
    }
}
