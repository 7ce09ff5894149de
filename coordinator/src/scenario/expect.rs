//! What is measured in a run, and what is expected of it.

use std::collections::BTreeMap;
use std::fmt;

use energy::document::hint;
use serde::Deserialize;

/// What can be expected, with its meaning. A name that ends in a dot goes before a pack's name.
pub const METRICS: &[(&str, &str)] = &[
    ("services_promised", "services in the first plan"),
    ("robots_promised", "robots that all packs of each station can service at the first plan, at the policy's confidence"),
    ("robots_served", "robots whose service was completed"),
    ("promises_broken", "robots whose last promise was broken, though they may have had a service before"),
    ("robots_stranded", "robots that ran empty outside a bay"),
    ("robots_browned_out", "robots that stood still because a rail could not deliver, though their packs were not empty"),
    ("robots_shut_in", "robots in the bays of stations that have no power in the end: no lift lets them out"),
    ("out_of_reach_h", "hours that robots spent out of their radios' reach, all robots"),
    ("packs_depleted", "station packs that gave out"),
    ("pack_switches", "times that the selector changed the active pack"),
    ("swaps", "robots whose pack was exchanged"),
    ("models_doubted", "times that a model ceased to explain what was measured"),
    ("services_done", "services that were completed; a robot may have several"),
    ("services_moved", "promised services that a later plan moved or took away, over all plans"),
    ("plan_gap", "how far the plans' missed work was proven to be from the least at most, as a share of it, on average"),
    ("energy_per_service_wh", "energy drawn from all station packs, for each service, Wh"),
    ("depot_exchanges", "station packs that were exchanged at a depot"),
    ("drive_energy_wh", "energy that stations took to drive, Wh"),
    ("path_selection_saves_wh", "energy that station packs are or would be spared by robots that select their power path, Wh"),
    ("pack_energy_wh", "energy drawn from all station packs, Wh"),
    ("mission_h", "hours that robots spent at work, all robots"),
    ("soc.", "true state of charge of that pack at the end (STATION.PACK when there are several stations)"),
    ("soc_after_services.", "the same when the last service was done"),
];

/// A number, or a range of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Expectation {
    /// Exactly this.
    Exactly(f64),
    /// Between these, ends included.
    Between(Range),
}

/// A range; an end that is not given is open.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Least.
    #[serde(default)]
    pub min: Option<f64>,
    /// Most.
    #[serde(default)]
    pub max: Option<f64>,
}

impl Expectation {
    /// Whether a measured value is as expected.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        match self {
            Expectation::Exactly(expected) => (value - expected).abs() < 1e-9,
            Expectation::Between(Range { min, max }) => min.is_none_or(|min| value >= min) && max.is_none_or(|max| value <= max),
        }
    }
}

impl fmt::Display for Expectation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Expectation::Exactly(value) => write!(f, "{value}"),
            Expectation::Between(Range { min: Some(min), max: Some(max) }) => write!(f, "{min} to {max}"),
            Expectation::Between(Range { min: Some(min), max: None }) => write!(f, ">= {min}"),
            Expectation::Between(Range { min: None, max: Some(max) }) => write!(f, "<= {max}"),
            Expectation::Between(Range { min: None, max: None }) => write!(f, "anything"),
        }
    }
}

/// An expectation and what came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// What was measured.
    pub metric: String,
    /// What was expected.
    pub expected: Expectation,
    /// The value; none when the run does not measure it.
    pub measured: Option<f64>,
}

impl Verdict {
    /// Whether it came as expected.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.measured.is_some_and(|value| self.expected.holds(value))
    }
}

/// Compares measurements with expectations.
pub(super) fn verdicts<'a>(expected: impl Iterator<Item = (&'a str, &'a Expectation)>, measured: &BTreeMap<String, f64>) -> Vec<Verdict> {
    expected
        .map(|(metric, expected)| Verdict { metric: metric.to_owned(), expected: *expected, measured: measured.get(metric).copied() })
        .collect()
}

/// Checks that a metric exists and that its range is one.
pub(super) fn check(metric: &str, expectation: &Expectation, packs: &[&str]) -> Result<(), String> {
    let of_pack = METRICS.iter().filter(|(name, _)| name.ends_with('.')).find_map(|(name, _)| metric.strip_prefix(name));
    match of_pack {
        Some(pack) if !packs.contains(&pack) => {
            return Err(format!("{metric}: there is no pack {pack}{} Known: {}", hint(pack, packs.iter().copied()), packs.join(", ")));
        }
        None if !METRICS.iter().any(|(name, _)| *name == metric) => {
            let names = || METRICS.iter().map(|(name, _)| *name);
            return Err(format!("`{metric}` is not measured{} Known: {}", hint(metric, names()), names().collect::<Vec<_>>().join(", ")));
        }
        _ => {}
    }
    let bounds = match *expectation {
        Expectation::Exactly(value) => [Some(value), None],
        Expectation::Between(Range { min, max }) => [min, max],
    };
    if bounds.iter().flatten().any(|bound| bound.is_nan()) {
        return Err(format!("{metric}: NaN is no expectation: nothing is equal to it"));
    }
    if let [Some(min), Some(max)] = bounds
        && min > max
    {
        return Err(format!("{metric}: min = {min} lies above max = {max}"));
    }
    Ok(())
}
