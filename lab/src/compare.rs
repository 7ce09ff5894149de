//! Compares a model with logs: error against the known sensor floor, and where it lies.

mod calibration;
mod words;

use std::sync::Arc;

use energy::{Channel, Model};
use serde::Serialize;

use crate::concentration::{Concentration, Sorted, worst};
use crate::floor::FloorCheck;
use crate::input_noise::{input_noise, with_inputs};
use crate::predict::{Prediction, predict};
use crate::prepare::{Prepared, Target};
use crate::regime::{Dimension, dimensions};
use crate::report::quantity::unit_of;
use crate::residual::{Residual, Size, residuals};
use crate::rounding::step_of;
use crate::whiteness::Whiteness;
pub use calibration::{Calibrated, Calibration, calibrate};
pub use words::floors_too_small;

/// RMS up to this multiple of the sensor floor counts as the floor.
pub const WITHIN: f64 = 1.5;

/// The answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// On every channel of every log, RMS is within [`WITHIN`] times the sensor floor.
    WithinFloor,
    /// The model leaves more than the sensors explain.
    LeavesError,
    /// The model states no sensor floor for a channel, so nobody can tell.
    FloorUnknown,
}

/// Error of one channel in one log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelError {
    /// Name of the log.
    pub log: String,
    /// Canonical name of the channel.
    pub channel: &'static str,
    /// Unit of every number here except `ratio`.
    pub unit: &'static str,
    /// Size of observed minus predicted.
    #[serde(flatten)]
    pub size: Size,
    /// Known floor: noise and rounding of the channel's own sensor, and what the noise of measured inputs adds; null when the
    /// model states no noise of that sensor.
    pub floor: Option<f64>,
    /// Share of the floor's square that the noise of inputs makes, 0..1.
    pub floor_of_inputs: f64,
    /// RMS over floor.
    pub ratio: Option<f64>,
    /// How sure that ratio is, and whether the floor itself can be right; null without a floor.
    pub floor_check: Option<FloorCheck>,
    /// What the residual looks like in time; null when there are too few rows to say.
    pub whiteness: Option<Whiteness>,
}

/// Error of one channel, over all logs, in one band of a regime.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegimeError {
    /// Canonical name of the channel.
    pub channel: &'static str,
    /// What the rows are sorted by: `log`, `soc`, `current`, ...
    pub dimension: &'static str,
    /// The band.
    pub band: String,
    /// Unit of the numbers in `size`.
    pub unit: &'static str,
    /// Size of observed minus predicted.
    #[serde(flatten)]
    pub size: Size,
    /// Share of the channel's squared error, 0..1.
    pub share: f64,
    /// Share of the channel's rows, 0..1.
    pub share_of_rows: f64,
}

/// Where the error of one channel, over all logs, is densest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Worst {
    /// Canonical name of the channel.
    pub channel: &'static str,
    /// The shortest set of conditions that explains most of the squared error.
    #[serde(flatten)]
    pub concentration: Concentration,
    /// The same for the rows outside that set, with shares of what is left; null when the rest is
    /// small or spread evenly.
    pub of_the_rest: Option<Concentration>,
}

/// Everything that `lab compare` says. Residuals are observed minus predicted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Version of this structure.
    pub schema: u32,
    /// Name of the model.
    pub model: String,
    /// The answer.
    pub verdict: Verdict,
    /// Error by log and channel.
    pub errors: Vec<ChannelError>,
    /// Error by regime; bands without rows are left out.
    pub regimes: Vec<RegimeError>,
    /// Where the error is densest, worst channel first; none for a channel whose error is spread
    /// evenly.
    pub worst: Vec<Worst>,
    /// The answer, the worst regimes, what the residual looks like and what calibration leaves of it, one sentence each.
    pub words: Vec<String>,
    /// What is left once sensors and starts are calibrated; null where nobody asked, the model leaves nothing, or it takes nothing away.
    pub calibration: Option<Calibration>,
}

/// Compares the model, with these parameter values, with all logs.
#[must_use]
pub fn compare(model: &Arc<Model>, values: &[f64], logs: &[Prepared]) -> Comparison {
    let predictions: Vec<Prediction> = logs.iter().map(|log| predict(model, log, values)).collect();
    let dimensions = dimensions(model, logs, &predictions);
    let mut errors = Vec::new();
    let mut channels: Vec<Rows> = Vec::new();
    for (index, (log, prediction)) in logs.iter().zip(&predictions).enumerate() {
        let of_inputs = input_noise(model, log, values);
        for (target, (_, of_inputs)) in log.targets.iter().zip(of_inputs) {
            let rows: Vec<Residual> = residuals(log, prediction, target).into_iter().filter(|row| row.used).collect();
            errors.push(channel_error(log, target, of_inputs, &rows));
            let known = channels.iter().position(|known| known.channel == target.channel);
            let known = known.unwrap_or_else(|| {
                channels.push(Rows::new(target.channel, dimensions.len()));
                channels.len() - 1
            });
            channels[known].add(&dimensions, index, &rows);
        }
    }
    let verdict = match &errors {
        errors if errors.iter().any(|error| error.ratio.is_some_and(|ratio| ratio > WITHIN)) => Verdict::LeavesError,
        errors if errors.iter().any(|error| error.ratio.is_none()) => Verdict::FloorUnknown,
        _ => Verdict::WithinFloor,
    };
    let mut worst: Vec<Worst> = channels.iter().filter_map(|rows| rows.worst(&dimensions)).collect();
    let excess = |worst: &Worst| worst.concentration.share - worst.concentration.share_of_rows;
    worst.sort_by(|a, b| excess(b).total_cmp(&excess(a)));
    let words = words::words(verdict, &errors, &worst);
    let regimes = channels.iter().flat_map(|rows| rows.errors(&dimensions)).collect();
    Comparison { schema: 1, model: model.name.clone(), verdict, errors, regimes, worst, words, calibration: None }
}

fn channel_error(log: &Prepared, target: &Target, of_inputs: f64, rows: &[Residual]) -> ChannelError {
    let channel = target.channel.name();
    let places: Vec<usize> = rows.iter().map(|row| row.row).collect();
    let time_s: Vec<f64> = places.iter().map(|&row| log.time_s[row]).collect();
    let values: Vec<f64> = rows.iter().map(Residual::value).collect();
    let observed: Vec<f64> = rows.iter().map(|row| row.observed).collect();
    let size = Size::of(values.iter().copied());
    let floor = (target.floor > 0.0).then(|| with_inputs(target.floor, of_inputs));
    ChannelError {
        log: log.name.clone(),
        channel,
        unit: unit_of(channel),
        size,
        floor,
        floor_of_inputs: floor.map_or(0.0, |floor| 1.0 - (target.floor / floor).powi(2)),
        ratio: floor.map(|floor| size.rms / floor),
        floor_check: FloorCheck::of(&places, &values, floor.unwrap_or(0.0), step_of(&observed)),
        whiteness: Whiteness::of(&time_s, &values),
    }
}

/// Rows of one channel, from all logs, sorted by every regime.
struct Rows {
    channel: Channel,
    values: Vec<f64>,
    sorted: Sorted,
}

/// Share of the squared error that must be left for the rest to get a sentence of its own.
const WORTH_ANOTHER: f64 = 0.15;

impl Rows {
    fn new(channel: Channel, dimensions: usize) -> Rows {
        Rows { channel, values: Vec::new(), sorted: Sorted { squares: Vec::new(), bands: vec![Vec::new(); dimensions] } }
    }

    fn add(&mut self, dimensions: &[Dimension], log: usize, rows: &[Residual]) {
        self.values.extend(rows.iter().map(Residual::value));
        self.sorted.squares.extend(rows.iter().map(|row| row.value() * row.value()));
        for (dimension, bands) in dimensions.iter().zip(&mut self.sorted.bands) {
            let of_row = &dimension.of_row[log];
            // A log without the channel has no row in any band.
            bands.extend(rows.iter().map(|row| of_row.get(row.row).copied().flatten()));
        }
    }

    fn errors(&self, dimensions: &[Dimension]) -> Vec<RegimeError> {
        let squares: f64 = self.sorted.squares.iter().sum();
        let mut errors = Vec::new();
        for (dimension, of_row) in dimensions.iter().zip(&self.sorted.bands) {
            let mut values = vec![Vec::new(); dimension.bands.len()];
            for (value, band) in self.values.iter().zip(of_row) {
                if let Some(band) = *band {
                    values[band].push(*value);
                }
            }
            let filled = values.into_iter().zip(&dimension.bands).filter(|(values, _)| !values.is_empty());
            errors.extend(filled.map(|(values, band)| {
                let size = Size::of(values.into_iter());
                RegimeError {
                    channel: self.channel.name(),
                    dimension: dimension.name,
                    band: band.clone(),
                    unit: unit_of(self.channel.name()),
                    size,
                    share: if squares > 0.0 { size.squares() / squares } else { 0.0 },
                    share_of_rows: size.rows as f64 / self.values.len() as f64,
                }
            }));
        }
        errors
    }

    fn worst(&self, dimensions: &[Dimension]) -> Option<Worst> {
        let concentration = worst(dimensions, &self.sorted)?;
        let rest = (1.0 - concentration.share >= WORTH_ANOTHER).then(|| self.sorted.without(dimensions, &concentration));
        let of_the_rest = rest.and_then(|rest| worst(dimensions, &rest));
        Some(Worst { channel: self.channel.name(), concentration, of_the_rest })
    }
}
