//! Numbers that a logger writes when nothing was measured: of every column, or of one.

use std::fmt;
use std::str::FromStr;

use serde::de::{self, Deserialize, Deserializer};

/// A number that stands for "nothing was measured".
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// The column of which it says so, by the channel's name or the logger's; every one where there is none.
    pub column: Option<String>,
    /// The number, as the logger writes it.
    pub value: f64,
}

impl Mark {
    /// Whether it is meant for a column that goes by one of these names.
    pub(super) fn is_of(&self, names: [&str; 2]) -> bool {
        self.column.as_deref().is_none_or(|column| names.contains(&column))
    }
}

impl From<f64> for Mark {
    fn from(value: f64) -> Mark {
        Mark { column: None, value }
    }
}

impl FromStr for Mark {
    type Err = String;

    fn from_str(text: &str) -> Result<Mark, String> {
        let (column, number) = match text.rsplit_once('=') {
            Some((column, number)) => (Some(column.trim().to_owned()), number),
            None => (None, text),
        };
        match number.trim().parse() {
            Ok(value) if column.as_deref() != Some("") => Ok(Mark { column, value }),
            _ => Err("write a number, or COLUMN=NUMBER, for example -9999 or voltage_v=0".to_owned()),
        }
    }
}

impl<'de> Deserialize<'de> for Mark {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Mark, D::Error> {
        struct Visitor;
        impl de::Visitor<'_> for Visitor {
            type Value = Mark;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("a number, or a text such as \"voltage_v=0\"")
            }

            fn visit_f64<E>(self, value: f64) -> Result<Mark, E> {
                Ok(value.into())
            }

            fn visit_i64<E>(self, value: i64) -> Result<Mark, E> {
                Ok((value as f64).into())
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Mark, E> {
                text.parse().map_err(E::custom)
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_of_every_column_and_one_with_a_name_of_that_alone() {
        let of = |text: &str| text.parse::<Mark>();
        assert_eq!(of("-9999"), Ok(Mark { column: None, value: -9999.0 }));
        let one = of("voltage_v=0").unwrap();
        assert!(one.is_of(["voltage_v", "U"]) && one.is_of(["x", "voltage_v"]) && !one.is_of(["current_a", "I"]));
        assert!(of("=0").is_err() && of("voltage_v=low").is_err());
    }
}
