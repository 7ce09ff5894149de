//! What a search found, for people and programs: the answer of `lab diagnose` and `lab discover`.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::{Channel, Model, Parameter, catalogue};
use serde::Serialize;

use super::candidate::Untested;
use super::certainty::range_sigma;
use super::discover::Search;
use super::evidence::Evidence;
use super::judge::{Refusal, before_on, leaves_little};
use super::look::{Outcome, Step};
use super::noise::Noise;
use super::state::State;
use super::trial::Trial;
use crate::compare::WITHIN;

/// One word for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The model explains the logs.
    Complete,
    /// The effects in `selected` are missing.
    Missing,
    /// Something is missing, and the logs cannot tell which of several effects it is.
    Ambiguous,
    /// The model does not explain the logs, and no effect of the catalogue does.
    Unknown,
}

/// A number by channel, in the channel's unit.
pub type ByChannel = BTreeMap<&'static str, f64>;

/// Everything that a search says.
#[derive(Debug, Clone, Serialize)]
pub struct Discovery {
    /// Version of this structure.
    pub schema: u32,
    /// Name of the model.
    pub model: String,
    /// The conclusion.
    pub verdict: Verdict,
    /// Effects that are missing, in the order in which they were found.
    pub selected: Vec<&'static str>,
    /// With a verdict of `ambiguous`: all effects between which the logs cannot tell.
    pub equivalent: Vec<&'static str>,
    /// The same by what is missing: of each set it is one, and the logs cannot tell which.
    pub equivalent_sets: Vec<Vec<&'static str>>,
    /// Every absent effect, most promising first, as seen from the model that was given.
    pub ranking: Vec<Ranked>,
    /// How the error falls, effect by effect.
    pub ladder: Vec<Rung>,
    /// Free parameters at the end: effect, parameter.
    pub parameters: BTreeMap<&'static str, BTreeMap<&'static str, Value>>,
    /// What is left at the end, by channel.
    pub residual: BTreeMap<&'static str, Left>,
    /// What to do to tell the equivalent effects apart; empty when there are none.
    pub experiment: String,
    /// Effects that these logs say nothing about.
    pub untested: Vec<Untested>,
}

/// A number and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Value {
    /// The number that the model had when it was given; none where the effect is new.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given: Option<f64>,
    /// The number.
    pub value: f64,
    /// Its standard deviation; none where the logs do not determine it.
    pub sigma: Option<f64>,
    /// Whether it rests at an end of its range: what it stands for would have to be larger than it can be, or less than nothing.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub at_end_of_range: bool,
}

impl Value {
    /// Of a parameter, which the model `given` may have had.
    #[must_use]
    pub fn of(parameter: &Parameter, given: &Model, value: f64, sigma: Option<f64>) -> Value {
        let given = given.parameter(parameter.effect, parameter.name).map(|parameter| parameter.value);
        Value { given, value, sigma, at_end_of_range: value <= parameter.min || value >= parameter.max }
    }
}

/// One absent effect.
#[derive(Debug, Clone, Serialize)]
pub struct Ranked {
    /// Its name.
    pub effect: &'static str,
    /// Fall of the information criterion in a refit; none when it was not worth one.
    pub delta_bic: Option<f64>,
    /// Chance of a score like this when the effect is not there and all else is right.
    pub p_value: f64,
    /// Expected parameters.
    pub epc: BTreeMap<&'static str, f64>,
    /// Their standard deviations, from the refit.
    pub sigma: BTreeMap<&'static str, f64>,
    /// Share of it that a refit of the model could not absorb, 0..1.
    pub uniqueness: f64,
    /// Effects that look like it in these logs, and how much, 0..1.
    pub confounded_with: BTreeMap<&'static str, f64>,
    /// RMS before.
    pub rms_before: ByChannel,
    /// RMS after the refit; empty without one.
    pub rms_after: ByChannel,
    /// RMS on held-out logs before; empty without such logs.
    pub holdout_before: ByChannel,
    /// RMS on held-out logs after the refit.
    pub holdout_after: ByChannel,
    /// Why it was not accepted; empty when it was, was passed over, or was not refitted.
    pub refused: Vec<Refusal>,
    /// Whether it gains as much as the one that was taken first, which does about as well with fewer numbers.
    pub passed_over: bool,
}

/// One model on the way.
#[derive(Debug, Clone, Serialize)]
pub struct Rung {
    /// The effect that was added; none for the model as given.
    pub effect: Option<&'static str>,
    /// Fall of the information criterion that it brought; none for the model as given.
    pub delta_bic: Option<f64>,
    /// RMS on the logs that were fitted.
    pub train_rms: ByChannel,
    /// RMS on held-out logs; empty without such logs.
    pub holdout_rms: ByChannel,
    /// Noise of the sensors.
    pub floor: ByChannel,
    /// Channels for which the model states no floor: theirs is the noise that the logs show from row to row.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub floor_from_rows: Vec<&'static str>,
}

/// What is left of one channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Left {
    /// RMS.
    pub rms: f64,
    /// Noise of the sensor.
    pub floor: f64,
    /// Whether the model states no such floor: then it is the noise that the logs show from row to row.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub floor_from_rows: bool,
    /// Deviation of what is left beside white noise.
    pub slow: f64,
    /// Persistence of that, s.
    pub tau_s: f64,
}

impl Discovery {
    /// Of a finished search.
    #[must_use]
    pub fn of(search: &Search) -> Discovery {
        let found: Vec<&Step> = search.steps.iter().filter(|step| matches!(step.outcome, Outcome::Missing(_))).collect();
        let (first, last) = (&search.steps[0], search.last.told());
        let selected: Vec<&'static str> = found.iter().map(|step| step.trials[0].spec.id).collect();
        let equivalent_sets = equivalents(&found);
        let (equivalent, experiment) = (all_of(&equivalent_sets), experiments(&equivalent_sets));
        let complete = leaves_little(last) || within(last) && beyond(last) < MOSTLY * beyond(first.base.told());
        let verdict = match () {
            () if !complete => Verdict::Unknown,
            () if !equivalent.is_empty() => Verdict::Ambiguous,
            () if selected.is_empty() => Verdict::Complete,
            () => Verdict::Missing,
        };
        Discovery {
            schema: 1,
            model: first.base.frame.model.name.clone(),
            verdict,
            selected,
            equivalent,
            equivalent_sets,
            ranking: ranking(first),
            ladder: ladder(search),
            parameters: parameters(&first.base.frame.model, last),
            residual: left(last),
            experiment,
            untested: untested(search),
        }
    }
}

/// Effects that the model as given could not be tried with, and those that could be until something was found which leaves no held-out
/// log to judge them.
fn untested(search: &Search) -> Vec<Untested> {
    let mut all = search.steps[0].untested.clone();
    let later = search.steps.last().into_iter().flat_map(|step| &step.untested).filter(|one| one.unjudged.is_some());
    for one in later {
        if !all.iter().any(|known| known.effect == one.effect) {
            all.push(one.clone());
        }
    }
    all
}

/// Share of the squared error beyond the floor that may be left when what was found is called the
/// answer: physics of another form than the catalogue's leaves some.
const MOSTLY: f64 = 0.15;

/// Whether the error is what `lab compare` counts as the sensors' floor.
fn within(state: &State) -> bool {
    state.rms().iter().all(|&(channel, rms)| rms <= WITHIN * state.frame.evidence.floor(channel))
}

/// Mean square beyond the floor, in floors.
fn beyond(state: &State) -> f64 {
    let over = |&(channel, rms): &(Channel, f64)| ((rms / state.frame.evidence.floor(channel)).powi(2) - 1.0).max(0.0);
    state.rms().iter().map(over).sum()
}

fn by_channel(numbers: &[(Channel, f64)]) -> ByChannel {
    numbers.iter().map(|&(channel, number)| (channel.name(), number)).collect()
}

/// The effects between which the logs cannot tell, the one that was taken first in each set.
fn equivalents(found: &[&Step]) -> Vec<Vec<&'static str>> {
    let set = |step: &&Step| match &step.outcome {
        Outcome::Missing(others) if !others.is_empty() => Some([&[step.trials[0].spec.id], &others[..]].concat()),
        _ => None,
    };
    found.iter().filter_map(set).collect()
}

/// All effects of these sets, each once.
fn all_of(sets: &[Vec<&'static str>]) -> Vec<&'static str> {
    let mut all = Vec::new();
    sets.iter().flatten().for_each(|id| {
        if !all.contains(id) {
            all.push(*id)
        }
    });
    all
}

/// What would tell the first of each set from the others.
fn experiments(sets: &[Vec<&'static str>]) -> String {
    let mut all = Vec::new();
    for (best, others) in sets.iter().filter_map(|set| set.split_first()) {
        for words in others.iter().map(|other| experiment(best, other)) {
            if !all.contains(&words) {
                all.push(words);
            }
        }
    }
    all.join("; ")
}

fn experiment(one: &str, other: &str) -> String {
    let spec = |id: &str| catalogue().iter().map(|effect| effect.spec()).find(|spec| spec.id == id);
    let says = |a: &str, b: &str| spec(a)?.confused_with.iter().find(|(id, _)| *id == b).map(|(_, what)| *what);
    match says(one, other).or_else(|| says(other, one)) {
        Some(what) => format!("to tell {one} from {other}: {what}"),
        None => format!("to tell {one} from {other}: a log in which one changes while the other does not"),
    }
}

fn ranking(step: &Step) -> Vec<Ranked> {
    let before = by_channel(&step.base.told().rms());
    let before_on = |held: Option<&Arc<Evidence>>| by_channel(&before_on(&step.base, step.held.as_ref(), &step.base_holdout, held));
    let trial = |id: &str| step.trials.iter().position(|trial| trial.spec.id == id);
    let mut all: Vec<Ranked> = step
        .scores
        .iter()
        .map(|score| {
            let place = trial(score.spec.id);
            let refit = place.map(|place| &step.trials[place]);
            // Where the logs point the other way, nothing is expected of it.
            let is_seen = score.statistic > 0.0;
            let expected = score
                .spec
                .parameters
                .iter()
                .zip(&score.expected)
                .map(|(parameter, expected)| (parameter.name, parameter.null.filter(|_| !is_seen).unwrap_or(*expected)));
            let others = step.scores.iter().filter(|other| other.spec.id != score.spec.id);
            let alike = others.map(|other| (other.spec.id, score.confounded(other))).filter(|(_, alike)| *alike > WORTH_NAMING);
            let own = refit.map(own_parameters);
            Ranked {
                effect: score.spec.id,
                delta_bic: refit.map(|trial| trial.delta_bic),
                p_value: chance(score.statistic, score.freedom),
                epc: match &own {
                    Some(own) => own.iter().map(|&(name, value, _)| (name, value)).collect(),
                    None => expected.collect(),
                },
                sigma: own.iter().flatten().filter_map(|&(name, _, sigma)| Some((name, sigma?))).collect(),
                uniqueness: score.uniqueness,
                confounded_with: alike.collect(),
                rms_before: before.clone(),
                rms_after: refit.map(|trial| by_channel(&trial.state.told().rms())).unwrap_or_default(),
                holdout_before: before_on(refit.and_then(|trial| trial.held.as_ref())),
                holdout_after: refit.map(|trial| by_channel(&trial.holdout)).unwrap_or_default(),
                refused: place.map(|place| step.refusals[place].clone()).unwrap_or_default(),
                passed_over: place.is_some_and(|place| step.passes_over(place)),
            }
        })
        .collect();
    let order = |ranked: &Ranked| trial(ranked.effect).unwrap_or(usize::MAX);
    all.sort_by_key(order);
    all
}

/// Confounding from which on it is worth naming.
const WORTH_NAMING: f64 = 0.5;

/// Chance of a statistic at least this large, for chi-squared with this freedom.
fn chance(statistic: f64, freedom: usize) -> f64 {
    use statrs::distribution::{ChiSquared, ContinuousCDF as _};
    ChiSquared::new(freedom.max(1) as f64).map_or(1.0, |distribution| distribution.sf(statistic.max(0.0)))
}

fn own_parameters(trial: &Trial) -> Vec<(&'static str, f64, Option<f64>)> {
    let model = &trial.state.frame.model;
    let deviations = deviations(trial.state.told());
    let own = deviations.into_iter().filter(|&(index, _, _)| model.parameters()[index].effect == trial.spec.id);
    own.map(|(index, value, sigma)| (model.parameters()[index].name, value, sigma)).collect()
}

/// Index, value and deviation of every free parameter by itself. One of which the logs say hardly more
/// than its range has none, one that was stated better than they know it is as it was stated.
#[must_use]
pub fn deviations(state: &State) -> Vec<(usize, f64, Option<f64>)> {
    let sigmas = state.sigmas_by_rows();
    let of = |(place, &index): (usize, &usize)| {
        if let Some((value, sigma)) = state.better_as_stated(place) {
            return (index, value, Some(sigma));
        }
        let known = sigmas[place] < OPEN * range_sigma(&state.frame, index);
        (index, state.x[place], known.then_some(sigmas[place]))
    };
    state.frame.free.iter().enumerate().map(of).collect()
}

/// Share of the deviation that a range alone leaves from which on a number counts as open.
const OPEN: f64 = 0.9;

fn ladder(search: &Search) -> Vec<Rung> {
    let floor = by_channel(&search.last.frame.evidence.floors);
    let floor_from_rows = floors_from_rows(&search.last);
    let first = &search.steps[0];
    let found = || search.steps.iter().filter(|step| matches!(step.outcome, Outcome::Missing(_)));
    // Errors are told of the same logs all the way: of those that the model at the end can predict.
    let held = found().last().and_then(|step| step.trials[0].held.as_ref());
    let mut rungs = vec![Rung {
        effect: None,
        delta_bic: None,
        train_rms: by_channel(&first.base.told().rms()),
        holdout_rms: by_channel(&before_on(&first.base, first.held.as_ref(), &first.base_holdout, held)),
        floor: floor.clone(),
        floor_from_rows: floor_from_rows.clone(),
    }];
    for step in found() {
        let best = &step.trials[0];
        rungs.push(Rung {
            effect: Some(best.spec.id),
            delta_bic: Some(best.delta_bic),
            train_rms: by_channel(&best.state.told().rms()),
            holdout_rms: by_channel(&before_on(&best.state, best.held.as_ref(), &best.holdout, held)),
            floor: floor.clone(),
            floor_from_rows: floor_from_rows.clone(),
        });
    }
    rungs
}

/// Channels for which the model states no sensor floor.
pub(crate) fn floors_from_rows(state: &State) -> Vec<&'static str> {
    let model = &state.frame.model;
    let unstated = |channel: &Channel| model.sensor(*channel).floor() <= 0.0;
    state.frame.evidence.floors.iter().map(|(channel, _)| *channel).filter(unstated).map(Channel::name).collect()
}

fn parameters(given: &Model, state: &State) -> BTreeMap<&'static str, BTreeMap<&'static str, Value>> {
    let mut all: BTreeMap<_, BTreeMap<_, _>> = BTreeMap::new();
    for (index, value, sigma) in deviations(state) {
        let parameter = &state.frame.model.parameters()[index];
        all.entry(parameter.effect).or_default().insert(parameter.name, Value::of(parameter, given, value, sigma));
    }
    all
}

fn left(state: &State) -> BTreeMap<&'static str, Left> {
    let from_rows = floors_from_rows(state);
    let noise = |wanted| state.noise.iter().find(|(channel, _)| *channel == wanted).map(|(_, noise)| *noise);
    let of = |(channel, rms): (Channel, f64)| {
        let (floor, noise) = (state.frame.evidence.floor(channel), noise(channel));
        // What is forgotten from one row to the next is no slower than white noise.
        let lasts = |noise: &Noise| noise.tau_s > state.frame.evidence.step_s(channel);
        let (slow, tau_s) = noise.filter(lasts).map_or((0.0, 0.0), |noise| (noise.slow.min(rms), noise.tau_s));
        let floor_from_rows = from_rows.contains(&channel.name());
        (channel.name(), Left { rms, floor, floor_from_rows, slow, tau_s })
    };
    state.rms().into_iter().map(of).collect()
}
