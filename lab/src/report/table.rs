//! Terminal tables of comparisons.

use comfy_table::{CellAlignment, LineStyle, Table, TableStyle};

use crate::compare::Comparison;
use crate::report::quantity::quantity;

/// A line under the header and nothing else: easy to read, to grep and to paste.
const STYLE: TableStyle = TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// An empty table in the style of this program.
#[must_use]
pub fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(STYLE).set_header(header.iter().copied());
    table
}

/// Aligns numbers to the right, from the given column on.
pub fn numbers_from(table: &mut Table, column: usize) {
    for column in table.column_iter_mut().skip(column) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}

/// The text of a table, without blanks at the ends of lines.
#[must_use]
pub fn text(table: &Table) -> String {
    table.lines().map(|line| line.trim_end().to_owned() + "\n").collect()
}

/// A comparison as people read it.
#[must_use]
pub fn comparison(comparison: &Comparison) -> String {
    let mut overall = table(&["log", "channel", "rows", "RMS", "mean", "max", "floor", "RMS/floor"]);
    for error in &comparison.errors {
        let (size, unit) = (error.size, error.unit);
        overall.add_row([
            error.log.clone(),
            error.channel.to_owned(),
            size.rows.to_string(),
            quantity(size.rms, unit),
            quantity(size.mean, unit),
            quantity(size.max_abs, unit),
            error.floor.map_or_else(|| "unknown".to_owned(), |floor| quantity(floor, unit)),
            error.ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.1}")),
        ]);
    }
    numbers_from(&mut overall, 2);
    let mut regimes = table(&["channel", "by", "band", "rows", "RMS", "mean", "share of squared error"]);
    for error in &comparison.regimes {
        regimes.add_row([
            error.channel.to_owned(),
            error.dimension.to_owned(),
            error.band.clone(),
            error.size.rows.to_string(),
            quantity(error.size.rms, error.unit),
            quantity(error.size.mean, error.unit),
            format!("{:.0} %", error.share * 100.0),
        ]);
    }
    numbers_from(&mut regimes, 3);
    let title = format!("{}: observed minus predicted", comparison.model);
    let words = comparison.words.join("\n");
    format!("{title}\n\n{}\n{}\n{words}\n", text(&overall), text(&regimes))
}
