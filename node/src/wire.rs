//! Estimates of the energy models as they go on the wire.

/// The same value and deviation, as a message carries it.
#[must_use]
pub fn wire(estimate: energy::Estimate) -> proto::Estimate {
    proto::Estimate::new(estimate.value, estimate.sigma)
}
