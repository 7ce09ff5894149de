//! No bay and no spare is issued twice: a book of what lifts and exchanges really began.

use std::collections::{BTreeMap, BTreeSet};

use proto::{BayId, RobotId, SpareId, StationId, Timestamp};
use station_agent::source::{Act, Observation};

use super::moment;

/// Who is in which bay, or on a lift to it, and which spares are used up.
#[derive(Debug, Default)]
pub(in crate::sim) struct Issue {
    bays: BTreeMap<(StationId, BayId), RobotId>,
    spent: BTreeMap<(StationId, SpareId), RobotId>,
    swapping: BTreeSet<RobotId>,
    pub(super) found: Vec<String>,
}

impl Issue {
    /// A station's machinery begins something.
    pub(in crate::sim) fn begins(&mut self, at: Timestamp, station: &StationId, act: &Act) {
        match act {
            Act::Lift(lift) if lift.into => {
                let place = (station.clone(), lift.bay.clone());
                let elsewhere = self.bays.iter().find(|(known, robot)| **robot == lift.robot && **known != place);
                if let Some(((other, bay), _)) = elsewhere {
                    self.found.push(format!(
                        "{}: {} is taken into {} of {station}, but has {bay} of {other}",
                        moment(at),
                        lift.robot,
                        lift.bay
                    ));
                }
                if let Some(holder) = self.bays.insert(place, lift.robot.clone()).filter(|holder| *holder != lift.robot) {
                    self.found.push(format!("{}: {} of {station} is issued to {}, but {holder} has it", moment(at), lift.bay, lift.robot));
                }
            }
            Act::Lift(lift) => {
                if self.bays.get(&(station.clone(), lift.bay.clone())) != Some(&lift.robot) {
                    self.found.push(format!("{}: {} is let out of {} of {station}, where it is not", moment(at), lift.robot, lift.bay));
                }
            }
            Act::Swap { robot, spare } => {
                self.swapping.insert(robot.clone());
                // Begun again after a restart: the same robot for the same spare.
                if let Some(holder) = self.spent.insert((station.clone(), spare.clone()), robot.clone()).filter(|holder| holder != robot) {
                    self.found.push(format!("{}: {spare} of {station} is issued to {robot}, but {holder} has it", moment(at)));
                }
            }
            Act::Select { .. } => {}
        }
    }

    /// What a station's machinery has done.
    pub(in crate::sim) fn ended(&mut self, at: Timestamp, station: &StationId, seen: &Observation) {
        if let Some(lift) = seen.lifted.as_ref().filter(|lift| !lift.into) {
            self.bays.remove(&(station.clone(), lift.bay.clone()));
        }
        if let Some(swapped) = &seen.swapped
            && !self.swapping.remove(&swapped.robot)
        {
            self.found.push(format!("{}: {} got a second pack for one exchange", moment(at), swapped.robot));
        }
        for (spare, _) in &seen.charged {
            self.spent.remove(&(station.clone(), spare.clone()));
        }
    }
}
