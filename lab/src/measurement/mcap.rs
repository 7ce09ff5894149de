//! MCAP recordings with `sensor_msgs/msg/BatteryState` of ROS 2. A place in such a log is the
//! number of the message within its topic.
//!
//! A stream may hold several files one after the other: a recording of rosbag2 that was split.
//!
//! ROS counts a current that leaves the battery negative, and writes NaN for what is not measured.

use std::collections::BTreeMap;
use std::io::{self, BufRead};

use energy::document::hint;
use energy::units::S_PER_H;
use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use proto::ros2::{BatteryState, TYPE, check_definition, decimal, decode};

use super::limits::{check_bytes, check_cells, read_error};
use super::{Cells, Format, GaugeStart, LogError, LogFacts, Table};

pub(super) const FORMAT: Format = Format { name: "MCAP", extensions: &["mcap"], parse };

/// Bytes that one record may have: pictures are far smaller, and nothing here needs more.
const RECORD_MAX: usize = 256 << 20;
/// Cells of one pack that get a column.
const CELLS_MAX: usize = 64;
/// What a robot's own gauge is taken to know its charge to, when it does not say.
const GAUGE_SIGMA: f64 = 0.05;
/// Charge that may flow before the gauge first speaks, as a share of the capacity: a fifth of its deviation.
const LITTLE_SOC: f64 = 0.01;
/// The time in which as much flows at the capacity an hour, s, where no message tells the capacity.
const LITTLE_S: f64 = 36.0;

/// A topic of the recording.
struct Topic {
    name: String,
    kind: String,
    encoding: String,
    /// What is wrong with its definition.
    wrong: Option<String>,
    messages: u64,
}

/// What has been read so far.
struct Reading<'a> {
    file: &'a str,
    wanted: Option<&'a str>,
    /// Of the present file, by its numbers.
    schemas: BTreeMap<u16, (String, Vec<u8>)>,
    /// Of the present file, by its numbers: the name of the topic.
    channels: BTreeMap<u16, String>,
    /// Of all files.
    topics: BTreeMap<String, Topic>,
    /// The topic that is read: the wanted one, or the first of batteries.
    chosen: Option<String>,
    rows: Rows,
}

fn parse(file: &str, input: &mut dyn BufRead, facts: &LogFacts) -> Result<Table, LogError> {
    let wanted = facts.topic.as_deref();
    let mut reading = Reading {
        file,
        wanted,
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        topics: BTreeMap::new(),
        chosen: wanted.map(str::to_owned),
        rows: Rows::new(),
    };
    let (mut bytes, mut cut_off) = (0, false);
    loop {
        cut_off |= reading.one_file(input, &mut bytes)?;
        if cut_off || input.fill_buf().map_err(|error| read_error(file, &error))?.is_empty() {
            break;
        }
    }
    reading.check_choice()?;
    let mut table = reading.rows.table();
    if cut_off {
        table.notes.push(format!("the recording was not closed; read are the {} messages up to its end", table.lines.len()));
    }
    Ok(table)
}

/// Reads until the buffer is full or the input ends.
fn fill(input: &mut dyn BufRead, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match input.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(read) => filled += read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

impl Reading<'_> {
    fn whole(&self, message: String) -> LogError {
        LogError::Whole { file: self.file.to_owned(), message }
    }

    /// Reads to the end of a file; whether that was not where its end should be.
    fn one_file(&mut self, input: &mut dyn BufRead, bytes: &mut u64) -> Result<bool, LogError> {
        self.schemas.clear();
        self.channels.clear();
        let mut reader = LinearReader::new_with_options(LinearReaderOptions::default().with_record_length_limit(RECORD_MAX));
        while let Some(event) = reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(need)) => {
                    let read = fill(input, reader.insert(need)).map_err(|error| read_error(self.file, &error))?;
                    *bytes += read as u64;
                    check_bytes(self.file, *bytes)?;
                    reader.notify_read(read);
                }
                Ok(LinearReadEvent::Record { data, opcode }) => self.take(opcode, data)?,
                // A recorder that was killed leaves what it had written.
                Err(McapError::UnexpectedEof | McapError::UnexpectedEoc) if !self.rows.time_ns.is_empty() => return Ok(true),
                Err(error) => return Err(self.whole(format!("not readable as MCAP: {error}"))),
            }
        }
        Ok(false)
    }

    fn take(&mut self, opcode: u8, data: &[u8]) -> Result<(), LogError> {
        use mcap::records::op::{CHANNEL, MESSAGE, SCHEMA};
        if ![SCHEMA, CHANNEL, MESSAGE].contains(&opcode) {
            return Ok(());
        }
        match mcap::parse_record(opcode, data).map_err(|error| self.whole(format!("not readable as MCAP: {error}")))? {
            Record::Schema { header, data } => {
                let definition = if header.name == TYPE { data.into_owned() } else { Vec::new() };
                self.schemas.insert(header.id, (header.name, definition));
            }
            Record::Channel(channel) => {
                let (kind, definition) = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let wrong = check_definition(&String::from_utf8_lossy(&definition)).err();
                let new = Topic { name: channel.topic.clone(), kind, encoding: channel.message_encoding, wrong, messages: 0 };
                self.topics.entry(channel.topic.clone()).or_insert(new);
                self.channels.insert(channel.id, channel.topic);
            }
            Record::Message { header, data } => {
                let file = self.file;
                let broken = |message: u64, what: String| LogError::Row { file: file.to_owned(), line: message, message: what };
                let topic = self.channels.get(&header.channel_id).and_then(|name| self.topics.get_mut(name));
                let Some(topic) = topic else { return Ok(()) };
                topic.messages += 1;
                if topic.kind != TYPE || self.chosen.get_or_insert_with(|| topic.name.clone()) != &topic.name {
                    return Ok(());
                }
                let number = self.rows.time_ns.len() as u64 + 1;
                if topic.encoding != "cdr" {
                    return Err(broken(number, format!("topic {} is encoded as `{}`, not `cdr` (ROS 2)", topic.name, topic.encoding)));
                }
                if let Some(wrong) = &topic.wrong {
                    return Err(broken(number, format!("topic {}: {wrong}", topic.name)));
                }
                let message = decode(&data).map_err(|error| broken(number, format!("topic {}: {error}", topic.name)))?;
                self.rows.push(&message, header.log_time);
                check_cells(file, &self.rows.cells)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Whether it is clear which topic was meant.
    fn check_choice(&self) -> Result<(), LogError> {
        let mut batteries: Vec<&str> = self.topics.values().filter(|topic| topic.kind == TYPE).map(|topic| topic.name.as_str()).collect();
        batteries.sort_unstable();
        let all = || {
            let one = |topic: &Topic| format!("{} ({}, {} messages)", topic.name, topic.kind, topic.messages);
            self.topics.values().map(one).collect::<Vec<_>>().join(", ")
        };
        match (self.wanted, batteries.as_slice()) {
            (_, []) => Err(self
                .whole(format!("no topic of type {TYPE}. Its topics: {}", if self.topics.is_empty() { "none".to_owned() } else { all() }))),
            (Some(wanted), known) if !known.contains(&wanted) => {
                let near = hint(wanted, known.iter().copied());
                Err(self.whole(format!("--topic {wanted}: no such topic of type {TYPE}{near} Its topics: {}", all())))
            }
            (None, [_, _, ..]) => {
                Err(self.whole(format!("several topics of type {TYPE}; choose one with --topic: {}", batteries.join(", "))))
            }
            _ if self.rows.time_ns.is_empty() => Err(self.whole("its battery topic holds no message".to_owned())),
            _ => Ok(()),
        }
    }
}

/// Messages on their way to a table.
struct Rows {
    /// By the sender's clock; 0 where it said nothing.
    stamp_ns: Vec<i64>,
    /// By the recorder's clock.
    time_ns: Vec<u64>,
    cells: Table,
    absent: Vec<u64>,
    /// Capacity that the first message tells: what the pack holds now, or what it was made for.
    capacity_ah: Option<f64>,
}

/// Columns, in the order of [`Rows::push`]; those of the cells follow.
const COLUMNS: [&str; 7] = ["time_s", "current_a", "voltage_v", "temperature_degc", "soc", "charge_ah", "power_supply_status"];

impl Rows {
    fn new() -> Rows {
        let names = COLUMNS.iter().map(|&name| name.to_owned()).collect();
        Rows { stamp_ns: Vec::new(), time_ns: Vec::new(), cells: Table::of(names, "messages"), absent: Vec::new(), capacity_ah: None }
    }

    fn push(&mut self, message: &BatteryState, log_time_ns: u64) {
        self.stamp_ns.push(message.header.stamp.unix_ns().unwrap_or(0));
        self.time_ns.push(log_time_ns);
        let number = self.time_ns.len() as u64;
        if number == 1 {
            let told = [message.capacity, message.design_capacity].map(decimal);
            self.capacity_ah = told.into_iter().find(|&capacity_ah| capacity_ah > 0.0);
            for cell in 1..=message.cell_voltage.len().min(CELLS_MAX) {
                self.cells.names.push(format!("cell_{cell}_v"));
                self.cells.columns.push(Cells::default());
            }
        }
        self.cells.lines.push(number);
        if !message.present {
            self.absent.push(number);
        }
        let own = [
            f64::NAN,
            0.0 - decimal(message.current),
            decimal(message.voltage),
            decimal(message.temperature),
            decimal(message.percentage),
            decimal(message.charge),
            f64::from(message.power_supply_status),
        ];
        let cells = message.cell_voltage.iter().map(|&volts| decimal(volts)).chain(std::iter::repeat(f64::NAN));
        for (column, value) in self.cells.columns.iter_mut().zip(own.into_iter().chain(cells)) {
            column.push(if message.present { value } else { f64::NAN });
        }
    }

    /// The table: times from the first message on, without columns that were never measured.
    fn table(self) -> Table {
        let Rows { stamp_ns, time_ns, mut cells, absent, capacity_ah } = self;
        let stamped = stamp_ns.iter().all(|&ns| ns != 0);
        let since = |row: usize| {
            if stamped {
                stamp_ns[row].saturating_sub(stamp_ns[0]) as f64
            } else {
                (i128::from(time_ns[row]) - i128::from(time_ns[0])) as f64
            }
        };
        let mut time_s = Cells::default();
        (0..time_ns.len()).for_each(|row| time_s.push(since(row) / 1e9));
        cells.columns[0] = time_s;
        if !stamped {
            cells.notes.push("the sender did not stamp its messages; times are those of the recorder".to_owned());
        }
        if !absent.is_empty() {
            cells.notes.push(format!("no battery was present: taken as missing ({})", super::some_places("messages", &absent)));
        }
        let columns = [0, 1, 4].map(|column: usize| cells.columns[column].numbers());
        match start(columns, capacity_ah) {
            Ok(start) => cells.start = start,
            Err(number) => cells.notes.push(format!(
                "its gauge first tells a charge in message {number}, and what flowed before that is not little or not known: the log does not say \
                 how full it begins"
            )),
        }
        let measured = |column: &Cells| column.numbers().iter().any(|value| value.is_finite());
        let keep: Vec<bool> = cells.columns.iter().map(measured).collect();
        let mut kept = keep.iter();
        cells.names.retain(|_| *kept.next().unwrap_or(&true));
        let mut kept = keep.iter();
        cells.columns.retain(|_| *kept.next().unwrap_or(&true));
        cells
    }
}

/// What the gauge says of the start, by its first word if little has flowed until then.
///
/// # Errors
/// The message of its first word, where that came too late.
fn start([time_s, current_a, soc]: [&[f64]; 3], capacity_ah: Option<f64>) -> Result<Option<GaugeStart>, u64> {
    let Some(first) = soc.iter().position(|soc| !soc.is_nan()) else { return Ok(None) };
    let passed = |row: usize| current_a[row] * (time_s[row] - time_s[row - 1]) / S_PER_H;
    let flowed_ah = (1..=first).map(passed).sum::<f64>().abs();
    let is_little = match capacity_ah {
        // A current that was not measured makes no sum.
        Some(capacity_ah) if !flowed_ah.is_nan() => flowed_ah <= LITTLE_SOC * capacity_ah,
        _ => time_s[first] - time_s[0] <= LITTLE_S,
    };
    if first > 0 && !is_little {
        return Err(first as u64 + 1);
    }
    Ok(Some(GaugeStart { soc: soc[first], sigma: GAUGE_SIGMA }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gauge_that_speaks_late_says_how_full_a_log_begins_only_if_little_has_flowed() {
        let time_s: Vec<f64> = (0..200).map(f64::from).collect();
        let told = |late: usize, amps: f64, capacity_ah: Option<f64>| {
            let soc: Vec<f64> = (0..200).map(|row| if row < late { f64::NAN } else { 0.5 }).collect();
            start([&time_s, &[amps; 200], &soc], capacity_ah).map(|start| start.map(|start| start.soc))
        };
        assert_eq!(told(0, 2.0, None), Ok(Some(0.5)));
        assert_eq!(told(200, 2.0, None), Ok(None));
        // 18 s at 2 A are a hundredth of an ampere-hour.
        assert_eq!((told(18, 2.0, Some(1.0)), told(19, 2.0, Some(1.0))), (Ok(Some(0.5)), Err(20)));
        assert_eq!(told(150, 0.0, Some(1.0)), Ok(Some(0.5)));
        // A current that is not known for a moment leaves the time.
        assert_eq!((told(36, f64::NAN, Some(1.0)), told(37, f64::NAN, Some(1.0))), (Ok(Some(0.5)), Err(38)));
        assert_eq!((told(36, 2.0, None), told(37, 2.0, None)), (Ok(Some(0.5)), Err(38)));
    }
}
