//! What a robot does when it is not being serviced: the same keys in scenarios and in the agent's
//! configuration.

mod course;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use anyhow::{Context, ensure};
use energy::forecast::{power_w, propagate_loads};
use energy::{Channel, Estimate, Model, Run, Start};
use serde::{Deserialize, Serialize};

pub use course::Course;

/// `[mission]`: what the robot does when it is not being serviced.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Mission {
    /// Worth of one second of its work; 1 is usual.
    pub weight: f64,
    /// Inputs of the load model while it works, such as `speed_mps`.
    pub inputs: BTreeMap<String, f64>,
    /// Distance from the coordinator's radio while it works, m; legs may say otherwise.
    pub distance_m: f64,
    /// What it does leg by leg, over and over; empty for the same all the time.
    pub profile: Vec<Leg>,
}

impl Default for Mission {
    fn default() -> Self {
        Self { weight: 1.0, inputs: BTreeMap::new(), distance_m: 0.0, profile: Vec::new() }
    }
}

/// A leg of a mission's profile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leg {
    /// How long, s (above 0).
    pub for_s: f64,
    /// Distance from the coordinator's radio, m; that of the mission when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_m: Option<f64>,
    /// Inputs of the load model that differ from those of the mission.
    #[serde(default)]
    pub inputs: BTreeMap<String, f64>,
}

/// What a robot's load model is told for a while.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// How long, s; infinite for ever.
    pub time_s: f64,
    /// Distance from the coordinator's radio, m.
    pub distance_m: f64,
    /// Inputs by channel; every stretch of a robot names the same channels.
    pub inputs: Vec<(Channel, f64)>,
}

/// A weight is counted in steps of this, and is no less but for 0.
const WEIGHT_MIN: f64 = 0.1;
/// And no more than this, so that the work of a large fleet can be added up.
const WEIGHT_MAX: f64 = 1000.0;
/// Largest number that makes sense as a load's input or a weight.
pub const INPUT_MAX: f64 = 1e6;
/// Longest leg, s, and longest piece or distance, m.
pub const LONG: f64 = 1e7;

/// Checks a range that holds both its ends.
///
/// # Errors
/// Names the key and the range.
pub fn within(key: &str, value: f64, min: f64, max: f64) -> anyhow::Result<()> {
    ensure!((min..=max).contains(&value), "{key} = {value}: must be between {min} and {max}");
    Ok(())
}

/// Checks a range above 0.
///
/// # Errors
/// Names the key and the range.
pub fn above(key: &str, value: f64, max: f64) -> anyhow::Result<()> {
    ensure!(value > 0.0 && value <= max, "{key} = {value}: must be above 0 and at most {max}");
    Ok(())
}

/// Inputs of a load model by channel.
///
/// # Errors
/// Names the key, and the nearest channel or the range.
pub fn channels(key: &str, inputs: &BTreeMap<String, f64>) -> anyhow::Result<Vec<(Channel, f64)>> {
    let read = |(name, &value): (&String, &f64)| {
        let hint = || energy::document::hint(name, Channel::ALL.iter().map(|c| c.name()));
        let channel = Channel::from_name(name).with_context(|| format!("{key}.{name}: unknown channel{}", hint()))?;
        within(&format!("{key}.{name}"), value, -INPUT_MAX, INPUT_MAX)?;
        Ok((channel, value))
    };
    inputs.iter().map(read).collect()
}

impl Mission {
    /// Checks every number and channel.
    ///
    /// # Errors
    /// Names the key, what is allowed, and the nearest channel.
    pub fn check(&self) -> anyhow::Result<()> {
        ensure!(
            self.weight == 0.0 || (WEIGHT_MIN..=WEIGHT_MAX).contains(&self.weight),
            "mission.weight = {}: must be 0, or between {WEIGHT_MIN} and {WEIGHT_MAX}",
            self.weight
        );
        within("mission.distance_m", self.distance_m, 0.0, LONG)?;
        for (index, leg) in self.profile.iter().enumerate() {
            let key = format!("mission.profile[{index}]");
            above(&format!("{key}.for_s"), leg.for_s, LONG)?;
            within(&format!("{key}.distance_m"), leg.distance_m.unwrap_or(0.0), 0.0, LONG)?;
        }
        self.stretches(&[]).map(|_| ())
    }

    /// The work as stretches: one for ever, or the legs of the profile. Channels of `others` are
    /// named too, at 0 where the mission does not name them.
    ///
    /// # Errors
    /// When an input is no channel.
    pub fn stretches(&self, others: &[Channel]) -> anyhow::Result<Vec<Stretch>> {
        let base = channels("mission.inputs", &self.inputs)?;
        let legs = self.profile.iter().enumerate();
        let legs: Vec<_> =
            legs.map(|(index, leg)| channels(&format!("mission.profile[{index}].inputs"), &leg.inputs)).collect::<Result<_, _>>()?;
        let named: BTreeSet<Channel> =
            base.iter().chain(legs.iter().flatten()).map(|(channel, _)| *channel).chain(others.iter().copied()).collect();
        let over = |own: &[(Channel, f64)]| {
            let value = |channel: Channel| own.iter().chain(&base).find(|(known, _)| *known == channel).map_or(0.0, |(_, value)| *value);
            named.iter().map(|&channel| (channel, value(channel))).collect()
        };
        if legs.is_empty() {
            return Ok(vec![Stretch { time_s: f64::INFINITY, distance_m: self.distance_m, inputs: over(&[]) }]);
        }
        let stretch = |(leg, own): (&Leg, &Vec<_>)| Stretch {
            time_s: leg.for_s,
            distance_m: leg.distance_m.unwrap_or(self.distance_m),
            inputs: over(own),
        };
        Ok(self.profile.iter().zip(&legs).map(stretch).collect())
    }

    /// Mean power of the work, W, with its deviation: what a leg's power is unsure of, the others'
    /// are too.
    ///
    /// # Errors
    /// When an input is no channel.
    pub fn drain_w(&self, load: &Arc<Model>) -> anyhow::Result<Estimate> {
        let stretches = self.stretches(&[])?;
        if let [only] = &stretches[..] {
            return Ok(power_w(load, &only.inputs));
        }
        let whole_s: f64 = stretches.iter().map(|stretch| stretch.time_s).sum();
        Ok(propagate_loads(load, |model, values| {
            let mut run = Run::with_parameters(Arc::clone(model), values.to_vec(), Start::at_soc(0.0));
            let mut power = |stretch: &Stretch| {
                stretch.inputs.iter().for_each(|&(channel, value)| run.channels[channel] = value);
                run.step(1.0);
                run.channels[Channel::PowerW] * stretch.time_s / whole_s
            };
            stretches.iter().map(&mut power).sum()
        }))
    }
}

#[cfg(test)]
mod tests;
