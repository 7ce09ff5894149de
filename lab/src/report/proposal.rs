//! Proposed formulas for people, for JSON and for model files: always called proposals.

use std::fmt::Write as _;

use energy::effect::expression;
use energy::{Channel, Model, Parameter};
use serde::Serialize;

use super::discovery::tables::files;
use super::discovery::{FileErrors, learned_lines};
use super::quantity::{quantity, unit_of, with_sigma};
use super::table::{numbers_from, table, text};
use crate::infer::certainty::range_sigma;
use crate::infer::evidence::Evidence;
use crate::infer::propose::switch::Switching;
use crate::infer::propose::{HOLDOUT_FALL, Proposal, error};
use crate::infer::state::State;
use crate::learned::{LeftOut, left_out};
use crate::model_edit::Change;

/// What came of the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// A formula that lowers the held-out error. Not an identified effect.
    Proposal,
    /// No formula does.
    None,
}

/// A parameter of a term, for JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Number {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Standard deviation, with the slow noise that the model leaves; no more than what the range says.
    pub sigma: f64,
    /// Whether it would go on if it could.
    pub at_end_of_range: bool,
}

/// One term, for JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TermReport {
    /// Name of the expression.
    pub name: String,
    /// Always `proposal`.
    pub status: &'static str,
    /// The channel that it adds to.
    pub channel: &'static str,
    /// What it adds: its equation.
    pub equation: &'static str,
    /// What it would mean.
    pub words: String,
    /// Fall of the information criterion that it brought.
    pub delta_bic: f64,
    /// Its parameters.
    pub parameters: Vec<Number>,
}

/// Error of one channel, for JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fall {
    /// The channel.
    pub channel: &'static str,
    /// Known or seen noise of one row.
    pub floor: f64,
    /// RMS with the fitted model without the proposal.
    pub rms_before: f64,
    /// RMS with it.
    pub rms_after: f64,
    /// Share of the squared error that it takes away.
    pub share: f64,
}

/// What comes and goes, for JSON. Errors are those with every log, a held-out one too, asked when it was there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SwitchingReport {
    /// The channel that it adds to: the one that is judged (see `training`), or an input that its sensor does not see all of.
    pub channel: &'static str,
    /// Whether it is single readings, each off by another amount: their mean and scatter are `size` and `sigma` then.
    pub readings: bool,
    /// What it is a multiple of; null for a constant.
    pub times: Option<&'static str>,
    /// Its size, in the channel's unit (for each unit of what it is a multiple of).
    pub size: f64,
    /// Standard deviation of that.
    pub sigma: f64,
    /// Unit of both.
    pub unit: String,
    /// Share of the rows in which it is there.
    pub share: f64,
    /// How often it comes, on all logs that were fitted.
    pub visits: usize,
    /// How long it stays on average, s.
    pub stays_s: f64,
    /// Error on the logs that were fitted.
    pub training: Fall,
    /// Error on logs that were not.
    pub holdout: Fall,
}

/// Error on held-out logs, in floors, from which on what comes and goes is not what is missing: within it a formula counts as one that explains.
const HARDLY_EXPLAINED: f64 = 2.0;

impl SwitchingReport {
    fn of(switching: &Switching, evidence: &Evidence, holdout: &Evidence) -> SwitchingReport {
        let fall = |evidence, (before, after)| falls(evidence, &[(switching.judged, before)], &[(switching.judged, after)]).remove(0);
        let unit = match (unit_of(switching.channel.name()), switching.times.map(|times| unit_of(times.name()))) {
            (unit, None | Some("")) => unit.to_owned(),
            ("V", Some("A")) => "ohm".to_owned(),
            ("W", Some("m/s")) => "N".to_owned(),
            (unit, Some(times)) => format!("{unit}/({times})"),
        };
        SwitchingReport {
            channel: switching.channel.name(),
            readings: switching.readings,
            times: switching.times.map(Channel::name),
            size: switching.size,
            sigma: switching.sigma,
            unit,
            share: switching.share,
            visits: switching.visits,
            stays_s: switching.stays_s,
            training: fall(evidence, switching.training),
            holdout: fall(holdout, switching.holdout),
        }
    }

    fn words(&self) -> Vec<String> {
        let (size, unit) = (with_sigma(self.size, Some(self.sigma), &self.unit), unit_of(self.training.channel));
        let times = self.times.map_or_else(String::new, |times| format!(" times {times}"));
        let beside = if self.channel == self.training.channel { "" } else { " beside what its sensor sees" };
        let errors = |fall: &Fall| format!("{} to {}", quantity(fall.rms_before, unit), quantity(fall.rms_after, unit));
        if self.readings {
            return vec![
                format!(
                    "Single readings of {} are off: {:.1} % of them, by {} on average, which scatter by {}.",
                    self.channel,
                    100.0 * self.share,
                    quantity(self.size, unit),
                    quantity(self.sigma, unit)
                ),
                format!(
                    "Without them the error falls from {} on the logs that were fitted, and from {} on the held-out ones ({:.2} x the floor).",
                    errors(&self.training),
                    errors(&self.holdout),
                    self.holdout.rms_after / self.holdout.floor
                ),
            ];
        }
        vec![
            format!(
                "Something comes and goes at times that no formula says: {size}{times} on {}{beside}, in {:.1} % of the rows, {} times, for {:.0} s on average.",
                self.channel,
                100.0 * self.share,
                self.visits,
                self.stays_s
            ),
            format!(
                "With every log asked when it was there, the error falls from {} on the logs that were fitted, and from {} on the held-out ones ({:.2} x the floor).",
                errors(&self.training),
                errors(&self.holdout),
                self.holdout.rms_after / self.holdout.floor
            ),
            if self.holdout.rms_after > HARDLY_EXPLAINED * self.holdout.floor {
                "That is far from the floor: what is missing is something else, which this follows only roughly.".to_owned()
            } else {
                "Look for what is there at such times; a model file cannot hold when they are.".to_owned()
            },
        ]
    }
}

/// Everything that `lab propose` says.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProposalReport {
    /// Version of this structure.
    pub schema: u32,
    /// Name of the model.
    pub model: String,
    /// What came of it.
    pub status: Status,
    /// The terms, in the order in which they were found.
    pub terms: Vec<TermReport>,
    /// Terms that were tried.
    pub tried: usize,
    /// Period that stands out of the residual before, s.
    pub period_s: Option<f64>,
    /// What comes and goes at times that no formula says; null where a formula does as well, or nothing comes and goes.
    pub switching: Option<SwitchingReport>,
    /// Errors on the logs that were fitted.
    pub training: Vec<Fall>,
    /// Errors on logs that were not.
    pub holdout: Vec<Fall>,
    /// What to know about it.
    pub words: Vec<String>,
    /// What was fitted beside the formula and has no place in the model file.
    pub left_out: Vec<LeftOut>,
    /// The files alone, the given one and that with the proposal, as `lab compare` sees them; empty without a proposal.
    pub files: Vec<FileErrors>,
    /// The file written; null when none was asked for or nothing is proposed.
    pub output: Option<String>,
}

impl ProposalReport {
    /// Puts a report together.
    #[must_use]
    pub fn of(proposal: &Proposal) -> ProposalReport {
        let (evidence, holdout) = (&proposal.base.frame.evidence, &proposal.judged_by);
        let training = falls(evidence, &proposal.base.rms(), &proposal.state.rms());
        let held = falls(holdout, &proposal.base_holdout, &proposal.holdout);
        let status = if proposal.terms.is_empty() { Status::None } else { Status::Proposal };
        let before = error(holdout, &proposal.base_holdout);
        let after = error(holdout, &proposal.holdout);
        let mut words = match status {
            Status::None if proposal.tried == 0 => vec!["Nothing is proposed: the fitted model explains the logs.".to_owned()],
            Status::None if proposal.switching.is_some() => vec!["No formula is proposed.".to_owned()],
            Status::None => vec![format!(
                "Nothing is proposed: of {} terms, none of those that do most for the fit lowers the error on logs that it has not seen by {:.0} % or more.",
                proposal.tried,
                100.0 * HOLDOUT_FALL
            )],
            Status::Proposal => vec![format!(
                "This is a proposal, not an identified effect: a formula that lowers the held-out error from {before:.2} to {after:.2} x the floor. \
                     Another formula may do as well; look for the physics that it stands for."
            )],
        };
        let switching = proposal.switching.as_ref().map(|switching| SwitchingReport::of(switching, evidence, holdout));
        words.extend(switching.iter().flat_map(SwitchingReport::words));
        // A period of the inputs shows in every residual: it is worth a word where no term explains it.
        if let (Some(period_s), Status::None, None) = (proposal.period_s, status, &switching) {
            words.push(format!("The residual before has a period of {period_s:.0} s."));
        }
        ProposalReport {
            schema: 1,
            model: proposal.base.frame.model.name.clone(),
            status,
            terms: terms(proposal),
            tried: proposal.tried,
            period_s: proposal.period_s,
            switching,
            training,
            holdout: held,
            words,
            left_out: if status == Status::Proposal { left_out(&proposal.state) } else { Vec::new() },
            files: Vec::new(),
            output: None,
        }
    }

    /// For the terminal.
    #[must_use]
    pub fn human(&self) -> String {
        let title = if self.status == Status::Proposal { "proposal" } else { "no proposal" };
        let mut whole = format!("{}: {title}\n\n", self.model);
        for term in &self.terms {
            let _ = writeln!(whole, "PROPOSAL {}: {} (delta BIC {:.0})\n  {}", term.name, term.words, term.delta_bic, term.equation);
            for number in &term.parameters {
                let sigma = Some(number.sigma).filter(|_| !number.at_end_of_range);
                let end = if number.at_end_of_range { ", at the end of its range" } else { "" };
                let _ = writeln!(whole, "  {} = {}{end}", number.name, with_sigma(number.value, sigma, unit_of(number.name)));
            }
            whole.push('\n');
        }
        let mut errors = table(&["logs", "channel", "RMS before", "RMS after", "floor", "explained"]);
        numbers_from(&mut errors, 2);
        for (logs, falls) in [("training", &self.training), ("held out", &self.holdout)] {
            for fall in falls {
                let unit = unit_of(fall.channel);
                errors.add_row([
                    logs.to_owned(),
                    fall.channel.to_owned(),
                    quantity(fall.rms_before, unit),
                    quantity(fall.rms_after, unit),
                    quantity(fall.floor, unit),
                    format!("{:.1} %", 100.0 * fall.share),
                ]);
            }
        }
        whole += &text(&errors);
        if !self.files.is_empty() {
            let _ = write!(whole, "\nThe files alone, as `lab compare` sees them:\n{}", text(&files(&self.files)));
        }
        for sentence in &self.words {
            let _ = write!(whole, "\n{sentence}");
        }
        if !self.left_out.is_empty() {
            let learned = learned_lines(&self.left_out);
            let _ = write!(whole, "\nA model file cannot hold what follows, so `lab compare` finds more error than this says:\n{learned}");
        }
        if let Some(path) = &self.output {
            let _ = write!(whole, "\nWritten to {path}");
        }
        whole + "\n"
    }

    /// The terms as entries of a model file, each with a comment that says what it is.
    #[must_use]
    pub fn entries(&self, proposal: &Proposal, source: &str) -> String {
        let model = &proposal.state.frame.model;
        let numbers = numbers(&proposal.state);
        let mut whole = String::new();
        for term in &self.terms {
            let Some(spec) = model.effects().map(|effect| effect.spec()).find(|spec| spec.id == term.name) else { continue };
            let formula = spec.equation.split_once(" += ").map_or(spec.equation, |(_, formula)| formula);
            let _ = write!(
                whole,
                "\n# PROPOSAL, not an identified effect: {}, {source}.\n# It may stand for other physics; replace it when that is known.\n[[effect]]\nid = \"{}\"\nname = \"{}\"\ntitle = \"{}\"\nchannel = \"{}\"\nformula = \"{formula}\"\n",
                term.words,
                expression::ID,
                term.name,
                spec.title,
                term.channel,
            );
            for (parameter, value, sigma) in numbers.iter().filter(|(parameter, ..)| parameter.effect == term.name) {
                let null = spec.parameters.iter().find(|known| known.name == parameter.name).and_then(|known| known.null);
                let null = null.map_or_else(String::new, |null| format!(", null = {null:?}"));
                // `lab fit` takes time_s at its word, and would pull what has a period away from logs that find it at other phases.
                let free = if spec.tells_time() && model.uncertainty.clock_sigma_s > 0.0 { "" } else { "free = true, " };
                let _ = writeln!(
                    whole,
                    "{} = {{ value = {value:?}, sigma = {sigma:?}, source = \"{source}\", {free}min = {:?}, max = {:?}{null} }}",
                    parameter.name, parameter.min, parameter.max
                );
            }
            if let Some(input) = proposal.slow(&term.name) {
                let _ = writeln!(whole, "states = {{ slow = {{ input = \"{input}\", tau = \"tau_s\" }} }}");
            }
        }
        whole
    }

    /// New numbers of the model's own free parameters, which were fitted beside the proposal.
    #[must_use]
    pub fn changes(&self, proposal: &Proposal, source: &str) -> Vec<Change> {
        let own =
            numbers(&proposal.state).into_iter().filter(|(parameter, ..)| self.terms.iter().all(|term| term.name != parameter.effect));
        let change = |(parameter, value, sigma): (Parameter, f64, f64)| Change {
            effect: parameter.effect.to_owned(),
            parameter: parameter.name.to_owned(),
            value,
            sigma,
            range: (parameter.min, parameter.max),
            source: source.to_owned(),
            free: true,
        };
        own.map(change).collect()
    }
}

/// The free parameters of a state with their values and deviations.
fn numbers(state: &State) -> Vec<(Parameter, f64, f64)> {
    let covariance = state.covariance();
    let model: &Model = &state.frame.model;
    let one = |(place, &index): (usize, &usize)| {
        let parameter = model.parameters()[index].clone();
        // What hardly moves a prediction is known no worse than its range says.
        let sigma = covariance[(place, place)].max(0.0).sqrt().min(range_sigma(&state.frame, index));
        (parameter, state.x[place], sigma)
    };
    state.frame.free.iter().enumerate().map(one).collect()
}

fn number((parameter, value, sigma): &(Parameter, f64, f64)) -> Number {
    let at_end_of_range = *value <= parameter.min || *value >= parameter.max;
    Number { name: parameter.name, value: *value, sigma: *sigma, at_end_of_range }
}

fn terms(proposal: &Proposal) -> Vec<TermReport> {
    let numbers = numbers(&proposal.state);
    let model = &proposal.state.frame.model;
    let of = |term: &crate::infer::propose::Proposed| {
        let spec = model.effects().map(|effect| effect.spec()).find(|spec| spec.id == term.name)?;
        let own = numbers.iter().filter(|(parameter, ..)| parameter.effect == term.name);
        Some(TermReport {
            name: term.name.clone(),
            status: "proposal",
            channel: spec.channel.name(),
            equation: spec.equation,
            words: term.words.clone(),
            delta_bic: term.delta_bic,
            parameters: own.map(number).collect(),
        })
    };
    proposal.terms.iter().filter_map(of).collect()
}

fn falls(evidence: &Evidence, before: &[(Channel, f64)], after: &[(Channel, f64)]) -> Vec<Fall> {
    let fall = |(&(channel, before), &(_, after)): (&(Channel, f64), &(Channel, f64))| Fall {
        channel: channel.name(),
        floor: evidence.floor(channel),
        rms_before: before,
        rms_after: after,
        share: if before > 0.0 { 1.0 - (after / before).powi(2) } else { 0.0 },
    };
    before.iter().zip(after).map(fall).collect()
}
