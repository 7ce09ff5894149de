//! How much of an error is that of sensors and of starts: what is left once they are calibrated within what is stated of them.

use energy::Model;
use serde::Serialize;

use super::{ChannelError, Comparison, Verdict, WITHIN};
use crate::infer::calibrate::{calibrated, corrected, rms_by_log};
use crate::learned::{LeftOut, left_out};
use crate::prepare::Prepared;
use crate::report::discovery::learned_lines;
use crate::report::quantity::quantity;

/// What calibration of sensors and starts leaves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Error by log and channel, in the order of [`Comparison::errors`].
    pub errors: Vec<Calibrated>,
    /// What they are off by, if that is what the model leaves.
    pub found: Vec<LeftOut>,
}

/// What is left of one channel in one log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibrated {
    /// Name of the log.
    pub log: String,
    /// Canonical name of the channel.
    pub channel: &'static str,
    /// Unit of `rms`.
    pub unit: &'static str,
    /// RMS that is left.
    pub rms: f64,
    /// The same over the floor; null without one.
    pub ratio: Option<f64>,
}

/// Share of an error that calibration must take away to be told.
const WORTH_TELLING: f64 = 0.1;

impl Comparison {
    /// The same of logs that were calibrated: what they were off by stands beside it.
    #[must_use]
    pub fn calibrated(mut self, found: Vec<LeftOut>) -> Comparison {
        let of = |error: &ChannelError| Calibrated {
            log: error.log.clone(),
            channel: error.channel,
            unit: error.unit,
            rms: error.size.rms,
            ratio: error.ratio,
        };
        self.words.push(match found.is_empty() {
            true => "Sensors and starts are as they are stated.".to_owned(),
            false => "That is with sensors and starts calibrated within what is stated of them:".to_owned(),
        });
        self.words.extend(lines(&found));
        self.calibration = Some(Calibration { errors: self.errors.iter().map(of).collect(), found });
        self
    }

    /// The same with what is left once sensors and starts are calibrated, where the model leaves something and that takes some of it away.
    #[must_use]
    pub fn with_calibration(mut self, model: &Model, values: &[f64], logs: &[Prepared]) -> Comparison {
        if self.verdict != Verdict::LeavesError {
            return self;
        }
        let Some(state) = calibrated(model, values, logs) else { return self };
        let left = rms_by_log(&state);
        // Errors lie log by log and target by target; names of logs need not be unlike.
        let places = logs.iter().enumerate().flat_map(|(log, prepared)| prepared.targets.iter().map(move |target| (log, target.channel)));
        let of = |(error, place): (&ChannelError, (usize, energy::Channel))| {
            let rms = left.iter().find(|(log, channel, _)| (*log, *channel) == place).map_or(error.size.rms, |(_, _, rms)| *rms);
            Calibrated {
                log: error.log.clone(),
                channel: error.channel,
                unit: error.unit,
                rms,
                ratio: error.floor.map(|floor| rms / floor),
            }
        };
        let errors: Vec<Calibrated> = self.errors.iter().zip(places).map(of).collect();
        let helps = self.errors.iter().zip(&errors).any(|(error, left)| left.rms < (1.0 - WORTH_TELLING) * error.size.rms);
        if helps {
            let calibration = Calibration { errors, found: left_out(&state) };
            self.words.extend(calibration.words());
            self.words.extend(lines(&calibration.found));
            self.calibration = Some(calibration);
        }
        self
    }
}

impl Comparison {
    /// What calibration leaves of each of the errors, in their order; none where it leaves all of them as they are.
    #[must_use]
    pub fn left_by_calibration(&self) -> Option<&[Calibrated]> {
        let left = &self.calibration.as_ref()?.errors;
        let differs = left.iter().zip(&self.errors).any(|(left, error)| left.rms != error.size.rms);
        differs.then_some(left)
    }
}

fn lines(found: &[LeftOut]) -> Vec<String> {
    learned_lines(found).lines().map(str::to_owned).collect()
}

/// The logs with sensors and starts calibrated, and what they are off by; as they are where nothing is known only roughly.
#[must_use]
pub fn calibrate(model: &Model, values: &[f64], logs: Vec<Prepared>) -> (Vec<Prepared>, Vec<LeftOut>) {
    match calibrated(model, values, &logs) {
        Some(state) => (corrected(&state, &logs), left_out(&state)),
        None => (logs, Vec::new()),
    }
}

impl Calibration {
    fn words(&self) -> Option<String> {
        let worst = self.errors.iter().max_by(|a, b| a.ratio.unwrap_or(0.0).total_cmp(&b.ratio.unwrap_or(0.0)))?;
        let (rms, ratio) = (quantity(worst.rms, worst.unit), worst.ratio?);
        let left = format!("{rms} RMS of {} in {} is left, {ratio:.1} x the sensor floor", worst.channel, worst.log);
        Some(match ratio <= WITHIN {
            true => {
                format!("With sensors and starts calibrated within what is stated of them, the model explains the logs: at most {left}.")
            }
            false => format!("With sensors and starts calibrated within what is stated of them, {left} (--calibrate shows where)."),
        })
    }
}
