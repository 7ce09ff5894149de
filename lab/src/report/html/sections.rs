//! What a report holds, as plain data. Every section is optional: an empty one is left out.

use serde::Serialize;

use crate::compare::{Calibrated, ChannelError, Comparison, RegimeError};
use crate::plot::Trace;
use crate::report::discovery::FileErrors;

/// A whole report.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Page {
    /// What was looked at.
    pub header: Header,
    /// The answer.
    pub verdict: Option<Answer>,
    /// Error by log and channel against the sensor floor.
    pub errors: Errors,
    /// The same for the held-out logs.
    pub holdout_errors: Errors,
    /// Measured and predicted over time.
    pub traces: Vec<Trace>,
    /// Error by regime, as in a comparison: bands of a regime follow each other.
    pub regimes: Vec<RegimeError>,
    /// How the error fell, one for each channel.
    pub ladders: Vec<Ladder>,
    /// What speaks for each effect.
    pub evidence: Vec<Evidence>,
    /// Which effects look alike in these logs.
    pub confounding: Option<Confounding>,
    /// Cumulative periodograms of residuals.
    pub spectra: Vec<SpectrumCurve>,
    /// Parameters with their uncertainty.
    pub parameters: Vec<ParameterRow>,
    /// What the model found is worth by its file.
    pub files: Files,
    /// What the coordinator would decide otherwise.
    pub decisions: Vec<DecisionRow>,
}

/// What the file of the model found leaves, and what it cannot hold.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Files {
    /// By channel, against the file of the model given.
    pub rows: Vec<FileErrors>,
    /// What to do where it is worse; empty where it is not.
    pub warning: String,
    /// What the file alone leaves, where more was learned than it can hold; empty where that is nothing.
    pub without: String,
    /// What it cannot hold, one by one.
    pub left_out: Vec<String>,
}

/// Error by log and channel.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Errors {
    /// As the logs are.
    pub all: Vec<ChannelError>,
    /// What is left of each with sensors and starts calibrated; none where that changes nothing.
    pub calibrated: Option<Vec<Calibrated>>,
}

impl Errors {
    /// Of a comparison.
    #[must_use]
    pub fn of(comparison: &Comparison) -> Errors {
        Errors { all: comparison.errors.clone(), calibrated: comparison.left_by_calibration().map(<[Calibrated]>::to_vec) }
    }
}

/// What was looked at, with what, and when.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Header {
    /// Title of the report.
    pub title: String,
    /// Name of the model.
    pub model: String,
    /// The logs.
    pub logs: Vec<LogLine>,
    /// What was noticed while they were read: gaps, repeated times, readings that are none.
    pub notes: Vec<String>,
    /// Date as the caller gives it; this library reads no clock.
    pub date: Option<String>,
    /// Version of the program.
    pub version: String,
}

/// One log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LogLine {
    /// Its name.
    pub name: String,
    /// Whether it was held out.
    pub holdout: bool,
    /// Rows.
    pub rows: usize,
    /// Length, s.
    pub span_s: f64,
}

/// How an answer is to be taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Tone {
    /// All is well.
    Good,
    /// Something is missing.
    Bad,
    /// Nobody can tell yet.
    Unsure,
}

/// An answer in words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// How it is to be taken.
    pub tone: Tone,
    /// The answer in a sentence.
    pub headline: String,
    /// More sentences.
    pub words: Vec<String>,
    /// The measurement that would settle what is open.
    pub experiment: Option<String>,
}

/// How the error of one channel fell, effect by effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ladder {
    /// Canonical name of the channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Sensor floor.
    pub floor: Option<f64>,
    /// What it is called: where the model states none, it is noise that the logs show.
    pub floor_name: String,
    /// The steps, the bare model first.
    pub steps: Vec<LadderStep>,
}

/// One step of a ladder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LadderStep {
    /// What was added: an effect's id, or words for the first step.
    pub effect: String,
    /// RMS on the training logs.
    pub train_rms: f64,
    /// RMS on the held-out logs.
    pub holdout_rms: Option<f64>,
}

/// What speaks for one effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evidence {
    /// Its id.
    pub effect: String,
    /// Whether it was added.
    pub accepted: bool,
    /// Why it was not, in words.
    pub refused: String,
    /// Fall of the Bayesian information criterion; above 10 is strong.
    pub delta_bic: Option<f64>,
    /// Chance of a score this large without the effect, corrected for the number tried.
    pub p_value: Option<f64>,
    /// Expected size of each of its parameters.
    pub epc: Vec<Epc>,
    /// How much of it survives a refit of what is in the model already, 0..1.
    pub uniqueness: Option<f64>,
    /// Unit of the errors that follow.
    pub unit: String,
    /// RMS on the training logs before.
    pub rms_before: Option<f64>,
    /// RMS on the training logs after.
    pub rms_after: Option<f64>,
    /// RMS on the held-out logs before.
    pub holdout_before: Option<f64>,
    /// RMS on the held-out logs after.
    pub holdout_after: Option<f64>,
}

/// Expected change of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Epc {
    /// Name, with unit.
    pub name: String,
    /// Expected value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: Option<f64>,
}

/// Which effects look alike in these logs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confounding {
    /// Effects, in the order of rows and columns.
    pub effects: Vec<String>,
    /// Correlation of their signatures after a refit, -1..1; NaN where it is not known.
    pub rho: Vec<Vec<f64>>,
    /// Effects of which a refit of the model leaves nothing that could look like another.
    pub absorbed: Vec<String>,
}

/// The cumulative periodogram of one channel of one log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpectrumCurve {
    /// Name of the log.
    pub log: String,
    /// Canonical name of the channel.
    pub channel: String,
    /// Frequency in Hz and share of the power up to it.
    pub points: Vec<(f64, f64)>,
    /// Distance from the straight line that white noise exceeds in one case of twenty.
    pub distance_5_percent: f64,
    /// Chance of the distance found, if white.
    pub p_value: f64,
}

/// One parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterRow {
    /// Its effect.
    pub effect: String,
    /// Its name, with unit.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Value before, where there was one.
    pub before: Option<f64>,
    /// Value.
    pub value: f64,
    /// Its standard deviation; none when the logs do not determine it.
    pub sigma: Option<f64>,
    /// What to know about it; empty when nothing.
    pub remark: String,
}

/// One number that the coordinator plans with.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DecisionRow {
    /// What it is: `run time left`, `energy per service`, `robots per pack`.
    pub what: String,
    /// Its unit.
    pub unit: String,
    /// With the model as it was.
    pub before: f64,
    /// Its standard deviation.
    pub before_sigma: Option<f64>,
    /// With the model as it is now.
    pub after: f64,
    /// Its standard deviation.
    pub after_sigma: Option<f64>,
}
