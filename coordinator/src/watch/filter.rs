//! What is only roughly known of a model, learnt from block to block, so that what remains is news.
//!
//! A linear Kalman filter over a few unknowns, all 0 when the model is exactly right, each with the
//! deviation that the model states for it. An innovation is what a block shows beyond what the
//! unknowns, as learnt so far, explain; over its standard deviation it is standard normal as long as
//! the model and its stated deviations are right (Bar-Shalom, Li and Kirubarajan, Estimation with
//! Applications to Tracking and Navigation, section 5.4).

/// Innovations beyond this teach nothing, in sigma: a filter that follows everything is never
/// surprised, and its surprise is what is asked for. What is not learnt comes again with every block,
/// so the gate lies where chance hardly reaches: 4 sigma, once in 16000 innovations.
const GATE: f64 = 4.0;

/// Unknowns and their covariance.
#[derive(Debug, Clone)]
pub(crate) struct Filter {
    x: Vec<f64>,
    p: Vec<Vec<f64>>,
}

impl Filter {
    /// Unknowns at 0, independent, with these deviations.
    pub(crate) fn new(sigmas: &[f64]) -> Self {
        let row = |index: usize| (0..sigmas.len()).map(|other| if other == index { sigmas[index].powi(2) } else { 0.0 }).collect();
        Self { x: vec![0.0; sigmas.len()], p: (0..sigmas.len()).map(row).collect() }
    }

    /// One unknown as learnt.
    pub(crate) fn value(&self, index: usize) -> f64 {
        self.x[index]
    }

    /// Deviation of one unknown.
    pub(crate) fn sigma(&self, index: usize) -> f64 {
        self.p[index][index].max(0.0).sqrt()
    }

    /// The unknown is counted from its learnt value from now on: that has been put into the model.
    pub(crate) fn rebase(&mut self, index: usize) {
        self.x[index] = 0.0;
    }

    /// The unknown is another one from now on, of which nothing was learnt.
    pub(crate) fn forget(&mut self, index: usize, sigma: f64) {
        self.x[index] = 0.0;
        self.p[index].fill(0.0);
        self.p.iter_mut().for_each(|row| row[index] = 0.0);
        self.wander(index, sigma * sigma);
    }

    /// Adds `share` of an unknown to another: an error of the current becomes one of the charge.
    pub(crate) fn carry(&mut self, from: usize, to: usize, share: f64) {
        self.x[to] += share * self.x[from];
        for column in 0..self.x.len() {
            self.p[to][column] += share * self.p[from][column];
        }
        for row in &mut self.p {
            row[to] += share * row[from];
        }
    }

    /// An unknown moves by itself by this much.
    pub(crate) fn wander(&mut self, index: usize, variance: f64) {
        self.p[index][index] += variance;
    }

    /// An unknown keeps this share of itself and becomes new for the rest, with that deviation over
    /// all: what is true at one state of charge holds less the further that moves.
    pub(crate) fn renew(&mut self, index: usize, keep: f64, sigma: f64) {
        self.x[index] *= keep;
        for column in 0..self.x.len() {
            self.p[index][column] *= keep;
        }
        for row in &mut self.p {
            row[index] *= keep;
        }
        self.wander(index, (1.0 - keep * keep) * sigma * sigma);
    }

    /// The innovation in sigma of a residual that follows the unknowns by `slopes` and has noise of
    /// this variance besides. The unknowns learn from it unless it is beyond the gate.
    pub(crate) fn judge(&mut self, slopes: &[f64], residual: f64, noise_variance: f64) -> f64 {
        let dot = |row: &[f64]| row.iter().zip(slopes).map(|(value, slope)| value * slope).sum::<f64>();
        let with: Vec<f64> = self.p.iter().map(|row| dot(row)).collect();
        let variance = dot(&with) + noise_variance;
        let innovation = residual - dot(&self.x);
        let z = innovation / variance.sqrt();
        if z.abs() < GATE {
            for (x, with) in self.x.iter_mut().zip(&with) {
                *x += with / variance * innovation;
            }
            for (row, of_row) in self.p.iter_mut().zip(&with) {
                row.iter_mut().zip(&with).for_each(|(p, of_column)| *p -= of_row * of_column / variance);
            }
        }
        z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_stated_deviation_allows_is_learnt_and_no_news_afterwards() {
        let mut filter = Filter::new(&[2.0]);
        // Variance 4 + 1: 2 over sqrt 5; gain 4/5, so 1.6 is learnt and 4 - 16/5 = 0.8 is left open.
        assert!((filter.judge(&[1.0], 2.0, 1.0) - 2.0 / 5f64.sqrt()).abs() < 1e-12);
        assert!((filter.value(0) - 1.6).abs() < 1e-12 && (filter.sigma(0) - 0.8f64.sqrt()).abs() < 1e-12);
        // The second time 0.4 is left, over sqrt 1.8.
        assert!((filter.judge(&[1.0], 2.0, 1.0) - 0.4 / 1.8f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_it_does_not_allow_stays_news() {
        let mut filter = Filter::new(&[2.0]);
        for _ in 0..100 {
            assert!((filter.judge(&[1.0], 15.0, 5.0) - 5.0).abs() < 1e-12);
        }
        assert_eq!(filter.value(0), 0.0);
    }

    #[test]
    fn an_error_that_is_carried_over_takes_its_doubt_along() {
        let mut filter = Filter::new(&[3.0, 4.0]);
        filter.carry(0, 1, 2.0);
        // 16 + 4 x 9.
        assert!((filter.sigma(1) - 52f64.sqrt()).abs() < 1e-12);
        // They are correlated now: seeing the second tells of the first, 18 / 53 of it.
        filter.judge(&[0.0, 1.0], 5.3, 1.0);
        assert!((filter.value(0) - 1.8).abs() < 1e-12);
    }

    #[test]
    fn what_is_renewed_whole_is_as_at_the_start() {
        let mut filter = Filter::new(&[3.0]);
        filter.judge(&[1.0], 5.0, 1.0);
        filter.renew(0, 0.0, 3.0);
        assert_eq!((filter.value(0), filter.sigma(0)), (0.0, 3.0));
    }
}
