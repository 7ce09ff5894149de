//! Where in the file the key stands that a message names: that line is wanted, not the one where its table begins.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The key that a message about the entry at `index` of `[[list]]` names first, as in `robot scout: radio.tx_dbm = 90: ...` or
/// `station mds-1: pack p1: soc = 9: ...`; the deepest table of it that is there. None when it names no key of the entry.
pub(super) fn named_by(message: &str, text: &str, list: &str, index: usize) -> Option<Range<usize>> {
    let file = DeTable::parse(text).ok()?;
    let DeValue::Array(entries) = file.get_ref().get(list)?.get_ref() else { return None };
    let mut at = entries.get(index)?.get_ref();
    // Whose it is comes before it.
    let mut rest = message.strip_prefix(list)?.split_once(": ")?.1;
    let mut found = None;
    for (member, list) in [("pack ", "packs"), ("spare ", "spares")] {
        if let Some((id, of_it)) = rest.strip_prefix(member).and_then(|rest| rest.split_once(": ")) {
            let member = member_of(at, list, id)?;
            (found, at, rest) = (Some(member.span()), member.get_ref(), of_it);
        }
    }
    let path = rest.split([' ', ':', '=']).next().unwrap_or_default();
    for step in path.split(['.', '[']) {
        match (at, step.strip_suffix(']')) {
            (DeValue::Array(values), Some(number)) => {
                let Some(value) = number.parse().ok().and_then(|number: usize| values.get(number)) else { break };
                (found, at) = (Some(value.span()), value.get_ref());
            }
            (DeValue::Table(table), None) => {
                let Some((key, value)) = table.iter().find(|(key, _)| key.get_ref() == step) else { break };
                (found, at) = (Some(key.span()), value.get_ref());
            }
            _ => break,
        }
    }
    found
}

/// The table of that id in a list of an entry.
fn member_of<'v>(entry: &'v DeValue<'v>, list: &str, id: &str) -> Option<&'v Spanned<DeValue<'v>>> {
    let DeValue::Array(members) = entry.as_table()?.get(list)?.get_ref() else { return None };
    let is_it = |member: &&Spanned<DeValue<'v>>| {
        let its = member.get_ref().as_table().and_then(|table| table.get("id")).and_then(|its| its.get_ref().as_str());
        its == Some(id)
    };
    members.iter().find(is_it)
}
