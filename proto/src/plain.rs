//! Text of others, made such that terminals and logs show it and do nothing else: an escape sequence would clear a
//! screen, a line break would begin a line that looks like one of ours.
//!
//! ```text
//!   in a message   codec.rs, for every text of it at once, before it is read
//!   elsewhere      `plain`, where the text comes in: keys, refusals
//! ```

use std::borrow::Cow;
use std::fmt::Write as _;

/// Whether a terminal would do something else with it than show it: control characters, and those that turn the direction of writing.
fn acts(c: char) -> bool {
    c.is_control() || matches!(c, '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The text with such characters as JSON escapes them: a line break is `\n`.
#[must_use]
pub fn plain(text: &str) -> Cow<'_, str> {
    if !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    let mut told = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            '\n' => told.push_str("\\n"),
            '\r' => told.push_str("\\r"),
            '\t' => told.push_str("\\t"),
            c if acts(c) => write!(told, "\\u{:04x}", u32::from(c)).expect("a text can be written to"),
            c => told.push(c),
        }
    }
    Cow::Owned(told)
}

/// JSON whose texts are [`plain`]; read again, it stays as it is. What is no JSON is left for the parser to refuse.
pub(crate) fn plain_json(bytes: &[u8]) -> Cow<'_, [u8]> {
    // Most messages have nothing of the kind: a backslash, or a first byte of what is no ASCII.
    if !bytes.iter().any(|&byte| byte == b'\\' || byte == 0x7f || byte == 0xc2 || byte == 0xe2) {
        return Cow::Borrowed(bytes);
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return Cow::Borrowed(bytes) };
    let mut told = String::with_capacity(text.len() + 16);
    let mut rest = text.chars();
    while let Some(c) = rest.next() {
        match c {
            '\\' => escape(&mut told, &mut rest),
            // Unescaped ones of ASCII stand between values, or are refused.
            c if acts(c) && (!c.is_ascii() || c == '\u{7f}') => {
                write!(told, "\\\\u{:04x}", u32::from(c)).expect("a text can be written to")
            }
            c => told.push(c),
        }
    }
    Cow::Owned(told.into_bytes())
}

/// What follows a backslash; one that makes a character which acts is escaped itself.
fn escape(told: &mut String, rest: &mut std::str::Chars<'_>) {
    told.push('\\');
    match rest.clone().next() {
        Some('b' | 'f' | 'n' | 'r' | 't') => told.push('\\'),
        Some('u') => {
            let hex = rest.as_str().get(1..5).filter(|hex| hex.bytes().all(|byte| byte.is_ascii_hexdigit()));
            let code = hex.and_then(|hex| u32::from_str_radix(hex, 16).ok());
            if code.and_then(char::from_u32).is_some_and(acts) {
                told.push('\\');
            }
        }
        // A quote or a backslash belongs to this one, and begins nothing.
        Some(c) => {
            told.push(c);
            rest.next();
        }
        None => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_shown() {
        assert_eq!(plain("\u{1b}[2J\nWARN all is well\u{9b}\u{202e}\u{7f}"), "\\u001b[2J\\nWARN all is well\\u009b\\u202e\\u007f");
        assert_eq!(plain("25 °C, “größer”, \\n"), "25 °C, “größer”, \\n");
    }

    #[test]
    fn a_text_in_json_is_what_it_is_elsewhere_and_stays_so() {
        for text in ["\u{1b}[2J\r\n\tx\u{8}\u{c}", "a\u{7f}b\u{85}c\u{2028}d", "\\n \\\\n \\u001b \"quoted\"", "25 °C “größer” 🔋"]
        {
            for json in [serde_json::to_string(text).unwrap(), serde_json::to_string(text).unwrap().replace("\\u001b", "\\u001B")] {
                let once = plain_json(json.as_bytes());
                let read: String = serde_json::from_slice(&once).unwrap();
                assert!(!read.contains(acts), "{read:?}");
                assert_eq!(plain_json(&once), once, "{read}");
                assert_eq!(read.replace("\\u0008", "\\b").replace("\\u000c", "\\f").to_lowercase(), {
                    let wanted = plain(text).into_owned();
                    wanted.replace("\\u0008", "\\b").replace("\\u000c", "\\f").to_lowercase()
                });
            }
        }
    }

    #[test]
    fn what_is_no_json_is_left_to_be_refused() {
        for bytes in [&b"{\"a\":\"\\"[..], b"\"\\u00", b"\"\\u\xc3\xa9", b"\xff\\n"] {
            assert!(serde_json::from_slice::<serde_json::Value>(&plain_json(bytes)).is_err());
        }
        // A raw line break within a text is not JSON, and must not become it.
        assert!(serde_json::from_slice::<String>(&plain_json(b"\"\\t\n\"")).is_err());
    }
}
