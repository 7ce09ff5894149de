//! Compares a model with logs: error against the known sensor floor, and where it lies.

use std::sync::Arc;

use energy::{Channel, Model};
use serde::Serialize;

use crate::predict::predict;
use crate::prepare::Prepared;
use crate::regime::{Dimension, dimensions};
use crate::report::quantity::{quantity, unit_of};
use crate::residual::{Residual, Size, residuals};

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
    /// Known sensor floor (noise and rounding); null when the model states none.
    pub floor: Option<f64>,
    /// RMS over floor.
    pub ratio: Option<f64>,
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
    /// The answer and the worst regimes, one sentence each.
    pub words: Vec<String>,
}

/// Compares the model, with these parameter values, with all logs.
#[must_use]
pub fn compare(model: &Arc<Model>, values: &[f64], logs: &[Prepared]) -> Comparison {
    let mut errors = Vec::new();
    let mut sorted: Vec<Sorted> = Vec::new();
    for (index, log) in logs.iter().enumerate() {
        let prediction = predict(model, log, values);
        let mut dimensions = dimensions(model, log, &prediction);
        if logs.len() > 1 {
            dimensions.insert(0, by_log(logs, index));
        }
        for target in &log.targets {
            let rows: Vec<Residual> = residuals(log, &prediction, target).into_iter().filter(|row| row.used).collect();
            errors.push(channel_error(log, target.channel, target.floor, Size::of(rows.iter().map(Residual::value))));
            for dimension in &dimensions {
                sort_in(&mut sorted, target.channel, dimension, &rows);
            }
        }
    }
    let verdict = match &errors {
        errors if errors.iter().any(|error| error.ratio.is_some_and(|ratio| ratio > WITHIN)) => Verdict::LeavesError,
        errors if errors.iter().any(|error| error.ratio.is_none()) => Verdict::FloorUnknown,
        _ => Verdict::WithinFloor,
    };
    let mut words = vec![answer(verdict, &errors)];
    let mut remarks: Vec<Remark> = sorted.iter().filter_map(worst).collect();
    remarks.sort_by(|a, b| b.excess.total_cmp(&a.excess));
    if remarks.is_empty() && verdict != Verdict::WithinFloor {
        words.push("No regime stands out: the squared error is spread about as the rows are.".to_owned());
    }
    words.extend(remarks.into_iter().map(|remark| remark.words));
    let regimes = sorted.iter().flat_map(regime_errors).collect();
    Comparison { schema: 1, model: model.name.clone(), verdict, errors, regimes, words }
}

fn channel_error(log: &Prepared, channel: Channel, floor: f64, size: Size) -> ChannelError {
    let floor = (floor > 0.0).then_some(floor);
    let ratio = floor.map(|floor| size.rms / floor);
    ChannelError { log: log.name.clone(), channel: channel.name(), unit: unit_of(channel.name()), size, floor, ratio }
}

fn by_log(logs: &[Prepared], index: usize) -> Dimension {
    let bands: Vec<String> = logs.iter().map(|log| log.name.clone()).collect();
    let groups = bands.iter().enumerate().map(|(index, name)| (vec![index], format!("in {name}"))).collect();
    Dimension { name: "log", bands, groups, of_row: vec![Some(index); logs[index].time_s.len()] }
}

/// Residuals of one channel, from all logs, sorted by one dimension.
struct Sorted {
    channel: Channel,
    dimension: Dimension,
    values: Vec<Vec<f64>>,
}

fn sort_in(all: &mut Vec<Sorted>, channel: Channel, dimension: &Dimension, rows: &[Residual]) {
    let known = all.iter().position(|sorted| sorted.channel == channel && sorted.dimension.name == dimension.name);
    let index = known.unwrap_or_else(|| {
        let values = vec![Vec::new(); dimension.bands.len()];
        all.push(Sorted { channel, dimension: dimension.clone(), values });
        all.len() - 1
    });
    for row in rows {
        if let Some(band) = dimension.of_row[row.row] {
            all[index].values[band].push(row.value());
        }
    }
}

fn regime_errors(sorted: &Sorted) -> Vec<RegimeError> {
    let sizes: Vec<Size> = sorted.values.iter().map(|values| Size::of(values.iter().copied())).collect();
    let squares: f64 = sizes.iter().map(Size::squares).sum();
    let rows: usize = sizes.iter().map(|size| size.rows).sum();
    let filled = sizes.into_iter().zip(&sorted.dimension.bands).filter(|(size, _)| size.rows > 0);
    let error = |(size, band): (Size, &String)| RegimeError {
        channel: sorted.channel.name(),
        dimension: sorted.dimension.name,
        band: band.clone(),
        unit: unit_of(sorted.channel.name()),
        size,
        share: if squares > 0.0 { size.squares() / squares } else { 0.0 },
        share_of_rows: size.rows as f64 / rows as f64,
    };
    filled.map(error).collect()
}

/// A share must exceed its share of rows by this much to be worth a sentence.
const REMARKABLE: f64 = 0.1;

/// Where the error lies, and by how much its share exceeds the share of rows.
struct Remark {
    excess: f64,
    words: String,
}

/// The set of bands in which the squared error is most concentrated, in words.
fn worst(sorted: &Sorted) -> Option<Remark> {
    let errors = regime_errors(sorted);
    let share = |bands: &[usize]| {
        let named = |error: &&RegimeError| bands.iter().any(|&band| sorted.dimension.bands[band] == error.band);
        errors.iter().filter(named).fold((0.0, 0.0), |sum, error| (sum.0 + error.share, sum.1 + error.share_of_rows))
    };
    let candidates = sorted.dimension.groups.iter().map(|(bands, words)| (share(bands), words));
    let ((error, rows), words) = candidates.max_by(|(a, _), (b, _)| (a.0 - a.1).total_cmp(&(b.0 - b.1)))?;
    (error - rows >= REMARKABLE).then(|| {
        let shares = (percent(error), percent(rows));
        let words = format!("{} of the squared error of {} lies {words}, in {} of the rows.", shares.0, sorted.channel.name(), shares.1);
        Remark { excess: error - rows, words }
    })
}

fn percent(share: f64) -> String {
    format!("{:.0} %", share * 100.0)
}

fn answer(verdict: Verdict, errors: &[ChannelError]) -> String {
    let by_ratio = |a: &&ChannelError, b: &&ChannelError| a.ratio.unwrap_or(0.0).total_cmp(&b.ratio.unwrap_or(0.0));
    let describe = |error: &ChannelError| {
        let rms = quantity(error.size.rms, error.unit);
        match (error.floor, error.ratio) {
            (Some(floor), Some(ratio)) => {
                let floor = quantity(floor, error.unit);
                format!("{rms} RMS of {} in {}, {ratio:.1} x the sensor floor of {floor}", error.channel, error.log)
            }
            _ => format!("{rms} RMS of {} in {}", error.channel, error.log),
        }
    };
    match (verdict, errors.iter().max_by(by_ratio)) {
        (Verdict::WithinFloor, Some(error)) => format!("The model explains the logs: at most {}.", describe(error)),
        (Verdict::LeavesError, Some(error)) => format!("The model leaves {}.", describe(error)),
        (Verdict::FloorUnknown, _) => {
            let unknown = errors.iter().find(|error| error.ratio.is_none()).map_or("", |error| error.channel);
            format!("No verdict: the model states no sensor floor for {unknown}; add [sensor.{unknown}] sigma = ... to it.")
        }
        (_, None) => "Nothing was compared.".to_owned(),
    }
}
