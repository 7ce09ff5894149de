//! `[source] kind = "measured"`: a real station. A gauge of the world outside has one line in each list here.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow, ensure};
use device::{Device, Log, Program, Reader, UNKNOWN_SOC, Unmeasured, power_supply, ros2, sbs};
use energy::document::hint;
use energy::selector::Rule;
use proto::{PackId, SpareId};
use serde::{Deserialize, Serialize};

use super::{Config, fraction};
use crate::agent::Agent;
use crate::source::Source;
use crate::source::measured::{Hands, KEY, MeasuredPack, MeasuredSpare, MeasuredStation, Place};

/// A real station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredConfig {
    /// What measures each pack.
    pub packs: BTreeMap<PackId, GaugeConfig>,
    /// What measures spares, where something does; without it a spare is what is written on it, and a pack that a robot left
    /// never counts as charged.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub spares: BTreeMap<SpareId, GaugeConfig>,
    /// Program, with its first arguments, that works lift, exchange and selector. Without it, robots get into and out of their bays
    /// by themselves, nothing is exchanged, and packs are changed by whatever changes them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub operate: Vec<String>,
    /// Longest time that one act may take, s: a program that has not ended by then is stopped, and the act has failed.
    #[serde(default = "default_operate_max_s")]
    pub operate_max_s: f64,
    /// Whether the station drives: `operate` is asked where it is then.
    #[serde(default)]
    pub drives: bool,
    /// The active pack is left below this voltage, V; 0 to leave it when it gives out.
    #[serde(default)]
    pub leave_below_v: f64,
    /// A pack is taken above this voltage, V; 0 for any that can be used.
    #[serde(default)]
    pub take_above_v: f64,
    /// A measured spare can be handed out from this state of charge on, until it falls below by more than its readings differ by
    /// themselves (what two of them may be off by, and at most 0.05).
    #[serde(default = "default_ready_soc")]
    pub ready_soc: f64,
    /// Temperature taken where nothing measures a pack's, °C.
    #[serde(default = "default_ambient_degc")]
    pub ambient_degc: f64,
    /// How far a state of charge may be off (standard deviation) where device or program do not say.
    #[serde(default = "default_soc_sigma")]
    pub soc_sigma: f64,
}

/// A guess: an exchange or a lift takes seconds to a few minutes, and whatever takes longer than a quarter of an hour hangs.
fn default_operate_max_s() -> f64 {
    900.0
}

fn default_ready_soc() -> f64 {
    0.95
}

fn default_ambient_degc() -> f64 {
    Unmeasured::default().ambient_degc
}

fn default_soc_sigma() -> f64 {
    Unmeasured::default().soc_sigma
}

/// What measures a pack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum GaugeConfig {
    /// A measured log, for trials: rows at most a minute apart.
    Replay {
        /// The log; relative to the configuration.
        file: PathBuf,
    },
    /// A battery that the Linux kernel shows.
    PowerSupply(power_supply::Config),
    /// A Smart Battery over I2C.
    Sbs(sbs::Config),
    /// A battery of ROS 2 through rmw_zenoh.
    Ros2(ros2::Config),
}

impl GaugeConfig {
    fn check(&self) -> anyhow::Result<()> {
        match self {
            Self::Replay { .. } | Self::PowerSupply(_) => Ok(()),
            Self::Sbs(config) => config.check(),
            Self::Ros2(config) => config.check(),
        }
    }

    fn open(&self, of: &Config, path: Option<&Path>) -> anyhow::Result<Box<dyn Device>> {
        match self {
            Self::Replay { file } => {
                let file = path.and_then(Path::parent).map_or_else(|| file.clone(), |folder| folder.join(file));
                Ok(Box::new(Log::read(&file)?))
            }
            Self::PowerSupply(config) => config.open(true),
            Self::Sbs(config) => config.open(true),
            Self::Ros2(config) => config.open(&of.network, &of.site),
        }
    }
}

/// Highest voltage that a configuration may state, V.
const VOLTAGE_MAX_V: f64 = 1e3;
/// Longest time that a configuration may give an act, s: a day.
const ACT_MAX_S: f64 = 86_400.0;

impl MeasuredConfig {
    /// Checks what types cannot, for the station `of`. Errors begin with a key of this table.
    pub(super) fn check(&self, of: &Config) -> anyhow::Result<()> {
        for pack in &of.packs {
            ensure!(self.packs.contains_key(&pack.id), "packs: nothing measures pack {}", pack.id);
        }
        let known = |names: &[&str], name: &str, what: &str| {
            ensure!(names.contains(&name), "{what}s: there is no {what} {name}{}", hint(name, names.iter().copied()));
            Ok(())
        };
        let packs: Vec<&str> = of.packs.iter().map(|pack| pack.id.as_ref()).collect();
        self.packs.keys().try_for_each(|id| known(&packs, id.as_ref(), "pack"))?;
        let spares: Vec<&str> = of.spares.iter().map(|spare| spare.id.as_ref()).collect();
        self.spares.keys().try_for_each(|id| known(&spares, id.as_ref(), "spare"))?;
        for (id, gauge) in &self.packs {
            gauge.check().map_err(|error| anyhow!("packs.{id}.{error:#}"))?;
        }
        for (id, gauge) in &self.spares {
            gauge.check().map_err(|error| anyhow!("spares.{id}.{error:#}"))?;
        }
        for (key, value) in [("leave_below_v", self.leave_below_v), ("take_above_v", self.take_above_v)] {
            ensure!((0.0..=VOLTAGE_MAX_V).contains(&value), "{key} = {value}: must be between 0 and {VOLTAGE_MAX_V}");
        }
        node::check_rule(self.rule())?;
        let act_s = self.operate_max_s;
        ensure!((1.0..=ACT_MAX_S).contains(&act_s), "operate_max_s = {act_s}: must be between 1 and {ACT_MAX_S}");
        fraction("ready_soc", self.ready_soc)?;
        self.unmeasured().check()?;
        let key = KEY.trim_start_matches("source.");
        Program::check(key, &self.operate)?;
        ensure!(!self.drives || !self.operate.is_empty(), "drives: the station drives, and {key} names no program that says where it is");
        ensure!(of.spares.is_empty() || !self.operate.is_empty(), "{key}: the station has spares, and no program to exchange them");
        Ok(())
    }

    fn rule(&self) -> Rule {
        Rule { leave_below_v: self.leave_below_v, take_above_v: self.take_above_v }
    }

    fn unmeasured(&self) -> Unmeasured {
        Unmeasured { ambient_degc: self.ambient_degc, soc_sigma: self.soc_sigma }
    }

    /// Makes agent and source of the station `of`.
    pub(super) fn build(&self, of: &Config, path: Option<&Path>) -> anyhow::Result<(Agent, Box<dyn Source>)> {
        let (mut gauges, mut packs) = (Vec::new(), Vec::new());
        for pack in &of.packs {
            let key = || format!("source.packs.{}", pack.id);
            let model = pack.battery.load_for_gauge(&format!("packs.{}.battery", pack.id), path)?;
            let device = self.packs.get(&pack.id).with_context(key)?.open(of, path).with_context(key)?;
            // Anything, until the device has said what it knows.
            gauges.push((pack.id.clone(), pack.gauge.open(Arc::clone(&model), UNKNOWN_SOC, self.ambient_degc)));
            let reader = Reader::new(device, Arc::clone(&model), self.unmeasured());
            packs.push(MeasuredPack::new(pack.id.clone(), reader, model.battery()));
        }
        let spare = |(id, gauge): (&SpareId, &GaugeConfig)| {
            let device = gauge.open(of, path).with_context(|| format!("source.spares.{id}"))?;
            Ok(MeasuredSpare::new(id.clone(), device, self.ready_soc, self.soc_sigma))
        };
        let spares = self.spares.iter().map(spare).collect::<anyhow::Result<_>>()?;
        let station = MeasuredStation::new(packs, spares, Hands::new(self.operate.clone(), self.operate_max_s, self.soc_sigma));
        let station = if self.drives { station.at(Place::new(self.operate.clone())) } else { station };
        Ok((Agent::new(of.profile(self.rule(), "measured"), gauges), Box::new(station)))
    }
}

#[cfg(test)]
mod tests;
