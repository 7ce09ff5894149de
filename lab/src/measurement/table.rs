//! What a format delivers: named columns of equal length, and the place of every row.

use std::collections::BTreeMap;
use std::fmt;

use energy::units::{S_PER_DAY, S_PER_H};
use jiff::civil::DateTime;
use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};

/// More different texts than this in one column are no categories but times or messages, which
/// nothing here can use; they would only fill the memory.
const TEXTS_MAX: usize = 10_000;

/// Columns as a format found them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Column names, in the order of the source.
    pub names: Vec<String>,
    /// Cells by column, as many per column as there are lines.
    pub columns: Vec<Cells>,
    /// Place of each row in the source, counted from 1: a line, a message or a database row.
    pub lines: Vec<u64>,
    /// What a place is called, in the plural; `lines` when empty.
    pub places: &'static str,
    /// What the reader should know but that stops nothing.
    pub notes: Vec<String>,
    /// What a fuel gauge that speaks in the log knows of the start.
    pub start: Option<GaugeStart>,
    /// What a row of units says.
    pub units: Option<Units>,
}

/// A row that says the units of columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Units {
    /// Its line.
    pub line: u64,
    /// By column.
    pub of: Vec<String>,
}

/// State of charge at the first row, by a fuel gauge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaugeStart {
    /// State of charge, 0..1.
    pub soc: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

impl Table {
    /// A table of these columns without rows.
    #[must_use]
    pub fn of(names: Vec<String>, places: &'static str) -> Table {
        Table { columns: vec![Cells::default(); names.len()], names, lines: Vec::new(), places, ..Table::default() }
    }

    /// The rows that are kept.
    pub(super) fn with_rows(self, kept: &[bool]) -> Table {
        let lines = self.lines.iter().zip(kept).filter(|(_, kept)| **kept).map(|(&line, _)| line).collect();
        let columns = self.columns.into_iter().map(|cells| cells.with_rows(kept)).collect();
        // A gauge's word is of the first row.
        let start = self.start.filter(|_| kept.first() == Some(&true));
        Table { lines, columns, start, ..self }
    }
}

/// The cells of one column: numbers with NaN where nothing was measured, and beside them the few
/// texts, each kept once.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cells {
    numbers: Vec<f64>,
    /// Row and index into `texts`, in the order of rows.
    at: Vec<(u32, u32)>,
    texts: Vec<String>,
    known: BTreeMap<String, u32>,
    /// Texts that were not kept, since there were too many different ones.
    dropped: usize,
    /// Rows of dates with a time, where the first text is one.
    moments: Vec<(u32, Timestamp)>,
    /// Texts that are none: the first one, and where there are dates as many as are kept of any.
    odd: Vec<(u32, String)>,
}

/// A word or a whole number in a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Label<'a> {
    Text(&'a str),
    Number(i64),
}

impl fmt::Display for Label<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Label::Text(text) => formatter.write_str(text),
            Label::Number(number) => number.fmt(formatter),
        }
    }
}

/// A date with a time as in RFC 3339, or the time since a test began as cyclers write it (`00:00:10`, `1d 02:03:04.5`). A date without a zone
/// is taken as it stands, as if there were no others.
pub(super) fn moment(text: &str) -> Option<Timestamp> {
    text.parse()
        .ok()
        .or_else(|| since_the_start(text))
        .or_else(|| text.parse::<DateTime>().ok()?.to_zoned(TimeZone::UTC).ok().map(|zoned| zoned.timestamp()))
}

/// `[DAYSd ]HOURS:MINUTES:SECONDS`, as if the test had begun at the epoch.
fn since_the_start(text: &str) -> Option<Timestamp> {
    let (days, clock) = text.split_once("d ").unwrap_or(("0", text));
    let [hours, minutes, seconds] = clock.split(':').collect::<Vec<_>>().try_into().ok()?;
    let whole = |text: &str| text.trim().parse::<u32>().ok();
    let seconds: f64 = seconds.replacen(',', ".", 1).parse().ok().filter(|seconds| (0.0..60.0).contains(seconds))?;
    let minutes = whole(minutes).filter(|minutes| *minutes < 60)?;
    let (days, hours) = (f64::from(whole(days)?), f64::from(whole(hours)?));
    let passed = SignedDuration::try_from_secs_f64(days * S_PER_DAY + hours * S_PER_H + f64::from(minutes) * 60.0 + seconds).ok()?;
    Timestamp::UNIX_EPOCH.checked_add(passed).ok()
}

impl Cells {
    /// Appends a number, or NaN where nothing was measured.
    pub fn push(&mut self, number: f64) {
        self.numbers.push(number);
    }

    /// Appends a text.
    pub fn push_text(&mut self, text: &str) {
        let row = u32::try_from(self.numbers.len()).unwrap_or(u32::MAX);
        self.numbers.push(f64::NAN);
        if self.odd.is_empty() || !self.moments.is_empty() {
            match moment(text) {
                Some(moment) => self.moments.push((row, moment)),
                None if self.odd.len() < TEXTS_MAX => self.odd.push((row, text.to_owned())),
                None => {}
            }
        }
        let id = match self.known.get(text) {
            Some(&id) => id,
            None if self.texts.len() >= TEXTS_MAX => {
                self.dropped += 1;
                return;
            }
            None => {
                let id = self.texts.len() as u32;
                self.texts.push(text.to_owned());
                self.known.insert(text.to_owned(), id);
                id
            }
        };
        self.at.push((row, id));
    }

    /// How many cells there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.numbers.len()
    }

    /// Whether there is no cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// The numbers; NaN where there is none.
    #[must_use]
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// The first cell that holds a text, with its row, of the rows that count.
    pub fn first_text(&self, counts: impl Fn(usize) -> bool) -> Option<(usize, &str)> {
        let mut all = self.at.iter().map(|&(row, id)| (row as usize, self.texts[id as usize].as_str()));
        all.find(|(row, _)| counts(*row))
    }

    /// Seconds since the first cell, where all are dates with times; NaN where missing. None where there is none.
    ///
    /// # Errors
    /// The first row and text that is something else, where others are dates.
    pub fn seconds(&self) -> Result<Option<Vec<f64>>, (usize, String)> {
        let Some(&(_, first)) = self.moments.first() else { return Ok(None) };
        let number = self.numbers.iter().position(|number| !number.is_nan()).map(|row| (row, self.numbers[row].to_string()));
        let text = self.odd.first().map(|(row, text)| (*row as usize, text.clone()));
        if let Some(odd) = number.into_iter().chain(text).min_by_key(|(row, _)| *row) {
            return Err(odd);
        }
        let mut seconds = vec![f64::NAN; self.numbers.len()];
        for &(row, moment) in &self.moments {
            seconds[row as usize] = moment.duration_since(first).as_secs_f64();
        }
        Ok(Some(seconds))
    }

    /// Whether so many different texts came that they were not all kept.
    #[must_use]
    pub fn overflowed(&self) -> bool {
        self.dropped > 0
    }

    /// Rows of dates with a time.
    pub(super) fn moments(&self) -> impl Iterator<Item = (usize, Timestamp)> + '_ {
        self.moments.iter().map(|&(row, moment)| (row as usize, moment))
    }

    /// Rows of this text.
    pub(super) fn rows_of_text(&self, text: &str) -> impl Iterator<Item = usize> + '_ {
        let wanted = self.known.get(text).copied();
        self.at.iter().filter(move |(_, id)| Some(*id) == wanted).map(|&(row, _)| row as usize)
    }

    /// The different texts, in the order in which they came.
    pub(super) fn different_texts(&self) -> &[String] {
        &self.texts
    }

    fn with_rows(self, kept: &[bool]) -> Cells {
        let mut kept_before = 0;
        let places: Vec<Option<u32>> = kept
            .iter()
            .map(|&kept| {
                kept_before += u32::from(kept);
                kept.then(|| kept_before - 1)
            })
            .collect();
        let place = |row: u32| places.get(row as usize).copied().flatten();
        let numbers = self.numbers.iter().zip(kept).filter(|(_, kept)| **kept).map(|(&number, _)| number).collect();
        Cells {
            numbers,
            at: self.at.into_iter().filter_map(|(row, id)| Some((place(row)?, id))).collect(),
            moments: self.moments.into_iter().filter_map(|(row, moment)| Some((place(row)?, moment))).collect(),
            odd: self.odd.into_iter().filter_map(|(row, text)| Some((place(row)?, text))).collect(),
            ..self
        }
    }

    /// What each row holds as a label: a text, or a whole number; none where it holds neither.
    pub(super) fn labels(&self) -> impl Iterator<Item = Option<Label<'_>>> {
        let mut texts = self.at.iter().peekable();
        self.numbers.iter().enumerate().map(move |(row, &number)| {
            if let Some(&(_, id)) = texts.next_if(|(at, _)| *at as usize == row) {
                return Some(Label::Text(&self.texts[id as usize]));
            }
            (number.fract() == 0.0).then_some(Label::Number(number as i64))
        })
    }

    /// Every cell as text; missing ones are empty.
    #[must_use]
    pub fn as_texts(&self) -> Vec<String> {
        let number = |number: &f64| if number.is_nan() { String::new() } else { number.to_string() };
        let mut all: Vec<String> = self.numbers.iter().map(number).collect();
        for &(row, id) in &self.at {
            all[row as usize].clone_from(&self.texts[id as usize]);
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_since_a_test_began_are_read_as_cyclers_write_them() {
        let mut cells = Cells::default();
        for text in ["00:00:00", "00:01:10,5", "26:00:00", "1d 02:00:01.00"] {
            cells.push_text(text);
        }
        assert_eq!(cells.seconds().unwrap().unwrap(), [0.0, 70.5, 93_600.0, 93_601.0]);
        for wrong in ["00:61:00", "1:2", "a:b:c", "-1:00:00", "10:00:75"] {
            assert_eq!(moment(wrong), None, "{wrong}");
        }
    }
}
