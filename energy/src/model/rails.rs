//! Reads the supply side of a robot's model: `[robot]`, `[[rail]]`, and the `rail = ".."` of effects.

use serde::Deserialize;
use toml::Spanned;

use crate::Channel;
use crate::document::{Document, DocumentError, hint};
use crate::effect::{EffectSpec, Phase};
use crate::power::{BATTERY, Consumer, ConsumerKind, ConverterLoss, EfficiencyTable, Ldo, PowerTree, Rail, RailKind, Switch, SwitchMode};
use crate::system::{Facts, RobotFacts, System};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRobot {
    nominal_v: f64,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawKind {
    Switching,
    Linear,
    Switch,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRail {
    id: String,
    from: String,
    kind: RawKind,
    source: Option<String>,
    voltage_v: Option<f64>,
    current_max_a: Option<f64>,
    input_min_v: Option<f64>,
    efficiency: Option<RawEfficiency>,
    polynomial: Option<RawPolynomial>,
    quiescent_a: Option<f64>,
    dropout_v: Option<f64>,
    theta_ja_k_per_w: Option<f64>,
    junction_max_degc: Option<f64>,
    resistance_ohm: Option<f64>,
    #[serde(default)]
    load: Vec<Spanned<RawLoad>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawEfficiency {
    input_v: Vec<f64>,
    output_a: Vec<f64>,
    efficiency: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPolynomial {
    fixed_w: f64,
    linear_v: f64,
    resistance_ohm: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLoad {
    name: String,
    kind: RawLoadKind,
    value: f64,
    #[serde(default)]
    sigma: f64,
    when: Option<Spanned<String>>,
    #[allow(dead_code, reason = "for readers of the file")]
    source: Option<String>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawLoadKind {
    Current,
    Power,
    Resistance,
}

/// Junction temperature up to which silicon regulators are rated when nothing else is said, °C.
const JUNCTION_MAX_DEGC: f64 = 125.0;

/// Facts of a robot; refuses them in a model of anything else.
pub(super) fn robot_facts(
    document: &Document<'_>,
    system: System,
    robot: Option<Spanned<RawRobot>>,
    raw_rails: Vec<Spanned<RawRail>>,
) -> Result<RobotFacts, DocumentError> {
    let first = robot.as_ref().map(|robot| ("[robot]", robot.span())).or_else(|| raw_rails.first().map(|rail| ("[[rail]]", rail.span())));
    if let Some((what, span)) = first
        && system != System::Robot
    {
        return Err(document.error_at(span, format!("a {what} table in a model with system = \"{}\"", system.name())));
    }
    let nominal_v = match robot {
        Some(robot) => {
            let value = robot.get_ref().nominal_v;
            within("robot.nominal_v", value, 0.1, 1000.0).map_err(|message| document.error_at(robot.span(), message))?
        }
        None => 0.0,
    };
    if let Some(rail) = raw_rails.first()
        && nominal_v == 0.0
    {
        return Err(document.error_at(rail.span(), "rails need a [robot] table with nominal_v = .., the pack's voltage when none is given"));
    }
    let spans: Vec<_> = raw_rails.iter().map(Spanned::span).collect();
    let mut rails = Vec::new();
    for raw in raw_rails {
        let span = raw.span();
        rails.push(rail(document, raw.into_inner()).map_err(|error| match error {
            Wrong::Rail(message) => document.error_at(span, message),
            Wrong::Placed(error) => error,
        })?);
    }
    let tree = if rails.is_empty() {
        None
    } else {
        Some(PowerTree::new(rails).map_err(|(index, message)| document.error_at(spans[index].clone(), message))?)
    };
    Ok(RobotFacts { nominal_v, tree, ..RobotFacts::default() })
}

/// Hangs an effect on the rail that its entry names.
pub(super) fn hang(
    document: &Document<'_>,
    facts: &mut Facts,
    spec: &EffectSpec,
    name: &Spanned<toml::Value>,
) -> Result<(), DocumentError> {
    let fail = |message: String| Err(document.error_at(name.span(), format!("effect `{}`: {message}", spec.id)));
    let Facts::Robot(robot) = facts else { return fail("only effects of a robot hang on rails".to_owned()) };
    if spec.phase != Phase::Load {
        return fail(format!("it acts in phase {:?}; only effects of phase Load hang on a rail", spec.phase));
    }
    let Some(id) = name.get_ref().as_str() else { return fail("rail is a text, the id of a [[rail]]".to_owned()) };
    if id == BATTERY {
        return Ok(());
    }
    let ids = || robot.tree.iter().flat_map(|tree| tree.rails().iter().map(|rail| rail.id.as_str()));
    let Some(index) = robot.tree.as_ref().and_then(|tree| tree.find(id)) else {
        let known = std::iter::once(BATTERY).chain(ids()).collect::<Vec<_>>().join(", ");
        return fail(format!("there is no rail `{id}`{} Known: {known}", hint(id, ids())));
    };
    robot.on_rails.insert(spec.id, index);
    Ok(())
}

/// An error of a whole rail, or one whose place is known already.
enum Wrong {
    Rail(String),
    Placed(DocumentError),
}

impl From<String> for Wrong {
    fn from(message: String) -> Self {
        Wrong::Rail(message)
    }
}

fn within(name: &str, value: f64, min: f64, max: f64) -> Result<f64, String> {
    if value.is_finite() && (min..=max).contains(&value) {
        Ok(value)
    } else {
        Err(format!("{name} = {value}: must be between {min} and {max}"))
    }
}

fn rail(document: &Document<'_>, raw: RawRail) -> Result<Rail, Wrong> {
    let id = raw.id.clone();
    if id.trim().is_empty() {
        return Err(Wrong::Rail("a rail's id must not be empty".to_owned()));
    }
    only_keys_of_its_kind(&raw)?;
    let named = |key: &str| format!("rail `{id}`: {key}");
    let needed = |key: &str, value: Option<f64>| value.ok_or_else(|| format!("{} is missing", named(key)));
    let optional = |key: &str, value: Option<f64>, otherwise: f64, max: f64| match value {
        Some(value) => within(&named(key), value, 0.0, max),
        None => Ok(otherwise),
    };
    let output_v = |given| within(&named("voltage_v"), needed("voltage_v", given)?, 0.1, 1000.0);
    let kind = match raw.kind {
        RawKind::Switching => {
            let output_v = output_v(raw.voltage_v)?;
            RailKind::Switching(SwitchMode {
                output_v,
                input_v_min: optional("input_min_v", raw.input_min_v, 0.0, 1000.0)?,
                loss: converter_loss(&named(""), output_v, raw.efficiency, raw.polynomial)?,
            })
        }
        RawKind::Linear => RailKind::Linear(Ldo {
            output_v: output_v(raw.voltage_v)?,
            ground_a: optional("quiescent_a", raw.quiescent_a, 0.0, 10.0)?,
            dropout_v: optional("dropout_v", raw.dropout_v, 0.0, 10.0)?,
            theta_ja_k_per_w: raw.theta_ja_k_per_w.map(|theta| within(&named("theta_ja_k_per_w"), theta, 0.0, 1000.0)).transpose()?,
            junction_max_degc: optional("junction_max_degc", raw.junction_max_degc, JUNCTION_MAX_DEGC, 500.0)?,
        }),
        RawKind::Switch => RailKind::Switch(Switch { resistance_ohm: optional("resistance_ohm", raw.resistance_ohm, 0.0, 1000.0)? }),
    };
    let current_a_max = match raw.current_max_a {
        Some(most) => within(&named("current_max_a"), most, 1e-6, 1e5)?,
        None => f64::INFINITY,
    };
    let loads = raw.load.into_iter().map(|raw| load(document, raw)).collect::<Result<_, _>>().map_err(Wrong::Placed)?;
    Ok(Rail { id, from: raw.from, kind, current_a_max, loads, source: raw.source })
}

fn only_keys_of_its_kind(raw: &RawRail) -> Result<(), String> {
    let (kind, allowed): (_, &[&str]) = match raw.kind {
        RawKind::Switching => ("switching", &["voltage_v", "input_min_v", "efficiency", "polynomial"]),
        RawKind::Linear => ("linear", &["voltage_v", "quiescent_a", "dropout_v", "theta_ja_k_per_w", "junction_max_degc"]),
        RawKind::Switch => ("switch", &["resistance_ohm"]),
    };
    let given = [
        ("voltage_v", raw.voltage_v.is_some()),
        ("input_min_v", raw.input_min_v.is_some()),
        ("efficiency", raw.efficiency.is_some()),
        ("polynomial", raw.polynomial.is_some()),
        ("quiescent_a", raw.quiescent_a.is_some()),
        ("dropout_v", raw.dropout_v.is_some()),
        ("theta_ja_k_per_w", raw.theta_ja_k_per_w.is_some()),
        ("junction_max_degc", raw.junction_max_degc.is_some()),
        ("resistance_ohm", raw.resistance_ohm.is_some()),
    ];
    match given.iter().find(|(key, is_given)| *is_given && !allowed.contains(key)) {
        Some((key, _)) => {
            let allowed = allowed.join(", ");
            Err(format!("rail `{}`: a {kind} rail has no `{key}`; beside id, from, kind, current_max_a, load: {allowed}", raw.id))
        }
        None => Ok(()),
    }
}

fn converter_loss(
    rail: &str,
    output_v: f64,
    table: Option<RawEfficiency>,
    polynomial: Option<RawPolynomial>,
) -> Result<ConverterLoss, String> {
    match (table, polynomial) {
        (Some(raw), None) => EfficiencyTable::new(raw.input_v, raw.output_a, &raw.efficiency)
            .map(ConverterLoss::Table)
            .map_err(|message| format!("{rail}efficiency: {message}")),
        (None, Some(raw)) => Ok(ConverterLoss::Polynomial {
            fixed_w: within(&format!("{rail}polynomial.fixed_w"), raw.fixed_w, 0.0, 1000.0)?,
            linear_v: within(&format!("{rail}polynomial.linear_v"), raw.linear_v, output_v, 10.0 * output_v)?,
            resistance_ohm: within(&format!("{rail}polynomial.resistance_ohm"), raw.resistance_ohm, 0.0, 1000.0)?,
        }),
        _ => Err(format!(
            "{rail}it needs one of efficiency = {{ input_v = [..], output_a = [..], efficiency = [[..], ..] }} and polynomial = {{ fixed_w = .., linear_v = .., resistance_ohm = .. }}"
        )),
    }
}

fn load(document: &Document<'_>, raw: Spanned<RawLoad>) -> Result<Consumer, DocumentError> {
    let span = raw.span();
    let raw = raw.into_inner();
    let (kind, least) = match raw.kind {
        RawLoadKind::Current => (ConsumerKind::Current, 0.0),
        RawLoadKind::Power => (ConsumerKind::Power, 0.0),
        RawLoadKind::Resistance => (ConsumerKind::Resistance, 1e-6),
    };
    let value = within(&format!("load `{}`: value ({})", raw.name, kind.unit()), raw.value, least, 1e9);
    let value = value.map_err(|message| document.error_at(span.clone(), message))?;
    // A resistance that might be zero, or a load that might feed its rail, is no load.
    let sigma = within(&format!("load `{}`: sigma ({})", raw.name, kind.unit()), raw.sigma, 0.0, value);
    let sigma = sigma.map_err(|message| document.error_at(span, message))?;
    let when = raw.when.map(|name| channel(document, &raw.name, &name)).transpose()?;
    Ok(Consumer { name: raw.name, kind, value, sigma, when })
}

fn channel(document: &Document<'_>, load: &str, name: &Spanned<String>) -> Result<Channel, DocumentError> {
    let inputs = || Channel::ALL.iter().copied().filter(|channel| !System::Robot.computed().contains(channel));
    inputs().find(|channel| channel.name() == name.get_ref()).ok_or_else(|| {
        let hint = hint(name.get_ref(), inputs().map(Channel::name));
        document.error_at(name.span(), format!("load `{load}`: `{}` is no channel that could switch it{hint}", name.get_ref()))
    })
}
