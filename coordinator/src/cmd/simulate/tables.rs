//! What is printed of runs.

use comfy_table::{Cell, CellAlignment};

use super::Finished;
use crate::cmd::{say_text, table, text};
use crate::counted::counted;
use crate::scenario::Scenario;

/// Prints what happened in each run, and all beside each other.
pub(super) fn print(scenario: &Scenario, seed: u64, finished: &[Finished], policy: &[String]) {
    say!("{} (seed {seed})", scenario.name);
    if !scenario.note.is_empty() {
        say!("{}", scenario.note);
    }
    for run in finished {
        say!("\n── {} ──", run.run.name);
        print_capacity(run);
        print_timeline(run);
    }
    say!();
    if !policy.is_empty() {
        print_policies(finished);
        say!();
    }
    print_comparison(finished);
}

/// What policies are compared by: `(heading, metric)`.
const COMPARED: &[(&str, &str)] = &[
    ("robots served", "robots_served"),
    ("services", "services_done"),
    ("stranded", "robots_stranded"),
    ("promises broken", "promises_broken"),
    ("mission hours", "mission_h"),
    ("pack Wh per service", "energy_per_service_wh"),
    ("gap", "plan_gap"),
    ("moved", "services_moved"),
];

fn print_policies(finished: &[Finished]) {
    let mut table = table();
    table.set_header(std::iter::once("policy").chain(COMPARED.iter().map(|(heading, _)| *heading)));
    let measured = |run: &Finished, metric: &str| run.outcome.measured.metrics.get(metric).copied().unwrap_or(f64::NAN);
    let least = finished.iter().map(|run| measured(run, "robots_stranded")).fold(f64::INFINITY, f64::min);
    for run in finished {
        let cell = |metric: &str| {
            let value = measured(run, metric);
            let text = match metric {
                // Whoever serves fewer misses less work with these: that gap stands beside no other.
                "plan_gap" if measured(run, "robots_stranded") > least => "-".to_owned(),
                "plan_gap" => format!("{:.1} %", value * 100.0),
                _ if value.is_nan() => "-".to_owned(),
                _ => number(value),
            };
            Cell::new(text).set_alignment(CellAlignment::Right)
        };
        table.add_row(std::iter::once(Cell::new(&run.run.name)).chain(COMPARED.iter().map(|(_, metric)| cell(metric))));
    }
    say_text(&text(&table));
}

/// Kinds of event that tell the story; the rest is in the trace.
fn tells(kind: proto::EventKind) -> bool {
    use proto::EventKind as K;
    !matches!(kind, K::Joined | K::PhaseChanged | K::CommandSent | K::CommandAccepted)
}

fn print_timeline(run: &Finished) {
    let mut last = String::new();
    for event in run.outcome.events.iter().filter(|event| tells(event.kind)) {
        let minutes = event.at.seconds_since(run.outcome.start) / 60.0;
        let text = format!("{:<16} {}", event.kind.to_string(), event.text);
        if text != last {
            say!("{minutes:>7.1} min  {text}");
        }
        last = text;
    }
}

fn print_capacity(run: &Finished) {
    let Some(capacity) = &run.outcome.measured.first_capacity else { return };
    for pack in &capacity.packs {
        let causes: Vec<String> = pack.breakdown_wh.iter().map(|(cause, wh)| format!("{cause} {wh:.1}")).collect();
        say!(
            "    promise  {} of {} holds {:.1} ± {:.1} Wh usable, a service takes {:.1} ± {:.1} Wh ({}): {} at {:.0} %",
            pack.pack,
            pack.station,
            pack.usable_wh.value,
            pack.usable_wh.sigma,
            pack.service_wh.value,
            pack.service_wh.sigma,
            causes.join(", "),
            counted(pack.robots_promised as usize, "robot"),
            pack.confidence * 100.0
        );
    }
    for station in capacity.stations.iter().filter(|station| capacity.packs_at(&station.station).count() > 1) {
        say!(
            "    promise  {} with all its packs holds {:.1} ± {:.1} Wh usable: {} at {:.0} %",
            station.station,
            station.usable_wh.value,
            station.usable_wh.sigma,
            counted(station.robots_promised as usize, "robot"),
            capacity.confidence * 100.0
        );
    }
}

fn print_comparison(finished: &[Finished]) {
    let mut table = table();
    let names = finished.iter().map(|run| Cell::new(&run.run.name).set_alignment(CellAlignment::Right));
    table.set_header(std::iter::once(Cell::new("")).chain(names));
    let metrics: Vec<&String> = finished.first().map_or_else(Vec::new, |run| run.outcome.measured.metrics.keys().collect());
    for metric in metrics {
        let values = finished.iter().map(|run| {
            let value = run.outcome.measured.metrics.get(metric).copied().unwrap_or(f64::NAN);
            let verdict = run.verdicts.iter().find(|verdict| verdict.metric == *metric);
            let mark = verdict.map_or(String::new(), |v| if v.holds() { " ✓".to_owned() } else { format!(" ✗ expected {}", v.expected) });
            Cell::new(format!("{}{mark}", number(value))).set_alignment(CellAlignment::Right)
        });
        table.add_row(std::iter::once(Cell::new(metric)).chain(values));
    }
    say_text(&text(&table));
    let (held, all) = finished.iter().flat_map(|run| &run.verdicts).fold((0, 0), |(held, all), v| (held + usize::from(v.holds()), all + 1));
    if all > 0 {
        say!("[expect]: {held} of {all} hold");
    }
    let others: Vec<&str> = finished.iter().filter(|run| run.run.is_other).map(|run| run.run.name.as_str()).collect();
    if !others.is_empty() {
        say!("[expect] says nothing of other policies than the scenario's: {}", others.join("; "));
    }
}

fn number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e9 { format!("{value:.0}") } else { format!("{value:.3}") }
}
