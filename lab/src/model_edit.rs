//! Writes fitted numbers into a model's own text, so that comments and layout stay and a diff
//! shows the changed numbers only.

mod append;
mod facts;
mod remove;

pub use append::append;
pub use facts::{put_number, set_number, set_ocv};
pub use remove::remove;

use energy::{Model, OcvTable};
use toml_edit::{DocumentMut, InlineTable, Item, TableLike, Value};

/// New numbers of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Its effect.
    pub effect: String,
    /// Its name.
    pub parameter: String,
    /// New value, in the unit of the name.
    pub value: f64,
    /// Standard deviation of it. Where it is 0 nobody knows it, since nothing that is measured is exact: what the text says stays.
    pub sigma: f64,
    /// Least and greatest value that a reader of the text accepts.
    pub range: (f64, f64),
    /// Where the numbers come from.
    pub source: String,
    /// Whether to mark it as free where the text does not mention it yet.
    pub free: bool,
}

/// Why a text cannot be edited.
#[derive(Debug, thiserror::Error)]
pub enum EditError {
    /// It is no TOML.
    #[error(transparent)]
    Toml(#[from] toml_edit::TomlError),
    /// It has no such effect.
    #[error("the model's text has no effect `{0}` to write to")]
    NoEffect(String),
    /// It has no such key.
    #[error("the model's text has no `{0}` to write to")]
    NoKey(String),
    /// Its list of effects is none.
    #[error("`effect` in the model's text is no list of [[effect]] tables")]
    NoList,
}

/// The text with the changes; `inline_ocv` writes the OCV table into the text instead of the name
/// of a file, for a text that moves away from that file.
///
/// # Errors
/// When the text is no TOML or lacks an effect.
pub fn edit(text: &str, changes: &[Change], inline_ocv: Option<&OcvTable>) -> Result<String, EditError> {
    let mut document: DocumentMut = text.parse()?;
    for change in changes {
        let effect = effect(&mut document, &change.effect).ok_or_else(|| EditError::NoEffect(change.effect.clone()))?;
        write(effect, change);
    }
    if let Some(table) = inline_ocv {
        facts::inline(&mut document, table, None);
    }
    Ok(document.to_string())
}

/// The OCV table of a battery whose text names a file for it.
#[must_use]
pub fn ocv_of_file<'a>(model: &'a Model, text: &str) -> Option<&'a OcvTable> {
    let document: DocumentMut = text.parse().ok()?;
    document.get("battery")?.get("ocv_csv")?;
    match &model.facts {
        energy::Facts::Battery(facts) => Some(&facts.ocv),
        _ => None,
    }
}

fn effect<'a>(document: &'a mut DocumentMut, id: &str) -> Option<&'a mut dyn TableLike> {
    let is = |table: &dyn TableLike| remove::name(table) == Some(id);
    match document.get_mut("effect")? {
        Item::ArrayOfTables(tables) => tables.iter_mut().find(|table| is(*table)).map(|table| table as &mut dyn TableLike),
        Item::Value(Value::Array(entries)) => {
            let tables = entries.iter_mut().filter_map(Value::as_inline_table_mut);
            tables.into_iter().find(|table| is(*table)).map(|table| table as &mut dyn TableLike)
        }
        _ => None,
    }
}

fn write(effect: &mut dyn TableLike, change: &Change) {
    let (mut value, sigma) = numbers(change.value, change.sigma);
    let (min, max) = change.range;
    if value.parse().is_ok_and(|rounded: f64| rounded < min || rounded > max) {
        value = with_point(change.value.to_string());
    }
    match effect.get_mut(&change.parameter).and_then(Item::as_table_like_mut) {
        Some(parameter) => {
            set(parameter, "value", number(&value));
            if change.sigma > 0.0 {
                set(parameter, "sigma", number(&sigma));
            }
            set(parameter, "source", Value::from(change.source.as_str()));
        }
        None => {
            let mut parameter = InlineTable::new();
            parameter.insert("value", number(&value));
            if change.sigma > 0.0 {
                parameter.insert("sigma", number(&sigma));
            }
            parameter.insert("source", Value::from(change.source.as_str()));
            if change.free {
                parameter.insert("free", Value::from(true));
            }
            effect.insert(&change.parameter, Item::Value(Value::InlineTable(parameter)));
        }
    }
}

/// Replaces a value and keeps the blanks and comments around it.
fn set(table: &mut dyn TableLike, key: &str, mut new: Value) {
    if let Some(old) = table.get_mut(key).and_then(Item::as_value_mut) {
        *new.decor_mut() = old.decor().clone();
        *old = new;
        return;
    }
    // The last value of `{ a = 1 }` owns the blank before the brace; it belongs behind the new one.
    let last = table.iter().last().map(|(key, _)| key.to_owned());
    if let Some(last) = last.and_then(|key| table.get_mut(&key)).and_then(Item::as_value_mut) {
        if let Some(suffix) = last.decor().suffix().cloned() {
            new.decor_mut().set_suffix(suffix);
            last.decor_mut().set_suffix("");
        }
        new.decor_mut().set_prefix(" ");
    }
    table.insert(key, Item::Value(new));
}

/// A number in the text given.
fn number(text: &str) -> Value {
    text.parse().unwrap_or_else(|_| Value::from(text.parse::<f64>().unwrap_or_default()))
}

/// Value and sigma as short texts: two digits of sigma, and the value to at least six digits and
/// to a hundredth of sigma.
fn numbers(value: f64, sigma: f64) -> (String, String) {
    let rounded = if sigma > 0.0 && value != 0.0 {
        let needed = (value.abs() / sigma).log10().ceil() as i32 + 3;
        shortest(value, needed.clamp(6, 17) as usize)
    } else {
        value.to_string()
    };
    (with_point(rounded), with_point(shortest(sigma, 2)))
}

/// The number to so many significant digits, in its shortest spelling.
fn shortest(value: f64, digits: usize) -> String {
    let rounded: f64 = format!("{value:.0$e}", digits - 1).parse().unwrap_or(value);
    if rounded != 0.0 && !(1e-4..1e6).contains(&rounded.abs()) { format!("{rounded:e}") } else { rounded.to_string() }
}

/// TOML tells 1.0 from 1.
fn with_point(text: String) -> String {
    if text.contains(['.', 'e']) { text } else { text + ".0" }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# A cell.\nsystem = \"battery\"\n[battery]\nseries = 1\n# Where the table comes from.\nocv_csv = \"t.csv\" # the table\n\n[[effect]]\nid = \"ohmic\"   # always\nresistance_ohm = { value = 0.03, source = \"guess\", free = true }  # R0\n\n[[effect]]\nid = \"rc1\"\n[effect.tau_s]\nvalue = 50.0 # s\nsigma = 10.0\nsource = \"guess\"\n";

    fn change(effect: &str, parameter: &str, value: f64, sigma: f64) -> Change {
        Change {
            effect: effect.to_owned(),
            parameter: parameter.to_owned(),
            value,
            sigma,
            range: (0.0, 1e3),
            source: "fitted".to_owned(),
            free: false,
        }
    }

    #[test]
    fn only_the_numbers_change() {
        let changes = [change("ohmic", "resistance_ohm", 0.067_891_234, 0.003_21), change("rc1", "tau_s", 61.0, 2.0)];
        let expected = TEXT
            .replace(
                "value = 0.03, source = \"guess\", free = true }",
                "value = 0.0678912, source = \"fitted\", free = true, sigma = 0.0032 }",
            )
            .replace("value = 50.0 # s\nsigma = 10.0\nsource = \"guess\"", "value = 61.0 # s\nsigma = 2.0\nsource = \"fitted\"");
        assert_eq!(edit(TEXT, &changes, None).unwrap(), expected);
    }

    #[test]
    fn a_deviation_that_nobody_knows_leaves_the_old_one() {
        let text = edit(TEXT, &[change("ohmic", "resistance_ohm", 0.02, 0.0), change("rc1", "tau_s", 61.0, 0.0)], None).unwrap();
        assert!(text.contains("{ value = 0.02, source = \"fitted\", free = true }"), "{text}");
        assert!(text.contains("value = 61.0 # s\nsigma = 10.0\n"), "{text}");
    }

    #[test]
    fn a_parameter_that_the_text_left_out_is_added_to_its_effect() {
        let text = edit(TEXT, &[change("rc1", "resistance_ohm", 0.01, 0.001)], None).unwrap();
        let parsed: toml::Table = text.parse().unwrap();
        assert_eq!(parsed["effect"][1]["resistance_ohm"]["value"].as_float(), Some(0.01));
        assert!(edit(TEXT, &[change("thermal", "x", 1.0, 1.0)], None).is_err());
    }

    #[test]
    fn a_table_moves_into_the_text_with_its_comment() {
        let table = OcvTable::new(vec![0.0, 1.0], vec![3.0, 4.2]).unwrap();
        let text = edit(TEXT, &[], Some(&table)).unwrap();
        let expected = "# Where the table comes from.\n# Points of t.csv\nocv = { soc = [0, 1], voltage_v = [3, 4.2] } # the table\n";
        assert!(text.contains(expected) && !text.contains("ocv_csv"), "{text}");
    }

    #[test]
    fn a_value_at_its_bound_is_not_rounded_beyond_it() {
        let at_bound = Change { range: (0.0, 0.123_456_789), ..change("rc1", "tau_s", 0.123_456_789, 0.01) };
        assert!(edit(TEXT, &[at_bound], None).unwrap().contains("value = 0.123456789"));
    }

    #[test]
    fn numbers_keep_a_hundredth_of_sigma() {
        assert_eq!(numbers(0.123_456_789, 1e-9), ("0.123456789".to_owned(), "1e-9".to_owned()));
        assert_eq!(numbers(12.0, 0.0), ("12.0".to_owned(), "0.0".to_owned()));
    }
}
