//! The part of a report that a comparison fills.

use std::sync::Arc;

use energy::Model;

use super::sections::{Answer, Errors, Header, LogLine, Page, SpectrumCurve, Tone};
use crate::compare::{Comparison, Verdict};
use crate::plot::traces;
use crate::predict::predict;
use crate::prepare::Prepared;
use crate::residual::residuals;
use crate::whiteness::cumulative_curve;

/// Points of a cumulative periodogram that are drawn.
const POINTS: usize = 300;

/// One line for each log.
#[must_use]
pub fn log_lines(logs: &[Prepared], holdout: bool) -> Vec<LogLine> {
    let span_s = |log: &Prepared| log.time_s.last().copied().unwrap_or(0.0) - log.time_s.first().copied().unwrap_or(0.0);
    logs.iter().map(|log| LogLine { name: log.name.clone(), holdout, rows: log.time_s.len(), span_s: span_s(log) }).collect()
}

/// A report of what a comparison found. The other sections stay empty until
/// [`Page::add_discovery`] fills them.
#[must_use]
pub fn page_of(model: &Arc<Model>, values: &[f64], logs: &[Prepared], comparison: &Comparison, date: Option<&str>) -> Page {
    let tone = match comparison.verdict {
        Verdict::WithinFloor => Tone::Good,
        Verdict::LeavesError => Tone::Bad,
        Verdict::FloorUnknown => Tone::Unsure,
    };
    let verdict = comparison.words.split_first().map(|(headline, words)| Answer {
        tone,
        headline: headline.clone(),
        words: words.to_vec(),
        experiment: None,
    });
    Page {
        header: Header {
            title: format!("{}: model and measurement", model.name),
            model: model.name.clone(),
            logs: log_lines(logs, false),
            notes: Vec::new(),
            date: date.map(str::to_owned),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        },
        verdict,
        errors: Errors::of(comparison),
        traces: traces(model, values, logs),
        regimes: comparison.regimes.clone(),
        spectra: spectra(model, values, logs, comparison),
        ..Page::default()
    }
}

impl Page {
    /// Adds what a comparison with held-out logs found.
    pub fn add_holdout(&mut self, model: &Arc<Model>, values: &[f64], logs: &[Prepared], comparison: &Comparison) {
        self.header.logs.extend(log_lines(logs, true));
        self.holdout_errors = Errors::of(comparison);
        self.traces.extend(traces(model, values, logs));
        if let (Some(verdict), Some(words)) = (&mut self.verdict, comparison.words.first()) {
            verdict.words.push(format!("Held-out logs: {words}"));
            if comparison.verdict == Verdict::LeavesError {
                verdict.tone = Tone::Bad;
            }
        }
    }
}

fn spectra(model: &Arc<Model>, values: &[f64], logs: &[Prepared], comparison: &Comparison) -> Vec<SpectrumCurve> {
    let mut all = Vec::new();
    for log in logs {
        let prediction = predict(model, log, values);
        for target in &log.targets {
            let rows = residuals(log, &prediction, target).into_iter().filter(|row| row.used);
            let (time_s, rest): (Vec<f64>, Vec<f64>) = rows.map(|row| (log.time_s[row.row], row.value())).unzip();
            let same = comparison.errors.iter().find(|error| error.log == log.name && error.channel == target.channel.name());
            let white = same.and_then(|error| error.whiteness.as_ref());
            let (Some(curve), Some(white)) = (cumulative_curve(&time_s, &rest), white) else { continue };
            all.push(SpectrumCurve {
                log: log.name.clone(),
                channel: target.channel.name().to_owned(),
                points: every(&curve, curve.len().div_ceil(POINTS)),
                distance_5_percent: white.cumulative_periodogram.distance_5_percent,
                p_value: white.cumulative_periodogram.p_value,
            });
        }
    }
    all
}

/// Every n-th point and the last. The curve only rises, so that none between them is far off; the
/// first few stay, since slow errors bend the curve there.
fn every(points: &[(f64, f64)], n: usize) -> Vec<(f64, f64)> {
    let kept = |index: usize| index < 20 || index.is_multiple_of(n) || index + 1 == points.len();
    points.iter().enumerate().filter(|(index, _)| kept(*index)).map(|(_, point)| *point).collect()
}
