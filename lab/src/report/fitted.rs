//! Fits for people and for JSON.

use energy::Model;
use serde::Serialize;

use crate::compare::{ChannelError, Comparison};
use crate::fit::{Fit, SegmentCertainty, Side, uniform_sigma};
use crate::model_edit::Change;

use super::quantity::{quantity, unit_of, with_sigma};
use super::table::{numbers_from, table, text};

/// How a parameter came out of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// The logs determine it.
    Determined,
    /// It rests on its least plausible value.
    AtMin,
    /// It rests on its greatest plausible value.
    AtMax,
    /// The logs say no more about it than its plausible range does.
    Flat,
}

/// One fitted parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedParameter {
    /// Its effect.
    pub effect: &'static str,
    /// Its name, with unit.
    pub name: &'static str,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// Value before the fit.
    pub before: f64,
    /// Value after the fit.
    pub value: f64,
    /// Standard deviation, honest under autocorrelation; null when flat, and where nothing is left of the logs and the model states no floor.
    pub sigma: Option<f64>,
    /// Least plausible value.
    pub min: f64,
    /// Greatest plausible value.
    pub max: f64,
    /// How it came out.
    pub state: State,
}

/// Error of one channel of one log, before and after.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LogErrors {
    /// Name of the log.
    pub log: String,
    /// Canonical name of the channel.
    pub channel: &'static str,
    /// Unit of RMS and floor.
    pub unit: &'static str,
    /// Rows that count.
    pub rows: usize,
    /// Known sensor floor; null when the model states none.
    pub floor: Option<f64>,
    /// RMS of observed minus predicted with the model as given.
    pub rms_before: f64,
    /// RMS with the model as fitted.
    pub rms_after: f64,
}

/// The same of a log to which the model was fitted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedLog {
    /// Its errors.
    #[serde(flatten)]
    pub errors: LogErrors,
    /// Lag-1 autocorrelation of the residuals after it.
    pub lag1: f64,
    /// Independent rows that the rows are worth.
    pub effective_rows: f64,
}

/// Everything that `lab fit` says.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FitReport {
    /// Version of this structure.
    pub schema: u32,
    /// Name of the model.
    pub model: String,
    /// Version of the program.
    pub version: &'static str,
    /// Whether the search ended at a minimum.
    pub converged: bool,
    /// Steps taken.
    pub iterations: usize,
    /// The free parameters.
    pub parameters: Vec<FittedParameter>,
    /// Correlation between them, in the same order; null where one is flat.
    pub correlation: Vec<Vec<f64>>,
    /// By log and channel.
    pub logs: Vec<FittedLog>,
    /// By log and channel, of logs to which nothing was fitted.
    pub holdout: Vec<LogErrors>,
    /// What to know about the result, one sentence each.
    pub words: Vec<String>,
    /// The file written; null when none was asked for.
    pub output: Option<String>,
}

/// Growth of RMS beyond which a channel of a log is reported to fit worse than before.
pub(super) const WORSE: f64 = 1.02;
/// Correlation beyond which two parameters are reported to move together.
const TOGETHER: f64 = 0.95;

impl LogErrors {
    /// Of two comparisons of the same logs, which list their channels in the same order.
    fn each(before: &Comparison, after: &Comparison) -> impl Iterator<Item = LogErrors> {
        let pairs = before.errors.iter().zip(&after.errors);
        pairs.map(|(before, after): (&ChannelError, &ChannelError)| LogErrors {
            log: after.log.clone(),
            channel: after.channel,
            unit: after.unit,
            rows: after.size.rows,
            floor: after.floor,
            rms_before: before.size.rms,
            rms_after: after.size.rms,
        })
    }

    fn grew(&self) -> bool {
        self.rms_after > WORSE * self.rms_before
    }

    /// What a table says of it at the end of a row.
    fn cells(&self) -> [String; 3] {
        let floor = self.floor.map_or_else(|| "unknown".to_owned(), |floor| quantity(floor, self.unit));
        [quantity(self.rms_before, self.unit), quantity(self.rms_after, self.unit), floor]
    }
}

impl FitReport {
    /// Puts a report together.
    #[must_use]
    pub fn of(model: &Model, fit: &Fit, before: &Comparison, after: &Comparison) -> FitReport {
        let parameters: Vec<FittedParameter> = (0..fit.free.len()).map(|index| parameter(model, fit, index)).collect();
        let p = parameters.len();
        let correlation = (0..p).map(|i| (0..p).map(|j| fit.certainty.correlation[(i, j)]).collect()).collect();
        // Comparisons and fits list channels of logs in the same order.
        let errors = LogErrors::each(before, after).zip(&fit.certainty.segments);
        let log =
            |(errors, worth): (LogErrors, &SegmentCertainty)| FittedLog { errors, lag1: worth.lag1, effective_rows: worth.effective_rows };
        let logs: Vec<FittedLog> = errors.map(log).collect();
        FitReport {
            schema: 1,
            model: model.name.clone(),
            version: env!("CARGO_PKG_VERSION"),
            converged: fit.solution.converged,
            iterations: fit.solution.iterations,
            words: words(&parameters, &logs, fit),
            parameters,
            correlation,
            logs,
            holdout: Vec::new(),
            output: None,
        }
    }

    /// Adds what the fit is worth to logs to which nothing was fitted.
    #[must_use]
    pub fn with_holdout(mut self, before: &Comparison, after: &Comparison) -> FitReport {
        self.holdout = LogErrors::each(before, after).collect();
        for log in self.holdout.iter().filter(|log| log.grew()) {
            let (before, after) = (quantity(log.rms_before, log.unit), quantity(log.rms_after, log.unit));
            self.words.push(format!(
                "{} in {}, held out, is predicted worse than before ({before}, now {after}): the fit helps only where it was made.",
                log.channel, log.log
            ));
        }
        self
    }

    /// What to write into the model's text. A parameter on which no row depends keeps its number
    /// and its source; one that is otherwise flat gets the deviation of its plausible range, and one of which nobody can tell how sure it is
    /// keeps its own.
    #[must_use]
    pub fn changes(&self, fit: &Fit, source: &str) -> Vec<Change> {
        let found = fit.certainty.silent.iter().zip(&fit.certainty.sigma);
        let moved = self.parameters.iter().zip(found).filter(|(_, (silent, _))| !**silent);
        let change = |(p, (_, sigma)): (&FittedParameter, (&bool, &Option<f64>))| Change {
            effect: p.effect.to_owned(),
            parameter: p.name.to_owned(),
            value: p.value,
            sigma: sigma.unwrap_or_else(|| uniform_sigma((p.min, p.max))),
            range: (p.min, p.max),
            source: source.to_owned(),
            free: false,
        };
        moved.map(change).collect()
    }

    /// The report as people read it.
    #[must_use]
    pub fn human(&self) -> String {
        let mut errors = table(&["log", "channel", "rows", "independent", "RMS before", "RMS after", "floor"]);
        for FittedLog { errors: log, effective_rows, .. } in &self.logs {
            let row = [log.log.clone(), log.channel.to_owned(), log.rows.to_string(), format!("{effective_rows:.1}")];
            errors.add_row(row.into_iter().chain(log.cells()));
        }
        numbers_from(&mut errors, 2);
        let mut parameters = table(&["parameter", "before", "after", "range", ""]);
        for p in &self.parameters {
            parameters.add_row([
                format!("{}.{}", p.effect, p.name),
                quantity(p.before, p.unit),
                with_sigma(p.value, p.sigma, p.unit),
                format!("{} .. {}", p.min, p.max),
                match p.state {
                    State::Determined => "",
                    State::AtMin => "at its least",
                    State::AtMax => "at its greatest",
                    State::Flat => "not determined",
                }
                .to_owned(),
            ]);
        }
        let mut whole = format!("{}: fit of {}\n\n{}\n", self.model, count(self.parameters.len()), text(&errors));
        if !self.holdout.is_empty() {
            whole += &format!("{}\n", text(&self.holdout_table()));
        }
        whole += &text(&parameters);
        if self.parameters.len() > 1 {
            whole += &format!("\n{}", text(&self.correlation_table()));
        }
        if !self.words.is_empty() {
            whole += &format!("\n{}\n", self.words.join("\n"));
        }
        if let Some(output) = &self.output {
            whole += &format!("\nWritten to {output}\n");
        }
        whole
    }

    fn holdout_table(&self) -> comfy_table::Table {
        let mut errors = table(&["held out", "channel", "rows", "RMS before", "RMS after", "floor"]);
        for log in &self.holdout {
            let row = [log.log.clone(), log.channel.to_owned(), log.rows.to_string()];
            errors.add_row(row.into_iter().chain(log.cells()));
        }
        numbers_from(&mut errors, 2);
        errors
    }

    fn correlation_table(&self) -> comfy_table::Table {
        let numbers: Vec<String> = (1..=self.parameters.len()).map(|number| number.to_string()).collect();
        let header: Vec<&str> = ["", "correlation"].into_iter().chain(numbers.iter().map(String::as_str)).collect();
        let mut matrix = table(&header);
        for (index, p) in self.parameters.iter().enumerate() {
            let cell = |value: &f64| if value.is_nan() { "-".to_owned() } else { format!("{value:.2}") };
            let row = [numbers[index].clone(), format!("{}.{}", p.effect, p.name)];
            matrix.add_row(row.into_iter().chain(self.correlation[index][..=index].iter().map(cell)));
        }
        numbers_from(&mut matrix, 2);
        matrix
    }
}

fn count(parameters: usize) -> String {
    if parameters == 1 { "1 parameter".to_owned() } else { format!("{parameters} parameters") }
}

fn parameter(model: &Model, fit: &Fit, index: usize) -> FittedParameter {
    let known = &model.parameters()[fit.free[index]];
    let sigma = fit.certainty.sigma[index];
    let state = match (fit.solution.bound[index], sigma) {
        (Some(Side::Min), _) => State::AtMin,
        (Some(Side::Max), _) => State::AtMax,
        (None, None) => State::Flat,
        (None, Some(_)) => State::Determined,
    };
    FittedParameter {
        effect: known.effect,
        name: known.name,
        unit: unit_of(known.name),
        before: known.value,
        value: fit.values[fit.free[index]],
        sigma: sigma.filter(|sigma| *sigma > 0.0),
        min: known.min,
        max: known.max,
        state,
    }
}

fn words(parameters: &[FittedParameter], logs: &[FittedLog], fit: &Fit) -> Vec<String> {
    let name = |p: &FittedParameter| format!("{}.{}", p.effect, p.name);
    let certainty = &fit.certainty;
    let mut words = Vec::new();
    if !fit.solution.converged {
        words.push(format!("The search did not end within {} steps: the numbers are not a minimum.", fit.solution.iterations));
    }
    for log in logs.iter().map(|log| &log.errors).filter(|log| log.grew()) {
        let (before, after) = (quantity(log.rms_before, log.unit), quantity(log.rms_after, log.unit));
        let where_ = format!("{} in {}", log.channel, log.log);
        words.push(format!(
            "{where_} fits worse than before ({before}, now {after}): the other logs or channels pull the parameters away from it."
        ));
    }
    for set in &certainty.tangled {
        let names: Vec<String> = set.iter().map(|&index| name(&parameters[index])).collect();
        let first = names.first().map_or("", String::as_str);
        let all = names.join(", ");
        words.push(format!("These logs determine {all} only in combination: fix one of them, for example --fix {first}."));
    }
    for (index, p) in parameters.iter().enumerate() {
        let bound = |side, value| {
            let value = quantity(value, p.unit);
            format!("{} rests on its {side} plausible value, {value}: the model lacks an effect, or the range is wrong.", name(p))
        };
        match p.state {
            State::AtMin => words.push(bound("least", p.min)),
            State::AtMax => words.push(bound("greatest", p.max)),
            State::Flat if certainty.silent[index] && p.value == p.before => {
                words.push(format!("{} is not determined: a small change of it changes no row of these logs (one that acts in steps, such as a threshold, would have to be a smooth edge). It keeps its value.", name(p)));
            }
            State::Flat if certainty.silent[index] => {
                let (before, now) = (quantity(p.before, p.unit), quantity(p.value, p.unit));
                words.push(format!(
                    "{} went from {before} to {now}, where no row of these logs depends on it any more: they say no more about it than that.",
                    name(p)
                ));
            }
            State::Flat if !certainty.tangled.iter().any(|set| set.contains(&index)) => {
                words.push(format!("{} is not determined: these logs say no more about it than its plausible range.", name(p)));
            }
            State::Flat | State::Determined => {}
        }
    }
    if certainty.sigma.contains(&Some(0.0)) {
        words.push(
            "These logs leave nothing, and the model states no sensor floor: how sure the numbers are cannot be told, and deviations in a model \
             file stay as they are."
                .to_owned(),
        );
    }
    for i in 0..parameters.len() {
        for j in 0..i {
            let correlation = certainty.correlation[(i, j)];
            if correlation.abs() > TOGETHER {
                let pair = format!("{} and {}", name(&parameters[j]), name(&parameters[i]));
                words.push(format!("{pair} move together (correlation {correlation:.2}): these logs hardly tell them apart."));
            }
        }
    }
    words
}
