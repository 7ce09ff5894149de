//! How a robot notices that another pack was put in.
//!
//! Most often its agent was without power meanwhile, or its gauge was silent for so long that it begins anew. Where both stay powered,
//! what the device says of the charge shows it: in an exchange it rises, and nothing else makes it rise while nothing charges.

use energy::Estimate;
use proto::RobotPhase;

use super::Agent;
use crate::source::Observation;

/// A charge that has risen by less may be the old pack's that rests: a guess, some times what gauges by the voltage gain then.
const RISE_SOC: f64 = 0.05;
/// And by less than so many of its standard deviations says nothing.
const RISE_SIGMAS: f64 = 2.0;

impl Agent {
    /// The charge of another pack, if this shows that one was put in. What comes between the two, such as 0 from a gauge without a pack,
    /// is none; nor is a pack that is no fuller than the one before, of which nobody can tell.
    #[must_use]
    pub fn put_in(&self, seen: &Observation) -> Option<Estimate> {
        let risen = || seen.said_soc.filter(|is| self.phase == RobotPhase::Swapping && self.has_risen(*is).unwrap_or(false));
        seen.exchanged.or_else(risen)
    }

    /// Whether what a gauge begins anew with is another pack. Gauges begin anew when their agent is restarted, or heard nothing for a
    /// while, too: while the old pack is in, or half out. Where nothing is known of the charge before, it is taken for another.
    pub(super) fn is_another(&self, seen: &Observation) -> bool {
        let says = seen.said_soc.or(seen.exchanged);
        says.and_then(|is| self.has_risen(is)).unwrap_or(true)
    }

    /// Whether this is more charge than there was before the exchange, beyond what either may be off by; none where nothing is known of it.
    fn has_risen(&self, is: Estimate) -> Option<bool> {
        let was = self.said_soc?;
        Some(is.value - was.value > (RISE_SIGMAS * was.sigma.hypot(is.sigma)).max(RISE_SOC))
    }

    /// Goes back to work with the other pack, once nothing of the station is at it any more.
    pub(super) fn leave_after_exchange(&mut self) {
        if self.phase == RobotPhase::Swapping && self.pack_seen && !self.is_still_exchanged() {
            self.resume();
        }
    }

    /// Takes in what the device says of the charge, until an exchange is on.
    pub(super) fn remember_said(&mut self, seen: &Observation) {
        if self.phase != RobotPhase::Swapping || self.said_soc.is_none() {
            self.said_soc = seen.said_soc.or(self.said_soc);
        }
    }
}
