use std::path::Path;

use crate::Config;

/// A station of two packs that the kernel shows, with a line more under `[source]` and other lines after it.
fn refused(source: &str, after: &str) -> String {
    let text = format!(
        r#"
schema = 1
id = "s-1"
site = "site"
bays = ["bay-1"]
packs = [{{ id = "p-1", battery = "mds-3s4p-7600mah" }}, {{ id = "p-2", battery = "mds-3s4p-7600mah" }}]
spares = [{{ id = "spare-1", soc = 0.9 }}]
[source]
kind = "measured"
{source}
{after}
"#
    );
    let config: Config = toml::from_str(&text).unwrap();
    config.check().map_or_else(|error| format!("{error:#}"), |()| String::new())
}

const BOTH: &str = "packs.p-1 = { kind = \"power_supply\", device = \"BAT0\" }\npacks.p-2 = { kind = \"sbs\", bus = \"/dev/i2c-1\" }";
const OPERATE: &str = "operate = [\"operate-station\"]";

#[test]
fn what_a_real_station_lacks_is_told_by_its_key() {
    let good = format!("{OPERATE}\n{BOTH}");
    assert_eq!(refused(&good, ""), "");
    assert_eq!(refused(BOTH, ""), "source.operate: the station has spares, and no program to exchange them");
    assert_eq!(refused(&format!("operate = [\"\"]\n{BOTH}"), ""), "source.operate: its first entry is a program");
    let drives = "source.drives: the station drives, and operate names no program that says where it is";
    assert_eq!(refused(&format!("drives = true\n{BOTH}"), ""), drives);
    let one = "packs.p-1 = { kind = \"power_supply\" }";
    assert_eq!(refused(&format!("{OPERATE}\n{one}"), ""), "source.packs: nothing measures pack p-2");
    let more = "[source.packs.p-3]\nkind = \"replay\"\nfile = \"x.csv\"";
    assert!(refused(&good, more).starts_with("source.packs: there is no pack p-3; did you mean `p-"), "{}", refused(&good, more));
    let other = "[source.spares.spare-9]\nkind = \"power_supply\"";
    assert_eq!(refused(&good, other), "source.spares: there is no spare spare-9; did you mean `spare-1`?");
    let sbs = "packs.p-1 = { kind = \"sbs\", bus = \"b\", address = 3 }\npacks.p-2 = { kind = \"power_supply\" }";
    assert_eq!(refused(&format!("{OPERATE}\n{sbs}"), ""), "source.packs.p-1.address = 3: must be between 8 (0x08) and 119 (0x77)");
    assert_eq!(refused(&format!("ready_soc = 2\n{good}"), ""), "source.ready_soc = 2: must be between 0 and 1");
    assert_eq!(refused(&format!("soc_sigma = 0\n{good}"), ""), "source.soc_sigma = 0: must be between 0.0001 and 0.5");
    let voltages = format!("leave_below_v = 11\ntake_above_v = 10\n{good}");
    assert!(refused(&voltages, "").starts_with("source.take_above_v = 10 lies below leave_below_v = 11: "));
}

#[test]
fn a_spare_that_is_measured_is_not_handed_out_for_what_is_written_on_it() {
    let text = r#"
schema = 1
id = "s-1"
site = "site"
bays = []
packs = []
spares = [{ id = "spare-1", soc = 0.9 }, { id = "spare-2", soc = 0.9 }]
[source]
kind = "measured"
packs = {}
spares.spare-1 = { kind = "power_supply" }
"#;
    let config: Config = toml::from_str(text).unwrap();
    let spares = config.profile(node::UNTIL_EMPTY, "measured").spares;
    assert_eq!(spares.iter().map(|spare| spare.ready).collect::<Vec<_>>(), [false, true]);
}

#[test]
fn a_device_that_is_not_there_is_told_with_the_pack_that_it_should_measure() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"
schema = 1
id = "s-1"
site = "site"
bays = []
packs = [{ id = "p-1", battery = "mds-3s4p-7600mah" }]
[source]
kind = "measured"
packs.p-1 = { kind = "replay", file = "none.csv" }
"#;
    let config: Config = toml::from_str(text).unwrap();
    let error = config.build(Some(&folder.path().join("station.toml"))).err().unwrap();
    let error = format!("{error:#}");
    assert!(error.starts_with("source.packs.p-1: cannot read") && error.contains("none.csv"), "{error}");
    // The body of a simulated station is another thing.
    let error = config.build_simulated(Some(Path::new("station.toml"))).err().unwrap().to_string();
    assert_eq!(error, "station s-1 has no simulated body");
}
