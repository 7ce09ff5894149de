//! Which spares go into which robots.

use std::sync::Arc;

use energy::Model;
use proto::{SpareState, StationState};

use super::Basis;
use crate::models::StationModels;

/// A charger holds the voltage of a full cell to about this share (data sheets say 0.5 to 1 %): cells that are full within it of one
/// another are charged alike.
const ALIKE: f64 = 0.01;

/// What a spare is, as far as anybody said.
#[derive(Debug, Clone, Default)]
pub(super) struct SpareKind {
    /// Name of its battery model.
    name: Option<String>,
    /// That model, where it is known.
    model: Option<Arc<Model>>,
}

impl SpareKind {
    /// Whether it goes into a robot whose battery is of that name and model: it is the same, or as many cells in the same arrangement,
    /// charged to the same voltage. Of what nobody said anything about it is believed that it fits.
    pub(super) fn fits(&self, name: &str, battery: &Model) -> bool {
        match (&self.name, &self.model) {
            (None, None) => true,
            (Some(own), _) if own == name => true,
            (_, Some(model)) => {
                let (own, other) = (model.battery(), battery.battery());
                let full = own.full_v_per_cell / other.full_v_per_cell - 1.0;
                own.series == other.series && own.parallel == other.parallel && full.abs() <= ALIKE
            }
            (Some(_), None) => false,
        }
    }

    /// Its battery model, where that is known.
    pub(super) fn model(&self) -> Option<&Arc<Model>> {
        self.model.as_ref()
    }

    pub(super) fn is(&self, other: &Self) -> bool {
        let address = |kind: &Self| kind.model.as_ref().map(Arc::as_ptr);
        self.name == other.name && address(self) == address(other)
    }
}

impl Basis<'_> {
    /// The kinds of a station's spares.
    pub(super) fn kinds_of_spares(&self, models: &StationModels, state: &StationState) -> Vec<SpareKind> {
        let mut kinds: Vec<SpareKind> = Vec::new();
        for spare in &state.spares {
            let kind = self.kind_of(models, spare);
            if !kinds.iter().any(|known| known.is(&kind)) {
                kinds.push(kind);
            }
        }
        kinds
    }

    /// The place of a spare's kind among them.
    pub(super) fn place_of(&self, kinds: &[SpareKind], models: &StationModels, spare: &SpareState) -> usize {
        let kind = self.kind_of(models, spare);
        kinds.iter().position(|known| known.is(&kind)).unwrap_or(0)
    }

    /// What a spare of a station is: as it says itself, or else what packs of robots are there.
    pub(super) fn kind_of(&self, models: &StationModels, spare: &SpareState) -> SpareKind {
        match &spare.battery {
            Some(name) => SpareKind { name: Some(name.clone()), model: self.models.named(name).cloned() },
            None => SpareKind { name: None, model: models.spare_battery.clone() },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(name: &str) -> Arc<Model> {
        Arc::new(energy::load_model(name, &|_| unreachable!("built in")).unwrap())
    }

    #[test]
    fn a_spare_fits_by_its_name_or_by_its_build() {
        let (explorer, mds) = (model("explorer-3s1p-1320mah"), model("mds-3s4p-7600mah"));
        let unsaid = SpareKind::default();
        assert!(unsaid.fits("explorer-3s1p-1320mah", &explorer) && unsaid.fits("anything", &mds));
        let known = SpareKind { name: None, model: Some(explorer.clone()) };
        // Also a model of it that somebody made by measurements, under another name.
        assert!(known.fits("explorer-measured", &explorer) && !known.fits("mds-3s4p-7600mah", &mds));
        let named = SpareKind { name: Some("house-pack".to_owned()), model: None };
        assert!(named.fits("house-pack", &mds) && !named.fits("explorer-3s1p-1320mah", &explorer));
    }
}
