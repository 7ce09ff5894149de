//! Comma-separated logs: a header, then one row per moment. Lines that begin with `#` are
//! comments.

use super::{Cell, Format, LogError, Table};

pub(super) const FORMAT: Format = Format { name: "CSV", extensions: &["csv"], parse };

/// How loggers spell "nothing was measured". Numbers that a logger uses for it (such as -9999)
/// differ by logger and are a fact of the log: `missing = [-9999]`.
const MISSING: &[&str] = &["", "nan", "na", "n/a", "null", "none", "inf", "+inf", "-inf", "-nan", "infinity", "-infinity"];

fn parse(file: &str, bytes: &[u8]) -> Result<Table, LogError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).flexible(true).from_reader(bytes);
    let broken = |error: csv::Error| {
        let line = error.position().map_or(1, csv::Position::line);
        LogError::Row { file: file.to_owned(), line, message: format!("not readable as CSV: {error}") }
    };
    let names: Vec<String> = reader.headers().map_err(broken)?.iter().map(str::to_owned).collect();
    check_header(file, &names)?;
    let mut table = Table { columns: vec![Vec::new(); names.len()], names, lines: Vec::new() };
    let mut place = Place { bytes, at: 0, line: 1 };
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let line = record.position().map_or(0, |position| place.line_of(position.byte()));
        if record.len() != table.names.len() {
            let message = format!("{} cells where the header has {} columns", record.len(), table.names.len());
            return Err(LogError::Row { file: file.to_owned(), line, message });
        }
        table.lines.push(line);
        for (column, text) in table.columns.iter_mut().zip(&record) {
            column.push(cell(text));
        }
    }
    Ok(table)
}

/// Counts lines up to where records begin. A record's own position lies before the blank lines
/// and comments that were skipped to reach it, so these are stepped over here.
struct Place<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
}

impl Place<'_> {
    fn line_of(&mut self, byte: u64) -> u64 {
        let begin = usize::try_from(byte).unwrap_or(usize::MAX).min(self.bytes.len());
        while self.at < begin || self.bytes.get(self.at).is_some_and(|byte| b"\r\n#".contains(byte)) {
            if self.at >= begin && self.bytes[self.at] == b'#' {
                let rest = &self.bytes[self.at..];
                self.at += rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
            } else {
                self.line += u64::from(self.bytes[self.at] == b'\n');
                self.at += 1;
            }
        }
        self.line
    }
}

fn check_header(file: &str, names: &[String]) -> Result<(), LogError> {
    let fail = |message: String| Err(LogError::Row { file: file.to_owned(), line: 1, message });
    if names.is_empty() {
        return Err(LogError::Whole {
            file: file.to_owned(),
            message: "the log is empty; it needs a header row and measurements".to_owned(),
        });
    }
    if names.len() == 1 && names[0].contains([';', '\t']) {
        return fail("the columns are not separated by commas".to_owned());
    }
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return fail("the first row holds numbers; it must be a header with column names".to_owned());
    }
    for (index, name) in names.iter().enumerate() {
        if name.is_empty() {
            return fail(format!("column {} has no name", index + 1));
        }
        if names[..index].contains(name) {
            return fail(format!("two columns are named `{name}`"));
        }
    }
    Ok(())
}

fn cell(text: &str) -> Cell {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Cell::Number(number),
        _ if MISSING.contains(&text.to_ascii_lowercase().as_str()) => Cell::Missing,
        _ => Cell::Text(text.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_numbers_gaps_and_text_with_their_lines() {
        let table = parse("a.csv", b"\xef\xbb\xbftime_s, floor\r\n# a comment\r\n0,mud\r\n1.5e0,\r\n2,NaN\r\n").unwrap();
        assert_eq!(table.names, ["time_s", "floor"]);
        assert_eq!(table.columns[0], [Cell::Number(0.0), Cell::Number(1.5), Cell::Number(2.0)]);
        assert_eq!(table.columns[1], [Cell::Text("mud".to_owned()), Cell::Missing, Cell::Missing]);
        assert_eq!(table.lines, [3, 4, 5]);
    }

    #[test]
    fn a_broken_shape_is_named_with_its_line() {
        let message = |text: &str| parse("a.csv", text.as_bytes()).unwrap_err().to_string();
        assert_eq!(message("time_s,voltage_v\n0,1\n1\n"), "a.csv:3: 1 cells where the header has 2 columns");
        assert_eq!(message("time_s,a,a\n0,1,2\n"), "a.csv:1: two columns are named `a`");
        assert!(message("time_s;voltage_v\n0;1\n").contains("not separated by commas"));
        assert!(message("0,1\n1,2\n").contains("must be a header"));
        assert!(message("").contains("the log is empty"));
    }
}
