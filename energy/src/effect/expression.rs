//! Effects that a user writes as a formula in a model file.
//!
//! `channel += formula(channels, own parameters, own states)`. A state is the low-passed copy of
//! another formula, `dx/dt = (u - x) / tau`, stepped exactly for an input held over the step. The
//! name `time_s` stands for the seconds since the run, or the log, began.
//!
//! An expression is an effect like those of the catalogue for everything that steps, fits or
//! prints models. It acts last in its phase. A share that is not finite adds nothing, so that a
//! formula's pole cannot take a forecast with it.

pub mod formula;
mod range;

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use formula::{Formula, FormulaError, Name, function_names};

use super::{EffectSpec, Own, ParameterSpec, Phase, Physics, catalogue};
use crate::document::hint;
use crate::{Channel, Channels, Facts, Real, System};

/// Id of every expression in a model file, and name of one that has none.
pub const ID: &str = "expression";
/// Name of the seconds since a run began.
pub const TIME: &str = "time_s";

/// What a user says of an expression.
#[derive(Debug, Clone, PartialEq)]
pub struct Definition {
    /// Tells it from other effects of the model.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// The channel that it adds to.
    pub channel: Channel,
    /// When it acts; none for the last phase in which effects add to the channel.
    pub phase: Option<Phase>,
    /// What it adds, in the channel's unit.
    pub formula: String,
    /// Low-passed copies.
    pub states: Vec<Lag>,
    /// Its parameters.
    pub parameters: Vec<OwnParameter>,
}

/// A low-passed copy of a formula.
#[derive(Debug, Clone, PartialEq)]
pub struct Lag {
    /// Its name in the formula.
    pub name: String,
    /// What it follows: a formula over channels and parameters.
    pub input: String,
    /// The parameter that is its time constant, s.
    pub tau: String,
}

/// A parameter of an expression.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnParameter {
    /// Its name in the formula.
    pub name: String,
    /// What it means.
    pub meaning: String,
    /// Value.
    pub value: f64,
    /// Value at which the expression vanishes, together with the other nulls.
    pub null: Option<f64>,
    /// Least plausible value.
    pub min: f64,
    /// Greatest plausible value.
    pub max: f64,
}

/// The part of a definition that an error is about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Part {
    /// Its name.
    Name,
    /// Its channel.
    Channel,
    /// Its phase.
    Phase,
    /// Its formula.
    Formula,
    /// The state of that name: its input.
    Input(String),
    /// The state of that name: all else.
    State(String),
    /// The parameter of that name.
    Parameter(String),
}

/// What is wrong with a definition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExpressionError {
    /// In which of its parts.
    pub part: Part,
    /// In which bytes of that text; none for all of it.
    pub at: Option<std::ops::Range<usize>>,
    /// What is wrong, and what is allowed.
    pub message: String,
}

fn wrong<T>(part: Part, message: String) -> Result<T, ExpressionError> {
    Err(ExpressionError { part, at: None, message })
}

/// A formula that steps.
#[derive(Debug)]
pub struct Expression {
    spec: &'static EffectSpec,
    formula: Formula,
    /// Inputs of the low-passed copies and places of their time constants.
    lags: Vec<(Formula, usize)>,
    /// Whether its last state counts the seconds.
    tells_time: bool,
}

/// Every definition met so far. What names an effect lives as long as the program, for effects of
/// the catalogue and so for these; one definition is kept once, however often its file is read.
static KEPT: Mutex<BTreeMap<String, &'static Expression>> = Mutex::new(BTreeMap::new());

impl Expression {
    /// Checks a definition and makes it ready for a system with these facts.
    ///
    /// # Errors
    /// With the part of the definition and what was probably meant.
    pub fn new(system: System, facts: &Facts, definition: &Definition) -> Result<&'static Expression, ExpressionError> {
        let parts = Expression::checked(system, definition)?;
        range::check_finite(facts, definition, &parts)?;
        let key = format!("{system:?} {definition:?}");
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(kept.entry(key).or_insert_with(|| {
            let Parts { phase, formula, lags, tells_time, used } = parts;
            let spec = spec(system, phase, definition, &used, tells_time);
            Box::leak(Box::new(Expression { spec: Box::leak(Box::new(spec)), formula, lags, tells_time }))
        }))
    }

    fn checked(system: System, definition: &Definition) -> Result<Parts, ExpressionError> {
        let name = &definition.name;
        if !is_name(name) {
            return wrong(Part::Name, format!("`{name}` is no name: letters, digits and _, not beginning with a digit"));
        }
        if super::find(system, name).is_some() {
            return wrong(Part::Name, format!("`{name}` is the name of an effect of the catalogue; give the expression another"));
        }
        let phase = phase(system, definition)?;
        let channels = readable(system);
        for (index, parameter) in definition.parameters.iter().enumerate() {
            let taken = definition.parameters[..index].iter().any(|other| other.name == parameter.name);
            own_name(Part::Parameter(parameter.name.clone()), &parameter.name, taken)?;
        }
        let place = |wanted: &str| definition.parameters.iter().position(|parameter| parameter.name == wanted);
        let of_input = |name: &str| channel(&channels, name).or_else(|| place(name).map(Name::Parameter));
        let parameters = definition.parameters.iter().map(|parameter| parameter.name.as_str());
        let mut known: Vec<&str> = parameters.chain(channels.iter().map(|channel| channel.name())).collect();
        let mut lags = Vec::new();
        for (index, lag) in definition.states.iter().enumerate() {
            let taken = place(&lag.name).is_some() || definition.states[..index].iter().any(|other| other.name == lag.name);
            own_name(Part::State(lag.name.clone()), &lag.name, taken)?;
            let Some(tau) = place(&lag.tau) else {
                let names = || definition.parameters.iter().map(|parameter| parameter.name.as_str());
                let message = format!("tau = \"{}\" is no parameter of the expression{}", lag.tau, hint(&lag.tau, names()));
                return wrong(Part::State(lag.name.clone()), message);
            };
            if definition.parameters[tau].min <= 0.0 {
                return wrong(Part::Parameter(lag.tau.clone()), "a time constant needs min > 0".to_owned());
            }
            let input = Formula::parse(&lag.input, &of_input, &known);
            lags.push((
                input.map_err(|FormulaError { at, message }| ExpressionError {
                    part: Part::Input(lag.name.clone()),
                    at: Some(at),
                    message,
                })?,
                tau,
            ));
        }
        let count = definition.states.len();
        let of_formula = |name: &str| match definition.states.iter().position(|lag| lag.name == name) {
            Some(state) => Some(Name::State(state)),
            None if name == TIME => Some(Name::State(count)),
            None => of_input(name),
        };
        known.extend(definition.states.iter().map(|lag| lag.name.as_str()).chain([TIME]));
        let formula = Formula::parse(&definition.formula, &of_formula, &known).map_err(|FormulaError { at, message }| ExpressionError {
            part: Part::Formula,
            at: Some(at),
            message,
        })?;
        let tells_time = formula.names().any(|name| name == Name::State(count));
        let used: Vec<Name> = formula.names().chain(lags.iter().flat_map(|(input, _)| input.names())).collect();
        for (index, parameter) in definition.parameters.iter().enumerate() {
            if !used.contains(&Name::Parameter(index)) && lags.iter().all(|(_, tau)| *tau != index) {
                return wrong(Part::Parameter(parameter.name.clone()), format!("`{}` is not used by the formula", parameter.name));
            }
        }
        Ok(Parts { phase, formula, lags, tells_time, used })
    }
}

/// A definition in the form in which it steps.
struct Parts {
    phase: Phase,
    formula: Formula,
    lags: Vec<(Formula, usize)>,
    tells_time: bool,
    /// Every name that its formulas use.
    used: Vec<Name>,
}

impl Parts {
    /// The formula's share with its states at these channels as if they had held for ever.
    fn settled(&self, channels: &Channels<f64>, parameters: &[f64], time_s: f64) -> f64 {
        let lagged = self.lags.iter().map(|(input, _)| input.value(channels, parameters, &[]));
        let states: Vec<f64> = lagged.chain([time_s]).collect();
        self.formula.value(channels, parameters, &states)
    }
}

fn is_name(text: &str) -> bool {
    let mut characters = text.chars();
    characters.next().is_some_and(|c| c.is_ascii_alphabetic()) && characters.all(|c| c.is_ascii_alphanumeric() || c == '_')
}

fn own_name(part: Part, name: &str, taken: bool) -> Result<(), ExpressionError> {
    let stands_for = match () {
        () if !is_name(name) => return wrong(part, format!("`{name}` is no name: letters, digits and _, not beginning with a digit")),
        () if taken => "something else in this expression",
        () if Channel::from_name(name).is_some() => "a channel",
        () if function_names().any(|known| known == name) => "a function",
        () if name == TIME => "the seconds since the start",
        () if name == "pi" => "a number",
        () => return Ok(()),
    };
    wrong(part, format!("`{name}` is the name of {stands_for}"))
}

fn channel(channels: &[Channel], name: &str) -> Option<Name> {
    channels.iter().copied().find(|channel| channel.name() == name).map(Name::Channel)
}

/// Channels that a formula of this system may read: what its effects need and move, and what its
/// steps take and make.
#[must_use]
pub fn readable(system: System) -> Vec<Channel> {
    let specs = || catalogue().iter().map(|effect| effect.spec()).filter(|spec| spec.system == system);
    let by_effects = specs().flat_map(|spec| spec.needs.iter().copied().chain([spec.channel]));
    let all: Vec<Channel> = by_effects.chain([system.inputs(), system.computed(), system.targets()].concat()).collect();
    // What depends on the length of a step is no quantity of the thing.
    Channel::ALL.iter().copied().filter(|channel| all.contains(channel) && *channel != Channel::SocPerA).collect()
}

/// Channels that an expression of this system may add to, each with the phases in which effects do.
#[must_use]
pub fn addable(system: System) -> Vec<(Channel, Vec<Phase>)> {
    let mut all: Vec<(Channel, Vec<Phase>)> = Vec::new();
    for phase in system.phases() {
        for spec in catalogue().iter().map(|effect| effect.spec()).filter(|spec| spec.system == system && spec.phase == *phase) {
            // A temperature is kept from step to step: what is added to it would pile up.
            if spec.channel == Channel::CellDegc {
                continue;
            }
            match all.iter_mut().find(|(channel, _)| *channel == spec.channel) {
                Some((_, phases)) if phases.contains(phase) => {}
                Some((_, phases)) => phases.push(*phase),
                None => all.push((spec.channel, vec![*phase])),
            }
        }
    }
    all
}

/// A phase as files name it.
fn phase_name(phase: Phase) -> String {
    format!("{phase:?}").to_lowercase()
}

/// The phase that a file names.
#[must_use]
pub fn phase_from_name(system: System, name: &str) -> Option<Phase> {
    system.phases().iter().copied().find(|phase| phase_name(*phase) == name)
}

fn phase(system: System, definition: &Definition) -> Result<Phase, ExpressionError> {
    let all = addable(system);
    let Some((_, phases)) = all.iter().find(|(channel, _)| *channel == definition.channel) else {
        let names = || all.iter().map(|(channel, _)| channel.name());
        let message = format!(
            "an expression of a {} cannot add to {}{} Allowed: {}",
            system.name(),
            definition.channel.name(),
            hint(definition.channel.name(), names()),
            names().collect::<Vec<_>>().join(", ")
        );
        return wrong(Part::Channel, message);
    };
    match definition.phase {
        None => Ok(phases[phases.len() - 1]),
        Some(phase) if phases.contains(&phase) => Ok(phase),
        Some(phase) => {
            let allowed = phases.iter().map(|phase| phase_name(*phase)).collect::<Vec<_>>().join(", ");
            wrong(
                Part::Phase,
                format!("effects do not add to {} in phase {}. Allowed: {allowed}", definition.channel.name(), phase_name(phase)),
            )
        }
    }
}

fn kept(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

fn spec(system: System, phase: Phase, definition: &Definition, used: &[Name], tells_time: bool) -> EffectSpec {
    let mut needs: Vec<Channel> = Vec::new();
    for name in used {
        if let Name::Channel(channel) = name
            && !needs.contains(channel)
        {
            needs.push(*channel);
        }
    }
    let parameter = |own: &OwnParameter| ParameterSpec {
        name: kept(&own.name),
        meaning: kept(&own.meaning),
        default: own.value,
        null: own.null,
        min: own.min,
        max: own.max,
        source: "the model file",
    };
    let states = definition.states.iter().map(|lag| kept(&lag.name)).chain(tells_time.then_some(TIME));
    EffectSpec {
        id: kept(&definition.name),
        title: kept(&definition.title),
        system,
        phase,
        channel: definition.channel,
        needs: needs.leak(),
        equation: kept(&format!("{} += {}", definition.channel.name(), definition.formula)),
        source: "a formula in the model file",
        validity: "where its author says",
        signature: "that of its formula",
        matters: 0.0,
        confused_with: &[],
        parameters: definition.parameters.iter().map(parameter).collect::<Vec<_>>().leak(),
        states: states.collect::<Vec<_>>().leak(),
    }
}

impl Physics for Expression {
    fn spec(&self) -> &'static EffectSpec {
        self.spec
    }

    fn start<S: Real>(&self, _: &Facts, parameters: &[S], states: &mut [S], channels: &Channels<S>) {
        for (state, (input, _)) in states.iter_mut().zip(&self.lags) {
            let rest = input.value(channels, parameters, &[]);
            *state = if rest.re().is_finite() { rest } else { S::from(0.0) };
        }
    }

    fn goes_with_current(&self, state: usize) -> bool {
        self.lags.get(state).is_some_and(|(input, _)| input.reads_current())
    }

    fn prepared_len(&self) -> usize {
        self.lags.len()
    }

    fn prepare<S: Real>(&self, _: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        for (kept, (_, tau)) in prepared.iter_mut().zip(&self.lags) {
            *kept = (parameters[*tau].recip() * -dt_s).exp();
        }
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        for ((state, kept), (input, _)) in own.states.iter_mut().zip(own.prepared).zip(&self.lags) {
            let follows = input.value(channels, own.parameters, &[]);
            if follows.re().is_finite() {
                *state = follows + (*state - follows) * *kept;
            }
        }
        if self.tells_time {
            own.states[self.lags.len()] += S::from(dt_s);
        }
        let share = self.formula.value(channels, own.parameters, own.states);
        if share.re().is_finite() {
            channels.add(self.spec.channel, share);
        }
    }
}

#[cfg(test)]
mod tests;
