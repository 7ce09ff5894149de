//! Whether this coordinator still leads, where several share a store.
//!
//! The lease is renewed beside the core: one that thinks for longer than a lease lasts still leads. One that does not come back from
//! that for [`HUNG`] gives way.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use tokio::task::JoinHandle;
use tracing::{error, warn};

use crate::store::{Store, StoreError};

/// A core that has taken in nothing for so long, not even a tick, hangs. Its lease is not renewed any more, so that another can lead. No
/// plan takes nearly as long: one that does its work must not lose the lease over it.
const HUNG: Duration = Duration::from_secs(30);

/// The right to command.
pub(super) struct Leading {
    right: Arc<Mutex<Right>>,
    renewing: Option<JoinHandle<()>>,
}

struct Right {
    /// Until when it leads for sure; none where nobody can replace it.
    until: Option<Instant>,
    /// Another leads.
    is_replaced: bool,
    /// When the core was last seen at work.
    seen: Instant,
}

fn lock(right: &Mutex<Right>) -> MutexGuard<'_, Right> {
    right.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Leading {
    /// That of who asked for it then, and has it.
    pub(super) fn begin(store: &Arc<Store>, asked: Instant) -> Self {
        let until = store.lease().map(|lease| asked + lease);
        let right = Arc::new(Mutex::new(Right { until, is_replaced: false, seen: monotonic() }));
        let renewing = store.renewal().map(|every| tokio::spawn(renew(Arc::downgrade(store), Arc::clone(&right), every)));
        Self { right, renewing }
    }

    /// Whether it must not command any more: another leads, or may lead by now.
    pub(super) fn is_over(&self) -> bool {
        let right = lock(&self.right);
        right.is_replaced || right.until.is_some_and(|until| monotonic() >= until)
    }

    /// Whether another leads for sure.
    pub(super) fn is_replaced(&self) -> bool {
        lock(&self.right).is_replaced
    }

    /// Takes in that the core is at work.
    pub(super) fn is_at_work(&self) {
        lock(&self.right).seen = monotonic();
    }

    /// Takes in that another leads.
    pub(super) fn replaced(&self) {
        lock(&self.right).is_replaced = true;
    }

    /// Asks no more for it.
    pub(super) async fn end(&mut self) {
        if let Some(task) = self.renewing.take() {
            task.abort();
            // Whatever it was at, it holds the store no longer.
            let _ = task.await;
        }
    }
}

/// Goes on leading as long as the core is at work.
async fn renew(store: Weak<Store>, right: Arc<Mutex<Right>>, every: Duration) {
    loop {
        tokio::time::sleep(every).await;
        let Some(store) = store.upgrade() else { return };
        let asked = monotonic();
        let idle = asked.duration_since(lock(&right).seen);
        if idle > HUNG {
            error!("the core has not come back for {} s: another may lead", idle.as_secs());
            return;
        }
        let renewed = store.renew().await;
        let mut right = lock(&right);
        match renewed {
            Ok(()) => right.until = store.lease().map(|lease| asked + lease),
            Err(StoreError::Deposed { .. }) => {
                right.is_replaced = true;
                return;
            }
            Err(failure) => warn!("{failure}"),
        }
    }
}

/// A clock that is never set: leases are counted by it.
#[allow(clippy::disallowed_methods, reason = "this is the shell's clock")]
pub(super) fn monotonic() -> Instant {
    Instant::now()
}
