//! What rows show of the open-circuit voltage: the end of a rest, and a slow current but for what it costs.

use std::ops::Range;

use energy::relaxation::extrapolate;

use super::Sheet;
use super::counted::Counted;
use super::passage::Known;
use crate::measurement::History;

/// A rest that counts, s: five minutes let its end be told to one per cent (Kottas, section 3.2).
pub(super) const REST_S: f64 = 300.0;
/// The beginning of a rest that is left out, as a share of it: faster processes than the last have ended by then.
const SETTLING: f64 = 1.0 / 3.0;
/// Readings of a rest that are looked at.
const READINGS: usize = 200;
/// A current is steady within this share of where its run begins.
const STEADY: f64 = 0.1;
/// The beginning of a steady current that is left out, as a share of the capacity, and for as long as a rest takes: the voltage is
/// still on its way.
const ON_ITS_WAY: f64 = 0.01;
/// What a current costs differs by this much, V per cell and share of the capacity an hour, from what a straight line over the state of
/// charge says of it: a tenth of what lithium cells lose. A guess.
const CROOKED_V: f64 = 0.01;
/// Wherever slow rows are taken together, they show a voltage to this at best, V: a table's straight lines are no better.
const LEAST_V: f64 = 5e-4;
/// States of charge at which slow rows are taken together: each to the next.
const PLACES: [(f64, f64); 4] = [(0.01, 0.0025), (0.1, 0.01), (0.9, 0.02), (2.0, 0.01)];

/// How something was shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// By the end of a rest.
    Rest,
    /// By a slow current.
    Slow,
}

/// A voltage at a state of charge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shown {
    pub(super) log: usize,
    pub(super) kind: Kind,
    pub(super) soc: f64,
    /// Voltage of one cell, V, and how well that row or rest tells it.
    pub(super) cell_v: f64,
    pub(super) sigma_v: f64,
    /// Current of the pack, A: 0 at rest.
    pub(super) current_a: f64,
    /// Whether the last charge before it went out; none where nothing says so.
    pub(super) discharged: Option<bool>,
}

/// All that logs show.
pub(super) struct AllShown {
    pub(super) all: Vec<Shown>,
    /// The slowest steady current, as a share of the capacity an hour.
    pub(super) slowest: Option<f64>,
}

pub(super) fn shown(logs: &[Counted<'_>], known: &Known, sheet: &Sheet, noise_v: f64) -> AllShown {
    let capacity_ah = known.capacity_ah.value;
    let mut all = Vec::new();
    let mut slowest: Option<f64> = None;
    for (index, (log, soc)) in logs.iter().zip(&known.soc).enumerate() {
        for run in log.runs(|level_a| level_a.abs() <= log.none_a) {
            all.extend(rest(log, soc, &run, noise_v).map(|shown| Shown { log: index, ..shown }));
        }
        for run in steady(log) {
            let per_hour = log.level_a[run.start].abs() / capacity_ah;
            slowest = Some(slowest.map_or(per_hour, |least| least.min(per_hour)));
            if per_hour <= sheet.slow_per_hour {
                all.extend(slow(log, soc, &run, noise_v, per_hour).into_iter().map(|shown| Shown { log: index, ..shown }));
            }
        }
    }
    AllShown { all, slowest }
}

/// Where a rest would end.
fn rest(log: &Counted<'_>, soc: &[f64], run: &Range<usize>, noise_v: f64) -> Option<Shown> {
    let (before, last) = (run.start - 1, run.end - 1);
    let began_s = log.time_s()[before];
    let length_s = log.time_s()[last] - began_s;
    if length_s < REST_S {
        return None;
    }
    let settled = (before..=last).filter(|&row| log.time_s()[row] - began_s >= SETTLING * length_s && log.cell_v[row].is_finite());
    let settled: Vec<(f64, f64)> = settled.map(|row| (log.time_s()[row] - began_s, log.cell_v[row])).collect();
    let (&(_, first_v), &(_, last_v)) = (settled.first()?, settled.last()?);
    let moved_v = (last_v - first_v).abs();
    let every = settled.len().div_ceil(READINGS);
    let some: Vec<(f64, f64)> = settled.iter().rev().step_by(every).rev().copied().collect();
    // What has not moved further in two thirds of the rest is not taken to move further after it.
    let end = extrapolate(&some, noise_v).ok().filter(|end| end.emf_v.sigma.is_finite() && (end.emf_v.value - last_v).abs() <= moved_v);
    let (cell_v, sigma_v) = end.map_or((last_v, moved_v.max(noise_v)), |end| (end.emf_v.value, end.emf_v.sigma));
    let came = (1..run.start).rev().find(|&row| !log.rests(row));
    let told = || log.log.facts.history.map(|history| history == History::Discharged);
    let discharged = came.map(|row| log.level_a[row] > 0.0).or_else(told);
    Some(Shown { log: 0, kind: Kind::Rest, soc: soc[last], cell_v, sigma_v: sigma_v.hypot(LEAST_V), current_a: 0.0, discharged })
}

/// Runs of a current that stays as it begins.
fn steady(log: &Counted<'_>) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    for whole in log.runs(|level_a| level_a.abs() > log.none_a) {
        let mut from = whole.start;
        for row in whole.clone() {
            let begins_a = log.level_a[from];
            if (log.level_a[row] - begins_a).abs() > STEADY * begins_a.abs() {
                runs.push(from..row);
                from = row;
            }
        }
        runs.push(from..whole.end);
    }
    let moves = |run: &Range<usize>| (log.drawn_ah[run.end - 1] - log.drawn_ah[run.start - 1]).abs();
    let all_ah = log.range_ah();
    runs.retain(|run| moves(run) > ON_ITS_WAY * all_ah);
    runs
}

/// What a slow current shows, place by place.
fn slow(log: &Counted<'_>, soc: &[f64], run: &Range<usize>, noise_v: f64, per_hour: f64) -> Vec<Shown> {
    let begins = soc[run.start - 1];
    let began_s = log.time_s()[run.start - 1];
    let settled = |row: usize| (soc[row] - begins).abs() >= ON_ITS_WAY && log.time_s()[row] - began_s >= REST_S;
    let rows = run.clone().filter(|&row| settled(row) && log.cell_v[row].is_finite());
    let mut places: Vec<(i64, Vec<usize>)> = Vec::new();
    for row in rows {
        let place = place(soc[row]);
        match places.last_mut() {
            Some((last, rows)) if *last == place => rows.push(row),
            _ => places.push((place, vec![row])),
        }
    }
    let together = |(_, rows): (i64, Vec<usize>)| {
        let mean = |of: &[f64]| rows.iter().map(|&row| of[row]).sum::<f64>() / rows.len() as f64;
        let current_a = mean(&log.current_a);
        let sigma_v = LEAST_V.hypot(CROOKED_V * per_hour).hypot(noise_v / (rows.len() as f64).sqrt());
        Shown { log: 0, kind: Kind::Slow, soc: mean(soc), cell_v: mean(&log.cell_v), sigma_v, current_a, discharged: Some(current_a > 0.0) }
    };
    places.into_iter().map(together).collect()
}

/// The number of the place that holds a state of charge.
pub(super) fn place(soc: f64) -> i64 {
    let (mut low, mut number) = (0.0, 0);
    for (high, width) in PLACES {
        if soc < high {
            return number + ((soc - low) / width).floor() as i64;
        }
        number += ((high - low) / width).round() as i64;
        low = high;
    }
    number
}
