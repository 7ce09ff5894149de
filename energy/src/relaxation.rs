//! Where the voltage of a resting pack will settle, and how fast.
//!
//! After a load ends, the open-circuit voltage creeps towards the electromotive force
//! (Kottas, section 3.2). Its relaxation time constant `tau_rlx` is the time in which it goes
//! 63 % of the way. The first half minute holds faster processes; what follows is close to one
//! exponential, so a few minutes of rest tell where hours would end:
//! `V(t) = V_emf - A exp(-t / tau)`.

use thiserror::Error;

use crate::Estimate;

/// Rest that is left out of an extrapolation, s (Kottas, section 3.2, after [40] there).
const SKIPPED_S: f64 = 30.0;
/// Fewest samples after that: two unknowns, a time constant and one to judge them by.
const SAMPLES_MIN: usize = 4;
/// Longest time constant that is tried, as a multiple of the time watched: a slower process
/// cannot be told from a drift.
const TAU_PER_REST: f64 = 3.0;
/// Halvings of the search for the time constant.
const ITERATIONS: usize = 60;

/// A rest as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relaxation {
    /// Voltage at which the rest would end, V.
    pub emf_v: Estimate,
    /// Time constant of the last exponential, s.
    pub tau_s: f64,
    /// Time in which 63 % of the whole way was or will be gone, s (the thesis' `tau_rlx`).
    pub tau_rlx_s: f64,
}

/// A rest from which nothing can be said yet.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum RestError {
    /// Too few samples.
    #[error("a rest needs {SAMPLES_MIN} samples after its first {SKIPPED_S} s; it has {0}")]
    TooShort(usize),
    /// Time stands still or runs back.
    #[error("the time of sample {0} is not after that of the one before, or a number is not finite")]
    Disordered(usize),
}

/// Extrapolates a rest: samples are time since the load ended, s, and voltage, V.
///
/// The deviation of the result is how far it moves when the last third of the rest is left out,
/// beside what the voltage sensor's noise `sigma_v` leaves. It knows nothing of a process that is
/// too slow to have shown in the rest: in a cell with a time constant of half an hour five minutes
/// tell the end to some 40 mV whatever the deviation says, and only a longer rest helps.
///
/// # Errors
/// [`RestError`] when the samples are too few or out of order.
pub fn extrapolate(rest: &[(f64, f64)], sigma_v: f64) -> Result<Relaxation, RestError> {
    let ordered = |pair: &[(f64, f64)]| pair[1].0 > pair[0].0 && pair.iter().all(|(t, v)| t.is_finite() && v.is_finite());
    if let Some(index) = rest.windows(2).position(|pair| !ordered(pair)) {
        return Err(RestError::Disordered(index + 1));
    }
    let late: Vec<(f64, f64)> = rest.iter().copied().filter(|(time_s, _)| *time_s >= SKIPPED_S).collect();
    if late.len() < SAMPLES_MIN {
        return Err(RestError::TooShort(late.len()));
    }
    let whole = settle(&late);
    let shorter = late.len() - late.len() / 3;
    let moved_v = if shorter >= SAMPLES_MIN { (settle(&late[..shorter]).emf_v - whole.emf_v).abs() } else { f64::INFINITY };
    // Before the rest was long enough to judge the extrapolation, all that is left to go is open.
    let left_v = (whole.emf_v - late[late.len() - 1].1).abs();
    let sigma = moved_v.min(left_v.max(sigma_v)).hypot(sigma_v * whole.noise_gain);
    Ok(Relaxation { emf_v: Estimate::new(whole.emf_v, sigma), tau_s: whole.tau_s, tau_rlx_s: time_to_share(rest, whole.emf_v) })
}

struct Settled {
    emf_v: f64,
    tau_s: f64,
    /// Deviation of the end voltage per deviation of one sample, at that time constant.
    noise_gain: f64,
}

/// Least squares in the end voltage and the amplitude, for the time constant that leaves least.
fn settle(late: &[(f64, f64)]) -> Settled {
    let span_s = late[late.len() - 1].0 - late[0].0;
    let (mut low, mut high) = ((span_s / late.len() as f64).ln(), (TAU_PER_REST * span_s).ln());
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let left = |log_tau: f64| linear(late, log_tau.exp()).1;
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut left_a, mut left_b) = (left(a), left(b));
    for _ in 0..ITERATIONS {
        if left_a < left_b {
            (high, b, left_b) = (b, a, left_a);
            a = high - golden * (high - low);
            left_a = left(a);
        } else {
            (low, a, left_a) = (a, b, left_b);
            b = low + golden * (high - low);
            left_b = left(b);
        }
    }
    let tau_s = f64::midpoint(low, high).exp();
    let (emf_v, _, noise_gain) = linear(late, tau_s);
    Settled { emf_v, tau_s, noise_gain }
}

/// End voltage, sum of squares left, and noise gain at one time constant.
fn linear(late: &[(f64, f64)], tau_s: f64) -> (f64, f64, f64) {
    let count = late.len() as f64;
    let basis = |time_s: f64| (-(time_s - late[0].0) / tau_s).exp();
    let mean = |f: &dyn Fn(f64, f64) -> f64| late.iter().map(|&(t, v)| f(t, v)).sum::<f64>() / count;
    let (mean_b, mean_v) = (mean(&|t, _| basis(t)), mean(&|_, v| v));
    let spread = mean(&|t, _| (basis(t) - mean_b).powi(2)).max(f64::MIN_POSITIVE);
    let slope = mean(&|t, v| (basis(t) - mean_b) * (v - mean_v)) / spread;
    let emf_v = mean_v - slope * mean_b;
    let left = late.iter().map(|&(t, v)| (v - emf_v - slope * basis(t)).powi(2)).sum();
    (emf_v, left, ((1.0 + mean_b.powi(2) / spread) / count).sqrt())
}

/// Time at which the voltage has gone 1 - 1/e of its way from the first sample to the end.
fn time_to_share(rest: &[(f64, f64)], end_v: f64) -> f64 {
    let (first_s, first_v) = rest[0];
    let goal_v = end_v + (first_v - end_v) / std::f64::consts::E;
    let beyond = |v: f64| (v - goal_v) * (end_v - first_v) >= 0.0;
    let Some(index) = rest.iter().position(|&(_, v)| beyond(v)) else { return f64::INFINITY };
    if index == 0 {
        return 0.0;
    }
    let ((t0, v0), (t1, v1)) = (rest[index - 1], rest[index]);
    t0 + (goal_v - v0) / (v1 - v0) * (t1 - t0) - first_s
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exponential(tau_s: f64, until_s: u32) -> Vec<(f64, f64)> {
        (0..=until_s).step_by(10).map(|t| (f64::from(t), 3.8 - 0.05 * (-f64::from(t) / tau_s).exp())).collect()
    }

    #[test]
    fn one_exponential_is_found_from_less_than_its_time_constant() {
        let rest = extrapolate(&exponential(400.0, 300), 0.0).unwrap();
        assert!((rest.emf_v.value - 3.8).abs() < 1e-6 && (rest.tau_s / 400.0 - 1.0).abs() < 1e-4, "{rest:?}");
    }

    #[test]
    fn the_thesis_time_constant_is_where_63_percent_of_the_way_is_gone() {
        let rest = extrapolate(&exponential(120.0, 900), 0.0).unwrap();
        assert!((rest.tau_rlx_s - 120.0).abs() < 0.5, "{rest:?}");
    }

    #[test]
    fn a_rest_of_half_a_minute_says_nothing() {
        assert_eq!(extrapolate(&exponential(120.0, 40), 1e-3), Err(RestError::TooShort(2)));
        assert_eq!(extrapolate(&[(0.0, 3.7), (0.0, 3.7)], 1e-3), Err(RestError::Disordered(1)));
    }

    #[test]
    fn a_rest_after_a_charge_falls_to_its_end() {
        let mirrored: Vec<_> = exponential(200.0, 300).into_iter().map(|(t, v)| (t, 7.6 - v)).collect();
        let rest = extrapolate(&mirrored, 0.0).unwrap();
        assert!((rest.emf_v.value - 3.8).abs() < 1e-6 && (rest.tau_rlx_s - 200.0).abs() < 1.0, "{rest:?}");
    }
}
