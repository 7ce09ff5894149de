//! What a station's agent must not forget when it is restarted, and how it goes on from there.

use std::collections::VecDeque;

use node::{Ledger, wire};
use proto::{BayId, BayPhase, CommandId, PackId, RobotId, SpareState};
use serde::{Deserialize, Serialize};

use super::{Agent, Output, Swapping};
use crate::source::{Act, Lifted};

/// What survives a restart. Gauges are not part of it: the chips that count go on counting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    ledger: Ledger,
    bays: Vec<(BayId, BayPhase, Option<RobotId>)>,
    spares: Vec<SpareState>,
    lifts: VecDeque<Lifted>,
    lifting: bool,
    swapping: Option<Swapping>,
    last_command: Option<CommandId>,
    /// Packs that gave out and were not charged since, and what their devices said of their charge then: at rest their voltage is back.
    #[serde(default)]
    depleted: Vec<(PackId, Option<proto::Estimate>)>,
}

/// What is compared to see whether a new memory is due.
pub(super) type Sketch = (Vec<(BayPhase, Option<RobotId>)>, Vec<bool>, usize, bool, Option<Swapping>, Vec<bool>);

impl Memory {
    /// Packs that had given out, and what their devices said of their charge then.
    #[must_use]
    pub fn depleted(&self) -> Vec<(PackId, Option<energy::Estimate>)> {
        let said = |soc: proto::Estimate| energy::Estimate::new(soc.value, soc.sigma);
        self.depleted.iter().map(|(pack, soc)| (pack.clone(), soc.map(said))).collect()
    }
}

impl Agent {
    /// Goes on from what was kept. To be called before the first input. Bays and spares that are no
    /// longer configured are left out, new ones are as configured.
    pub fn restore(&mut self, memory: Memory) {
        for (id, said_soc) in memory.depleted() {
            if let Some(pack) = self.packs.iter_mut().find(|pack| pack.id == id) {
                (pack.depleted, pack.said_soc) = (true, said_soc);
            }
        }
        self.ledger = memory.ledger;
        for bay in &mut self.bays {
            if let Some((_, phase, robot)) = memory.bays.iter().find(|(id, ..)| *id == bay.id) {
                // Somebody may have looked after a bay that was out of order; if nobody has, it will show.
                let held = if robot.is_some() { BayPhase::Occupied } else { BayPhase::Free };
                (bay.phase, bay.robot) = (if *phase == BayPhase::Failed { held } else { *phase }, robot.clone());
            }
        }
        for spare in &mut self.spares {
            if let Some(known) = memory.spares.iter().find(|known| known.spare == spare.spare) {
                // One that is measured is told by its device: it may have been exchanged meanwhile.
                let ready = spare.ready && known.ready;
                *spare = SpareState { ready, ..known.clone() };
            }
        }
        (self.lifts, self.lifting) = (memory.lifts, memory.lifting);
        (self.swapping, self.last_command) = (memory.swapping, memory.last_command);
        self.restored = true;
        self.kept = Some(self.sketch());
    }

    fn sketch(&self) -> Sketch {
        let bays = self.bays.iter().map(|bay| (bay.phase, bay.robot.clone())).collect();
        let spares = self.spares.iter().map(|spare| spare.ready).collect();
        let depleted = self.packs.iter().map(|pack| pack.depleted).collect();
        (bays, spares, self.lifts.len(), self.lifting, self.swapping.clone(), depleted)
    }

    /// Asks for what has changed to be kept, before anybody hears of it and before anything moves.
    pub(super) fn keep(&mut self) {
        let sketch = self.sketch();
        if self.kept.as_ref() == Some(&sketch) {
            return;
        }
        self.kept = Some(sketch);
        let memory = Memory {
            ledger: self.ledger.clone(),
            bays: self.bays.iter().map(|bay| (bay.id.clone(), bay.phase, bay.robot.clone())).collect(),
            spares: self.spares.clone(),
            lifts: self.lifts.clone(),
            lifting: self.lifting,
            swapping: self.swapping.clone(),
            last_command: self.last_command.clone(),
            depleted: self.packs.iter().filter(|pack| pack.depleted).map(|pack| (pack.id.clone(), pack.said_soc.map(wire))).collect(),
        };
        self.outputs.retain(|output| !matches!(output, Output::Keep(_)));
        self.outputs.push_front(Output::Keep(Box::new(memory)));
    }

    /// After a restart, nothing moves: what was kept as begun had not begun, and is begun now.
    pub(super) fn begin_again(&mut self) {
        self.restored = false;
        self.lifting = false;
        if let Some((robot, spare)) = self.swapping.clone() {
            self.outputs.push_back(Output::Act(Act::Swap { robot, spare }));
        }
    }
}
