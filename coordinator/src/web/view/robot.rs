//! One robot in full: how it is, why it is serviced so, what else there was.

use proto::{Explanation, RobotId, Timestamp};
use serde::Serialize;

use super::{Tone, fleet};
use crate::answers;
use crate::core::Core;
use crate::models::from_wire;
use crate::web::number::{percent, quantity, reading, span};
use crate::web::past::{Past, Series};
use crate::when::minute_from;

/// One robot.
#[derive(Debug, Clone, Serialize)]
pub struct RobotDetail {
    /// Which.
    pub robot: RobotId,
    /// When it was looked at.
    pub at: Timestamp,
    /// What it does.
    pub doing: String,
    /// How that stands.
    pub tone: Tone,
    /// Its service in a sentence.
    pub service: String,
    /// Why so, line by line.
    pub reasons: Vec<String>,
    /// What else there was.
    pub alternatives: Vec<AlternativeLine>,
    /// Doubts in models that its service rests on: what, and what to run.
    pub doubts: Vec<DoubtLine>,
    /// What its gauge says.
    pub facts: Vec<Fact>,
    /// Whether it is not there to be heard, and may be forgotten.
    pub may_forget: bool,
    /// Its state of charge over time, a fraction.
    pub charge: Series,
}

/// A labelled number.
#[derive(Debug, Clone, Serialize)]
pub struct Fact {
    /// What.
    pub label: &'static str,
    /// How much.
    pub text: String,
}

/// Another way of servicing a robot.
#[derive(Debug, Clone, Serialize)]
pub struct AlternativeLine {
    /// `exchange at mds-1`.
    pub what: String,
    /// `could begin 12:52`, or `not now`.
    pub when: String,
    /// Why it was not taken.
    pub why_not: Vec<String>,
}

/// A doubt.
#[derive(Debug, Clone, Serialize)]
pub struct DoubtLine {
    /// In a sentence.
    pub text: String,
    /// What to run.
    pub command: String,
}

pub(super) fn detail(now: Timestamp, core: &Core, past: &Past, id: &RobotId) -> Result<RobotDetail, String> {
    let explanation = core.explain(now, id)?;
    let robot = &core.fleet().robots[id];
    let (doing, tone) = fleet::doing(robot);
    let Explanation { service, reasons, alternatives, doubts, .. } = explanation;
    let service = service.map_or_else(
        || "no service".to_owned(),
        |service| {
            let bay = service.bay.as_ref().map_or_else(String::new, |bay| format!(" {bay}"));
            format!(
                "{} at {}{bay}, {} to {}",
                service.status,
                service.station,
                minute_from(now, service.start),
                minute_from(now, service.end)
            )
        },
    );
    let alternatives = alternatives.into_iter().map(|other| AlternativeLine {
        what: format!("{} at {}", answers::mode_in_words(&other.mode), other.station),
        when: other.start.map_or_else(|| "not now".to_owned(), |start| format!("could begin {}", minute_from(now, start))),
        why_not: other.why_not,
    });
    Ok(RobotDetail {
        robot: id.clone(),
        at: now,
        doing,
        tone,
        service,
        reasons,
        alternatives: alternatives.collect(),
        doubts: doubts.into_iter().map(|doubt| DoubtLine { text: doubt.text, command: doubt.command }).collect(),
        facts: facts(robot),
        may_forget: core.can_forget(id).is_ok(),
        charge: past.robots.get(id).cloned().unwrap_or_default(),
    })
}

fn facts(robot: &crate::fleet::Robot) -> Vec<Fact> {
    let mut facts = Vec::new();
    if let Some(gauge) = &robot.gauge {
        facts.push(Fact { label: "Charge", text: percent(from_wire(gauge.soc)).text });
        facts.push(Fact { label: "Energy left", text: quantity(from_wire(gauge.remaining_wh), "Wh").text });
        facts.extend(gauge.time_to_empty_s.map(|s| Fact { label: "Time to empty", text: span(from_wire(s)).text }));
        facts.extend(fleet::to_full_s(robot).map(|s| Fact { label: "Time to full", text: span(from_wire(s)).text }));
        facts.push(Fact { label: "Health", text: percent(from_wire(gauge.soh)).text });
        facts.push(Fact { label: "Voltage", text: reading(gauge.voltage_v, "V", 2).text });
        facts.push(Fact { label: "Current", text: reading(gauge.current_a, "A", 2).text });
        facts.push(Fact { label: "Temperature", text: reading(gauge.temperature_degc, "°C", 1).text });
        facts.push(Fact { label: "Gauge", text: gauge.source.clone() });
    }
    if let Some(state) = &robot.state {
        facts.push(Fact { label: "Draws at work", text: quantity(from_wire(state.drain_w), "W").text });
        facts.push(Fact { label: "Battery model", text: state.battery.clone() });
        for (station, way) in &state.travel {
            let energy = quantity(from_wire(way.energy_wh), "Wh").text;
            facts.push(Fact { label: "Way home", text: format!("{station}: {}, {energy}", crate::web::number::span_text(way.time_s)) });
        }
        facts.extend(state.note.clone().map(|text| Fact { label: "Note", text }));
    }
    facts
}
