//! One effect added by its name, for people and for JSON.

use std::collections::BTreeMap;

use energy::{Channel, Model};
use serde::Serialize;

use crate::compare::{Comparison, RegimeError};
use crate::decision::Decisions;
use crate::infer::answer::{ByChannel, Rung, Value, deviations, floors_from_rows};
use crate::infer::judge::Refusal;
use crate::infer::state::State;
use crate::infer::trial::Trial;
use crate::learned::LeftOut;

use super::discovery::tables::parameter_table;
use super::discovery::{decisions, ladder, learned_lines, refusal};
use super::quantity::{digits, quantity, unit_of};
use super::table::{numbers_from, table, text};

/// What the files of three models leave of the logs, as `lab compare` sees them.
#[derive(Debug)]
pub struct Look {
    /// Logs that were fitted.
    pub train: Comparison,
    /// Logs that were held out, if any.
    pub holdout: Option<Comparison>,
}

/// Error of one channel of one log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LogError {
    /// Name of the log.
    pub log: String,
    /// Whether it was held out.
    pub holdout: bool,
    /// Canonical name of the channel.
    pub channel: &'static str,
    /// RMS with the model as it was given.
    pub given: f64,
    /// RMS with its free parameters refitted.
    pub refitted: f64,
    /// RMS with the effect.
    pub extended: f64,
    /// Known sensor floor; null when the model states none.
    pub floor: Option<f64>,
}

/// Error of one channel in one band of a regime, over all fitted logs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegimeChange {
    /// Canonical name of the channel.
    pub channel: &'static str,
    /// What rows are sorted by.
    pub dimension: &'static str,
    /// The band.
    pub band: String,
    /// RMS before the effect, with the free parameters refitted.
    pub before: f64,
    /// RMS with it.
    pub after: f64,
    /// Part of the channel's squared error before that it takes away here, -inf..1.
    pub taken: f64,
}

/// Everything that `lab add` says.
#[derive(Debug, Clone, Serialize)]
pub struct Addition {
    /// Version of this structure.
    pub schema: u32,
    /// Name of the model.
    pub model: String,
    /// The effect.
    pub effect: &'static str,
    /// Whether the evidence is for it.
    pub accepted: bool,
    /// Why not; empty when it is.
    pub refused: Vec<Refusal>,
    /// Fall of the Bayesian information criterion; above 10 is strong.
    pub delta_bic: f64,
    /// The effect's parameters.
    pub parameters: BTreeMap<&'static str, Value>,
    /// How the error fell, with all that is roughly known at its best.
    pub ladder: Vec<Rung>,
    /// Error by log and channel with the files of the models alone.
    pub logs: Vec<LogError>,
    /// The same by regime, where most changed.
    pub regimes: Vec<RegimeChange>,
    /// Where the error lies now, one sentence each.
    pub words: Vec<String>,
    /// What it changes in what the coordinator plans with.
    pub decision: Decisions,
    /// What was learned of logs and sensors, which a model file cannot hold.
    pub left_out: Vec<LeftOut>,
    /// The file written; null when none was asked for.
    pub output: Option<String>,
}

/// Regimes that are listed.
const REGIMES: usize = 8;

impl Addition {
    /// The effect's own parameters, which the model given may have had under the same name.
    #[must_use]
    pub fn parameters_of(given: &Model, trial: &Trial) -> BTreeMap<&'static str, Value> {
        let model = &trial.state.frame.model;
        let own = deviations(trial.state.told()).into_iter().map(|(index, value, sigma)| {
            let parameter = &model.parameters()[index];
            (parameter, Value::of(parameter, given, value, sigma))
        });
        own.filter(|(parameter, _)| parameter.effect == trial.spec.id).map(|(parameter, value)| (parameter.name, value)).collect()
    }

    /// The model refitted, and with the effect.
    #[must_use]
    pub fn ladder_of(base: &State, base_holdout: &[(Channel, f64)], trial: &Trial) -> Vec<Rung> {
        let named =
            |numbers: &[(Channel, f64)]| -> ByChannel { numbers.iter().map(|&(channel, number)| (channel.name(), number)).collect() };
        let floor = named(&base.frame.evidence.floors);
        let floor_from_rows = floors_from_rows(base);
        vec![
            Rung {
                effect: None,
                delta_bic: None,
                train_rms: named(&base.told().rms()),
                holdout_rms: named(base_holdout),
                floor: floor.clone(),
                floor_from_rows: floor_from_rows.clone(),
            },
            Rung {
                effect: Some(trial.spec.id),
                delta_bic: Some(trial.delta_bic),
                train_rms: named(&trial.state.told().rms()),
                holdout_rms: named(&trial.holdout),
                floor,
                floor_from_rows,
            },
        ]
    }

    /// Error by log with the model given, refitted and extended.
    #[must_use]
    pub fn logs_of(looks: &[Look; 3]) -> Vec<LogError> {
        let mut all = Vec::new();
        for holdout in [false, true] {
            let side = |look: &'_ Look| if holdout { look.holdout.clone() } else { Some(look.train.clone()) };
            let [Some(given), Some(refitted), Some(extended)] = looks.each_ref().map(side) else { continue };
            // An effect may make a channel predicted that was not: there is no before for it.
            for error in &given.errors {
                let rms = |of: &Comparison| of.errors.iter().find(|e| e.log == error.log && e.channel == error.channel).map(|e| e.size.rms);
                let (Some(refitted), Some(extended)) = (rms(&refitted), rms(&extended)) else { continue };
                let (log, channel) = (error.log.clone(), error.channel);
                all.push(LogError { log, holdout, channel, given: error.size.rms, refitted, extended, floor: error.floor });
            }
        }
        all
    }

    /// Regimes of which the effect takes away most, or to which it adds.
    #[must_use]
    pub fn regimes_of(before: &Comparison, after: &Comparison) -> Vec<RegimeChange> {
        let same = |a: &RegimeError, b: &RegimeError| (a.channel, a.dimension, &a.band) == (b.channel, b.dimension, &b.band);
        let of = |old: &RegimeError| {
            let new = after.regimes.iter().find(|new| same(old, new))?;
            let taken = if old.size.rms > 0.0 { old.share * (1.0 - (new.size.rms / old.size.rms).powi(2)) } else { 0.0 };
            let (channel, dimension, band) = (old.channel, old.dimension, old.band.clone());
            Some(RegimeChange { channel, dimension, band, before: old.size.rms, after: new.size.rms, taken })
        };
        let mut all: Vec<RegimeChange> = before.regimes.iter().filter(|old| old.share_of_rows < WHOLE).filter_map(of).collect();
        all.sort_by(|a, b| b.taken.abs().total_cmp(&a.taken.abs()));
        all.truncate(REGIMES);
        all
    }

    /// The report as people read it.
    #[must_use]
    pub fn human(&self) -> String {
        let verdict = if self.accepted {
            format!("the logs speak for {}", self.effect)
        } else {
            let reasons: Vec<&str> = self.refused.iter().map(|&one| refusal(one)).collect();
            format!("the logs do NOT speak for {}: {}", self.effect, reasons.join(", "))
        };
        let mut parts = vec![format!("{}: {verdict} (delta BIC {}).\n", self.model, digits(self.delta_bic)), ladder(&self.ladder)];
        let parameters = self.parameters.iter().map(|(name, value)| (format!("{}.{name}", self.effect), *name, *value));
        parts.push(text(&parameter_table(parameters)));
        parts.push(format!("RMS by log, as `lab compare` sees the written model:\n{}", self.log_table()));
        if !self.regimes.is_empty() {
            parts.push(format!("Where it changes most:\n{}", self.regime_table()));
        }
        parts.push(format!("What is left: {}\n", self.words.join("\n")));
        if !self.decision.0.is_empty() {
            parts.push(format!("What it changes:\n{}", text(&decisions(&self.decision))));
        }
        if !self.left_out.is_empty() {
            parts.push(format!(
                "A model file cannot hold what follows, which the error at the top rests on:\n{}",
                learned_lines(&self.left_out)
            ));
        }
        if let Some(output) = &self.output {
            let warning = if self.accepted { "" } else { ", although the logs do not speak for it" };
            parts.push(format!("Written to {output}{warning}\n"));
        }
        parts.join("\n")
    }

    fn log_table(&self) -> String {
        let mut rows = table(&["log", "", "channel", "as given", "refitted", "with it", "floor"]);
        for log in &self.logs {
            let unit = unit_of(log.channel);
            rows.add_row([
                log.log.clone(),
                if log.holdout { "held out" } else { "" }.to_owned(),
                log.channel.to_owned(),
                quantity(log.given, unit),
                quantity(log.refitted, unit),
                quantity(log.extended, unit),
                log.floor.map_or_else(|| "unknown".to_owned(), |floor| quantity(floor, unit)),
            ]);
        }
        numbers_from(&mut rows, 3);
        text(&rows)
    }

    fn regime_table(&self) -> String {
        let mut rows = table(&["channel", "by", "band", "before", "with it", "of all squared error"]);
        for regime in &self.regimes {
            let unit = unit_of(regime.channel);
            rows.add_row([
                regime.channel.to_owned(),
                regime.dimension.to_owned(),
                regime.band.clone(),
                quantity(regime.before, unit),
                quantity(regime.after, unit),
                format!("{:+.0} %", -100.0 * regime.taken),
            ]);
        }
        numbers_from(&mut rows, 3);
        text(&rows)
    }
}

/// A band with nearly all rows is no regime.
const WHOLE: f64 = 0.95;
