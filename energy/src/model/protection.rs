//! Reads the `[protection]` table of a battery model.
//!
//! ```toml
//! [protection]
//! over_voltage_v = { trip = 4.28, release = 4.1, delay_s = 2.0 }
//! short_circuit_a = { trip = 30.0 }
//! ```
//!
//! What is not given keeps the value that follows from the pack's own facts.

use serde::Deserialize;
use toml::Spanned;

use crate::document::{Document, DocumentError};
use crate::protection::{Limits, Trip};
use crate::system::{Facts, System};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawProtection {
    short_circuit_a: Option<Spanned<RawLimit>>,
    over_current_discharge_a: Option<Spanned<RawLimit>>,
    over_current_charge_a: Option<Spanned<RawLimit>>,
    over_voltage_v: Option<Spanned<RawLimit>>,
    under_voltage_v: Option<Spanned<RawLimit>>,
    over_temperature_charge_degc: Option<Spanned<RawLimit>>,
    over_temperature_discharge_degc: Option<Spanned<RawLimit>>,
    under_temperature_charge_degc: Option<Spanned<RawLimit>>,
    under_temperature_discharge_degc: Option<Spanned<RawLimit>>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(deny_unknown_fields)]
struct RawLimit {
    trip: Option<f64>,
    delay_s: Option<f64>,
    release: Option<f64>,
    release_s: Option<f64>,
}

/// A day: no front end waits longer.
const WAIT_MAX_S: f64 = crate::units::S_PER_DAY;

/// Puts the table, when there is one, over the limits that follow from the pack's own facts.
pub(super) fn apply(
    document: &Document<'_>,
    system: System,
    facts: &mut Facts,
    raw: Option<Spanned<RawProtection>>,
) -> Result<(), DocumentError> {
    match (facts, raw) {
        (_, None) => Ok(()),
        (Facts::Battery(facts), Some(given)) => {
            facts.protection = limits(document, given.into_inner(), facts.protection.clone())?;
            Ok(())
        }
        (_, Some(given)) => {
            let message = format!("a [protection] table in a model with system = \"{}\"", system.name());
            Err(document.error_at(given.span(), message))
        }
    }
}

fn limits(document: &Document<'_>, raw: RawProtection, mut limits: Limits) -> Result<Limits, DocumentError> {
    for trip in Trip::ALL {
        let given = match trip {
            Trip::ShortCircuit => &raw.short_circuit_a,
            Trip::OverCurrentDischarge => &raw.over_current_discharge_a,
            Trip::OverCurrentCharge => &raw.over_current_charge_a,
            Trip::OverVoltage => &raw.over_voltage_v,
            Trip::UnderVoltage => &raw.under_voltage_v,
            Trip::OverTemperatureCharge => &raw.over_temperature_charge_degc,
            Trip::OverTemperatureDischarge => &raw.over_temperature_discharge_degc,
            Trip::UnderTemperatureCharge => &raw.under_temperature_charge_degc,
            Trip::UnderTemperatureDischarge => &raw.under_temperature_discharge_degc,
        };
        let Some(given) = given else { continue };
        let fail = |message: String| document.error_at(given.span(), format!("protection.{}: {message}", trip.name()));
        let (min, max) = range(trip);
        let within = |key: &str, value: Option<f64>, (min, max): (f64, f64), known: f64| match value {
            None => Ok(known),
            Some(value) if (min..=max).contains(&value) => Ok(value),
            Some(value) => Err(fail(format!("{key} = {value}: must be between {min} and {max}"))),
        };
        let raw = given.get_ref();
        let limit = limits.get_mut(trip);
        limit.trip = within("trip", raw.trip, (min, max), limit.trip)?;
        limit.release = within("release", raw.release, (min.min(0.0), max), limit.release)?;
        limit.delay_s = within("delay_s", raw.delay_s, (0.0, WAIT_MAX_S), limit.delay_s)?;
        limit.release_s = within("release_s", raw.release_s, (0.0, WAIT_MAX_S), limit.release_s)?;
        let (beyond, side) = if trip.is_lower() { (limit.release < limit.trip, "least") } else { (limit.release > limit.trip, "most") };
        if beyond {
            return Err(fail(format!("release = {} must be at {side} trip = {}", limit.release, limit.trip)));
        }
    }
    Ok(limits)
}

/// Least and greatest plausible threshold.
fn range(trip: Trip) -> (f64, f64) {
    match trip {
        Trip::ShortCircuit | Trip::OverCurrentDischarge | Trip::OverCurrentCharge => (1e-3, 1e6),
        Trip::OverVoltage | Trip::UnderVoltage => (0.1, 10.0),
        Trip::OverTemperatureCharge | Trip::OverTemperatureDischarge | Trip::UnderTemperatureCharge | Trip::UnderTemperatureDischarge => {
            (-80.0, 200.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::protection::{Limits, Trip};
    use crate::{Model, built_in};

    fn read(table: &str) -> Result<Model, String> {
        let text = format!("{}\n[protection]\n{table}\n", built_in("explorer-3s1p-1320mah").unwrap());
        Model::parse("pack.toml", &text, &|table| Ok(built_in(table).unwrap().to_owned())).map_err(|error| error.to_string())
    }

    #[test]
    fn what_the_table_leaves_out_follows_from_the_pack() {
        let model = read("over_voltage_v = { trip = 4.25, delay_s = 1.5 }").unwrap();
        let (limits, known) = (&model.battery().protection, Limits::of(4.2, 3.0, 1.32, 1.32));
        let over = limits.get(Trip::OverVoltage);
        assert_eq!((over.trip, over.delay_s, over.release), (4.25, 1.5, known.get(Trip::OverVoltage).release));
        for trip in Trip::ALL.into_iter().filter(|&trip| trip != Trip::OverVoltage) {
            assert_eq!(limits.get(trip), known.get(trip));
        }
    }

    #[test]
    fn every_limit_can_be_stated_under_its_name() {
        for trip in Trip::ALL {
            let known = *Limits::of(4.2, 3.0, 1.32, 1.32).get(trip);
            let model = read(&format!("{} = {{ trip = {}, release_s = 77.0 }}", trip.name(), known.trip)).unwrap();
            assert_eq!(model.battery().protection.get(trip).release_s, 77.0);
        }
    }

    #[test]
    fn bad_limits_are_refused_with_place_and_near_match() {
        let error = read("over_voltage_v = { trip = 4.25, release = 4.3 }").unwrap_err();
        assert!(error.starts_with("pack.toml:") && error.contains("release = 4.3 must be at most trip = 4.25"), "{error}");
        let error = read("under_voltage_v = { trip = 3.1 }").unwrap_err();
        assert!(error.contains("release = 3 must be at least trip = 3.1"), "{error}");
        assert!(read("over_voltage_v = { trip = nan }").unwrap_err().contains("trip = NaN: must be between 0.1 and 10"));
        assert!(read("over_voltage_v = { delay_s = -1.0 }").unwrap_err().contains("delay_s = -1"));
        assert!(read("over_voltage = { trip = 4.25 }").unwrap_err().contains("did you mean `over_voltage_v`?"));
        let robot = format!("{}\n[protection]\n", built_in("explorer-robot").unwrap());
        let error = Model::parse("robot.toml", &robot, &|_| unreachable!()).unwrap_err().to_string();
        assert!(error.contains("a [protection] table in a model with system = \"robot\""), "{error}");
    }
}
