//! How many robots are taken in side by side at a station.

use std::collections::BTreeMap;

use proto::{BayId, StationId};

use super::Basis;
use crate::fleet::Robot;
use crate::scheduler::StationView;

impl Basis<'_> {
    /// Leaves free bays out that would not be fed.
    pub(super) fn leave_unfed(&self, view: &mut StationView) {
        let fed = self.side_by_side(&view.station);
        if fed == self.most_side_by_side(&view.station) {
            return;
        }
        let held = |bay: &BayId| view.begun.iter().any(|begun| begun.bay.as_ref() == Some(bay));
        let (held, mut free): (Vec<BayId>, Vec<BayId>) = view.bays.iter().cloned().partition(held);
        let fed = fed.saturating_sub(held.len());
        view.unfed = free.len().saturating_sub(fed);
        free.truncate(fed);
        view.bays.retain(|bay| held.contains(bay) || free.contains(bay));
    }

    /// How many robots may charge side by side at a station: as many as its converters feed at full current, and the crowd beside these.
    #[must_use]
    pub fn side_by_side(&self, id: &StationId) -> usize {
        let most = self.most_side_by_side(id);
        self.fed(id, most).saturating_add(self.crowd).min(most)
    }

    /// By how many the converters of a station could take in more side by side than they feed at full current, at most.
    #[must_use]
    pub fn crowd_max(&self) -> usize {
        let ids = self.models.stations.keys();
        ids.map(|id| (self.most_side_by_side(id), id)).map(|(most, id)| most - self.fed(id, most)).max().unwrap_or(0)
    }

    /// How many of so many robots a station's converters feed at full current.
    fn fed(&self, id: &StationId, most: usize) -> usize {
        let models = self.models.stations.get(id).filter(|models| models.converter_w_max.is_finite());
        let Some((models, battery)) = models.zip(self.reference_battery()) else { return most };
        self.tables.fed(models, most, battery, [self.settings.serve_below_soc, self.settings.charge_to_soc])
    }

    /// As many robots as can be side by side at a station: as many as it has bays, or as can come.
    fn most_side_by_side(&self, id: &StationId) -> usize {
        let bays = self.fleet.stations.get(id).and_then(|station| station.state.as_ref()).map_or(1, |state| state.bays.len());
        let in_reach = self.in_reach.get_or_init(|| {
            let mut in_reach: BTreeMap<StationId, usize> = BTreeMap::new();
            let ways = self.fleet.robots.values().filter_map(Robot::known).flat_map(|(_, state)| state.travel.keys());
            ways.for_each(|station| match in_reach.get_mut(station) {
                Some(robots) => *robots += 1,
                None => drop(in_reach.insert(station.clone(), 1)),
            });
            in_reach
        });
        bays.min(in_reach.get(id).copied().unwrap_or(0)).max(1)
    }
}
