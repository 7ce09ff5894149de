//! A log: time, canonical channels and whatever else the file holds.

use std::collections::BTreeMap;

use energy::Channel;

use super::charging::{rows_that_charge, sign};
use super::clocks::how_to_write;
use super::facts::misspelt;
use super::hints::odd_epoch;
use super::mapping::Source;
use super::no_time::no_time;
use super::selection::{Selected, select};
use super::spikes::{RUN_ROWS, explaining_step, spikes};
use super::times::{Rows, gaps};
use super::unfollowed::unfollowed;
use super::units::doubts;
use super::unmeasured::{Unmeasured, asked_for, could_be_asked_for, unmeasured};
use super::unread::unread;
use super::values::{count, missing, register_ends, within_range, without_given, without_sentinels};
use super::whose::{begins_another, of_several};
use super::{GapCurrent, LogError, LogFacts, Mark, Table};

/// The column that every log begins with, in seconds.
pub(super) const TIME: &str = "time_s";

/// A column that is not a channel of any system.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// Numbers, NaN where missing.
    Number(Vec<f64>),
    /// At least one cell is text; missing cells are empty.
    Text(Vec<String>),
}

/// One recording.
///
/// The value of an input at row k holds over (t\[k-1\], t\[k\]]; a state such as a voltage is
/// that at t\[k\].
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    /// The file, as the user named it.
    pub file: String,
    /// Short name: the file's stem.
    pub name: String,
    /// Time, s, strictly increasing.
    pub time_s: Vec<f64>,
    /// How many readings of its inputs each row holds the mean of; empty where each holds one.
    pub readings: Vec<f64>,
    /// Which rows are compared; empty where all are. The others lie between those that were asked for.
    pub compared: Vec<bool>,
    /// Canonical channels, NaN where missing.
    pub channels: BTreeMap<Channel, Vec<f64>>,
    /// Pieces of the gaps of a battery's current, in order.
    pub unmeasured: Vec<Unmeasured>,
    /// Further columns.
    pub extra: BTreeMap<String, Column>,
    /// What is known beside the rows.
    pub facts: LogFacts,
    /// What the reader should know but that stops nothing.
    pub notes: Vec<String>,
}

impl Log {
    /// How many rows there are.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.time_s.len()
    }

    /// Names of all columns.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        std::iter::once(TIME).chain(self.channels.keys().map(|channel| channel.name())).chain(self.extra.keys().map(String::as_str))
    }

    /// Applies names, units and the contract of logs to the cells of any format, and notes what
    /// is not as it should be.
    ///
    /// # Errors
    /// Names the line and the column.
    pub fn from_table(file: &str, table: Table, mut facts: LogFacts) -> Result<Log, LogError> {
        let whole = |message: String| LogError::Whole { file: file.to_owned(), message };
        let mapped = facts.columns.iter().map(|mapping| Ok((mapping.canonical.as_str(), mapping.resolve(&table.names)?)));
        let mapped: BTreeMap<&str, Source> = mapped.collect::<Result<_, String>>().map_err(whole)?;
        let Selected { table, compared, is_cut } = select(table, &facts.rows, &mapped).map_err(whole)?;
        let (table, mapped, mut notes) = (&table, &mapped, Vec::new());
        let charges = &rows_that_charge(table, &facts.charging, mapped, &mut notes).map_err(whole)?[..];
        let (compared, missing, places) = (&compared[..], &facts.missing[..], Vec::new());
        let mut reader = Reader { file, table, mapped, compared, charges, missing, notes, places };
        reader.notes.extend(unread(&table.names, mapped, missing));
        let doubted = doubts(table, &facts.columns).map_err(|(line, message)| LogError::Row { file: file.to_owned(), line, message })?;
        reader.notes.extend(doubted);
        let (time_s, rows) = reader.time_s()?;
        let (mut channels, mut extra) = (BTreeMap::new(), BTreeMap::new());
        let own = |index| Source::Column { index, scale: 1.0, offset: 0.0 };
        let unmapped = table.names.iter().enumerate().map(|(index, name)| (name.as_str(), own(index)));
        // Dates that became the time are said by it.
        let dates =
            mapped.get(TIME).and_then(|source| source.column()).filter(|&index| matches!(table.columns[index].seconds(), Ok(Some(_))));
        let unmapped = unmapped.filter(|(name, source)| !mapped.contains_key(name) && (dates.is_none() || source.column() != dates));
        for (name, source) in unmapped.chain(mapped.iter().map(|(&name, &source)| (name, source))) {
            if name == TIME {
                continue;
            }
            match Channel::from_name(name) {
                Some(channel) => {
                    channels.insert(channel, reader.channel(channel, source, &rows)?);
                }
                None => {
                    reader.notes.extend(mapped.get(name).and_then(|_| misspelt(name)));
                    if let Some(column) = reader.any(name, source, &rows) {
                        extra.insert(name.to_owned(), column);
                    }
                }
            }
        }
        reader.tell_spikes(&time_s, &channels);
        let current_a = channels.get(&Channel::CurrentA).filter(|_| facts.gap_current != Some(GapCurrent::Stated));
        let unknown = facts.gap_current == Some(GapCurrent::Unknown) || is_cut && facts.gap_current.is_none();
        let (unmeasured, gaps) = current_a.map_or_else(Default::default, |current_a| unmeasured(&time_s, current_a, unknown));
        reader.notes.extend(asked_for(&unmeasured, gaps));
        reader.notes.extend(current_a.filter(|_| facts.gap_current.is_none()).and_then(|_| could_be_asked_for(&time_s)));
        let mut notes = [table.notes.clone(), reader.notes].concat();
        if let (Some(start), None, None) =
            (table.start.filter(|start| (0.0..=1.0).contains(&start.soc)), facts.soc_initial, facts.rest_voltage_v)
        {
            facts.soc_initial = Some(start.soc);
            facts.soc_initial_sigma = facts.soc_initial_sigma.or(Some(start.sigma));
            notes.push(format!("starts at {:.1} % by the gauge in the log, unless --soc-initial says otherwise", 100.0 * start.soc));
        }
        if facts.ambient_sigma_k.is_some() && facts.ambient_degc.is_none() {
            notes.push("ambient_sigma_k says how well ambient_degc is known, and that is not given: it changes nothing".to_owned());
        }
        let notes = notes.into_iter().map(|note| format!("{file}: {note}")).collect();
        let stem = std::path::Path::new(file).file_stem().map_or_else(|| file.to_owned(), |stem| stem.to_string_lossy().into_owned());
        let compared = if compared.is_empty() { Vec::new() } else { rows.firsts(compared.to_vec()) };
        let (file, readings) = (file.to_owned(), Vec::new());
        Ok(Log { file, name: stem, time_s, readings, compared, channels, unmeasured, extra, facts, notes })
    }
}

struct Reader<'a> {
    file: &'a str,
    table: &'a Table,
    mapped: &'a BTreeMap<&'a str, Source>,
    /// Which rows are compared; empty where all are.
    compared: &'a [bool],
    /// In which rows a current flows into the battery; empty where it has its own sign.
    charges: &'a [bool],
    missing: &'a [Mark],
    /// What the reader should know.
    notes: Vec<String>,
    /// Place in the source of every row of the log.
    places: Vec<u64>,
}

impl Reader<'_> {
    fn row_error(&self, row: usize, message: String) -> LogError {
        LogError::Row { file: self.file.to_owned(), line: self.table.lines[row], message }
    }

    /// Strictly increasing times, and which rows of the source they are.
    fn time_s(&mut self) -> Result<(Vec<f64>, Rows), LogError> {
        let whole = |message: String| LogError::Whole { file: self.file.to_owned(), message };
        let names = &self.table.names;
        let source = match (self.mapped.get(TIME).copied(), names.iter().position(|name| name == TIME)) {
            (Some(source), _) => source,
            (None, Some(0)) => Source::Column { index: 0, scale: 1.0, offset: 0.0 },
            (None, Some(index)) => {
                return Err(whole(format!("`{TIME}` is column {}; it must be the first column, or say --column {TIME}={TIME}", index + 1)));
            }
            (None, None) => {
                return Err(whole(no_time(self.table)));
            }
        };
        if let Some(several) = of_several(self.table, self.mapped) {
            return Err(whole(several));
        }
        let time_s = match self.moments(source)? {
            Some(time_s) => time_s,
            None => self.numbers(TIME, source)?,
        };
        if let Source::Column { index, scale, .. } = source {
            self.notes.extend(odd_epoch(&time_s, &names[index], scale));
        }
        let (rows, note) = Rows::of(&time_s, &self.table.lines, self.table.places).map_err(|(row, message)| {
            let whose = begins_another(self.table, self.mapped, row).map_or_else(String::new, |whose| format!("; {whose}"));
            self.row_error(row, format!("column `{TIME}`: {message}{whose}"))
        })?;
        let time_s = rows.numbers(time_s);
        if time_s.len() < 2 {
            return Err(whole(format!("{} of different time; a log needs at least 2", count(time_s.len(), "row"))));
        }
        self.places = rows.firsts(self.table.lines.clone());
        self.notes.extend(note);
        self.notes.extend(gaps(&time_s, &self.places, self.table.places));
        Ok((time_s, rows))
    }

    /// Seconds since the first row, where times are dates.
    fn moments(&self, source: Source) -> Result<Option<Vec<f64>>, LogError> {
        let Source::Column { index, scale, offset } = source else { return Ok(None) };
        let name = &self.table.names[index];
        let odd =
            |(row, text): (usize, String)| self.row_error(row, format!("column `{name}`: `{text}` is no date with a time, as others are"));
        let seconds = self.table.columns[index].seconds().map_err(odd)?;
        if seconds.is_some() && (scale, offset) != (1.0, 0.0) {
            let message = format!("column `{name}` holds dates with times, which become seconds by themselves: --column {TIME}={name}");
            return Err(LogError::Whole { file: self.file.to_owned(), message });
        }
        Ok(seconds)
    }

    /// A channel's values, with what cannot be a measurement made missing.
    fn channel(&mut self, channel: Channel, source: Source, rows: &Rows) -> Result<Vec<f64>, LogError> {
        let (lines, places) = (&self.table.lines, self.table.places);
        let mut values = self.numbers(channel.name(), source)?;
        if let Source::Column { index, scale, offset } = source {
            without_given(&mut values, &self.marks(channel.name(), index));
            self.notes.extend(missing(channel.name(), &values, lines, places));
            self.notes.extend(without_sentinels(channel.name(), &mut values, lines, places));
            self.notes.extend(register_ends(channel.name(), &values, lines, places));
            values.iter_mut().for_each(|value| *value = *value * scale + offset);
        }
        let from = match source {
            Source::Column { index, .. } => self.table.names[index].as_str(),
            Source::Constant(_) => channel.name(),
        };
        sign(channel, &mut values, self.charges);
        let outside = within_range(channel, from, &mut values, lines, places).map_err(|(row, message)| self.row_error(row, message))?;
        self.notes.extend(outside);
        Ok(rows.numbers(values))
    }

    /// What the logger writes in a column when nothing was measured.
    fn marks(&self, name: &str, index: usize) -> Vec<f64> {
        let names = [name, self.table.names[index].as_str()];
        self.missing.iter().filter(|mark| mark.is_of(names)).map(|mark| mark.value).collect()
    }

    fn tell_spikes(&mut self, time_s: &[f64], channels: &BTreeMap<Channel, Vec<f64>>) {
        let input = channels.get(&Channel::CurrentA).or(channels.get(&Channel::PackCurrentA));
        let explains = input.map(|input| (input, explaining_step(input)));
        for (&channel, values) in channels {
            // An input that is missing may have done anything.
            let step = |input: &[f64], row: usize| (input[row] - input[row - 1]).abs();
            let moves = |row: usize| explains.is_some_and(|(input, least)| step(input, row).is_nan() || step(input, row) > least);
            // What the logger wrote is known for sure where it is of our unit, or nothing.
            let as_written = |value: f64| match self.mapped.get(channel.name()) {
                Some(Source::Column { scale, offset, .. }) if (*scale, *offset) != (1.0, 0.0) => *offset == 0.0 && value == 0.0,
                _ => true,
            };
            // A voltage of some rows may be the answer to a current that nobody measured.
            let is_unexplained = explains.is_none() && matches!(channel, Channel::VoltageV | Channel::PackVoltageV);
            let longest = if is_unexplained { 1 } else { RUN_ROWS };
            self.notes.extend(spikes((channel, values), (time_s, longest), moves, as_written, (&self.places, self.table.places)));
        }
        for pair in [(Channel::CurrentA, Channel::VoltageV), (Channel::PackCurrentA, Channel::PackVoltageV)] {
            if let (Some(current_a), Some(voltage_v)) = (channels.get(&pair.0), channels.get(&pair.1)) {
                self.notes.extend(unfollowed((pair.0, current_a), (pair.1, voltage_v), &self.places, self.table.places));
            }
        }
    }

    /// A column's numbers as the source wrote them; for time also in the unit of the log.
    fn numbers(&self, name: &str, source: Source) -> Result<Vec<f64>, LogError> {
        let (index, scale, offset) = match source {
            Source::Column { index, scale, offset } => (index, scale, offset),
            Source::Constant(value) => return Ok(vec![value; self.table.lines.len()]),
        };
        let cells = &self.table.columns[index];
        // What another kind of row holds was not asked for.
        let counts = |row: usize| self.compared.get(row).copied().unwrap_or(true);
        if let Some((row, text)) = cells.first_text(counts) {
            let from = &self.table.names[index];
            let via = if from == name { String::new() } else { format!(" (made from `{from}`)") };
            let nor = match name {
                TIME => format!(", nor a date with a time such as 2026-03-01T10:00:00Z{}", how_to_write(text)),
                _ => String::new(),
            };
            return Err(self.row_error(row, format!("column `{name}`{via}: `{text}` is not a number{nor}")));
        }
        let mut values = cells.numbers().to_vec();
        if name == TIME {
            values.iter_mut().for_each(|value| *value = *value * scale + offset);
        }
        Ok(values)
    }

    fn any(&mut self, name: &str, source: Source, rows: &Rows) -> Option<Column> {
        let (index, scale, offset) = match source {
            Source::Column { index, scale, offset } => (index, scale, offset),
            Source::Constant(value) => return Some(Column::Number(rows.numbers(vec![value; self.table.lines.len()]))),
        };
        let cells = &self.table.columns[index];
        if cells.overflowed() {
            self.notes.push(format!("`{name}`: too many different texts to be of use; the column is left out"));
            return None;
        }
        if cells.first_text(|_| true).is_some() {
            return Some(Column::Text(rows.firsts(cells.as_texts())));
        }
        let marks = self.marks(name, index);
        let value = |&value: &f64| if marks.contains(&value) { f64::NAN } else { value * scale + offset };
        Some(Column::Number(rows.numbers(cells.numbers().iter().map(value).collect())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::{Mapping, read_log};

    fn read(text: &str, columns: &[&str]) -> Result<Log, String> {
        let columns: Vec<Mapping> = columns.iter().map(|text| text.parse().unwrap()).collect();
        let facts = LogFacts { columns, missing: vec![(-9999.0).into()], ..LogFacts::default() };
        read_log("dir/a.csv", text.as_bytes(), facts).map_err(|error| error.to_string())
    }

    #[test]
    fn channels_extras_gaps_and_units_find_their_place() {
        let log =
            read("time_s,temp_K,current_a,floor\n0,298.15,1,mud\n5,-9999,,grass\n60,300.15,2,\n", &["temperature_degc=temp_K*1-273.15"]);
        let log = log.unwrap();
        assert_eq!(log.name, "a");
        assert_eq!(log.time_s, [0.0, 5.0, 60.0]);
        let degc = &log.channels[&Channel::TemperatureDegc];
        assert!((degc[0] - 25.0).abs() < 1e-9 && degc[1].is_nan() && (degc[2] - 27.0).abs() < 1e-9);
        assert!(log.channels[&Channel::CurrentA][1].is_nan());
        assert_eq!(log.extra["floor"], Column::Text(vec!["mud".to_owned(), "grass".to_owned(), String::new()]));
        assert!(log.extra.contains_key("temp_K"));
    }

    #[test]
    fn dates_with_times_become_seconds() {
        let times = |[first, second, third]: [&str; 3], column: &str| {
            let log = read(&format!("when,a\n{first},1\n{second},1\n{third},1\n"), &[column]);
            log.inspect(|log| assert!(log.extra.keys().eq(["a"]))).map(|log| log.time_s)
        };
        let column = "time_s=when";
        // Offsets count, a leap day too, and spaces do for the T.
        let dated = times(["2024-02-28T23:59:59Z", "2024-02-29 01:00:00.25+01:00", "2024-03-01T00:00:00Z"], column);
        assert_eq!(dated.unwrap(), [0.0, 1.25, 86_401.0]);
        let without_a_zone = times(["2026-03-29 01:59:59", "2026-03-29 03:00:00", "2026-03-29 03:00:01"], column);
        assert_eq!(without_a_zone.unwrap(), [0.0, 3601.0, 3602.0]);
        let error = |rows, column| times(rows, column).unwrap_err();
        let odd = error(["2024-03-01T10:00:00Z", "2024-03-01T10:00:01Z", "noon"], column);
        assert_eq!(odd, "dir/a.csv:4: column `when`: `noon` is no date with a time, as others are");
        let number = error(["2024-03-01T10:00:00Z", "5", "2024-03-01T10:00:01Z"], column);
        assert_eq!(number, "dir/a.csv:3: column `when`: `5` is no date with a time, as others are");
        let neither = error(["10:00", "10:01", "10:02"], column);
        assert!(neither.ends_with("`10:00` is not a number, nor a date with a time such as 2026-03-01T10:00:00Z"), "{neither}");
        assert!(error(["1/3/2024 10:00:00"; 3], column).ends_with("nothing else tells which number is the day"));
        let scaled = error(["2024-03-01T10:00:00Z", "2024-03-01T10:00:01Z", "2024-03-01T10:00:02Z"], "time_s=when/1000");
        assert!(scaled.ends_with("which become seconds by themselves: --column time_s=when"), "{scaled}");
        let backwards = error(["2024-03-01T10:00:00Z", "2024-03-01T09:59:59Z", "2024-03-01T10:00:01Z"], column);
        assert_eq!(backwards, "dir/a.csv:3: column `time_s`: time goes backwards: -1 s after 0 s");
        assert!(error(["2024-03-01T10:00:00Z", "", "2024-03-01T10:00:01Z"], column).contains("every row needs a time"));
    }

    #[test]
    fn a_number_can_stand_for_a_column() {
        let log = read("time_s,current_a\n0,1\n1,1\n", &["cycle_count=120"]).unwrap();
        assert_eq!(log.channels[&Channel::CycleCount], [120.0, 120.0]);
    }

    #[test]
    fn a_doubt_about_surroundings_that_are_not_stated_is_told_to_change_nothing() {
        let noted = |ambient_degc| {
            let facts = LogFacts { ambient_degc, ambient_sigma_k: Some(1.0), ..LogFacts::default() };
            read_log("a.csv", b"time_s,current_a\n0,1\n1,1\n", facts).unwrap().notes
        };
        let note = "a.csv: ambient_sigma_k says how well ambient_degc is known, and that is not given: it changes nothing";
        assert_eq!((noted(None), noted(Some(20.0))), (vec![note.to_owned()], Vec::new()));
    }

    #[test]
    fn text_in_a_number_names_file_line_and_column() {
        let error = read("time_s,voltage_v\n0,4.1\n1,low\n", &[]).unwrap_err();
        assert_eq!(error, "dir/a.csv:3: column `voltage_v`: `low` is not a number");
        let error = read("time_s,u\n0,4.1\n1,low\n", &["voltage_v=u"]).unwrap_err();
        assert_eq!(error, "dir/a.csv:3: column `voltage_v` (made from `u`): `low` is not a number");
    }

    #[test]
    fn time_must_come_first_and_increase() {
        assert_eq!(read("time_s\n0\n2\n1\n", &[]).unwrap_err(), "dir/a.csv:4: column `time_s`: time goes backwards: 1 s after 2 s");
        assert!(read("time_s\n0\n0\n", &[]).unwrap_err().contains("1 row of different time; a log needs at least 2"));
        assert!(read("time_s,a\n0,1\n,1\n", &[]).unwrap_err().contains("every row needs a time"));
        assert!(read("time,a\n0,1\n1,1\n", &[]).unwrap_err().contains("--column time_s=time"));
        assert!(read("a,time_s\n0,1\n1,2\n", &[]).unwrap_err().contains("must be the first column"));
        assert!(read("time_s,a\n0,1\n", &[]).unwrap_err().contains("at least 2"));
        assert!(read("t_ms,a\n0,1\n1000,1\n", &["time_s=t_ms/1000"]).is_ok());
    }
}
