//! A station: its packs as stacked energy, its bays, its spares.

use proto::{BayPhase, PackId, RobotId, Schedule, StationId, StationState, Timestamp};
use serde::Serialize;

use super::stack::{Stack, Stacks};
use super::{Tone, fleet};
use crate::fleet::Station;
use crate::models::from_wire;
use crate::view::Basis;
use crate::web::number::{Quantity, percent, reading, span};
use crate::when::{self, minute_from};

/// One station.
#[derive(Debug, Clone, Serialize)]
pub struct StationCard {
    /// Which.
    pub station: StationId,
    /// How it is, in words.
    pub state: String,
    /// How that stands.
    pub tone: Tone,
    /// Its packs.
    pub packs: Vec<PackLine>,
    /// Its bays.
    pub bays: Vec<BayLine>,
    /// Batteries that robots can get.
    pub spares: Vec<SpareLine>,
}

/// One pack.
#[derive(Debug, Clone, Serialize)]
pub struct PackLine {
    /// Which.
    pub pack: PackId,
    /// `feeds the station`, `depleted`, `absent`, or nothing.
    pub state: String,
    /// How it stands.
    pub tone: Tone,
    /// State of charge; none before its gauge spoke.
    pub charge: Option<Quantity>,
    /// Where its energy goes; none before its gauge spoke.
    pub stack: Option<Stack>,
    /// Time until it is empty at its present load.
    pub time_to_empty: Option<Quantity>,
    /// Voltage and temperature.
    pub readings: Vec<Quantity>,
}

/// One bay.
#[derive(Debug, Clone, Serialize)]
pub struct BayLine {
    /// Which.
    pub bay: String,
    /// `free`, or what happens in it and until when.
    pub state: String,
    /// The robot in it.
    pub robot: Option<RobotId>,
    /// How it stands.
    pub tone: Tone,
}

/// One spare.
#[derive(Debug, Clone, Serialize)]
pub struct SpareLine {
    /// Which.
    pub spare: String,
    /// Its charge.
    pub charge: Quantity,
    /// `ready`, or not.
    pub state: &'static str,
    /// How it stands.
    pub tone: Tone,
}

pub(super) fn cards(basis: &Basis<'_>, schedule: &Schedule, stacks: &Stacks) -> Vec<StationCard> {
    let mut ids: Vec<&StationId> = basis.models.stations.keys().chain(basis.fleet.stations.keys()).collect();
    ids.sort_by_key(|id| fleet::natural(id.as_ref()));
    ids.dedup();
    ids.into_iter().map(|id| card(basis, schedule, stacks, id)).collect()
}

fn card(basis: &Basis<'_>, schedule: &Schedule, stacks: &Stacks, id: &StationId) -> StationCard {
    let known = basis.fleet.stations.get(id).and_then(|station| Some((station, station.state.as_ref()?)));
    let Some((station, state)) = known else {
        let state = "not heard yet".to_owned();
        return StationCard { station: id.clone(), state, tone: Tone::Quiet, packs: Vec::new(), bays: Vec::new(), spares: Vec::new() };
    };
    let (words, tone) = standing(basis.now, station, state);
    StationCard {
        station: id.clone(),
        state: words,
        tone,
        packs: state
            .packs
            .iter()
            .map(|pack| pack_line(basis.now, station, state, pack, stacks.get(&(id.clone(), pack.pack.clone()))))
            .collect(),
        bays: state.bays.iter().map(|bay| bay_line(basis.now, schedule, id, bay)).collect(),
        spares: state.spares.iter().map(spare_line).collect(),
    }
}

fn standing(now: Timestamp, station: &Station, state: &StationState) -> (String, Tone) {
    if station.is_lost() {
        return ("lost".to_owned(), Tone::Bad);
    }
    if !state.powered {
        return ("without power".to_owned(), Tone::Bad);
    }
    let mut words = vec![format!("draws {:.1} W", state.pack_power_w)];
    if let Some(at) = state.arrives {
        words.push(format!("on its way, takes robots in from {}", minute_from(now, at)));
    }
    if !state.away.is_empty() {
        words.push(when::away(now, &state.away));
    }
    if state.lift_busy {
        words.push("lift moves".to_owned());
    }
    if let Some(robot) = &state.swapping {
        words.push(format!("exchanges the pack of {robot}"));
    }
    words.extend(state.note.clone());
    (words.join(", "), Tone::Good)
}

fn back_in_words(now: Timestamp, back: proto::PackReturn) -> String {
    format!("away, a pack with {:.0} % comes at {}", back.soc.value * 100.0, minute_from(now, back.at))
}

fn pack_line(now: Timestamp, station: &Station, state: &StationState, pack: &proto::PackState, stack: Option<&Stack>) -> PackLine {
    let gauge = station.packs.get(&pack.pack);
    let active = state.active_pack.as_ref() == Some(&pack.pack);
    let (words, tone) = match (pack.connected, pack.depleted, active) {
        (false, ..) => (pack.back.map_or_else(|| "absent".to_owned(), |back| back_in_words(now, back)), Tone::Quiet),
        (_, true, _) => ("depleted".to_owned(), Tone::Bad),
        (.., true) => ("feeds the station".to_owned(), Tone::Active),
        _ => (String::new(), Tone::Quiet),
    };
    PackLine {
        pack: pack.pack.clone(),
        state: words,
        tone,
        charge: gauge.map(|gauge| percent(from_wire(gauge.soc))),
        stack: stack.filter(|_| pack.connected).cloned(),
        time_to_empty: gauge.and_then(|gauge| gauge.time_to_empty_s).map(|time_s| span(from_wire(time_s))),
        readings: gauge.map_or_else(Vec::new, |gauge| {
            vec![reading(gauge.voltage_v, "V", 2), reading(gauge.current_a, "A", 2), reading(gauge.temperature_degc, "°C", 1)]
        }),
    }
}

fn bay_line(now: Timestamp, schedule: &Schedule, station: &StationId, bay: &proto::BayState) -> BayLine {
    let serves = |service: &&proto::Service| service.station == *station && Some(&service.robot) == bay.robot.as_ref();
    let until =
        schedule.services.iter().find(serves).map_or_else(String::new, |service| format!(" until {}", minute_from(now, service.end)));
    let (state, tone) = match bay.phase {
        BayPhase::Free => ("free".to_owned(), Tone::Quiet),
        BayPhase::Failed => ("out of order".to_owned(), Tone::Bad),
        phase => (format!("{phase}{until}"), Tone::Active),
    };
    BayLine { bay: bay.bay.to_string(), state, robot: bay.robot.clone(), tone }
}

fn spare_line(spare: &proto::SpareState) -> SpareLine {
    let (state, tone) = if spare.ready { ("ready", Tone::Good) } else { ("not ready", Tone::Quiet) };
    SpareLine { spare: spare.spare.to_string(), charge: percent(from_wire(spare.soc)), state, tone }
}
