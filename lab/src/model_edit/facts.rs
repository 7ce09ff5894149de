//! Changes the fixed facts of a model's text: the OCV table, and single numbers.

use energy::OcvTable;
use toml_edit::{Array, DocumentMut, InlineTable, Item, Key, TableLike, Value};

use super::{EditError, number, set, shortest, with_point};

/// How the comment begins that says what moved a fact. There is at most one before each.
const MOVED: &str = "# Moved ";

/// The text with other points in its OCV table, written in place, and a comment `# Moved ...`
/// before it.
///
/// # Errors
/// When the text is no TOML or has no OCV table.
pub fn set_ocv(text: &str, table: &OcvTable, moved: &str) -> Result<String, EditError> {
    let mut document: DocumentMut = text.parse()?;
    if document.get("battery").and_then(|battery| battery.get("ocv_csv")).is_some() {
        inline(&mut document, table, Some(moved));
        return Ok(document.to_string());
    }
    let battery = document.get_mut("battery").and_then(Item::as_table_like_mut);
    let battery = battery.ok_or_else(|| EditError::NoKey("battery".to_owned()))?;
    let points = battery.get_mut("ocv").and_then(Item::as_table_like_mut).ok_or_else(|| EditError::NoKey("battery.ocv".to_owned()))?;
    let (soc, voltage_v) = table.points();
    set(points, "soc", Value::Array(array(soc)));
    set(points, "voltage_v", Value::Array(array(voltage_v)));
    match battery.get_mut("ocv") {
        // A `[battery.ocv]` table has its comment before its own header.
        Some(Item::Table(own)) => {
            let prefix = own.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default().to_owned();
            own.decor_mut().set_prefix(with_note(&prefix, moved));
        }
        _ => note(battery, "ocv", moved),
    }
    Ok(document.to_string())
}

/// The text with another number under `table.key`, and a comment `# Moved ...` before it.
///
/// # Errors
/// When the text is no TOML or has no such key.
pub fn set_number(text: &str, table: &str, key: &str, value: f64, digits: usize, moved: &str) -> Result<String, EditError> {
    let mut document: DocumentMut = text.parse()?;
    let missing = || EditError::NoKey(format!("{table}.{key}"));
    let owner = document.get_mut(table).and_then(Item::as_table_like_mut).ok_or_else(missing)?;
    owner.get(key).ok_or_else(missing)?;
    set(owner, key, number(&with_point(shortest(value, digits))));
    note(owner, key, moved);
    Ok(document.to_string())
}

/// The text with a number under `table.key`, whether or not it was there, and a comment before it.
///
/// # Errors
/// When the text is no TOML, or has something else in the table's place.
pub fn put_number(text: &str, table: &str, key: &str, value: f64, comment: &str) -> Result<String, EditError> {
    let mut document: DocumentMut = text.parse()?;
    let owner = document.entry(table).or_insert_with(toml_edit::table).as_table_like_mut();
    let owner = owner.ok_or_else(|| EditError::NoKey(table.to_owned()))?;
    let shown = number(&with_point(shortest(value, 3)));
    match owner.contains_key(key) {
        true => set(owner, key, shown),
        false => drop(owner.insert(key, Item::Value(shown))),
    }
    // An inline table has no room for a comment.
    if let Some(mut key) = document.get_mut(table).and_then(Item::as_table_mut).and_then(|owner| owner.key_mut(key)) {
        // After what somebody wrote there before.
        let before = key.leaf_decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default().to_owned();
        if !before.contains(comment) {
            key.leaf_decor_mut().set_prefix(format!("{before}# {comment}\n"));
        }
    }
    Ok(document.to_string())
}

/// Writes the points of a table in the place of the name of its file.
pub(super) fn inline(document: &mut DocumentMut, table: &OcvTable, moved: Option<&str>) {
    let Some(battery) = document.get_mut("battery").and_then(Item::as_table_like_mut) else { return };
    let old = battery.get_key_value("ocv_csv").map(|(key, item)| (key.clone(), item.clone()));
    let Some((old_key, old_item)) = old else { return };
    let (soc, voltage_v) = table.points();
    let mut points = InlineTable::new();
    points.insert("soc", Value::Array(array(soc)));
    points.insert("voltage_v", Value::Array(array(voltage_v)));
    let mut value = Value::InlineTable(points);
    if let Some(suffix) = old_item.as_value().and_then(|value| value.decor().suffix()).cloned() {
        value.decor_mut().set_suffix(suffix);
    }
    battery.remove("ocv_csv");
    let mut key = Key::new("ocv").with_leaf_decor(old_key.leaf_decor().clone());
    let before = old_key.leaf_decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default();
    let file = old_item.as_str().unwrap_or_default();
    key.leaf_decor_mut().set_prefix(format!("{before}# Points of {file}\n"));
    battery.entry_format(&key).or_insert(Item::Value(value));
    if let Some(moved) = moved {
        note(battery, "ocv", moved);
    }
}

fn array(values: &[f64]) -> Array {
    values.iter().map(|value| number(&value.to_string())).collect()
}

/// Says before a key what moved its value.
fn note(table: &mut dyn TableLike, key: &str, moved: &str) {
    // The keys of a dotted table (`battery.ocv.soc = ..`) have no line of their own before them.
    if table.is_dotted() {
        return;
    }
    if let Some(mut key) = table.key_mut(key) {
        let prefix = key.leaf_decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default().to_owned();
        key.leaf_decor_mut().set_prefix(with_note(&prefix, moved));
    }
}

fn with_note(prefix: &str, moved: &str) -> String {
    let kept: String = prefix.split_inclusive('\n').filter(|line| !line.trim_start().starts_with(MOVED)).collect();
    format!("{kept}{MOVED}{moved}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(low_v: f64) -> OcvTable {
        OcvTable::new(vec![0.0, 1.0], vec![low_v, 4.2]).unwrap()
    }

    #[test]
    fn a_table_is_moved_in_place_with_one_comment_however_often() {
        for (text, note_before) in [
            ("[battery]\n# A table.\nocv = { soc = [0, 0.5, 1], voltage_v = [3, 3.6, 4] } # end\nseries = 1\n", "# A table.\n"),
            ("[battery]\nseries = 1\n\n# A table.\n[battery.ocv]\nsoc = [0, 1]\nvoltage_v = [3, 4]\n", "# A table.\n"),
            ("[battery]\n# A table.\nocv_csv = \"t.csv\"\nseries = 1\n", "# A table.\n# Points of t.csv\n"),
        ] {
            let once = set_ocv(text, &table(3.1), "by 5 mV").unwrap();
            let twice = set_ocv(&once, &table(3.2), "by 9 mV").unwrap();
            let parsed: toml::Table = twice.parse().unwrap();
            assert_eq!(parsed["battery"]["ocv"]["voltage_v"][0].as_float(), Some(3.2), "{twice}");
            assert!(twice.contains(&format!("{note_before}# Moved by 9 mV\n")) && !twice.contains("5 mV"), "{twice}");
        }
        assert!(set_ocv("[battery]\nseries = 1\n", &table(3.1), "").is_err());
    }

    #[test]
    fn a_number_keeps_what_stands_around_it() {
        let text = "[battery]\n# Measured.\ncapacity_ah = 2.28 # Ah\n";
        let expected = "[battery]\n# Measured.\n# Moved from 2.28\ncapacity_ah = 2.301 # Ah\n";
        assert_eq!(set_number(text, "battery", "capacity_ah", 2.300_96, 4, "from 2.28").unwrap(), expected);
        assert!(set_number(text, "battery", "capacity", 1.0, 4, "").is_err());
    }
}
