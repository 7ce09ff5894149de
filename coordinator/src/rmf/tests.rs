use std::path::Path;

use energy::Model;

use super::*;
use crate::scenario::Scenario;

/// With the keys and numbers of a small delivery fleet, as the adapters' template has them.
const FLEET: &str = "
rmf_fleet:
  name: \"tinyRobot\"
  limits:
    linear: [0.5, 0.75] # velocity, acceleration
    angular: [0.6, 2.0]
  profile: { footprint: 0.3, vicinity: 0.5 }
  reversible: true
  battery_system: { voltage: 12.0, capacity: 24.0, charging_current: 5.0 }
  mechanical_system: { mass: 20.0, moment_of_inertia: 10.0, friction_coefficient: 0.22 }
  ambient_system: { power: 20.0 }
  tool_system: { power: 0.0 }
  recharge_threshold: 0.10
  recharge_soc: 1.0
  robots:
    tinyRobot1: { charger: \"tinyRobot1_charger\" }
    tinyRobot2: { charger: \"tinyRobot2_charger\" }
fleet_manager: { ip: \"127.0.0.1\" }
";

/// A corridor of three waypoints, 3 m and 4 m long, driven both ways, with a charger at each end.
const GRAPH: &str = "
building_name: corridor
levels:
  L1:
    vertices:
      - [0.0, 0.0, {name: tinyRobot1_charger, is_charger: true}]
      - [3.0, 0.0, {name: ''}]
      - [3.0, 4.0, {name: tinyRobot2_charger, is_charger: true}]
    lanes:
      - [0, 1, {}]
      - [1, 0, {}]
      - [1, 2, {}]
      - [2, 1, {}]
";

const WISHES: Wishes = Wishes { hours: 8.0, driving: 1.0, sigma: 0.1 };

fn fleet() -> Fleet {
    Fleet::parse("fleet.yaml", FLEET).unwrap()
}

fn imported(graph: Option<&str>) -> Import {
    let graph = graph.map(|text| Graph::parse("graph.yaml", text).unwrap());
    import(&fleet(), graph.as_ref(), WISHES).unwrap()
}

fn file<'a>(import: &'a Import, name: &str) -> &'a str {
    &import.files.iter().find(|(file, _)| file == name).unwrap().1
}

#[test]
fn models_are_models_and_a_metre_costs_what_rmf_says() {
    let import = imported(None);
    let model = |name: &str| Model::parse(name, file(&import, name), &|_| unreachable!()).unwrap();
    let [battery, robot, _, _] =
        ["tinyRobot-battery.toml", "tinyRobot-robot.toml", "tinyRobot-grid.toml", "tinyRobot-charger.toml"].map(model);
    assert_eq!((battery.battery().capacity_ah, battery.battery().charge.current_a), (24.0, 5.0));
    // By hand, at 0.5 m/s: 20 W + 0.22 * 20 kg * 9.81 m/s2 * 0.5 m/s = 41.58 W.
    let mission: ::node::mission::Mission = toml::from_str("inputs = { speed_mps = 0.5 }").unwrap();
    let drain_w = mission.drain_w(&std::sync::Arc::new(robot)).unwrap().value;
    assert!((drain_w - 41.58).abs() < 0.02, "{drain_w}");
}

#[test]
fn small_numbers_keep_their_deviations() {
    let small = Fleet::parse("fleet.yaml", &FLEET.replace("friction_coefficient: 0.22", "friction_coefficient: 0.0003")).unwrap();
    let import = import(&small, None, WISHES).unwrap();
    let robot = Model::parse("robot", file(&import, "tinyRobot-robot.toml"), &|_| unreachable!()).unwrap();
    let rolling = robot.parameters().iter().find(|parameter| parameter.value == 0.0003).expect("it is there");
    assert!((rolling.sigma / 3e-5 - 1.0).abs() < 1e-9, "{rolling:?}");
}

#[test]
fn the_scenario_is_a_scenario_with_the_fleets_numbers() {
    for graph in [None, Some(GRAPH)] {
        let import = imported(graph);
        let scenario = Scenario::parse(Path::new("tinyRobot.toml"), file(&import, "tinyRobot.toml")).unwrap();
        let policy = scenario.policy.as_ref().unwrap().get_ref();
        assert_eq!((policy.serve_below_soc, policy.charge_to_soc), (0.1, 1.0));
        let stations: Vec<String> = scenario.station.iter().map(|station| station.get_ref().id.to_string()).collect();
        assert_eq!(stations, ["tinyRobot1_charger", "tinyRobot2_charger"]);
        let robots: Vec<(f64, usize)> =
            scenario.robot.iter().map(|robot| (robot.get_ref().soc.at(0), robot.get_ref().travel_s.len())).collect();
        assert_eq!(robots, [(0.325, usize::from(graph.is_none())), (0.775, usize::from(graph.is_none()))]);
    }
}

#[test]
fn ways_are_the_shortest_along_the_lanes() {
    let graph = Graph::parse("graph.yaml", GRAPH).unwrap();
    assert_eq!(graph.chargers().collect::<Vec<_>>(), ["tinyRobot1_charger", "tinyRobot2_charger"]);
    // By hand: 3 m and 7 m; 4 m and 7 m.
    assert_eq!(graph.distance_m("tinyRobot1_charger").unwrap(), 5.0);
    assert_eq!(graph.distance_m("tinyRobot2_charger").unwrap(), 5.5);
    let scenario = imported(Some(GRAPH));
    assert!(file(&scenario, "tinyRobot.toml").contains("to.tinyRobot1_charger = [{ length_m = 5.00, speed_mps = 0.5 }]"));
    // One way only: nobody comes to the first.
    let one_way = GRAPH.replace("      - [1, 0, {}]\n", "");
    let error = Graph::parse("graph.yaml", &one_way).unwrap().distance_m("tinyRobot1_charger").unwrap_err();
    assert_eq!(error.to_string(), "the navigation graph has no lane that leads to `tinyRobot1_charger`");
}

#[test]
fn a_lift_joins_levels() {
    let two = "
levels:
  L1:
    vertices: [[0, 0, {name: a_charger, is_charger: true}], [5, 0, {lift: lift1}]]
    lanes: [[1, 0, {}]]
  L2:
    vertices: [[5, 0, {lift: lift1}], [5, 7, {name: far}]]
    lanes: [[1, 0, {}]]
";
    // By hand: 5 m from the lift on either level, 12 m from the far end.
    let distance_m = Graph::parse("graph.yaml", two).unwrap().distance_m("a_charger").unwrap();
    assert!((distance_m - 22.0 / 3.0).abs() < 1e-9, "{distance_m}");
}

#[test]
fn older_configurations_have_their_robots_at_the_top() {
    let (above, below) = FLEET.split_once("  robots:").unwrap();
    let manager = below.split_once("fleet_manager").unwrap().1;
    let robots = "robots:\n  tinyRobot1:\n    robot_config: { max_delay: 15.0 }\n    rmf_config:\n      charger: { waypoint: \"tinyRobot1_charger\" }\n";
    let fleet = Fleet::parse("fleet.yaml", &format!("{above}\nfleet_manager{manager}\n{robots}")).unwrap();
    assert_eq!(fleet.robots, [fleet::Robot { name: "tinyRobot1".to_owned(), charger: Some("tinyRobot1_charger".to_owned()) }]);
}

#[test]
fn what_tender_has_no_place_for_is_named_and_so_is_what_rmf_leaves_out() {
    let import = imported(None);
    assert_eq!(import.unused, ["rmf_fleet.profile", "rmf_fleet.reversible", "fleet_manager"]);
    assert!(import.not_modelled.iter().any(|line| line.contains("temperature")));
    assert!(import.assumed.iter().any(|line| line.contains("no navigation graph was given")));
}

#[test]
fn a_wrong_configuration_is_refused_with_the_place_and_what_was_meant() {
    let refused = |from: &str, to: &str| {
        assert!(FLEET.contains(from), "{from}");
        format!("{:#}", Fleet::parse("fleet.yaml", &FLEET.replace(from, to)).unwrap_err())
    };
    let error = refused("battery_system", "battery_sytem");
    assert!(error.starts_with("fleet.yaml: rmf_fleet: no `battery_system`; did you mean `battery_sytem`? There is: "), "{error}");
    assert_eq!(refused("voltage: 12.0", "voltage: twelve"), "fleet.yaml: rmf_fleet.battery_system.voltage: \"twelve\" is not a number");
    assert_eq!(
        refused("voltage: 12.0", "voltage: -12.0"),
        "fleet.yaml: rmf_fleet.battery_system.voltage = -12: must be between 0 and 2000"
    );
    assert_eq!(refused("mass: 20.0", "mass: 0"), "fleet.yaml: rmf_fleet.mechanical_system.mass = 0: must be above 0");
    let error = refused("linear: [0.5, 0.75]", "linear: [0.5]");
    assert_eq!(error, "fleet.yaml: rmf_fleet.limits.linear: must be [velocity, acceleration], has 1 entries");
    assert!(refused("recharge_threshold: 0.10", "recharge_threshold: 1.0").contains("must lie below recharge_soc = 1"));
    let error = refused("rmf_fleet:", "rmf_fleet: [");
    assert!(error.starts_with("fleet.yaml: ") && error.contains("line"), "{error}");
    let wrong = Graph::parse("graph.yaml", GRAPH).unwrap().distance_m("tinyRobot1_chargr").unwrap_err().to_string();
    assert!(wrong.contains("did you mean `tinyRobot1_charger`?"), "{wrong}");
    let charger = "charger: \"tinyRobot2_charger\"";
    assert_eq!(
        refused(charger, "charger: \"\""),
        "fleet.yaml: rmf_fleet.robots.tinyRobot2.charger: must name a waypoint; a robot that may charge anywhere has none"
    );
    assert_eq!(
        refused(charger, "charger: { waypoint: \"\" }"),
        "fleet.yaml: rmf_fleet.robots.tinyRobot2.charger.waypoint: must name a waypoint; a robot that may charge anywhere has none"
    );
    assert_eq!(
        refused("\"tinyRobot\"", "\"tiny\\nRobot\""),
        "fleet.yaml: rmf_fleet.name = \"tiny\\nRobot\": must be one line, without control characters"
    );
    let lane = GRAPH.replace("- [0, 1, {}]", "- [0, 3, {}]");
    let error = Graph::parse("graph.yaml", &lane).unwrap_err().to_string();
    assert_eq!(error, "graph.yaml: levels.L1.lanes[0][1] = 3: must be between 0 and 2");
}

#[test]
fn a_lane_on_a_level_without_vertices_is_refused_wherever_that_level_stands() {
    let graph = |levels: &str| Graph::parse("graph.yaml", &format!("levels:\n{levels}"));
    let [empty, used] = ["{vertices: [], lanes: [[0, 1, {}]]}", "{vertices: [[0, 0, {}]], lanes: []}"];
    for (levels, level) in [(format!("  L1: {empty}\n  L2: {used}\n"), "L1"), (format!("  L1: {used}\n  L2: {empty}\n"), "L2")] {
        let error = graph(&levels).unwrap_err().to_string();
        assert_eq!(error, format!("graph.yaml: levels.{level}.lanes[0]: a lane joins two vertices, and this level has none"));
    }
    assert_eq!(graph(&format!("  L1: {{vertices: [], lanes: []}}\n  L2: {used}\n")).unwrap().chargers().count(), 0);
}

#[test]
fn a_fleet_may_have_any_name_of_one_line() {
    // A character that Rust would show by its number, in words that TOML does not know.
    let fleet = Fleet::parse("fleet.yaml", &FLEET.replace("\"tinyRobot\"", "\"tiny \\\"Robot\\\" \\u200b\"")).unwrap();
    let import = import(&fleet, None, WISHES).unwrap();
    let scenario = Scenario::parse(Path::new(&import.scenario), file(&import, &import.scenario)).unwrap();
    assert_eq!(scenario.name, "tiny \"Robot\" \u{200b} (Open-RMF)");
}
