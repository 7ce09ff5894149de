//! What a station can charge, and with how much: the same keys in the configurations of
//! coordinator and station agent and in scenarios.

use std::path::Path;

use anyhow::ensure;
use serde::{Deserialize, Serialize};

use crate::files::ModelRef;

/// `charging`: limits and sources of a station's charging.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Charging<M = ModelRef> {
    /// Most power that the converters give to all bays together, W; none for no limit. Robots that
    /// charge side by side share it: each gets what it asks for up to a common level.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub converter_w_max: Option<f64>,
    /// Power that an external supply puts into packs that do not feed the station, W in all; 0 for
    /// no supply.
    #[serde(default)]
    pub recharge_w: f64,
    /// Battery model of the packs that robots leave at an exchange: they are charged, from the
    /// supply or else from the active pack, and become spares again. None: they are put aside.
    #[serde(default = "none", skip_serializing_if = "Option::is_none")]
    pub spare_battery: Option<M>,
    /// State of charge, above 0 to 1, from which on such a pack is a spare again. None: when its charger has ended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spare_ready_soc: Option<f64>,
}

fn none<M>() -> Option<M> {
    None
}

/// Greatest power that a configuration may state, W.
const POWER_W_MAX: f64 = 1e6;

impl<M> Default for Charging<M> {
    fn default() -> Self {
        Self { converter_w_max: None, recharge_w: 0.0, spare_battery: None, spare_ready_soc: None }
    }
}

impl<M> Charging<M> {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the key and the range.
    pub fn check(&self) -> anyhow::Result<()> {
        if let Some(limit_w) = self.converter_w_max {
            ensure!(
                limit_w > 0.0 && limit_w <= POWER_W_MAX,
                "charging.converter_w_max = {limit_w}: must be above 0 and at most {POWER_W_MAX}"
            );
        }
        let recharge_w = self.recharge_w;
        ensure!((0.0..=POWER_W_MAX).contains(&recharge_w), "charging.recharge_w = {recharge_w}: must be between 0 and {POWER_W_MAX}");
        if let Some(soc) = self.spare_ready_soc {
            ensure!(soc > 0.0 && soc <= 1.0, "charging.spare_ready_soc = {soc}: must be above 0 and at most 1");
        }
        Ok(())
    }

    /// The converters' limit, W; infinite for none.
    #[must_use]
    pub fn converter_w(&self) -> f64 {
        self.converter_w_max.unwrap_or(f64::INFINITY)
    }

    /// The same with the model named in another way.
    #[must_use]
    pub fn named<N>(&self, name: impl Fn(&M) -> N) -> Charging<N> {
        Charging {
            converter_w_max: self.converter_w_max,
            recharge_w: self.recharge_w,
            spare_battery: self.spare_battery.as_ref().map(name),
            spare_ready_soc: self.spare_ready_soc,
        }
    }
}

impl Charging {
    /// The model of the packs that robots leave.
    ///
    /// # Errors
    /// When it cannot be read, or is no battery.
    pub fn load(&self, beside: Option<&Path>) -> anyhow::Result<Option<std::sync::Arc<energy::Model>>> {
        let Some(reference) = &self.spare_battery else { return Ok(None) };
        reference.load_as(energy::System::Battery, "charging.spare_battery", beside).map(Some)
    }
}
