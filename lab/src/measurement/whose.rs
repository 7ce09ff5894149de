//! Logs of several cells or robots in one file: what becomes of them as one is nobody's.

use std::collections::BTreeMap;

use super::Table;
use super::mapping::Source;
use super::no_time::words;
use super::table::Label;
use super::values::for_a_shell;

/// Words in names of columns that tell of whose recording a row is, not of which part of one.
const WHOSE: [&str; 10] = ["battery", "pack", "cell", "robot", "unit", "serial", "id", "name", "channel", "spare"];
/// Words with which such a column numbers or names its owners.
const NAMES: [&str; 8] = ["id", "name", "serial", "number", "no", "nr", "index", "label"];
/// Words in names of columns that tell which of its parts something is about, which moves from one to another in any one battery.
const PARTS: [&str; 16] = [
    "min", "minimum", "max", "maximum", "low", "lowest", "high", "highest", "weak", "weakest", "hot", "hottest", "cold", "coldest",
    "active", "selected",
];
/// More owners than this in one file are none: every row has its own, or it is a measured number.
const OWNERS_MAX: usize = 64;
/// Rows change hands at least so often for each row, where several are logged by turns. What flickers does so less. A guess.
const BY_TURNS: f64 = 0.5;
/// What is shown of them.
const SHOWN: usize = 4;

/// Whether a column of that name tells of whose recording a row is.
pub(super) fn says_whose(name: &str) -> bool {
    words(name).any(|word| WHOSE.contains(&word.as_str()))
}

/// Whether it does so for certain: `cell_id` or `pack name`, and `cell` where it holds names, not `cell_voltage_v` or `lowest cell id`.
fn names_an_owner(name: &str, holds_texts: bool) -> bool {
    let words: Vec<String> = words(name).collect();
    let is = |list: &[&str], word: &String| list.contains(&word.as_str());
    match words.as_slice() {
        [only] => holds_texts && is(&WHOSE, only) && only != "name",
        [first @ .., last] => is(&NAMES, last) && first.iter().any(|word| is(&WHOSE, word)) && !words.iter().any(|word| is(&PARTS, word)),
        [] => false,
    }
}

/// Columns that name owners and become no channel, with each row's owner; rows without one are the last owner's.
fn owned<'t>(table: &'t Table, mapped: &BTreeMap<&str, Source>) -> impl Iterator<Item = (&'t str, Vec<Label<'t>>, Vec<u32>)> {
    let taken: Vec<usize> = mapped.values().filter_map(|source| source.column()).collect();
    let columns = table.names.iter().zip(&table.columns).enumerate();
    columns.filter_map(move |(index, (name, cells))| {
        if taken.contains(&index) || !names_an_owner(name, !cells.different_texts().is_empty()) {
            return None;
        }
        let (mut owners, mut of_rows): (Vec<Label<'t>>, Vec<u32>) = (Vec::new(), Vec::new());
        let mut last = 0;
        for owner in cells.labels() {
            if let Some(owner) = owner {
                let place = owners.iter().position(|known| *known == owner).unwrap_or_else(|| {
                    owners.push(owner);
                    owners.len() - 1
                });
                last = place as u32;
            }
            of_rows.push(last);
            if owners.len() > OWNERS_MAX {
                return None;
            }
        }
        (owners.len() > 1).then_some((name.as_str(), owners, of_rows))
    })
}

fn words_of(name: &str, owners: &[Label<'_>]) -> String {
    let shown = owners.iter().take(SHOWN).map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let more = if owners.len() > SHOWN { ", ..." } else { "" };
    let flag = for_a_shell(&format!("{name}={}", owners[0]));
    format!("`{name}` says that the rows are of several ({shown}{more}): say whose are read, --rows {flag}")
}

/// Why the rows of a table cannot be those of one battery or robot: by a column that names its owner they change hands by turns.
pub(super) fn of_several(table: &Table, mapped: &BTreeMap<&str, Source>) -> Option<String> {
    owned(table, mapped).find_map(|(name, owners, of_rows)| {
        let changes = of_rows.windows(2).filter(|pair| pair[0] != pair[1]).count();
        (changes > 2 * owners.len() && changes as f64 >= BY_TURNS * of_rows.len() as f64).then(|| words_of(name, &owners))
    })
}

/// Whose rows begin where time goes back, if that is another's.
pub(super) fn begins_another(table: &Table, mapped: &BTreeMap<&str, Source>, row: usize) -> Option<String> {
    let mut all = owned(table, mapped);
    all.find_map(|(name, owners, of_rows)| (row > 0 && of_rows[row] != of_rows[row - 1]).then(|| words_of(name, &owners)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(name: &str, owners: &[&str]) -> Table {
        let mut table = Table::of(vec!["time_s".to_owned(), name.to_owned()], "lines");
        for (row, owner) in owners.iter().enumerate() {
            table.columns[0].push(row as f64);
            match owner.parse() {
                _ if owner.is_empty() => table.columns[1].push(f64::NAN),
                Ok(number) => table.columns[1].push(number),
                Err(_) => table.columns[1].push_text(owner),
            }
            table.lines.push(row as u64 + 2);
        }
        table
    }

    #[test]
    fn rows_that_change_hands_by_turns_are_of_several() {
        let none = BTreeMap::new();
        let told = |name: &str, owners: &[&str]| of_several(&table(name, owners), &none);
        let by_turns = ["A", "B", "A", "B", "A", "B"];
        assert_eq!(
            told("cell_id", &by_turns).unwrap(),
            "`cell_id` says that the rows are of several (A, B): say whose are read, --rows cell_id=A"
        );
        assert!(told("Pack Name", &["1", "2", "1", "2", "1", "2"]).unwrap().ends_with("--rows 'Pack Name=1'"));
        assert!(told("CellID", &by_turns).is_some() && told("cell", &by_turns).is_some());
        // One after the other they are told by the time, which begins anew.
        let in_turn = ["A", "A", "A", "B", "B", "B"];
        assert_eq!(told("cell", &in_turn), None);
        let begins = |row| begins_another(&table("cell", &in_turn), &none, row);
        assert!(begins(3).is_some() && begins(2).is_none());
    }

    #[test]
    fn what_moves_in_one_battery_names_no_owner() {
        let none = BTreeMap::new();
        let told = |name: &str, cells: &[&str]| of_several(&table(name, cells), &none);
        let flickers = ["3", "4", "3", "4", "3", "4", "3", "4"];
        for name in ["cell_voltage_v", "battery", "cell", "pack", "Low Cell ID", "max_cell_number", "High Cell Voltage ID", "step_id"] {
            assert_eq!(told(name, &flickers), None, "{name}");
        }
        assert_eq!(told("mode", &["CC", "CV", "CC", "CV", "CC", "CV"]), None);
        assert_eq!(told("Name", &["CC", "CV", "CC", "CV", "CC", "CV"]), None);
        assert_eq!(told("cell", &["A"; 6]), None);
        // Written now and then it is still one.
        assert_eq!(told("serial_no", &["7", "", "", "7", "", "", "7", "", ""]), None);
        let mapped = BTreeMap::from([("voltage_v", Source::Column { index: 1, scale: 1.0, offset: 0.0 })]);
        assert_eq!(of_several(&table("cell_id", &flickers), &mapped), None, "it is a channel");
    }
}
