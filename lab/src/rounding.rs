//! Readings that are rounded: the step of their digits, and what noise lies behind them.

use crate::residual::{BENT, MEDIAN, bends, noise_between};

/// Neighbouring levels lie whole steps apart but for so much of a step: how numbers are written.
const OFF_STEP: f64 = 0.01;
/// Levels nearer to each other than this share of the greatest are one: how numbers are kept.
const DIGITS: f64 = 1e-9;
/// So many levels, whole steps apart, are no chance. With fewer, each must have been read [`OFTEN`] times.
const LEVELS: usize = 16;
/// See [`LEVELS`].
const OFTEN: usize = 4;
/// A step less than this share of the noise is not seen: it adds step²/12, two per cent of its square (Sheppard).
const SEEN: f64 = 0.5;
/// Two levels make second differences of at most two steps, and the noise that spreads over a third seldom makes more than three: what is
/// more has moved.
const MOVED: f64 = 3.5;
/// The golden section: its multiples less whole numbers fill 0..1 evenly, in no order of their own.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The step of which all readings are whole multiples from each other; nothing where they are not visibly rounded.
#[must_use]
pub fn step_of(readings: &[f64]) -> Option<f64> {
    let mut levels: Vec<f64> = readings.iter().copied().filter(|value| value.is_finite()).collect();
    let least = DIGITS * levels.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let count = levels.len();
    levels.sort_by(f64::total_cmp);
    levels.dedup_by(|above, below| *above - *below <= least);
    if levels.len() < 2 || levels.len() < LEVELS && count < OFTEN * levels.len() {
        return None;
    }
    let apart = || levels.windows(2).map(|pair| pair[1] - pair[0]);
    let step = apart().fold(f64::INFINITY, f64::min);
    let whole = |apart: f64| (apart / step - (apart / step).round()).abs() <= OFF_STEP;
    apart().all(whole).then_some(step)
}

/// The step where it shows beside the noise that rows have between them.
#[must_use]
pub fn seen(step: Option<f64>, noise: f64) -> Option<f64> {
    step.filter(|step| *step > SEEN * noise)
}

/// Standard deviation of noise and rounding together, between rows of readings with this step, as [`noise_between`] has it where there is
/// none. Second differences of such readings lie whole steps apart, and so does their median. Each is therefore moved by a share of a step
/// within half of one either way, evenly: their square grows by step²/12, which is taken off again.
#[must_use]
pub fn noise_of_rounded(rows: &[usize], values: &[f64], step: f64, least: usize) -> Option<f64> {
    let mut sizes: Vec<f64> = bends(rows, values).enumerate().map(|(k, bend)| (bend + step * evenly(k)).abs()).collect();
    if sizes.len() < least.max(1) {
        return None;
    }
    let middle = sizes.len() / 2;
    let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    // The median of the sum is that of a Gauss curve: of 6 noise² + step²/12.
    Some(((median / (MEDIAN * BENT)).powi(2) - step.powi(2) / 72.0).max(0.0).sqrt())
}

/// Standard deviation of a reading of these rows: noise, and rounding where readings are visibly rounded. At least step / sqrt(12) then: what is
/// rounded away does not come back from row to row. Noise far below the step shows where a slow voltage passes from one level to the next: there
/// readings vary by step² p (1 - p), with p the chance to be above, on average step noise / sqrt(pi) over all of a step. Where they vary by more
/// than step² / 12, three levels take part, and they vary by noise and rounding together.
#[must_use]
pub fn floor_between(rows: &[usize], readings: &[f64]) -> f64 {
    let noise = noise_between(rows, readings, 1).unwrap_or(0.0);
    let Some(step) = seen(step_of(readings), noise) else { return noise };
    let rounding = step.powi(2) / 12.0;
    let near = || bends(rows, readings).filter(|bend| bend.abs() <= MOVED * step);
    let varies = near().map(|bend| bend.powi(2) / 6.0).sum::<f64>() / (near().count() as f64).max(1.0);
    let behind = varies.min(rounding) * std::f64::consts::PI.sqrt() / step;
    let wide = noise_of_rounded(rows, readings, step, 1).unwrap_or(0.0);
    wide.max(varies.sqrt()).max(rounding.sqrt().hypot(behind))
}

/// How many independent readings each of these is worth, where they are rounded to this step and their noise is of deviation `sigma` before
/// that. What is read errs by the same while what it is of moves within a step, but for its noise: of the variance of a reading the share s stays, and of
/// L readings that stay each is worth 1 / (1 + s (L - 1)).
#[must_use]
pub fn worth(readings: &[f64], step: f64, sigma: f64) -> Vec<f64> {
    let share = stays(step, sigma);
    let mut worth = vec![1.0; readings.len()];
    let mut from = 0;
    while share > NEGLIGIBLE && from < readings.len() {
        let (mut low, mut high, mut until) = (readings[from], readings[from], from + 1);
        while until < readings.len() && readings[until].max(high) - readings[until].min(low) < 1.5 * step {
            (low, high, until) = (readings[until].min(low), readings[until].max(high), until + 1);
        }
        // Where what is read passes from one level to the next it is half as long in each; where it lies between the two it stays.
        let (before, after) = readings[from..until].split_at((until - from) / 2);
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len().max(1) as f64;
        let passes = !before.is_empty() && (mean(after) - mean(before)).abs() > 0.5 * step;
        let long = ((until - from) as f64 / if passes { 2.0 } else { 1.0 }).max(1.0);
        worth[from..until].fill((1.0 + share * (long - 1.0)).recip());
        from = until;
    }
    worth
}

/// A share that makes nothing of as many readings as a mean takes.
const NEGLIGIBLE: f64 = 2e-3;
/// Harmonics of a saw tooth that are looked at: of what is left out the greatest adds 1/400 of the first.
const HARMONICS: u32 = 20;

/// Share of the variance of a rounded reading, noise included, that is the same for all values within a step: the error of rounding is a saw tooth of the value, and noise
/// before it smooths harmonic k of that by exp(-2 pi² k² (sigma/step)²) (Widrow and Kollár, Quantization Noise, 2008, section 19.3).
fn stays(step: f64, sigma: f64) -> f64 {
    let noise = 2.0 * std::f64::consts::PI * sigma / step;
    let harmonic = |k: u32| 0.5 * (step / (std::f64::consts::PI * f64::from(k))).powi(2) * (-(noise * f64::from(k)).powi(2)).exp();
    (1..=HARMONICS).map(harmonic).sum::<f64>() / (sigma.powi(2) + step.powi(2) / 12.0)
}

/// A number within half of one either way.
fn evenly(k: usize) -> f64 {
    (k as f64 * GOLDEN).fract() - 0.5
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::floor::{FloorCheck, FloorOpinion};

    const ROWS: usize = 2000;

    /// A voltage that falls by `fall` of a step a row and sways, read with noise of one and this step: what was, and what was read.
    fn read(step: f64, fall: f64) -> (Vec<f64>, Vec<f64>) {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let noise = Normal::new(0.0, 1.0).unwrap();
        let was: Vec<f64> = (0..ROWS).map(|k| step * (3.0 * (k as f64 / 90.0).sin() - fall * k as f64)).collect();
        let read = was.iter().map(|was| ((was + noise.sample(&mut random)) / step).round() * step).collect();
        (was, read)
    }

    #[test]
    fn a_right_floor_is_right_whatever_the_step() {
        let rows: Vec<usize> = (0..ROWS).collect();
        for step in [0.1, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0] {
            for fall in [0.003, 0.02, 0.07, 0.23, 0.5, 0.9] {
                let (was, read) = read(step, fall);
                let left: Vec<f64> = read.iter().zip(&was).map(|(read, was)| read - was).collect();
                // Sheppard: rounding adds a twelfth of the step's square.
                let floor = 1f64.hypot(step / 12f64.sqrt());
                let check = FloorCheck::of(&rows, &left, floor, step_of(&read)).unwrap();
                assert_ne!(check.opinion, FloorOpinion::FloorTooSmall, "{step} {fall}: {check:?}, {floor}");
                let noise = check.noise_seen.unwrap() / floor;
                assert!(step > 2.0 || (noise - 1.0).abs() < 0.12, "{step} {fall}: {noise}");
                // A floor that is half of what it should be is still found out.
                let check = FloorCheck::of(&rows, &left, floor / 2.0, step_of(&read)).unwrap();
                let doubted = matches!(check.opinion, FloorOpinion::FloorTooSmall | FloorOpinion::AboveFloor);
                assert!(doubted, "{step} {fall}: {check:?}, half of {floor}");
            }
        }
    }

    #[test]
    fn a_floor_of_rounded_rows_is_of_noise_and_step() {
        let rows: Vec<usize> = (0..ROWS).collect();
        for step in [0.7, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0] {
            for fall in [0.003, 0.07, 0.23] {
                let (_, read) = read(step, fall);
                let found = floor_between(&rows, &read) / 1f64.hypot(step / 12f64.sqrt());
                assert!((0.9..1.15).contains(&found), "{step} {fall}: {found}");
            }
        }
    }

    /// Fifty readings of a value that stays somewhere between two levels: what their mean errs by, over many values, against what they are worth.
    #[test]
    fn means_of_rounded_readings_err_as_their_worth_says() {
        for (step, at_most) in [(1.0, 50.0), (3.0, 50.0), (5.0, 25.0), (10.0, 5.0), (20.0, 3.0)] {
            let (mut squares, mut expected, mut most) = (0.0, 0.0, 0.0_f64);
            let (mut random, noise) = (Pcg64Mcg::seed_from_u64(3), Normal::new(0.0, 1.0).unwrap());
            for value in 0..1000 {
                let was = step * f64::from(value) / 1000.0;
                let read: Vec<f64> = (0..50).map(|_| ((was + noise.sample(&mut random)) / step).round() * step).collect();
                let worth: f64 = worth(&read, step, 1.0).iter().sum();
                squares += (read.iter().sum::<f64>() / 50.0 - was).powi(2);
                expected += (1.0 + step * step / 12.0) / worth;
                most = most.max(worth);
            }
            assert!((0.5..1.3).contains(&(squares / expected)) && most <= at_most + 1e-9, "{step}: {squares} {expected}, {most}");
        }
        assert!((stays(1.0, 0.0) - 1.0).abs() < 0.04 && stays(1.0, 0.5) < 1e-4, "{} {}", stays(1.0, 0.0), stays(1.0, 0.5));
        // What moves through its levels row by row stays at none.
        let moves: Vec<f64> = (0..100).map(|k| 10.0 * f64::from(k)).collect();
        assert_eq!(worth(&moves, 10.0, 0.0), [1.0; 100]);
    }

    #[test]
    fn what_is_not_rounded_stays_as_it_was() {
        let rows: Vec<usize> = (0..ROWS).collect();
        let mut random = Pcg64Mcg::seed_from_u64(9);
        let noise = Normal::new(0.0, 1e-3).unwrap();
        let free: Vec<f64> = (0..ROWS).map(|k| 4.0 - 1e-4 * k as f64 + noise.sample(&mut random)).collect();
        assert_eq!(step_of(&free), None);
        assert_eq!(floor_between(&rows, &free), noise_between(&rows, &free, 1).unwrap());
        // Digits that are finer than the noise are a step, but none that shows.
        let written: Vec<f64> = free.iter().map(|volts| (volts * 1e5).round() / 1e5).collect();
        assert!((step_of(&written).unwrap() - 1e-5).abs() < 1e-9);
        assert_eq!(floor_between(&rows, &written), noise_between(&rows, &written, 1).unwrap());
    }

    #[test]
    fn a_step_is_what_all_readings_are_multiples_of() {
        assert_eq!(step_of(&[4.0; 9]), None);
        assert_eq!(step_of(&[4.0, 4.1, 4.25]), None);
        let two: Vec<f64> = (0..20).map(|k| if k % 3 == 0 { 4.21 } else { 4.20 }).collect();
        assert!((step_of(&two).unwrap() - 0.01).abs() < 1e-9);
        let sense: Vec<f64> = (0..40).map(|k| 0.00125 * f64::from(3000 - k * k / 3)).collect();
        assert!((step_of(&sense).unwrap() - 0.00125).abs() < 1e-9);
    }
}
