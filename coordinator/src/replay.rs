//! The journal told to a core again: it must decide what was decided.
//!
//! The same for the live store's journal (`coordinator replay`) and the simulator's.

use std::collections::BTreeMap;

use proto::{Doubt, Event, EventKind, PackId, RobotId, Schedule, StationId, Timestamp};

use crate::core::{Core, Input};
use crate::outbox::Outbox;
use crate::store::{Heard, Record, What};
use crate::watch::BEFORE_COMMAND;

/// A core that is told what another was told.
pub struct Replay {
    core: Core,
    outbox: Outbox,
    told: u64,
    /// Its decisions, each with the number of the input that it followed.
    made: Vec<(u64, Record)>,
}

/// How much of a decision that differs is shown, characters, and how much of it before the difference.
const SHOWN: usize = 300;
const SHOWN_BEFORE: usize = 100;

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
        let decided = self.outbox.take_records().into_iter().filter(Record::is_decision);
        self.made.extend(decided.map(|record| (heard.number, record)));
        Ok(())
    }

    /// How many things it was told.
    #[must_use]
    pub fn told(&self) -> u64 {
        self.told
    }

    /// Compares its decisions with those kept, each kind in order; how many were the same. What packs
    /// can service and why follows from the same beliefs, and is not compared. Those kept hold at least what followed
    /// the inputs up to `whole`; they may hold less than it was told, when a coordinator still writes.
    ///
    /// # Errors
    /// The first difference.
    pub fn compare(&self, kept: &[Record], whole: u64) -> Result<usize, String> {
        let mut same = 0;
        for kind in [Record::is_event as fn(&Record) -> bool, Record::is_command, Record::is_plan] {
            let mut own = self.made.iter().filter(|(_, record)| kind(record));
            for record in kept.iter().filter(|record| kind(record)) {
                match own.next() {
                    Some((_, mine)) if alike(mine, record) => same += 1,
                    mine => {
                        let (kept, mine) = apart(&said(record), &mine.map_or_else(|| "nothing".to_owned(), |(_, mine)| said(mine)));
                        return Err(format!("the journal has\n  {kept}\nthe core decides\n  {mine}"));
                    }
                }
            }
            if let Some((_, more)) = own.next().filter(|(number, _)| *number <= whole) {
                return Err(format!("the core decides what is not in the journal:\n  {}", apart(&said(more), "").0));
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

/// Whether two decisions are the same, but for where what to run about a doubted model finds files.
fn alike(mine: &Record, kept: &Record) -> bool {
    let same_text = |a: &str, b: &str| {
        let head = |text: &str| text.split(BEFORE_COMMAND).next().map(str::to_owned);
        head(a) == head(b)
    };
    match (mine, kept) {
        (Record::Event(mine), Record::Event(kept)) if mine.kind == EventKind::ModelDoubted => {
            same_text(&mine.text, &kept.text) && Event { text: kept.text.clone(), ..mine.clone() } == *kept
        }
        (Record::Plan(mine), Record::Plan(kept)) if mine.doubts.len() == kept.doubts.len() => {
            let doubts = mine.doubts.iter().zip(&kept.doubts).map(|(mine, kept)| match same_text(&mine.text, &kept.text) {
                true => Doubt { text: kept.text.clone(), command: kept.command.clone(), ..mine.clone() },
                false => mine.clone(),
            });
            mine == kept || Schedule { doubts: doubts.collect(), ..Schedule::clone(mine) } == **kept
        }
        _ => mine == kept,
    }
}

fn said(record: &Record) -> String {
    format!("{record:?}")
}

/// Two texts about where they differ.
fn apart(a: &str, b: &str) -> (String, String) {
    let same = a.chars().zip(b.chars()).take_while(|(a, b)| a == b).count();
    let from = if same + SHOWN_BEFORE < SHOWN { 0 } else { same - SHOWN_BEFORE };
    let part = |text: &str| {
        let shown: String = text.chars().skip(from).take(SHOWN).collect();
        let (before, after) = (if from > 0 { "... " } else { "" }, if text.chars().count() > from + SHOWN { " ..." } else { "" });
        format!("{before}{shown}{after}")
    };
    (part(a), part(b))
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
            What::Before(schedule) => Input::Before(schedule),
            What::RobotAlive(robot, alive) => Input::RobotAlive(robot, alive),
            What::StationAlive(station, alive) => Input::StationAlive(station, alive),
            What::Reply(reply) => Input::Reply(reply),
            What::Replan(why) => Input::Replan(why),
            What::Forget(robot) => Input::Forget(robot),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_shown_where_they_differ() {
        let long = |end: &str| format!("{}{end}", "a".repeat(1000));
        let (one, other) = apart(&long("1"), &long("2"));
        assert_eq!(one, format!("... {}1", "a".repeat(SHOWN_BEFORE)));
        assert_eq!(other, format!("... {}2", "a".repeat(SHOWN_BEFORE)));
        assert_eq!(apart("short", "nothing"), ("short".to_owned(), "nothing".to_owned()));
        assert!(apart(&long(""), "").0.ends_with("a ..."));
    }
}
