//! Measurements: from a file of any known format to a [`Log`] of canonical channels.
//!
//! A format only turns bytes into a [`Table`] of cells. Names, units, gaps and per-log facts are
//! the same for every format and live in [`Log`]. To add a format: one file here that has a
//! `FORMAT`, and one line in `FORMATS`.

mod csv;
mod facts;
mod log;
mod mapping;

use std::path::Path;

use energy::DocumentError;

pub use facts::{History, LogFacts, Overrides, Role};
pub use log::{Column, Log};
pub use mapping::Mapping;

/// One cell as a format found it.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A finite number.
    Number(f64),
    /// Nothing was measured.
    Missing,
    /// Something else.
    Text(String),
}

/// What a format delivers: named columns of equal length, and the line of every row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Column names, in the order of the file.
    pub names: Vec<String>,
    /// Cells by column, as many per column as there are lines.
    pub columns: Vec<Vec<Cell>>,
    /// Line of each row in the file, counted from 1.
    pub lines: Vec<u64>,
}

/// A source format.
pub struct Format {
    /// Name for people.
    pub name: &'static str,
    /// File endings that it claims, lower case.
    pub extensions: &'static [&'static str],
    /// Turns bytes into cells; the first argument names the file in errors.
    pub parse: fn(&str, &[u8]) -> Result<Table, LogError>,
}

/// Every known format.
static FORMATS: &[Format] = &[csv::FORMAT];

/// Every known format.
#[must_use]
pub fn formats() -> &'static [Format] {
    FORMATS
}

/// What is wrong with a log.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// No format claims the file's ending.
    #[error("{file}: no log format for `.{extension}`; known: {known}")]
    UnknownFormat {
        /// The file.
        file: String,
        /// Its ending.
        extension: String,
        /// Known endings.
        known: String,
    },
    /// The content breaks the contract of logs.
    #[error("{file}:{line}: {message}")]
    Row {
        /// The file.
        file: String,
        /// Line, counted from 1.
        line: u64,
        /// What is wrong, with the column's name.
        message: String,
    },
    /// The log as a whole breaks the contract.
    #[error("{file}: {message}")]
    Whole {
        /// The file.
        file: String,
        /// What is wrong.
        message: String,
    },
    /// The facts beside the log are wrong.
    #[error(transparent)]
    Facts(#[from] DocumentError),
}

/// Reads a log from bytes: the format by the file's ending, then names, units and facts.
///
/// # Errors
/// Names the file, the line and the column.
pub fn read_log(file: &str, bytes: &[u8], facts: LogFacts) -> Result<Log, LogError> {
    let extension = Path::new(file).extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    let format = FORMATS.iter().find(|format| format.extensions.contains(&extension.as_str()));
    let Some(format) = format else {
        let known = FORMATS.iter().flat_map(|format| format.extensions).map(|ending| format!(".{ending}"));
        return Err(LogError::UnknownFormat { file: file.to_owned(), extension, known: known.collect::<Vec<_>>().join(", ") });
    };
    Log::from_table(file, &(format.parse)(file, bytes)?, facts)
}
