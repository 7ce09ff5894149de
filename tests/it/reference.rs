//! Reference pages that are generated: they say what the programs say. `TENDER_UPDATE_DOCS=1` writes
//! them anew.

use std::fmt::Write as _;

use coordinator::scenario::Scenario;
use coordinator::store::Standing;
use coordinator::web::{Past, metrics};
use tests::{program, workspace};

/// Compares a page with what it should be, or writes it.
fn page(name: &str, wanted: &str) {
    let path = workspace().join("docs/reference").join(name);
    if std::env::var_os("TENDER_UPDATE_DOCS").is_some() {
        node::files::write_text(&path, wanted).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == wanted, "{name} is not what the programs say: run TENDER_UPDATE_DOCS=1 cargo test -p tests reference");
}

/// The help of a command and of those below it.
fn help(program_name: &'static str, commands: &[String], text: &mut String) {
    // Settings of whoever runs the tests are no part of the page.
    let asked = program(program_name).args(commands).arg("--help").env_remove("TENDER_LOG_FORMAT").env_remove("TENDER_CONFIG").output();
    let said = String::from_utf8(asked.unwrap().stdout).unwrap();
    let depth = "#".repeat(2 + commands.len());
    let name = [&[program_name.to_owned()], commands].concat().join(" ");
    let lines: Vec<&str> = said.lines().map(str::trim_end).collect();
    writeln!(text, "{depth} `{name}`\n\n```text\n{}\n```\n", lines.join("\n").trim_end()).unwrap();
    let below = lines.iter().skip_while(|line| **line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    for line in below.filter(|line| line.starts_with("  ") && !line.starts_with("   ")) {
        let command = line.split_whitespace().next().unwrap();
        if command != "help" {
            help(program_name, &[commands, &[command.to_owned()]].concat(), text);
        }
    }
}

#[test]
fn the_page_of_commands_is_their_help() {
    let mut text =
        "# Commands\n\nGenerated from the programs' own help; `lab` stands in [lab/README.md](../../lab/README.md).\n\n".to_owned();
    for name in ["coordinator", "robot-agent", "station-agent"] {
        help(name, &[], &mut text);
    }
    page("commands.md", &(text.trim_end().to_owned() + "\n"));
}

/// Metrics of a simulated fleet after ten minutes.
fn sheet() -> String {
    let path = workspace().join("tests/fixtures/short-fleet.toml");
    let scenario = Scenario::parse(&path, &node::files::read_text(&path).unwrap()).unwrap();
    let deployment = scenario.deploy(&scenario.runs()[0], 1).unwrap();
    let mut past = Past::default();
    let mut watch = |step: coordinator::sim::Step<'_>| step.news.iter().for_each(|event| past.event(event));
    let outcome = coordinator::sim::simulate(&deployment, 600.0, 25.0, coordinator::models::Kept::Nowhere, &mut watch).unwrap();
    metrics::text(outcome.end, &outcome.core, &past, Some(&Standing::default()))
}

#[test]
fn the_page_of_metrics_is_what_is_served() {
    let mut text =
        "# Metrics\n\nGenerated from what `/metrics` serves. Where a label `kind` is `value` or `sigma`, a number comes with its\n\
        standard deviation. Units are base units, as Prometheus wants them: energy is in joules (1 Wh = 3600 J).\n\n\
        | metric | type | labels | meaning |\n| --- | --- | --- | --- |\n"
            .to_owned();
    let sheet = sheet();
    for line in sheet.lines().filter_map(|line| line.strip_prefix("# HELP ")) {
        let (name, meaning) = line.split_once(' ').unwrap();
        let kind = sheet.lines().find_map(|line| line.strip_prefix(&format!("# TYPE {name} "))).unwrap();
        let sample = sheet.lines().find(|line| line.starts_with(&format!("{name}{{"))).unwrap_or_default();
        let labels: Vec<String> =
            sample.split(['{', ',', '}']).filter_map(|part| Some(format!("`{}`", part.split_once("=\"")?.0))).collect();
        writeln!(text, "| `{name}` | {kind} | {} | {meaning} |", labels.join(", ")).unwrap();
    }
    page("metrics.md", &text);
}

/// The conventions of Prometheus (naming of metrics and labels), and their own checker where it is.
#[test]
fn metrics_are_named_by_the_conventions() {
    let sheet = sheet();
    let mut names = 0;
    for line in sheet.lines().filter_map(|line| line.strip_prefix("# HELP ")) {
        let (name, meaning) = line.split_once(' ').unwrap();
        names += 1;
        assert!(name.starts_with("tender_") && name.bytes().all(|b| b.is_ascii_lowercase() || b == b'_'), "{name}");
        assert!(meaning.len() > 10 && meaning.ends_with('.'), "{name}: {meaning}");
        let counter = sheet.contains(&format!("# TYPE {name} counter"));
        assert_eq!(counter, name.ends_with("_total"), "{name}: _total is for counters, and all counters");
        for unit in ["_wh", "_ms", "_minutes", "_hours", "_percent", "_soc", "_watt_hours"] {
            assert!(!name.ends_with(unit), "{name}: not a base unit");
        }
    }
    assert!(names > 10, "{names} metrics");
    let checked = std::process::Command::new("promtool")
        .args(["check", "metrics"])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn();
    let Ok(mut checked) = checked else {
        eprintln!("skipped in part: promtool is not installed");
        return;
    };
    std::io::Write::write_all(&mut checked.stdin.take().unwrap(), sheet.as_bytes()).unwrap();
    let said = checked.wait_with_output().unwrap();
    assert!(said.status.success(), "{}{}", String::from_utf8_lossy(&said.stdout), String::from_utf8_lossy(&said.stderr));
}
