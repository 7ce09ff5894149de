//! Batteries as their gauges have found them.

use std::sync::Arc;

use energy::Model;
use proto::{Gauge, RobotId, RobotState};

use super::Basis;
use crate::trust::Owner;

impl Basis<'_> {
    /// The battery of this model whose gauge that is.
    pub(crate) fn worn(&self, owner: &Owner, model: &Arc<Model>, gauge: &Gauge) -> Arc<Model> {
        let worn = self.tables.worn.of(model, gauge);
        // A doubt makes nothing more of what is there.
        let is_more = || self.tables.worn.origin(&worn).is_some_and(|(_, share)| share > 1.0);
        if self.trust.fault(self.now, owner).is_some() && is_more() { Arc::clone(model) } else { worn }
    }

    /// A robot's battery; none where nobody knows what it is.
    pub(super) fn battery(&self, id: &RobotId, gauge: &Gauge, state: &RobotState) -> Option<Arc<Model>> {
        Some(self.worn(&Owner::Robot(id.clone()), self.models.battery(id, &state.battery)?, gauge))
    }
}
