//! The portmanteau test of Ljung and Box, Biometrika 65 (1978) 297.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use super::slots::Correlation;

/// Lags tested, where there are rows enough.
const LAGS: usize = 20;

/// Are the first lags of a residual uncorrelated?
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LjungBox {
    /// Lags tested, in slots, from 1.
    pub lags: usize,
    /// The statistic: chi-square distributed with as many degrees of freedom as lags, if white.
    pub statistic: f64,
    /// Chance of a statistic this large, if white.
    pub p_value: f64,
}

impl LjungBox {
    /// Of the correlation of `n` filled slots; at most a fifth of them as lags.
    ///
    /// With c the mean product of the N pairs at lag k over the variance, `Q = (n + 2) / n Σ N c²`.
    /// Where no slot is empty, N = n - k and N c / n is the usual autocorrelation, so this is
    /// Ljung's and Box's own n (n + 2) Σ r² / (n - k).
    pub(super) fn of(correlation: &Correlation, n: usize) -> LjungBox {
        let lags = LAGS.min(n / 5).min(correlation.pairs.len() - 1);
        let sum: f64 = (1..=lags).map(|lag| correlation.pairs[lag] * correlation.at(lag).powi(2)).sum();
        let statistic = (n as f64 + 2.0) / n as f64 * sum;
        let p_value = ChiSquared::new(lags as f64).map_or(f64::NAN, |chi_square| chi_square.sf(statistic));
        LjungBox { lags, statistic, p_value }
    }
}

#[cfg(test)]
mod tests {
    use crate::whiteness::Whiteness;
    use crate::whiteness::tests::{seconds, uniform};

    #[test]
    fn agrees_with_statsmodels() {
        // tests/reference/whiteness.py, statsmodels acorr_ljungbox.
        for (n, statistic, p_value) in REFERENCE {
            let found = Whiteness::of(&seconds(n), &uniform(n)).unwrap().ljung_box;
            assert!((found.statistic - statistic).abs() < 1e-8 * statistic, "{found:?}");
            assert!((found.p_value - p_value).abs() < 1e-9, "{found:?}");
        }
    }

    const REFERENCE: [(usize, f64, f64); 2] = [(500, 17.847709513611, 0.597439727889), (60, 8.126553514494, 0.775164076516)];
}
