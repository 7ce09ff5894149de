//! How certain a promise must be.

use super::Tick;

/// How certain it must be that a station's packs hold what is promised.
///
/// The packs must hold what services take, and what the station takes by itself until the last of
/// them has ended; then it may go dark. What the packs hold and what everything takes is normally
/// distributed:
///
/// `held - taken >= quantile x sqrt(own variances + |base + ticks x hotel + energy x service|²)`
///
/// with the deviations by shared parameters as vectors, of which only the products matter.
#[derive(Debug, Clone, PartialEq)]
pub struct Chance {
    /// Quantile of the standard normal distribution that a new promise needs (1.645 for 95 %).
    pub quantile: f64,
    /// The same for robots whose promise is only held to ([`super::Robot::held`]).
    pub quantile_held: f64,
    /// What the station draws by itself until its last service has ended, per tick.
    pub hotel: i64,
    /// What services that have begun still take.
    pub begun: i64,
    /// Variance of what the packs hold and of services that have begun, units².
    pub variance: f64,
    /// Products of the deviations by shared parameters of what has begun (0), of the station itself in a
    /// tick (1) and of a unit of service (2), units².
    pub shared: [[f64; 3]; 3],
}

impl Chance {
    /// The standard deviation of packs less load.
    #[must_use]
    pub fn sigma(&self, ticks: Tick, energy: i64, own_variance: f64) -> f64 {
        let parts = [1.0, f64::from(ticks), energy as f64];
        let products = (0..3).flat_map(|a| (0..3).map(move |b| (a, b)));
        let shared: f64 = products.map(|(a, b)| self.shared[a][b] * parts[a] * parts[b]).sum();
        (self.variance + own_variance + shared).max(0.0).sqrt()
    }
}
