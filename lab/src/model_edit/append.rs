//! Appends effects to a model's text.

use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value};

use super::{EditError, effect};

/// The text with an `[[effect]]` of that id at its end, under a comment; nothing changes where it
/// has one already. Its parameters are written by [`super::edit`].
///
/// # Errors
/// When the text is no TOML, or its `effect` is no list.
pub fn append(text: &str, id: &str, comment: &str) -> Result<String, EditError> {
    let mut document: DocumentMut = text.parse()?;
    if effect(&mut document, id).is_some() {
        return Ok(text.to_owned());
    }
    match document.entry("effect").or_insert(Item::ArrayOfTables(ArrayOfTables::new())) {
        Item::ArrayOfTables(tables) => {
            let mut table = Table::new();
            table.decor_mut().set_prefix(format!("\n# {comment}\n"));
            table.insert("id", Item::Value(Value::from(id)));
            tables.push(table);
        }
        // `effect = [{ id = ".." }]` has no room for a comment.
        Item::Value(Value::Array(entries)) => {
            let mut entry = InlineTable::new();
            entry.insert("id", Value::from(id));
            entries.push(entry);
        }
        _ => return Err(EditError::NoList),
    }
    Ok(document.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_edit::{Change, edit};

    fn change(free: bool) -> Change {
        let (effect, parameter, source) = ("rc1".to_owned(), "tau_s".to_owned(), "fitted".to_owned());
        Change { effect, parameter, value: 30.0, sigma: 2.0, range: (1.0, 100.0), source, free }
    }

    #[test]
    fn an_effect_is_appended_once_and_nothing_else_changes() {
        let text = "schema = 1 # first\n\n[[effect]]\nid = \"ohmic\"  # always\n";
        let more = edit(&append(text, "rc1", "Found.").unwrap(), &[change(true)], None).unwrap();
        let own = "\n# Found.\n[[effect]]\nid = \"rc1\"\ntau_s = { value = 30.0, sigma = 2.0, source = \"fitted\", free = true }\n";
        assert_eq!(more, text.to_owned() + own);
        assert_eq!(append(&more, "rc1", "Again.").unwrap(), more);
    }

    #[test]
    fn a_model_without_effects_and_one_with_inline_effects_take_one_too() {
        for text in ["schema = 1\n", "schema = 1\neffect = []\n", "effect = [{ id = \"ohmic\" }]\n"] {
            let more = edit(&append(text, "rc1", "Found.").unwrap(), &[change(false)], None).unwrap();
            let parsed: toml::Table = more.parse().unwrap();
            let last = parsed["effect"].as_array().unwrap().last().unwrap();
            assert_eq!((last["id"].as_str(), last["tau_s"]["value"].as_float()), (Some("rc1"), Some(30.0)), "{more}");
        }
    }
}
