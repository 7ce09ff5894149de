//! The scene of a case before anything is hidden in it: a true model, what the lab believes of
//! it, the scripts of its logs, and a specimen of its sensors.

pub mod battery;
pub mod robot;
pub mod station;

use energy::{Channel, Sensor, System, find};

use crate::draft::{Draft, Part};
use crate::random::Stream;
use crate::world::Script;

/// A scene.
#[derive(Debug, Clone)]
pub struct Setting {
    /// The base model with its true numbers.
    pub truth: Draft,
    /// The base model as the lab gets it.
    pub believed: Draft,
    /// What happens in each log.
    pub scripts: Vec<Script>,
    /// Sensors as they are stated.
    pub sensors: Vec<(Channel, Sensor)>,
}

/// Logs that are made poorer on purpose, so that they cannot tell two things from each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Poor {
    /// Every log at one age and one count of cycles.
    pub one_age: bool,
    /// Age and cycles follow each other.
    pub age_follows_cycles: bool,
    /// Every log at one temperature.
    pub one_temperature: bool,
    /// Robot: camera and radio are on together. Station: every bay is always taken.
    pub together: bool,
}

/// What a setting is made for.
#[derive(Debug, Clone, Default)]
pub struct Wish {
    /// Effects that will be hidden: the base has none of them and everything that they need.
    pub hidden: Vec<&'static str>,
    /// The lab's OCV table is the true one.
    pub exact_ocv: bool,
    /// Logs that lack something.
    pub poor: Poor,
    /// Effects of the base, if the case prescribes them.
    pub base: Option<&'static [&'static str]>,
    /// The base's parameters are known.
    pub all_known: bool,
}

/// How far believed values of free parameters lie from the truth, as a share.
const BELIEVED_SHARE: f64 = 0.1;

/// What the lab believes of true parts: free numbers lie beside the truth.
fn believed(system: System, parts: &[Part], random: &mut Stream) -> Vec<Part> {
    let mut parts = parts.to_vec();
    for part in &mut parts {
        let (_, effect) = find(system, part.id).expect("parts are of the catalogue");
        for value in part.values.iter_mut().filter(|value| value.free) {
            let spec = effect.spec().parameters.iter().find(|spec| spec.name == value.name).expect("checked when drafted");
            value.value = (value.value * (1.0 + BELIEVED_SHARE * random.normal().clamp(-2.0, 2.0))).clamp(spec.min, spec.max);
        }
    }
    parts
}
