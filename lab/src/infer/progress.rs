//! What a search tells while it goes on, for who waits for it.

use energy::Channel;

use super::look::Step;
use super::state::State;

/// Where a search stands.
#[derive(Debug, Clone, PartialEq)]
pub enum Progress {
    /// The model so far explains so much; whatever was told before is replaced.
    Stands {
        /// What was found, in order, with the RMS that is left after each on the logs that were fitted, by channel.
        found: Vec<Rung>,
        /// The same with the model as it was given, fitted.
        given: Vec<(Channel, f64)>,
    },
    /// Every absent effect is asked for what it promises.
    Asking,
    /// An absent effect is tried beside it.
    Trying {
        /// The effect.
        effect: &'static str,
        /// The how many-th of those that are absent.
        number: usize,
        /// How many are absent.
        of: usize,
    },
    /// An effect that did well on coarser evidence is refitted on all of it.
    Refitting {
        /// The effect.
        effect: &'static str,
    },
    /// What was found is gone through: whether all of it is needed, and whether something else does better in its place.
    Reviewing,
}

impl Progress {
    /// A model with what was found on the way to it.
    pub(super) fn stands(given: &State, steps: &[Step]) -> Progress {
        let rung = |step: &Step| Rung { effect: step.trials[0].spec.id, left: step.trials[0].state.told().rms() };
        Progress::Stands { found: steps.iter().map(rung).collect(), given: given.told().rms() }
    }
}

/// One effect that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Rung {
    /// The effect.
    pub effect: &'static str,
    /// What is left with it, by channel.
    pub left: Vec<(Channel, f64)>,
}

/// Who is told.
pub type Told<'a> = &'a dyn Fn(Progress);

/// Nobody is.
pub fn silent(_: Progress) {}
