//! Errors in the TOML files that people write, with the place and the nearest match.

use std::fmt;
use std::ops::Range;

use serde::de::DeserializeOwned;

/// What is wrong in a text, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DocumentError {
    /// The file, as the user named it.
    pub file: String,
    /// Line and column, counted from 1; none when the whole text is meant.
    pub place: Option<(usize, usize)>,
    /// What is wrong, and what is allowed.
    pub message: String,
}

impl fmt::Display for DocumentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.place {
            Some((line, column)) => write!(f, "{}:{line}:{column}: {}", self.file, self.message),
            None => write!(f, "{}: {}", self.file, self.message),
        }
    }
}

impl std::error::Error for DocumentError {}

/// A text with its name: what errors point into.
#[derive(Debug, Clone, Copy)]
pub struct Document<'a> {
    /// The file, as the user named it.
    pub file: &'a str,
    /// Its content.
    pub text: &'a str,
}

impl Document<'_> {
    /// Reads the text into a raw type that refuses unknown keys.
    ///
    /// # Errors
    /// With line, column, and for an unknown key the nearest known one.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, DocumentError> {
        toml::from_str(self.text).map_err(|error| {
            let message = with_near_match(error.message());
            match error.span() {
                Some(span) => self.error_at(span, message),
                None => self.error(message),
            }
        })
    }

    /// An error about the whole text.
    #[must_use]
    pub fn error(&self, message: impl Into<String>) -> DocumentError {
        DocumentError { file: self.file.to_owned(), place: None, message: message.into() }
    }

    /// An error about a stretch of bytes of the text.
    #[must_use]
    pub fn error_at(&self, span: Range<usize>, message: impl Into<String>) -> DocumentError {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |rest| rest.chars().count()) + 1;
        DocumentError { file: self.file.to_owned(), place: Some((line, column)), message: message.into() }
    }
}

/// Serde lists what it expected; the nearest of these is most often what was meant. Kinds of number and lists are told in words.
fn with_near_match(message: &str) -> String {
    let Some((problem, expected)) = message.split_once(", expected ") else { return message.to_owned() };
    if let Some((_, words)) = KINDS.iter().find(|(kind, _)| *kind == expected.trim_end()) {
        return format!("{problem}, expected {words}");
    }
    let Some(wrong) = problem.split('`').nth(1) else { return message.to_owned() };
    let known: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
    match nearest(wrong, known.iter().copied()) {
        Some(near) => format!("{problem}; did you mean `{near}`? Allowed: {}", known.join(", ")),
        None => message.to_owned(),
    }
}

/// What serde calls numbers and lists, and what people do.
const KINDS: [(&str, &str); 8] = [
    ("a sequence", "a list: `[a, b]`, or `[[name]]` before each of several tables"),
    ("u8", "a whole number from 0 to 255"),
    ("u16", "a whole number from 0 to 65535"),
    ("u32", "a whole number, 0 or more"),
    ("u64", "a whole number, 0 or more"),
    ("usize", "a whole number, 0 or more"),
    ("i64", "a whole number"),
    ("f64", "a number"),
];

/// The candidate that `wrong` was most likely meant to be, if any is close.
pub fn nearest<'a>(wrong: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .map(|candidate| (likeness(wrong, candidate), candidate))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

/// Between 0 and 1, which is the same but for capitals.
fn likeness(a: &str, b: &str) -> f64 {
    strsim::jaro_winkler(a, b).max(strsim::jaro_winkler(&a.to_lowercase(), &b.to_lowercase()))
}

/// The end of a sentence about a wrong name: "; did you mean `x`?" or a full stop.
pub fn hint<'a>(wrong: &str, candidates: impl Iterator<Item = &'a str>) -> String {
    nearest(wrong, candidates).map_or_else(|| ".".to_owned(), |near| format!("; did you mean `{near}`?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn capitals_make_no_name_a_different_one() {
        assert_eq!(nearest("RC1", ["rc2", "rc1", "ohmic"].into_iter()), Some("rc1"));
    }

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "only parsed")]
    struct Sample {
        capacity_ah: f64,
        #[serde(default)]
        series: u32,
    }

    #[test]
    fn an_unknown_key_is_named_with_line_and_near_match() {
        let error = Document { file: "pack.toml", text: "series = 3\ncapacity_aa = 2.0\n" }.parse::<Sample>().unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("pack.toml:2:1: unknown field `capacity_aa`"), "{text}");
        assert!(text.contains("did you mean `capacity_ah`?"), "{text}");
    }

    #[test]
    fn text_where_a_number_belongs_is_located() {
        let error = Document { file: "pack.toml", text: "capacity_ah = \"two\"\n" }.parse::<Sample>().unwrap_err();
        assert_eq!(error.place, Some((1, 15)), "{error}");
        assert!(error.to_string().ends_with("expected a number"), "{error}");
        let error = Document { file: "pack.toml", text: "capacity_ah = 2.0\nseries = -3\n" }.parse::<Sample>().unwrap_err();
        assert!(error.to_string().ends_with("expected a whole number, 0 or more"), "{error}");
    }

    #[test]
    fn one_table_where_several_may_stand_is_told_how_to_be_written() {
        #[derive(Debug, serde::Deserialize)]
        struct Fleet {
            #[expect(dead_code, reason = "only read")]
            station: Vec<Sample>,
        }
        let error = Document { file: "fleet.toml", text: "[station]\nseries = 3\n" }.parse::<Fleet>().unwrap_err();
        assert!(error.to_string().ends_with("expected a list: `[a, b]`, or `[[name]]` before each of several tables"), "{error}");
    }
}
