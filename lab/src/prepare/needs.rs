//! What a model needs of a log, and what of that a log lacks.

use energy::{Channel, Model};

use super::{Missing, predicted_channels};
use crate::measurement::{Log, for_missing};

/// Inputs that a log must hold for this model to predict it, and who needs each.
#[must_use]
pub fn needed_inputs(model: &Model) -> Vec<(Channel, String)> {
    let predicted = predicted_channels(model);
    let computed = |channel: Channel| predicted.contains(&channel) || model.system.computed().contains(&channel);
    let system = model.system.inputs().iter().map(|&channel| (channel, format!("every {} model", model.system.name())));
    let effects =
        model.effects().flat_map(|effect| effect.spec().needs.iter().map(|&channel| (channel, format!("effect `{}`", effect.spec().id))));
    let mut needed: Vec<(Channel, String)> = Vec::new();
    for (channel, by) in system.chain(effects) {
        if !computed(channel) && !needed.iter().any(|(known, _)| *known == channel) {
            needed.push((channel, by));
        }
    }
    needed
}

/// What is needed and not there.
pub(super) fn lacking(log: &Log, needed: Vec<(Channel, String)>, has: impl Fn(Channel) -> bool) -> Vec<Missing> {
    let lacked = needed.into_iter().filter(|(channel, _)| !has(*channel));
    let missing = |(channel, needed_by): (Channel, String)| {
        let (hint, flag) = for_missing(channel.name(), log.columns());
        Missing { channel, needed_by, hint, flag }
    };
    lacked.map(missing).collect()
}

/// What a model needs beside what it is compared with, and a log lacks too, as a further sentence.
pub(super) fn lacked_too(model: &Model, log: &Log) -> String {
    let has = |channel: Channel| log.channels.contains_key(&channel) || channel == Channel::AmbientDegc && log.facts.ambient_degc.is_some();
    let lacked: Vec<&str> = lacking(log, needed_inputs(model), has).iter().map(|one| one.channel.name()).collect();
    if lacked.is_empty() { String::new() } else { format!(" It needs {} too, and has not got it.", lacked.join(", ")) }
}
