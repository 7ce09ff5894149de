//! Which rows of a log are read: those of a cycle or a step of a test, or a stretch of time.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use energy::document::hint;
use jiff::Timestamp;
use serde::de::{self, Deserialize, Deserializer};

use super::Table;
use super::log::{Log, TIME};
use super::mapping::Source;
use super::table::{Cells, moment};
use super::thin::thousands;
use super::times::short;
use super::whose::says_whose;

/// What is shown of a column in which no row is as asked for.
const SHOWN: usize = 6;

/// What a column must hold in every row that is read.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// The column, by the name that a mapping gives it, and then in its unit, or by the logger's.
    pub column: String,
    wanted: Wanted,
    /// As the user wrote it.
    text: String,
}

#[derive(Debug, Clone, PartialEq)]
enum Wanted {
    /// This number or text.
    Same(String),
    /// A number within these, both included.
    Numbers(f64, f64),
    /// A date within these, both included.
    Dates(Option<Timestamp>, Option<Timestamp>),
}

impl FromStr for Selection {
    type Err = String;

    fn from_str(text: &str) -> Result<Selection, String> {
        let wrong = || "write COLUMN=VALUE or COLUMN=FROM..TO, for example cycle=3, step=5..7 or time_s=3600..".to_owned();
        let (column, value) = text.split_once('=').map(|(column, value)| (column.trim(), value.trim())).ok_or_else(wrong)?;
        if column.is_empty() || value.is_empty() {
            return Err(wrong());
        }
        let wanted = match value.split_once("..").map(|(from, to)| (from.trim(), to.trim())) {
            None => Wanted::Same(value.to_owned()),
            Some(("", "")) => return Err(wrong()),
            Some((from, to)) => range(from, to).ok_or_else(wrong)?,
        };
        let is_empty = match &wanted {
            Wanted::Same(_) => false,
            Wanted::Numbers(from, to) => from > to,
            Wanted::Dates(from, to) => from.zip(*to).is_some_and(|(from, to)| from > to),
        };
        if is_empty {
            return Err(format!("{value}: begins after it ends"));
        }
        Ok(Selection { column: column.to_owned(), wanted, text: format!("{column}={value}") })
    }
}

fn range(from: &str, to: &str) -> Option<Wanted> {
    let number = |text: &str, open: f64| if text.is_empty() { Some(open) } else { text.parse().ok().filter(|value: &f64| !value.is_nan()) };
    if let (Some(from), Some(to)) = (number(from, f64::NEG_INFINITY), number(to, f64::INFINITY)) {
        return Some(Wanted::Numbers(from, to));
    }
    let date = |text: &str| if text.is_empty() { Some(None) } else { moment(text).map(Some) };
    Some(Wanted::Dates(date(from)?, date(to)?))
}

impl fmt::Display for Selection {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.text)
    }
}

impl<'de> Deserialize<'de> for Selection {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Selection, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}

impl Selection {
    /// Which rows are as asked for.
    ///
    /// # Errors
    /// Where there is no such column, or none.
    fn rows(&self, table: &Table, mapped: &BTreeMap<&str, Source>) -> Result<Vec<bool>, String> {
        let rows = self.marks(table, mapped)?;
        if rows.contains(&true) { Ok(rows) } else { Err(self.no_row(table, mapped)) }
    }

    /// The same, where there may be none.
    pub(super) fn marks(&self, table: &Table, mapped: &BTreeMap<&str, Source>) -> Result<Vec<bool>, String> {
        let (cells, scale, offset) = self.column(table, mapped)?;
        let numbers = || cells.numbers().iter().map(|number| number * scale + offset);
        Ok(match &self.wanted {
            Wanted::Same(text) => {
                let number = text.parse::<f64>().ok();
                let mut rows: Vec<bool> = numbers().map(|value| Some(value) == number).collect();
                cells.rows_of_text(text).for_each(|row| rows[row] = true);
                rows
            }
            Wanted::Numbers(from, to) => numbers().map(|value| (*from..=*to).contains(&value)).collect(),
            Wanted::Dates(from, to) => {
                let mut rows = vec![false; cells.len()];
                let within = |date: Timestamp| from.is_none_or(|from| from <= date) && to.is_none_or(|to| date <= to);
                cells.moments().filter(|&(_, date)| within(date)).for_each(|(row, _)| rows[row] = true);
                rows
            }
        })
    }

    /// That no row is as asked for, with what there is.
    pub(super) fn no_row(&self, table: &Table, mapped: &BTreeMap<&str, Source>) -> String {
        let holds = self.column(table, mapped).map_or_else(
            |_| "nothing".to_owned(),
            |(cells, scale, offset)| held(cells, cells.numbers().iter().map(|number| number * scale + offset)),
        );
        format!("{self}: no row is like that; `{}` holds {holds}", self.column)
    }

    /// Its column, and what makes our unit of its numbers.
    fn column<'t>(&self, table: &'t Table, mapped: &BTreeMap<&str, Source>) -> Result<(&'t Cells, f64, f64), String> {
        let own = |index| Source::Column { index, scale: 1.0, offset: 0.0 };
        let of_logger = || table.names.iter().position(|name| *name == self.column).map(own);
        match mapped.get(self.column.as_str()).copied().or_else(of_logger) {
            Some(Source::Column { index, scale, offset }) => Ok((&table.columns[index], scale, offset)),
            Some(Source::Constant(_)) => Err(format!("{self}: `{}` is the same number in every row", self.column)),
            None => {
                let near = hint(&self.column, table.names.iter().map(String::as_str));
                Err(format!("{self}: the log has no column `{}`{near} Its columns: {}", self.column, table.names.join(", ")))
            }
        }
    }
}

/// What a column holds, in words.
fn held(cells: &Cells, numbers: impl Iterator<Item = f64>) -> String {
    let (low, high) =
        numbers.filter(|number| !number.is_nan()).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    let texts = cells.different_texts();
    let shown = texts.iter().take(SHOWN).map(|text| format!("`{text}`")).collect::<Vec<_>>().join(", ");
    let more = if texts.len() > SHOWN { " and others" } else { "" };
    match (low <= high, texts.is_empty()) {
        (true, true) => format!("{} to {}", short(low), short(high)),
        (true, false) => format!("{} to {}, and {shown}{more}", short(low), short(high)),
        (false, false) => shown + more,
        (false, true) => "nothing".to_owned(),
    }
}

/// Rows that are read belong to one recording with those between them where on average at least so many follow each other: columns that
/// tell several recordings apart, such as a cell's number, change with every row. A guess.
const RUN: usize = 3;
/// The rows that were asked for.
pub(super) struct Selected {
    /// They, and with them those that lie between: what flowed then is part of the same recording.
    pub(super) table: Table,
    /// Which of these rows were asked for; nothing where all were.
    pub(super) compared: Vec<bool>,
    /// Whether rows between them were left out, so that nobody knows what flowed then.
    pub(super) is_cut: bool,
}

/// The rows of a table that are as asked for in every respect.
pub(super) fn select(table: Table, selections: &[Selection], mapped: &BTreeMap<&str, Source>) -> Result<Selected, String> {
    if selections.is_empty() {
        return Ok(Selected { table, compared: Vec::new(), is_cut: false });
    }
    let mut kept = vec![true; table.lines.len()];
    for selection in selections {
        let rows = selection.rows(&table, mapped)?;
        kept.iter_mut().zip(rows).for_each(|(kept, row)| *kept &= row);
    }
    let asked = selections.iter().map(Selection::to_string).collect::<Vec<_>>().join(" and ");
    let rows = kept.iter().filter(|&&kept| kept).count();
    if rows == 0 {
        return Err(format!("{asked}: each is so in some rows, but not all in one"));
    }
    let mut note = format!("{} of {} rows are read, those with {asked}", thousands(rows), thousands(kept.len()));
    let begin_again = begin_again(&kept);
    let of_one = !selections.iter().any(|selection| says_whose(&selection.column));
    let between = if of_one { between(&table, &kept, begin_again, mapped) } else { vec![false; kept.len()] };
    let read: Vec<bool> = kept.iter().zip(&between).map(|(kept, between)| *kept || *between).collect();
    let followed = between.iter().filter(|between| **between).count();
    if followed > 0 {
        note += &format!("; {} between them are followed, since what flows in them counts, and not compared", thousands(followed));
    }
    let is_cut = begin_again > 0 && followed == 0;
    if is_cut {
        note += "; those between them are left out as another recording's, and what flowed then is not known";
    }
    let mut table = table.with_rows(&read);
    table.notes.push(note);
    let compared = kept.iter().zip(&read).filter(|(_, read)| **read).map(|(kept, _)| *kept).collect();
    Ok(Selected { table, compared: if followed > 0 { compared } else { Vec::new() }, is_cut })
}

impl Log {
    /// Whether what was measured in a row is compared, or only what flowed in it counts.
    #[must_use]
    pub fn compares(&self, row: usize) -> bool {
        self.compared.get(row).copied().unwrap_or(true)
    }

    /// How many rows are compared.
    #[must_use]
    pub fn rows_compared(&self) -> usize {
        (0..self.rows()).filter(|&row| self.compares(row)).count()
    }
}

/// How often rows that were asked for begin again after others.
fn begin_again(kept: &[bool]) -> usize {
    let from = kept.iter().position(|kept| *kept).unwrap_or_default();
    kept[from..].windows(2).filter(|pair| !pair[0] && pair[1]).count()
}

/// Rows between those that were asked for, where all of them are one recording; none where they are not.
fn between(table: &Table, kept: &[bool], begin_again: usize, mapped: &BTreeMap<&str, Source>) -> Vec<bool> {
    let ends = kept.iter().position(|kept| *kept).zip(kept.iter().rposition(|kept| *kept));
    let are_one = |&(first, last): &(usize, usize)| {
        let is_in_runs = kept.iter().filter(|kept| **kept).count() >= RUN * (begin_again + 1);
        let in_order = |time_s: &[f64]| time_s[first..=last].windows(2).all(|pair| pair[0] <= pair[1]);
        begin_again > 0 && is_in_runs && time(table, mapped).is_some_and(|time_s| in_order(&time_s))
    };
    match ends.filter(are_one) {
        Some((first, last)) => kept.iter().enumerate().map(|(row, kept)| (first..last).contains(&row) && !kept).collect(),
        None => vec![false; kept.len()],
    }
}

/// The times of a table, in any unit; none where it has no such column.
fn time(table: &Table, mapped: &BTreeMap<&str, Source>) -> Option<Vec<f64>> {
    let own = || table.names.iter().position(|name| name == TIME);
    let index = mapped.get(TIME).map_or_else(own, |source| source.column())?;
    let cells = &table.columns[index];
    Some(cells.seconds().ok()?.unwrap_or_else(|| cells.numbers().to_vec()))
}

#[cfg(test)]
mod tests {
    use crate::measurement::{LogFacts, read_log};

    const CYCLES: &str =
        "time_s,cycle,mode,current_a,voltage_v\n0,1,rest,0,4.1\n1,1,CC,1,4.0\n2,2,CC,1,3.9\n3,2,rest,0,4.0\n4,3,rest,0,4.0\n";

    fn read(text: &str, rows: &[&str]) -> Result<(Vec<f64>, String), String> {
        let rows = rows.iter().map(|one| one.parse()).collect::<Result<_, String>>()?;
        let log = read_log("a.csv", text.as_bytes(), LogFacts { rows, ..LogFacts::default() }).map_err(|error| error.to_string())?;
        Ok((log.time_s, log.notes.first().cloned().unwrap_or_default()))
    }

    #[test]
    fn rows_are_chosen_by_number_text_and_range() {
        let times = |rows: &[&str]| read(CYCLES, rows).unwrap().0;
        assert_eq!(times(&["cycle=2"]), [2.0, 3.0]);
        assert_eq!(times(&["cycle = 2.0"]), [2.0, 3.0]);
        assert_eq!(times(&["cycle=2..3"]), [2.0, 3.0, 4.0]);
        assert_eq!(times(&["mode=rest"]), [0.0, 3.0, 4.0]);
        assert_eq!(times(&["mode=rest", "time_s=..3.5"]), [0.0, 3.0]);
        let note = read(CYCLES, &["cycle=2", "time_s=1.."]).unwrap().1;
        assert_eq!(note, "a.csv: 2 of 5 rows are read, those with cycle=2 and time_s=1..");
    }

    /// By hand: 2 A for ten of each twenty seconds, and then 1 A.
    #[test]
    fn what_flows_between_the_rows_that_are_read_counts_and_is_not_compared() {
        let row = |second: u32| {
            let (mode, current_a) = if (second / 10).is_multiple_of(2) { ("D", 2.0) } else { ("R", 1.0) };
            format!("{second},{mode},{current_a},4.0\n")
        };
        let text = (0..60).map(row).fold("time_s,mode,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
        let facts = LogFacts { rows: vec!["mode=D".parse().unwrap()], soc_initial: Some(1.0), ..LogFacts::default() };
        let log = read_log("a.csv", text.as_bytes(), facts).unwrap();
        assert_eq!(log.rows(), 50);
        let note = "a.csv: 30 of 60 rows are read, those with mode=D; 20 between them are followed, since what flows in them counts, and not compared";
        assert_eq!(log.notes[0], note);
        let model = crate::load_model("enertech-lco-2280mah").unwrap().model;
        let prepared = crate::prepare(&model, &log).unwrap();
        let used: Vec<usize> = (0..50).filter(|row| prepared.targets[0].used[*row]).collect();
        assert_eq!(used, (1..10).chain(20..30).chain(40..50).collect::<Vec<_>>());
        let charge_as: f64 = prepared.inputs[0].1[1..].iter().sum();
        assert_eq!(charge_as, 9.0 * 2.0 + 10.0 * 1.0 + 10.0 * 2.0 + 10.0 * 1.0 + 10.0 * 2.0);
        // Two recordings: rows that alternate, and packs that are exchanged.
        let of = |name: &str, every: u32| {
            let row = |second: u32| format!("{second},{},{},4.0\n", second / every % 2, 1 + second / every % 2);
            let text = (0..120).map(row).fold(format!("time_s,{name},current_a,voltage_v\n"), |text, row| text + &row);
            let facts = LogFacts { rows: vec![format!("{name}=1").parse().unwrap()], soc_initial: Some(1.0), ..LogFacts::default() };
            read_log("a.csv", text.as_bytes(), facts).unwrap()
        };
        assert_eq!((of("which", 1).rows(), of("battery_id", 40).rows()), (60, 40));
        // Of packs that are exchanged again and again nobody knows what the other one gave.
        let exchanged = of("pack", 20);
        assert_eq!((exchanged.rows(), exchanged.unmeasured.last().map(|piece| piece.gap)), (60, Some(1)), "{:?}", exchanged.notes);
        assert!(exchanged.notes[0].ends_with("as another recording's, and what flowed then is not known"), "{:?}", exchanged.notes);
        assert_eq!(of("step", 20).rows(), 100);
    }

    #[test]
    fn dates_are_chosen_by_dates_and_begin_anew() {
        let text = "when,current_a,voltage_v\n2026-03-01T10:00:00Z,1,4.1\n2026-03-01T10:00:10Z,1,4.0\n2026-03-01T10:00:20Z,1,3.9\n";
        let columns = vec!["time_s=when".parse().unwrap()];
        let rows = vec!["when=2026-03-01T10:00:05Z..".parse().unwrap()];
        let log = read_log("a.csv", text.as_bytes(), LogFacts { rows, columns, ..LogFacts::default() }).unwrap();
        assert_eq!(log.time_s, [0.0, 10.0]);
    }

    /// A logger's remark among its dates.
    #[test]
    fn dates_behind_what_is_none_are_chosen_too() {
        let row = |row: i32| format!("2026-03-01T10:00:{row:02}Z,{},1,4.1\n", if row == 20 { "rest" } else { "CC" });
        let text = (0..40).map(row).fold("when,mode,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
        let text = text.replace("2026-03-01T10:00:20Z", "started");
        let read = |selected: &[&str]| {
            let (columns, rows) = (vec!["time_s=when".parse().unwrap()], selected.iter().map(|one| one.parse().unwrap()).collect());
            read_log("a.csv", text.as_bytes(), LogFacts { rows, columns, ..LogFacts::default() }).map(|log| log.rows())
        };
        assert_eq!(read(&["mode=CC"]).unwrap(), 39);
        assert_eq!(read(&["when=2026-03-01T10:00:10Z..", "mode=CC"]).unwrap(), 29);
        assert!(read(&[]).unwrap_err().to_string().contains("a.csv:22: column `when`: `started` is no date"));
    }

    #[test]
    fn a_mapped_column_is_chosen_by_in_its_own_unit() {
        for name in ["min", "time_s"] {
            let text = format!("{name},current_a,voltage_v\n0,1,4.1\n1,1,4.0\n2,1,3.9\n");
            let columns = vec![format!("time_s={name}*60").parse().unwrap()];
            let rows = vec!["time_s=60..".parse().unwrap()];
            let log = read_log("a.csv", text.as_bytes(), LogFacts { rows, columns, ..LogFacts::default() }).unwrap();
            assert_eq!(log.time_s, [60.0, 120.0]);
        }
    }

    #[test]
    fn what_no_row_is_like_is_said_with_what_there_is() {
        let error = |rows: &[&str]| read(CYCLES, rows).unwrap_err();
        assert_eq!(error(&["cycle=4"]), "a.csv: cycle=4: no row is like that; `cycle` holds 1 to 3");
        assert_eq!(error(&["mode=CV"]), "a.csv: mode=CV: no row is like that; `mode` holds `rest`, `CC`");
        assert_eq!(error(&["cycle=3", "mode=CC"]), "a.csv: cycle=3 and mode=CC: each is so in some rows, but not all in one");
        assert!(error(&["cylce=3"]).contains("no column `cylce`; did you mean `cycle`?"), "{}", error(&["cylce=3"]));
        assert_eq!(error(&["cycle=3..2"]), "3..2: begins after it ends");
        for wrong in ["cycle", "=3", "cycle=", "cycle=..", "mode=a..b"] {
            assert!(error(&[wrong]).starts_with("write COLUMN=VALUE"), "{wrong}");
        }
    }
}
