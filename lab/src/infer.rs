//! Which effect is missing: evidence for every effect that a model lacks, with all that is only
//! roughly known taken into account.
//!
//! ```text
//!   rough      what a model knows roughly: OCV table, sensors' offsets and gains, SoC at the start
//!     |
//!   evidence   the rows that are judged, alone or in means
//!     |          judges   which held-out logs can judge a model
//!     |          steady   over which of them the inputs hold
//!     |          course   as few steps as show them
//!     |          floors   what a model makes of its inputs' noise
//!     |
//!   frame      model, logs and rough knowledge as one vector of unknowns; predictions, derivatives
//!     |            noise   the sensors' known floor beside a slow part of unknown size
//!     v              v
//!   lens       rows and derivatives in units of independent noise, and what a refit absorbs
//!     |
//!   state      the best unknowns and noise for one list of effects, and the evidence for it
//!     |          descent    the way there
//!     |          starts     where a log may have begun
//!     |          delays     how late a sensor may be
//!     |          other_starts  and whether that alone explains them all
//!     |          other_numbers  or one number that the model states
//!     |          stated     or all that it states roughly, within their deviations
//!     |          certainty  how well the numbers are known; uneven  where rows do not all err alike
//!     |          count      what the noise of a current adds up to
//!     |          told       the numbers that are told and written
//!     |          dilution   without what the noise of inputs does to them
//!     |
//!   candidate  absent effects, the shapes that their equations can take, what keeps one from a test
//!     |
//!   score      each of them without a refit: expected size, uniqueness, what it is confused with
//!     |
//!   sketch     the promising ones refitted on coarser evidence
//!     |          handover   another effect in the place of the best one
//!     |
//!   trial      the best of them refitted on all of it
//!     |
//!   judge      accepted or not, also by logs that the fit has not seen
//!     |          anew   once more from the beginning, where the best leaves something
//!     |
//!   look       at every absent effect: what is missing, and what the logs cannot tell from it
//!     v
//!   discover   one after the other until the model is complete, or nothing explains what is left
//!     |          prune   effects that a later one made needless
//!     |          exchange   effects that stood in for another one
//!     |          undecided  what the logs cannot tell from what was found, at the end
//!     |          progress   what is told while it goes on
//!     |
//!   answer       all of that in numbers and names, for the terminal, JSON and the report
//!
//!   propose    when nothing of the catalogue explains what is left: a formula, as a proposal
//!              periodic   at another phase in every log
//!              switch     what comes and goes at times that no formula says
//! ```
//!
//! Nothing here knows any effect by name.

mod anew;
pub mod answer;
pub mod calibrate;
pub mod candidate;
pub(crate) mod certainty;
mod count;
mod course;
mod delays;
mod descent;
mod dilution;
pub mod discover;
pub mod evidence;
mod exchange;
pub mod floors;
pub mod frame;
mod handover;
pub mod judge;
pub mod judges;
mod lens;
pub mod look;
pub mod noise;
pub mod other_numbers;
pub mod other_starts;
pub mod progress;
pub mod propose;
mod prune;
pub mod rough;
pub mod score;
mod segment;
mod sketch;
mod starts;
pub mod state;
pub mod stated;
mod steady;
mod told;
pub mod trial;
mod undecided;
mod uneven;
mod walk;
