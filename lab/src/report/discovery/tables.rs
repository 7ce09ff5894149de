//! Tables of a search.

use comfy_table::Table;

use super::{FileErrors, named, perhaps_sigma, refusal};
use crate::decision::Decisions;
use crate::infer::answer::{ByChannel, Discovery, Ranked, Rung, Value};
use crate::report::comparison::chance;
use crate::report::quantity::{digits, quantity, unit_of, with_sigma};
use crate::report::table::{numbers_from, table};

/// Parameters of one effect that are printed, and effects that look like it.
const SIZES: usize = 3;
const NAMES: usize = 2;

/// How the error of one channel fell.
pub(super) fn ladder(rungs: &[Rung], channel: &'static str, bar: impl Fn(f64) -> String) -> Table {
    let unit = unit_of(channel);
    let holdout = rungs.iter().any(|rung| rung.holdout_rms.contains_key(channel));
    let mut header = vec![channel, "RMS", ""];
    if holdout {
        header.extend(["held out", ""]);
    }
    header.push("delta BIC");
    let mut rows = table(&header);
    for rung in rungs {
        let cells = |numbers: &ByChannel| match numbers.get(channel) {
            Some(&rms) => [quantity(rms, unit), bar(rms)],
            None => [String::new(), String::new()],
        };
        let name = rung.effect.map_or_else(|| "the model, refitted".to_owned(), |effect| format!("+ {effect}"));
        let mut row = vec![name];
        row.extend(cells(&rung.train_rms));
        if holdout {
            row.extend(cells(&rung.holdout_rms));
        }
        row.push(rung.delta_bic.map_or_else(String::new, digits));
        rows.add_row(row);
    }
    if let Some(&floor) = rungs.first().and_then(|rung| rung.floor.get(channel)) {
        rows.add_row([floor_name(&rungs[0], channel).to_owned(), quantity(floor, unit)]);
    }
    for column in [1, if holdout { 3 } else { 1 }, header.len() - 1] {
        if let Some(column) = rows.column_mut(column) {
            column.set_cell_alignment(comfy_table::CellAlignment::Right);
        }
    }
    rows
}

/// What the floor of a channel is.
#[must_use]
pub fn floor_name(rung: &Rung, channel: &str) -> &'static str {
    if rung.floor_from_rows.contains(&channel) { "noise from row to row" } else { "sensor floor" }
}

/// What speaks for every effect, most promising first.
pub(super) fn ranking(found: &Discovery, printed: usize) -> Table {
    let holdout = found.ranking.iter().any(|ranked| !ranked.holdout_before.is_empty());
    let mut header = vec!["effect", "delta BIC", "p", "expected size", "unique", "looks like", "RMS"];
    if holdout {
        header.push("held out");
    }
    header.push("refused because");
    let mut rows = table(&header);
    for ranked in found.ranking.iter().take(printed) {
        let mut alike: Vec<(&str, f64)> = ranked.confounded_with.iter().map(|(id, rho)| (*id, *rho)).collect();
        alike.sort_by(|a, b| b.1.total_cmp(&a.1));
        let alike: Vec<String> = alike.iter().take(NAMES).map(|(id, rho)| format!("{id} {rho:.2}")).collect();
        let mut row = vec![
            ranked.effect.to_owned(),
            ranked.delta_bic.map_or_else(|| "-".to_owned(), digits),
            chance(ranked.p_value),
            sizes(ranked),
            format!("{:.2}", ranked.uniqueness),
            alike.join("\n"),
            fall(&ranked.rms_before, &ranked.rms_after),
        ];
        if holdout {
            row.push(fall(&ranked.holdout_before, &ranked.holdout_after));
        }
        row.push(why_not(ranked, found).join("\n"));
        rows.add_row(row);
    }
    rows
}

/// Why an effect was not taken, or was although an error rises.
#[must_use]
pub fn why_not(ranked: &Ranked, found: &Discovery) -> Vec<&'static str> {
    match ranked.delta_bic {
        None => vec!["not worth a refit"],
        Some(_) if ranked.refused.is_empty() && rises(ranked) => vec!["accepted: falls beside slow noise"],
        Some(_) if ranked.passed_over && !found.selected.contains(&ranked.effect) => {
            let taken = found.ranking.iter().filter(|other| found.selected.contains(&other.effect));
            let is_larger = taken.map(|other| other.epc.len()).max().is_some_and(|numbers| ranked.epc.len() > numbers);
            vec![if is_larger { "more numbers than it needs" } else { "another does as well" }]
        }
        Some(_) => ranked.refused.iter().map(|&one| refusal(one)).collect(),
    }
}

/// Whether an error rises that is shown.
fn rises(ranked: &Ranked) -> bool {
    let up =
        |before: &ByChannel, after: &ByChannel| before.iter().all(|(channel, rms)| after.get(channel).is_some_and(|after| after >= rms));
    up(&ranked.rms_before, &ranked.rms_after) || !ranked.holdout_before.is_empty() && up(&ranked.holdout_before, &ranked.holdout_after)
}

fn sizes(ranked: &Ranked) -> String {
    let of = |(name, value): (&&str, &f64)| format!("{name} {}", named(name, *value, ranked.sigma.get(*name).copied()));
    let mut lines: Vec<String> = ranked.epc.iter().take(SIZES).map(of).collect();
    if ranked.epc.len() > SIZES {
        lines.push(format!("and {} more", ranked.epc.len() - SIZES));
    }
    lines.join("\n")
}

/// How a number by channel fell, one line each.
#[must_use]
pub fn fall(before: &ByChannel, after: &ByChannel) -> String {
    let several = before.len() > 1;
    if after.is_empty() {
        return "-".to_owned();
    }
    let line = |(channel, &rms): (&&'static str, &f64)| {
        let unit = unit_of(channel);
        let after = after.get(channel).map_or_else(|| "?".to_owned(), |&rms| quantity(rms, unit));
        let name = if several { format!("{channel} ") } else { String::new() };
        format!("{name}{} -> {after}", quantity(rms, unit))
    };
    before.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Free parameters at the end.
pub(super) fn parameters(found: &Discovery) -> Table {
    let all = found.parameters.iter().flat_map(|(effect, own)| own.iter().map(move |(name, value)| (effect, *name, *value)));
    parameter_table(all.map(|(effect, name, value)| (format!("{effect}.{name}"), name, value)))
}

/// Parameters by their full and their own names, beside what the model had when it was given.
pub(in crate::report) fn parameter_table(parameters: impl Iterator<Item = (String, &'static str, Value)>) -> Table {
    let parameters: Vec<_> = parameters.collect();
    let given = parameters.iter().any(|(_, _, value)| value.given.is_some());
    let ends = parameters.iter().any(|(_, _, value)| value.at_end_of_range);
    let header = [("parameter", true), ("given", given), ("value", true), ("", ends)];
    let shown = |cells: [String; 4]| cells.into_iter().zip(header).filter(|(_, (_, shown))| *shown).map(|(cell, _)| cell);
    let mut rows = table(&header.iter().filter(|(_, shown)| *shown).map(|(name, _)| *name).collect::<Vec<_>>());
    for (full, name, value) in parameters {
        rows.add_row(shown([
            full,
            value.given.map_or_else(|| "new".to_owned(), |given| named(name, given, None)),
            with_sigma(value.value, value.sigma, unit_of(name)),
            if value.at_end_of_range { "at the end of its range" } else { "" }.to_owned(),
        ]));
    }
    numbers_from(&mut rows, 1);
    if let Some(words) = rows.column_mut(2 + usize::from(given)) {
        words.set_cell_alignment(comfy_table::CellAlignment::Left);
    }
    rows
}

/// What the files of two models leave.
pub(in crate::report) fn files(errors: &[FileErrors]) -> Table {
    let mut rows = table(&["channel", "", "model given", "model found", ""]);
    for one in errors {
        let unit = unit_of(one.channel);
        rows.add_row([
            one.channel.to_owned(),
            if one.holdout { "held out" } else { "" }.to_owned(),
            quantity(one.given, unit),
            quantity(one.found, unit),
            if one.is_worse() { "worse" } else { "" }.to_owned(),
        ]);
    }
    for column in [2, 3] {
        if let Some(column) = rows.column_mut(column) {
            column.set_cell_alignment(comfy_table::CellAlignment::Right);
        }
    }
    rows
}

/// What the coordinator plans with, before and after.
#[must_use]
pub fn decisions(decisions: &Decisions) -> Table {
    let mut rows = table(&["", "before", "after", "change"]);
    for row in decisions.rows() {
        let change = (row.after - row.before) / row.before * 100.0;
        rows.add_row([
            row.what,
            perhaps_sigma(row.before, row.before_sigma, &row.unit),
            perhaps_sigma(row.after, row.after_sigma, &row.unit),
            // Rounded first: what is below that is no fall.
            if change.is_finite() { format!("{:+.1} %", (change * 10.0).round() / 10.0 + 0.0) } else { "-".to_owned() },
        ]);
    }
    numbers_from(&mut rows, 1);
    rows
}
