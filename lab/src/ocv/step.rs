//! The resistance that steps of a current show at once.

use std::f64::consts::SQRT_2;

use energy::Estimate;

use super::counted::Counted;
use super::passage::Known;
use crate::residual::MEDIAN;

/// A step that counts, as a share of the capacity an hour.
const STEP_PER_HOUR: f64 = 0.05;
/// And the voltage must step by so many times its noise.
const NOISES: f64 = 8.0;
/// Below this state of charge the resistance rises towards the end (Kottas, section 3.2).
const RISES: f64 = 0.1;
/// Readings farther apart than this show more than a resistance, s.
const APART_S: f64 = 10.5;
/// Among those that are near enough, the nearest, and what is at most so many times as far apart.
const NEAREST: f64 = 1.5;
/// A current after the step is the same within this share of the step.
const SAME: f64 = 0.1;
/// What one step may differ from the others by its state of charge, temperature and direction, as a share. A guess.
const DIFFERS: f64 = 0.05;

/// Resistance of the pack per cell in series, ohm, and how many steps show it: the middle one.
pub(super) fn resistance(logs: &[Counted<'_>], known: &Known, noise_v: f64) -> Option<(Estimate, usize)> {
    let (mut steps, mut least_a): (Vec<Step>, f64) = (Vec::new(), f64::INFINITY);
    for (log, soc) in logs.iter().zip(&known.soc) {
        let (time_s, volts, amps) = (log.time_s(), &log.cell_v, &log.current_a);
        for row in 1..volts.len() {
            let (apart_s, step_a) = (time_s[row] - time_s[row - 1], amps[row] - amps[row - 1]);
            let step_v = volts[row] - volts[row - 1];
            let counts = soc[row] >= RISES && apart_s <= APART_S && step_a.abs() >= STEP_PER_HOUR * known.capacity_ah.value;
            if !counts || step_v.is_nan() || step_v.abs() < NOISES * noise_v {
                continue;
            }
            // What the voltage does next under the same current it has done within the step, too.
            let goes_on = amps.get(row + 1).is_some_and(|next_a| (next_a - amps[row]).abs() <= SAME * step_a.abs());
            let slope = if goes_on { (volts[row + 1] - volts[row]) / (time_s[row + 1] - time_s[row]) } else { f64::NAN };
            let slid_v = if slope.is_finite() { slope * apart_s } else { 0.0 };
            steps.push(Step { apart_s, ohm: -(step_v - slid_v) / step_a, slid_ohm: (slid_v / step_a).abs() });
            least_a = least_a.min(step_a.abs());
        }
    }
    let noise_ohm = SQRT_2 * noise_v / least_a;
    let nearest_s = steps.iter().map(|step| step.apart_s).fold(f64::INFINITY, f64::min);
    steps.retain(|step| step.apart_s <= NEAREST * nearest_s);
    let middle_of = |of: &dyn Fn(&Step) -> f64| {
        let mut sorted: Vec<f64> = steps.iter().map(of).collect();
        sorted.sort_by(f64::total_cmp);
        median(&sorted)
    };
    let middle = middle_of(&|step| step.ohm)?;
    // A median of sizes is so many deviations of a Gauss curve.
    let spread = middle_of(&|step| (step.ohm - middle).abs())? / MEDIAN;
    // What slid within the step slid faster at its beginning: by about as much again.
    let slid = middle_of(&|step| step.slid_ohm)?;
    // A single step is as uncertain as both of its readings; many say by themselves how uncertain they are.
    let sigma = (spread.max(noise_ohm) / (steps.len() as f64).sqrt()).hypot(DIFFERS * middle).hypot(slid);
    (middle > 0.0).then(|| (Estimate::new(middle, sigma), steps.len()))
}

/// A step of the current.
struct Step {
    /// Time between its readings, s.
    apart_s: f64,
    /// Resistance that it shows, per cell in series, ohm.
    ohm: f64,
    /// What was taken off for what goes on slowly.
    slid_ohm: f64,
}

/// The middle of sorted numbers.
fn median(sorted: &[f64]) -> Option<f64> {
    let middle = sorted.len() / 2;
    let upper = *sorted.get(middle)?;
    Some(if sorted.len() % 2 == 1 { upper } else { f64::midpoint(sorted[middle - 1], upper) })
}
