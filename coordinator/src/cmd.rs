//! The command line: one file per command.

/// Prints a line of an answer; see [`say_text`].
macro_rules! say {
    () => { $crate::cmd::say_text("\n") };
    ($($line:tt)*) => { $crate::cmd::say_text(&(format!($($line)*) + "\n")) };
}

pub mod certs;
pub mod demo;
pub mod doctor;
pub mod import;
pub mod plan;
mod presence;
pub mod replay;
pub mod run;
pub mod schedule;
mod serve;
pub mod simulate;

use clap::ValueEnum;
use comfy_table::{LineStyle, Table, TableStyle};

/// How an answer is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Format {
    /// Tables for people.
    #[default]
    Table,
    /// JSON for programs.
    Json,
}

/// A seed, as flags take it.
fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("must be a whole number from 0 to {}", u64::MAX))
}

/// A line under the header and nothing else: easy to read, to grep and to paste.
const STYLE: TableStyle = TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// An empty table in the style of this program.
fn table() -> Table {
    let mut table = Table::new();
    table.load_style(STYLE);
    table
}

/// The text of a table, without blanks at the ends of lines.
fn text(table: &Table) -> String {
    table.lines().map(|line| line.trim_end().to_owned() + "\n").collect()
}

/// Prints a part of an answer. Whoever reads may have had enough (`| head`): that ends the program
/// quietly. An answer that cannot be told is an error.
fn say_text(text: &str) {
    use std::io::Write as _;
    if let Err(error) = std::io::stdout().write_all(text.as_bytes()).and_then(|()| std::io::stdout().flush()) {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        eprintln!("coordinator: cannot print the answer: {error}");
        std::process::exit(2);
    }
}
