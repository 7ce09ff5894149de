//! Why a way does not fit.

use crate::problem::Tick;

/// What a way asks for that is not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Clash {
    /// All bays are taken in this tick.
    Bay(Tick),
    /// The lift is taken in this tick.
    Lift(Tick),
    /// The place for exchanges is taken in this tick.
    Slot(Tick),
    /// No charged spare of this kind is left in this tick.
    Spare(Tick, u16),
    /// The station would draw more than it may in this tick, by so much.
    Power(Tick, i64),
    /// The packs that are there before this tick are so much short.
    Energy(Tick, i64),
}
