//! What a station has to hand out to robots.

use energy::Estimate;
use node::wire;
use proto::SpareId;

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
