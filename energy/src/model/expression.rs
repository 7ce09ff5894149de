//! Reads `[[effect]] id = "expression"`: a formula with its channel, parameters and states.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use super::Parameter;
use super::file::Keys;
use crate::Channel;
use crate::document::{Document, DocumentError, hint};
use crate::effect::Effect;
use crate::effect::expression::{Definition, Expression, ID, Lag, OwnParameter, Part, addable, phase_from_name};
use crate::system::{Facts, System};

#[derive(Deserialize)]
#[serde(expecting = "a table", deny_unknown_fields)]
struct RawOwn {
    value: f64,
    #[serde(default)]
    sigma: f64,
    source: String,
    #[serde(default)]
    free: bool,
    min: Option<f64>,
    max: Option<f64>,
    null: Option<f64>,
    #[serde(default)]
    meaning: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLag {
    input: String,
    tau: String,
}

/// Reach of a parameter whose range is not given, as a multiple of its value.
const REACH: f64 = 10.0;

/// Reads the keys of an expression, without its id and its rail.
pub(super) fn read(
    document: &Document<'_>,
    system: System,
    facts: &Facts,
    span: Range<usize>,
    mut keys: Keys,
) -> Result<(&'static dyn Effect, Vec<Parameter>), DocumentError> {
    let mut places: BTreeMap<&'static str, Range<usize>> = BTreeMap::new();
    let mut text = |name: &'static str| {
        let key = keys.keys().find(|key| key.get_ref() == name).cloned();
        let Some(value) = key.and_then(|key| keys.remove(&key)) else { return Ok(None) };
        places.insert(name, value.span());
        match value.get_ref() {
            toml::Value::String(text) => Ok(Some(text.clone())),
            _ => Err(document.error_at(value.span(), format!("{name} of an expression is a text in quotes"))),
        }
    };
    let name = text("name")?.unwrap_or_else(|| ID.to_owned());
    let title = text("title")?.unwrap_or_else(|| format!("Formula `{name}`"));
    let (channel_name, phase_name) = (text("channel")?, text("phase")?);
    let formula = text("formula")?.ok_or_else(|| document.error_at(span.clone(), "an expression needs a formula = \"..\""))?;
    let allowed = addable(system);
    let names = || allowed.iter().map(|(channel, _)| channel.name());
    let list = || names().collect::<Vec<_>>().join(", ");
    let channel_name = channel_name.ok_or_else(|| {
        document.error_at(span.clone(), format!("an expression needs the channel = \"..\" that it adds to. Allowed: {}", list()))
    })?;
    let at = |name: &str| places.get(name).cloned().unwrap_or_else(|| span.clone());
    let channel = Channel::from_name(&channel_name).ok_or_else(|| {
        let message = format!(
            "unknown channel `{channel_name}`{} An expression of a {} may add to: {}",
            hint(&channel_name, names()),
            system.name(),
            list()
        );
        document.error_at(at("channel"), message)
    })?;
    let phase = phase_name.map(|name| {
        let known: Vec<String> = system.phases().iter().map(|phase| format!("{phase:?}").to_lowercase()).collect();
        phase_from_name(system, &name).ok_or_else(|| {
            let message = format!(
                "a {} has no phase `{name}`{} Its phases: {}",
                system.name(),
                hint(&name, known.iter().map(String::as_str)),
                known.join(", ")
            );
            document.error_at(at("phase"), message)
        })
    });
    let mut definition =
        Definition { name, title, channel, phase: phase.transpose()?, formula, states: Vec::new(), parameters: Vec::new() };
    let mut raw = Vec::new();
    let mut states_at = span.clone();
    for (key, value) in &keys {
        if key.get_ref() == "states" {
            states_at = value.span();
            let states: BTreeMap<String, RawLag> = value.get_ref().clone().try_into().map_err(|error: toml::de::Error| {
                document.error_at(value.span(), format!("states: {}; write slow = {{ input = \"..\", tau = \"..\" }}", error.message()))
            })?;
            definition.states.extend(states.into_iter().map(|(name, RawLag { input, tau })| Lag { name, input, tau }));
        } else {
            raw.push((key, value));
        }
    }
    let taus: Vec<String> = definition.states.iter().map(|lag| lag.tau.clone()).collect();
    let mut given = Vec::new();
    for (key, value) in raw {
        let (own, one) = parameter(document, key.get_ref(), taus.contains(key.get_ref()), value)?;
        definition.parameters.push(own);
        given.push((one, value.span()));
    }
    let effect = Expression::new(system, facts, &definition).map_err(|error| {
        let whole = match &error.part {
            Part::Name => at("name"),
            Part::Channel => at("channel"),
            Part::Phase => at("phase"),
            Part::Formula => at("formula"),
            Part::Input(_) | Part::State(_) => states_at.clone(),
            Part::Parameter(name) => {
                definition.parameters.iter().position(|own| own.name == *name).map_or(span.clone(), |index| given[index].1.clone())
            }
        };
        let input = |name: &str| definition.states.iter().find(|lag| lag.name == name).map_or("", |lag| lag.input.as_str());
        let place = match (&error.part, error.at) {
            (Part::Formula, Some(bytes)) => inside(document.text, whole, &definition.formula, bytes),
            (Part::Input(name), Some(bytes)) => inside(document.text, whole, input(name), bytes),
            _ => whole,
        };
        document.error_at(place, format!("expression `{}`: {}", definition.name, error.message))
    })?;
    // The effect's own names live as long as the program.
    let spec = Effect::spec(effect);
    let parameters = given.into_iter().zip(spec.parameters).map(|((own, _), known)| Parameter { effect: spec.id, name: known.name, ..own });
    Ok((effect, parameters.collect()))
}

/// Bytes of a formula, within the stretch of the document that holds it: exact where it is spelt
/// there as it is, without escapes.
fn inside(text: &str, whole: Range<usize>, formula: &str, bytes: Range<usize>) -> Range<usize> {
    match text.get(whole.clone()).and_then(|stretch| stretch.find(formula)) {
        Some(offset) => whole.start + offset + bytes.start..whole.start + offset + bytes.end,
        None => whole,
    }
}

fn parameter(
    document: &Document<'_>,
    name: &str,
    is_tau: bool,
    given: &Spanned<toml::Value>,
) -> Result<(OwnParameter, Parameter), DocumentError> {
    let fail = |message: String| document.error_at(given.span(), format!("{name}: {message}"));
    let raw: RawOwn = given.get_ref().clone().try_into().map_err(|error: toml::de::Error| {
        let keys = "name, title, channel, phase, formula, states";
        fail(format!("{}; a parameter is {{ value = .., source = \"..\" }}. Other keys of an expression: {keys}", error.message()))
    })?;
    if !raw.value.is_finite() || raw.null.is_some_and(|null| !null.is_finite()) {
        return Err(fail("value and null must be finite".to_owned()));
    }
    let reach = if raw.value == 0.0 { 1.0 } else { REACH * raw.value.abs() };
    let (low, high) = if is_tau { (raw.value / REACH, reach) } else { (-reach, reach) };
    let null = raw.null.unwrap_or(raw.value);
    let (min, max) = (raw.min.unwrap_or(low.min(null)), raw.max.unwrap_or(high.max(null)));
    if !(min.is_finite() && max.is_finite() && min < max) {
        return Err(fail(format!("min = {min} must lie below max = {max}")));
    }
    if ![raw.value, null].iter().all(|value| (min..=max).contains(value)) {
        return Err(fail(format!("value and null must be between {min} and {max}")));
    }
    if !raw.sigma.is_finite() || raw.sigma < 0.0 {
        return Err(fail(format!("sigma = {} must be finite and >= 0", raw.sigma)));
    }
    let own = OwnParameter { name: name.to_owned(), meaning: raw.meaning, value: raw.value, null: raw.null, min, max };
    let one =
        Parameter { effect: "", name: "", value: raw.value, sigma: raw.sigma, source: raw.source, free: raw.free, min, max, follows: None };
    Ok((own, one))
}
