//! The command line: one file per command.

pub mod demo;
pub mod run;
pub mod schedule;
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
