//! What is left when the physics is right: white noise of the sensor, of known size, beside a
//! slow part of unknown size and persistence (an Ornstein-Uhlenbeck process).
//!
//! `V = white^2 I + slow^2 exp(-|t_i - t_j| / tau)`. A scalar Kalman filter turns residuals and
//! derivatives into independent innovations of unit deviation, whatever the sampling, and gives
//! the likelihood (Brockwell and Davis, Time Series: Theory and Methods, 1991, section 12.5).

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

    /// The filter for rows at these times, s, increasing; each is the mean of so many readings.
    #[must_use]
    pub fn filter(&self, time_s: &[f64], counts: &[f64]) -> Filter {
        let rows = time_s.len();
        let mut filter = Filter { kept: vec![0.0; rows], gain: vec![0.0; rows], scale: vec![0.0; rows], log_variance: 0.0 };
        self.along(time_s, counts, |row, kept, gain, variance| {
            filter.kept[row] = kept;
            filter.gain[row] = gain;
            filter.scale[row] = variance.sqrt().recip();
            filter.log_variance += variance.ln();
        });
        filter
    }

    /// Minus twice the log-likelihood of these residuals at these times, without its constant.
    fn cost(&self, time_s: &[f64], counts: &[f64], residual: &[f64]) -> f64 {
        let (mut cost, mut product, mut level) = (0.0, 1.0, 0.0);
        self.along(time_s, counts, |row, kept, gain, variance| {
            level *= kept;
            let innovation = residual[row] - level;
            level += gain * innovation;
            cost += innovation * innovation / variance;
            product *= variance;
            // Logarithms are dear: one for many rows.
            if !(1e-200..1e200).contains(&product) {
                cost += product.ln();
                product = 1.0;
            }
        });
        cost + product.ln()
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
}

/// Persistences that are tried, as multiples of the mean step.
const TAU_STEPS: [f64; 7] = [1.5, 5.0, 15.0, 50.0, 150.0, 500.0, 2000.0];

/// Factors between the points of that grid.
const BESIDE: [f64; 2] = [0.55, 1.8];
/// Largest persistence, as a share of the mean length of a log. What lasts longer is an error of
/// the model: a disturbance that could last as long as the log would excuse any wrong level.
const LONGEST: f64 = 0.1;

/// Times, s, numbers of readings and residuals of the judged rows of one log.
pub type Rows<'a> = (&'a [f64], &'a [f64], &'a [f64]);

/// The most likely noise of residuals, given the white part of one reading.
#[must_use]
pub fn estimate(white: f64, logs: &[Rows<'_>]) -> Noise {
    let cost = |noise: Noise| logs.iter().map(|(time_s, counts, residual)| noise.cost(time_s, counts, residual)).sum::<f64>();
    let (mut rows, mut squares, mut length_s) = (0.0, 0.0, 0.0);
    for (time_s, counts, residual) in logs.iter().filter(|(time_s, ..)| time_s.len() > 1) {
        rows += residual.len() as f64;
        squares += residual.iter().zip(*counts).map(|(r, count)| r * r * count).sum::<f64>();
        length_s += time_s[time_s.len() - 1] - time_s[0];
    }
    let none = Noise::white(white);
    if rows == 0.0 {
        return none;
    }
    let (step_s, variance) = (length_s / rows, squares / rows);
    let longest_s = LONGEST * length_s / logs.len() as f64;
    let mut best = (cost(none), none);
    // Nothing slow can hide in residuals that lie clearly below the sensor's own noise.
    if variance < 0.5 * white * white {
        return none;
    }
    let largest = (3.0 * variance.sqrt()).max(white);
    let sized = |tau_s: f64| {
        least(0.02 * white, largest, |slow| {
            let noise = Noise { white, slow, tau_s };
            (cost(noise), noise)
        })
    };
    let mut keep = |found: (f64, Noise)| {
        if found.0 < best.0 {
            best = found;
        }
        best.1
    };
    let longest_s = longest_s.max(TAU_STEPS[1] * step_s);
    for tau_s in TAU_STEPS.map(|steps| steps * step_s).into_iter().filter(|&tau_s| tau_s <= longest_s) {
        keep(sized(tau_s));
    }
    // Between the points of the grid.
    let coarse = keep((f64::INFINITY, none));
    if coarse.slow > 0.0 {
        for factor in BESIDE {
            keep(sized((coarse.tau_s * factor).min(longest_s)));
        }
    }
    best.1
}

/// The least cost over sizes between `low` and `high`, by golden section on their logarithm.
fn least(low: f64, high: f64, at: impl Fn(f64) -> (f64, Noise)) -> (f64, Noise) {
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    let at = |log: f64| at(log.exp());
    let (mut low, mut high) = (low.ln(), high.ln());
    let (mut a, mut b) = (at(high - ratio * (high - low)), at(low + ratio * (high - low)));
    while high - low > 0.1 {
        if a.0 < b.0 {
            high = low + ratio * (high - low);
            b = a;
            a = at(high - ratio * (high - low));
        } else {
            low = high - ratio * (high - low);
            a = b;
            b = at(low + ratio * (high - low));
        }
    }
    if a.0 < b.0 { a } else { b }
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
        let cost = NOISE.cost(&time_s, &[1.0; 6], values.as_slice());
        assert!((cost - cholesky.determinant().ln() - expected.norm_squared()).abs() < 1e-9);
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
