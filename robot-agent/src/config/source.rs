//! `[source]`: where samples come from. A gauge of the world outside has one line in each list here.

use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use device::{Device, power_supply, ros2, sbs};
use node::files::ModelRef;
use node::{Age, NetworkConfig};
use proto::{RobotId, SiteId};
use serde::{Deserialize, Serialize};

use crate::charger::ChargerConfig;
use crate::radio::Radio;
use crate::source::vda5050;

/// `[source]`: where samples come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum SourceConfig {
    /// A simulated body; what is true of it may differ from what the gauge believes.
    Sim {
        /// The true battery.
        battery: ModelRef,
        /// The true loads.
        load: ModelRef,
        /// True state of charge at the start.
        soc: f64,
        /// What the pack has lived through.
        #[serde(default)]
        age: Age,
        /// The charger on board; without it the battery takes its rated charge in any case.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        charger: Option<ChargerConfig>,
        /// Its radio; without it the coordinator hears it everywhere.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        radio: Option<Radio>,
        /// Temperature of the surroundings, °C.
        temperature_degc: f64,
        /// Chooses the gauge IC's specimen and noise.
        seed: u64,
    },
    /// A measured log.
    Replay {
        /// The log.
        file: PathBuf,
    },
    /// A battery that the Linux kernel shows.
    PowerSupply(power_supply::Config),
    /// A Smart Battery over I2C.
    Sbs(sbs::Config),
    /// A robot of ROS 2 through rmw_zenoh.
    Ros2(ros2::Config),
    /// A vehicle of VDA 5050 over MQTT.
    Vda5050(vda5050::Config),
}

/// What `--source` names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SourceKind {
    /// The simulated body that the configuration file describes.
    Sim,
    /// A measured log, WHAT: time_s, current_a, voltage_v, temperature_degc.
    Replay,
    /// A battery that Linux shows under /sys/class/power_supply; WHAT: its name, such as BAT0.
    PowerSupply,
    /// A Smart Battery; WHAT: its bus, such as /dev/i2c-1.
    Sbs,
    /// A robot of ROS 2 through rmw_zenoh; WHAT: the topic of its sensor_msgs/msg/BatteryState.
    Ros2,
    /// A vehicle of VDA 5050 over MQTT; WHAT: mqtt://HOST:PORT/INTERFACE/vN/MANUFACTURER/SERIAL.
    Vda5050,
}

impl SourceConfig {
    /// The source that flags name: its kind and, where it needs one, what to read.
    ///
    /// # Errors
    /// Says what is needed.
    pub fn of(kind: SourceKind, what: Option<&str>) -> anyhow::Result<Self> {
        Ok(match kind {
            SourceKind::Sim => bail!("a simulated robot is described by a file: robot-agent run --config FILE"),
            SourceKind::Replay => {
                let file = what.context("--source replay needs the log: robot-agent run --source replay FILE")?;
                Self::Replay { file: std::path::absolute(file)? }
            }
            SourceKind::Vda5050 => {
                let vehicle = "mqtt://127.0.0.1:1883/uagv/v2/KIT/0001";
                let what =
                    what.with_context(|| format!("--source vda5050 needs the vehicle: robot-agent run --source vda5050 {vehicle}"))?;
                Self::Vda5050(vda5050::Config::of(what)?)
            }
            SourceKind::Sbs => {
                let bus = what.context("--source sbs needs the bus: robot-agent run --source sbs /dev/i2c-1")?;
                Self::Sbs(sbs::Config::on(bus.into()))
            }
            SourceKind::Ros2 => {
                let topic = what.context("--source ros2 needs the topic: robot-agent run --source ros2 /battery_state")?.to_owned();
                Self::Ros2(ros2::Config { topic, domain: 0, connect: Vec::new(), invert_current: false })
            }
            SourceKind::PowerSupply => {
                Self::PowerSupply(power_supply::Config { device: what.map(str::to_owned), ..power_supply::Config::default() })
            }
        })
    }

    /// Checks what types cannot.
    ///
    /// # Errors
    /// Names the key and the allowed range.
    pub fn check(&self) -> anyhow::Result<()> {
        match self {
            Self::Sim { soc, age, temperature_degc, charger, radio, .. } => {
                charger.map_or(Ok(()), |charger| charger.check()).context("source")?;
                radio.map_or(Ok(()), |radio| radio.check()).context("source")?;
                age.check().context("source")?;
                ensure!(
                    (-60.0..=100.0).contains(temperature_degc),
                    "source.temperature_degc = {temperature_degc}: must be between -60 and 100"
                );
                ensure!((0.0..=1.0).contains(soc), "source.soc = {soc}: must be between 0 and 1");
                Ok(())
            }
            Self::Replay { .. } | Self::PowerSupply(_) => Ok(()),
            Self::Sbs(config) => config.check().context("source"),
            Self::Ros2(config) => config.check().context("source"),
            Self::Vda5050(config) => config.check(),
        }
    }

    /// The gauge of the world outside that is named here; none for a simulated body or a log.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn device(&self, network: &NetworkConfig, site: &SiteId, robot: &RobotId) -> anyhow::Result<Option<Box<dyn Device>>> {
        Ok(Some(match self {
            Self::Sim { .. } | Self::Replay { .. } => return Ok(None),
            Self::PowerSupply(config) => config.open(false).context("source")?,
            Self::Sbs(config) => config.open(false).context("source")?,
            Self::Ros2(config) => config.open(network, site).context("source")?,
            Self::Vda5050(config) => config.open(robot)?,
        }))
    }
}
