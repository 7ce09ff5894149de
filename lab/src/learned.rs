//! What a search learned, written into the text of the model that it began with.
//!
//! Everything that a model file can hold is written: new effects, fitted parameters, and the shifts
//! of what the model knew only roughly (its OCV table, its capacity).
//! What belongs to one log or to a sensor (the charge at its start, an offset) has no place in the
//! file; [`left_out`] names it. That is why a written model, compared with the same logs, leaves a
//! little more error than the search did.

use energy::units::S_PER_H;
use energy::{Channel, Facts, Model, OcvTable};
use serde::Serialize;

use crate::infer::answer::deviations;
use crate::infer::certainty::range_sigma;
use crate::infer::rough::{Known, Rough, straight};
use crate::infer::state::State;
use crate::measurement::{Unmeasured, short};
use crate::model_edit::{Change, EditError, append, edit, ocv_of_file, set_number, set_ocv};
use crate::report::quantity::{digits, quantity, unit_of};

/// Share of its deviation by which a rough number must have moved to be written. A thousandth of a
/// capacity is millivolts near empty, so this is small.
const MOVED: f64 = 0.01;
/// The same for what is only told.
const WORTH_TELLING: f64 = 0.1;
/// Deviations from which on what was found is no chance.
const SURELY: f64 = 3.0;

/// The text of the given model with all that the state learned. `origin` says from what, `inline`
/// whether a table that the text names by file must stand in the text instead.
///
/// # Errors
/// When the text is not that of a model.
pub fn write(text: &str, given: &Model, state: &State, origin: &str, inline: bool) -> Result<String, EditError> {
    let model = &state.frame.model;
    let mut whole = text.to_owned();
    for effect in model.effects().map(|effect| effect.spec()).filter(|spec| given.effects().all(|known| known.spec().id != spec.id)) {
        whole = append(&whole, effect.id, &format!("{}: found by {origin}.", effect.title))?;
    }
    let table = if inline { ocv_of_file(model, &whole) } else { None };
    let changes = fitted(state, origin);
    // The table that the text names is replaced below when it moved, and only then.
    let moved = moved_ocv(state);
    whole = edit(&whole, &changes, if moved.is_some() { None } else { table })?;
    if let Some(moved) = moved {
        whole = set_ocv(&whole, &moved.table, &format!("by {} RMS, at most {}: {origin}", mv(moved.rms_v), mv(moved.most_v)))?;
        let was = format!("from {}: what the logs left open of the table, RMS", model.uncertainty.ocv_sigma_v);
        whole = set_number(&whole, "uncertainty", "ocv_sigma_v", moved.sigma_v, 2, &was)?;
    }
    if let (Some((error, sigma)), Facts::Battery(facts)) = (shift(state, Rough::Capacity, MOVED), &model.facts) {
        let was = format!("from {}: {origin}", facts.capacity_ah);
        whole = set_number(&whole, "battery", "capacity_ah", facts.capacity_ah * (1.0 + error), 6, &was)?;
        let was = format!("from {}: what the logs left open", model.uncertainty.capacity_relative_sigma);
        whole = set_number(&whole, "uncertainty", "capacity_relative_sigma", sigma, 2, &was)?;
    }
    Ok(whole)
}

/// What was learned and has no place in a model file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOut {
    /// What it is, in words.
    pub what: String,
    /// How far it was found from what the model and the log say, in `unit`.
    pub shift: f64,
    /// Standard deviation of that.
    pub sigma: f64,
    /// The deviation that the model or the log states for it.
    pub stated_sigma: f64,
    /// Unit of all; empty for a pure number.
    pub unit: &'static str,
    /// What the facts of the log would say then; empty where they cannot.
    pub fact: String,
}

/// What the state learned about logs and sensors, where it moved.
#[must_use]
pub fn left_out(state: &State) -> Vec<LeftOut> {
    let log = |log: usize| state.frame.evidence.logs[log].name.clone();
    let of = |known: &Known| {
        let what = known.what;
        let (words, unit) = match what {
            // Gaps are told as wholes, below.
            Rough::Capacity | Rough::Ocv(_) | Rough::Unmeasured { .. } => return None,
            Rough::SocInitial(own) => (format!("state of charge at the start of {}", log(own)), ""),
            Rough::TemperatureInitial(own) => (format!("temperature at the start of {}", log(own)), "K"),
            Rough::Ambient(own) => (format!("temperature around {}", log(own)), "K"),
            Rough::Clock(own) => (format!("time_s of formulas at the start of {}", log(own)), "s"),
            Rough::Offset(channel) => (format!("offset of the sensor of {}", channel.name()), unit(channel)),
            Rough::Gain(channel) => (format!("gain of the sensor of {} beyond 1", channel.name()), ""),
            Rough::Lag(channel) => (format!("delay of the sensor of {}", channel.name()), "s"),
        };
        let (shift, sigma) = shift(state, what, WORTH_TELLING)?;
        let fact = match what {
            Rough::SocInitial(own) => format!("soc_initial = {:.4}", (state.frame.evidence.logs[own].start.soc + shift).clamp(0.0, 1.0)),
            _ => String::new(),
        };
        Some(LeftOut { what: words, shift, sigma, stated_sigma: known.sigma, unit, fact })
    };
    state.frame.known.iter().filter_map(of).chain(through_gaps(state)).collect()
}

/// The charge that flowed in gaps of the logs, where it was another than the row after the gap says.
fn through_gaps(state: &State) -> Vec<LeftOut> {
    let frame = &state.frame;
    let of_gap = |(log, gap): (usize, usize)| {
        let logged = &frame.evidence.logs[log];
        let place = |what| frame.known.iter().position(|known| known.what == what);
        let pieces: Vec<(&Unmeasured, usize)> = (logged.unmeasured.iter().enumerate())
            .filter(|(_, piece)| piece.gap == gap)
            .filter_map(|(number, piece)| Some((piece, place(Rough::Unmeasured { log, piece: number })?)))
            .collect();
        let hours = |piece: &Unmeasured| (piece.to_s - piece.from_s) / S_PER_H;
        let (first, last) = (pieces.first()?.0, pieces.last()?.0);
        let shift: f64 = pieces.iter().map(|(piece, place)| hours(piece) * state.x[frame.free.len() + place]).sum();
        let stated_sigma = pieces.iter().map(|(piece, _)| (hours(piece) * piece.current_sigma_a).powi(2)).sum::<f64>().sqrt();
        let covariance = state.covariance();
        let terms = pieces.iter().flat_map(|one| pieces.iter().map(move |other| (one, other)));
        let variance: f64 =
            terms.map(|((a, at), (b, to))| hours(a) * hours(b) * covariance[(frame.free.len() + at, frame.free.len() + to)]).sum();
        let what = format!(
            "charge from {} to {} s of {}, of which no current was logged, beyond that of the row after",
            short(first.from_s),
            short(last.to_s),
            logged.name
        );
        let sigma = variance.max(0.0).sqrt().min(stated_sigma);
        // What a log states of a long gap is so little that hardly anything is far from it.
        (shift.abs() > (WORTH_TELLING * stated_sigma).min(SURELY * sigma)).then(|| LeftOut {
            what,
            shift,
            sigma,
            stated_sigma,
            unit: "Ah",
            fact: String::new(),
        })
    };
    let logs = frame.evidence.logs.iter().enumerate();
    let gaps = logs.flat_map(|(log, logged)| (0..logged.unmeasured.last().map_or(0, |piece| piece.gap + 1)).map(move |gap| (log, gap)));
    gaps.filter_map(of_gap).collect()
}

/// A difference of temperatures is in K.
fn unit(channel: Channel) -> &'static str {
    match unit_of(channel.name()) {
        "degC" => "K",
        unit => unit,
    }
}

fn mv(volts: f64) -> String {
    quantity(volts, "V")
}

/// Times the written deviation from which on that of a number by itself is said beside it.
const APART: f64 = 1.2;

/// New numbers of the free parameters. A file holds a deviation for each number and not how they go
/// together: of numbers that the logs know only in combination it gets the deviation within what
/// they do know, so that what follows from all of them is no less certain than it is. One that was given with a deviation, and of which
/// they say nothing, stays as it stands.
fn fitted(state: &State, origin: &str) -> Vec<Change> {
    let covariance = state.covariance_by_rows();
    let deviations = deviations(state);
    let of = |(place, &index): (usize, &usize)| {
        let parameter = &state.frame.model.parameters()[index];
        let open = range_sigma(&state.frame, index);
        let by_itself = state.normal[(place, place)].max(0.0).sqrt().recip();
        if state.better_as_stated(place).is_some() {
            return None;
        }
        let sigma = if by_itself < open { covariance[(place, place)].max(0.0).sqrt().max(by_itself).min(open) } else { open };
        Some(Change {
            effect: parameter.effect.to_owned(),
            parameter: parameter.name.to_owned(),
            value: state.x[place],
            sigma,
            range: (parameter.min, parameter.max),
            source: match deviations[place].2 {
                Some(alone) if alone > APART * sigma => {
                    format!("fitted by {origin}; sigma with all other numbers as they are, {} for it by itself", digits(alone))
                }
                Some(_) => format!("fitted by {origin}"),
                None => format!("left open by the logs: {origin}"),
            },
            free: true,
        })
    };
    state.frame.free.iter().enumerate().filter_map(of).collect()
}

/// A rough number's shift and the deviation that is left of it; none when it hardly moved.
fn shift(state: &State, what: Rough, share: f64) -> Option<(f64, f64)> {
    let place = state.frame.known.iter().position(|known| known.what == what)?;
    let (known, unknown) = (&state.frame.known[place], state.frame.free.len() + place);
    let error = state.x[unknown];
    (error.abs() > share * known.sigma).then(|| (error, left_open(state, unknown).min(known.sigma)))
}

fn left_open(state: &State, unknown: usize) -> f64 {
    // One column of the covariance is enough, and the whole is small.
    state.covariance()[(unknown, unknown)].max(0.0).sqrt()
}

/// An OCV table with the correction that was learned.
struct MovedOcv {
    table: OcvTable,
    rms_v: f64,
    most_v: f64,
    sigma_v: f64,
}

/// Correction below which a table is left alone, V per cell.
const OCV_LEAST_V: f64 = 2e-5;

fn moved_ocv(state: &State) -> Option<MovedOcv> {
    let Facts::Battery(facts) = &state.frame.model.facts else { return None };
    let (first, last) = (facts.ocv.points().0[0], *facts.ocv.points().0.last()?);
    // What lies beyond the table's ends would change the line that goes on from them.
    let mut errors = state.frame.ocv_error(&state.x);
    errors.retain(|(soc, _)| (first..=last).contains(soc));
    let most_v = errors.iter().map(|(_, error)| *error).max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    if most_v.abs() < OCV_LEAST_V {
        return None;
    }
    let knots: Vec<f64> = errors.iter().map(|(soc, _)| *soc).collect();
    let mut soc: Vec<f64> = facts.ocv.points().0.iter().copied().chain(knots).collect();
    soc.sort_by(f64::total_cmp);
    soc.dedup_by(|a, b| *a - *b < 1e-9);
    let moved = |&soc: &f64| facts.ocv.voltage_v(soc) + straight(&errors, soc);
    // To a microvolt: far below any sensor, and short.
    let voltage_v = rising(&soc.iter().map(moved).collect::<Vec<_>>()).into_iter().map(|v| (v * 1e6).round() / 1e6).collect();
    let covariance = state.covariance();
    let known = state.frame.known.iter().enumerate().filter(|(_, known)| matches!(known.what, Rough::Ocv(_)));
    let variances: Vec<f64> = known
        .map(|(place, known)| {
            let unknown = state.frame.free.len() + place;
            covariance[(unknown, unknown)].clamp(0.0, known.sigma.powi(2))
        })
        .collect();
    let mean = |squares: &[f64]| squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let squares: Vec<f64> = errors.iter().map(|(_, error)| error.powi(2)).collect();
    Some(MovedOcv { table: OcvTable::new(soc, voltage_v).ok()?, rms_v: mean(&squares).sqrt(), most_v, sigma_v: mean(&variances).sqrt() })
}

/// The nearest values that do not fall, by pooling neighbours that do (isotonic regression).
fn rising(values: &[f64]) -> Vec<f64> {
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for &value in values {
        let mut pool = (value, 1);
        while let Some(&(mean, count)) = pools.last().filter(|(mean, _)| *mean > pool.0) {
            pools.pop();
            let total = count + pool.1;
            pool = ((mean * count as f64 + pool.0 * pool.1 as f64) / total as f64, total);
        }
        pools.push(pool);
    }
    pools.into_iter().flat_map(|(mean, count)| std::iter::repeat_n(mean, count)).collect()
}

#[cfg(test)]
mod tests {
    use super::rising;

    #[test]
    fn what_falls_is_pooled_and_what_rises_stays() {
        assert_eq!(rising(&[1.0, 3.0, 2.0, 4.0]), [1.0, 2.5, 2.5, 4.0]);
        assert_eq!(rising(&[3.0, 2.0, 1.0]), [2.0; 3]);
        assert_eq!(rising(&[1.0, 2.0]), [1.0, 2.0]);
    }
}
