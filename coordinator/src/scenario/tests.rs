//! `scenarios/default.toml` names every key of the format. What the keys are is asked from serde:
//! a table with an unknown key is refused with the list of known ones.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use toml::{Table, Value};

use super::expect::Range;
use super::*;
use crate::config::PolicyConfig;

const DEFAULT: &str = include_str!("../../../scenarios/default.toml");
const UNKNOWN: &str = "zzzzzzzz";

fn parse(text: &str) -> Result<Scenario, String> {
    Scenario::parse(Path::new("default.toml"), text).map_err(|error| error.to_string())
}

/// Where a value lies in the file: keys, and indices of lists.
#[derive(Debug, Clone)]
enum Step {
    Key(String),
    Index(usize),
}

fn tables(value: &Value, at: &[Step], found: &mut Vec<Vec<Step>>) {
    let deeper = |step: Step| [at, &[step]].concat();
    match value {
        Value::Table(table) => {
            found.push(at.to_vec());
            table.iter().for_each(|(key, value)| tables(value, &deeper(Step::Key(key.clone())), found));
        }
        Value::Array(values) => {
            values.iter().enumerate().for_each(|(index, value)| tables(value, &deeper(Step::Index(index)), found));
        }
        _ => {}
    }
}

fn table_at<'a>(root: &'a mut Value, at: &[Step]) -> &'a mut Table {
    let value = at.iter().fold(root, |value, step| match step {
        Step::Key(key) => &mut value.as_table_mut().unwrap()[key.as_str()],
        Step::Index(index) => &mut value.as_array_mut().unwrap()[*index],
    });
    value.as_table_mut().unwrap()
}

/// Known keys of the table in which serde found the unknown one; none when any key may stand there.
fn known_keys(error: &str) -> Option<BTreeSet<String>> {
    let (_, expected) = error.split_once(&format!("unknown field `{UNKNOWN}`, expected "))?;
    Some(expected.split('`').skip(1).step_by(2).map(str::to_owned).collect())
}

/// Keys of the format that a file does not use, by the table that could hold them, and how many
/// tables have known keys. Of several tables at one place (robots, legs) one that uses a key is enough.
fn unused_keys(text: &str) -> (BTreeMap<String, Vec<String>>, usize) {
    let root: Value = toml::from_str(text).map(Value::Table).unwrap();
    let mut places = Vec::new();
    tables(&root, &[], &mut places);
    let (mut unused, mut structs): (BTreeMap<String, BTreeSet<String>>, usize) = (BTreeMap::new(), 0);
    for place in places {
        let mut changed = root.clone();
        let table = table_at(&mut changed, &place);
        let present: BTreeSet<String> = table.keys().cloned().collect();
        table.insert(UNKNOWN.to_owned(), Value::Boolean(true));
        let error = parse(&toml::to_string(&changed).unwrap()).expect_err("an unknown key or a wrong value");
        let Some(known) = known_keys(&error).or_else(|| keys_of_a_range(&error, &present)) else { continue };
        structs += 1;
        let lacking: BTreeSet<String> = known.difference(&present).cloned().collect();
        let keys: Vec<&str> = place.iter().filter_map(|step| if let Step::Key(key) = step { Some(key.as_str()) } else { None }).collect();
        let still = unused.entry(keys.join(".")).or_insert_with(|| lacking.clone());
        still.retain(|key| lacking.contains(key));
    }
    unused.retain(|_, lacking| !lacking.is_empty());
    (unused.into_iter().map(|(place, lacking)| (place, lacking.into_iter().collect())).collect(), structs)
}

/// The error of an untagged enum hides which of its variants came near, so the range is asked
/// itself.
fn keys_of_a_range(error: &str, present: &BTreeSet<String>) -> Option<BTreeSet<String>> {
    let error = error.contains("untagged enum Expectation").then(|| toml::from_str::<Range>(&format!("{UNKNOWN} = true")))?;
    let known = known_keys(&error.unwrap_err().to_string())?;
    // Not [expect] itself, whose keys are metrics.
    (!present.is_empty() && present.is_subset(&known)).then_some(known)
}

#[test]
fn default_toml_names_every_key_of_the_format() {
    parse(DEFAULT).unwrap();
    let (unused, structs) = unused_keys(DEFAULT);
    assert!(unused.is_empty(), "scenarios/default.toml lacks {unused:#?}");
    // The file, policy, publish, three changes, station, pack, two ages, spare, charging, selector, robot, mission,
    // run, range; depot, vehicle and its three legs; a second pack; a second robot with charger, radio, way, piece, mission, leg.
    assert_eq!(structs, 30, "has serde's message changed, or is a new table missing here?");
}

#[test]
fn a_key_that_default_toml_would_lack_is_found() {
    for line in
        ["seed = 1", "resend_s = 5", "state_period_s = 10", "swap_s = 60", "recharge_w = 0", "count = 2", "weight = 1.0", "min = 20"]
    {
        let key = line.split(' ').next().unwrap();
        let mut without = DEFAULT.replace(&format!("\n{line}\n"), "\n");
        if key == "count" {
            without = without.replace("soc = [0.22, 0.25]", "soc = 0.2").replace("[60, 120]", "60");
        }
        let found: Vec<String> = unused_keys(&without).0.into_values().flatten().collect();
        assert_eq!(found, [key]);
    }
}

#[test]
fn every_line_of_default_toml_that_sets_something_has_a_comment_before_it() {
    let mut before = "";
    for (number, line) in DEFAULT.lines().enumerate() {
        let sets = !line.is_empty() && !line.starts_with('#');
        assert!(!sets || before.starts_with('#'), "default.toml:{}: `{line}` has no comment before it", number + 1);
        before = line;
    }
}

#[test]
fn every_metric_is_explained_in_default_toml() {
    for (metric, _) in METRICS {
        assert!(DEFAULT.contains(&format!("#   {metric}")), "{metric}");
    }
}

#[test]
fn values_in_default_toml_are_the_defaults() {
    let written = parse(DEFAULT).unwrap();
    let least = parse("schema = 1\nname = \"least\"\nduration_s = 1\n").unwrap();
    assert_eq!(*written.policy.as_ref().unwrap().get_ref(), PolicyConfig::default());
    assert_eq!(written.publish, least.publish);
    assert_eq!((&written.site, written.seed, written.temperature_degc), (&least.site, least.seed, least.temperature_degc));
    assert_eq!((&written.world, &written.believed), (&least.world, &least.believed));
    assert_eq!(written.robot[0].get_ref().mission, node::mission::Mission::default());
    assert_eq!(written.robot[0].get_ref().gauge, energy::gauge::Kind::default());
    assert_eq!(written.station[0].get_ref().packs[0].gauge, energy::gauge::Kind::default());
    let station = "schema = 1\nname = \"s\"\nduration_s = 1\n[[station]]\nid = \"s\"\nload = \"mds-station\"\nbays = 1\nload_s = 1\nunload_s = 1\npacks = [{ id = \"p\", battery = \"mds-3s4p-7600mah\", soc = 1.0 }]\n";
    let least = parse(station).unwrap();
    assert_eq!(written.station[0].get_ref().swap_s, least.station[0].get_ref().swap_s);
    assert!(least.station[0].get_ref().spares.is_empty());
    assert_eq!(least.station[0].get_ref().charging, node::Charging::default());
    assert_eq!(written.station[0].get_ref().charging.recharge_w, 0.0);
}

#[test]
fn expectations_that_nothing_can_meet_are_refused() {
    let with = |expect: &str| parse(&format!("schema = 1\nname = \"e\"\nduration_s = 1\n[expect]\n{expect}\n")).unwrap_err();
    assert!(with("swaps = nan").contains("swaps: NaN is no expectation"), "{}", with("swaps = nan"));
    assert!(with("swaps = { min = nan }").contains("swaps: NaN is no expectation"));
    assert!(with("swaps = { min = 2, max = 1 }").contains("swaps: min = 2 lies above max = 1"));
}

#[test]
fn runs_that_would_write_into_one_folder_are_refused() {
    for (first, second) in [("a", "a"), ("a b", "a-b"), ("a", "")] {
        let text = format!("schema = 1\nname = \"r\"\nduration_s = 1\n[[run]]\nname = \"{first}\"\n[[run]]\nname = \"{second}\"\n");
        let error = parse(&text).unwrap_err();
        assert!(error.contains(&format!(":6:1: run \"{second}\": a run needs a name")), "{error}");
    }
}

#[test]
fn a_hidden_effect_is_left_out_of_every_belief_and_of_no_truth() {
    let text = DEFAULT.replace(
        "[run.believed]\n# As in [believed]. Default {}.\nwithout = {}",
        "[run.believed]\nwithout = { \"mds-station\" = [\"lift\"] }",
    );
    let scenario = parse(&text).unwrap();
    let deployment = scenario.deploy(&scenario.runs()[0], 1).unwrap();
    let believed = deployment.coordinator.load(None).unwrap().1.stations.into_values().next().unwrap().load;
    assert!(believed.effects().all(|effect| effect.spec().id != "lift"));
    let station_agent::SourceConfig::Sim { load, .. } = &deployment.stations[0].source else { panic!("simulated") };
    assert!(load.load(None).unwrap().effects().any(|effect| effect.spec().id == "lift"));
}

#[test]
fn mistakes_in_the_physics_of_a_fleet_are_named_with_their_line_and_what_is_allowed() {
    let with = |old: &str, new: &str| {
        assert!(DEFAULT.contains(old), "{old}");
        parse(&DEFAULT.replace(old, new)).unwrap_err()
    };
    for (old, new, said) in [
        ("\nbelow_soc = 0.1\n", "\nbelow_soc = 1.5\n", "station mds-1: depot.below_soc = 1.5: must be between 0 and 1"),
        ("\nat_once = 1\n", "\nat_once = 0\n", "station mds-1: depot.at_once = 0"),
        ("\noverlap_s = 0\n", "\noverlap_s = 0.1\n", "change = \"make_before_break\" has"),
        ("\"break_before_make\"\n#", "\"brake_before_make\"\n#", "unknown variant `brake_before_make`"),
        ("\nfor_s = 20\n", "\nfor_s = 0\n", "station mds-1: vehicle.profile[0].for_s = 0: must be above 0"),
        ("{ speed_mps = 0.3, floor_class", "{ sped_mps = 0.3, floor_class", "mission.profile[0].inputs.sped_mps: unknown channel"),
        (
            "\nsensitivity_dbm = -85\n",
            "\nsensitivity_dbm = -850\n",
            "robot scout: radio.sensitivity_dbm = -850: must be between -200 and 100",
        ),
        ("[[robot.way.to.mds-1]]", "[[robot.way.to.mds-2]]", "robot scout: way.to names the unknown station mds-2"),
        ("\ntravel_s = {}\n", "\ntravel_s = { mds-1 = 60 }\n", "way.to.mds-1: travel_s.mds-1 is given too"),
        ("path = \"direct\"", "path = \"both\"", "unknown variant `both`, expected `direct` or `selected`"),
    ] {
        let error = with(old, new);
        assert!(error.contains(said) && error.contains("default.toml:"), "{error}");
    }
}

#[test]
fn a_power_path_that_the_stations_load_does_not_have_is_refused() {
    let text = DEFAULT.replace("path = \"direct\"", "path = \"selected\"");
    let scenario = parse(&text).unwrap();
    let error = scenario.deploy(&scenario.runs()[0], 1).unwrap_err().to_string();
    assert!(error.contains("has the effect `robot_own_load`, but this path wants `path_selection`"), "{error}");
}

#[test]
fn a_mistake_is_told_with_the_line_of_its_key() {
    let text = "schema = 1\nname = \"n\"\nduration_s = 60\n\n[[station]]\nid = \"s\"\nload = \"mds-station\"\nbays = 1\nload_s = 30\nunload_s = 30\n\
                packs = [\n  { id = \"p1\", battery = \"mds-3s4p-7600mah\", soc = 1.0 },\n  { id = \"p2\", battery = \"mds-3s4p-7600mah\", soc = 0.9 },\n]\n\n\
                [[robot]]\nid = \"r\"\ncount = 2\nbattery = \"explorer-3s1p-1320mah\"\nload = \"explorer-robot\"\nsoc = [0.5, 0.8]\n\
                travel_s.s = 60\nmission.inputs = { speed_mps = 0.1 }\n";
    assert!(parse(text).is_ok());
    for (old, new, said) in [
        ("soc = [0.5, 0.8]", "soc = [50, 80]", "default.toml:21:1: robot r: soc = 50: must be between 0 and 1"),
        ("travel_s.s = 60", "travel_s.s = -1", "default.toml:22:10: robot r: travel_s.s = -1"),
        ("travel_s.s = 60", "travel_s.t = 60", "default.toml:22:1: robot r: travel_s names the unknown station t"),
        ("\"explorer-robot\"", "\"explorer-robo\"", "default.toml:20:1: robot r: load: no model `explorer-robo`"),
        ("soc = 0.9", "soc = 9", "default.toml:13:46: station s: pack p2: soc = 9"),
        ("unload_s = 30", "unload_s = -3", "default.toml:10:1: station s: unload_s = -3"),
        // What is no matter of one key is told of the whole entry.
        ("id = \"p2\"", "id = \"p1\"", "default.toml:5:1: station s: pack p1 appears twice"),
    ] {
        let error = parse(&text.replace(old, new)).unwrap_err();
        assert!(error.starts_with(said), "{error}");
    }
}
