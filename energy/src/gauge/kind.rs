//! The gauges that there are, by name.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{CoulombCounter, Gauge, ImpedanceTrack, SigmaPoint};
use crate::document::hint;
use crate::{Estimate, Model};

/// Which gauge, as configurations name it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Counts charge and corrects at rest.
    #[default]
    CoulombCounter,
    /// Learns resistance and capacity as well.
    ImpedanceTrack,
    /// A filter over all that the model is unsure of.
    SigmaPoint,
}

impl Kind {
    /// Every gauge.
    pub const ALL: &'static [Kind] = &[Kind::CoulombCounter, Kind::ImpedanceTrack, Kind::SigmaPoint];

    /// Its name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Kind::CoulombCounter => "coulomb_counter",
            Kind::ImpedanceTrack => "impedance_track",
            Kind::SigmaPoint => "sigma_point",
        }
    }

    /// The gauge of that name.
    ///
    /// # Errors
    /// Says which gauges there are and which one was probably meant.
    pub fn parse(name: &str) -> Result<Kind, String> {
        let names = || Kind::ALL.iter().map(|kind| kind.name());
        Kind::ALL.iter().copied().find(|kind| kind.name() == name).ok_or_else(|| {
            let known = names().collect::<Vec<_>>().join(", ");
            format!("no gauge is called `{name}`{} Known: {known}", hint(name, names()))
        })
    }

    /// Such a gauge on a pack whose state of charge is known this well.
    #[must_use]
    pub fn open(self, model: Arc<Model>, soc: Estimate, temperature_degc: f64) -> Box<dyn Gauge> {
        match self {
            Kind::CoulombCounter => Box::new(CoulombCounter::new(model, soc, temperature_degc)),
            Kind::ImpedanceTrack => Box::new(ImpedanceTrack::new(model, soc, temperature_degc)),
            Kind::SigmaPoint => Box::new(SigmaPoint::new(model, soc, temperature_degc)),
        }
    }
}

/// [`Kind::open`] by name.
///
/// # Errors
/// Those of [`Kind::parse`].
pub fn open(name: &str, model: Arc<Model>, soc: Estimate, temperature_degc: f64) -> Result<Box<dyn Gauge>, String> {
    Kind::parse(name).map(|kind| kind.open(model, soc, temperature_degc))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_gauge_is_refused_with_what_was_meant() {
        let error = Kind::parse("colomb_counter").unwrap_err();
        assert!(error.contains("did you mean `coulomb_counter`?"), "{error}");
        assert!(Kind::ALL.iter().all(|&kind| Kind::parse(kind.name()) == Ok(kind)));
    }
}
