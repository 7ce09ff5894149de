//! The house keeps itself tidy.

use std::path::{Path, PathBuf};
use std::process::Command;

use tests::workspace;

/// Every Rust file of the workspace, without what was built.
fn rust_files() -> Vec<PathBuf> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("a readable folder").flatten() {
            let path = entry.path();
            let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.') || name == "target");
            if path.is_dir() && !hidden {
                walk(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    walk(&workspace(), &mut found);
    found.sort();
    found
}

/// `cargo fmt` does not see modules that a macro declares, such as the effects.
#[test]
fn every_file_is_formatted() {
    let files = rust_files();
    assert!(files.len() > 100, "{} files", files.len());
    let checked = Command::new("rustfmt").args(["--check", "--edition", "2024", "--config-path"]).arg(workspace()).args(&files).output();
    let checked = checked.expect("rustfmt comes with the toolchain");
    assert!(checked.status.success(), "run rustfmt on these:\n{}", String::from_utf8_lossy(&checked.stdout));
}

#[test]
fn no_file_has_taken_in_a_second_subject() {
    for file in rust_files() {
        let lines = std::fs::read_to_string(&file).expect("a text").lines().count();
        assert!(lines <= 400, "{} has {lines} lines: which second subject moved in?", file.display());
    }
}

/// The pure halves reach neither clock nor disk nor network, and draw no random numbers; the planner's search draws them from its seed.
#[test]
fn cores_are_pure() {
    let pure = [
        "energy/src",
        "planner/src",
        "proto/src",
        "coordinator/src/core.rs",
        "coordinator/src/core/",
        "coordinator/src/fleet.rs",
        "coordinator/src/trust.rs",
        "coordinator/src/clocks.rs",
        "coordinator/src/refusals.rs",
        "coordinator/src/view.rs",
        "coordinator/src/view",
        "coordinator/src/watch",
        "coordinator/src/forecast.rs",
        "coordinator/src/scheduler",
        "coordinator/src/service_run.rs",
        "coordinator/src/outbox.rs",
        "coordinator/src/replay.rs",
        "robot-agent/src/agent",
        "station-agent/src/agent",
        "node/src/ledger.rs",
        "node/src/silence.rs",
    ];
    for file in rust_files() {
        let inside = file.strip_prefix(workspace()).expect("inside the workspace").to_string_lossy().into_owned();
        if !pure.iter().any(|part| inside.starts_with(part)) {
            continue;
        }
        let text = std::fs::read_to_string(&file).expect("a text");
        // What stands before tests in the same file: `mod tests;` may stand anywhere.
        let code = text.split("mod tests {").next().unwrap_or_default();
        for banned in ["std::fs", "std::net", "std::time", "tokio::", "zenoh::", "sqlx::", "std::env", "println!"] {
            assert!(!code.contains(banned), "{inside} uses {banned}");
        }
        // Whole words: a strand of cells is none of them.
        let mut words = code.split(|c: char| !c.is_alphanumeric() && c != '_');
        let drawn = words.find(|word| ["rand", "rand_distr", "rand_pcg"].contains(word));
        assert!(drawn.is_none() || inside.starts_with("planner/src"), "{inside} uses {}", drawn.unwrap_or_default());
    }
}
