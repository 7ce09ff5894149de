//! What is left when the physics is right: white noise of the sensor, of known size, beside a
//! slow part of unknown size and persistence (an Ornstein-Uhlenbeck process).
//!
//! `V = white^2 I + slow^2 exp(-|t_i - t_j| / tau)`. A scalar Kalman filter turns residuals and
//! derivatives into independent innovations of unit deviation, whatever the sampling, and gives
//! the likelihood (Brockwell and Davis, Time Series: Theory and Methods, 1991, section 12.5).

mod likely;

use likely::{LANES, Likely, WORN};

/// Noise of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Deviation of the white part, in the channel's unit.
    pub white: f64,
    /// Deviation of the slow part, in the channel's unit; 0 when there is none.
    pub slow: f64,
    /// Time after which the slow part has forgotten 63 % of itself, s.
    pub tau_s: f64,
}

/// The filter of one noise along the rows of one log.
#[derive(Debug, Clone)]
pub struct Filter {
    kept: Vec<f64>,
    gain: Vec<f64>,
    scale: Vec<f64>,
    /// Sum of the logarithms of the innovations' variances.
    pub log_variance: f64,
}

impl Noise {
    /// White noise alone.
    #[must_use]
    pub fn white(white: f64) -> Noise {
        Noise { white, slow: 0.0, tau_s: 1.0 }
    }

    /// The same with a slow part of at least this deviation, that moves as much from row to row.
    #[must_use]
    pub fn with_slow(self, slow: f64) -> Noise {
        if self.slow == 0.0 || slow <= self.slow {
            return self;
        }
        Noise { slow, tau_s: self.tau_s * (slow / self.slow).powi(2), ..self }
    }

    /// White noise that leaves a level as uncertain as this does, for readings that are so far apart, s:
    /// its spectral density is that of this noise at frequency 0.
    #[must_use]
    pub fn levelled(&self, step_s: f64) -> Noise {
        if self.slow == 0.0 || step_s <= 0.0 {
            return *self;
        }
        Noise::white((self.white.powi(2) + self.slow.powi(2) / (step_s / (2.0 * self.tau_s)).tanh()).sqrt())
    }

    /// Multiplies many columns at once, whose values of one row lie behind one another, by the covariance
    /// of rows at these times, s, increasing; each is worth so many independent readings.
    pub fn spread_all(&self, time_s: &[f64], counts: &[f64], values: &mut [f64], columns: usize) {
        let own: Vec<f64> = values.to_vec();
        let kept = |row: usize| if row == 0 { 0.0 } else { (-(time_s[row] - time_s[row - 1]) / self.tau_s).exp() };
        let (white2, slow2) = (self.white * self.white, self.slow * self.slow);
        values.chunks_exact_mut(columns).zip(counts).for_each(|(row, count)| row.iter_mut().for_each(|value| *value *= white2 / count));
        // What each row shares with the earlier ones and itself, and then with the later ones.
        let (mut before, mut after) = (vec![0.0; columns], vec![0.0; columns]);
        for (row, value) in values.chunks_exact_mut(columns).enumerate() {
            let kept = kept(row);
            for ((value, level), own) in value.iter_mut().zip(&mut before).zip(&own[row * columns..]) {
                *level = *level * kept + own;
                *value += slow2 * *level;
            }
        }
        for (row, value) in values.chunks_exact_mut(columns).enumerate().rev() {
            let kept = if row + 1 < time_s.len() { kept(row + 1) } else { 0.0 };
            for ((value, level), own) in value.iter_mut().zip(&mut after).zip(&own[row * columns..]) {
                *level *= kept;
                *value += slow2 * *level;
                *level += own;
            }
        }
    }

    /// The filter for rows at these times, s, increasing; each is worth so many independent readings.
    #[must_use]
    pub fn filter(&self, time_s: &[f64], counts: &[f64]) -> Filter {
        let rows = time_s.len();
        let mut filter = Filter { kept: vec![0.0; rows], gain: vec![0.0; rows], scale: vec![0.0; rows], log_variance: 0.0 };
        // Logarithms are dear: one for many rows.
        let mut product = 1.0_f64;
        self.along(time_s, counts, |row, kept, gain, variance| {
            filter.kept[row] = kept;
            filter.gain[row] = gain;
            filter.scale[row] = variance.sqrt().recip();
            product *= variance;
            if !(WORN..WORN.recip()).contains(&product) {
                filter.log_variance += product.ln();
                product = 1.0;
            }
        });
        filter.log_variance += product.ln();
        filter
    }

    #[inline(always)]
    fn along(&self, time_s: &[f64], counts: &[f64], mut at: impl FnMut(usize, f64, f64, f64)) {
        let (white2, slow2) = (self.white * self.white, self.slow * self.slow);
        let (mut before_s, mut step_s, mut kept, mut variance) = (f64::NAN, f64::NAN, 0.0, slow2);
        for (row, &now_s) in time_s.iter().enumerate() {
            let dt_s = now_s - before_s;
            before_s = now_s;
            if row > 0 {
                if dt_s != step_s {
                    (step_s, kept) = (dt_s, (-dt_s / self.tau_s).exp());
                }
                variance = kept * kept * variance + slow2 * (1.0 - kept * kept);
            }
            let total = variance + white2 / counts[row];
            let gain = variance / total;
            at(row, kept, gain, total);
            variance *= 1.0 - gain;
        }
    }
}

impl Filter {
    /// Turns one column of values, row by row, into innovations of unit deviation, in place.
    pub fn apply(&self, column: &mut [f64]) {
        let mut level = 0.0;
        for (((value, &kept), &gain), &scale) in column.iter_mut().zip(&self.kept).zip(&self.gain).zip(&self.scale) {
            level *= kept;
            let innovation = *value - level;
            level += gain * innovation;
            *value = innovation * scale;
        }
    }

    /// Sum of the squares of a column's innovations.
    #[must_use]
    pub fn squares(&self, column: &[f64]) -> f64 {
        let (mut level, mut sum) = (0.0, 0.0);
        for (((&value, &kept), &gain), &scale) in column.iter().zip(&self.kept).zip(&self.gain).zip(&self.scale) {
            level *= kept;
            let innovation = value - level;
            level += gain * innovation;
            sum += (innovation * scale).powi(2);
        }
        sum
    }

    /// The same for many columns at once, whose values of one row lie behind one another.
    pub fn apply_to_all(&self, values: &mut [f64], columns: usize) {
        let mut level = vec![0.0; columns];
        for (row, ((&kept, &gain), &scale)) in values.chunks_exact_mut(columns).zip(self.kept.iter().zip(&self.gain).zip(&self.scale)) {
            for (value, level) in row.iter_mut().zip(&mut level) {
                *level *= kept;
                let innovation = *value - *level;
                *level += gain * innovation;
                *value = innovation * scale;
            }
        }
    }
}

/// Persistences that are tried, as multiples of the mean step.
const TAU_STEPS: [f64; 7] = [1.5, 5.0, 15.0, 50.0, 150.0, 500.0, 2000.0];
/// Sizes that are tried, as shares of what the residuals have beyond the white part.
const SIZES: [f64; LANES] = [0.25, 0.55, 1.0, 1.9];
/// Factors by which size and persistence move, one after the other, to go on from there.
const FACTORS: [f64; 3] = [1.6, 1.25, 1.1];
/// Moves with one factor at most.
const MOVES: usize = 12;
/// Slow noise is looked for between these shares of the white part and of the residuals.
const LEAST: f64 = 0.02;
const LARGEST: f64 = 3.0;
/// Largest persistence, as a share of the mean length of a log. What lasts longer is an error of
/// the model: a disturbance that could last as long as the log would excuse any wrong level.
const LONGEST: f64 = 0.1;

/// Times, s, numbers of readings and residuals of the judged rows of one log.
pub type Rows<'a> = (&'a [f64], &'a [f64], &'a [f64]);

/// The most likely noise of residuals, given the white part of one reading.
#[must_use]
pub fn estimate(white: f64, logs: &[Rows<'_>]) -> Noise {
    let (mut rows, mut squares, mut length_s, mut own) = (0.0, 0.0, 0.0, 0.0);
    for (time_s, counts, residual) in logs.iter().filter(|(time_s, ..)| time_s.len() > 1) {
        rows += residual.len() as f64;
        squares += residual.iter().zip(*counts).map(|(r, count)| r * r * count).sum::<f64>();
        own += residual.iter().zip(*counts).map(|(r, count)| r * r - white * white / count).sum::<f64>();
        length_s += time_s[time_s.len() - 1] - time_s[0];
    }
    let none = Noise::white(white);
    // Nothing slow can hide in residuals that lie clearly below the sensor's own noise.
    if rows == 0.0 || squares / rows < 0.5 * white * white {
        return none;
    }
    let step_s = length_s / rows;
    let longest_s = (LONGEST * length_s / logs.len() as f64).max(TAU_STEPS[1] * step_s);
    let (least, largest) = (LEAST * white, (LARGEST * (squares / rows).sqrt()).max(white));
    let within = |slow: f64, tau_s: f64| Noise { white, slow: slow.clamp(least, largest), tau_s: tau_s.min(longest_s) };
    let likely = Likely::new(white, logs);
    let mut best = (likely.costs([none; LANES])[0], none);
    let mut keep = |noises: [Noise; LANES]| {
        let costs = likely.costs(noises);
        let before = best.0;
        for (cost, noise) in costs.into_iter().zip(noises) {
            if cost < best.0 {
                best = (cost, noise);
            }
        }
        (best.1, best.0 < before)
    };
    let beyond = (own / rows).max(0.01 * white * white).sqrt();
    let mut found = none;
    for tau_s in TAU_STEPS.map(|steps| steps * step_s).into_iter().filter(|&tau_s| tau_s <= longest_s) {
        found = keep(SIZES.map(|share| within(share * beyond, tau_s))).0;
    }
    if found.slow == 0.0 {
        return none;
    }
    for factor in FACTORS {
        for _ in 0..MOVES {
            let Noise { slow, tau_s, .. } = found;
            let around = [(slow * factor, tau_s), (slow / factor, tau_s), (slow, tau_s * factor), (slow, tau_s / factor)];
            let (better, moved) = keep(around.map(|(slow, tau_s)| within(slow, tau_s)));
            found = better;
            if !moved {
                break;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use rand::SeedableRng as _;
    use rand_distr::{Distribution as _, StandardNormal};

    const NOISE: Noise = Noise { white: 1.0, slow: 2.0, tau_s: 30.0 };

    fn draw(noise: Noise, time_s: &[f64], seed: u64) -> Vec<f64> {
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let mut slow = noise.slow * normal();
        let step = |row: usize| if row == 0 { 0.0 } else { time_s[row] - time_s[row - 1] };
        (0..time_s.len())
            .map(|row| {
                let kept = (-step(row) / noise.tau_s).exp();
                slow = kept * slow + noise.slow * (1.0 - kept * kept).sqrt() * normal();
                slow + noise.white * normal()
            })
            .collect()
    }

    /// From one row to the next it moves as before: the variance of a short step is `2 slow² dt / tau`.
    #[test]
    fn a_larger_slow_part_takes_the_same_steps() {
        let larger = NOISE.with_slow(10.0);
        let step = |noise: Noise| 2.0 * noise.slow.powi(2) / noise.tau_s;
        assert!((step(larger) - step(NOISE)).abs() < 1e-12 && larger.slow == 10.0);
        assert_eq!((NOISE.with_slow(1.0), Noise::white(1.0).with_slow(5.0)), (NOISE, Noise::white(1.0)));
    }

    /// The filter is a Cholesky factor of V in disguise.
    #[test]
    fn innovations_and_likelihood_are_those_of_the_covariance_matrix() {
        let time_s = [0.0_f64, 1.0, 3.0, 10.0, 11.0, 60.0];
        let covariance = DMatrix::from_fn(6, 6, |i, j| {
            NOISE.slow.powi(2) * (-(time_s[i] - time_s[j]).abs() / NOISE.tau_s).exp() + if i == j { NOISE.white.powi(2) } else { 0.0 }
        });
        let values = DVector::from_vec(vec![1.0, -2.0, 0.5, 3.0, 0.0, -1.0]);
        let cholesky = covariance.cholesky().unwrap();
        let expected = cholesky.l().solve_lower_triangular(&values).unwrap();
        let mut found = values.as_slice().to_vec();
        let filter = NOISE.filter(&time_s, &[1.0; 6]);
        filter.apply(&mut found);
        assert!(found.iter().zip(expected.iter()).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected}");
        assert!((filter.log_variance - cholesky.determinant().ln()).abs() < 1e-12);
        let logs = [(&time_s[..], &[1.0; 6][..], values.as_slice())];
        let cost = Likely::new(1.0, &logs).costs([NOISE; LANES])[LANES - 1];
        assert!((cost - cholesky.determinant().ln() - expected.norm_squared()).abs() < 1e-9);
    }

    #[test]
    fn columns_are_spread_as_by_the_covariance_matrix_and_a_level_is_as_uncertain_when_levelled() {
        let (time_s, counts) = ([0.0_f64, 1.0, 3.0, 10.0], [1.0, 2.0, 1.0, 4.0]);
        let covariance = DMatrix::from_fn(4, 4, |i, j| {
            NOISE.slow.powi(2) * (-(time_s[i] - time_s[j]).abs() / NOISE.tau_s).exp() + if i == j { 1.0 / counts[i] } else { 0.0 }
        });
        let columns = DMatrix::from_row_slice(2, 4, &[1.0, -2.0, 0.5, 3.0, 0.0, 1.0, 4.0, -1.0]);
        let mut found = columns.clone();
        NOISE.spread_all(&time_s, &counts, found.as_mut_slice(), 2);
        assert!((found - columns * covariance).amax() < 1e-12);
        // The mean of many readings a second apart, by V and by white noise.
        let (rows, step_s) = (20_000.0_f64, 1.0);
        let shared = (1.0 + (-step_s / NOISE.tau_s).exp()) / (1.0 - (-step_s / NOISE.tau_s).exp());
        let variance = (NOISE.white.powi(2) + NOISE.slow.powi(2) * shared) / rows;
        assert!((NOISE.levelled(step_s).white.powi(2) / rows / variance - 1.0).abs() < 1e-9);
    }

    #[test]
    fn many_columns_become_what_each_becomes_alone() {
        let time_s = [0.0, 1.0, 3.0, 10.0];
        let filter = NOISE.filter(&time_s, &[1.0, 2.0, 1.0, 4.0]);
        let columns = [[1.0, -2.0, 0.5, 3.0], [0.0, 1.0, 4.0, -1.0]];
        let mut together: Vec<f64> = (0..4).flat_map(|row| columns.map(|column| column[row])).collect();
        filter.apply_to_all(&mut together, 2);
        for (place, column) in columns.into_iter().enumerate() {
            let mut alone = column;
            filter.apply(&mut alone);
            assert!((0..4).all(|row| (alone[row] - together[2 * row + place]).abs() < 1e-15));
        }
    }

    #[test]
    fn a_slow_part_is_found_with_about_its_size_and_persistence() {
        let time_s: Vec<f64> = (0..4000).map(f64::from).collect();
        let values = draw(NOISE, &time_s, 1);
        let found = estimate(1.0, &[(&time_s, &[1.0; 4000], &values)]);
        assert!((found.slow / NOISE.slow - 1.0).abs() < 0.2 && (15.0..=50.0).contains(&found.tau_s), "{found:?}");
    }

    #[test]
    fn white_noise_has_no_slow_part_worth_the_name() {
        let time_s: Vec<f64> = (0..4000).map(f64::from).collect();
        let values = draw(Noise::white(1.0), &time_s, 2);
        let found = estimate(1.0, &[(&time_s, &[1.0; 4000], &values)]);
        assert!(found.slow < 0.15, "{found:?}");
    }
}
