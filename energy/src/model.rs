//! A model: fixed facts, a list of effects and their parameters, read from TOML.
//!
//! Zero effects is a valid model. Reading is the only place where values are checked; after it,
//! physics is total.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use crate::document::{Document, DocumentError, hint};
use crate::effect::{Effect, ParameterSpec, Phase, catalogue, find};
use crate::ocv::OcvTable;
use crate::system::{BatteryFacts, ChargeFacts, Facts, System};
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
    /// Delay of a reading, s.
    #[serde(default)]
    pub lag_s: f64,
    /// Standard deviation of a constant offset, from the datasheet.
    #[serde(default)]
    pub offset_sigma: f64,
    /// Standard deviation of the gain about 1, from the datasheet.
    #[serde(default)]
    pub gain_sigma: f64,
}

impl Sensor {
    /// A perfect sensor.
    pub const PERFECT: Sensor = Sensor { sigma: 0.0, quantum: 0.0, lag_s: 0.0, offset_sigma: 0.0, gain_sigma: 0.0 };

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
        if self.quantum > 0.0 { (shown / self.quantum).round() * self.quantum } else { shown }
    }
}

/// What is only roughly known and must be marginalised instead of being named as an effect.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct Uncertainty {
    /// Standard deviation of the OCV table, V per cell.
    #[serde(default)]
    pub ocv_sigma_v: f64,
    /// Standard deviation of the SoC at the start of a log.
    #[serde(default)]
    pub soc_initial_sigma: f64,
    /// Standard deviation of the capacity, as a share of it.
    #[serde(default)]
    pub capacity_relative_sigma: f64,
    /// Standard deviation of bay currents, as a share of them.
    #[serde(default)]
    pub bay_current_relative_sigma: f64,
}

/// An effect at its place in a model.
pub(crate) struct Placed {
    pub(crate) effect: &'static dyn Effect,
    pub(crate) parameters: Range<usize>,
    pub(crate) states: Range<usize>,
}

/// Facts, effects in order of evaluation, parameters.
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
    phase_ends: Vec<usize>,
    state_count: usize,
}

impl std::fmt::Debug for Model {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Model").field("name", &self.name).field("parameters", &self.parameters).finish_non_exhaustive()
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawModel {
    schema: Spanned<u32>,
    system: System,
    name: String,
    #[allow(dead_code, reason = "for readers of the file")]
    source: Option<String>,
    battery: Option<Spanned<RawBattery>>,
    #[serde(default)]
    sensor: BTreeMap<Spanned<String>, Sensor>,
    #[serde(default)]
    uncertainty: Option<Spanned<Uncertainty>>,
    #[serde(default)]
    effect: Vec<Spanned<BTreeMap<Spanned<String>, Spanned<toml::Value>>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawBattery {
    series: u32,
    parallel: u32,
    capacity_ah: f64,
    full_v_per_cell: f64,
    eod_v_per_cell: f64,
    charge_current_a: f64,
    charge_cutoff_a: f64,
    ocv: Option<RawOcv>,
    ocv_csv: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOcv {
    soc: Vec<f64>,
    voltage_v: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawParameter {
    value: f64,
    #[serde(default)]
    sigma: f64,
    source: String,
    #[serde(default)]
    free: bool,
    min: Option<f64>,
    max: Option<f64>,
}

/// The only version of the model file so far.
const SCHEMA: u32 = 1;

impl Model {
    /// Reads a model. `read` fetches a file that the text names (an OCV table), relative to it.
    ///
    /// # Errors
    /// Says what is wrong, where, what is allowed and what was probably meant.
    pub fn parse(file: &str, text: &str, read: &dyn Fn(&str) -> Result<String, String>) -> Result<Model, DocumentError> {
        let document = Document { file, text };
        let raw: RawModel = document.parse()?;
        if *raw.schema.get_ref() != SCHEMA {
            let message = format!("schema = {}: this program reads schema = {SCHEMA}", raw.schema.get_ref());
            return Err(document.error_at(raw.schema.span(), message));
        }
        let facts = facts(&document, raw.system, raw.battery, read)?;
        let mut sensors = BTreeMap::new();
        for (name, sensor) in raw.sensor {
            let names = || Channel::ALL.iter().map(|c| c.name());
            let channel = Channel::from_name(name.get_ref()).ok_or_else(|| {
                let hint = hint(name.get_ref(), names());
                document.error_at(name.span(), format!("unknown channel `{}`{hint}", name.get_ref()))
            })?;
            let numbers = [sensor.sigma, sensor.quantum, sensor.lag_s, sensor.offset_sigma, sensor.gain_sigma];
            if !numbers.iter().all(|x| x.is_finite() && *x >= 0.0) {
                return Err(document.error_at(name.span(), format!("sensor.{}: every number must be finite and >= 0", name.get_ref())));
            }
            sensors.insert(channel, sensor);
        }
        let uncertainty = raw.uncertainty.map_or(Ok(Uncertainty::default()), |given| {
            let u = *given.get_ref();
            let numbers = [u.ocv_sigma_v, u.soc_initial_sigma, u.capacity_relative_sigma, u.bay_current_relative_sigma];
            if numbers.iter().all(|x| x.is_finite() && *x >= 0.0) {
                Ok(u)
            } else {
                Err(document.error_at(given.span(), "uncertainty: every number must be finite and >= 0"))
            }
        })?;
        let mut effects = Vec::new();
        for entry in raw.effect {
            effects.push(effect(&document, raw.system, entry)?);
        }
        Model::assemble(raw.name, raw.system, facts, sensors, uncertainty, effects).map_err(|message| document.error(message))
    }

    fn assemble(
        name: String,
        system: System,
        facts: Facts,
        sensors: BTreeMap<Channel, Sensor>,
        uncertainty: Uncertainty,
        mut effects: Vec<(usize, Vec<Parameter>)>,
    ) -> Result<Model, String> {
        let phase_of = |index: usize| {
            let phase = catalogue()[index].spec().phase;
            system.phases().iter().position(|&p| p == phase).expect("the catalogue is consistent")
        };
        effects.sort_by_key(|(index, _)| (phase_of(*index), *index));
        if let Some(twice) = effects.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(format!("effect `{}` appears twice; a model has each effect at most once", catalogue()[twice[0].0].spec().id));
        }
        let mut phase_ends = vec![0; system.phases().len()];
        let mut placed = Vec::new();
        let mut parameters = Vec::new();
        // A battery's own state comes first: its charge.
        let mut state_count = usize::from(system == System::Battery);
        for (index, own) in effects {
            let effect = catalogue()[index];
            let states = state_count..state_count + effect.spec().states.len();
            let range = parameters.len()..parameters.len() + own.len();
            state_count = states.end;
            parameters.extend(own);
            placed.push(Placed { effect, parameters: range, states });
            for end in &mut phase_ends[phase_of(index)..] {
                *end = placed.len();
            }
        }
        Ok(Model { name, system, facts, sensors, uncertainty, parameters, placed, phase_ends, state_count })
    }

    /// The same model without some of its effects.
    #[must_use]
    pub fn without(&self, leave_out: impl Fn(&str) -> bool) -> Model {
        let kept = self.placed.iter().filter(|placed| !leave_out(placed.effect.spec().id));
        let effects = kept.map(|placed| {
            let (index, _) = find(self.system, placed.effect.spec().id).expect("placed effects are in the catalogue");
            (index, self.parameters[placed.parameters.clone()].to_vec())
        });
        let (sensors, facts) = (self.sensors.clone(), self.facts.clone());
        Model::assemble(self.name.clone(), self.system, facts, sensors, self.uncertainty, effects.collect())
            .expect("no effect appears twice")
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

    pub(crate) fn placed_in(&self, phase: Phase) -> Range<usize> {
        let index = self.system.phases().iter().position(|&p| p == phase).expect("a phase of this system");
        let start = if index == 0 { 0 } else { self.phase_ends[index - 1] };
        start..self.phase_ends[index]
    }

    pub(crate) fn state_count(&self) -> usize {
        self.state_count
    }
}

fn facts(
    document: &Document<'_>,
    system: System,
    battery: Option<Spanned<RawBattery>>,
    read: &dyn Fn(&str) -> Result<String, String>,
) -> Result<Facts, DocumentError> {
    match (system, battery) {
        (System::Battery, None) => Err(document.error("system = \"battery\" needs a [battery] table with its fixed facts")),
        (System::Battery, Some(raw)) => {
            let span = raw.span();
            battery_facts(raw.into_inner(), read).map(Facts::Battery).map_err(|message| document.error_at(span, message))
        }
        (_, Some(raw)) => Err(document.error_at(raw.span(), format!("a [battery] table in a model with system = \"{}\"", system.name()))),
        (System::Robot, None) => Ok(Facts::Robot),
        (System::Station, None) => Ok(Facts::Station),
    }
}

fn battery_facts(raw: RawBattery, read: &dyn Fn(&str) -> Result<String, String>) -> Result<BatteryFacts, String> {
    let within = |name: &str, value: f64, min: f64, max: f64| {
        if value.is_finite() && (min..=max).contains(&value) {
            Ok(value)
        } else {
            Err(format!("battery.{name} = {value}: must be between {min} and {max}"))
        }
    };
    let count = |name: &str, value: u32| {
        if (1..=1000).contains(&value) { Ok(value) } else { Err(format!("battery.{name} = {value}: must be between 1 and 1000")) }
    };
    let ocv = match (raw.ocv, raw.ocv_csv) {
        (Some(table), None) => OcvTable::new(table.soc, table.voltage_v).map_err(|error| format!("battery.ocv: {error}"))?,
        (None, Some(path)) => {
            let text = read(&path).map_err(|error| format!("battery.ocv_csv = \"{path}\": {error}"))?;
            ocv_from_csv(&text).map_err(|error| format!("battery.ocv_csv = \"{path}\": {error}"))?
        }
        _ => return Err("battery needs one of ocv = { soc = [..], voltage_v = [..] } and ocv_csv = \"FILE\"".to_owned()),
    };
    let eod_v_per_cell = within("eod_v_per_cell", raw.eod_v_per_cell, 0.1, 10.0)?;
    Ok(BatteryFacts {
        series: count("series", raw.series)?,
        parallel: count("parallel", raw.parallel)?,
        capacity_ah: within("capacity_ah", raw.capacity_ah, 1e-3, 1e5)?,
        full_v_per_cell: within("full_v_per_cell", raw.full_v_per_cell, eod_v_per_cell, 10.0)?,
        eod_v_per_cell,
        ocv,
        charge: ChargeFacts {
            current_a: within("charge_current_a", raw.charge_current_a, 1e-3, 1e5)?,
            cutoff_a: within("charge_cutoff_a", raw.charge_cutoff_a, 1e-6, raw.charge_current_a.max(1e-6))?,
        },
    })
}

/// Reads `soc,voltage_v` rows; lines that begin with `#` are comments.
fn ocv_from_csv(text: &str) -> Result<OcvTable, String> {
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    match lines.next() {
        Some((_, header)) if header.trim() == "soc,voltage_v" => {}
        other => return Err(format!("the header must be `soc,voltage_v`, found `{}`", other.map_or("nothing", |(_, line)| line))),
    }
    let (mut soc, mut voltage_v) = (Vec::new(), Vec::new());
    for (index, line) in lines {
        let numbers: Vec<f64> = line
            .split(',')
            .map(|cell| cell.trim().parse().map_err(|_| format!("line {}: `{}` is not a number", index + 1, cell.trim())))
            .collect::<Result<_, _>>()?;
        let [s, v] = numbers[..] else { return Err(format!("line {}: {} columns instead of 2", index + 1, numbers.len())) };
        soc.push(s);
        voltage_v.push(v);
    }
    OcvTable::new(soc, voltage_v)
}

type RawEffect = Spanned<BTreeMap<Spanned<String>, Spanned<toml::Value>>>;

fn effect(document: &Document<'_>, system: System, entry: RawEffect) -> Result<(usize, Vec<Parameter>), DocumentError> {
    let span = entry.span();
    let mut keys = entry.into_inner();
    let id = keys
        .iter()
        .find(|(key, _)| key.get_ref() == "id")
        .map(|(key, _)| key.clone())
        .and_then(|key| keys.remove(&key))
        .ok_or_else(|| document.error_at(span.clone(), "an [[effect]] needs an id = \"...\""))?;
    let id_text =
        id.get_ref().as_str().ok_or_else(|| document.error_at(id.span(), "an effect's id is a text such as \"ohmic\""))?.to_owned();
    let ids = || catalogue().iter().filter(|e| e.spec().system == system).map(|e| e.spec().id);
    let (index, effect) = find(system, &id_text).ok_or_else(|| {
        let message = format!("a {} has no effect `{id_text}`{}", system.name(), hint(&id_text, ids()));
        document.error_at(id.span(), format!("{message} Known: {}", ids().collect::<Vec<_>>().join(", ")))
    })?;
    let specs = effect.spec().parameters;
    if let Some(unknown) = keys.keys().find(|key| specs.iter().all(|spec| spec.name != key.get_ref())) {
        let names = || specs.iter().map(|spec| spec.name);
        let message = format!("effect `{id_text}` has no parameter `{}`{}", unknown.get_ref(), hint(unknown.get_ref(), names()));
        return Err(document.error_at(unknown.span(), format!("{message} Its parameters: {}", names().collect::<Vec<_>>().join(", "))));
    }
    let mut parameters = Vec::new();
    for spec in specs {
        let given = keys.iter().find(|(key, _)| key.get_ref() == spec.name);
        parameters.push(match given {
            Some((_, value)) => parameter(document, effect.spec().id, spec, value)?,
            None => default_parameter(effect.spec().id, spec),
        });
    }
    Ok((index, parameters))
}

fn default_parameter(effect: &'static str, spec: &'static ParameterSpec) -> Parameter {
    Parameter {
        effect,
        name: spec.name,
        value: spec.default,
        sigma: 0.0,
        source: format!("catalogue default: {}", spec.source),
        free: false,
        min: spec.min,
        max: spec.max,
    }
}

fn parameter(
    document: &Document<'_>,
    effect: &'static str,
    spec: &'static ParameterSpec,
    given: &Spanned<toml::Value>,
) -> Result<Parameter, DocumentError> {
    let fail = |message: String| document.error_at(given.span(), format!("{effect}.{}: {message}", spec.name));
    let raw: RawParameter = given
        .get_ref()
        .clone()
        .try_into()
        .map_err(|error: toml::de::Error| fail(format!("{}; write {{ value = .., source = \"..\" }}", error.message())))?;
    let (min, max) = (raw.min.unwrap_or(spec.min), raw.max.unwrap_or(spec.max));
    if !(min.is_finite() && max.is_finite() && min < max) {
        return Err(fail(format!("min = {min} must lie below max = {max}")));
    }
    if !raw.value.is_finite() || !(min..=max).contains(&raw.value) {
        return Err(fail(format!("value = {} must be between {min} and {max} ({})", raw.value, spec.source)));
    }
    if !raw.sigma.is_finite() || raw.sigma < 0.0 {
        return Err(fail(format!("sigma = {} must be finite and >= 0", raw.sigma)));
    }
    Ok(Parameter { effect, name: spec.name, value: raw.value, sigma: raw.sigma, source: raw.source, free: raw.free, min, max })
}
