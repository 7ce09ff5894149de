//! A model: fixed facts, a list of effects and their parameters, read from TOML.
//!
//! Zero effects is a valid model. Reading is the only place where values are checked; after it,
//! physics is total.

mod cells;
mod expression;
mod file;
mod protection;
mod rails;
mod variant;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use serde::Deserialize;

use crate::effect::{Effect, Phase, Steps, find};
use crate::real::{Dual, HalfDual};
use crate::system::{BatteryFacts, Facts, System};
use crate::{Channel, Estimate};

/// A parameter's value and where it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// The effect that it belongs to.
    pub effect: &'static str,
    /// Its name, with unit.
    pub name: &'static str,
    /// Value, in the unit that its name ends in.
    pub value: f64,
    /// Standard deviation of the value.
    pub sigma: f64,
    /// Where the value came from.
    pub source: String,
    /// Whether a fit may change it.
    pub free: bool,
    /// Least value that a fit may try.
    pub min: f64,
    /// Greatest value that a fit may try.
    pub max: f64,
    /// Effect and name of the parameter whose value it has in a fit, where two stand for one thing.
    pub follows: Option<(&'static str, &'static str)>,
}

impl Parameter {
    /// Whether nobody stated its value: it is the catalogue's.
    #[must_use]
    pub fn is_catalogue_default(&self) -> bool {
        self.source.starts_with(file::CATALOGUE_DEFAULT)
    }
}

/// What is known of a sensor: the floor below which no residual can be explained.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// White noise, standard deviation.
    pub sigma: f64,
    /// Step between readings.
    #[serde(default)]
    pub quantum: f64,
    /// Largest reading that is shown as 0.
    #[serde(default)]
    pub dead_band: f64,
    /// Time by which a reading is late, s: a log's readings are compared with what was true so much earlier. Below 0 it is early, as where
    /// another sensor's clock is behind.
    #[serde(default)]
    pub lag_s: f64,
    /// Standard deviation of the time by which a reading is late or early beyond that, s.
    #[serde(default)]
    pub lag_sigma_s: f64,
    /// Standard deviation of a constant offset, from the datasheet.
    #[serde(default)]
    pub offset_sigma: f64,
    /// Standard deviation of the gain about 1, from the datasheet.
    #[serde(default)]
    pub gain_sigma: f64,
}

impl Sensor {
    /// A perfect sensor.
    pub const PERFECT: Sensor =
        Sensor { sigma: 0.0, quantum: 0.0, dead_band: 0.0, lag_s: 0.0, lag_sigma_s: 0.0, offset_sigma: 0.0, gain_sigma: 0.0 };

    /// Standard deviation of one reading: noise and rounding to the quantum (uniform, q²/12).
    #[must_use]
    pub fn floor(&self) -> f64 {
        (self.sigma.powi(2) + self.quantum.powi(2) / 12.0).sqrt()
    }

    /// What this sensor shows for a true value. The three numbers are standard normal draws: one
    /// for the noise of this reading, and one each for this specimen's offset and gain.
    #[must_use]
    pub fn shows(&self, value: f64, noise: f64, offset: f64, gain: f64) -> f64 {
        let shown = value * (1.0 + gain * self.gain_sigma) + offset * self.offset_sigma + noise * self.sigma;
        match () {
            () if shown.abs() <= self.dead_band => 0.0,
            () if self.quantum > 0.0 => (shown / self.quantum).round() * self.quantum,
            () => shown,
        }
    }
}

/// What is only roughly known and must be marginalised instead of being named as an effect.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Uncertainty {
    /// Standard deviation of the OCV table, V per cell.
    pub ocv_sigma_v: f64,
    /// State of charge over which the error of the OCV table changes, 0.02 to 1; 0.15 when not
    /// stated (guess: tables err where electrode stages begin and end, some 0.1 to 0.3 apart).
    pub ocv_length_soc: f64,
    /// Standard deviation of the SoC at the start of a log.
    pub soc_initial_sigma: f64,
    /// Standard deviation of the capacity, as a share of it.
    pub capacity_relative_sigma: f64,
    /// Standard deviation of what the shapes of the effects leave out of a cell's resistance, as a
    /// share of it; 0.02 when not stated (guess: a fitted shape leaves 1 % to 5 % out).
    pub resistance_relative_sigma: f64,
    /// Standard deviation of bay currents, as a share of them.
    pub bay_current_relative_sigma: f64,
    /// Standard deviation of what the clock of formulas (`time_s`) shows at the start of a log, s: of a periodic load every
    /// log sees another phase. 0 when every log finds it at the same.
    pub clock_sigma_s: f64,
}

impl Default for Uncertainty {
    fn default() -> Self {
        Self {
            ocv_sigma_v: 0.0,
            ocv_length_soc: 0.15,
            soc_initial_sigma: 0.0,
            capacity_relative_sigma: 0.0,
            resistance_relative_sigma: 0.02,
            bay_current_relative_sigma: 0.0,
            clock_sigma_s: 0.0,
        }
    }
}

/// An effect at its place in a model. Opaque outside this crate.
#[derive(Clone)]
pub struct Placed {
    pub(crate) effect: &'static dyn Effect,
    /// The effect for plain and for dual numbers: the way to it in every step, kept short.
    pub(crate) plain: &'static dyn Steps<f64>,
    pub(crate) dual: &'static dyn Steps<Dual>,
    pub(crate) half: &'static dyn Steps<HalfDual>,
    pub(crate) channel: Channel,
    pub(crate) parameters: Range<usize>,
    pub(crate) prepared: Range<usize>,
    pub(crate) states: Range<usize>,
    /// The rail that it hangs on, for a robot's effect that does not hang on the battery.
    pub(crate) rail: Option<usize>,
}

/// Facts, effects in order of evaluation, parameters.
#[derive(Clone)]
pub struct Model {
    /// Name, for people.
    pub name: String,
    /// What it describes.
    pub system: System,
    /// Fixed facts.
    pub facts: Facts,
    /// Known sensor floors by channel.
    pub sensors: BTreeMap<Channel, Sensor>,
    /// What is only roughly known.
    pub uncertainty: Uncertainty,
    parameters: Vec<Parameter>,
    placed: Vec<Placed>,
    phases: [Range<usize>; Phase::COUNT],
    state_count: usize,
    prepared_count: usize,
    predicts_temperature: bool,
}

impl std::fmt::Debug for Model {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Model").field("name", &self.name).field("parameters", &self.parameters).finish_non_exhaustive()
    }
}

impl Model {
    pub(crate) fn assemble(
        name: String,
        system: System,
        facts: Facts,
        sensors: BTreeMap<Channel, Sensor>,
        uncertainty: Uncertainty,
        mut effects: Vec<(&'static dyn Effect, Vec<Parameter>)>,
    ) -> Result<Model, String> {
        let rail_of = |effect: &dyn Effect| facts.rail_of(effect.spec().id);
        // Effects on one rail lie together, before those on the battery; expressions come after the
        // catalogue's, in the order of the file.
        effects.sort_by_cached_key(|(effect, _)| {
            let spec = effect.spec();
            let phase = system.phases().iter().position(|&p| p == spec.phase).expect("an effect acts in a phase of its system");
            (phase, rail_of(*effect).unwrap_or(usize::MAX), find(system, spec.id).map_or(usize::MAX, |(index, _)| index))
        });
        let mut ids = BTreeSet::new();
        if let Some(twice) = effects.iter().map(|(effect, _)| effect.spec().id).find(|id| !ids.insert(*id)) {
            let more = if find(system, twice).is_none() { "; tell expressions apart by name = \"...\"" } else { "" };
            return Err(format!("effect `{twice}` appears twice; a model has each effect at most once{more}"));
        }
        let mut placed: Vec<Placed> = Vec::new();
        let mut parameters = Vec::new();
        // What the system itself keeps comes first.
        let mut state_count = facts.own_states();
        let mut prepared_count = 0;
        for (effect, own) in effects {
            let states = state_count..state_count + effect.spec().states.len();
            let range = parameters.len()..parameters.len() + own.len();
            let prepared = prepared_count..prepared_count + effect.prepared_len();
            (state_count, prepared_count) = (states.end, prepared.end);
            parameters.extend(own);
            let channel = effect.spec().channel;
            placed.push(Placed {
                effect,
                plain: effect,
                dual: effect,
                half: effect,
                channel,
                parameters: range,
                prepared,
                states,
                rail: rail_of(effect),
            });
        }
        // Effects of a phase lie together; a phase that the system lacks has none.
        let mut phases = [const { 0..0 }; Phase::COUNT];
        for (index, place) in placed.iter().enumerate() {
            let range = &mut phases[place.effect.spec().phase as usize];
            *range = if range.start == range.end { index..index + 1 } else { range.start..index + 1 };
        }
        let predicts_temperature = placed.iter().any(|place| place.channel == Channel::CellDegc);
        Ok(Model {
            name,
            system,
            facts,
            sensors,
            uncertainty,
            parameters,
            placed,
            phases,
            state_count,
            prepared_count,
            predicts_temperature,
        })
    }

    /// All parameters of all effects, in order of evaluation.
    #[must_use]
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// The parameter of that effect and name.
    #[must_use]
    pub fn parameter(&self, effect: &str, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.effect == effect && p.name == name)
    }

    /// Values of all parameters, in the order of [`Model::parameters`].
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }

    /// Values of all parameters with their deviations.
    #[must_use]
    pub fn estimates(&self) -> Vec<Estimate> {
        self.parameters.iter().map(|p| Estimate::new(p.value, p.sigma)).collect()
    }

    /// The effects, in order of evaluation.
    pub fn effects(&self) -> impl Iterator<Item = &'static dyn Effect> + '_ {
        self.placed.iter().map(|placed| placed.effect)
    }

    /// Whether the model says how the cell's temperature moves; otherwise a measured temperature
    /// is an input.
    #[must_use]
    #[inline]
    pub fn predicts_temperature(&self) -> bool {
        self.predicts_temperature
    }

    /// Facts of a pack.
    ///
    /// # Panics
    /// When the model is not of a battery: callers take models of one system.
    #[must_use]
    pub fn battery(&self) -> &BatteryFacts {
        match &self.facts {
            Facts::Battery(battery) => battery,
            _ => panic!("`{}` is the model of a {}, not of a battery", self.name, self.system.name()),
        }
    }

    /// The known sensor on that channel, or a perfect one.
    #[must_use]
    pub fn sensor(&self, channel: Channel) -> Sensor {
        self.sensors.get(&channel).copied().unwrap_or(Sensor::PERFECT)
    }

    pub(crate) fn placed(&self) -> &[Placed] {
        &self.placed
    }

    #[inline]
    pub(crate) fn placed_in(&self, phase: Phase) -> &[Placed] {
        let Range { start, end } = self.phases[phase as usize];
        // Most phases of most models are empty: that is found out first.
        if start == end { &[] } else { &self.placed[start..end] }
    }

    pub(crate) fn prepared_count(&self) -> usize {
        self.prepared_count
    }

    /// Names of the states of a battery's run, with their units, in the order of `Run::states`.
    pub(crate) fn state_names(&self) -> impl Iterator<Item = &'static str> + '_ {
        std::iter::once("soc").chain(self.placed.iter().flat_map(|placed| placed.effect.spec().states.iter().copied()))
    }

    pub(crate) fn state_count(&self) -> usize {
        self.state_count
    }
}
