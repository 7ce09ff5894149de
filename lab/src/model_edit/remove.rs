//! Takes effects out of a model's text.

use energy::effect::expression;
use toml_edit::{DocumentMut, Item, TableLike, Value};

use super::EditError;

/// The text without the effects of which that is said, by their id or, for an expression, by its name.
///
/// # Errors
/// When the text is no TOML, or its `effect` is no list.
pub fn remove(text: &str, is_left_out: impl Fn(&str) -> bool) -> Result<String, EditError> {
    let mut document: DocumentMut = text.parse()?;
    let stays = |table: &dyn TableLike| name(table).is_none_or(|name| !is_left_out(name));
    match document.get_mut("effect") {
        None => {}
        Some(Item::ArrayOfTables(tables)) => tables.retain(|table| stays(table)),
        Some(Item::Value(Value::Array(entries))) => entries.retain(|entry| entry.as_inline_table().is_none_or(|table| stays(table))),
        Some(_) => return Err(EditError::NoList),
    }
    Ok(document.to_string())
}

/// What an effect is known by: expressions share an id.
pub(super) fn name(table: &dyn TableLike) -> Option<&str> {
    let text = |key: &str| table.get(key).and_then(Item::as_str);
    let id = text("id")?;
    Some(if id == expression::ID { text("name").unwrap_or(id) } else { id })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_goes_with_all_its_numbers_and_the_others_stay_as_they_are() {
        let first = "schema = 1 # first\n\n[[effect]]\nid = \"ohmic\" # always\n";
        let second = "\n# Slow.\n[[effect]]\nid = \"rc1\"\n[effect.tau_s]\nvalue = 50.0 # s\n";
        let third = "\n[[effect]]\nid = \"expression\"\nname = \"drift\"\nvoltage_v = \"0.01\"\n";
        let text = [first, second, third].concat();
        assert_eq!(remove(&text, |id| id == "rc1").unwrap(), [first, third].concat());
        assert_eq!(remove(&text, |id| id == "drift").unwrap(), [first, second].concat());
        assert_eq!(remove(&text, |_| false).unwrap(), text);
        let none: toml::Table = remove(&text, |_| true).unwrap().parse().unwrap();
        assert!(!none.contains_key("effect") && none.contains_key("schema"), "{none:?}");
        let inline = "effect = [{ id = \"ohmic\" }, { id = \"rc1\" }]\n";
        assert_eq!(remove(inline, |id| id == "ohmic").unwrap().replace(' ', ""), "effect=[{id=\"rc1\"}]\n");
        assert!(remove("effect = 1\n", |_| true).is_err());
    }
}
