//! The resistance that steps of a current show at once.

use std::ops::Range;

use energy::Estimate;

use super::counted::Counted;
use super::passage::Known;
use crate::residual::MEDIAN;

/// A step that counts, as a share of the capacity an hour.
const STEP_PER_HOUR: f64 = 0.05;
/// And the voltage must step by so many times its noise.
const NOISES: f64 = 8.0;
/// Where single readings do not show it by that, means of so many may: their noise is less.
const TOGETHER: [usize; 4] = [1, 2, 4, 8];
/// What a slow current costs in all its time, in resistances of its first seconds, and how well that is known: diffusion and
/// charge transfer come to about as much again. A guess.
pub(super) const OF_STEP: (f64, f64) = (2.0, 0.7);
/// The same where no step was seen, V per cell at the capacity an hour. A guess: lithium cells lose some 50 to 200 mV at that.
pub(super) const UNSEEN_V: (f64, f64) = (0.1, 0.07);
/// Below this state of charge the resistance rises towards the end (Kottas, section 3.2).
const RISES: f64 = 0.1;
/// Readings farther from a step than this show more than a resistance, s.
const APART_S: f64 = 10.5;
/// Among those that are near enough, the nearest, and what is at most so many times as far apart.
const NEAREST: f64 = 1.5;
/// A current after the step is the same within this share of the step.
const SAME: f64 = 0.1;
/// What one step may differ from the others by its state of charge, temperature and direction, as a share. A guess.
const DIFFERS: f64 = 0.05;

/// Resistance of the pack per cell in series, ohm, and how many steps show it: the middle one.
pub(super) fn resistance(logs: &[Counted<'_>], known: &Known, noise_v: f64) -> Option<(Estimate, usize)> {
    let mut steps: Vec<Step> = Vec::new();
    for (log, soc) in logs.iter().zip(&known.soc) {
        let least_a = STEP_PER_HOUR * known.capacity_ah.value;
        let rows = (1..soc.len()).filter(|&row| soc[row] >= RISES && (log.level_a[row] - log.level_a[row - 1]).abs() >= least_a);
        steps.extend(rows.filter_map(|row| TOGETHER.iter().find_map(|&readings| step(log, row, readings, noise_v))));
    }
    let nearest_s = steps.iter().map(|step| step.apart_s).fold(f64::INFINITY, f64::min);
    steps.retain(|step| step.apart_s <= NEAREST * nearest_s);
    let noise_ohm = steps.iter().map(|step| step.noise_ohm).fold(0.0, f64::max);
    let middle_of = |of: &dyn Fn(&Step) -> f64| {
        let mut sorted: Vec<f64> = steps.iter().map(of).collect();
        sorted.sort_by(f64::total_cmp);
        median(&sorted)
    };
    let middle = middle_of(&|step| step.ohm)?;
    let spread = middle_of(&|step| (step.ohm - middle).abs())? / MEDIAN;
    // What slid within the step slid faster at its beginning: by about as much again.
    let slid = middle_of(&|step| step.slid_ohm)?;
    // A single step is as uncertain as its readings; many say by themselves how uncertain they are.
    let sigma = (spread.max(noise_ohm) / (steps.len() as f64).sqrt()).hypot(DIFFERS * middle).hypot(slid);
    (middle > 0.0).then(|| (Estimate::new(middle, sigma), steps.len()))
}

/// The same where no step shows it, of a battery of this capacity: what a slow current costs is some of these.
pub(super) fn unseen_ohm(capacity_ah: f64) -> Estimate {
    let ohm = UNSEEN_V.0 / OF_STEP.0 / capacity_ah;
    // Neither is known well.
    Estimate::new(ohm, ohm * (UNSEEN_V.1 / UNSEEN_V.0).hypot(OF_STEP.1 / OF_STEP.0))
}

/// A step of the current.
struct Step {
    /// Time between its readings, s.
    apart_s: f64,
    /// Resistance that it shows, per cell in series, ohm.
    ohm: f64,
    /// What of that is noise.
    noise_ohm: f64,
    /// What was taken off for what goes on slowly.
    slid_ohm: f64,
}

/// The step of the current that a row begins, by means of so many readings before and after it; nothing where they do not show it, or the
/// current moves between them.
fn step(log: &Counted<'_>, row: usize, readings: usize, noise_v: f64) -> Option<Step> {
    let (time_s, level_a) = (log.time_s(), &log.level_a);
    let step_a = level_a[row] - level_a[row - 1];
    let (from, until) = (row.checked_sub(readings)?, row + readings);
    let near = until <= level_a.len() && time_s[until - 1] - time_s[row - 1] <= APART_S && time_s[row - 1] - time_s[from] <= APART_S;
    let same = |rows: Range<usize>, as_a: f64| level_a[rows].iter().all(|level_a| (level_a - as_a).abs() <= SAME * step_a.abs());
    if !near || !same(from..row, level_a[row - 1]) || !same(row..until, level_a[row]) {
        return None;
    }
    let mean = |of: &[f64], rows: Range<usize>| of[rows].iter().sum::<f64>() / readings as f64;
    let at = |rows: Range<usize>| (mean(time_s, rows.clone()), mean(&log.cell_v, rows));
    let ((before_s, before_v), (after_s, after_v)) = (at(from..row), at(row..until));
    // What the voltage does further away under the same current it has done up to the step, too.
    let slid = |near: (f64, f64), far: Option<Range<usize>>, as_a: f64| {
        let (far_s, far_v) = at(far.filter(|far| far.end <= level_a.len() && same(far.clone(), as_a))?);
        let share = (near.0 - time_s[row - 1]) / (far_s - near.0);
        Some((share * (far_v - near.1), share)).filter(|(slid_v, _)| slid_v.is_finite())
    };
    let (slid_v, share) = slid((after_s, after_v), Some(until..until + readings), level_a[row]).unwrap_or((0.0, 0.0));
    let (came_v, came) =
        slid((before_s, before_v), from.checked_sub(readings).map(|far| far..from), level_a[row - 1]).unwrap_or((0.0, 0.0));
    let (step_v, noise_v) = (after_v - before_v, noise_v / (readings as f64).sqrt());
    if step_v.is_nan() || step_v.abs() < NOISES * noise_v {
        return None;
    }
    let errs = (1.0 + share).hypot(share).hypot(1.0 + came).hypot(came);
    Some(Step {
        apart_s: after_s - before_s,
        ohm: -(step_v - slid_v + came_v) / step_a,
        noise_ohm: errs * noise_v / step_a.abs(),
        slid_ohm: (slid_v / step_a).abs(),
    })
}

/// The middle of sorted numbers.
fn median(sorted: &[f64]) -> Option<f64> {
    let middle = sorted.len() / 2;
    let upper = *sorted.get(middle)?;
    Some(if sorted.len() % 2 == 1 { upper } else { f64::midpoint(sorted[middle - 1], upper) })
}
