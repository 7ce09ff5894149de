//! `coordinator plan`: its schedule, its exit status and the file that it writes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// One of the instances whose optimum another solver proved (`planner/tests/instances/README.md`): one robot
/// runs empty at least, and then 313 units of work are missed.
fn instance() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../planner/tests/instances/6-1-1.json")
}

fn plan(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_coordinator")).current_dir(folder).arg("plan").args(arguments).output().unwrap()
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_schedule_is_printed_and_written_whole_in_place_of_an_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let old = folder.path().join("plan.json");
    std::fs::write(&old, "x".repeat(100_000)).unwrap();
    let made = plan(folder.path(), &[path(&instance()), "--iterations", "20000", "--format", "json", "--output", "plan.json"]);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    assert_eq!(std::fs::read(&old).unwrap(), made.stdout);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no draft is left beside it");
    let schedule: Value = serde_json::from_slice(&made.stdout).unwrap();
    assert_eq!((&schedule["format"], &schedule["objective"][0], &schedule["objective"][1]), (&"mds-sol-1".into(), &1.into(), &313.into()));
    let again = plan(folder.path(), &[path(&instance()), "--iterations", "20000", "--format", "json"]);
    assert_eq!(again.stdout, made.stdout, "seed and moves decide");
}

#[test]
fn what_cannot_be_written_leaves_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let made = plan(folder.path(), &[path(&instance()), "--iterations", "100", "--output", "no/such/plan.json"]);
    assert_eq!(made.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&made.stderr).contains("cannot write no/such/plan.json"), "{made:?}");
    std::fs::create_dir(folder.path().join("plan.json")).unwrap();
    let made = plan(folder.path(), &[path(&instance()), "--iterations", "100", "--output", "plan.json"]);
    assert_eq!(made.status.code(), Some(2));
    assert!(folder.path().join("plan.json").is_dir() && std::fs::read_dir(folder.path()).unwrap().count() == 1);
}

#[test]
fn what_cannot_be_planned_says_why_by_words_and_exit_status() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(instance()).unwrap();
    let mut empty: Value = serde_json::from_str(&text).unwrap();
    for pack in empty["stations"][0]["packs"].as_array_mut().unwrap() {
        pack["remaining"] = 0.into();
    }
    std::fs::write(folder.path().join("empty.json"), empty.to_string()).unwrap();
    std::fs::write(folder.path().join("cut.json"), &text[..text.len() / 2]).unwrap();
    for (arguments, status, words) in [
        (["empty.json", "--policy", "optimise"], 1, "short of that"),
        (["cut.json", "--policy", "optimise"], 2, "cut.json cannot be planned: line"),
        (["gone.json", "--policy", "optimise"], 2, "gone.json"),
        ([path(&instance()), "--policy", "optimize"], 2, "did you mean \"optimise\"?"),
    ] {
        let made = plan(folder.path(), &arguments);
        let said = String::from_utf8_lossy(&made.stderr).into_owned();
        assert!(made.status.code() == Some(status) && said.contains(words) && made.stdout.is_empty(), "{arguments:?}: {made:?}");
    }
}
