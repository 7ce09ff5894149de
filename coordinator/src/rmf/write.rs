//! Writes a fleet of Open-RMF as a scenario and the models that it names, with where each number came
//! from, what had to be assumed, and what RMF does not model.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use anyhow::{Context, ensure};
use energy::units::S_PER_H;
use proto::{RobotId, StationId};
use serde::Serialize;

use super::fleet::Robot;
use super::{Fleet, Graph};

/// What RMF does not say and the user may.
#[derive(Debug, Clone, Copy)]
pub struct Wishes {
    /// Simulated time, h.
    pub hours: f64,
    /// Share of its working time that a robot drives.
    pub driving: f64,
    /// How far the numbers of power may be off, a robot's and a charger's: a standard deviation over the number.
    pub sigma: f64,
}

/// A fleet, imported.
#[derive(Debug, Clone, Serialize)]
pub struct Import {
    /// Name of the scenario file; the first of `files`.
    pub scenario: String,
    /// Files by name, with their content.
    #[serde(skip)]
    pub files: Vec<(String, String)>,
    /// What became of the configuration's numbers.
    pub taken: Vec<String>,
    /// What the configuration does not say and was assumed.
    pub assumed: Vec<String>,
    /// What RMF's models leave out and ours have a place for.
    pub not_modelled: Vec<String>,
    /// Keys of the configuration that Tender has no place for.
    pub unused: Vec<String>,
}

/// RMF's battery has one voltage; the curve that stands for it runs this share below and above it, so
/// that the energy is the same and both ends are ends.
const VOLTAGE_SHARE: f64 = 0.01;
/// Voltage of a cell, V, by which a battery is divided into cells: lithium-ion's. Nothing but the way it
/// is written hangs on it.
const CELL_V: f64 = 3.7;
/// A grid's pack holds what its charger gives in a month without a pause, h, so that what is told of its
/// energy does not hang on how long is simulated.
const GRID_H: f64 = 720.0;
/// In a longer run it holds this many times what its charger can give in all of it.
const GRID_TIMES: f64 = 2.0;
/// The way to a charger that nothing is known of, s.
const UNKNOWN_WAY_S: f64 = 60.0;
/// Charge ends at this share of the charger's current: without resistance it is there at once.
const CUTOFF_SHARE: f64 = 0.05;

/// What RMF's energy models leave out.
const NOT_MODELLED: [&str; 7] = [
    "how a battery's voltage falls with its charge and its load (one nominal voltage): effects ohmic, rc, ...; `lab fit` calibrates them",
    "temperature and age of batteries",
    "losses of drive and converters: a robot's power is mechanical power plus two constants",
    "charging that tapers off towards full, and the charger's efficiency",
    "what a charger takes its energy from: stations here have a pack that stands for the grid",
    "docking and undocking times, and who may charge first: here load_s = unload_s = 0 and a planner",
    "how sure any of its numbers is: none has a deviation",
];

/// A station: a charger and the way to it.
struct Station {
    id: StationId,
    waypoint: String,
    way_m: f64,
}

/// Makes a scenario of a fleet; `graph` knows its chargers and ways.
///
/// # Errors
/// When a name cannot be an id, or a robot's charger is not in the graph.
pub fn import(fleet: &Fleet, graph: Option<&Graph>, wishes: Wishes) -> anyhow::Result<Import> {
    ensure!((0.01..=8760.0).contains(&wishes.hours), "--hours {}: must be between 0.01 and 8760", wishes.hours);
    ensure!((0.0..=1.0).contains(&wishes.driving), "--driving {}: must be between 0 and 1", wishes.driving);
    ensure!((0.0..=1.0).contains(&wishes.sigma), "--sigma {}: must be between 0 and 1", wishes.sigma);
    let stem = id_like(&fleet.name);
    let stations = stations(fleet, graph)?;
    let mut import = Import {
        scenario: format!("{stem}.toml"),
        files: Vec::new(),
        taken: taken(fleet),
        assumed: assumed(fleet, graph, wishes),
        not_modelled: NOT_MODELLED.map(str::to_owned).to_vec(),
        unused: fleet.unused.clone(),
    };
    let scenario = scenario(fleet, &stem, &stations, graph, wishes, &import)?;
    import.files = vec![
        (import.scenario.clone(), scenario),
        (format!("{stem}-battery.toml"), battery(fleet, &stem)),
        (format!("{stem}-robot.toml"), robot(fleet, &stem, wishes)),
        (format!("{stem}-grid.toml"), grid(fleet, &stem, wishes)),
        (format!("{stem}-charger.toml"), charger(fleet, &stem, wishes)),
    ];
    Ok(import)
}

/// A name as ids are written: other characters become `-`.
fn id_like(name: &str) -> String {
    let text: String = name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' }).take(48).collect();
    let text = text.trim_start_matches(['-', '_']);
    if text.is_empty() { "fleet".to_owned() } else { text.to_owned() }
}

/// One station for each charger: those that robots name and those of the graph.
fn stations(fleet: &Fleet, graph: Option<&Graph>) -> anyhow::Result<Vec<Station>> {
    let named = fleet.robots.iter().filter_map(|robot| robot.charger.as_deref());
    let waypoints: BTreeSet<&str> = named.chain(graph.into_iter().flat_map(Graph::chargers)).filter(|name| !name.is_empty()).collect();
    ensure!(
        !waypoints.is_empty(),
        "fleet {}: neither a robot names its charger nor does a navigation graph have one: give the graph with --graph",
        fleet.name
    );
    let mut stations: Vec<Station> = Vec::new();
    for waypoint in waypoints {
        let id = StationId::new(id_like(waypoint)).with_context(|| format!("charger `{waypoint}`"))?;
        ensure!(
            stations.iter().all(|other| other.id != id),
            "chargers `{waypoint}` and another one both become the station {id}: rename one"
        );
        let way_m = graph.map_or(Ok(0.0), |graph| graph.distance_m(waypoint))?;
        stations.push(Station { id, waypoint: waypoint.to_owned(), way_m });
    }
    Ok(stations)
}

fn taken(fleet: &Fleet) -> Vec<String> {
    let Fleet { voltage_v, capacity_ah, charging_current_a, mass_kg, friction_coefficient, ambient_w, linear, angular, .. } = fleet;
    vec![
        format!("battery_system: {voltage_v} V, {capacity_ah} Ah, charged with {charging_current_a} A: the battery model"),
        format!("mechanical_system: {mass_kg} kg, friction {friction_coefficient}: effects rolling and acceleration of the robot model"),
        format!("ambient_system: {ambient_w} W: effect idle of the robot model"),
        format!("limits: {} m/s, {} m/s2, {} rad/s: work and ways", linear[0], linear[1], angular[0]),
        format!("recharge_threshold {}: policy.serve_below_soc", fleet.recharge_threshold),
        format!("recharge_soc {}: policy.charge_to_soc", fleet.recharge_soc),
    ]
}

fn assumed(fleet: &Fleet, graph: Option<&Graph>, wishes: Wishes) -> Vec<String> {
    let mut assumed = vec![
        format!(
            "where each robot's charge begins: evenly between {} and {}, so that not all come at once",
            fleet.recharge_threshold, fleet.recharge_soc
        ),
        format!("what robots do: they drive {} % of their time at {} m/s (--driving)", wishes.driving * 100.0, fleet.linear[0]),
    ];
    assumed.push(format!(
        "how far powers may be off: each number of a robot's and its charger's efficiency by {} % (--sigma)",
        wishes.sigma * 100.0
    ));
    match graph {
        Some(_) => assumed.push("where robots work: anywhere; the way to a charger is the mean over all waypoints of the graph".to_owned()),
        None => assumed.push("the ways to the chargers: a minute, since no navigation graph was given (--graph)".to_owned()),
    }
    if fleet.tool_w > 0.0 {
        assumed
            .push(format!("when the tool runs: always at work; its {} W are in the effect idle (RMF: in tasks that use it)", fleet.tool_w));
    }
    if fleet.moment_of_inertia_kgm2 > 0.0 {
        assumed.push(format!(
            "moment_of_inertia: the {} kg m2 cost nothing here; RMF counts I |alpha omega| while a robot begins and ends to turn",
            fleet.moment_of_inertia_kgm2
        ));
    }
    assumed.push("braking costs nothing; RMF counts it like speeding up".to_owned());
    assumed
}

/// Numbers with where they come from, as a model's parameters are written. RMF's robots may be heavier
/// than those that the effects were made for.
fn parameter(name: &str, value: f64, key: &str, wishes: Wishes) -> String {
    let (most, sigma) = ((2.0 * value).max(1.0), wishes.sigma * value);
    format!("{name} = {{ value = {value:?}, sigma = {sigma:?}, min = 0.0, max = {most:?}, source = \"Open-RMF, {key}\" }}\n")
}

fn battery(fleet: &Fleet, stem: &str) -> String {
    format!(
        "# The battery of the Open-RMF fleet {}: one voltage and a capacity. The curve runs 1 % about the\n\
         # nominal voltage, so that it holds the same energy and that its ends are ends.\n\
         schema = 1\nsystem = \"battery\"\nname = \"{stem}-battery\"\nsource = \"Open-RMF, battery_system\"\n\n{}",
        fleet.name,
        facts(fleet, fleet.capacity_ah)
    )
}

/// `[battery]` of a pack with the fleet's voltage and charge current.
fn facts(fleet: &Fleet, capacity_ah: f64) -> String {
    let series = (fleet.voltage_v / CELL_V).round().max(1.0);
    let cell_v = fleet.voltage_v / series;
    let [low_v, high_v] = [1.0 - VOLTAGE_SHARE, 1.0 + VOLTAGE_SHARE].map(|share| cell_v * share);
    let charge_a = fleet.charging_current_a;
    format!(
        "[battery]\nseries = {series}\nparallel = 1\ncapacity_ah = {capacity_ah:?}\n\
         full_v_per_cell = {high_v:.6}\neod_v_per_cell = {low_v:.6}\n\
         charge_current_a = {charge_a:?}\ncharge_cutoff_a = {:?}\n\
         ocv = {{ soc = [0.0, 1.0], voltage_v = [{low_v:.6}, {high_v:.6}] }}\n",
        CUTOFF_SHARE * charge_a
    )
}

fn robot(fleet: &Fleet, stem: &str, wishes: Wishes) -> String {
    let idle = parameter("idle_w", fleet.ambient_w + fleet.tool_w, "ambient_system and tool_system", wishes);
    let rolling = parameter("rolling_coefficient", fleet.friction_coefficient, "mechanical_system.friction_coefficient", wishes);
    let mass = parameter("mass_kg", fleet.mass_kg, "mechanical_system.mass", wishes);
    format!(
        "# A robot of the Open-RMF fleet {}, with the terms of its SimpleMotionPowerSink and SimpleDevicePowerSink.\n\
         schema = 1\nsystem = \"robot\"\nname = \"{stem}-robot\"\nsource = \"Open-RMF, mechanical_system, ambient_system, tool_system\"\n\n\
         [[effect]]\nid = \"idle\"\n{idle}\n[[effect]]\nid = \"rolling\"\n{rolling}{mass}\n[[effect]]\nid = \"acceleration\"\n{mass}",
        fleet.name
    )
}

/// A charger. That it loses nothing is RMF's word, and no better known than its other numbers.
fn charger(fleet: &Fleet, stem: &str, wishes: Wishes) -> String {
    format!(
        "# A charger of the Open-RMF fleet {}: it loses nothing and takes nothing for itself.\n\
         schema = 1\nsystem = \"station\"\nname = \"{stem}-charger\"\nsource = \"Open-RMF models no loss\"\n\n\
         [[effect]]\nid = \"charger_efficiency\"\n\
         efficiency = {{ value = 1.0, sigma = {:?}, source = \"Open-RMF models no loss\" }}\n",
        fleet.name, wishes.sigma
    )
}

/// The grid behind a charger, as a pack that cannot give out.
fn grid(fleet: &Fleet, stem: &str, wishes: Wishes) -> String {
    let hours = GRID_H.max(GRID_TIMES * wishes.hours);
    let capacity_ah = (fleet.charging_current_a * hours).max(fleet.capacity_ah);
    format!(
        "# What an Open-RMF charger takes its energy from is not modelled there: a pack of what the charger gives\n\
         # in {hours} h. Put your station's packs in its place to see how many robots they can serve.\n\
         schema = 1\nsystem = \"battery\"\nname = \"{stem}-grid\"\nsource = \"stands for the grid\"\n\n{}",
        facts(fleet, capacity_ah)
    )
}

fn scenario(
    fleet: &Fleet,
    stem: &str,
    stations: &[Station],
    graph: Option<&Graph>,
    wishes: Wishes,
    import: &Import,
) -> anyhow::Result<String> {
    let mut text = format!("# The Open-RMF fleet {}, imported. Every key is explained in scenarios/default.toml.\n", fleet.name);
    for (title, lines) in [("Assumed", &import.assumed), ("Not modelled by RMF", &import.not_modelled)] {
        let _ = writeln!(text, "#\n# {title}:");
        lines.iter().for_each(|line| {
            let _ = writeln!(text, "#   - {line}");
        });
    }
    let _ = write!(
        text,
        "schema = 1\nname = {}\nnote = \"Imported from Open-RMF.\"\nduration_s = {:?}\n\n\
         [policy]\nserve_below_soc = {:?}\ncharge_to_soc = {:?}\n",
        toml::Value::String(format!("{} (Open-RMF)", fleet.name)),
        wishes.hours * S_PER_H,
        fleet.recharge_threshold,
        fleet.recharge_soc
    );
    for Station { id, waypoint, .. } in stations {
        let _ = write!(
            text,
            "\n# Charger {waypoint:?}.\n[[station]]\nid = \"{id}\"\nload = \"{stem}-charger.toml\"\nbays = 1\nload_s = 0\nunload_s = 0\n\
             packs = [{{ id = \"grid\", battery = \"{stem}-grid.toml\", soc = 1.0 }}]\n"
        );
    }
    let mut ids: BTreeMap<RobotId, &str> = BTreeMap::new();
    for (index, robot) in fleet.robots.iter().enumerate() {
        let id = RobotId::new(id_like(&robot.name)).with_context(|| format!("robot `{}`", robot.name))?;
        if let Some(other) = ids.insert(id.clone(), &robot.name) {
            anyhow::bail!("robots `{other}` and `{}` both become {id}: rename one", robot.name);
        }
        let share = (index as f64 + 0.5) / fleet.robots.len() as f64;
        let soc = fleet.recharge_threshold + share * (fleet.recharge_soc - fleet.recharge_threshold);
        let _ =
            write!(text, "\n[[robot]]\nid = \"{id}\"\nbattery = \"{stem}-battery.toml\"\nload = \"{stem}-robot.toml\"\nsoc = {soc:.4}\n");
        ways(&mut text, fleet, robot, stations, graph);
        work(&mut text, fleet, wishes);
    }
    Ok(text)
}

/// The ways of a robot: to its own charger where it has one, else to all.
fn ways(text: &mut String, fleet: &Fleet, robot: &Robot, stations: &[Station], graph: Option<&Graph>) {
    let own = |station: &&Station| robot.charger.as_ref().is_none_or(|charger| *charger == station.waypoint);
    let mine = stations.iter().filter(own);
    if graph.is_none() {
        let travel: Vec<String> = mine.map(|station| format!("{} = {UNKNOWN_WAY_S}", station.id)).collect();
        let _ = writeln!(text, "travel_s = {{ {} }}", travel.join(", "));
        return;
    }
    let _ = write!(text, "travel_s = {{}}\n\n[robot.way]\naccel_mps2 = {:?}\nyaw_rate_radps = {:?}\n", fleet.linear[1], fleet.angular[0]);
    for station in mine {
        let _ = writeln!(text, "to.{} = [{{ length_m = {:.2}, speed_mps = {:?} }}]", station.id, station.way_m, fleet.linear[0]);
    }
}

/// What a robot does at work: it drives, and stands, minute by minute.
fn work(text: &mut String, fleet: &Fleet, wishes: Wishes) {
    const MINUTE_S: f64 = 60.0;
    let drives = format!("speed_mps = {:?}", fleet.linear[0]);
    let Wishes { driving, .. } = wishes;
    if driving >= 1.0 {
        let _ = write!(text, "\n[robot.mission]\ninputs = {{ {drives} }}\n");
    } else if driving <= 0.0 {
        let _ = write!(text, "\n[robot.mission]\ninputs = {{ speed_mps = 0.0 }}\n");
    } else {
        let (drive_s, stand_s) = (MINUTE_S * driving, MINUTE_S * (1.0 - driving));
        let _ = write!(
            text,
            "\n[robot.mission]\nprofile = [{{ for_s = {drive_s:?}, inputs = {{ {drives} }} }}, {{ for_s = {stand_s:?}, inputs = {{ speed_mps = 0.0 }} }}]\n"
        );
    }
}
