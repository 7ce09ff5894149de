//! Measured and predicted over time, thinned to what an eye can see.

use std::sync::Arc;

use energy::Model;
use serde::Serialize;

use crate::input_noise::{input_noise, with_inputs};
use crate::predict::predict;
use crate::prepare::Prepared;
use crate::report::quantity::unit_of;
use crate::residual::{Residual, residuals};

/// Points in the order of time, in pieces between which nothing was measured.
pub type Pieces = Vec<Vec<(f64, f64)>>;

/// One channel of one log over time, in seconds and the channel's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trace {
    /// Name of the log.
    pub log: String,
    /// Canonical name of the channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Known sensor floor; none when the model states none.
    pub floor: Option<f64>,
    /// Rows that count, before thinning.
    pub rows: usize,
    /// Measured.
    pub measured: Pieces,
    /// Predicted.
    pub predicted: Pieces,
    /// Measured minus predicted.
    pub residual: Pieces,
}

/// Spans of time into which a log is cut; each keeps its lowest and its highest point.
const SPANS: usize = 360;
/// A pause longer than this many usual intervals breaks a line,
const PAUSE: f64 = 20.0;
/// if it is also longer than this share of the log: a logger may write only what changes.
const SEEN: f64 = 0.02;

/// Every channel of every log.
#[must_use]
pub fn traces(model: &Arc<Model>, values: &[f64], logs: &[Prepared]) -> Vec<Trace> {
    let mut all = Vec::new();
    for log in logs {
        let prediction = predict(model, log, values);
        let of_inputs = input_noise(model, log, values);
        for (target, (_, of_inputs)) in log.targets.iter().zip(of_inputs) {
            let rows: Vec<Residual> = residuals(log, &prediction, target).into_iter().filter(|row| row.used).collect();
            let thinned = |value: fn(&Residual) -> f64| thin(&rows.iter().map(|row| (log.time_s[row.row], value(row))).collect::<Vec<_>>());
            all.push(Trace {
                log: log.name.clone(),
                channel: target.channel.name().to_owned(),
                unit: unit_of(target.channel.name()).to_owned(),
                floor: (target.floor > 0.0).then(|| with_inputs(target.floor, of_inputs)),
                rows: rows.len(),
                measured: thinned(|row| row.observed),
                predicted: thinned(|row| row.predicted),
                residual: thinned(Residual::value),
            });
        }
    }
    all
}

/// Thins points in the order of time: peaks stay where they are, since every span keeps its lowest
/// and its highest point. Few points stay as they are.
fn thin(points: &[(f64, f64)]) -> Pieces {
    let mut steps: Vec<f64> = points.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    let usual_s = if steps.is_empty() { 0.0 } else { *steps.select_nth_unstable_by(points.len() / 2 - 1, f64::total_cmp).1 };
    let whole_s = points.last().map_or(0.0, |last| last.0 - points[0].0);
    let pause_s = (PAUSE * usual_s).max(SEEN * whole_s);
    let pieces = points.chunk_by(|a, b| b.0 - a.0 <= pause_s);
    if points.len() <= 2 * SPANS {
        return pieces.map(<[_]>::to_vec).collect();
    }
    let begin_s = points[0].0;
    let width_s = whole_s / SPANS as f64;
    let span = |point: &(f64, f64)| ((point.0 - begin_s) / width_s) as usize;
    let ends = |part: &[(f64, f64)]| {
        let lowest = (0..part.len()).min_by(|&a, &b| part[a].1.total_cmp(&part[b].1)).unwrap_or(0);
        let highest = (0..part.len()).max_by(|&a, &b| part[a].1.total_cmp(&part[b].1)).unwrap_or(0);
        let (first, second) = (lowest.min(highest), lowest.max(highest));
        if first == second { vec![part[first]] } else { vec![part[first], part[second]] }
    };
    pieces.map(|piece| piece.chunk_by(|a, b| span(a) == span(b)).flat_map(ends).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_of_one_row_survives_and_a_pause_breaks_the_line() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|k| (f64::from(k), f64::from(k % 7))).collect();
        points[54_321].1 = 99.0;
        points.drain(20_000..30_000);
        let pieces = thin(&points);
        assert_eq!(pieces.len(), 2);
        let kept: usize = pieces.iter().map(Vec::len).sum();
        assert!(kept <= 2 * SPANS + 4, "{kept}");
        assert!(pieces[1].contains(&(54_321.0, 99.0)));
        assert!(pieces.iter().all(|piece| piece.windows(2).all(|pair| pair[0].0 < pair[1].0)));
    }

    #[test]
    fn few_points_stay_as_they_are() {
        let points = [(0.0, 1.0), (1.0, 2.0), (2.0, 1.0)];
        assert_eq!(thin(&points), [points.to_vec()]);
        assert_eq!(thin(&points[..1]), [points[..1].to_vec()]);
        assert_eq!(thin(&[]), Pieces::new());
    }
}
