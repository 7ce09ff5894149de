//! A log as the parts between its gaps: what flowed in a gap nobody knows, so that nothing is counted across it.

use std::collections::BTreeMap;

use energy::Channel;
use energy::units::H_PER_S;

use super::anchor::COUNTED;
use crate::measurement::Log;
use crate::prepare::held;

/// Share of a log's charge up to which a current that was the same before and after a gap is taken to have gone on: a logger that was
/// late. A guess.
const WENT_ON: f64 = 0.05;

/// A part of a log.
pub(super) struct Part {
    pub(super) log: Log,
    /// Whether it begins after a gap: what is stated of the log's beginning is not of it.
    pub(super) is_later: bool,
}

/// The parts of each log between those gaps of its current over which more may have flowed, or less, than charge is counted well; in order. A gap over
/// which `gap_current = "stated"` is none.
pub(super) fn parts(logs: &[Log]) -> Vec<Part> {
    logs.iter().flat_map(of_one).collect()
}

fn of_one(log: &Log) -> Vec<Part> {
    let Some(current_a) = log.channels.get(&Channel::CurrentA).and_then(|values| held(values)) else {
        return vec![part(log, 0, log.rows())];
    };
    let range_ah = range_ah(log, &current_a);
    // The row after a gap knows its own interval, which begins where the gap ends.
    let after = |ends_s: f64| log.time_s.partition_point(|&time_s| time_s <= ends_s);
    // Of each gap what may have flowed otherwise, what is counted for it, Ah, and when it ends.
    let mut gaps: BTreeMap<usize, (f64, f64, f64)> = BTreeMap::new();
    for piece in &log.unmeasured {
        let (unsure_ah, counted_ah, ends_s) = gaps.entry(piece.gap).or_default();
        let hours = (piece.to_s - piece.from_s) * H_PER_S;
        *unsure_ah += piece.current_sigma_a * hours;
        *counted_ah += current_a.get(after(piece.to_s)).copied().unwrap_or_default().abs() * hours;
        *ends_s = piece.to_s;
    }
    let parts = |(unsure_ah, counted_ah, _): &&(f64, f64, f64)| *unsure_ah > COUNTED * range_ah || *counted_ah > WENT_ON * range_ah;
    let begins: Vec<usize> = gaps.values().filter(parts).map(|(_, _, ends_s)| after(*ends_s)).collect();
    let starts = std::iter::once(0).chain(begins.iter().copied());
    let ends = begins.iter().copied().chain([log.rows()]);
    starts.zip(ends).filter(|(from, to)| to - from >= 2).map(|(from, to)| part(log, from, to)).collect()
}

/// What lies between the most and the least that was drawn of a log, Ah, as it is counted across gaps.
fn range_ah(log: &Log, current_a: &[f64]) -> f64 {
    let (mut drawn_ah, mut low, mut high) = (0.0, 0.0_f64, 0.0_f64);
    for (step, current_a) in log.time_s.windows(2).zip(&current_a[1..]) {
        drawn_ah += current_a * (step[1] - step[0]) * H_PER_S;
        (low, high) = (low.min(drawn_ah), high.max(drawn_ah));
    }
    high - low
}

fn part(log: &Log, from: usize, to: usize) -> Part {
    let is_later = from > 0;
    let mut part = Log {
        time_s: log.time_s[from..to].to_vec(),
        readings: log.readings.get(from..to).unwrap_or_default().to_vec(),
        compared: log.compared.get(from..to).unwrap_or_default().to_vec(),
        channels: log.channels.iter().map(|(&channel, values)| (channel, values[from..to].to_vec())).collect(),
        ..log.clone()
    };
    if is_later {
        let facts = &mut part.facts;
        (facts.soc_initial, facts.soc_initial_sigma, facts.rest_voltage_v, facts.history, facts.settling_s) =
            (None, None, None, None, None);
        part.name = format!("{} from {:.0} s", log.name, log.time_s[from]);
        part.file = format!("{} from {:.0} s", log.file, log.time_s[from]);
    }
    Part { log: part, is_later }
}
