//! A search for missing effects, for people and for JSON.

mod holdout;
pub(super) mod tables;
mod words;

use std::collections::BTreeMap;

use serde::Serialize;

use crate::compare::Comparison;
use crate::decision::Decisions;
use crate::infer::answer::{ByChannel, Discovery, Rung};
use crate::infer::judges::Unpredicted;
use crate::infer::other_numbers::OtherNumber;
use crate::infer::other_starts::OtherStart;
use crate::infer::stated::Roughly;
use crate::learned::LeftOut;

use super::fitted::WORSE;
use super::quantity::{digits, quantity, unit_of, with_sigma};
use super::table::text;

pub use holdout::{Unexplained, held_out, in_few_rows};
pub use tables::{decisions, fall, floor_name, why_not};
pub use words::{alike, effects, headline, left, other_numbers, other_starts, refusal, untested, within_stated};

/// How far a search went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reach {
    /// One look at every absent effect.
    OneLook,
    /// One effect after the other, to the end.
    Whole,
}

/// Everything that `lab diagnose` and `lab discover` say.
#[derive(Debug, Clone, Serialize)]
pub struct DiscoveryReport {
    /// What was found.
    #[serde(flatten)]
    pub discovery: Discovery,
    /// What it changes in what the coordinator plans with, from the model as given to the one found.
    pub decision: Decisions,
    /// What was learned of logs and sensors, which a model file cannot hold.
    pub left_out: Vec<LeftOut>,
    /// RMS by channel that the model found leaves by its file alone, as `lab compare` sees it.
    pub file_rms: ByChannel,
    /// The files of the model given and of the one found against each other, channel by channel.
    pub files: Vec<FileErrors>,
    /// Channels of the logs that were learned from that the model found does not explain.
    pub unexplained: Vec<Unexplained>,
    /// Channels of held-out logs that the model found does not explain.
    pub holdout_unexplained: Vec<Unexplained>,
    /// Held-out logs that lack a column which something found needs: they judged what came before it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub holdout_unpredicted: Vec<Unpredicted>,
    /// Logs that would have to begin at another charge for the model as given to explain all of them, without what was found.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub other_starts: Vec<OtherStart>,
    /// Numbers of the model as given, each of which alone would explain all logs if it were another, without what was found.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub other_numbers: Vec<OtherNumber>,
    /// Numbers that the model states with deviations and that are not free, as they would together explain all logs within these, without what was
    /// found.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub within_stated: Vec<Roughly>,
    /// Channels of which the stated sensor floor looks too small, in words; empty where the model found explains the logs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub floors_too_small: Vec<String>,
    /// How far the search went.
    pub reach: Reach,
    /// The file written; null when none was asked for.
    pub output: Option<String>,
}

/// What the files of two models leave of a channel, as `lab compare` sees them.
#[derive(Debug, Clone, Serialize, PartialEq)]
pub struct FileErrors {
    /// The channel.
    pub channel: &'static str,
    /// Whether the logs were held out.
    pub holdout: bool,
    /// RMS with the model as it was given.
    pub given: f64,
    /// RMS with the model found.
    pub found: f64,
}

impl FileErrors {
    /// Whether the model found leaves more, by more than a refit does by chance.
    #[must_use]
    pub fn is_worse(&self) -> bool {
        self.found > WORSE * self.given
    }
}

impl FileErrors {
    /// By channel, of the logs that were fitted or of those held out.
    #[must_use]
    pub fn of(given: &ByChannel, found: &ByChannel, holdout: bool) -> Vec<FileErrors> {
        let both = |(&channel, &given): (&&'static str, &f64)| Some(FileErrors { channel, holdout, given, found: *found.get(channel)? });
        given.iter().filter_map(both).collect()
    }
}

/// Effects in the printed ranking; JSON holds all.
const PRINTED: usize = 8;

impl DiscoveryReport {
    /// The report as people read it.
    #[must_use]
    pub fn human(&self) -> String {
        let found = &self.discovery;
        let unpredicted: String = self.holdout_unpredicted.iter().map(|one| one.words() + "\n").collect();
        let held = held_out(found, &self.holdout_unexplained).map_or_else(String::new, |words| words + "\n") + &unpredicted;
        let starts = other_starts(&self.other_starts).map_or_else(String::new, |words| words + "\n");
        let numbers = other_numbers(&self.other_numbers).map_or_else(String::new, |words| words + "\n");
        let within = within_stated(&self.within_stated).map_or_else(String::new, |words| words + "\n");
        let mut parts = vec![format!("{}: {}\n{starts}{within}{numbers}{held}", found.model, headline(found, self.reach))];
        parts.push(ladder(&found.ladder));
        parts.extend(section("", text(&tables::ranking(found, PRINTED)), !found.ranking.is_empty()));
        let more = found.ranking.len().saturating_sub(PRINTED);
        if more > 0 {
            parts.push(format!("{more} more promise less (--format json has all).\n"));
        }
        parts.extend(section("Parameters", text(&tables::parameters(found)), !found.parameters.is_empty()));
        parts.extend(section("The files alone, as `lab compare` sees them", self.files(), !self.files.is_empty()));
        parts.extend(section("What it changes", text(&decisions(&self.decision)), !self.decision.0.is_empty()));
        parts.extend(section("What is left", left(found) + &in_few_rows(&self.unexplained) + &self.floors() + &self.beside(), true));
        parts.extend(section("Not to be tested with these logs", untested(&found.untested), !found.untested.is_empty()));
        if !found.equivalent.is_empty() {
            parts.push(alike(found));
        }
        if !found.experiment.is_empty() {
            parts.push(format!("Next measurement: {}.\n", found.experiment));
        }
        if let Some(output) = &self.output {
            parts.push(format!("Written to {output}\n"));
        }
        parts.join("\n")
    }

    fn files(&self) -> String {
        text(&tables::files(&self.files)) + &self.file_warning().map_or_else(String::new, |warning| warning.to_owned() + "\n")
    }

    /// What to do where the file of the model found is worse than that of the model given; nothing where it is not.
    pub(super) fn file_warning(&self) -> Option<&'static str> {
        self.files.iter().any(FileErrors::is_worse).then_some(
            "Where the model found is worse, what it learned of a log or a sensor is missing (below), or it holds for the \
             logs that it was fitted to and not for others: look at both before you use it.",
        )
    }

    /// Which floors to doubt, one line each.
    fn floors(&self) -> String {
        self.floors_too_small.iter().map(|words| words.clone() + "\n").collect()
    }

    /// What was learned beside the model, and what the model alone leaves therefore.
    fn beside(&self) -> String {
        self.without().map_or_else(String::new, |words| format!("{words}:\n{}", learned_lines(&self.left_out)))
    }

    /// What the model alone leaves, where more was learned than its file can hold.
    pub(super) fn without(&self) -> Option<String> {
        let alone: Vec<String> =
            self.file_rms.iter().map(|(channel, rms)| format!("{} of {channel}", quantity(*rms, unit_of(channel)))).collect();
        (!self.left_out.is_empty()).then(|| {
            format!(
                "A model file cannot hold what follows; without it `lab compare` finds {} RMS (`--calibrate` asks for it anew)",
                alone.join(", ")
            )
        })
    }
}

/// RMS by channel over all logs of a comparison.
#[must_use]
pub fn rms_of(comparison: &Comparison) -> ByChannel {
    let mut sums: BTreeMap<&'static str, (f64, usize)> = BTreeMap::new();
    for error in &comparison.errors {
        let (squares, rows) = sums.entry(error.channel).or_default();
        *squares += error.size.squares();
        *rows += error.size.rows;
    }
    sums.into_iter().map(|(channel, (squares, rows))| (channel, (squares / rows.max(1) as f64).sqrt())).collect()
}

fn section(title: &str, body: String, there: bool) -> Option<String> {
    let title = if title.is_empty() { String::new() } else { format!("{title}:\n") };
    there.then(|| title + &body)
}

/// Stated deviations from which on it is said that a number is that far off.
const FAR: f64 = 2.0;

/// A line for each, with its sign.
pub(crate) fn learned_lines(left_out: &[LeftOut]) -> String {
    let far = |one: &LeftOut| {
        let deviations = one.shift.abs() / one.stated_sigma;
        if deviations > FAR { format!(", {deviations:.1} of the deviations stated for it") } else { String::new() }
    };
    let fact = |one: &LeftOut| if one.fact.is_empty() { String::new() } else { format!(" ({})", one.fact) };
    left_out.iter().map(|one| format!("  {}: {}{}{}\n", one.what, signed(one), fact(one), far(one))).collect()
}

fn signed(one: &LeftOut) -> String {
    let size = with_sigma(one.shift, Some(one.sigma), one.unit);
    if one.shift > 0.0 { format!("+{size}") } else { size }
}

/// Share by which an error has to change to have moved.
const HARDLY: f64 = 0.005;
/// Widest bar of a ladder, characters.
const BAR: f64 = 30.0;

/// How the error fell, with bars, one table for each channel.
#[must_use]
pub fn ladder(rungs: &[Rung]) -> String {
    let mut channels: Vec<&'static str> = rungs.first().map_or_else(Vec::new, |rung| rung.train_rms.keys().copied().collect());
    // What did not move is told last.
    let stays = |channel: &&'static str| {
        let of = |rung: Option<&Rung>| rung.and_then(|rung| rung.train_rms.get(channel).copied()).unwrap_or(0.0);
        let [first, last] = [of(rungs.first()), of(rungs.last())];
        (first - last).abs() <= HARDLY * first
    };
    channels.sort_by_key(stays);
    let of = |channel: &&'static str| {
        let at = |numbers: &ByChannel| numbers.get(channel).copied();
        let most = rungs.iter().flat_map(|rung| [at(&rung.train_rms), at(&rung.holdout_rms)]).flatten().fold(0.0, f64::max);
        tables::ladder(rungs, channel, |rms| "\u{2588}".repeat((rms / most * BAR).round().max(1.0) as usize))
    };
    channels.iter().map(|channel| text(&of(channel))).collect::<Vec<_>>().join("\n")
}

/// A number with its deviation; without one where it is exact.
#[must_use]
pub fn perhaps_sigma(value: f64, sigma: Option<f64>, unit: &str) -> String {
    if sigma.is_some() { with_sigma(value, sigma, unit) } else { quantity(value, unit) }
}

/// The number of a named parameter, in its unit.
fn named(name: &str, value: f64, sigma: Option<f64>) -> String {
    match unit_of(name) {
        "" if sigma.is_none() => digits(value),
        unit => perhaps_sigma(value, sigma, unit),
    }
}
