//! The journal told to a core again: it must decide what was decided.
//!
//! The same for the live store's journal (`coordinator replay`) and the simulator's.

use std::collections::BTreeMap;

use proto::{PackId, RobotId, StationId, Timestamp};

use crate::core::{Core, Input};
use crate::outbox::Outbox;
use crate::store::{Heard, Record, What};

/// A core that is told what another was told.
pub struct Replay {
    core: Core,
    outbox: Outbox,
    told: u64,
    made: Vec<Record>,
}

/// How much of a decision that differs is shown, characters.
const SHOWN: usize = 300;

impl Replay {
    /// Begins with a core as it was at the start of that epoch.
    #[must_use]
    pub fn new(core: Core, epoch: u64) -> Self {
        Self { core, outbox: Outbox::new(epoch), told: 0, made: Vec::new() }
    }

    /// Tells it one thing more.
    ///
    /// # Errors
    /// When lines of the journal are missing before this one.
    pub fn tell(&mut self, heard: &Heard, input: Input) -> Result<(), String> {
        self.told += 1;
        if heard.number != self.told {
            return Err(format!("epoch {}: inputs {} to {} are not in the journal", heard.epoch, self.told, heard.number - 1));
        }
        self.outbox.handle(&mut self.core, heard.at, input);
        self.outbox.take_commands();
        // The core runs by itself what nobody ran beside it.
        self.outbox.take_studies();
        self.made.extend(self.outbox.take_records().into_iter().filter(Record::is_decision));
        Ok(())
    }

    /// How many things it was told.
    #[must_use]
    pub fn told(&self) -> u64 {
        self.told
    }

    /// Compares its decisions with those kept, each kind in order; how many were the same. What packs
    /// can service and why follows from the same beliefs, and is not compared.
    ///
    /// # Errors
    /// The first difference.
    pub fn compare(&self, kept: &[Record]) -> Result<usize, String> {
        let mut same = 0;
        for kind in [Record::is_event as fn(&Record) -> bool, Record::is_command, Record::is_plan] {
            let mut own = self.made.iter().filter(|record| kind(record));
            for record in kept.iter().filter(|record| kind(record)) {
                match own.next() {
                    Some(mine) if mine == record => same += 1,
                    mine => {
                        let mine = mine.map_or_else(|| "nothing".to_owned(), brief);
                        return Err(format!("the journal has\n  {}\nthe core decides\n  {mine}", brief(record)));
                    }
                }
            }
            if let Some(more) = own.next() {
                return Err(format!("the core decides what is not in the journal:\n  {}", brief(more)));
            }
        }
        Ok(same)
    }

    /// The core as it is now.
    #[must_use]
    pub fn into_core(self) -> Core {
        self.core
    }
}

fn brief(record: &Record) -> String {
    format!("{record:?}").chars().take(SHOWN).collect()
}

/// Makes inputs of journal lines and the telemetry that they point to.
#[derive(Default)]
pub struct Inputs {
    gauges: BTreeMap<(RobotId, Timestamp, u64), proto::Gauge>,
    states: BTreeMap<(RobotId, Timestamp, u64), proto::RobotState>,
    pack_gauges: BTreeMap<(StationId, PackId, Timestamp, u64), proto::Gauge>,
    station_states: BTreeMap<(StationId, Timestamp, u64), proto::StationState>,
}

impl Inputs {
    /// With the telemetry among these records.
    #[must_use]
    pub fn of<'a>(records: impl IntoIterator<Item = &'a Record>) -> Self {
        let mut inputs = Self::default();
        for record in records {
            inputs.add(record.clone());
        }
        inputs
    }

    /// Adds a record; all but telemetry is passed over.
    pub fn add(&mut self, record: Record) {
        match record {
            Record::RobotGauge { robot, gauge } => drop(self.gauges.insert((robot, gauge.at, gauge.seq), gauge)),
            Record::RobotState { robot, state } => drop(self.states.insert((robot, state.at, state.seq), state)),
            Record::PackGauge { station, pack, gauge } => drop(self.pack_gauges.insert((station, pack, gauge.at, gauge.seq), gauge)),
            Record::StationState { station, state } => drop(self.station_states.insert((station, state.at, state.seq), state)),
            _ => {}
        }
    }

    /// The input that a line stands for.
    ///
    /// # Errors
    /// When the telemetry that it points to is not there.
    pub fn input(&mut self, heard: &Heard) -> Result<Input, String> {
        let gone =
            || format!("input {} of epoch {}: its telemetry is no longer in the journal: {:?}", heard.number, heard.epoch, heard.what);
        Ok(match heard.what.clone() {
            What::Nothing => Input::Nothing,
            What::Tick => Input::Tick,
            What::Studied => Input::Studied,
            What::RobotAlive(robot, alive) => Input::RobotAlive(robot, alive),
            What::StationAlive(station, alive) => Input::StationAlive(station, alive),
            What::Reply(reply) => Input::Reply(reply),
            What::Replan(why) => Input::Replan(why),
            What::Refused(text) => Input::Refused(text),
            What::RobotGauge(robot, at, seq) => {
                Input::RobotGauge(robot.clone(), self.gauges.get(&(robot, at, seq)).cloned().ok_or_else(gone)?)
            }
            What::RobotState(robot, at, seq) => {
                Input::RobotState(robot.clone(), self.states.get(&(robot, at, seq)).cloned().ok_or_else(gone)?)
            }
            What::StationState(station, at, seq) => {
                Input::StationState(station.clone(), self.station_states.get(&(station, at, seq)).cloned().ok_or_else(gone)?)
            }
            What::PackGauge(station, pack, at, seq) => {
                let gauge = self.pack_gauges.get(&(station.clone(), pack.clone(), at, seq)).cloned().ok_or_else(gone)?;
                Input::PackGauge(station, pack, gauge)
            }
        })
    }
}
