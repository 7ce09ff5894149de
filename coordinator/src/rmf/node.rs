//! A YAML text, asked for by path: what is not there, or is something else, is named with where it was
//! looked for and what was probably meant.

use std::ops::RangeInclusive;

use anyhow::{Context, anyhow, bail, ensure};
use energy::document::hint;
use serde_json::Value;

/// A place in a YAML text.
#[derive(Debug, Clone)]
pub(super) struct Node<'a> {
    file: &'a str,
    path: String,
    value: &'a Value,
}

/// Reads a text.
///
/// # Errors
/// With line and column.
pub(super) fn parse(file: &str, text: &str) -> anyhow::Result<Value> {
    serde_saphyr::from_str(text).map_err(|error| anyhow!("{file}: {error}"))
}

impl<'a> Node<'a> {
    pub(super) fn root(file: &'a str, value: &'a Value) -> Self {
        Self { file, path: String::new(), value }
    }

    /// Where this is, for errors.
    pub(super) fn place(&self) -> String {
        if self.path.is_empty() { self.file.to_owned() } else { format!("{}: {}", self.file, self.path) }
    }

    fn child(&self, key: &str, value: &'a Value) -> Self {
        let path = if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) };
        Self { file: self.file, path, value }
    }

    /// Its keys, in the order of their names.
    pub(super) fn keys(&self) -> impl Iterator<Item = &'a str> {
        self.value.as_object().into_iter().flat_map(|map| map.keys().map(String::as_str))
    }

    /// What stands under a key, if anything does.
    pub(super) fn get(&self, key: &str) -> Option<Self> {
        self.value.get(key).filter(|value| !value.is_null()).map(|value| self.child(key, value))
    }

    /// What must stand under a key.
    pub(super) fn need(&self, key: &str) -> anyhow::Result<Self> {
        self.get(key).with_context(|| {
            let there: Vec<&str> = self.keys().collect();
            let near = hint(key, there.iter().copied());
            let there = if there.is_empty() { "nothing".to_owned() } else { there.join(", ") };
            format!("{}: no `{key}`{near} There is: {there}", self.place())
        })
    }

    pub(super) fn number(&self, allowed: RangeInclusive<f64>) -> anyhow::Result<f64> {
        let number = self.value.as_f64().with_context(|| format!("{}: {} is not a number", self.place(), self.value))?;
        ensure!(allowed.contains(&number), "{} = {number}: must be between {} and {}", self.place(), allowed.start(), allowed.end());
        Ok(number)
    }

    pub(super) fn text(&self) -> anyhow::Result<&'a str> {
        self.value.as_str().with_context(|| format!("{}: {} is not a text", self.place(), self.value))
    }

    pub(super) fn is_text(&self) -> bool {
        self.value.is_string()
    }

    /// Whether it is `true`.
    pub(super) fn is_true(&self) -> bool {
        self.value.as_bool() == Some(true)
    }

    /// The elements of a list.
    pub(super) fn list(&self) -> anyhow::Result<Vec<Self>> {
        let Some(list) = self.value.as_array() else { bail!("{}: {} is not a list", self.place(), self.value) };
        let element = |(index, value)| Self { file: self.file, path: format!("{}[{index}]", self.path), value };
        Ok(list.iter().enumerate().map(element).collect())
    }

    /// What stands under each key.
    pub(super) fn entries(&self) -> anyhow::Result<Vec<(&'a str, Self)>> {
        let Some(map) = self.value.as_object() else { bail!("{}: {} is not a map", self.place(), self.value) };
        Ok(map.iter().map(|(key, value)| (key.as_str(), self.child(key, value))).collect())
    }
}
