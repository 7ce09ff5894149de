//! What is printed when a model is doubted, run as it stands: from the logs of a simulated fleet and from the store that a live one
//! would have kept.

use std::path::Path;
use std::process::Output;

use tests::{program, workspace};

/// What a scenario's run prints with `keep`, the folder or file that its measurements go to.
fn simulate(scenario: &str, run: &str, keep: &str, to: &Path) -> String {
    let mut command = program("coordinator");
    command.args(["simulate", &format!("scenarios/{scenario}.toml"), "--run", run, keep]).arg(to).current_dir(workspace());
    String::from_utf8(command.output().unwrap().stdout).unwrap()
}

/// The command behind a doubt in this model.
fn command(printed: &str, whose: &str) -> Vec<String> {
    let line = printed.lines().find(|line| line.contains(&format!("{whose} no longer explains")));
    let line = line.unwrap_or_else(|| panic!("{whose} is not doubted:\n{printed}"));
    let command = line.rsplit("run `").next().unwrap().trim_end_matches('`');
    shlex::split(command).unwrap()
}

fn answer(command: &[String]) -> Output {
    assert_eq!(command[0], "lab");
    program("lab").args(&command[1..]).current_dir(workspace()).output().unwrap()
}

#[test]
fn the_command_of_a_doubt_runs_as_it_is_printed_and_finds_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("hidden-own-load", "own load unknown", "the load model of mds-1", "robot_own_load"),
        ("hidden-bad-contact", "contacts as new", "the load model of mds-1", "bay_contact"),
        ("hidden-cold-cells", "resistance of 25 degC", "the model of pack-1 of mds-1", "arrhenius"),
        // Nothing tells how many cycles a pack has seen.
        ("aged-pack", "as printed on the pack", "the model of pack-1 of mds-1", "capacity_health and resistance_health"),
    ];
    for (scenario, run, whose, named) in cases {
        let places = [folder.path().join(format!("{scenario} logs")), folder.path().join(format!("{scenario}.db"))];
        for (keep, place) in ["--telemetry", "--store"].into_iter().zip(&places) {
            let command = command(&simulate(scenario, run, keep, place), whose);
            let output = answer(&command);
            let (said, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
            assert_ne!(output.status.code(), Some(2), "{command:?}: {error}");
            assert!(said.lines().next().unwrap_or_default().contains(named), "{command:?}: {said}");
        }
    }
}

#[test]
fn the_load_model_of_a_robot_is_the_one_that_its_agent_names() {
    let folder = tempfile::tempdir().unwrap();
    let printed = simulate("hidden-slope", "level model", "--telemetry", folder.path());
    let command = command(&printed, "the load model of carrier-1 on its ways");
    assert_eq!(command[3], "scenarios/models/carrier-robot-level.toml");
    let said = answer(&command).stdout;
    assert!(String::from_utf8_lossy(&said).starts_with("carrier-robot: missing: slope."), "{}", String::from_utf8_lossy(&said));
}

/// From a promise that a live fleet broke, by the command that it printed meanwhile, to one that it keeps.
#[test]
fn what_a_store_teaches_of_a_worn_pack_keeps_the_next_promise() {
    let folder = tempfile::tempdir().unwrap();
    let (scenario, run) = ("aged-pack", "as printed on the pack");
    let metric = |printed: &str, name: &str| -> f64 {
        let line = printed.lines().find(|line| line.split_whitespace().next() == Some(name)).unwrap_or_else(|| panic!("{name}: {printed}"));
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    };
    let before = simulate(scenario, run, "--store", &folder.path().join("site.db"));
    assert_eq!((metric(&before, "promises_broken"), metric(&before, "robots_served")), (3.0, 0.0));
    let found = folder.path().join("found.toml");
    let mut command = command(&before, "the model of pack-1 of mds-1");
    command.extend(["--output".to_owned(), found.display().to_string()]);
    let output = answer(&command);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let after = simulate(scenario, run, "--model", &found);
    assert_eq!((metric(&after, "promises_broken"), metric(&after, "robots_served")), (0.0, 2.0));
}
