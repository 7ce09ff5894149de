//! A log that begins while a load is on.
//!
//! A model begins rested: no part of its voltage lags behind. Of a log that is a part of a longer one that is wrong until the battery has
//! forgotten what it did before, and looks like an effect.

use energy::{Channel, Model, System};

use super::edges::answers_at_once;
use super::log::Log;
use super::thin::{jump, thousands};
use super::times::short;

/// Where a load is switched on at the first row, the voltage falls within a step by so many times more than within the next.
const FALLS: f64 = 3.0;

/// Takes out what was measured before a battery has settled, as long as the log says that it takes; notes that, or that it may have to.
pub fn leave_out_settling(log: &mut Log, model: &Model) {
    let Some(&first_s) = log.time_s.first() else { return };
    let Some(settling_s) = log.facts.settling_s else {
        log.notes.extend(begins_loaded(log, model));
        return;
    };
    let rows = log.time_s.partition_point(|&time_s| time_s < first_s + settling_s);
    if rows == 0 {
        return;
    }
    // What is written of its temperature says how warm it begins.
    let answers = |channel: &Channel| model.system.targets().contains(channel) && answers_at_once(*channel);
    for (_, measured) in log.channels.iter_mut().filter(|(channel, _)| answers(channel)) {
        measured[..rows].fill(f64::NAN);
    }
    let settled = format!("{}: the first {} of {} rows are not compared", log.file, thousands(rows), thousands(log.rows()));
    log.notes.push(format!("{settled}: over {} s what was before the log is forgotten (settling_s)", short(settling_s)));
}

/// What is to be said of a battery that is under load from the first row on, and whose voltage does not show that it was not before.
fn begins_loaded(log: &Log, model: &Model) -> Option<String> {
    if model.system != System::Battery {
        return None;
    }
    let (current_a, voltage_v) = (log.channels.get(&Channel::CurrentA)?, log.channels.get(&Channel::VoltageV)?);
    let &[first_a, next_a, ..] = current_a.as_slice() else { return None };
    let &[first_v, next_v, later_v, ..] = voltage_v.as_slice() else { return None };
    let loaded = |a: f64| a.abs() > jump(&[current_a.as_slice(), &[0.0]].concat(), model, Channel::CurrentA);
    let noise_v = model.sensor(Channel::VoltageV).floor();
    let begun_before = (next_v - first_v).abs() <= FALLS * ((later_v - next_v).abs() + noise_v);
    (loaded(first_a) && loaded(next_a) && begun_before).then(|| {
        format!(
            "{}: begins at {} A, and is taken for rested before. Where it is a part of a longer log, settling_s = SECONDS beside it, or --settling-s, leaves \
             out the first SECONDS, in which the voltage still shows the load before: a few of the slowest time constants are enough",
            log.file,
            short(first_a)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_model;
    use crate::measurement::{LogFacts, read_log};

    /// A cell of 30 mohm and a pair of 20 mohm and 30 s, under 2 A since so many seconds before the log.
    fn log(since_s: f64, settling_s: Option<f64>) -> Log {
        let mut text = "time_s,current_a,voltage_v,temperature_degc\n".to_owned();
        for row in 0..100 {
            let loaded_s = since_s + f64::from(row);
            let drop_v = if loaded_s > 0.0 { 2.0 * (0.03 + 0.02 * (1.0 - (-loaded_s / 30.0).exp())) } else { 0.0 };
            text += &format!("{row},2,{},30\n", 3.9 - drop_v);
        }
        let mut log = read_log("log.csv", text.as_bytes(), LogFacts { settling_s, ..LogFacts::default() }).unwrap();
        leave_out_settling(&mut log, &load_model("enertech-lco-2280mah").unwrap().model);
        log
    }

    #[test]
    fn a_part_of_a_longer_log_is_told_and_a_load_that_begins_with_the_log_is_not() {
        let told =
            |since_s: f64| log(since_s, None).notes.iter().any(|note| note.contains("begins at 2 A, and is taken for rested before"));
        assert!(told(20.0) && told(1e4) && !told(0.0));
    }

    #[test]
    fn what_settles_is_not_compared() {
        let log = log(20.0, Some(60.0));
        let volts = &log.channels[&Channel::VoltageV];
        assert!(volts[..60].iter().all(|v| v.is_nan()) && volts[60..].iter().all(|v| v.is_finite()));
        assert!(log.channels[&Channel::TemperatureDegc].iter().all(|degc| degc.is_finite()), "it begins as warm as it was");
        assert!(log.notes.last().unwrap().contains("the first 60 of 100 rows are not compared"), "{:?}", log.notes);
    }
}
