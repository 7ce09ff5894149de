//! Effects that a model lacks, ready to be tried on its logs.

use std::sync::Arc;

use energy::document::nearest;
use energy::units::S_PER_H;
use energy::{Channel, EffectSpec, Facts, Model, Parameter, ParameterSpec, catalogue};

use super::frame::Frame;
use super::judges::Unjudged;
use crate::measurement::{as_flag, conversion};
use crate::prepare::Prepared;
use crate::report::quantity::{quantity, unit_of};

/// An absent effect, in the model.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The effect.
    pub spec: &'static EffectSpec,
    /// The model with it, its other parameters where the base model's fit has them.
    pub model: Arc<Model>,
    /// Index of the effect's first parameter into [`Model::parameters`]; the others follow.
    pub first: usize,
    /// Points of its parameters at which its onset is looked at: just off the nulls, with the
    /// parameters that only shape it on a grid.
    pub onsets: Vec<Vec<f64>>,
    /// Whether it sums up effects that these logs hold no input for: one more to try only in place of those.
    pub stands_in: bool,
}

/// An effect that these logs cannot say anything about.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Untested {
    /// The effect.
    pub effect: &'static str,
    /// Why.
    pub reason: String,
    /// The column that these logs have and no held-out log that the model so far can predict, where that alone is why.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unjudged: Option<Unjudged>,
}

impl Untested {
    fn new(spec: &EffectSpec, reason: String) -> Untested {
        Untested { effect: spec.id, reason, unjudged: None }
    }
}

/// Every effect of the model's system that it lacks: those that can be tried at the frame's
/// unknowns, and those that cannot.
#[must_use]
pub fn candidates(frame: &Frame, x: &[f64]) -> (Vec<Candidate>, Vec<Untested>) {
    let base = Model::clone(&frame.model).with_values(&frame.values(x));
    let has = |id: &str| base.effects().any(|effect| effect.spec().id == id);
    let (mut able, mut unable) = (Vec::new(), Vec::new());
    let passed = passed(&base.facts, &frame.evidence.logs);
    for effect in catalogue().iter().filter(|effect| effect.spec().system == base.system && !has(effect.spec().id)) {
        let spec = effect.spec();
        if let Some(part) = effect.lumps().iter().find(|part| has(part)) {
            unable.push(Untested::new(spec, format!("it is the sum of several effects, and the model has {part} by itself")));
            continue;
        }
        if let Some(sum) = base.effects().find(|sum| sum.lumps().contains(&spec.id) && !sum.may_need().contains(&spec.id)) {
            let reason = format!("is a part of {}, which the model has: `lab fit --free {0}` asks for its numbers", sum.spec().id);
            unable.push(Untested::new(spec, reason));
            continue;
        }
        if let Some(reason) = effect.ruled_out(&base.facts) {
            unable.push(Untested::new(spec, reason.to_owned()));
            continue;
        }
        if let Some((channel, log)) = effect.told_by().iter().find_map(|&channel| Some((channel, tells(&frame.evidence.logs, channel)?))) {
            let reason = format!("is asked about only where nothing tells {}, which {log} does", channel.name());
            unable.push(Untested::new(spec, reason));
            continue;
        }
        if let Some((way, _)) = ["out of", "into"].iter().zip(passed).find(|(_, passed)| *passed < effect.reversal()) {
            let reason = format!("needs logs in which {:.1} % of the capacity pass {way} the battery in one go", 100.0 * effect.reversal());
            unable.push(Untested::new(spec, reason));
            continue;
        }
        let model = match base.with(spec.id) {
            Ok(model) => model,
            Err(reason) => {
                unable.push(Untested::new(spec, reason));
                continue;
            }
        };
        let made = |wanted| crate::prepare::predicted_channels(&model).contains(&wanted) || model.system.computed().contains(&wanted);
        let needs = || spec.needs.iter().copied().filter(|&channel| !made(channel));
        let missing = frame.evidence.logs.iter().find_map(|log| {
            let input = |wanted| log.inputs.iter().any(|(channel, _)| *channel == wanted);
            needs().find(|&channel| !input(channel)).map(|channel| (channel, log))
        });
        if let Some((channel, log)) = missing {
            let named = nearest(channel.name(), log.others.iter().map(String::as_str));
            let hint = named.map_or_else(String::new, |near| {
                format!(" (is it `{near}`? {})", as_flag(channel.name(), near, conversion(channel.name(), near)))
            });
            unable.push(Untested::new(spec, format!("needs the column {}, which {} lacks{hint}", channel.name(), log.name)));
            continue;
        }
        if let Some(unjudged) = frame.evidence.unjudged(&base, &model) {
            let reason = format!("needs the column {}, which {}", unjudged.column, unjudged.who_lacks());
            unable.push(Untested { unjudged: Some(unjudged), ..Untested::new(spec, reason) });
            continue;
        }
        if let Some((channel, log)) = predicts_an_input(frame, &model) {
            let channel = channel.name();
            let reason = format!("predicts {channel}, which {log} measured and nothing is judged by (--target)");
            unable.push(Untested::new(spec, reason));
            continue;
        }
        let first = model.parameters().iter().position(|parameter| parameter.effect == spec.id).unwrap_or(0);
        let stands_in = !effect.told_by().is_empty();
        able.push(Candidate { spec, onsets: onsets(spec), model: Arc::new(model), first, stands_in });
    }
    (able, unable)
}

/// Sizes of effects that nobody stated and no fit may change, in words: what is found beside them is the difference to a guess.
#[must_use]
pub fn held_at_defaults(model: &Model) -> Option<String> {
    let sizes = model.effects().flat_map(|effect| {
        let spec = effect.spec();
        spec.parameters.iter().filter(|own| own.null.is_some_and(|null| own.default != null)).map(move |own| (spec.id, own.name))
    });
    let parameter = |(effect, name): (&str, &str)| model.parameters().iter().find(|one| one.effect == effect && one.name == name);
    let held: Vec<&Parameter> = sizes.filter_map(parameter).filter(|one| !one.free && one.is_catalogue_default()).collect();
    let told = held.iter().map(|one| format!("{}.{} at {}", one.effect, one.name, quantity(one.value, unit_of(one.name))));
    let told: Vec<String> = told.collect();
    (!told.is_empty()).then(|| {
        format!(
            "{}: held at the catalogue's default, since the model gives it neither a value nor `free = true`: {}. What is found beside it is \
             the difference to it, and a resistance may come out below zero",
            model.name,
            told.join(", ")
        )
    })
}

/// The first log that tells what was counted so far. A gauge that counts from when it was set up begins at nothing, whatever the battery has seen
/// before; one that says all along that it is nothing means it.
fn tells(logs: &[Prepared], counted: Channel) -> Option<&str> {
    let from_nothing = |values: &[f64]| {
        values.iter().find(|value| value.is_finite()).zip(values.last()).is_some_and(|(first, last)| *first < 1.0 && last > first)
    };
    let tells = |log: &&Prepared| log.inputs.iter().any(|(channel, values)| *channel == counted && !from_nothing(values));
    logs.iter().find(tells).map(|log| log.name.as_str())
}

/// Largest share of a battery's capacity that passed in one go in any log, out of it and into it: what flowed back in between is
/// taken off.
fn passed(facts: &Facts, logs: &[Prepared]) -> [f64; 2] {
    let Facts::Battery(battery) = facts else { return [0.0; 2] };
    let mut most = [0.0_f64; 2];
    for log in logs {
        let Some((_, current_a)) = log.inputs.iter().find(|(channel, _)| *channel == Channel::CurrentA) else { continue };
        let mut since = [0.0_f64; 2];
        for (times, current_a) in log.time_s.windows(2).zip(&current_a[1..]) {
            let share = current_a * (times[1] - times[0]) / S_PER_H / battery.capacity_ah;
            for (way, sign) in [1.0, -1.0].into_iter().enumerate() {
                since[way] = (since[way] + sign * share).max(0.0);
                most[way] = most[way].max(since[way]);
            }
        }
    }
    most
}

/// A channel that the model would predict and that is a measured input of a log, but not to be judged by: nothing would hold the
/// prediction to what was measured.
fn predicts_an_input<'a>(frame: &'a Frame, model: &Model) -> Option<(Channel, &'a str)> {
    let predicted = crate::prepare::predicted_channels(model);
    frame.evidence.logs.iter().find_map(|log| {
        let unjudged = |channel: &Channel| !log.only.is_empty() && !log.only.contains(channel) && predicted.contains(channel);
        log.inputs.iter().map(|(channel, _)| *channel).find(unjudged).map(|channel| (channel, log.name.as_str()))
    })
}

/// Share of the way from null to a usual size at which an onset is looked at: far enough for
/// numbers that multiply each other, near enough to be the onset.
const ONSET: f64 = 1e-3;
/// Points of a grid of a parameter that only shapes an effect, beside its default.
const GRID: usize = 5;
/// The grid reaches from the default over this factor up and down, within the range.
const REACH: f64 = 50.0;

/// See [`Candidate::onsets`]; the first is its usual shape.
pub(super) fn onsets(spec: &EffectSpec) -> Vec<Vec<f64>> {
    let plain: Vec<f64> = spec.parameters.iter().map(onset).collect();
    let mut all = vec![plain.clone()];
    for (index, parameter) in spec.parameters.iter().enumerate().filter(|(_, parameter)| parameter.null.is_none()) {
        for value in grid(parameter) {
            let mut point = plain.clone();
            point[index] = value;
            all.push(point);
        }
    }
    all
}

/// A usual size of a parameter: its default or, where that is the null, a part of its range.
#[must_use]
pub fn usual(parameter: &ParameterSpec) -> f64 {
    match parameter.null {
        Some(null) if parameter.default == null => null + 0.05 * (parameter.max - null),
        _ => parameter.default,
    }
}

/// A value of a parameter just off where the effect does nothing.
pub(super) fn onset(parameter: &ParameterSpec) -> f64 {
    parameter.null.map_or(parameter.default, |null| null + ONSET * (usual(parameter) - null))
}

/// Whether a number of an effect refines it: it is nothing by default, where others of the effect have a size.
pub(super) fn refines(effect: &EffectSpec, number: &ParameterSpec) -> bool {
    is_nothing_by_default(number) && effect.parameters.iter().any(|other| other.null.is_some() && !is_nothing_by_default(other))
}

/// Whether a number does nothing where nobody states it.
pub(super) fn is_nothing_by_default(number: &ParameterSpec) -> bool {
    number.null == Some(number.default)
}

/// Which numbers of an effect do something only once others of it have a size: those that refine it, and do at the onset no more
/// beside the others than the share of their sizes that the onset is. What a fit makes of such a number there is noise over next
/// to nothing, and carries it to an end of its range. Each by whether it refines, and the square of what it does by its usual size.
pub(super) fn acts_through_others(numbers: impl Iterator<Item = (bool, f64)> + Clone) -> Vec<bool> {
    let most = numbers.clone().fold(0.0, |most: f64, (_, square)| most.max(square));
    numbers.map(|(refines, square)| refines && square < ONSET * ONSET * most).collect()
}

fn grid(parameter: &ParameterSpec) -> Vec<f64> {
    let share = |index: usize| (index as f64 + 0.5) / GRID as f64;
    let point = |index| {
        if parameter.min > 0.0 {
            let low = parameter.min.max(parameter.default / REACH).ln();
            let high = parameter.max.min(parameter.default * REACH).ln();
            (low + share(index) * (high - low)).exp()
        } else {
            parameter.min + share(index) * (parameter.max - parameter.min)
        }
    };
    (0..GRID).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_model;

    #[test]
    fn a_size_that_nobody_stated_and_that_is_held_is_told() {
        let given = Model::clone(&load_model("enertech-lco-2280mah").unwrap().model);
        assert_eq!(held_at_defaults(&given), None);
        let more = given.with("contact_resistance").unwrap();
        assert_eq!(held_at_defaults(&more), None, "what is added to be found is free");
        let text = "schema = 1\nsystem = \"robot\"\nname = \"r\"\n[[effect]]\nid = \"idle\"\n";
        let robot = Model::parse("r", text, &|_| unreachable!("no table")).unwrap();
        let told = held_at_defaults(&robot).unwrap();
        assert!(told.starts_with("r: held at the catalogue's default") && told.contains("idle."), "{told}");
    }

    #[test]
    fn a_number_that_refines_an_effect_waits_for_its_size_and_one_that_acts_alone_does_not() {
        assert_eq!(acts_through_others([(false, 1.0), (true, 1e-7)].into_iter()), [false, true]);
        assert_eq!(acts_through_others([(false, 1.0), (true, 1e-2)].into_iter()), [false, false]);
        assert_eq!(acts_through_others([(false, 1.0), (false, 1e-7)].into_iter()), [false, false]);
        let refining = |system, id: &str| {
            let spec = energy::find(system, id).unwrap().1.spec();
            spec.parameters.iter().filter(|number| refines(spec, number)).map(|number| number.name).collect::<Vec<_>>()
        };
        assert_eq!(refining(energy::System::Battery, "self_discharge"), ["activation_kj_per_mol"]);
        assert!(
            refining(energy::System::Battery, "ohmic_soc").is_empty() && refining(energy::System::Battery, "current_offset").is_empty()
        );
    }
}
