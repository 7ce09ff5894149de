//! `coordinator simulate`: exit codes and what it says about mistakes.

use std::path::Path;

use super::{SMALL, coordinator, simulate};

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("small.toml"), SMALL).unwrap();
    folder
}

/// Replaces `old` by `new` in the small scenario and gives the exit code and stderr.
fn changed(folder: &Path, old: &str, new: &str) -> (i32, String) {
    assert!(SMALL.contains(old), "{old}");
    std::fs::write(folder.join("changed.toml"), SMALL.replace(old, new)).unwrap();
    let answer = simulate(folder, &["changed.toml"]);
    assert!(answer.code == 0 || answer.code == 1 || answer.stdout.is_empty(), "{}", answer.stdout);
    (answer.code, answer.stderr)
}

#[test]
fn as_expected_is_exit_0_and_not_as_expected_is_exit_1() {
    let folder = folder();
    let answer = simulate(folder.path(), &["small.toml"]);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    assert!(answer.stdout.contains("[expect]: 1 of 1 hold"), "{}", answer.stdout);
    std::fs::write(folder.path().join("one.toml"), SMALL.replace("robots_served = 0", "robots_served = 1")).unwrap();
    let answer = simulate(folder.path(), &["one.toml"]);
    assert_eq!(answer.code, 1);
    assert!(answer.stdout.contains("✗ expected 1") && answer.stdout.contains("[expect]: 0 of 1 hold"), "{}", answer.stdout);
    let answer = simulate(folder.path(), &["one.toml", "--format", "json", "--seed", "7"]);
    assert_eq!(answer.code, 1);
    let json: serde_json::Value = serde_json::from_str(&answer.stdout).unwrap();
    assert_eq!((&json["seed"], &json["runs"][0]["expect"][0]["holds"]), (&7.into(), &false.into()));
}

#[test]
fn what_cannot_be_read_is_exit_2() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(folder.path().join("empty.toml"), "").unwrap();
    std::fs::write(folder.path().join("bytes.toml"), [0xff, 0xfe, 0x00]).unwrap();
    for (file, said) in [
        ("missing.toml", "cannot read missing.toml"),
        ("sub", "cannot read sub"),
        ("empty.toml", "empty.toml:1:1: missing field `schema`"),
        ("bytes.toml", "bytes.toml"),
    ] {
        let answer = simulate(folder.path(), &[file]);
        assert_eq!((answer.code, answer.stdout.as_str()), (2, ""), "{file}: {}", answer.stderr);
        assert!(answer.stderr.contains(said), "{file}: {}", answer.stderr);
    }
}

/// What is replaced in the small scenario, by what, and what must be said about it.
const MISTAKES: &[(&str, &str, &[&str])] = &[
    ("duration_s = 5", "duraton_s = 5", &["changed.toml:3:1: unknown field `duraton_s`", "did you mean `duration_s`?"]),
    ("schema = 1", "schema = 2", &["changed.toml:1:10: schema = 2", "reads schema = 1"]),
    ("duration_s = 5", "duration_s = -5", &["changed.toml:3:14: duration_s = -5: must be above 0"]),
    ("duration_s = 5", "duration_s = nan", &["changed.toml:3:14: duration_s = NaN"]),
    ("duration_s = 5", "duration_s = \"5\"", &["changed.toml:3:14: "]),
    ("soc = 0.5", "soc = 1.5", &["changed.toml:18:1: robot explorer: soc = 1.5: must be between 0 and 1"]),
    ("soc = 0.5", "soc = nan", &["changed.toml:18:1: robot explorer: soc = NaN: must be between 0 and 1"]),
    ("soc = 0.5", "soc = [0.5]", &["robot explorer: soc has 1 numbers for 2 robots"]),
    ("soc = 1.0 }", "soc = -0.1 }", &["station mds-1: pack pack-1: soc = -0.1: must be between 0 and 1"]),
    ("travel_s.mds-1", "travel_s.mds-2", &["unknown station mds-2", "did you mean `mds-1`?"]),
    ("load_s = 30\nunload_s", "load_s = inf\nunload_s", &["station mds-1: load_s = inf: must be between 0 and 31536000"]),
    (
        "[[run]]",
        "[[robot]]\nid = \"explorer-1\"\nbattery = \"explorer-3s1p-1320mah\"\nload = \"explorer-robot\"\nsoc = 0.5\ntravel_s = {}\n[[run]]",
        &["changed.toml:20:1: robot explorer-1 appears twice"],
    ),
    ("id = \"mds-1\"", "id = \"a/b\"", &["changed.toml:7:6: `a/b` is not a station id", "A-Z a-z 0-9 _ -"]),
    ("id = \"explorer\"", "id = \"a/b\"", &["changed.toml:13:1: `a/b-1` is not a robot id"]),
    ("count = 2", "count = 0", &["robot explorer: count = 0: must be between 1 and 100000"]),
    (
        "explorer-3s1p-1320mah",
        "explorer-3s1p-1320ma",
        &["changed.toml:16:1: robot explorer: battery: no model `explorer-3s1p-1320ma`", "did you mean `explorer-3s1p-1320mah`?"],
    ),
    (
        "load = \"mds-station\"",
        "load = \"explorer-robot\"",
        &["changed.toml:8:1: station mds-1: load = \"explorer-robot\": it is the model of a robot, not of a station"],
    ),
    ("[\"lift\"]", "[\"lft\"]", &["has no effect `lft`; it has robot_own_load, charger_efficiency"]),
    ("{ \"mds-station\" = [\"lift\"] }", "{ \"mds-staton\" = [\"lift\"] }", &["`mds-staton`", "did you mean `mds-station`?"]),
    ("robots_served = 0", "robots_serve = 0", &["changed.toml:24:1: `robots_serve` is not measured", "did you mean `robots_served`?"]),
    ("robots_served = 0", "soc.pack-2 = 0", &["changed.toml:24:1: "]),
    ("robots_served = 0", "\"soc.pack-2\" = 0", &["there is no pack pack-2", "did you mean `pack-1`?"]),
    (
        "unload_s = 30",
        "unload_s = 30\ncharging = { spare_ready_soc = 0.2 }",
        &["stations.mds-1.charging.spare_ready_soc = 0.2: must lie above policy.serve_below_soc = 0.2"],
    ),
    ("\"least_slack\"", "\"least_slak\"", &["changed.toml:4:1: policy.name = \"least_slak\"", "did you mean `least_slack`?"]),
];

#[test]
fn every_mistake_in_a_scenario_is_exit_2_and_says_what_is_allowed() {
    let folder = folder();
    for (old, new, said) in MISTAKES {
        let (code, stderr) = changed(folder.path(), old, new);
        assert_eq!(code, 2, "{new}: {stderr}");
        for part in *said {
            assert!(stderr.contains(part), "{new}: {part:?} is not in: {stderr}");
        }
        assert!(!stderr.contains("panicked"), "{new}: {stderr}");
    }
}

#[test]
fn a_run_or_model_that_is_not_there_is_exit_2() {
    let folder = folder();
    std::fs::write(folder.path().join("syntax.toml"), "x = = 1\n").unwrap();
    let pack = energy::built_in("mds-3s4p-7600mah").unwrap();
    std::fs::write(folder.path().join("negative.toml"), pack.replace("capacity_ah = 7.6", "capacity_ah = -7.6")).unwrap();
    let table = "enertech-lco-2280mah-ocv.csv";
    std::fs::write(folder.path().join(table), energy::built_in(table).unwrap()).unwrap();
    for (option, value, said) in [
        ("--run", "plane", "there is no such run; did you mean `plain`?"),
        ("--model", "syntax.toml", "syntax.toml:1:5: "),
        ("--model", "negative.toml", "capacity_ah = -7.6: must be between"),
        ("--model", "mds-staton", "did you mean `mds-station`?"),
        ("--seed", "none", "invalid value 'none'"),
    ] {
        let answer = simulate(folder.path(), &["small.toml", option, value]);
        assert_eq!((answer.code, answer.stdout.as_str()), (2, ""), "{option} {value}: {}", answer.stderr);
        assert!(answer.stderr.contains(said), "{option} {value}: {}", answer.stderr);
    }
}

#[test]
fn out_writes_trace_and_schedule_and_leaves_nothing_half_written() {
    let folder = folder();
    let answer = simulate(folder.path(), &["small.toml", "--out", "new/out"]);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    let names = |at: &Path| {
        let mut names: Vec<String> = std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    assert_eq!(names(&folder.path().join("new/out")), ["report.html", "schedule.json", "trace.txt"]);
    let trace = std::fs::read_to_string(folder.path().join("new/out/trace.txt")).unwrap();
    assert!(trace.contains("plan_made") && trace.ends_with('\n'), "{trace}");
    let schedule = std::fs::read_to_string(folder.path().join("new/out/schedule.json")).unwrap();
    serde_json::from_str::<serde_json::Value>(&schedule).unwrap();

    let before = names(folder.path());
    for option in ["--out", "--telemetry"] {
        for place in ["small.toml", "small.toml/below"] {
            let answer = simulate(folder.path(), &["small.toml", option, place]);
            assert_eq!((answer.code, answer.stdout.as_str()), (2, ""), "{option} {place}: nothing is simulated before");
            assert!(answer.stderr.contains("cannot make small.toml"), "{}", answer.stderr);
        }
    }
    assert_eq!(names(folder.path()), before);
    assert_eq!(std::fs::read_to_string(folder.path().join("small.toml")).unwrap(), SMALL);
}

#[test]
fn a_model_that_is_given_stands_in_for_what_a_run_believes_in_too() {
    let folder = folder();
    let pack = energy::built_in("mds-3s4p-7600mah").unwrap();
    let table = "enertech-lco-2280mah-ocv.csv";
    std::fs::write(folder.path().join(table), energy::built_in(table).unwrap()).unwrap();
    let of_capacity = |file: &str, name: &str, capacity_ah: &str| {
        let text = pack.replace("name = \"mds-3s4p-7600mah\"", &format!("name = \"{name}\"")).replace("capacity_ah = 7.6", capacity_ah);
        assert!(text.contains(name) && text.contains(capacity_ah));
        std::fs::write(folder.path().join(file), text).unwrap();
    };
    of_capacity("aged.toml", "pack-as-it-is", "capacity_ah = 5.0");
    of_capacity("half.toml", "mds-3s4p-7600mah", "capacity_ah = 3.8");
    of_capacity("quarter.toml", "pack-as-it-is", "capacity_ah = 1.9");
    let runs = "\n[[run]]\nname = \"new\"\n[[run]]\nname = \"aged\"\nbelieved.replace = { \"mds-3s4p-7600mah\" = \"aged.toml\" }\n";
    let (begin, _) = SMALL.split_once("[[run]]").unwrap_or((SMALL, ""));
    std::fs::write(folder.path().join("runs.toml"), begin.to_owned() + runs).unwrap();
    let usable_wh = |more: &[&str]| -> Vec<f64> {
        let answer = simulate(folder.path(), &[&["runs.toml", "--format", "json"], more].concat());
        assert!(answer.code < 2, "{}", answer.stderr);
        let json: serde_json::Value = serde_json::from_str(&answer.stdout).unwrap();
        let of = |run: &serde_json::Value| run["first_capacity"]["packs"][0]["usable_wh"]["value"].as_f64().unwrap();
        json["runs"].as_array().unwrap().iter().map(of).collect()
    };
    let given = usable_wh(&[]);
    assert!(given[1] < 0.8 * given[0], "{given:?}");
    // In the place of the scenario's: a run that believes in another one goes on to do so, which is said.
    let half = usable_wh(&["--model", "half.toml"]);
    assert!(half[0] < 0.6 * given[0] && half[1] == given[1], "{half:?}");
    let told = simulate(folder.path(), &["runs.toml", "--model", "half.toml"]).stderr;
    assert!(told.contains("run \"aged\" goes on to believe in aged.toml in its place"), "{told}");
    // In the place of what one run believes in: the other believes what it did.
    let quarter = usable_wh(&["--model", "quarter.toml"]);
    assert!(quarter[0] == given[0] && quarter[1] < 0.5 * given[1], "{quarter:?}");
}

#[test]
fn a_simulated_store_answers_like_a_live_one() {
    let folder = folder();
    let answer = simulate(folder.path(), &["small.toml", "--store", "run.db"]);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    let asked = |arguments: &[&str]| coordinator(folder.path(), &[&["schedule", "--store", "run.db"], arguments].concat());
    for (question, said) in [
        (&["show"][..], "by least_slack"),
        (&["capacity"], "pack-1 of mds-1: 1 at > 99 % ("),
        (&["explain", "explorer-2"], "; the packs hold it with probability > 99.9 %"),
        (&["history"], "plan_made"),
    ] {
        let answer = asked(question);
        assert_eq!(answer.code, 0, "{question:?}: {}", answer.stderr);
        assert!(answer.stdout.contains(said), "{question:?}: {}", answer.stdout);
    }
    let answer = asked(&["explain", "explorer-3"]);
    assert_eq!(answer.code, 2, "{}", answer.stdout);
    assert!(
        answer.stderr.contains("did you mean `explorer-") && answer.stderr.contains("Known: explorer-1, explorer-2"),
        "{}",
        answer.stderr
    );
    // It is the store of one new run, or none.
    for (arguments, said) in [
        (&["small.toml", "--store", "run.db"][..], "--store run.db: it is there already"),
        (&["small.toml", "--store", "two.db", "--policy", "optimise,threshold"], "this makes 2: choose one"),
        (&["small.toml", "--policy", "optimise,optimise"], "`optimise` is named twice"),
    ] {
        let answer = simulate(folder.path(), arguments);
        assert_eq!((answer.code, answer.stdout.as_str()), (2, ""), "{arguments:?}");
        assert!(answer.stderr.contains(said), "{arguments:?}: {}", answer.stderr);
    }
    let answer = simulate(folder.path(), &["small.toml", "--store", "none/run.db"]);
    assert_eq!((answer.code, answer.stdout.as_str()), (2, ""), "{}", answer.stderr);
    assert!(answer.stderr.contains("--store none/run.db: there is no folder"), "{}", answer.stderr);
    assert!(!folder.path().join("two.db").exists() && !folder.path().join("none").exists());
}

#[test]
fn a_scenario_expects_nothing_of_other_policies_than_its_own() {
    let folder = folder();
    std::fs::write(folder.path().join("one.toml"), SMALL.replace("robots_served = 0", "robots_served = 1")).unwrap();
    assert_eq!(simulate(folder.path(), &["one.toml", "--policy", "optimise,threshold"]).code, 0);
    let answer = simulate(folder.path(), &["one.toml", "--policy", "optimise,least_slack"]);
    assert_eq!(answer.code, 1, "{}", answer.stdout);
    assert!(answer.stdout.contains("[expect]: 0 of 1 hold\n[expect] says nothing of other policies"), "{}", answer.stdout);
}
