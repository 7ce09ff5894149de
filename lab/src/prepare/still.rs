//! Inputs that stand still at nothing but for their sensor's noise.
//!
//! Charge, heat and drops add up over noise, but not what goes by the size or the sign of an input: the hysteresis of a cell at rest, the friction of a robot
//! that stands. Noise of deviation s around nothing is a steady input of 0.8 s to these, and the noisier the sensor the more they
//! are told to be. So where readings look like noise around a steady value near nothing, that value is what they are taken for.

use energy::Sensor;

/// Rows of which one value is made: as many as look like noise. What is slower than that stays.
const ROWS: [usize; 3] = [960, 240, 60];
/// Rows below which noise is not told from what happens.
const ROWS_MIN: usize = 20;
/// So many deviations from nothing readings are that may be noise around it.
const NEAR_SIGMAS: f64 = 5.0;
/// Noise has at least this part of the deviation that is stated: what moves by less is seen better than that says.
const LEAST: f64 = 0.5;
/// So many deviations of a statistic from what it is of white noise.
const SIGMAS: f64 = 3.0;

/// Takes readings of a sensor (their means, of so many each where `readings` says so) that are noise around a steady value near nothing
/// for that value.
pub(super) fn steadied(sensor: Sensor, readings: &[f64], values: &mut [f64]) {
    let sigma = sensor.floor();
    if sigma == 0.0 {
        return;
    }
    let sigma_of = |row: usize| sigma / readings.get(row).copied().unwrap_or(1.0).sqrt();
    let mut from = 0;
    while from < values.len() {
        let near = (from..values.len().min(from + ROWS[0] + ROWS_MIN))
            .take_while(|row| values[*row].abs() <= NEAR_SIGMAS * sigma_of(*row))
            .count();
        // What is too little for itself goes with the piece before.
        let pieces = ROWS.map(|most| if near < most + ROWS_MIN { near } else { most });
        let noise = |rows: &usize| is_noise(&values[from..from + rows], (from..from + rows).map(sigma_of));
        let Some(rows) = pieces.into_iter().find(|rows| *rows >= ROWS_MIN && noise(rows)) else {
            from += near.clamp(1, ROWS_MIN);
            continue;
        };
        let mean = values[from..from + rows].iter().sum::<f64>() / rows as f64;
        values[from..from + rows].fill(mean);
        from += rows;
    }
}

/// Whether values are as far from their mean, and from each other, as noise of these deviations: by its variance, and by von Neumann's ratio
/// (Annals of Mathematical Statistics 12, 1941, p. 367), which is 2 for values that do not follow each other.
fn is_noise(values: &[f64], sigmas: impl Iterator<Item = f64>) -> bool {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let expected: f64 = sigmas.map(|sigma| sigma * sigma).sum();
    let steps: f64 = values.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    let variance = LEAST.powi(2)..1.0 + SIGMAS * (2.0 / count).sqrt();
    variance.contains(&(squares / expected)) && (steps / squares - 2.0).abs() < SIGMAS * 2.0 / count.sqrt()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};

    use super::*;

    const SENSOR: Sensor = Sensor { sigma: 0.05, ..Sensor::PERFECT };

    fn noisy(truth: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        (0..1200).map(|row| truth(row) + SENSOR.sigma * rng.sample::<f64, _>(rand_distr::StandardNormal)).collect()
    }

    fn off(values: &[f64], truth: impl Fn(usize) -> f64) -> f64 {
        (values.iter().enumerate().map(|(row, value)| (value - truth(row)).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    }

    #[test]
    fn what_stands_still_is_steady_with_the_charge_that_it_had() {
        // A drain of 8 mA behind an ammeter of 50 mA: means of hundreds are within 50 / sqrt(240) mA.
        let read = noisy(|_| 0.008);
        let mut values = read.clone();
        steadied(SENSOR, &[], &mut values);
        assert!(off(&values, |_| 0.008) < 0.004 && off(&read, |_| 0.008) > 0.045, "{}", off(&values, |_| 0.008));
        assert!((values.iter().sum::<f64>() - read.iter().sum::<f64>()).abs() < 1e-9);
        let size = |values: &[f64]| values.iter().map(|value| value.abs()).sum::<f64>() / 1200.0;
        assert!(size(&read) > 0.035 && size(&values) < 0.012, "{} {}", size(&read), size(&values));
    }

    #[test]
    fn what_moves_stays_as_it_was_read() {
        // A load, one that comes and goes within the noise's reach, and a slow wave.
        let waves = |row: usize| 0.1 * (row as f64 / 8.0).sin();
        let pulses = |row: usize| if (row / 7).is_multiple_of(2) { 0.12 } else { -0.05 };
        let truths: [&dyn Fn(usize) -> f64; 3] = [&|_| 1.0, &pulses, &waves];
        for truth in truths {
            let read = noisy(truth);
            let mut values = read.clone();
            steadied(SENSOR, &[], &mut values);
            let changed = read.iter().zip(&values).filter(|(read, value)| read != value).count();
            assert!(changed <= 60, "{changed} rows");
        }
        // A fine ammeter that is stated to be a coarse one shows what really flows.
        let beats = |row: usize| if [0, 3, 4, 9, 11].contains(&(row % 13)) { 0.02 } else { -0.01 };
        let alternates = |row: usize| if row.is_multiple_of(2) { 0.1 } else { 0.0 };
        let fine: [&dyn Fn(usize) -> f64; 2] = [&beats, &alternates];
        for flows in fine {
            let read: Vec<f64> = (0..1200).map(flows).collect();
            let mut values = read.clone();
            steadied(SENSOR, &[], &mut values);
            assert_eq!(values, read);
        }
        // Means of sixteen readings are four times less noisy: what would be noise of one of them is none of theirs.
        let read = noisy(|_| 0.0);
        let mut values = read.clone();
        steadied(SENSOR, &[16.0; 1200], &mut values);
        assert_eq!(values, read);
    }
}
