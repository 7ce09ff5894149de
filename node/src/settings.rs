//! One precedence for every program: a flag of its own, then `--set`, then the environment, then the
//! file, then what the program says by itself.

use anyhow::{Context, anyhow, bail, ensure};
use energy::document::{Document, DocumentError};
use serde::de::DeserializeOwned;
use toml_edit::{DocumentMut, Item, TableLike, Value};

/// Environment variables with this prefix set keys: `TENDER_SET_POLICY__CONFIDENCE=0.9` is
/// `policy.confidence = 0.9`.
pub const PREFIX: &str = "TENDER_SET_";

/// A key that is laid over a file.
#[derive(Debug, Clone)]
struct Change {
    /// What sets it, for people.
    origin: String,
    key: String,
    value: String,
    /// It is a text whatever it looks like: a password may be a number.
    is_text: bool,
}

/// A configuration of that file's text with the environment's and the command line's keys laid over it.
/// `sets` are `KEY=VALUE` as `--set` takes them; values are TOML, or plain text. `check` says what is wrong with a
/// configuration whose types are right.
///
/// # Errors
/// When it cannot be read: names the line of the file, or the variable or flag that is at fault.
pub fn read<T: DeserializeOwned>(file: &str, text: &str, sets: &[String], check: impl Fn(&T) -> anyhow::Result<()>) -> anyhow::Result<T> {
    let environment = std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    read_over(file, text, &changes(environment, sets)?, check)
}

fn read_over<T: DeserializeOwned>(
    file: &str,
    text: &str,
    changes: &[Change],
    check: impl Fn(&T) -> anyhow::Result<()>,
) -> anyhow::Result<T> {
    // What is wrong, as the file's fault and as a key's.
    let read = |text: &str| {
        let read = Document { file, text }.parse::<T>().map_err(|error| {
            let message = without_secrets(&error.message, text);
            (anyhow::Error::new(DocumentError { message: message.clone(), ..error }), message)
        });
        read.and_then(|config| match check(&config) {
            Ok(()) => Ok(config),
            Err(error) => {
                let why = format!("{error:#}");
                Err((error.context(file.to_owned()), why))
            }
        })
    };
    let changes = &with_texts(changes.to_vec(), |changes| {
        let error = Document { file, text: &overlay(text, changes).ok()? }.parse::<T>().err()?;
        Some(error.message)
    });
    read(&overlay(text, changes)?).map_err(|(error, why): (anyhow::Error, String)| {
        // Who reads well without a key, and not with it, has that key to blame.
        let first_bad = || (1..=changes.len()).find(|&count| overlay(text, &changes[..count]).is_ok_and(|text| read(&text).is_err()));
        let bad = read(text).is_ok().then(first_bad).flatten();
        bad.map_or_else(|| error, |count| anyhow!("{}: {why}", changes[count - 1].origin))
    })
}

/// A number that nobody sets: where it is wrong, the key that it stands for is at fault.
const PROBE: &str = "-7214390651";

/// The same, with those as texts that look like something else where a text is wanted. `wrong` is what is wrong with them first.
fn with_texts(mut changes: Vec<Change>, wrong: impl Fn(&[Change]) -> Option<String>) -> Vec<Change> {
    let wants_text = |changes: &[Change], index: usize| {
        let mut probed = changes.to_vec();
        probed[index].value = PROBE.to_owned();
        let wanted = |text: &str| wrong(&probed).is_some_and(|message| message.contains(&format!("`{PROBE}`, expected {text}")));
        wanted("a string") || wanted("path string")
    };
    // One is found at a time: the first that is wrong is told.
    while wrong(&changes).is_some_and(|message| message.contains("string"))
        && let Some(index) = (0..changes.len()).find(|&index| !changes[index].is_text && wants_text(&changes, index))
    {
        changes[index].is_text = true;
    }
    changes
}

/// Whether nobody but who set it may read what this key holds.
fn is_secret(key: &str) -> bool {
    key.split('.').any(|part| ["token", "password"].contains(&part.trim()))
}

/// A message about a text, in which values that are secret are not told.
fn without_secrets(message: &str, text: &str) -> String {
    fn shown(table: &dyn TableLike, found: &mut Vec<String>) {
        for (key, item) in table.iter() {
            if let Some(inner) = item.as_table_like() {
                shown(inner, found);
            } else if let Some(value) = item.as_value().filter(|_| is_secret(key)) {
                // As it is written, and as it is read.
                found.push(value.to_string().trim().to_owned());
                found.extend(value.as_str().map(ToOwned::to_owned));
                found.extend(value.as_integer().map(|number| number.to_string()));
                found.extend(value.as_float().map(|number| format!("{number:?}")));
            }
        }
    }
    let mut secrets = Vec::new();
    if let Ok(document) = text.parse::<DocumentMut>() {
        shown(document.as_table(), &mut secrets);
    }
    // Messages quote values one way or the other.
    secrets.iter().fold(message.to_owned(), |message, secret| {
        message
            .replace(&format!("`{secret}`"), "`...`")
            .replace(&format!("\"{secret}\""), "\"...\"")
            .replace(&format!("{secret:?}"), "\"...\"")
    })
}

fn changes(environment: impl Iterator<Item = (String, String)>, sets: &[String]) -> anyhow::Result<Vec<Change>> {
    let mut from_environment: Vec<Change> = environment
        .filter_map(|(name, value)| {
            let key = name.strip_prefix(PREFIX)?.to_lowercase().replace("__", ".");
            Some(Change { origin: name, key, value, is_text: false })
        })
        .collect();
    from_environment.sort_by(|a, b| a.origin.cmp(&b.origin));
    let from_flags = sets.iter().map(|set| {
        let (key, value) = set.split_once('=').with_context(|| format!("--set {set}: must be KEY=VALUE, such as policy.confidence=0.9"))?;
        let origin = if is_secret(key) { format!("--set {key}=...") } else { format!("--set {set}") };
        Ok(Change { origin, key: key.trim().to_owned(), value: value.trim().to_owned(), is_text: false })
    });
    from_environment.into_iter().map(Ok).chain(from_flags).collect()
}

fn overlay(text: &str, changes: &[Change]) -> anyhow::Result<String> {
    if changes.is_empty() {
        return Ok(text.to_owned());
    }
    // What is wrong with the file itself is told by whoever reads it, with its line.
    let Ok(mut document) = text.parse::<DocumentMut>() else { return Ok(text.to_owned()) };
    for Change { origin, key, value, is_text } in changes {
        let parsed = value.parse().ok().filter(|_| !is_text);
        set(document.as_table_mut(), key, parsed.unwrap_or_else(|| Value::from(value))).with_context(|| origin.clone())?;
    }
    Ok(document.to_string())
}

fn set(table: &mut dyn TableLike, key: &str, value: Value) -> anyhow::Result<()> {
    ensure!(!key.is_empty() && key.split('.').all(|part| !part.is_empty()), "`{key}` is no key, such as policy.confidence");
    let (first, rest) = key.split_once('.').map_or((key, None), |(first, rest)| (first, Some(rest)));
    let Some(rest) = rest else {
        table.insert(first, Item::Value(value));
        return Ok(());
    };
    let inner = table.entry(first).or_insert_with(toml_edit::table);
    match inner.as_table_like_mut() {
        Some(inner) => set(inner, rest, value),
        None => bail!("`{first}` is a value, not a table: it has no `{rest}`"),
    }
}

#[cfg(test)]
mod tests;
