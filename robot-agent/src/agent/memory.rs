//! What a robot's agent must not forget when it is restarted, and how it finds itself again.

use node::Ledger;
use proto::{BayId, CommandId, RobotPhase, StationId};
use serde::{Deserialize, Serialize};

use super::{Agent, Output};
use crate::source::{Act, Observation, Place};

/// Who is at work after a restart goes on after this, s: what feeds a robot counts as a bay after ten seconds.
const SETTLES_S: f64 = 15.0;
/// And not at all where nothing is heard of it for so long, s.
const GIVES_UP_S: f64 = 60.0;

/// What a restarted agent still has to find out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Restored {
    /// Where the robot stands.
    Now,
    /// Whether the robot that is at work by all that is known stands on a charger.
    AtWork,
}

/// What survives a restart. The gauge is not part of it: the chip that counts goes on counting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    ledger: Ledger,
    phase: RobotPhase,
    station: Option<StationId>,
    bay: Option<BayId>,
    target_soc: Option<f64>,
    last_command: Option<CommandId>,
    /// What the device said last of the charge before an exchange.
    #[serde(default)]
    said_soc: Option<proto::Estimate>,
    /// Whether another pack was seen in the robot, until the exchange is over.
    #[serde(default)]
    pack_seen: bool,
}

/// What is compared to see whether a new memory is due.
pub(super) type Sketch = (RobotPhase, Option<StationId>, Option<BayId>, Option<f64>, bool);

impl Memory {
    /// Where the robot stands by what was kept; nothing where it may have been moving.
    #[must_use]
    pub fn place(&self) -> Option<Place> {
        use RobotPhase::{Charged, Charging, Docked, Stranded, Swapping, Travelling, Waiting, Working};
        match self.phase {
            Waiting | Swapping => Some(Place::AtStation),
            Docked | Charging | Charged => Some(Place::InBay),
            Working | Travelling | Stranded => None,
        }
    }
}

impl Agent {
    /// Goes on from what was kept. To be called before the first input.
    pub fn restore(&mut self, memory: Memory) {
        let Memory { ledger, phase, station, bay, target_soc, last_command, said_soc, pack_seen } = memory;
        self.ledger = ledger;
        (self.phase, self.station, self.bay, self.target_soc, self.last_command) = (phase, station, bay, target_soc, last_command);
        self.said_soc = said_soc.map(|soc| energy::Estimate::new(soc.value, soc.sigma));
        self.pack_seen = pack_seen;
        self.restored = Some(Restored::Now);
        self.kept = Some(self.sketch());
    }

    fn sketch(&self) -> Sketch {
        (self.phase, self.station.clone(), self.bay.clone(), self.target_soc, self.pack_seen)
    }

    /// Asks for what has changed to be kept, before anybody hears of it and before the robot moves.
    pub(super) fn keep(&mut self) {
        let sketch = self.sketch();
        if self.kept.as_ref() == Some(&sketch) {
            return;
        }
        self.kept = Some(sketch);
        let memory = Memory {
            ledger: self.ledger.clone(),
            phase: self.phase,
            station: self.station.clone(),
            bay: self.bay.clone(),
            target_soc: self.target_soc,
            last_command: self.last_command.clone(),
            said_soc: self.said_soc.map(|soc| proto::Estimate::new(soc.value, soc.sigma)),
            pack_seen: self.pack_seen,
        };
        self.outputs.retain(|output| !matches!(output, Output::Keep(_)));
        self.outputs.push_front(Output::Keep(Box::new(memory)));
    }

    /// After a restart: what was kept may not have been done yet, or the robot was moved meanwhile.
    pub(super) fn find_itself(&mut self, observation: &Observation) {
        use RobotPhase::{Charged, Charging, Docked, Swapping, Travelling, Waiting, Working};
        let place = observation.place;
        let at_work = self.phase == Working && place == Place::Mission && !observation.powered;
        match self.restored.take() {
            None => return,
            Some(Restored::Now) if !at_work => {}
            // It may have been plugged in while nobody looked: what feeds it shows only in time.
            Some(_) if at_work && self.passed_s < GIVES_UP_S && (self.passed_s < SETTLES_S || self.last.is_none()) => {
                self.restored = Some(Restored::AtWork);
                return;
            }
            // Its way back to work ended with the agent, and nobody knows whether it was done: who is at work already does it once more.
            Some(_) if at_work && self.last.is_some() => return self.resume(),
            Some(_) => return,
        }
        match (self.phase, place, self.station.clone()) {
            (Travelling, Place::Mission, Some(station)) => {
                let bay = self.bay.clone();
                self.outputs.push_back(Output::Act(Act::TravelTo { station, bay }));
            }
            // What was asked of it there may not have been begun. Where it stands already it stays.
            (Waiting, Place::AtStation, Some(station)) if self.bay.is_some() => {
                let bay = self.bay.clone();
                self.outputs.push_back(Output::Act(Act::GoOnTo { station, bay }));
            }
            (Working, Place::Underway | Place::AtStation, _) | (Waiting | Docked | Charging | Charged | Swapping, Place::Mission, _) => {
                self.resume();
            }
            (Charging, Place::InBay, _) => self.outputs.push_back(Output::Act(Act::Charge)),
            (Docked | Charged, Place::InBay, _) => self.outputs.push_back(Output::Act(Act::StopCharging)),
            _ => {}
        }
    }
}
