//! Makes a case of a place in the plan and a seed.

use energy::{Channel, System, Uncertainty};
use lab::measurement::{GapCurrent, History, LogFacts, Role};

use crate::case::{Case, CaseLog, Hidden, Right, Truth};
use crate::draft::{Draft, PackFacts};
use crate::electrochemical::CELLS;
use crate::foreign::Stranger;
use crate::gauge::Gauge;
use crate::hide::{Shape, size_for};
use crate::plan::{Ambiguity, Entry, Subject};
use crate::random::Stream;
use crate::refit::{ROUNDS, leaves};
use crate::setting::{Setting, Wish, battery, robot, station};
use crate::stand_in::stand_ins;
use crate::told;
use crate::world::{Course, World, courses};

/// RMS error of an electrochemical cell's table as its model states it: it has none.
const CELL_OCV_SIGMA_V: f64 = 1e-3;
/// Relaxation, in any form.
const RELAXATIONS: &[&str] = &["rc1", "rc2", "rc_ladder", "warburg", "surface_diffusion"];
/// What else an electrochemical cell does.
const CELL_PHYSICS: &[&str] = &[
    "arrhenius",
    "polarisation_arrhenius",
    "relaxation_arrhenius",
    "butler_volmer",
    "ohmic_soc",
    "polarisation_soc",
    "entropic",
    "charge_asymmetry",
    "thermal",
];

/// The case of that entry and seed.
#[must_use]
pub fn make(entry: &Entry, seed: u64) -> Case {
    match &entry.subject {
        Subject::Effects { ids, confusable } => effects(entry, seed, ids, *confusable),
        Subject::Nothing { wrong_ocv } => nothing(entry, seed, *wrong_ocv),
        Subject::Stranger(stranger) => foreign(entry, seed, stranger),
        Subject::Collinear(ambiguity) => collinear(entry, seed, ambiguity),
        Subject::Cell { cell, base } => electrochemical(entry, seed, *cell, base),
    }
}

fn draw(system: System, seed: u64, wish: &Wish) -> Setting {
    match system {
        System::Battery => battery::draw(seed, wish),
        System::Robot => robot::draw(seed, wish),
        System::Station => station::draw(seed, wish),
    }
}

fn effects(entry: &Entry, seed: u64, ids: &[&'static str], confusable: bool) -> Case {
    let setting = draw(entry.system, seed, &Wish { hidden: ids.to_vec(), ..Wish::default() });
    let (hidden, courses) = hide(entry, seed, &setting, ids);
    let truth = Truth {
        story: tell(&hidden),
        right: Right::Effects(hidden),
        confusable,
        wrong_ocv: true,
        told_over_floor: f64::NAN,
        base: base(&setting.truth),
    };
    finish(entry, seed, &setting, &courses, truth)
}

/// Hides effects, each at its own size, and finds what all the others leave of each.
fn hide(entry: &Entry, seed: u64, setting: &Setting, ids: &[&'static str]) -> (Vec<Hidden>, Vec<Course>) {
    let mut random = Stream::new(seed, "hidden");
    let (low, high) = entry.strength;
    let mut hidden: Vec<Hidden> = Vec::new();
    let mut draft = setting.truth.clone();
    for &id in ids {
        let shape = Shape::draw(entry.system, id, &mut random);
        let new = shape.sized(&setting.truth, &setting.scripts, random.log_between(low, high));
        draft = draft.with(id, &new.parameters);
        hidden.push(new);
    }
    let courses = courses(&World { draft, foreign: None }, &setting.scripts);
    for index in 0..hidden.len() {
        let others = hidden.iter().enumerate().filter(|(other, _)| *other != index);
        let rest = others.fold(setting.truth.clone(), |rest, (_, other)| rest.with(other.id, &other.parameters));
        hidden[index].leaves = leaves(&rest, &courses, ROUNDS);
    }
    (hidden, courses)
}

fn nothing(entry: &Entry, seed: u64, wrong_ocv: bool) -> Case {
    let setting = draw(entry.system, seed, &Wish { exact_ocv: !wrong_ocv, ..Wish::default() });
    let courses = courses(&World { draft: setting.truth.clone(), foreign: None }, &setting.scripts);
    let truth = Truth {
        story: "nothing is hidden".to_owned(),
        right: Right::Complete,
        confusable: false,
        wrong_ocv,
        told_over_floor: f64::NAN,
        base: base(&setting.truth),
    };
    finish(entry, seed, &setting, &courses, truth)
}

fn foreign(entry: &Entry, seed: u64, stranger: &Stranger) -> Case {
    let setting = draw(entry.system, seed, &Wish { base: Some(stranger.base), ..Wish::default() });
    let mut random = Stream::new(seed, "hidden");
    let make = (stranger.make)(&mut random);
    let (low, high) = entry.strength;
    let world = |size: f64| World { draft: setting.truth.clone(), foreign: Some((make.clone(), size)) };
    let trial = |size: f64| leaves(&setting.truth, &courses(&world(size), &setting.scripts), ROUNDS).strength;
    let size = size_for(random.log_between(low, high), trial, |_, _| false);
    let courses = courses(&world(size), &setting.scripts);
    let leaves = leaves(&setting.truth, &courses, ROUNDS);
    let right = if stranger.any.is_empty() {
        Right::Unknown { may: stranger.may.to_vec(), leaves }
    } else {
        Right::AnyOf { any: stranger.any.to_vec(), may: stranger.may.to_vec(), leaves }
    };
    let truth = Truth {
        story: stranger.story.to_owned(),
        right,
        confusable: false,
        wrong_ocv: true,
        told_over_floor: f64::NAN,
        base: base(&setting.truth),
    };
    finish(entry, seed, &setting, &courses, truth)
}

fn collinear(entry: &Entry, seed: u64, ambiguity: &Ambiguity) -> Case {
    let id = Stream::new(seed, "which").pick(ambiguity.hidden);
    let wish =
        Wish { hidden: vec![id], poor: ambiguity.poor, base: Some(ambiguity.base), all_known: ambiguity.all_known, exact_ocv: false };
    let setting = draw(entry.system, seed, &wish);
    let (hidden, courses) = hide(entry, seed, &setting, &[id]);
    let leaves = hidden[0].leaves.clone();
    let may = ambiguity.may.iter().copied().chain(stand_ins(&setting.truth, &courses)).collect();
    let right = Right::Set { must: ambiguity.must.to_vec(), may, leaves };
    let truth =
        Truth { story: tell(&hidden), right, confusable: false, wrong_ocv: true, told_over_floor: f64::NAN, base: base(&setting.truth) };
    finish(entry, seed, &setting, &courses, truth)
}

fn electrochemical(entry: &Entry, seed: u64, cell: usize, base: &[&'static str]) -> Case {
    // Sensors, start and beliefs are those of any battery; cell and logs are the stored ones.
    let mut setting = battery::draw(seed, &Wish { exact_ocv: true, ..Wish::default() });
    let cell = &CELLS[cell];
    let (full_v_per_cell, eod_v_per_cell) = cell.limits_v;
    let pack = PackFacts { series: 1, capacity_ah: cell.capacity_ah, full_v_per_cell, eod_v_per_cell, ocv: cell.ocv() };
    let mut values = Stream::new(seed, "battery parameters");
    let parts: Vec<_> = base.iter().map(|&id| battery::base_part(id, cell.capacity_ah, true, &mut values)).collect();
    for draft in [&mut setting.truth, &mut setting.believed] {
        (draft.pack, draft.parts) = (Some(pack.clone()), parts.clone());
        draft.uncertainty = Uncertainty { ocv_sigma_v: CELL_OCV_SIGMA_V, ..draft.uncertainty };
    }
    let courses = cell.courses();
    let leaves = leaves(&setting.truth, &courses, ROUNDS);
    let right = Right::AnyOf { any: RELAXATIONS.to_vec(), may: CELL_PHYSICS.to_vec(), leaves };
    let story = format!("single-particle model with electrolyte and temperature, parameter set {}", cell.name);
    let truth = Truth { story, right, confusable: false, wrong_ocv: false, told_over_floor: f64::NAN, base: Vec::new() };
    finish(entry, seed, &setting, &courses, truth)
}

/// Puts the gauge between truth and logs.
fn finish(entry: &Entry, seed: u64, setting: &Setting, courses: &[Course], mut truth: Truth) -> Case {
    let gauge = Gauge::draw(&setting.sensors, &mut Stream::new(seed, "gauge"));
    let (mut noise, mut starts) = (Stream::new(seed, "noise"), Stream::new(seed, "starts"));
    let mut logs: Vec<(bool, CaseLog)> =
        courses.iter().map(|course| (course.holdout, measured(entry.system, course, &gauge, &mut noise, &mut starts))).collect();
    let holdout: Vec<CaseLog> = logs.extract_if(.., |(holdout, _)| *holdout).map(|(_, log)| log).collect();
    if let Right::Effects(_) | Right::Complete = truth.right {
        truth.told_over_floor = told::over_floor(&as_told(setting, &truth), &holdout);
    }
    Case {
        seed,
        system: entry.system,
        name: entry.name.clone(),
        kind: entry.kind,
        base_model_toml: setting.believed.toml(),
        train: logs.into_iter().map(|(_, log)| log).collect(),
        holdout,
        truth,
    }
}

/// The true effects with their true numbers, on the OCV table that the lab gets.
fn as_told(setting: &Setting, truth: &Truth) -> Draft {
    let mut draft = setting.truth.clone();
    draft.pack.clone_from(&setting.believed.pack);
    let Right::Effects(hidden) = &truth.right else { return draft };
    hidden.iter().fold(draft, |draft, hidden| draft.with(hidden.id, &hidden.parameters))
}

fn measured(system: System, course: &Course, gauge: &Gauge, noise: &mut Stream, starts: &mut Stream) -> CaseLog {
    let shown = |(channel, values): &(Channel, Vec<f64>)| (*channel, gauge.shows(*channel, &course.time_s, values, noise));
    let role = Some(if course.holdout { Role::Holdout } else { Role::Train });
    // Who stores a battery says so.
    let gap_current = course.was_shelved().then_some(GapCurrent::Stated);
    let mut facts = LogFacts { role, gap_current, ..LogFacts::default() };
    if system == System::Battery {
        facts.soc_initial = Some((course.start.soc + battery::SOC_SIGMA * starts.normal()).clamp(0.0, 1.0));
        facts.soc_initial_sigma = Some(battery::SOC_SIGMA);
        facts.history = Some(if course.start.history > 0.0 { History::Discharged } else { History::Charged });
    }
    CaseLog { name: course.name.clone(), time_s: course.time_s.clone(), columns: course.columns.iter().map(shown).collect(), facts }
}

/// True values of the base's free parameters.
fn base(truth: &Draft) -> Vec<(&'static str, &'static str, f64)> {
    let free = |part: &crate::draft::Part| {
        let id = part.id;
        part.values.iter().filter(|value| value.free).map(move |value| (id, value.name, value.value)).collect::<Vec<_>>()
    };
    truth.parts.iter().flat_map(free).collect()
}

/// Hidden effects in words.
fn tell(hidden: &[Hidden]) -> String {
    let one = |hidden: &Hidden| {
        let values: Vec<String> = hidden.parameters.iter().map(|(name, value)| format!("{name} = {value:.4e}")).collect();
        format!("{} ({})", hidden.id, values.join(", "))
    };
    hidden.iter().map(one).collect::<Vec<_>>().join(" and ")
}
