//! What was asked of columns that is not done.

use std::collections::BTreeMap;

use energy::document::hint;

use super::Mark;
use super::mapping::Source;
use super::values::plain;

/// Columns beside which one number was given for every row, and signs of columns that are not there.
pub(super) fn unread(names: &[String], mapped: &BTreeMap<&str, Source>, missing: &[Mark]) -> Vec<String> {
    let has = |name: &str| names.iter().any(|known| known == name);
    let replaced = mapped.iter().filter(|(name, _)| has(name)).filter_map(|(name, source)| {
        let Source::Constant(value) = source else { return None };
        Some(format!(
            "`{name}`: {} stands for every row, and the column of that name is not read; leave out --column {name}={} (or the \
             line in [columns]) to read it",
            plain(*value),
            plain(*value)
        ))
    });
    let absent = missing.iter().filter_map(|mark| mark.column.as_deref()).filter(|column| !has(column) && !mapped.contains_key(column));
    let absent = absent.map(|column| {
        let near = hint(column, names.iter().map(String::as_str));
        format!("--missing {column}=NUMBER (or `missing`): the log has no column `{column}`{near}")
    });
    replaced.chain(absent).collect()
}
