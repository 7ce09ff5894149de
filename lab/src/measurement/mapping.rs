//! Users' own columns and units: `temperature_degc=temp_K*1-273.15`.

use std::str::FromStr;

use energy::document::nearest;

/// One canonical column made from a source column: value × scale + offset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mapping {
    /// The name that the column gets.
    pub canonical: String,
    /// Source column with scale and offset, as written. Which part is the column's name can only
    /// be told with the header at hand, since names may hold `-` or `*`.
    pub expression: String,
}

/// Where the values of a mapped column come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Source {
    /// A column by index, with scale and offset.
    Column { index: usize, scale: f64, offset: f64 },
    /// The same number in every row.
    Constant(f64),
}

impl Source {
    /// The column, if it is one.
    pub(super) fn column(self) -> Option<usize> {
        match self {
            Source::Column { index, .. } => Some(index),
            Source::Constant(_) => None,
        }
    }
}

impl FromStr for Mapping {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=').map(|(canonical, expression)| (canonical.trim(), expression.trim())) {
            Some((canonical, expression)) if !canonical.is_empty() && !expression.is_empty() => {
                Ok(Mapping { canonical: canonical.to_owned(), expression: expression.to_owned() })
            }
            _ => Err("write CANONICAL=SOURCE[*SCALE][+/-OFFSET], for example temperature_degc=temp_K*1-273.15".to_owned()),
        }
    }
}

impl Mapping {
    /// Finds the source among the columns of a log.
    pub(super) fn resolve(&self, names: &[String]) -> Result<Source, String> {
        let text = self.expression.as_str();
        let mut tried = None;
        for (rest, offset) in offsets(text) {
            for (name, scale) in scales(rest) {
                if let Some(index) = names.iter().position(|known| known == name) {
                    return Ok(Source::Column { index, scale, offset });
                }
                tried = Some(name);
            }
        }
        if let Some(value) = text.parse::<f64>().ok().filter(|value| value.is_finite()) {
            return Ok(Source::Constant(value));
        }
        let divided = text.rsplit_once('/').filter(|(_, divisor)| number(divisor) == Some(0.0));
        if let Some((name, _)) = divided.filter(|(name, _)| names.iter().any(|known| known == name.trim())) {
            return Err(format!("`{}={text}`: `{}` cannot be divided by 0", self.canonical, name.trim()));
        }
        // The last reading cut off the most, so what is left is most likely a bare name.
        let name = tried.unwrap_or(text);
        let near =
            nearest(name, names.iter().map(String::as_str)).map_or_else(|| ".".to_owned(), |near| format!("; did you mean `{near}`?"));
        Err(format!("`{}={text}`: the log has no column `{name}`{near} Its columns: {}", self.canonical, names.join(", ")))
    }
}

/// Every way to read the text as `REST[+-]OFFSET`, the whole text first, then from the right.
fn offsets(text: &str) -> impl Iterator<Item = (&str, f64)> {
    let cuts = text.char_indices().rev().filter(|(at, sign)| *at > 0 && matches!(sign, '+' | '-'));
    std::iter::once((text, 0.0)).chain(cuts.filter_map(|(at, _)| Some((text[..at].trim(), number(&text[at..])?))))
}

/// Every way to read the text as `NAME*SCALE` or `NAME/DIVISOR`, the whole text first.
fn scales(text: &str) -> impl Iterator<Item = (&str, f64)> {
    let cuts = text.char_indices().rev().filter(|(at, sign)| *at > 0 && matches!(sign, '*' | '/'));
    std::iter::once((text, 1.0)).chain(cuts.filter_map(|(at, sign)| {
        let scale = number(&text[at + 1..])?;
        let scale = if sign == '*' { scale } else { 1.0 / scale };
        scale.is_finite().then_some((text[..at].trim(), scale))
    }))
}

fn number(text: &str) -> Option<f64> {
    let compact: String = text.split_whitespace().collect();
    compact.parse().ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolve(text: &str, names: &[&str]) -> Result<Source, String> {
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        format!("x={text}").parse::<Mapping>().unwrap().resolve(&names)
    }

    #[test]
    fn scale_and_offset_are_told_from_the_name_by_the_header() {
        let column = |index, scale, offset| Ok(Source::Column { index, scale, offset });
        assert_eq!(resolve("temp_K*1-273.15", &["time_s", "temp_K"]), column(1, 1.0, -273.15));
        assert_eq!(resolve("mv*1e-3", &["mv"]), column(0, 1e-3, 0.0));
        assert_eq!(resolve("mv/1000 + 2", &["mv"]), column(0, 1e-3, 2.0));
        assert_eq!(resolve("I-bat*-1", &["I", "I-bat"]), column(1, -1.0, 0.0));
        assert_eq!(resolve("I-2", &["I", "I-2"]), column(1, 1.0, 0.0));
        assert_eq!(resolve("25.5", &["I"]), Ok(Source::Constant(25.5)));
    }

    #[test]
    fn an_unknown_source_is_named_with_its_near_match() {
        let error = resolve("temp_k*1-273.15", &["time_s", "temp_K"]).unwrap_err();
        assert!(error.contains("no column `temp_k`; did you mean `temp_K`?"), "{error}");
        assert_eq!(resolve("mv/0", &["mv"]).unwrap_err(), "`x=mv/0`: `mv` cannot be divided by 0");
        assert!("voltage_v".parse::<Mapping>().is_err());
    }
}
