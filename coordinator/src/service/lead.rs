//! Whether this coordinator still leads, where several share a store.

use std::time::Instant;

use tracing::warn;

use super::Service;
use crate::store::StoreError;

impl Service {
    /// Whether it must not command any more: another leads, or may lead by now.
    pub(super) fn deposed(&self) -> bool {
        self.replaced || self.leads_until.is_some_and(|until| monotonic() >= until)
    }

    /// Goes on leading, where that has to be asked for.
    pub(super) async fn renew(&mut self) {
        if self.store.renewal().is_none() {
            return;
        }
        let asked = monotonic();
        match self.store.renew().await {
            Ok(()) => self.leads_until = self.store.lease().map(|lease| asked + lease),
            Err(StoreError::Deposed { .. }) => self.replaced = true,
            Err(failure) => warn!("{failure}"),
        }
    }
}

/// A clock that is never set: leases are counted by it.
#[allow(clippy::disallowed_methods, reason = "this is the shell's clock")]
pub(super) fn monotonic() -> Instant {
    Instant::now()
}
