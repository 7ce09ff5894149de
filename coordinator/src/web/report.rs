//! What runs of a scenario came to, as one file that shows what the dashboard shows.

use std::collections::BTreeMap;

use proto::RobotId;
use serde::Serialize;

use super::assets;
use super::desk::Books;
use super::past::{Past, Series};
use super::view::{RobotDetail, View, Wanted};
use crate::scenario::Verdict;
use crate::sim::Outcome;

/// A report.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Name of the scenario.
    pub title: String,
    /// What it is about.
    pub note: String,
    /// The seed.
    pub seed: u64,
    /// The program that made it.
    pub version: &'static str,
    /// Its runs.
    pub runs: Vec<Run>,
}

/// One run.
#[derive(Debug, Serialize)]
pub struct Run {
    /// Its name.
    pub name: String,
    /// The page as it stood at the end.
    pub view: View,
    /// Each robot in full.
    pub robots: BTreeMap<RobotId, RobotDetail>,
    /// Energy of each pack over time, Wh, by `station pack`.
    pub packs: BTreeMap<String, Series>,
    /// What was measured.
    pub metrics: Vec<MetricRow>,
}

/// What runs came to, for a page that shows how the last of them looked at its end.
#[derive(Debug, Clone, Serialize)]
pub struct Ended {
    /// What the scenario is about.
    pub note: String,
    /// Its runs.
    pub runs: Vec<Measured>,
}

/// What was measured in one run.
#[derive(Debug, Clone, Serialize)]
pub struct Measured {
    /// Its name.
    pub name: String,
    /// What was measured.
    pub metrics: Vec<MetricRow>,
}

impl Measured {
    /// What was measured in a run, and what was expected of it.
    #[must_use]
    pub fn new(name: &str, outcome: &Outcome, verdicts: &[Verdict]) -> Self {
        Self { name: name.to_owned(), metrics: metrics(outcome, verdicts) }
    }
}

/// One metric.
#[derive(Debug, Clone, Serialize)]
pub struct MetricRow {
    /// Its name.
    pub metric: String,
    /// Its value.
    pub value: f64,
    /// That as text.
    pub text: String,
    /// What was expected of it; none when nothing was.
    pub expected: Option<String>,
    /// Whether it came so.
    pub holds: Option<bool>,
}

impl Run {
    /// What came of a run, from its core at the end and what was seen of it.
    #[must_use]
    pub fn new(name: &str, outcome: &Outcome, past: &Past, verdicts: &[Verdict]) -> Self {
        let core = &outcome.core;
        let site = outcome.site.clone();
        let wanted = Wanted { rows: usize::MAX, ..Wanted::default() };
        let view = View::new(outcome.end, core, Books { site: &site, title: name, ended: None, past, store: None, ladder: None }, &wanted);
        let known = core.fleet().robots.keys();
        let robots = known.filter_map(|id| Some((id.clone(), View::robot(outcome.end, core, past, id).ok()?))).collect();
        let packs = past.packs.iter().map(|((station, pack), series)| (format!("{station} {pack}"), series.clone())).collect();
        Self { name: name.to_owned(), view, robots, packs, metrics: metrics(outcome, verdicts) }
    }
}

fn metrics(outcome: &Outcome, verdicts: &[Verdict]) -> Vec<MetricRow> {
    let metric = |(metric, &value): (&String, &f64)| {
        let verdict = verdicts.iter().find(|verdict| verdict.metric == *metric);
        let text = if value.fract() == 0.0 { format!("{value:.0}") } else { format!("{value:.3}") };
        MetricRow {
            metric: metric.clone(),
            value,
            text,
            expected: verdict.map(|verdict| verdict.expected.to_string()),
            holds: verdict.map(Verdict::holds),
        }
    };
    outcome.measured.metrics.iter().map(metric).collect()
}

impl Report {
    /// The file.
    #[must_use]
    pub fn html(&self) -> String {
        assets::whole_page(&serde_json::to_string(self).expect("a report has text keys"))
    }
}
