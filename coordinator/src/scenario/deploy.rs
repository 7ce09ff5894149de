//! One run as configurations: the same types that the live processes read.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, ensure};
use energy::charger::PowerPath;
use node::files::{ModelRef, ReducedModel};
use node::{ClockConfig, NetworkConfig};
use toml::Spanned;

use super::file::{Changes, RobotEntry, RunEntry, Scenario, StationEntry};
use crate::config::{Config, PolicyConfig, StationConfig, TelemetryConfig};
use crate::web::WebConfig;

/// Configurations of every process of a fleet.
#[derive(Debug, Clone)]
pub struct Deployment {
    /// The coordinator.
    pub coordinator: Config,
    /// Robot agents with their simulated bodies.
    pub robots: Vec<robot_agent::Config>,
    /// Station agents with their simulated bodies.
    pub stations: Vec<station_agent::Config>,
}

impl Scenario {
    /// Configurations for one run.
    ///
    /// # Errors
    /// When a change names no model, or names an effect of every model at once.
    pub fn deploy(&self, run: &RunEntry, seed: u64) -> anyhow::Result<Deployment> {
        let mut policy = self.policy.as_ref().map_or_else(PolicyConfig::default, |policy| policy.get_ref().clone());
        if let Some(name) = &run.policy {
            policy.name.clone_from(name);
            policy.settings().with_context(|| format!("run \"{}\"", run.name))?;
        }
        self.check_changes(run)?;
        self.check_models(run)?;
        let mut coordinator = Config {
            schema: 1,
            site: self.site.clone(),
            store: PathBuf::from("tender.db"),
            policy,
            robots: BTreeMap::new(),
            batteries: BTreeMap::new(),
            stations: BTreeMap::new(),
            viewers: Vec::new(),
            network: NetworkConfig::coordinator(),
            // Several fleets may run on one machine.
            web: WebConfig { port: 0, ..WebConfig::default() },
            telemetry: TelemetryConfig::default(),
            clock: None,
        };
        let believed = |name: &str| self.reference(name, &[&self.believed, &run.believed]);
        let truth = |name: &str| self.reference(name, &[&self.world]);
        let mut robots = Vec::new();
        for entry in self.robot.iter().map(Spanned::get_ref) {
            for index in 0..entry.len() {
                let config =
                    self.robot_config(entry, index, seed.wrapping_mul(1_000_003).wrapping_add(robots.len() as u64), &believed, &truth)?;
                coordinator.robots.insert(config.id.clone(), believed(&entry.battery));
                robots.push(config);
            }
        }
        let mut stations = Vec::new();
        for (index, entry) in self.station.iter().map(Spanned::get_ref).enumerate() {
            let seed = seed.wrapping_mul(1_000_003).wrapping_add(500_000 + 1000 * index as u64);
            let config = StationConfig {
                load: believed(&entry.load),
                load_s: entry.load_s,
                unload_s: entry.unload_s,
                swap_s: entry.swap_s,
                packs: entry.packs.iter().map(|pack| (pack.id.clone(), believed(&pack.battery))).collect(),
                charging: entry.charging.named(|name| believed(name)),
            };
            coordinator.stations.insert(entry.id.clone(), config);
            let spares = entry.spares.iter().filter_map(|spare| spare.battery.as_ref());
            coordinator.batteries.extend(spares.map(|name| (name.clone(), believed(name))));
            stations.push(self.station_config(entry, seed, &believed, &truth)?);
        }
        for robot in &robots {
            for station in &stations {
                check_power_path(robot, station)?;
            }
        }
        Ok(Deployment { coordinator, robots, stations })
    }

    fn robot_config(
        &self,
        entry: &RobotEntry,
        index: usize,
        seed: u64,
        believed: &dyn Fn(&str) -> ModelRef,
        truth: &dyn Fn(&str) -> ModelRef,
    ) -> anyhow::Result<robot_agent::Config> {
        let config = robot_agent::Config {
            schema: 1,
            id: entry.robot(index)?,
            site: self.site.clone(),
            gauge: entry.gauge,
            battery: believed(&entry.battery),
            load: Some(believed(&entry.load)),
            mission: entry.mission.clone(),
            way: entry.way.clone(),
            travel_s: entry.travel_s.iter().map(|(station, values)| (station.clone(), values.at(index))).collect(),
            publish: self.publish,
            alone: Default::default(),
            memory: None,
            source: robot_agent::SourceConfig::Sim {
                battery: truth(&entry.battery),
                load: truth(&entry.load),
                soc: entry.soc.at(index),
                age: entry.age,
                charger: entry.charger,
                radio: entry.radio,
                temperature_degc: self.temperature_degc,
                seed,
            },
            body: Default::default(),
            network: NetworkConfig::agent(),
            clock: None,
        };
        config.check().with_context(|| format!("robot {}", config.id))?;
        Ok(config)
    }

    fn station_config(
        &self,
        entry: &StationEntry,
        seed: u64,
        believed: &dyn Fn(&str) -> ModelRef,
        truth: &dyn Fn(&str) -> ModelRef,
    ) -> anyhow::Result<station_agent::Config> {
        let bays = (1..=entry.bays).map(|number| proto::BayId::new(format!("bay-{number}"))).collect::<Result<_, _>>()?;
        let true_pack = |pack: &super::PackEntry| station_agent::TruePack { battery: truth(&pack.battery), soc: pack.soc, age: pack.age };
        let spare = |spare: &super::SpareEntry| {
            let (id, soc, battery) = (spare.id.clone(), spare.soc, spare.battery.clone());
            station_agent::SpareConfig { id, soc, battery }
        };
        let config = station_agent::Config {
            schema: 1,
            id: entry.id.clone(),
            site: self.site.clone(),
            bays,
            packs: entry
                .packs
                .iter()
                .map(|pack| station_agent::PackConfig { id: pack.id.clone(), gauge: pack.gauge, battery: believed(&pack.battery) })
                .collect(),
            spares: entry.spares.iter().map(spare).collect(),
            publish: self.publish,
            alone: Default::default(),
            memory: None,
            source: station_agent::SourceConfig::Sim {
                load: truth(&entry.load),
                packs: entry.packs.iter().map(|pack| (pack.id.clone(), true_pack(pack))).collect(),
                spares: entry.spares.iter().filter_map(|spare| Some((spare.id.clone(), truth(spare.battery.as_deref()?)))).collect(),
                load_s: entry.load_s,
                unload_s: entry.unload_s,
                swap_s: entry.swap_s,
                charging: entry.charging.named(|name| truth(name)),
                selector: entry.selector,
                depot: entry.depot,
                vehicle: entry.vehicle.as_ref().map(|vehicle| vehicle.named(|name| truth(name))),
                temperature_degc: self.temperature_degc,
                seed,
            },
            network: NetworkConfig::agent(),
            clock: None,
        };
        config.check().with_context(|| format!("station {}", config.id))?;
        Ok(config)
    }

    /// Names of all models that stations and robots use.
    #[must_use]
    pub fn model_names(&self) -> Vec<&str> {
        let stations = self.station.iter().flat_map(|station| station.get_ref().models());
        let all = stations.chain(self.robot.iter().flat_map(|robot| robot.get_ref().models()));
        let mut names: Vec<&str> = all.map(|named| named.model).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    fn check_changes(&self, run: &RunEntry) -> anyhow::Result<()> {
        let names = self.model_names();
        for changes in [&self.world, &self.believed, &run.believed] {
            for key in changes.without.keys().chain(changes.replace.keys()) {
                let hint = || energy::document::hint(key, names.iter().copied());
                ensure!(
                    key == "*" || names.contains(&key.as_str()),
                    "no station or robot has a model `{key}`{} Used: {}",
                    hint(),
                    names.join(", ")
                );
            }
            let every = changes.without.get("*");
            ensure!(
                every.is_none_or(|ids| ids == &["*"]),
                "without: for every model only \"*\" = [\"*\"] is possible: models have different effects"
            );
            ensure!(!changes.replace.contains_key("*"), "replace: one model cannot stand for all");
        }
        Ok(())
    }

    /// A file that is not there is told here, and a misspelt name that replaces another.
    fn check_models(&self, run: &RunEntry) -> anyhow::Result<()> {
        let is_there = |key: &str, name: &str| {
            ensure!(
                energy::built_in_names().any(|known| known == name) || self.folder.join(name).exists(),
                "{key}: no model `{name}`: neither built in nor a file{} Built in: {}",
                energy::document::hint(name, energy::built_in_names()),
                energy::built_in_names().collect::<Vec<_>>().join(", ")
            );
            Ok(())
        };
        let stations = self
            .station
            .iter()
            .map(Spanned::get_ref)
            .flat_map(|entry| entry.models().map(move |named| (format!("station {}", entry.id), named)));
        let robots = self
            .robot
            .iter()
            .map(Spanned::get_ref)
            .flat_map(|entry| entry.models().map(move |named| (format!("robot {}", entry.id), named)));
        for (of, named) in stations.chain(robots) {
            let key = format!("{of}: {}", named.key);
            is_there(&key, named.model)?;
            // What is built in was looked at when the file was read.
            if energy::built_in(named.model).is_none() {
                self.reference(named.model, &[]).load_as(named.of, &key, None)?;
            }
        }
        let replacing = [&self.world, &self.believed, &run.believed].into_iter().flat_map(|changes| &changes.replace);
        replacing.into_iter().try_for_each(|(old, new)| is_there(&format!("replace.{old}"), new))
    }

    fn reference(&self, name: &str, changes: &[&Changes]) -> ModelRef {
        let mut model = name.to_owned();
        let mut without: Vec<String> = Vec::new();
        for changes in changes {
            if let Some(other) = changes.replace.get(name) {
                model.clone_from(other);
            }
            for key in [name, "*"] {
                without.extend(changes.without.get(key).into_iter().flatten().cloned());
            }
        }
        let model = if energy::built_in(&model).is_some() {
            model
        } else {
            let path = self.folder.join(&model);
            std::path::absolute(&path).unwrap_or(path).to_string_lossy().into_owned()
        };
        if without.is_empty() { ModelRef::Name(model) } else { ModelRef::Reduced(ReducedModel { model, without }) }
    }
}

/// Where a robot takes its own load is a matter of its charger and of the station's load: the two must
/// agree.
fn check_power_path(robot: &robot_agent::Config, station: &station_agent::Config) -> anyhow::Result<()> {
    let robot_agent::SourceConfig::Sim { charger: Some(charger), .. } = &robot.source else { return Ok(()) };
    let goes = robot.travel_s.contains_key(&station.id) || robot.way.as_ref().is_some_and(|way| way.to.contains_key(&station.id));
    let station_agent::SourceConfig::Sim { load, .. } = &station.source else { return Ok(()) };
    let load = load.load(None)?;
    let (own, theirs) = (charger.power_path(), energy::service::power_path(&load));
    let effect = |path| if path == PowerPath::Direct { "robot_own_load" } else { "path_selection" };
    ensure!(
        !goes || theirs.is_none_or(|theirs| theirs == own),
        "robot {}: charger.path: the load `{}` of station {} has the effect `{}`, but this path wants `{}`: name another load, such as {}",
        robot.id,
        load.name,
        station.id,
        effect(theirs.unwrap_or(own)),
        effect(own),
        if own == PowerPath::Direct { "mds-station" } else { "mds-station-path-selection" }
    );
    Ok(())
}

impl Deployment {
    /// The same fleet on another network and a faster clock.
    pub fn place(&mut self, endpoint: &str, clock: ClockConfig) {
        self.coordinator.network.listen = vec![endpoint.to_owned()];
        self.coordinator.clock = Some(clock);
        for (network, own_clock) in self
            .robots
            .iter_mut()
            .map(|config| (&mut config.network, &mut config.clock))
            .chain(self.stations.iter_mut().map(|config| (&mut config.network, &mut config.clock)))
        {
            network.connect = vec![endpoint.to_owned()];
            *own_clock = Some(clock);
        }
    }
}
