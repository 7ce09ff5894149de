//! A simulated station as a vehicle: the same key in scenarios and in the station agent's
//! configuration.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::ensure;
use energy::System;
use serde::{Deserialize, Serialize};

use crate::files::ModelRef;
use crate::mission::{Leg, Mission, Stretch, within};

/// `vehicle`: what a station drives when the run begins; after its profile it stands for good. Driving
/// takes power from the active pack beside what the station takes anyway; the lift waits meanwhile.
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
    pub profile: Vec<Leg>,
}

impl<M> Vehicle<M> {
    /// The drive as stretches, with standing still at the end of it.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn stretches(&self) -> anyhow::Result<Vec<Stretch>> {
        ensure!(!self.profile.is_empty(), "vehicle.profile: at least one leg is needed");
        within("vehicle.robot_kg", self.robot_kg, 0.0, 1e6)?;
        let mission = Mission { inputs: self.inputs.clone(), profile: self.profile.clone(), ..Mission::default() };
        let as_vehicle = |error: anyhow::Error| anyhow::anyhow!("{}", error.to_string().replacen("mission.", "vehicle.", 1));
        mission.check().map_err(as_vehicle)?;
        let mut stretches = mission.stretches(&[]).map_err(as_vehicle)?;
        let still = stretches[0].inputs.iter().map(|&(channel, _)| (channel, 0.0)).collect();
        stretches.push(Stretch { time_s: f64::INFINITY, distance_m: 0.0, inputs: still });
        Ok(stretches)
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
