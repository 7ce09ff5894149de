//! Where the rows of a text begin: its header, what stands before that, and a row of units behind it.

use std::borrow::Cow;

use super::super::limits::COLUMNS_MAX;
use super::MISSING;
use super::cells::split;

/// The line of the header of an EC-Lab export, whose first lines say how many there are before the data; as far as that is known.
pub(super) fn ec_lab_header(line: u64, text: &str, known: Option<u64>) -> Option<u64> {
    match known {
        None if line == 1 && ["EC-Lab ASCII FILE", "BT-Lab ASCII FILE"].iter().any(|sign| text.starts_with(sign)) => Some(u64::MAX),
        Some(u64::MAX) => {
            let count = text.strip_prefix("Nb header lines").and_then(|rest| rest.trim_start_matches([' ', ':']).trim().parse().ok());
            count.or(known)
        }
        _ => known,
    }
}

/// What stands between the names of a header, outside quotes: commas, or semicolons or tabs where there are more of these, as a name may
/// hold a comma.
pub(super) fn separator_of(header: &str) -> char {
    let mut quoted = false;
    let bare: String = header
        .chars()
        .filter(|&letter| {
            quoted ^= letter == '"';
            !quoted
        })
        .collect();
    let count = |separator: char| bare.matches(separator).count();
    // Of as many the last counts.
    ['\t', ';', ','].into_iter().max_by_key(|&separator| count(separator)).unwrap_or(',')
}

/// Whether a line could name the columns of a log.
fn looks_like_a_header(text: &str, separator: char) -> bool {
    let is_name = |cell: &Cow<'_, str>| cell.chars().any(char::is_alphabetic) && cell.parse::<f64>().is_err();
    split(text, separator).is_some_and(|cells| cells.len() > 1 && cells.iter().all(is_name))
}

/// Whether a line could be the header of a table that one of one column is not.
pub(super) fn wider(text: &str) -> bool {
    [';', '\t'].iter().any(|&other| looks_like_a_header(text, other))
}

/// That what was taken for the header is the first line of a preamble, where a later line looks like the header.
pub(super) fn preamble(line: u64, names: &[String], text: &str, separator: char) -> String {
    let is_header = [separator, ';', '\t'].iter().any(|&one| looks_like_a_header(text, one) && text.split(one).count() > names.len());
    if !is_header {
        return String::new();
    }
    let before = if line == 2 { "line 1 is".to_owned() } else { format!("lines 1 to {} are", line - 1) };
    format!(
        "; perhaps {before} a preamble (`{}`), and line {line} is the header (`{text}`): take out what stands before it, or begin those lines \
         with #",
        names.join(",")
    )
}

/// That cells are separated by spaces, where a header of one column and a row of numbers say so.
pub(super) fn spaces(names: &[String], text: &str) -> Option<String> {
    let [header] = names else { return None };
    let cells: Vec<&str> = text.split_whitespace().collect();
    let columns = header.split_whitespace().count();
    let is_so = columns > 1 && cells.len() == columns && cells.iter().all(|cell| cell.parse::<f64>().is_ok());
    is_so.then(|| {
        format!("the cells look separated by spaces, which names may hold too (`{header}`): put commas, semicolons or tabs between them")
    })
}

/// What is wrong with the names of columns.
pub(super) fn check_names(names: &[String]) -> Result<(), String> {
    if names.len() > COLUMNS_MAX {
        return Err(format!("{} columns; a log may have {COLUMNS_MAX}", names.len()));
    }
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err("the first row holds numbers; it must be a header with column names".to_owned());
    }
    for (index, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(format!("column {} has no name", index + 1));
        }
        if names[..index].contains(name) {
            return Err(format!("two columns are named `{name}`"));
        }
    }
    Ok(())
}

/// Whether a row is one of units or descriptions: no cell holds a digit, or a word for what is missing.
pub(super) fn are_units(cells: &[Cow<'_, str>]) -> bool {
    let has_digit = |cell: &str| cell.contains(|letter: char| letter.is_ascii_digit());
    let is_missing = |cell: &str| MISSING.contains(&cell.to_ascii_lowercase().as_str());
    let could_be = |cell: &str| cell.is_empty() || !has_digit(cell) && !is_missing(cell);
    // What has no unit may have an empty cell, but time has one.
    cells.len() > 1 && !cells[0].is_empty() && cells.iter().all(|cell| could_be(cell))
}
