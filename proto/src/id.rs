//! Names of robots, stations and their parts.
//!
//! An id is always exactly one chunk of a Zenoh key expression: it cannot hold the
//! separator, a wildcard or anything else with a meaning there. The check happens once,
//! on construction, so that building a key needs no escaping and cannot fail.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use serde::de::{Deserialize, Deserializer, Error, Visitor};
use serde::ser::{Serialize, Serializer};

/// Longest id in characters (all of them ASCII, so also in bytes).
const CHARS_MAX: usize = 64;

/// A text that cannot be an id.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{text}` is not a {kind} id: allowed are 1 to 64 characters out of A-Z a-z 0-9 _ -, \
     the first one a letter or a digit"
)]
pub struct IdError {
    /// What the text was meant to name: `robot`, `station`, ...
    pub kind: &'static str,
    /// The offending text, shortened when it is long.
    pub text: String,
}

fn check(kind: &'static str, text: &str) -> Result<(), IdError> {
    let bytes = text.as_bytes();
    let starts_well = bytes.first().is_some_and(u8::is_ascii_alphanumeric);
    let safe = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-');
    if starts_well && bytes.len() <= CHARS_MAX && bytes.iter().all(safe) {
        return Ok(());
    }
    let mut shown: String = text.chars().take(CHARS_MAX + 1).collect();
    if shown.len() < text.len() {
        shown.push_str("...");
    }
    Err(IdError { kind, text: shown })
}

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident: $kind:literal;)+) => {$(
        $(#[$doc])*
        ///
        /// 1 to 64 characters of `A-Z a-z 0-9 _ -`, starting with a letter or digit.
        /// A copy shares the text: plans and schedules name the same robot many times.
        #[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(Arc<str>);

        impl $name {
            /// Checks the text and wraps it.
            pub fn new(text: impl AsRef<str>) -> Result<Self, IdError> {
                let text = text.as_ref();
                check($kind, text)?;
                Ok(Self(text.into()))
            }

            /// The text of the id.
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl FromStr for $name {
            type Err = IdError;
            fn from_str(text: &str) -> Result<Self, IdError> {
                Self::new(text)
            }
        }

        impl TryFrom<String> for $name {
            type Error = IdError;
            fn try_from(text: String) -> Result<Self, IdError> {
                Self::new(text)
            }
        }

        impl From<$name> for String {
            fn from(id: $name) -> String {
                id.as_str().to_owned()
            }
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                to.serialize_str(&self.0)
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                struct Text;
                impl Visitor<'_> for Text {
                    type Value = $name;
                    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                        f.write_str(concat!("a ", $kind, " id"))
                    }
                    fn visit_str<E: Error>(self, text: &str) -> Result<$name, E> {
                        $name::new(text).map_err(E::custom)
                    }
                }
                from.deserialize_str(Text)
            }
        }

        impl AsRef<str> for $name {
            fn as_ref(&self) -> &str {
                &self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(&self.0)
            }
        }
    )+};
}

ids! {
    /// One robot of a fleet.
    RobotId: "robot";
    /// One docking station.
    StationId: "station";
    /// One docking place of a station.
    BayId: "bay";
    /// One energy store inside a station, from which robots are serviced.
    PackId: "pack";
    /// One exchange battery kept by a station.
    SpareId: "spare";
    /// One installation: everything that a single coordinator looks after.
    SiteId: "site";
    /// One command; repeating it under the same id has no further effect.
    CommandId: "command";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accepts_plain_names_up_to_the_longest() {
        for text in ["r1", "R", "7", "dock-A_2", &"x".repeat(64)] {
            assert_eq!(RobotId::new(text).unwrap().as_str(), text);
        }
    }

    #[test]
    fn refuses_whatever_has_a_meaning_in_a_key_or_is_too_long() {
        let long = "x".repeat(65);
        for text in ["", "*", "a*", "a$b", "a/b", "a#", "a?", "a.b", "-a", "_a", "a b", "é", "a\0", &long] {
            assert!(StationId::new(text).is_err(), "{text:?} was accepted");
        }
    }

    #[test]
    fn error_shows_the_text_and_what_is_allowed() {
        let text = "bay 1".parse::<BayId>().unwrap_err().to_string();
        assert!(text.starts_with("`bay 1` is not a bay id"), "{text}");
        assert!(text.contains("1 to 64 characters"), "{text}");
        let error = BayId::new("y".repeat(9_999)).unwrap_err();
        assert!(error.text.len() < 80);
    }

    #[test]
    fn serde_checks_too() {
        assert!(serde_json::from_str::<PackId>("\"p1\"").is_ok());
        assert!(serde_json::from_str::<PackId>("\"p/1\"").is_err());
    }
}
