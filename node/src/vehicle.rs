//! A simulated station as a vehicle: the same key in scenarios and in the station agent's
//! configuration.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::ensure;
use energy::System;
use serde::{Deserialize, Serialize};

use crate::files::ModelRef;
use crate::mission::{Leg, Mission, Stretch, within};

/// `vehicle`: what a station drives from when the run begins; after its profile it stands for good. Driving
/// takes power from the active pack beside what the station takes anyway; the lift waits meanwhile. Who is aboard goes along.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vehicle<M = ModelRef> {
    /// Model of its drive: what it takes beyond its own standstill counts.
    pub load: M,
    /// Mass of one robot aboard, kg: payload, unless a leg states its own.
    #[serde(default)]
    pub robot_kg: f64,
    /// Inputs of the model throughout.
    #[serde(default)]
    pub inputs: BTreeMap<String, f64>,
    /// What it does leg by leg, once.
    pub profile: Vec<VehicleLeg>,
}

/// A leg of a vehicle's profile, or a stay between two.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehicleLeg {
    /// How long, s (above 0).
    pub for_s: f64,
    /// Inputs of the model that differ from those throughout.
    #[serde(default)]
    pub inputs: BTreeMap<String, f64>,
    /// It stands, and takes robots in.
    #[serde(default)]
    pub open: bool,
}

/// A part of a vehicle's way.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// What its model is told, and for how long.
    pub stretch: Stretch,
    /// Whether it stands, and takes robots in.
    pub open: bool,
}

impl<M> Vehicle<M> {
    /// The way part by part, with standing still at the end of it.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn parts(&self) -> anyhow::Result<Vec<Part>> {
        ensure!(!self.profile.is_empty(), "vehicle.profile: at least one leg is needed");
        within("vehicle.robot_kg", self.robot_kg, 0.0, 1e6)?;
        for (index, leg) in self.profile.iter().enumerate() {
            ensure!(!leg.open || leg.inputs.is_empty(), "vehicle.profile[{index}]: it is open, so it stands and has no inputs");
        }
        let legs = self.profile.iter().map(|leg| Leg { for_s: leg.for_s, distance_m: None, inputs: leg.inputs.clone() });
        let mission = Mission { inputs: self.inputs.clone(), profile: legs.collect(), ..Mission::default() };
        let as_vehicle = |error: anyhow::Error| anyhow::anyhow!("{}", error.to_string().replacen("mission.", "vehicle.", 1));
        mission.check().map_err(as_vehicle)?;
        let stretches = mission.stretches(&[]).map_err(as_vehicle)?;
        let still: Vec<_> = stretches[0].inputs.iter().map(|&(channel, _)| (channel, 0.0)).collect();
        let stand = |time_s| Part { stretch: Stretch { time_s, distance_m: 0.0, inputs: still.clone() }, open: true };
        let part = |(stretch, leg): (Stretch, &VehicleLeg)| {
            if leg.open { stand(leg.for_s) } else { Part { stretch, open: false } }
        };
        Ok(stretches.into_iter().zip(&self.profile).map(part).chain([stand(f64::INFINITY)]).collect())
    }

    /// The same with the model named in another way.
    #[must_use]
    pub fn named<N>(&self, name: impl Fn(&M) -> N) -> Vehicle<N> {
        Vehicle { load: name(&self.load), robot_kg: self.robot_kg, inputs: self.inputs.clone(), profile: self.profile.clone() }
    }
}

impl Vehicle {
    /// The model of its drive.
    ///
    /// # Errors
    /// When it cannot be read, or is no robot's.
    pub fn model(&self, beside: Option<&Path>) -> anyhow::Result<std::sync::Arc<energy::Model>> {
        self.load.load_as(System::Robot, "vehicle.load", beside)
    }
}
