//! The file as it stands, before any check.

use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Instance {
    pub format: String,
    pub name: String,
    pub tick_s: i64,
    pub horizon: i64,
    pub capacity_target: i64,
    pub battery: Battery,
    pub stations: Vec<Station>,
    pub robots: Vec<Robot>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Battery {
    pub capacity: i64,
    pub floor: i64,
    pub min_gain: i64,
    pub targets: Vec<i64>,
    pub swap_energy: i64,
    pub curve: Vec<Segment>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Segment {
    pub below: i64,
    pub gain: i64,
    pub draw: i64,
    pub draw_bare: i64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Station {
    pub id: i64,
    pub bays: i64,
    pub lift_slots: i64,
    pub swap_slots: i64,
    pub hotel: i64,
    pub p_max: i64,
    pub switch_cost: i64,
    pub load_ticks: i64,
    pub load_draw: i64,
    pub unload_ticks: i64,
    pub unload_draw: i64,
    pub swap_ticks: i64,
    pub swap_draw: i64,
    pub spares: Vec<i64>,
    pub packs: Vec<Pack>,
    pub ongoing: Vec<Ongoing>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Pack {
    pub id: i64,
    pub remaining: i64,
    pub reserve: i64,
    pub available_from: i64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ongoing {
    pub bay: i64,
    pub until: i64,
    pub draw: i64,
    pub unload_ticks: i64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Robot {
    pub id: i64,
    pub energy: i64,
    pub drain: i64,
    pub drain_hi: i64,
    pub mission_end: i64,
    pub weight: i64,
    pub critical: Option<(i64, i64)>,
    pub critical_weight: i64,
    pub travel: Vec<(i64, i64)>,
}

/// Serde's message without its place, and with the nearest match of an unknown field.
pub(super) fn explain(message: &str) -> String {
    let message = message.rsplit_once(" at line ").map_or(message, |(what, _)| what);
    let Some((problem, expected)) = message.split_once(", expected ") else { return message.to_owned() };
    let (Some(wrong), true) = (problem.split('`').nth(1), problem.starts_with("unknown field")) else { return message.to_owned() };
    let known: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
    let near = known.iter().map(|name| (strsim::jaro_winkler(wrong, name), name)).filter(|(likeness, _)| *likeness > 0.75);
    let near = near.max_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(String::new, |(_, name)| format!(" did you mean `{name}`?"));
    format!("{problem};{near} allowed are {}", known.join(", "))
}
