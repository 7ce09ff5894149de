//! The fleet configuration of Open-RMF (`rmf_fleet`), as its fleet adapters read it.

use anyhow::ensure;

use super::node::{self, Node};

/// What a fleet configuration says that Tender has a place for.
#[derive(Debug, Clone, PartialEq)]
pub struct Fleet {
    /// Its name.
    pub name: String,
    /// Nominal speed, m/s, and acceleration, m/s².
    pub linear: [f64; 2],
    /// Nominal rotational speed, rad/s, and acceleration, rad/s².
    pub angular: [f64; 2],
    /// Nominal voltage of the battery, V.
    pub voltage_v: f64,
    /// Its capacity, Ah.
    pub capacity_ah: f64,
    /// The charger's current, A.
    pub charging_current_a: f64,
    /// Mass of a robot, kg.
    pub mass_kg: f64,
    /// Its moment of inertia about the vertical axis, kg m².
    pub moment_of_inertia_kgm2: f64,
    /// Friction over weight.
    pub friction_coefficient: f64,
    /// Power of computers and sensors, W.
    pub ambient_w: f64,
    /// Power of the tool while it is used, W.
    pub tool_w: f64,
    /// State of charge below which robots do not operate.
    pub recharge_threshold: f64,
    /// State of charge to which they are charged.
    pub recharge_soc: f64,
    /// Its robots, by name.
    pub robots: Vec<Robot>,
    /// Keys that Tender has no place for.
    pub unused: Vec<String>,
}

/// A robot of the fleet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// Waypoint of its charger.
    pub charger: Option<String>,
}

/// What RMF takes when a configuration does not say.
const RECHARGE_THRESHOLD: f64 = 0.2;
const RECHARGE_SOC: f64 = 1.0;

/// Keys that are read here; all others are told as unused.
const USED: [&str; 9] = [
    "name",
    "limits",
    "battery_system",
    "mechanical_system",
    "ambient_system",
    "tool_system",
    "recharge_threshold",
    "recharge_soc",
    "robots",
];

impl Fleet {
    /// Reads a fleet configuration.
    ///
    /// # Errors
    /// Names the key by its path, what is allowed, and what was probably meant.
    pub fn parse(file: &str, text: &str) -> anyhow::Result<Self> {
        let value = node::parse(file, text)?;
        let root = Node::root(file, &value);
        let fleet = root.need("rmf_fleet")?;
        let limits = fleet.need("limits")?;
        let battery = fleet.need("battery_system")?;
        let mechanics = fleet.need("mechanical_system")?;
        let power = |system: &str| -> anyhow::Result<f64> { fleet.need(system)?.need("power")?.number(0.0..=1e5) };
        let share = |key: &str, default: f64| fleet.get(key).map_or(Ok(default), |node| node.number(0.0..=1.0));
        let above = |node: &Node<'_>, key: &str, most: f64| -> anyhow::Result<f64> {
            let node = node.need(key)?;
            let number = node.number(0.0..=most)?;
            ensure!(number > 0.0, "{} = {number}: must be above 0", node.place());
            Ok(number)
        };
        let name = fleet.need("name")?;
        let (place, name) = (name.place(), name.text()?.to_owned());
        ensure!(!name.contains(char::is_control), "{place} = {name:?}: must be one line, without control characters");
        let read = Self {
            linear: pair(&limits.need("linear")?)?,
            angular: pair(&limits.need("angular")?)?,
            voltage_v: above(&battery, "voltage", 2000.0)?,
            capacity_ah: above(&battery, "capacity", 1e5)?,
            charging_current_a: above(&battery, "charging_current", 1e5)?,
            mass_kg: above(&mechanics, "mass", 1e5)?,
            moment_of_inertia_kgm2: mechanics.need("moment_of_inertia")?.number(0.0..=1e6)?,
            friction_coefficient: mechanics.need("friction_coefficient")?.number(0.0..=10.0)?,
            ambient_w: power("ambient_system")?,
            tool_w: power("tool_system")?,
            recharge_threshold: share("recharge_threshold", RECHARGE_THRESHOLD)?,
            recharge_soc: share("recharge_soc", RECHARGE_SOC)?,
            robots: robots(&root, &fleet)?,
            unused: unused(&root, &fleet),
            name,
        };
        ensure!(
            read.recharge_threshold < read.recharge_soc,
            "{}: recharge_threshold = {} must lie below recharge_soc = {}",
            fleet.place(),
            read.recharge_threshold,
            read.recharge_soc
        );
        Ok(read)
    }
}

fn pair(node: &Node<'_>) -> anyhow::Result<[f64; 2]> {
    let list = node.list()?;
    let [speed, acceleration] = list.as_slice() else {
        anyhow::bail!("{}: must be [velocity, acceleration], has {} entries", node.place(), list.len())
    };
    let both = [speed.number(0.0..=100.0)?, acceleration.number(0.0..=100.0)?];
    ensure!(both.iter().all(|number| *number > 0.0), "{}: both must be above 0", node.place());
    Ok(both)
}

/// Robots under `rmf_fleet.robots`, or at the top with an `rmf_config` of their own, as older adapters
/// have them.
fn robots(root: &Node<'_>, fleet: &Node<'_>) -> anyhow::Result<Vec<Robot>> {
    let entries = match fleet.get("robots") {
        Some(robots) => robots,
        None => root.need("robots").map_err(|_| fleet.need("robots").unwrap_err())?,
    };
    let mut read = Vec::new();
    for (name, robot) in entries.entries()? {
        let older = || robot.get("rmf_config").and_then(|config| config.get("charger"));
        let charger = match robot.get("charger").or_else(older) {
            Some(charger) if charger.is_text() => Some(charger),
            Some(charger) => Some(charger.need("waypoint")?),
            None => None,
        };
        let charger = charger.map(|charger| waypoint(&charger)).transpose()?;
        read.push(Robot { name: name.to_owned(), charger });
    }
    ensure!(!read.is_empty(), "{}: at least one robot is needed", entries.place());
    Ok(read)
}

/// The name of a charger's waypoint.
fn waypoint(charger: &Node<'_>) -> anyhow::Result<String> {
    let name = charger.text()?;
    ensure!(!name.is_empty(), "{}: must name a waypoint; a robot that may charge anywhere has none", charger.place());
    Ok(name.to_owned())
}

fn unused(root: &Node<'_>, fleet: &Node<'_>) -> Vec<String> {
    let own = fleet.keys().filter(|key| !USED.contains(key)).map(|key| format!("rmf_fleet.{key}"));
    let others = root.keys().filter(|key| !["rmf_fleet", "robots"].contains(key)).map(str::to_owned);
    own.chain(others).collect()
}
