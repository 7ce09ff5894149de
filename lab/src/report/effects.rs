//! The catalogue of effects as tables, cards and JSON.

use std::fmt::Write as _;

use energy::document::hint;
use energy::effect::expression;
use energy::{Channel, EffectSpec, System, catalogue};
use serde::Serialize;

use super::quantity::unit_of;
use super::table::{table, text};

/// An effect, for JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectCard {
    /// Name in files.
    pub id: &'static str,
    /// `battery`, `robot` or `station`.
    pub system: &'static str,
    /// One line for people.
    pub title: &'static str,
    /// The channel that it adds to or transforms.
    pub channel: &'static str,
    /// Equation in plain text.
    pub equation: &'static str,
    /// Where the equation comes from.
    pub source: &'static str,
    /// Where it holds.
    pub validity: &'static str,
    /// What its absence looks like in residuals.
    pub signature: &'static str,
    /// Smallest change of the channel that matters, in the channel's unit.
    pub matters: f64,
    /// Channels that a log must have.
    pub needs: Vec<&'static str>,
    /// Its parameters.
    pub parameters: Vec<ParameterCard>,
    /// Effects that it may be mistaken for.
    pub confused_with: Vec<Confusion>,
}

/// A parameter, for JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterCard {
    /// Name with unit.
    pub name: &'static str,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// Meaning.
    pub meaning: &'static str,
    /// Start value when nothing better is known.
    pub default: f64,
    /// Value at which the effect vanishes, if there is one.
    pub null: Option<f64>,
    /// Least plausible value.
    pub min: f64,
    /// Greatest plausible value.
    pub max: f64,
    /// Where default and range come from.
    pub source: &'static str,
}

/// Two effects that data may not tell apart, for JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confusion {
    /// The other effect.
    pub effect: &'static str,
    /// What tells them apart.
    pub experiment: &'static str,
}

/// Why there is no such effect.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoEffect {
    /// No effect has this name.
    #[error("no effect `{id}`{hint} `lab effects` lists them all")]
    Unknown {
        /// What was asked for.
        id: String,
        /// The nearest, or a full stop.
        hint: String,
    },
    /// Several systems have one of this name.
    #[error("several systems have an effect `{id}`: say {choices}")]
    Ambiguous {
        /// What was asked for.
        id: String,
        /// The full names.
        choices: String,
    },
}

impl EffectCard {
    fn of(spec: &'static EffectSpec) -> EffectCard {
        let parameter = |p: &'static energy::ParameterSpec| ParameterCard {
            name: p.name,
            unit: unit_of(p.name),
            meaning: p.meaning,
            default: p.default,
            null: p.null,
            min: p.min,
            max: p.max,
            source: p.source,
        };
        EffectCard {
            id: spec.id,
            system: spec.system.name(),
            title: spec.title,
            channel: spec.channel.name(),
            equation: spec.equation,
            source: spec.source,
            validity: spec.validity,
            signature: spec.signature,
            matters: spec.matters,
            needs: spec.needs.iter().map(|channel| channel.name()).collect(),
            parameters: spec.parameters.iter().map(parameter).collect(),
            confused_with: spec.confused_with.iter().map(|&(effect, experiment)| Confusion { effect, experiment }).collect(),
        }
    }
}

/// The whole catalogue, or that of one system, and how users write effects of their own.
#[must_use]
pub fn cards(system: Option<System>) -> Vec<EffectCard> {
    let specs = catalogue().iter().map(|effect| effect.spec());
    let known = specs.filter(|spec| system.is_none_or(|system| spec.system == system)).map(EffectCard::of);
    known.chain([expression()]).collect()
}

/// The effect whose equation stands in the model file.
fn expression() -> EffectCard {
    EffectCard {
        id: expression::ID,
        system: "any",
        title: "A formula of the user",
        channel: "the channel that it names",
        equation: "channel += formula(channels, own parameters, own states, time_s)",
        source: "the model file",
        validity: "any number in a model, told apart by name; acts last in its phase; adds nothing where it is not finite",
        signature: "that of its formula",
        matters: 0.0,
        needs: Vec::new(),
        parameters: Vec::new(),
        confused_with: Vec::new(),
    }
}

/// What a formula of each system may add to and read, with an example.
fn how_to_write() -> String {
    let mut whole = "\n".to_owned();
    for system in [System::Battery, System::Robot, System::Station] {
        let names = |channels: Vec<Channel>| channels.iter().map(|channel| channel.name()).collect::<Vec<_>>().join(", ");
        let adds = expression::addable(system).into_iter().map(|(channel, _)| channel).collect();
        let _ = writeln!(whole, "{}: adds to {}\n  may read {}", system.name(), names(adds), names(expression::readable(system)));
    }
    let functions = expression::formula::function_names().collect::<Vec<_>>().join(", ");
    let _ =
        write!(whole, "\noperators + - * / ^ and parentheses; functions {functions}; pi; {} since the start\n{EXAMPLE}", expression::TIME);
    whole
}

const EXAMPLE: &str = r#"
[[effect]]
id = "expression"
name = "near_empty"
channel = "overpotential_v"
formula = "k * slow * exp(-soc / a)"
k = { value = 0.1, source = "guess", free = true, min = 0.0, max = 2.0, null = 0.0 }
a = { value = 0.1, source = "guess", free = true, min = 0.01, max = 1.0 }
tau_s = { value = 60.0, source = "guess", min = 1.0, max = 1000.0 }
states = { slow = { input = "cell_current_a", tau = "tau_s" } }
"#;

/// The effect of that name among the cards: `id`, or `system/id` where systems share an id.
///
/// # Errors
/// With the near match, or with the full names of those that share the id.
pub fn find<'a>(cards: &'a [EffectCard], id: &str) -> Result<&'a EffectCard, NoEffect> {
    let (system, bare) = id.split_once('/').map_or((None, id), |(system, bare)| (Some(system), bare));
    let named = |card: &&EffectCard| card.id == bare && system.is_none_or(|system| card.system == system);
    let found: Vec<&EffectCard> = cards.iter().filter(named).collect();
    match found[..] {
        [card] => Ok(card),
        [] => {
            let full: Vec<String> = cards.iter().map(|card| format!("{}/{}", card.system, card.id)).collect();
            let hint = match system {
                Some(_) => hint(id, full.iter().map(String::as_str)),
                None => hint(id, cards.iter().map(|card| card.id)),
            };
            Err(NoEffect::Unknown { id: id.to_owned(), hint: if hint.is_empty() { ".".to_owned() } else { hint } })
        }
        _ => {
            let choices: Vec<String> = found.iter().map(|card| format!("{}/{}", card.system, card.id)).collect();
            Err(NoEffect::Ambiguous { id: id.to_owned(), choices: choices.join(" or ") })
        }
    }
}

/// The catalogue as a table.
#[must_use]
pub fn list(cards: &[EffectCard]) -> String {
    let mut table = table(&["effect", "system", "title", "parameters", "needs"]);
    for card in cards {
        let parameters: Vec<&str> = card.parameters.iter().map(|parameter| parameter.name).collect();
        table.add_row([card.id, card.system, card.title, &parameters.join("\n"), &card.needs.join("\n")]);
    }
    text(&table)
}

/// Everything about one effect.
#[must_use]
pub fn card(card: &EffectCard) -> String {
    let mut parameters = table(&["parameter", "unit", "default", "null", "range", "meaning", "source"]);
    for p in &card.parameters {
        parameters.add_row([
            p.name.to_owned(),
            p.unit.to_owned(),
            p.default.to_string(),
            p.null.map_or_else(|| "-".to_owned(), |null| null.to_string()),
            format!("{} .. {}", p.min, p.max),
            p.meaning.to_owned(),
            p.source.to_owned(),
        ]);
    }
    let needs = if card.needs.is_empty() { "nothing beyond its system's inputs".to_owned() } else { card.needs.join(", ") };
    if card.id == expression::ID {
        return format!("{}: {}\n\nequation   {}\nvalidity   {}\n{}", card.id, card.title, card.equation, card.validity, how_to_write());
    }
    let mut whole = format!(
        "{}/{}: {}\n\nequation   {}\nsource     {}\nvalidity   {}\nadds to    {}\nneeds      {needs}\nabsence    {}\nmatters    from {} {} of {}\n\n{}",
        card.system,
        card.id,
        card.title,
        card.equation,
        card.source,
        card.validity,
        card.channel,
        card.signature,
        card.matters,
        unit_of(card.channel),
        card.channel,
        text(&parameters),
    );
    for confusion in &card.confused_with {
        let _ = write!(whole, "\nMay be mistaken for {}. What tells them apart: {}.\n", confusion.effect, confusion.experiment);
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_that_two_systems_share_must_be_said_in_full() {
        let robots = cards(Some(System::Robot)).into_iter().find(|card| card.id == "converter").unwrap();
        let both = [robots.clone(), EffectCard { system: "station", ..robots }];
        let error = find(&both, "converter").unwrap_err().to_string();
        assert!(error.ends_with("say robot/converter or station/converter"), "{error}");
        assert_eq!(find(&both, "station/converter").unwrap().system, "station");
        let error = find(&both, "station/convertor").unwrap_err().to_string();
        assert!(error.contains("did you mean `station/converter`?"), "{error}");
    }

    #[test]
    fn every_card_prints_its_equation_and_parameters() {
        for one in cards(None) {
            let text = card(&one);
            assert!(text.contains(one.equation) && one.parameters.iter().all(|p| text.contains(p.name)), "{text}");
        }
    }
}
