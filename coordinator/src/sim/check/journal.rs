//! The journal replays to the same decisions: a core that is told the same says the same.

use crate::core::Core;
use crate::models::{Models, Settings};
use crate::replay::{Inputs, Replay};
use crate::sim::disk::Reign;

/// The first difference between what a coordinator kept and what a core does that is told the same.
pub(in crate::sim) fn replays(settings: Settings, models: &Models, reign: &Reign) -> Result<Core, String> {
    let core = Core::new(settings, models.clone(), reign.numbering);
    let mut replay = Replay::new(core, reign.numbering.epoch);
    let mut inputs = Inputs::of(&reign.records);
    for heard in reign.heard() {
        replay.tell(heard, inputs.input(heard)?)?;
    }
    replay.compare(&reign.records, u64::MAX)?;
    Ok(replay.into_core())
}
