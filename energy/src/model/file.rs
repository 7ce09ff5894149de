//! Reads a model from its TOML text.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::cells::{RawBalancing, RawCell};
use super::protection::{self, RawProtection};
use super::rails::{self, RawRail, RawRobot};
use super::{Model, Parameter, Sensor, Uncertainty};
use crate::Channel;
use crate::document::{Document, DocumentError, hint};
use crate::effect::{Effect, ParameterSpec, catalogue, expression, find};
use crate::ocv::OcvTable;
use crate::pack::CellFactors;
use crate::protection::Limits;
use crate::system::{BatteryFacts, ChargeFacts, Facts, RobotFacts, System};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawModel {
    schema: Spanned<u32>,
    system: System,
    name: String,
    #[allow(dead_code, reason = "for readers of the file")]
    source: Option<String>,
    battery: Option<Spanned<RawBattery>>,
    protection: Option<Spanned<RawProtection>>,
    robot: Option<Spanned<RawRobot>>,
    #[serde(default)]
    rail: Vec<Spanned<RawRail>>,
    #[serde(default)]
    sensor: BTreeMap<Spanned<String>, Sensor>,
    #[serde(default)]
    uncertainty: Option<Spanned<Uncertainty>>,
    #[serde(default)]
    effect: Vec<RawEffect>,
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
    #[serde(default)]
    cell: Vec<Spanned<RawCell>>,
    balancing: Option<Spanned<RawBalancing>>,
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
        let robot = rails::robot_facts(&document, raw.system, raw.robot, raw.rail)?;
        let mut facts = facts(&document, raw.system, raw.battery, robot, read)?;
        protection::apply(&document, raw.system, &mut facts, raw.protection)?;
        let mut sensors = BTreeMap::new();
        for (name, sensor) in raw.sensor {
            let names = || Channel::ALL.iter().map(|c| c.name());
            let channel = Channel::from_name(name.get_ref()).ok_or_else(|| {
                let hint = hint(name.get_ref(), names());
                document.error_at(name.span(), format!("unknown channel `{}`{hint}", name.get_ref()))
            })?;
            let numbers = [sensor.sigma, sensor.quantum, sensor.dead_band, sensor.lag_sigma_s, sensor.offset_sigma, sensor.gain_sigma];
            if !(sensor.lag_s.is_finite() && numbers.iter().all(|x| x.is_finite() && *x >= 0.0)) {
                let words = "every number must be finite and, but for lag_s, >= 0";
                return Err(document.error_at(name.span(), format!("sensor.{}: {words}", name.get_ref())));
            }
            sensors.insert(channel, sensor);
        }
        let uncertainty = raw.uncertainty.map_or(Ok(Uncertainty::default()), |given| {
            let u = *given.get_ref();
            let numbers = [
                u.ocv_sigma_v,
                u.soc_initial_sigma,
                u.capacity_relative_sigma,
                u.resistance_relative_sigma,
                u.bay_current_relative_sigma,
                u.clock_sigma_s,
            ];
            if !numbers.iter().all(|x| x.is_finite() && *x >= 0.0) {
                return Err(document.error_at(given.span(), "uncertainty: every number must be finite and >= 0"));
            }
            let shares = [
                ("soc_initial_sigma", u.soc_initial_sigma),
                ("capacity_relative_sigma", u.capacity_relative_sigma),
                ("resistance_relative_sigma", u.resistance_relative_sigma),
                ("bay_current_relative_sigma", u.bay_current_relative_sigma),
            ];
            if let Some((name, value)) = shares.into_iter().find(|(_, value)| *value > 1.0) {
                let words = format!("uncertainty.{name} = {value}: it is a share, at most 1 (5 % is 0.05)");
                return Err(document.error_at(given.span(), words));
            }
            if !(0.02..=1.0).contains(&u.ocv_length_soc) {
                return Err(
                    document.error_at(given.span(), format!("uncertainty.ocv_length_soc = {}: allowed are 0.02 to 1", u.ocv_length_soc))
                );
            }
            Ok(u)
        })?;
        let mut effects = Vec::new();
        for entry in raw.effect {
            let ReadEffect { effect, parameters, rail } = effect(&document, raw.system, &facts, entry)?;
            if let Some(rail) = rail {
                rails::hang(&document, &mut facts, effect.spec(), &rail)?;
            }
            effects.push((effect, parameters));
        }
        Model::assemble(raw.name, raw.system, facts, sensors, uncertainty, effects).map_err(|message| document.error(message))
    }
}

fn facts(
    document: &Document<'_>,
    system: System,
    battery: Option<Spanned<RawBattery>>,
    robot: RobotFacts,
    read: &dyn Fn(&str) -> Result<String, String>,
) -> Result<Facts, DocumentError> {
    match (system, battery) {
        (System::Battery, None) => Err(document.error("system = \"battery\" needs a [battery] table with its fixed facts")),
        (System::Battery, Some(raw)) => {
            let span = raw.span();
            let mut raw = raw.into_inner();
            let (cells, balancing) = (std::mem::take(&mut raw.cell), raw.balancing.take());
            let mut facts = battery_facts(raw, read).map_err(|message| document.error_at(span, message))?;
            facts.unlike = super::cells::cells(document, cells, facts.series, facts.parallel)?;
            facts.balancing = balancing.map(|raw| super::cells::balancing(document, raw, &facts)).transpose()?;
            Ok(Facts::Battery(facts))
        }
        (_, Some(raw)) => Err(document.error_at(raw.span(), format!("a [battery] table in a model with system = \"{}\"", system.name()))),
        (System::Robot, None) => Ok(Facts::Robot(robot)),
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
    let (soc, voltage_v) = ocv.points();
    let ends = |values: &[f64]| (values[0], values[values.len() - 1]);
    let allowed = |name: &str, (first, last): (f64, f64), (min, max): (f64, f64), what: &str| {
        let fits = first >= min && last <= max;
        if fits { Ok(()) } else { Err(format!("battery.ocv: {name} runs from {first} to {last}: {what}, between {min} and {max}")) }
    };
    allowed("soc", ends(soc), (-0.5, 1.5), "a share of the charge of a full cell")?;
    allowed("voltage_v", ends(voltage_v), (-1.0, 10.0), "volts of one cell")?;
    let eod_v_per_cell = within("eod_v_per_cell", raw.eod_v_per_cell, 0.1, 10.0)?;
    let full_cell_v = ocv.voltage_v(1.0);
    if eod_v_per_cell >= full_cell_v {
        let words = format!("its OCV table ends at {full_cell_v} V for a full cell, so that no charge is left above it");
        return Err(format!("battery.eod_v_per_cell = {eod_v_per_cell}: {words}"));
    }
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
        cell: CellFactors::default(),
        unlike: Vec::new(),
        balancing: None,
        protection: Limits::of(raw.full_v_per_cell, eod_v_per_cell, raw.charge_current_a, raw.capacity_ah),
        cycle_count: 0.0,
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

/// The keys of an effect, with their places.
pub(super) type Keys = BTreeMap<Spanned<String>, Spanned<toml::Value>>;
type RawEffect = Spanned<Keys>;

/// An effect as read: its parameters and, for a robot's, the rail it names.
struct ReadEffect {
    effect: &'static dyn Effect,
    parameters: Vec<Parameter>,
    rail: Option<Spanned<toml::Value>>,
}

fn effect(document: &Document<'_>, system: System, facts: &Facts, entry: RawEffect) -> Result<ReadEffect, DocumentError> {
    let span = entry.span();
    let mut keys = entry.into_inner();
    let mut take = |name: &str| {
        let key = keys.keys().find(|key| key.get_ref() == name).cloned();
        key.and_then(|key| keys.remove(&key))
    };
    let rail = if system == System::Robot { take("rail") } else { None };
    let id = take("id").ok_or_else(|| document.error_at(span.clone(), "an [[effect]] needs an id = \"...\""))?;
    let id_text =
        id.get_ref().as_str().ok_or_else(|| document.error_at(id.span(), "an effect's id is a text such as \"ohmic\""))?.to_owned();
    if id_text == expression::ID {
        let (effect, parameters) = super::expression::read(document, system, facts, span, keys)?;
        return Ok(ReadEffect { effect, parameters, rail });
    }
    let ids = || catalogue().iter().filter(|e| e.spec().system == system).map(|e| e.spec().id).chain([expression::ID]);
    let (_, effect) = find(system, &id_text).ok_or_else(|| {
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
    Ok(ReadEffect { effect, parameters, rail })
}

/// How the source of a number begins that the model's text does not give.
pub(super) const CATALOGUE_DEFAULT: &str = "catalogue default: ";

pub(super) fn default_parameter(effect: &'static str, spec: &'static ParameterSpec) -> Parameter {
    Parameter {
        effect,
        name: spec.name,
        value: spec.default,
        sigma: 0.0,
        source: format!("{CATALOGUE_DEFAULT}{}", spec.source),
        free: false,
        min: spec.min,
        max: spec.max,
        follows: None,
    }
}

/// Share of the least usual value of a number that must not be nothing that is taken for nothing.
const NEXT_TO_NOTHING: f64 = 1e-6;

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
    // Where the catalogue's range ends above nothing, equations divide by the number: nothing at all is never meant.
    let min = if spec.min > 0.0 { min.max(NEXT_TO_NOTHING * spec.min) } else { min };
    if !(min.is_finite() && max.is_finite() && min < max) {
        return Err(fail(format!("min = {min} must lie below max = {max}")));
    }
    if !raw.value.is_finite() || !(min..=max).contains(&raw.value) {
        return Err(fail(format!("value = {} must be between {min} and {max} ({})", raw.value, spec.source)));
    }
    if !raw.sigma.is_finite() || raw.sigma < 0.0 {
        return Err(fail(format!("sigma = {} must be finite and >= 0", raw.sigma)));
    }
    Ok(Parameter {
        effect,
        name: spec.name,
        value: raw.value,
        sigma: raw.sigma,
        source: raw.source,
        free: raw.free,
        min,
        max,
        follows: None,
    })
}
