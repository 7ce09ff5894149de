//! Range checks that name the field, the value and what is allowed.

use std::fmt::Display;

use crate::estimate::Estimate;

/// A value that a message must not carry.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{field}` is {value}, allowed is {allowed}")]
pub struct MessageError {
    /// Path of the field, such as `soc.sigma`.
    pub field: String,
    /// The value found there.
    pub value: String,
    /// What would be allowed.
    pub allowed: String,
}

type Checked = Result<(), MessageError>;

/// A state of charge may overshoot its ends a little: gauges are not clamped, so that
/// their error stays visible.
const SOC: (f64, f64) = (-0.05, 1.05);

/// Refuses `field` unless `holds`.
pub(super) fn require(holds: bool, field: impl Display, value: impl Display, allowed: impl Display) -> Checked {
    match holds {
        true => Ok(()),
        false => Err(MessageError { field: field.to_string(), value: value.to_string(), allowed: allowed.to_string() }),
    }
}

/// Any number but NaN and infinity.
pub(super) fn finite(field: impl Display, value: f64) -> Checked {
    require(value.is_finite(), field, value, "a finite number")
}

/// A finite number within `low..=high`.
pub(super) fn within(field: impl Display, value: f64, low: f64, high: f64) -> Checked {
    let holds = value.is_finite() && (low..=high).contains(&value);
    require(holds, field, value, format_args!("{low} to {high}"))
}

/// A finite number, zero or more.
pub(super) fn not_negative(field: impl Display, value: f64) -> Checked {
    let holds = value.is_finite() && value >= 0.0;
    require(holds, field, value, "zero or more, and finite")
}

/// Finite value, finite sigma of zero or more.
pub(super) fn estimate(field: impl Display, estimate: Estimate) -> Checked {
    finite(format_args!("{field}.value"), estimate.value)?;
    not_negative(format_args!("{field}.sigma"), estimate.sigma)
}

/// An estimate whose value and sigma are no larger than anything that could be meant.
pub(super) fn estimate_within(field: impl Display, quantity: Estimate, most: f64) -> Checked {
    estimate(&field, quantity)?;
    within(format_args!("{field}.value"), quantity.value, -most, most)?;
    within(format_args!("{field}.sigma"), quantity.sigma, 0.0, most)
}

/// An estimate of something that cannot be below zero.
pub(super) fn estimate_not_negative(field: impl Display, quantity: Estimate) -> Checked {
    estimate(&field, quantity)?;
    not_negative(format_args!("{field}.value"), quantity.value)
}

/// An estimated state of charge.
pub(super) fn soc_estimate(field: impl Display, soc: Estimate) -> Checked {
    estimate(&field, soc)?;
    within(format_args!("{field}.value"), soc.value, SOC.0, SOC.1)
}

/// A list in which nothing may be named twice.
pub(super) fn distinct<T: Ord + Display>(field: impl Display, names: impl IntoIterator<Item = T>) -> Checked {
    let mut names: Vec<T> = names.into_iter().collect();
    names.sort();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => require(false, field, &pair[0], "every name at most once"),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_check_lets_a_number_pass_that_is_not_finite() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(finite("x", value).is_err());
            assert!(within("x", value, f64::NEG_INFINITY, f64::INFINITY).is_err());
            assert!(not_negative("x", value).is_err());
            assert!(estimate("x", Estimate::new(0.0, value)).is_err());
        }
    }

    #[test]
    fn ranges_include_their_ends() {
        assert!(within("x", -1.0, -1.0, 1.0).is_ok());
        assert!(within("x", 1.0, -1.0, 1.0).is_ok());
        assert!(not_negative("x", -0.0).is_ok());
        assert!(soc_estimate("x", Estimate::exact(1.05)).is_ok());
    }

    #[test]
    fn a_repeated_name_is_shown() {
        assert!(distinct("x", ["a", "b"]).is_ok());
        assert_eq!(distinct("x", ["b", "a", "b"]).unwrap_err().value, "b");
    }
}
