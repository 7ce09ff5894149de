//! Energy that has a common doubt: what a service takes from a station's packs.
//!
//! A wrong converter efficiency makes every service dearer at once, so deviations of the
//! station's parameters add up over services; those of the robots' batteries are independent.

use crate::Estimate;

/// Energy with its sensitivity to each shared parameter and its own variance.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Need {
    /// Expected energy, Wh.
    pub mean_wh: f64,
    /// Change by one standard deviation of each shared parameter, Wh.
    pub shared_wh: Vec<f64>,
    /// Variance that is this need's own, Wh².
    pub own_variance: f64,
}

impl Need {
    /// A need whose doubt is its own.
    #[must_use]
    pub fn own(estimate: Estimate) -> Self {
        Self { mean_wh: estimate.value, shared_wh: Vec::new(), own_variance: estimate.sigma.powi(2) }
    }

    /// The same need `factor` times as long.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            mean_wh: self.mean_wh * factor,
            shared_wh: self.shared_wh.iter().map(|x| x * factor).collect(),
            own_variance: self.own_variance * factor * factor,
        }
    }

    /// That many needs alike: their shared doubt adds up, their own doubts are independent.
    #[must_use]
    pub fn times(&self, count: u32) -> Self {
        Self { own_variance: self.own_variance * f64::from(count), ..self.scaled(f64::from(count)) }
    }

    /// Both needs together.
    #[must_use]
    pub fn plus(&self, other: &Need) -> Self {
        let mut sum = self.clone();
        sum.add(other, 1.0);
        sum
    }

    /// Adds another need, `factor` times as long.
    pub fn add(&mut self, other: &Need, factor: f64) {
        self.mean_wh += factor * other.mean_wh;
        if self.shared_wh.len() < other.shared_wh.len() {
            self.shared_wh.resize(other.shared_wh.len(), 0.0);
        }
        self.shared_wh.iter_mut().zip(&other.shared_wh).for_each(|(sum, more)| *sum += factor * more);
        self.own_variance += factor * factor * other.own_variance;
    }

    /// Value and standard deviation.
    #[must_use]
    pub fn estimate(&self) -> Estimate {
        let shared: f64 = self.shared_wh.iter().map(|x| x * x).sum();
        Estimate::new(self.mean_wh, (shared + self.own_variance).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_doubt_adds_up_and_own_doubt_averages_out() {
        let one = Need { mean_wh: 10.0, shared_wh: vec![0.3], own_variance: 0.16 };
        assert_eq!(one.times(2), one.plus(&one));
        let three = one.plus(&one).plus(&one).estimate();
        assert!((three.value - 30.0).abs() < 1e-12);
        // 3 x 0.3 shared, sqrt(3) x 0.4 own.
        assert!((three.sigma - (0.81_f64 + 0.48).sqrt()).abs() < 1e-12);
    }
}
