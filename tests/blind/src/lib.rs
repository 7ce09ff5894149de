//! Blind benchmark of the lab: worlds with a hidden effect, and a scorer that knows the truth.
//!
//! ```text
//!   plan          which things are hidden, how often, how large          (fixed list)
//!     |
//!   setting/      a true model, what the lab believes of it, the scripts of its logs   (drawn by seed)
//!   hide, foreign/, electrochemical     what is hidden, sized by what `refit` says is left of it
//!     |
//!   world         what truly happens        gauge   what the sensors show of it
//!     v
//!   make ──> Case: base model + logs for the lab, Truth for the scorer
//!
//!   ask           the one call of the lab          run     many cases, with their times
//!   answer        the lab's JSON contract      score   one answer against the truth
//!   tally, table  rates with their Wilson intervals, as Markdown and JSON
//! ```
//!
//! The lab sees the base model and the logs only. Everything that decides what is right stands in
//! this crate and shares no code with the lab's inference: [`refit`] finds by its own least squares
//! how much of a hidden effect a refit of the base leaves, [`stand_in`] by the same which others do as well where logs
//! cannot tell, [`class`] says which effects count as one, and why.
//!
//! Every seed gives the same case for ever. Development uses the seeds from
//! [`plan::DEVELOPMENT_SEED`] on; the table in `lab/README.md` uses those from
//! [`plan::PUBLISHED_SEED`] on. Never tune on the published seeds, and never look into their cases.

pub mod answer;
pub mod ask;
pub mod case;
pub mod class;
pub mod draft;
pub mod electrochemical;
pub mod foreign;
pub mod gauge;
pub mod hide;
pub mod make;
pub mod plan;
pub mod random;
pub mod refit;
pub mod run;
pub mod score;
pub mod setting;
pub mod stand_in;
pub mod table;
pub mod tally;
pub mod told;
pub mod world;

pub use answer::Answer;
pub use ask::{Ask, Question, ask};
pub use case::{Bin, Case, CaseLog, Hidden, Kind, Leaves, Right, Truth};
pub use make::make;
pub use plan::{Entry, plan};
pub use run::{Choice, Outcome, run};
pub use score::{Mark, judge};
pub use tally::{tally, with_formulas};
