//! One effect after the other, until the model is complete or nothing explains what is left.

use std::sync::Arc;

use energy::{Channel, EffectSpec, Model, System, catalogue};

use super::candidate::{Candidate, Untested, candidates};
use super::evidence::Evidence;
use super::frame::Frame;
use super::score::{Score, Scoring};
use super::state::State;
use super::trial::{Trial, held_out};
use crate::report::quantity::unit_of;

/// What is known after one look at every absent effect.
#[derive(Debug, Clone)]
pub struct Step {
    /// The model so far, fitted.
    pub base: State,
    /// RMS on held-out logs with the model so far, by channel; empty without such logs.
    pub base_holdout: Vec<(Channel, f64)>,
    /// Every absent effect that the logs excite, by how much it explains.
    pub scores: Vec<Score>,
    /// The best of them refitted, best first.
    pub trials: Vec<Trial>,
    /// Why each of them is not accepted; nothing where it is.
    pub refusals: Vec<Vec<Refusal>>,
    /// Effects that cannot be tried on these logs.
    pub untested: Vec<Untested>,
    /// The conclusion.
    pub outcome: Outcome,
}

/// Why a refitted effect is not accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// The evidence is too weak for the number of effects tried.
    Evidence,
    /// It is smaller than a decision would notice.
    TooSmall,
    /// It hardly lowers the error of the logs that it was fitted to.
    Training,
    /// It does not help on the held-out logs.
    Holdout,
}

/// The conclusion of one look.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// The model explains the logs.
    Complete,
    /// The first trial is missing; the logs cannot tell it from those of these places.
    Missing(Vec<usize>),
    /// The model does not explain the logs and no effect does.
    Unknown,
}

/// Fall of the information criterion that an effect must bring, were it the only one tried.
const DELTA_BIC: f64 = 10.0;
/// Effects within this of the best one's information criterion are as likely.
const ALIKE: f64 = 10.0;
/// Effects that are refitted: the best by what a linear refit promises, and by the score against
/// slow noise.
const REFITTED: usize = 4;
const REFITTED_TOO: usize = 1;
/// Share of the squared error beyond the floor that an effect must take away: 5 % of the RMS.
const FALL: f64 = 0.1;
/// RMS over floor up to which a channel is explained.
const EXPLAINED: f64 = 1.05;

impl Step {
    /// Looks at every effect that the base model lacks.
    #[must_use]
    pub fn look(base: State, holdout: Option<&Arc<Evidence>>) -> Step {
        let (able, untested) = candidates(&base.frame, &base.x);
        let scoring = Scoring::new(&base);
        let mut scored: Vec<(Score, &Candidate)> = able.iter().filter_map(|one| scoring.score(one).map(|score| (score, one))).collect();
        scored.sort_by(|a, b| b.0.gain.total_cmp(&a.0.gain));
        let mut by_statistic: Vec<usize> = (0..scored.len()).collect();
        by_statistic.sort_by(|&a, &b| scored[b].0.statistic.total_cmp(&scored[a].0.statistic));
        let best_gain = scored.first().map_or(0.0, |(score, _)| score.gain);
        let worth_a_refit = |&place: &usize| {
            let score = &scored[place].0;
            let near = place < REFITTED && score.gain > 0.3 * best_gain || score.gain > best_gain - 2.0 * ALIKE;
            let next = by_statistic.iter().take(REFITTED_TOO).any(|&other| other == place);
            (near || next) && score.gain.max(score.statistic) > 0.5 * threshold(able.len())
        };
        let mut trials: Vec<Trial> = Vec::new();
        for place in (0..scored.len()).filter(worth_a_refit) {
            let (score, candidate) = &scored[place];
            let rival = trials.iter().map(|trial| trial.state.cost).fold(f64::INFINITY, f64::min) + 3.0 * ALIKE;
            trials.push(Trial::run(&base, candidate, score, rival, holdout));
        }
        trials.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
        let base_holdout = holdout.map_or_else(Vec::new, |evidence| held_out(&base, evidence));
        let refusals: Vec<Vec<Refusal>> = trials.iter().map(|trial| refusals(&base, trial, &base_holdout, holdout, able.len())).collect();
        // The accepted ones come first.
        let mut order: Vec<usize> = (0..trials.len()).collect();
        order.sort_by_key(|&place| !refusals[place].is_empty());
        let trials: Vec<Trial> = order.iter().map(|&place| trials[place].clone()).collect();
        let refusals: Vec<Vec<Refusal>> = order.iter().map(|&place| refusals[place].clone()).collect();
        let accepted = refusals.iter().take_while(|refusals| refusals.is_empty()).count();
        let outcome = match accepted {
            0 if explained(&base) => Outcome::Complete,
            0 => Outcome::Unknown,
            _ => {
                let alike = |&place: &usize| {
                    let likely = trials[0].delta_bic - trials[place].delta_bic < ALIKE;
                    likely && !same_form(trials[0].spec, trials[place].spec)
                };
                Outcome::Missing((1..accepted).filter(alike).collect())
            }
        };
        let scores = scored.into_iter().map(|(score, _)| score).collect();
        Step { base, base_holdout, scores, trials, refusals, untested, outcome }
    }
}

/// The evidence that one of so many effects must bring.
fn threshold(tried: usize) -> f64 {
    DELTA_BIC + 2.0 * (tried.max(1) as f64).ln()
}

/// Why a refitted effect, one of so many that were tried, is not accepted; empty when it is.
#[must_use]
pub fn refusals(base: &State, trial: &Trial, before: &[(Channel, f64)], holdout: Option<&Arc<Evidence>>, tried: usize) -> Vec<Refusal> {
    let mut all = Vec::new();
    if trial.delta_bic < threshold(tried) {
        all.push(Refusal::Evidence);
    }
    if trial.change < trial.spec.matters {
        all.push(Refusal::TooSmall);
    }
    if !falls(&base.frame.evidence, &base.rms(), &trial.state.rms()) {
        all.push(Refusal::Training);
    }
    if holdout.is_some_and(|evidence| !falls(evidence, before, &trial.holdout)) {
        all.push(Refusal::Holdout);
    }
    all
}

/// Whether the squared error, in floors, falls by a share of what lies beyond the floors.
fn falls(evidence: &Evidence, before: &[(Channel, f64)], after: &[(Channel, f64)]) -> bool {
    let rows = |channel| evidence.segments.iter().filter(|segment| segment.channel == channel).map(|s| s.rows.len()).sum::<usize>() as f64;
    let squares =
        |rms: &[(Channel, f64)]| rms.iter().map(|&(channel, rms)| rows(channel) * (rms / evidence.floor(channel)).powi(2)).sum::<f64>();
    let floor: f64 = before.iter().map(|&(channel, _)| rows(channel)).sum();
    let (before, after) = (squares(before), squares(after));
    before - after > (FALL * (before - floor)).max(0.0)
}

/// Whether one effect is another, or that with more freedom: it moves the same channel by
/// parameters of the same names.
fn same_form(a: &EffectSpec, b: &EffectSpec) -> bool {
    let within = |a: &EffectSpec, b: &EffectSpec| a.parameters.iter().all(|p| b.parameters.iter().any(|q| q.name == p.name));
    a.channel == b.channel && (within(a, b) || within(b, a))
}

/// Whether what is left of every channel is the sensors' noise, or less beyond it than the
/// smallest effect on such a channel that matters.
#[must_use]
pub fn explained(state: &State) -> bool {
    state.rms().iter().all(|&(channel, rms)| {
        let floor = state.frame.evidence.floor(channel);
        let beyond = (rms * rms - floor * floor).max(0.0).sqrt();
        rms <= EXPLAINED * floor || beyond < matters(state.frame.model.system, channel)
    })
}

/// Half of the smallest effect that matters on channels of this one's unit.
fn matters(system: System, channel: Channel) -> f64 {
    let specs = catalogue().iter().map(|effect| effect.spec()).filter(|spec| spec.system == system);
    let alike = specs.filter(|spec| unit_of(spec.channel.name()) == unit_of(channel.name()));
    0.5 * alike.map(|spec| spec.matters).fold(f64::INFINITY, f64::min)
}

/// The whole search.
#[derive(Debug, Clone)]
pub struct Search {
    /// Every look, first to last.
    pub steps: Vec<Step>,
    /// The model at the end.
    pub last: State,
}

/// Most effects that are added.
const EFFECTS_MAX: usize = 8;

/// Adds effects until the model is complete or none is accepted.
#[must_use]
pub fn search(model: Arc<Model>, evidence: Arc<Evidence>, holdout: Option<&Arc<Evidence>>) -> Search {
    let frame = Arc::new(Frame::new(model, evidence));
    let mut state = State::search(Arc::clone(&frame), &frame.start(), f64::NEG_INFINITY);
    let mut steps = Vec::new();
    loop {
        let step = Step::look(state, holdout);
        let go_on = matches!(step.outcome, Outcome::Missing(_)) && steps.len() < EFFECTS_MAX;
        let next = if go_on { step.trials[0].state.clone() } else { step.base.clone() };
        steps.push(step);
        state = next;
        if !go_on {
            return Search { steps, last: state };
        }
    }
}
