//! What a change of model changes in what the coordinator plans with: run time and energy of a
//! battery, power of a robot, energy per service of a station.
//!
//! Each number comes from the library that the coordinator itself asks, under the circumstances
//! that the logs show, with the deviation that the model's own numbers give it.

mod battery;
mod robot;
mod station;

use std::sync::Arc;

use energy::{Estimate, Model, System};
use serde::ser::SerializeMap as _;
use serde::{Serialize, Serializer};

use crate::measurement::rows_after_gaps;
use crate::prepare::Prepared;
use crate::report::html::DecisionRow;
use crate::report::quantity::unit_of;

/// A number that the coordinator plans with, by one model.
#[derive(Debug, Clone, PartialEq)]
struct Figure {
    /// Its name, with unit.
    name: &'static str,
    /// What it is, in words.
    what: String,
    /// The number.
    estimate: Estimate,
}

/// A number that the coordinator plans with, before and after a change of model.
#[derive(Debug, Clone, PartialEq)]
pub struct Decision {
    /// Its name, with unit.
    pub name: &'static str,
    /// What it is, in words, with the circumstances.
    pub what: String,
    /// With the model as it was.
    pub before: Estimate,
    /// With the model as it is now.
    pub after: Estimate,
}

/// Everything that a change of model changes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Decisions(pub Vec<Decision>);

/// A model and the logs made ready for it.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// The model.
    pub model: &'a Arc<Model>,
    /// Logs that say under which circumstances it is asked.
    pub logs: &'a [Prepared],
}

impl Decisions {
    /// Of two models of one thing.
    #[must_use]
    pub fn between(before: Seen<'_>, after: Seen<'_>) -> Decisions {
        let old = figures(before);
        let both = figures(after).into_iter().filter_map(|new| {
            let old = old.iter().find(|old| old.name == new.name)?;
            // A circumstance such as the charge at the end of a log may itself move with the model.
            Some(Decision { name: new.name, what: new.what, before: old.estimate, after: new.estimate })
        });
        Decisions(both.collect())
    }

    /// The same for tables: times of minutes in minutes.
    #[must_use]
    pub fn rows(&self) -> Vec<DecisionRow> {
        let row = |decision: &Decision| {
            let unit = unit_of(decision.name);
            let minutes = unit == "s" && decision.before.value.max(decision.after.value) >= 600.0;
            let (scale, unit) = if minutes { (1.0 / 60.0, "min") } else { (1.0, unit) };
            let sigma = |estimate: Estimate| (estimate.sigma > 0.0).then_some(estimate.sigma * scale);
            DecisionRow {
                what: decision.what.clone(),
                unit: unit.to_owned(),
                before: decision.before.value * scale,
                before_sigma: sigma(decision.before),
                after: decision.after.value * scale,
                after_sigma: sigma(decision.after),
            }
        };
        self.0.iter().map(row).collect()
    }
}

impl Serialize for Decisions {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Entry<'a> {
            what: &'a str,
            before: Estimate,
            after: Estimate,
        }
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for decision in &self.0 {
            map.serialize_entry(decision.name, &Entry { what: &decision.what, before: decision.before, after: decision.after })?;
        }
        map.end()
    }
}

fn figures(seen: Seen<'_>) -> Vec<Figure> {
    match seen.model.system {
        System::Battery => battery::figures(seen),
        System::Robot => robot::figures(seen),
        System::Station => station::figures(seen),
    }
}

/// Sum over the rows of a log of a value times the interval that ends there; rows without a value are left out, and those after a
/// gap, over which nobody knows what was. And the time that counted, s.
fn integral(log: &Prepared, value: impl Fn(usize) -> Option<f64>) -> (f64, f64) {
    let mut gaps = rows_after_gaps(&log.time_s, &log.readings).into_iter().peekable();
    let known = (1..log.time_s.len()).filter(|row| gaps.next_if_eq(row).is_none());
    let rows = known.filter_map(|row| Some((value(row)?, log.time_s[row] - log.time_s[row - 1])));
    rows.fold((0.0, 0.0), |(sum, time_s), (value, dt_s)| (sum + value * dt_s, time_s + dt_s))
}

/// The values of an input of a log.
fn input(log: &Prepared, channel: energy::Channel) -> Option<&[f64]> {
    log.inputs.iter().find(|(known, _)| *known == channel).map(|(_, values)| values.as_slice())
}

#[cfg(test)]
mod tests;
