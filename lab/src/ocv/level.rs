//! What current flows, behind the noise of its readings.
//!
//! A single reading of an ammeter does not tell a rest from a slow current where it scatters by as much as that is. A current that is held
//! does so by its mean: rows are taken together for as long as nothing but chance lies between them, and a level begins where the rows after
//! it have another mean. (Page's test for a change, Biometrika 41, 1954, by generalised likelihood, of a mean in noise that is known.)

use std::ops::Range;

use crate::residual::{BENT, bends};

/// Rows over which the scatter is taken at a time.
const WINDOW: usize = 32;
/// Of their second differences so many count, the smallest: a step of the current makes two great ones, and one reading that is far off three.
const COUNT: usize = 24;
/// The root of the mean square of so many of noise of one, the lower quartile of many windows (by simulation of 200,000).
const SMALLEST: f64 = 0.577;
/// Of the windows that scatter at all this share is quieter: a current that is worked with moves in most of them, and its ammeter in all.
const QUIET: f64 = 0.25;
/// Another level begins where chi² of one degree of freedom is above so many times the logarithm of how many rows there are: of a million
/// tests of noise less than one comes out so, by a distance that covers what is uncertain of the noise.
const PRICE: f64 = 4.0;
/// Boundaries of levels are looked for again within so many rows, when both sides are known.
const NEAR: usize = 64;

/// Standard deviation of what a current does from row to row where it is quiet, by second differences: its noise and rounding. 0 where it
/// does nothing but step.
pub(super) fn scatter(current_a: &[f64]) -> f64 {
    let rows: Vec<usize> = (0..WINDOW).collect();
    let of_window = |window: &[f64]| {
        let mut squares: Vec<f64> = bends(&rows, window).map(|bend| bend * bend).collect();
        squares.sort_by(f64::total_cmp);
        (squares[..COUNT].iter().sum::<f64>() / COUNT as f64).sqrt() / BENT / SMALLEST
    };
    let mut windows: Vec<f64> = current_a.chunks_exact(WINDOW).map(of_window).filter(|scatter| *scatter > 0.0).collect();
    windows.sort_by(f64::total_cmp);
    windows.get((windows.len() as f64 * QUIET) as usize).copied().unwrap_or(0.0)
}

/// The mean, in every row, of the rows around it between which nothing but noise of this deviation lies. Readings as they are where there is none.
pub(super) fn levels(current_a: &[f64], scatter_a: f64) -> Vec<f64> {
    if scatter_a <= 0.0 {
        return current_a.to_vec();
    }
    let sums = Sums::of(current_a);
    let mut level_a = vec![0.0; current_a.len()];
    for level in sums.placed(sums.cut(PRICE * (current_a.len() as f64).ln() * scatter_a.powi(2))) {
        let mean_a = sums.mean(level.clone());
        level_a[level].fill(mean_a);
    }
    level_a
}

/// Sums of all rows before each.
struct Sums(Vec<f64>);

impl Sums {
    fn of(values: &[f64]) -> Sums {
        let mut sum = 0.0;
        let running = values.iter().map(|value| {
            sum += value;
            sum
        });
        Sums(std::iter::once(0.0).chain(running).collect())
    }

    fn mean(&self, rows: Range<usize>) -> f64 {
        (self.0[rows.end] - self.0[rows.start]) / rows.len() as f64
    }

    /// What the sum of squares falls by when rows have one mean before a cut and another from there on.
    fn gain(&self, rows: &Range<usize>, cut: usize) -> f64 {
        let (before, after) = ((cut - rows.start) as f64, (rows.end - cut) as f64);
        before * after / (before + after) * (self.mean(rows.start..cut) - self.mean(cut..rows.end)).powi(2)
    }

    /// The best cut among these.
    fn best(&self, rows: &Range<usize>, cuts: Range<usize>) -> usize {
        let first = cuts.start;
        cuts.max_by(|&a, &b| self.gain(rows, a).total_cmp(&self.gain(rows, b))).unwrap_or(first)
    }

    /// Where levels begin, row 0 and what comes after the last among them.
    fn cut(&self, price: f64) -> Vec<usize> {
        let rows = self.0.len() - 1;
        let (mut cuts, mut until) = (vec![0], 2);
        while until <= rows {
            let from = cuts[cuts.len() - 1];
            let seen = from..until;
            // One, two, four ... of the newest rows against all before them.
            let mut news = std::iter::successors(Some(1), |new| Some(2 * new)).take_while(|&new| new < seen.len());
            if let Some(new) = news.find(|&new| self.gain(&seen, until - new) > price) {
                let earliest = until.saturating_sub(2 * new).max(from + 1);
                cuts.push(self.best(&seen, earliest..until));
                until = cuts[cuts.len() - 1] + 2;
            } else {
                until += 1;
            }
        }
        cuts.push(rows);
        cuts
    }

    /// The levels, each boundary moved to where both levels beside it fit best.
    fn placed(&self, mut cuts: Vec<usize>) -> Vec<Range<usize>> {
        for at in 1..cuts.len() - 1 {
            let both = cuts[at - 1]..cuts[at + 1];
            let near = cuts[at].saturating_sub(NEAR).max(both.start + 1)..(cuts[at] + NEAR).min(both.end);
            cuts[at] = self.best(&both, near);
        }
        cuts.windows(2).map(|pair| pair[0]..pair[1]).collect()
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// An hour of rest, a day of 125 mA, an hour of rest, and a day back, in rows of 30 s: where each of them begins, and what flows in all rows.
    fn there_and_back() -> (Vec<usize>, Vec<f64>) {
        let parts = [(0.0, 120), (0.125, 2400), (0.0, 120), (-0.125, 2400), (0.0, 120)];
        let begins = parts.iter().scan(0, |row, (_, rows)| Some(std::mem::replace(row, *row + rows))).collect();
        (begins, parts.iter().flat_map(|&(current_a, rows)| std::iter::repeat_n(current_a, rows)).collect())
    }

    fn read(truth_a: &[f64], noise_a: f64, seed: u64) -> Vec<f64> {
        let (mut random, noise) = (Pcg64Mcg::seed_from_u64(seed), Normal::new(0.0, noise_a).unwrap());
        truth_a.iter().map(|truth_a| truth_a + noise.sample(&mut random)).collect()
    }

    #[test]
    fn a_level_is_where_the_current_is_held_however_it_scatters() {
        let (begins, truth_a) = there_and_back();
        for noise_a in [1e-3, 1e-2, 5e-2] {
            for seed in 0..5 {
                let read_a = read(&truth_a, noise_a, seed);
                let scatter_a = scatter(&read_a);
                assert!((scatter_a / noise_a - 1.0).abs() < 0.06, "{noise_a}: {scatter_a}");
                let level_a = levels(&read_a, scatter_a);
                let found: Vec<usize> = (0..level_a.len()).filter(|&row| row == 0 || level_a[row] != level_a[row - 1]).collect();
                // Two means of n readings differ by a step when that is some deviations: within few readings of it.
                let near = |(found, begins): (&usize, &usize)| found.abs_diff(*begins) <= 6;
                assert!(found.len() == begins.len() && found.iter().zip(&begins).all(near), "{noise_a} {seed}: {found:?}, {begins:?}");
                let off_a = level_a.iter().zip(&truth_a).map(|(level, truth)| (level - truth).abs());
                assert!(off_a.filter(|off_a| *off_a > 0.4 * noise_a).count() < 12);
            }
        }
    }

    #[test]
    fn what_does_not_scatter_stays_as_it_was() {
        let (_, truth_a) = there_and_back();
        assert_eq!(scatter(&truth_a), 0.0);
        assert_eq!(levels(&truth_a, 0.0), truth_a);
        // A current that is worked with is not averaged: it moves by far more than it scatters at rest.
        let works: Vec<f64> = (0..900).map(|row| if row % 300 < 100 { 0.0 } else { 1.0 + (row as f64).sin() }).collect();
        let read_a = read(&works, 1e-3, 3);
        let level_a = levels(&read_a, scatter(&read_a));
        assert!(level_a.iter().zip(&works).all(|(level, works)| (level - works).abs() < 0.01));
    }
}
