//! The resistance that steps of a current show at once.

use std::f64::consts::SQRT_2;

use energy::Estimate;

use super::counted::Counted;
use super::passage::Known;

/// A step that counts, as a share of the capacity an hour.
const STEP_PER_HOUR: f64 = 0.05;
/// And the voltage must step by so many times its noise.
const NOISES: f64 = 8.0;
/// Below this state of charge the resistance rises towards the end (Kottas, section 3.2).
const RISES: f64 = 0.1;
/// Readings farther apart than this show more than a resistance, s.
const APART_S: f64 = 10.0;
/// Among those that are near enough, the nearest, and what is at most so many times as far apart.
const NEAREST: f64 = 1.5;
/// What one step may differ from the others by its state of charge, temperature and direction, as a share. A guess.
const DIFFERS: f64 = 0.05;

/// Resistance of the pack per cell in series, ohm, and how many steps show it: the middle one.
pub(super) fn resistance(logs: &[Counted<'_>], known: &Known, noise_v: f64) -> Option<(Estimate, usize)> {
    let (mut steps, mut least_a): (Vec<(f64, f64)>, f64) = (Vec::new(), f64::INFINITY);
    for (log, soc) in logs.iter().zip(&known.soc) {
        let (time_s, volts, amps) = (log.time_s(), &log.cell_v, &log.current_a);
        for row in 1..volts.len() {
            let (apart_s, step_a) = (time_s[row] - time_s[row - 1], amps[row] - amps[row - 1]);
            let step_v = volts[row] - volts[row - 1];
            let ohm = -step_v / step_a;
            if soc[row] >= RISES
                && apart_s <= APART_S
                && step_a.abs() >= STEP_PER_HOUR * known.capacity_ah.value
                && step_v.abs() >= NOISES * noise_v
            {
                steps.push((apart_s, ohm));
                least_a = least_a.min(step_a.abs());
            }
        }
    }
    let noise_ohm = SQRT_2 * noise_v / least_a;
    let nearest_s = steps.iter().map(|(apart_s, _)| *apart_s).fold(f64::INFINITY, f64::min);
    let mut ohms: Vec<f64> = steps.into_iter().filter(|(apart_s, _)| *apart_s <= NEAREST * nearest_s).map(|(_, ohm)| ohm).collect();
    ohms.sort_by(f64::total_cmp);
    let middle = median(&ohms)?;
    let mut off: Vec<f64> = ohms.iter().map(|ohm| (ohm - middle).abs()).collect();
    off.sort_by(f64::total_cmp);
    // A median of sizes is so many deviations of a Gauss curve.
    let spread = median(&off)? / 0.6745;
    // A single step is as uncertain as both of its readings; many say by themselves how uncertain they are.
    let sigma = (spread.max(noise_ohm) / (ohms.len() as f64).sqrt()).hypot(DIFFERS * middle);
    (middle > 0.0).then(|| (Estimate::new(middle, sigma), ohms.len()))
}

/// The middle of sorted numbers.
fn median(sorted: &[f64]) -> Option<f64> {
    let middle = sorted.len() / 2;
    let upper = *sorted.get(middle)?;
    Some(if sorted.len() % 2 == 1 { upper } else { f64::midpoint(sorted[middle - 1], upper) })
}
