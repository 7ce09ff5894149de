//! How well the truth itself would predict the held-out logs, told only what the lab is told.
//!
//! A start known to 1 % and a table that is 3 mV wrong cost more than a sensor's noise: the true
//! effects with their true numbers do not reach the floor either, unless start and table are
//! learned as well. The error of the lab is published over the floor and over this.

use energy::{Channel, Run, Start};

use crate::case::CaseLog;
use crate::draft::Draft;

/// RMS over the sensor floor on the main channel of all logs.
#[must_use]
pub fn over_floor(truth: &Draft, logs: &[CaseLog]) -> f64 {
    let model = truth.model();
    let target = model.system.targets()[0];
    let predicted = |channel: &Channel| {
        model.system.computed().contains(channel) || (*channel == Channel::TemperatureDegc && model.predicts_temperature())
    };
    let (mut sum, mut rows) = (0.0, 0.0);
    for log in logs {
        let mut run = Run::new(model.clone(), start(log));
        let column = |wanted: Channel| log.columns.iter().find(|(channel, _)| *channel == wanted).map(|(_, values)| values);
        let Some(observed) = column(target) else { continue };
        for row in 1..log.time_s.len() {
            for (channel, values) in log.columns.iter().filter(|(channel, _)| !predicted(channel)) {
                run.channels[*channel] = values[row];
            }
            run.step(log.time_s[row] - log.time_s[row - 1]);
            sum += (observed[row] - run.channels[target]).powi(2);
            rows += 1.0;
        }
    }
    (sum / rows).sqrt() / model.sensor(target).floor()
}

/// Where a log begins, as its facts and its first row tell.
fn start(log: &CaseLog) -> Start {
    let first =
        |wanted: Channel| log.columns.iter().find(|(channel, _)| *channel == wanted).and_then(|(_, values)| values.first().copied());
    let mut start = Start::at_soc(log.facts.soc_initial.unwrap_or(1.0));
    start.temperature_degc = first(Channel::TemperatureDegc).unwrap_or(start.temperature_degc);
    start.cycle_count = first(Channel::CycleCount).unwrap_or(0.0);
    start.age_days = first(Channel::AgeDays).unwrap_or(0.0);
    start.history = match log.facts.history {
        Some(lab::measurement::History::Discharged) => 1.0,
        Some(lab::measurement::History::Charged) => -1.0,
        None => 0.0,
    };
    start
}
