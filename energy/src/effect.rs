//! Physical effects: what each one adds to which channel.
//!
//! One file describes one effect: its equation, symbols, source, range of validity and what its
//! absence looks like in residuals. The [`catalogue!`] line registers it and fixes its place in
//! the order of evaluation. Nothing outside the file knows the effect by name.

use crate::channel::{Channel, Channels};
use crate::real::{Dual, Real};
use crate::system::{Facts, System};

/// When in a step an effect acts. A [`System`] runs the phases in its own order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Phase {
    /// Changes how much charge the battery holds.
    Capacity,
    /// Adds a current that does not reach the terminals.
    Current,
    /// Adds to a cell's overpotential.
    Voltage,
    /// Turns losses into temperature.
    Heat,
    /// Adds to the power that the loads of a robot, or the bays of a station, take.
    Load,
    /// A charger between a bay and a robot's battery.
    Charger,
    /// A converter between the battery and its loads, or a pack and its bays.
    Converter,
    /// What a station takes beside its bays.
    Overhead,
}

/// What is known of an effect before it is used.
#[derive(Debug)]
pub struct EffectSpec {
    /// Name in files and on the command line.
    pub id: &'static str,
    /// One line for people.
    pub title: &'static str,
    /// The system it belongs to.
    pub system: System,
    /// When in a step it acts.
    pub phase: Phase,
    /// The channel that it adds to or transforms.
    pub channel: Channel,
    /// Inputs that a log must have for the effect to be seen.
    pub needs: &'static [Channel],
    /// Equation, in plain text.
    pub equation: &'static str,
    /// Where the equation comes from.
    pub source: &'static str,
    /// Where it holds.
    pub validity: &'static str,
    /// What its absence looks like in residuals.
    pub signature: &'static str,
    /// Smallest change of its channel that a decision would notice, in the channel's unit.
    pub matters: f64,
    /// Effects that data may not tell from this one, with the experiment that does.
    pub confused_with: &'static [(&'static str, &'static str)],
    /// Its parameters.
    pub parameters: &'static [ParameterSpec],
    /// Names of its states, with units.
    pub states: &'static [&'static str],
}

/// What is known of a parameter before anybody measured it.
#[derive(Debug)]
pub struct ParameterSpec {
    /// Name with unit.
    pub name: &'static str,
    /// Meaning.
    pub meaning: &'static str,
    /// Start value when nothing better is known.
    pub default: f64,
    /// Value at which the effect vanishes; none when the parameter only shapes it.
    pub null: Option<f64>,
    /// Least plausible value.
    pub min: f64,
    /// Greatest plausible value.
    pub max: f64,
    /// Where default and range come from.
    pub source: &'static str,
}

/// The physics of one effect, written once for plain and dual numbers.
pub trait Physics: Send + Sync {
    /// What is known of the effect.
    fn spec(&self) -> &'static EffectSpec;

    /// Sets the effect's states at the start of a run, from channels that hold the start values
    /// (rest: no current has flowed for long). States start at zero unless this says otherwise.
    fn start<S: Real>(&self, _facts: &Facts, _parameters: &[S], _states: &mut [S], _channels: &Channels<S>) {}

    /// Advances the states over `dt_s` seconds, in which the inputs stayed as they are in
    /// `channels`, and adds the effect's share to its channel.
    fn step<S: Real>(&self, facts: &Facts, dt_s: f64, parameters: &[S], states: &mut [S], channels: &mut Channels<S>);
}

/// [`Physics`] behind a pointer, for either kind of number.
pub trait Effect: Send + Sync {
    /// What is known of the effect.
    fn spec(&self) -> &'static EffectSpec;
    /// [`Physics::start`] with plain numbers.
    fn start_plain(&self, facts: &Facts, parameters: &[f64], states: &mut [f64], channels: &Channels<f64>);
    /// [`Physics::start`] with derivatives.
    fn start_dual(&self, facts: &Facts, parameters: &[Dual], states: &mut [Dual], channels: &Channels<Dual>);
    /// [`Physics::step`] with plain numbers.
    fn step_plain(&self, facts: &Facts, dt_s: f64, parameters: &[f64], states: &mut [f64], channels: &mut Channels<f64>);
    /// [`Physics::step`] with derivatives.
    fn step_dual(&self, facts: &Facts, dt_s: f64, parameters: &[Dual], states: &mut [Dual], channels: &mut Channels<Dual>);
}

impl<T: Physics> Effect for T {
    fn spec(&self) -> &'static EffectSpec {
        Physics::spec(self)
    }
    fn start_plain(&self, facts: &Facts, parameters: &[f64], states: &mut [f64], channels: &Channels<f64>) {
        self.start(facts, parameters, states, channels);
    }
    fn start_dual(&self, facts: &Facts, parameters: &[Dual], states: &mut [Dual], channels: &Channels<Dual>) {
        self.start(facts, parameters, states, channels);
    }
    fn step_plain(&self, facts: &Facts, dt_s: f64, parameters: &[f64], states: &mut [f64], channels: &mut Channels<f64>) {
        self.step(facts, dt_s, parameters, states, channels);
    }
    fn step_dual(&self, facts: &Facts, dt_s: f64, parameters: &[Dual], states: &mut [Dual], channels: &mut Channels<Dual>) {
        self.step(facts, dt_s, parameters, states, channels);
    }
}

/// The kinds of number that a [`crate::Run`] can be made of: each picks its half of [`Effect`].
pub trait Lane: Real {
    /// Starts an effect.
    fn start(effect: &dyn Effect, facts: &Facts, parameters: &[Self], states: &mut [Self], channels: &Channels<Self>);
    /// Steps an effect.
    fn step(effect: &dyn Effect, facts: &Facts, dt_s: f64, parameters: &[Self], states: &mut [Self], channels: &mut Channels<Self>);
}

impl Lane for f64 {
    fn start(effect: &dyn Effect, facts: &Facts, parameters: &[f64], states: &mut [f64], channels: &Channels<f64>) {
        effect.start_plain(facts, parameters, states, channels);
    }
    #[inline]
    fn step(effect: &dyn Effect, facts: &Facts, dt_s: f64, parameters: &[f64], states: &mut [f64], channels: &mut Channels<f64>) {
        effect.step_plain(facts, dt_s, parameters, states, channels);
    }
}

impl Lane for Dual {
    fn start(effect: &dyn Effect, facts: &Facts, parameters: &[Dual], states: &mut [Dual], channels: &Channels<Dual>) {
        effect.start_dual(facts, parameters, states, channels);
    }
    fn step(effect: &dyn Effect, facts: &Facts, dt_s: f64, parameters: &[Dual], states: &mut [Dual], channels: &mut Channels<Dual>) {
        effect.step_dual(facts, dt_s, parameters, states, channels);
    }
}

macro_rules! catalogue {
    ($($system:ident { $($file:ident :: $effect:ident,)* })*) => {
        $(mod $system { $(pub(crate) mod $file;)* })*

        static CATALOGUE: &[&dyn Effect] = &[$($(&$system::$file::$effect,)*)*];
    };
}

// One line per effect. Within a phase, effects act in this order.
catalogue! {
    battery {
        capacity_fade::CapacityFade,
        self_discharge::SelfDischarge,
        ohmic::Ohmic,
        ohmic_soc::OhmicSoc,
        rc::FirstRc,
        thermal::LumpedThermal,
    }
    robot {
        idle::Idle,
        motion::Motion,
        converter::Converter,
    }
    station {
        own_load::RobotOwnLoad,
        charger::Charger,
        converter::Converter,
        hotel::Hotel,
        lift::Lift,
    }
}

/// Every known effect, in order of evaluation within a phase.
#[must_use]
pub fn catalogue() -> &'static [&'static dyn Effect] {
    CATALOGUE
}

/// The effect of that id in that system, with its place in the catalogue.
#[must_use]
pub fn find(system: System, id: &str) -> Option<(usize, &'static dyn Effect)> {
    CATALOGUE.iter().copied().enumerate().find(|(_, effect)| effect.spec().system == system && effect.spec().id == id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_catalogue_is_consistent() {
        let mut ids = BTreeSet::new();
        for effect in catalogue() {
            let spec = effect.spec();
            assert!(ids.insert((spec.system, spec.id)), "{} appears twice", spec.id);
            assert!(!spec.parameters.is_empty(), "{} has no parameter", spec.id);
            assert!(spec.parameters.iter().any(|p| p.null.is_some()), "{} cannot vanish", spec.id);
            for p in spec.parameters {
                assert!(p.min < p.max && (p.min..=p.max).contains(&p.default), "{}.{}", spec.id, p.name);
                assert!(p.null.is_none_or(|null| (p.min..=p.max).contains(&null)), "{}.{}", spec.id, p.name);
            }
            assert!(spec.system.phases().contains(&spec.phase), "{} acts in a phase that its system lacks", spec.id);
            for (other, _) in spec.confused_with {
                assert!(find(spec.system, other).is_some(), "{} names the unknown effect {other}", spec.id);
            }
        }
    }
}
