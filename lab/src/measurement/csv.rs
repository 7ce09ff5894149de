//! Logs as text: a header, then one row per moment, with commas between cells, or semicolons or tabs
//! where the header has more of these; there a comma in a number is its decimal point. Lines that
//! begin with `#` are comments, and those before the header of an EC-Lab export (`.mpt`) are skipped. Read line by line, so that a long log is never in memory as text.

mod cells;
mod commas;
mod header;

use std::io::BufRead;

use cells::split;
use commas::Commas;
use header::{are_units, check_names, ec_lab_header, preamble, separator_of, spaces, wider};

use super::ending::LastCells;
use super::limits::{Line, Lines, check_cells};
use super::table::Units;
use super::values::count;
use super::{Cells, Format, LogError, LogFacts, Table, some_places};

pub(super) const FORMAT: Format = Format { name: "CSV", extensions: &["csv", "txt", "tsv", "mpt"], parse };

/// How loggers spell "nothing was measured". Numbers that a logger uses for it (such as -9999)
/// differ by logger and are a fact of the log: `missing = [-9999]`.
const MISSING: &[&str] =
    &["", "nan", "na", "n/a", "null", "none", "inf", "+inf", "-inf", "-nan", "+nan", "infinity", "-infinity", "+infinity"];

fn parse(file: &str, input: &mut dyn BufRead, facts: &LogFacts) -> Result<Table, LogError> {
    let mut lines = Lines::of(file, input);
    let mut table = Table::default();
    let (mut headers, mut last_cells) = (Vec::new(), LastCells::default());
    let mut separator = ',';
    let mut header_at = None;
    // Columns without a name at the end of the header, lines without anything, and what commas in numbers are.
    let (mut unnamed, mut empty, mut commas) = (0, Vec::new(), Commas::beside(&facts.missing));
    while let Some(Line { number: line, text, whole }) = lines.next()? {
        if text.trim().is_empty() || text.starts_with('#') {
            continue;
        }
        header_at = ec_lab_header(line, text, header_at);
        if header_at.is_some_and(|header| line < header) {
            continue;
        }
        let broken = |message: String| LogError::Row { file: file.to_owned(), line, message };
        let cut = || format!("line {line}, the last, is cut off and left out");
        // Spreadsheets may say first how they separate columns.
        if let (true, Some(said)) = (table.names.is_empty(), text.strip_prefix("sep=").map(str::trim_end))
            && said.chars().count() <= 1
        {
            continue;
        }
        if table.names.is_empty() {
            separator = separator_of(text);
        }
        let Some(mut cells) = split(text, separator) else {
            if !whole && !table.names.is_empty() {
                table.notes.push(cut());
                break;
            }
            return Err(broken("a quoted cell does not end on its line".to_owned()));
        };
        if table.names.is_empty() {
            let mut names: Vec<String> = cells.iter().map(|name| name.to_string()).collect();
            unnamed = names.iter().rev().take_while(|name| name.is_empty()).count().min(names.len() - 1);
            names.truncate(names.len() - unnamed);
            if let Err(wrong) = check_names(&names) {
                // What has no names may be what stands before them.
                let next = lines.next()?;
                let before = next.map_or_else(String::new, |next| preamble(next.number, &names, next.text, separator));
                return Err(LogError::Row { file: file.to_owned(), line, message: wrong + &before });
            }
            table = Table::of(names, "lines");
            match separator {
                ';' => table.notes.push("columns are separated by semicolons".to_owned()),
                '\t' => table.notes.push("columns are separated by tabs".to_owned()),
                _ => {}
            }
            continue;
        }
        // What spreadsheets leave behind the last column and below the last row.
        if unnamed > 0 && cells.len() == table.names.len() + unnamed && cells[table.names.len()..].iter().all(|cell| cell.is_empty()) {
            cells.truncate(table.names.len());
        }
        if cells.len() > 1 && cells.iter().all(|cell| cell.is_empty()) {
            empty.push(line);
            continue;
        }
        if let Some(told) = spaces(&table.names, text) {
            return Err(broken(told));
        }
        let is_wider = table.names.len() == 1 && wider(text);
        if cells.len() != table.names.len() || is_wider {
            if !whole && cells.len() < table.names.len() {
                table.notes.push(cut());
                break;
            }
            let columns = count(table.names.len(), "column");
            let shape = match is_wider {
                true => format!("the header has {columns}"),
                false => format!("{} where the header has {columns}", count(cells.len(), "cell")),
            };
            return Err(broken(shape + &preamble(line, &table.names, text, separator)));
        }
        // A logger that was started again writes its header again.
        if cells.iter().zip(&table.names).all(|(cell, name)| cell == name) {
            headers.push(line);
            continue;
        }
        if table.lines.is_empty() && are_units(&cells) {
            table.notes.push(format!("line {line} holds no number and is skipped: {}", cells.join(", ")));
            table.units = Some(Units { line, of: cells.iter().map(|cell| cell.to_string()).collect() });
            continue;
        }
        let last = cells.last().map_or("", |cell| cell.as_ref());
        if !whole && !last_cells.looks_whole(last) {
            table.notes.push(format!("line {line}, the last, has no line end and fewer digits than others: taken as cut off and left out"));
            break;
        }
        last_cells.add(last);
        table.lines.push(line);
        check_cells(file, &table)?;
        for (index, (column, text)) in table.columns.iter_mut().zip(&cells).enumerate() {
            match if separator == ',' { None } else { commas.of(line, index, text) } {
                Some(number) => push(column, &number),
                None => push(column, text),
            }
        }
    }
    commas.check().map_err(|(line, message)| LogError::Row { file: file.to_owned(), line, message })?;
    if lines.is_latin() {
        table.notes.push("is not UTF-8: read as Latin-1".to_owned());
    }
    if table.names.is_empty() {
        let message = match header_at {
            Some(_) => "an EC-Lab export whose `Nb header lines : N` is missing, or counts more lines than there are".to_owned(),
            None => "the log is empty; it needs a header row and measurements".to_owned(),
        };
        return Err(LogError::Whole { file: file.to_owned(), message });
    }
    if commas.any()
        && let Some(note) = table.notes.iter_mut().find(|note| note.starts_with("columns are separated"))
    {
        note.push_str(", and a comma in a number is its decimal point");
    }
    if !empty.is_empty() {
        table.notes.push(format!(
            "{} without any value {} skipped ({})",
            count(empty.len(), "line"),
            if empty.len() == 1 { "is" } else { "are" },
            some_places("lines", &empty)
        ));
    }
    if !headers.is_empty() {
        table.notes.push(format!("the header comes again and is skipped ({})", some_places("lines", &headers)));
    }
    Ok(table)
}

fn push(column: &mut Cells, text: &str) {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => column.push(number),
        _ if MISSING.contains(&text.to_ascii_lowercase().as_str()) => column.push(f64::NAN),
        _ => column.push_text(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Table, String> {
        parse("a.csv", &mut text.as_bytes(), &LogFacts::default()).map_err(|error| error.to_string())
    }

    #[test]
    fn reads_numbers_gaps_and_text_with_their_lines() {
        let table = read("\u{feff}time_s, floor\r\n# a comment\r\n0,mud\r\n\r\n1.5e0,\r\n2,NaN\r\n").unwrap();
        assert_eq!(table.names, ["time_s", "floor"]);
        assert_eq!(table.columns[0].numbers(), [0.0, 1.5, 2.0]);
        assert_eq!(table.columns[1].as_texts(), ["mud", "", ""]);
        assert_eq!(table.columns[1].first_text(|_| true), Some((0, "mud")));
        assert_eq!(table.lines, [3, 5, 6]);
    }

    #[test]
    fn quoted_cells_may_hold_commas_and_quotes() {
        let table = read("time_s,\"a, \"\"b\"\"\"\n\"0\", \"x\" \n1,2\n").unwrap();
        assert_eq!(table.names, ["time_s", "a, \"b\""]);
        assert_eq!(table.columns[1].as_texts(), ["x", "2"]);
        assert_eq!(read("time_s,a\n0,\"x\n").unwrap_err(), "a.csv:2: a quoted cell does not end on its line");
    }

    #[test]
    fn a_broken_shape_is_named_with_its_line() {
        let message = |text: &str| read(text).unwrap_err();
        assert_eq!(message("time_s,voltage_v\n0,1\n1\n"), "a.csv:3: 1 cell where the header has 2 columns");
        assert_eq!(message("# by hand\ntime_s,a,a\n0,1,2\n"), "a.csv:2: two columns are named `a`");
        assert!(message("0,1\n1,2\n").contains("must be a header"));
        assert!(message("").contains("the log is empty"));
        assert!(message("# nothing\n").contains("the log is empty"));
    }

    #[test]
    fn a_preamble_is_told_from_the_header_behind_it() {
        let message = |text: &str| read(text).unwrap_err();
        let header = "time_s,current_a,voltage_v\n0,1,4\n";
        assert_eq!(
            message(&format!("Cycler: Arbin\nDate: 2025-01-01\n\n{header}")),
            "a.csv:4: 3 cells where the header has 1 column; perhaps lines 1 to 3 are a preamble (`Cycler: Arbin`), and line 4 is the header \
             (`time_s,current_a,voltage_v`): take out what stands before it, or begin those lines with #"
        );
        assert!(
            message(&format!("Cycler,Arbin\n{header}")).contains("perhaps line 1 is a preamble (`Cycler,Arbin`), and line 2 is the header")
        );
        assert!(message("Cycler: Arbin\ntime_s;current_a\n0;1\n").contains("and line 2 is the header (`time_s;current_a`)"));
        // A row that is merely too long is none.
        assert_eq!(message("time_s,a\n0,1,2\n"), "a.csv:2: 3 cells where the header has 2 columns");
    }

    #[test]
    fn a_preamble_whose_names_are_none_and_cells_between_spaces_are_told() {
        let message = |text: &str| read(text).unwrap_err();
        let told = message("Date\t03/01/2026\tof test\t03/01/2026\nRec\tTestTime\tAmps\tVolts\tState\n1\t0\t1\t4\tD\n");
        assert!(told.starts_with("a.csv:1: two columns are named `03/01/2026`; perhaps line 1 is a preamble"), "{told}");
        assert!(told.contains("and line 2 is the header (`Rec\tTestTime"), "{told}");
        let told = message("time_s current_a\n0 1\n");
        assert!(told.starts_with("a.csv:2: the cells look separated by spaces") && told.contains("(`time_s current_a`)"), "{told}");
        // A name of one column may hold spaces.
        assert_eq!(read("free text\n1\n").unwrap().names, ["free text"]);
    }

    #[test]
    fn commas_between_thousands_are_no_decimal_points() {
        let told = read("time_s;current_ma;u_v\n0;800;3.9\n1;1,250;3.8\n").unwrap_err();
        assert!(told.starts_with("a.csv:3: `1,250` has a comma and `3.9` in line 2 a decimal point"), "{told}");
    }

    #[test]
    fn an_export_of_ec_lab_begins_where_it_says() {
        let text = "EC-Lab ASCII FILE\nNb header lines : 6\n\nGalvanostatic cycling\nDevice : BCS-815\n\
                    mode\ttime/s\tEcell/V\t<I>/mA\t\n1\t0,0E+0\t4,2\t-1,0\t\n";
        let table = read(text).unwrap();
        assert_eq!((&table.names[..], &table.lines[..]), (&["mode", "time/s", "Ecell/V", "<I>/mA"].map(str::to_owned)[..], &[7][..]));
        assert_eq!(table.columns[2].numbers(), [4.2]);
        for cut in ["EC-Lab ASCII FILE\nNb header lines : 90\n", "EC-Lab ASCII FILE\nmode\ttime/s\n1\t0\n"] {
            assert!(read(cut).unwrap_err().contains("`Nb header lines : N` is missing, or counts more"));
        }
    }

    #[test]
    fn a_degree_sign_of_another_encoding_stops_nothing() {
        let bytes = b"time_s,T/\xb0C\n0,25\n";
        let table = parse("a.csv", &mut &bytes[..], &LogFacts::default()).unwrap();
        assert_eq!((table.names[1].as_str(), &table.notes[..]), ("T/\u{b0}C", &["is not UTF-8: read as Latin-1".to_owned()][..]));
    }

    #[test]
    fn semicolons_and_tabs_separate_too_and_a_comma_is_a_decimal_point_then() {
        let table = read("time_s;a;note\n0;-0,002;\"1;2\"\n1;1,5e-3;3,4,5\n2;7;x\n").unwrap();
        assert_eq!(table.columns[1].numbers(), [-0.002, 1.5e-3, 7.0]);
        assert_eq!(table.columns[2].as_texts(), ["1;2", "3,4,5", "x"]);
        assert_eq!(table.notes, ["columns are separated by semicolons, and a comma in a number is its decimal point"]);
        let table = read("time_s\ta\n0\t1.5\n").unwrap();
        assert_eq!((table.columns[1].numbers(), table.notes.len()), (&[1.5][..], 1));
        // A name may hold a comma, where most of what separates is none; where commas separate, they do nothing else.
        let table = read("time_s;a;b, terminal\n0,5;2,28;4,1\n").unwrap();
        assert_eq!((table.names[2].as_str(), table.columns[2].numbers()), ("b, terminal", &[4.1][..]));
        assert_eq!(read("time_s,a;b\n0,1\n").unwrap().names, ["time_s", "a;b"]);
    }

    #[test]
    fn what_spreadsheets_leave_behind_is_skipped() {
        let table = read("sep=;\ntime_s;a;\"note, free\";\n0;1,5;x;\n1;2,5;y;\n;;;\n").unwrap();
        assert_eq!(table.names, ["time_s", "a", "note, free"]);
        assert_eq!((table.columns[1].numbers(), &table.lines[..]), (&[1.5, 2.5][..], &[3, 4][..]));
        let notes = [
            "columns are separated by semicolons, and a comma in a number is its decimal point",
            "1 line without any value is skipped (line 5)",
        ];
        assert_eq!(table.notes, notes);
        // A comma in tabbed numbers is told as well, and a column without a name that holds something is none to guess.
        assert!(read("time_s\ta\n0\t4,181\n").unwrap().notes[0].ends_with("and a comma in a number is its decimal point"));
        assert_eq!(read("time_s,a,\n0,1,2\n").unwrap_err(), "a.csv:2: 3 cells where the header has 2 columns");
        assert_eq!(read("time_s,,a\n0,1,2\n").unwrap_err(), "a.csv:1: column 2 has no name");
    }

    #[test]
    fn a_row_of_units_is_skipped_and_said() {
        let table = read("time_s,a,soc\ns,A,\n0,1,2\n").unwrap();
        assert_eq!((table.lines, table.notes), (vec![3], vec!["line 2 holds no number and is skipped: s, A, ".to_owned()]));
        // A word beside a number is one, and so is what is missing.
        assert_eq!(read("time_s,a\n0,x\n").unwrap().columns[1].as_texts(), ["x"]);
        assert_eq!(read("time_s,a\nnan,nan\n0,1\n").unwrap().lines, [2, 3]);
    }

    #[test]
    fn what_a_logger_leaves_behind_when_it_stops_is_skipped_and_said() {
        let table = read("time_s,a\n0,1\ntime_s,a\n1,2\n2").unwrap();
        assert_eq!(table.lines, [2, 4]);
        assert_eq!(table.notes, ["line 5, the last, is cut off and left out", "the header comes again and is skipped (line 3)"]);
        assert_eq!(read("time_s,a\n0,\"x\"\n1,\"y").unwrap().notes, ["line 3, the last, is cut off and left out"]);
    }

    #[test]
    fn a_last_row_without_a_line_end_counts_unless_its_last_number_was_cut() {
        let rows = "time_s,voltage_v\n0,3.95452\n1,3.95234\n";
        let cut = read(&format!("{rows}2,3.9")).unwrap();
        assert_eq!(cut.lines, [2, 3]);
        assert_eq!(cut.notes, ["line 4, the last, has no line end and fewer digits than others: taken as cut off and left out"]);
        let whole = read(&format!("{rows}2,3.95102")).unwrap();
        assert_eq!((whole.lines, whole.notes), (vec![2, 3, 4], Vec::new()));
        assert_eq!(read("time_s,a\n0,1\n1,2").unwrap().lines, [2, 3]);
    }
}
