//! Physical effects: what each one adds to which channel.
//!
//! One file describes one effect: its equation, symbols, source, range of validity and what its
//! absence looks like in residuals. Its line in `effect/catalogue.rs` registers it and fixes its place
//! in the order of evaluation. Nothing outside the file knows the effect by name.

// By its path, so that the effects' files lie beside the catalogue and not in a folder below it.
#[path = "effect/catalogue.rs"]
mod catalogue;
pub mod expression;

pub use catalogue::{catalogue, find};

use std::ops::Range;

use crate::channel::{Channel, Channels};
use crate::model::Placed;
use crate::real::{Dual, HalfDual, Real};
use crate::system::{Facts, System};

/// When in a step an effect acts. A [`System`] runs the phases in its own order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Phase {
    /// Turns the current that a sensor showed into the one that flowed.
    Sensed,
    /// Changes how much charge the battery holds.
    Capacity,
    /// Adds a current, or a loss of charge, that does not reach the terminals.
    Current,
    /// Shifts a cell's equilibrium voltage without loss.
    Equilibrium,
    /// Adds to a cell's overpotential what follows the current at once.
    Series,
    /// Adds to a cell's overpotential what takes time or bends with the current.
    Polarisation,
    /// Makes heat and turns it into temperature.
    Heat,
    /// Between the cells and the pack's terminals.
    Connection,
    /// Turns true voltage and temperature into what their sensors show.
    Shown,
    /// Adds to the power that the loads of a robot, or the bays of a station, take.
    Load,
    /// A charger between a bay and a robot's battery.
    Charger,
    /// Joins between a station's charger and its converter, past the charger.
    Bypass,
    /// A converter between the battery and its loads, or a pack and its bays.
    Converter,
    /// Adds to a robot's power what hangs on its battery directly.
    Drive,
    /// What a station takes beside its bays.
    Overhead,
}

impl Phase {
    /// How many phases there are.
    pub(crate) const COUNT: usize = Phase::Overhead as usize + 1;
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

impl EffectSpec {
    /// Whether its last state is the clock of formulas, `time_s`.
    #[must_use]
    pub fn tells_time(&self) -> bool {
        self.states.last() == Some(&expression::TIME)
    }
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

/// What belongs to one effect in one run.
#[derive(Debug)]
pub struct Own<'a, S> {
    /// Values of its parameters, in the order of its [`EffectSpec`].
    pub parameters: &'a [S],
    /// What [`Physics::prepare`] made of them for the length of this step.
    pub prepared: &'a [S],
    /// Its states.
    pub states: &'a mut [S],
}

/// The physics of one effect, written once for plain and dual numbers.
pub trait Physics: Send + Sync {
    /// What is known of the effect.
    fn spec(&self) -> &'static EffectSpec;

    /// Sets the effect's states at the start of a run, from channels that hold the start values
    /// (rest: no current has flowed for long). States start at zero unless this says otherwise.
    fn start<S: Real>(&self, _facts: &Facts, _parameters: &[S], _states: &mut [S], _channels: &Channels<S>) {}

    /// How many numbers [`Physics::prepare`] makes.
    fn prepared_len(&self) -> usize {
        0
    }

    /// Whether it reads the open-circuit curve at another charge than the mean one of the cells.
    fn reads_curve(&self) -> bool {
        false
    }

    /// Effects of which it is the sum: a model has these or it.
    fn lumps(&self) -> &'static [&'static str] {
        &[]
    }

    /// Those of [`Self::lumps`] that may be missing beside it all the same, since there may be more of them than goes by its own numbers.
    fn may_need(&self) -> &'static [&'static str] {
        &[]
    }

    /// Why what these facts describe cannot have the effect, whatever its logs show; none where it can.
    fn ruled_out(&self, _facts: &Facts) -> Option<&'static str> {
        None
    }

    /// Inputs by which other effects tell what it sums up: it is asked about only where a log has none of them.
    fn told_by(&self) -> &'static [Channel] {
        &[]
    }

    /// Share of a battery's capacity that must pass in one go, once out of it and once into it, for the effect to differ from what
    /// follows the current alone.
    fn reversal(&self) -> f64 {
        0.0
    }

    /// Whether a state is a voltage or a current, which is as large as the battery's current: its name ends in its unit.
    fn goes_with_current(&self, state: usize) -> bool {
        ["_v", "_a", "_a_sqrt_s"].iter().any(|unit| self.spec().states[state].ends_with(unit))
    }

    /// Calculates what depends on parameters and the length of a step only, such as
    /// `exp(-dt / tau)`. Called when one of these changes, not at every step.
    fn prepare<S: Real>(&self, _facts: &Facts, _dt_s: f64, _parameters: &[S], _prepared: &mut [S]) {}

    /// The same where `prepared` holds what belongs to these parameters and another length: all that
    /// the length does not change may stay.
    fn prepare_length<S: Real>(&self, facts: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        self.prepare(facts, dt_s, parameters, prepared);
    }

    /// Advances the states over `dt_s` seconds, in which the inputs stayed as they are in
    /// `channels`, and adds the effect's share to its channel.
    fn step<S: Real>(&self, facts: &Facts, dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>);
}

/// [`Physics`] behind a pointer, for one kind of number.
pub trait Steps<S>: Send + Sync {
    /// [`Physics::start`].
    fn start(&self, facts: &Facts, parameters: &[S], states: &mut [S], channels: &Channels<S>);
    /// [`Physics::prepare`].
    fn prepare(&self, facts: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]);
    /// [`Physics::prepare_length`].
    fn prepare_length(&self, facts: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]);
    /// [`Physics::step`].
    fn step(&self, facts: &Facts, dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>);
    /// [`Physics::step`] for many runs of one model, whose numbers lie behind one another.
    fn step_many(&self, facts: &Facts, dt_s: f64, many: Many<'_, S>);
}

/// What belongs to one effect in several runs of one model: every run has a row of parameters,
/// prepared numbers and states, of which the effect's part begins at the offset.
#[derive(Debug)]
pub struct Many<'a, S> {
    /// Rows of parameters, length of a row, offset in it.
    pub parameters: (&'a [S], usize, Range<usize>),
    /// Rows of prepared numbers.
    pub prepared: (&'a [S], usize, Range<usize>),
    /// Rows of states.
    pub states: (&'a mut [S], usize, Range<usize>),
    /// Channels of every run.
    pub channels: &'a mut [Channels<S>],
}

/// [`Physics`] behind a pointer.
pub trait Effect: Steps<f64> + Steps<Dual> + Steps<HalfDual> {
    /// What is known of the effect.
    fn spec(&self) -> &'static EffectSpec;
    /// [`Physics::prepared_len`].
    fn prepared_len(&self) -> usize;
    /// [`Physics::reads_curve`].
    fn reads_curve(&self) -> bool;
    /// [`Physics::lumps`].
    fn lumps(&self) -> &'static [&'static str];
    /// [`Physics::may_need`].
    fn may_need(&self) -> &'static [&'static str];
    /// [`Physics::ruled_out`].
    fn ruled_out(&self, facts: &Facts) -> Option<&'static str>;
    /// [`Physics::told_by`].
    fn told_by(&self) -> &'static [Channel];
    /// [`Physics::reversal`].
    fn reversal(&self) -> f64;
    /// [`Physics::goes_with_current`].
    fn goes_with_current(&self, state: usize) -> bool;
}

impl<T: Physics> Effect for T {
    fn spec(&self) -> &'static EffectSpec {
        Physics::spec(self)
    }
    fn prepared_len(&self) -> usize {
        Physics::prepared_len(self)
    }
    fn reads_curve(&self) -> bool {
        Physics::reads_curve(self)
    }
    fn lumps(&self) -> &'static [&'static str] {
        Physics::lumps(self)
    }
    fn may_need(&self) -> &'static [&'static str] {
        Physics::may_need(self)
    }
    fn ruled_out(&self, facts: &Facts) -> Option<&'static str> {
        Physics::ruled_out(self, facts)
    }
    fn told_by(&self) -> &'static [Channel] {
        Physics::told_by(self)
    }
    fn reversal(&self) -> f64 {
        Physics::reversal(self)
    }
    fn goes_with_current(&self, state: usize) -> bool {
        Physics::goes_with_current(self, state)
    }
}

impl<T: Physics, S: Real> Steps<S> for T {
    fn start(&self, facts: &Facts, parameters: &[S], states: &mut [S], channels: &Channels<S>) {
        Physics::start(self, facts, parameters, states, channels);
    }
    fn prepare(&self, facts: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        Physics::prepare(self, facts, dt_s, parameters, prepared);
    }
    fn prepare_length(&self, facts: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        Physics::prepare_length(self, facts, dt_s, parameters, prepared);
    }
    fn step(&self, facts: &Facts, dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        Physics::step(self, facts, dt_s, own, channels);
    }
    fn step_many(&self, facts: &Facts, dt_s: f64, many: Many<'_, S>) {
        let Many { parameters: (parameters, p, own_p), prepared: (prepared, q, own_q), states: (states, n, own_n), channels } = many;
        for (index, channels) in channels.iter_mut().enumerate() {
            let own = Own {
                parameters: &parameters[index * p + own_p.start..index * p + own_p.end],
                prepared: &prepared[index * q + own_q.start..index * q + own_q.end],
                states: &mut states[index * n + own_n.start..index * n + own_n.end],
            };
            Physics::step(self, facts, dt_s, own, channels);
        }
    }
}

/// The kinds of number that a [`crate::Run`] can be made of: each picks its half of [`Effect`].
pub trait Lane: Real {
    /// The placed effect for this kind of number.
    fn of(placed: &Placed) -> &'static dyn Steps<Self>;
}

impl Lane for f64 {
    #[inline]
    fn of(placed: &Placed) -> &'static dyn Steps<f64> {
        placed.plain
    }
}

impl Lane for Dual {
    #[inline]
    fn of(placed: &Placed) -> &'static dyn Steps<Dual> {
        placed.dual
    }
}

impl Lane for HalfDual {
    #[inline]
    fn of(placed: &Placed) -> &'static dyn Steps<HalfDual> {
        placed.half
    }
}

/// Steps a lone effect once, as a run would: for the tests of effects.
#[cfg(test)]
pub(crate) fn step_once(
    effect: &impl Physics,
    facts: &Facts,
    dt_s: f64,
    parameters: &[f64],
    states: &mut [f64],
    channels: &mut Channels<f64>,
) {
    let mut prepared = vec![0.0; Physics::prepared_len(effect)];
    Physics::prepare(effect, facts, dt_s, parameters, &mut prepared);
    Physics::step(effect, facts, dt_s, Own { parameters, prepared: &prepared, states }, channels);
}

/// A run of one cell of 2 Ah with an OCV line from 3 V to 4 V and these effects, for the tests of
/// effects that meet others: `(id, [(parameter, value)])`.
#[cfg(test)]
pub(crate) fn cell(series: u32, effects: &[(&str, &[(&str, f64)])], start: crate::Start) -> crate::Run<f64> {
    let mut text = format!(
        "schema = 1\nsystem = \"battery\"\nname = \"cell\"\n\
         [battery]\nseries = {series}\nparallel = 1\ncapacity_ah = 2.0\nfull_v_per_cell = 4.0\neod_v_per_cell = 3.0\n\
         charge_current_a = 2.0\ncharge_cutoff_a = 0.1\nocv = {{ soc = [0.0, 1.0], voltage_v = [3.0, 4.0] }}\n"
    );
    for (id, parameters) in effects {
        text += &format!("[[effect]]\nid = \"{id}\"\n");
        for (name, value) in *parameters {
            text += &format!("{name} = {{ value = {value:?}, source = \"test\" }}\n");
        }
    }
    let model = crate::Model::parse("cell", &text, &|_| unreachable!("the table is inline")).expect("the test's model is right");
    crate::Run::new(std::sync::Arc::new(model), start)
}

/// Power that a lone effect adds to a robot's with these inputs, W: for the tests of effects.
#[cfg(test)]
pub(crate) fn robot_power_w(effect: &impl Physics, parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
    let mut channels = Channels::filled(0.0_f64);
    for &(channel, value) in inputs {
        channels[channel] = value;
    }
    step_once(effect, &Facts::robot(), 1.0, parameters, &mut [], &mut channels);
    channels[Channel::PowerW]
}
