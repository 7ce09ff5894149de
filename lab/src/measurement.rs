//! Measurements: from a file of any known format to a [`Log`] of canonical channels.
//!
//! A format only turns bytes into a [`Table`] of cells. Names, units, gaps, values that cannot be
//! and per-log facts are the same for every format and live in [`Log`]. To add a format: one file here that has a
//! `FORMAT`, and one line in `FORMATS`.

mod charging;
mod clocks;
mod csv;
mod edges;
mod ending;
mod facts;
mod hints;
mod limits;
mod log;
mod mapping;
mod mark;
mod mcap;
mod no_time;
mod overlap;
mod selection;
mod settling;
mod spikes;
mod store;
mod table;
mod thin;
mod times;
mod unfollowed;
mod units;
mod unmeasured;
mod unread;
mod values;
mod whose;

use std::io::BufRead;
use std::path::Path;

use energy::DocumentError;

pub use edges::leave_out_edges;
pub use facts::{GapCurrent, History, LogFacts, Overrides, Role};
pub use hints::{as_flag, conversion, for_missing};
pub use limits::BYTES_MAX as LOG_BYTES_MAX;
pub use log::{Column, Log};
pub use mapping::Mapping;
pub use mark::Mark;
pub use overlap::shared_rows;
pub use selection::Selection;
pub use settling::leave_out_settling;
pub use store::{StoreQuery, Subject, instant, read_store};
pub use table::{Cells, GaugeStart, Table};
pub use thin::{LONG, Thinning, thin, uneven_sampling};
pub(crate) use times::{rows_after_gaps, short, usual_step_s};
pub use unmeasured::Unmeasured;

/// A source format.
pub struct Format {
    /// Name for people.
    pub name: &'static str,
    /// File endings that it claims, lower case.
    pub extensions: &'static [&'static str],
    /// Turns a stream of bytes into cells; the first argument names the file in errors.
    pub parse: fn(&str, &mut dyn BufRead, &LogFacts) -> Result<Table, LogError>,
}

/// Every known format.
static FORMATS: &[Format] = &[csv::FORMAT, mcap::FORMAT];

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
pub fn read_log(file: &str, mut bytes: &[u8], facts: LogFacts) -> Result<Log, LogError> {
    read_log_from(file, &mut bytes, facts)
}

/// Like [`read_log`], from a stream, of which only a little is in memory at a time.
///
/// # Errors
/// Names the file, the line and the column; refuses what is too long for one log.
pub fn read_log_from(file: &str, input: &mut dyn BufRead, facts: LogFacts) -> Result<Log, LogError> {
    let extension = Path::new(file).extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    let format = FORMATS.iter().find(|format| format.extensions.contains(&extension.as_str()));
    let Some(format) = format else {
        let known = FORMATS.iter().flat_map(|format| format.extensions).map(|ending| format!(".{ending}"));
        return Err(LogError::UnknownFormat { file: file.to_owned(), extension, known: known.collect::<Vec<_>>().join(", ") });
    };
    let table = (format.parse)(file, input, &facts)?;
    Log::from_table(file, table, facts)
}

/// Where something was found, for notes: `lines 3, 9, 12 ... 988`.
fn some_places(places: &str, at: &[u64]) -> String {
    const SHOWN: usize = 5;
    let list = |at: &[u64]| at.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
    match at {
        [one] => format!("{} {one}", places.strip_suffix('s').unwrap_or(places)),
        [first @ .., last] if at.len() > SHOWN => format!("{places} {} ... {last}", list(&first[..SHOWN - 1])),
        _ => format!("{places} {}", list(at)),
    }
}
