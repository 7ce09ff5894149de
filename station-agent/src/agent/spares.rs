//! What a station has to hand out to robots.

use device::UNKNOWN_SOC;
use energy::Estimate;
use node::wire;
use proto::{RobotId, SpareId};

use super::Agent;
use crate::source::Swapped;

impl Agent {
    /// Takes in that an exchange has ended. What the robot gave lies in the place of its spare, and is none before it is charged.
    pub(super) fn exchanged(&mut self, swapped: Option<Swapped>) {
        let own = |swapped: &Swapped| self.swapping.as_ref() == Some(&(swapped.robot.clone(), swapped.spare.clone()));
        if let Some(Swapped { spare, given_soc, .. }) = swapped.filter(own) {
            self.swapping = None;
            self.lie_there(vec![(spare, given_soc)], false);
        }
    }

    /// Takes in that an exchange cannot be done. What is in the place of its spare is not known any more: something is wrong with it.
    pub(super) fn called_off(&mut self, called_off: Option<(RobotId, SpareId)>) {
        if let Some((_, spare)) = called_off.filter(|ended| self.swapping.as_ref() == Some(ended)) {
            self.swapping = None;
            self.lie_there(vec![(spare, UNKNOWN_SOC)], false);
        }
    }

    /// Takes in what lies in the places of spares, and whether it can be handed out. One that is being handed out is not there any more.
    pub(super) fn lie_there(&mut self, seen: Vec<(SpareId, Estimate)>, ready: bool) {
        for (id, soc) in seen {
            let is_given = self.swapping.as_ref().is_some_and(|(_, given)| *given == id);
            if let Some(spare) = self.spares.iter_mut().find(|spare| spare.spare == id && !is_given) {
                (spare.soc, spare.ready) = (wire(soc), ready);
            }
        }
    }
}
