//! Numbers as people read them: a value, its sigma, its unit, and the text of all three.

use energy::Estimate;
use energy::units::S_PER_H;
use serde::Serialize;

use crate::scheduler::{apart, short_of};

/// A number with its sigma. Pages show `text`; programs take `value` and `sigma`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// The expected value, in `unit`.
    pub value: f64,
    /// One standard deviation, in `unit`; 0 for what is exact.
    pub sigma: f64,
    /// Its unit: `Wh`, `W`, `%`, `s`, `V`, `°C`.
    pub unit: &'static str,
    /// All of it in words: `19.5 ± 1.0 %`.
    pub text: String,
}

/// Most digits after the point that are shown.
const DIGITS_MAX: i32 = 3;

/// A quantity whose digits end where its sigma does.
#[must_use]
pub fn quantity(estimate: Estimate, unit: &'static str) -> Quantity {
    let Estimate { value, sigma } = estimate;
    // The sigma's first digit, or its first two below 10: `22.83 ± 0.41`, but `22.8 ± 1.2`.
    let digits = if sigma > 0.0 { (1 - sigma.log10().floor() as i32).clamp(0, DIGITS_MAX) as usize } else { 1 };
    let digits = if sigma >= 1.0 { digits.min(1) } else { digits.min(2) };
    Quantity { value, sigma, unit, text: format!("{} ± {sigma:.digits$} {unit}", rounded(value, digits)) }
}

/// A number with that many digits; rounding leaves no minus before nothing.
fn rounded(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    if text.trim_start_matches(['-', '0', '.']).is_empty() { text.trim_start_matches('-').to_owned() } else { text }
}

/// A fraction as percent.
#[must_use]
pub fn percent(fraction: Estimate) -> Quantity {
    quantity(Estimate::new(100.0 * fraction.value, 100.0 * fraction.sigma), "%")
}

/// A probability in percent. Nothing is certain, and nothing that is told is impossible.
#[must_use]
pub fn likely(probability: f64) -> String {
    let percent = 100.0 * probability;
    if percent > 99.5 { "> 99 %".to_owned() } else { format!("{:.0} %", percent.max(1.0)) }
}

/// What a service is short of.
#[must_use]
pub fn short(wh: f64, [lacks_power, lacks_bay, lacks_spare, lacks_right_temperature]: [bool; 4]) -> String {
    match () {
        // Without it bays and spares are of no use.
        () if lacks_power => "power".to_owned(),
        () if lacks_bay => "a bay".to_owned(),
        () if lacks_spare => "a charged spare".to_owned(),
        () if lacks_right_temperature => "batteries neither too hot nor too cold".to_owned(),
        () => format!("{} Wh", short_of(wh)),
    }
}

/// A probability that is less than what was asked for shows that.
#[must_use]
pub fn likely_of(probability: f64, asked: f64) -> String {
    let text = likely(probability);
    if probability >= asked || text != likely(asked) {
        return text;
    }
    let [percent, _] = apart(100.0 * probability, 100.0 * asked);
    format!("{percent} %")
}

/// What a sensor shows: no sigma goes with it on the wire.
#[must_use]
pub fn reading(value: f64, unit: &'static str, digits: usize) -> Quantity {
    Quantity { value, sigma: 0.0, unit, text: format!("{} {unit}", rounded(value, digits)) }
}

const S_PER_MIN: f64 = 60.0;

/// A span of time: value and sigma in seconds, the text in the unit that fits.
#[must_use]
pub fn span(estimate_s: Estimate) -> Quantity {
    let Estimate { value, sigma } = estimate_s;
    let text = if value < 1.5 * S_PER_MIN {
        format!("{value:.0} ± {sigma:.0} s")
    } else if value < S_PER_H && sigma < S_PER_H {
        let digits = usize::from(sigma < 10.0 * S_PER_MIN);
        format!("{:.digits$} ± {:.digits$} min", value / S_PER_MIN, sigma / S_PER_MIN)
    } else {
        format!("{} ± {}", span_text(value), span_text(sigma))
    };
    Quantity { value, sigma, unit: "s", text }
}

/// `45 s`, `12 min`, `3 h 05 min`, `2 d 4 h`.
#[must_use]
pub fn span_text(span_s: f64) -> String {
    let span_s = span_s.max(0.0);
    if span_s.is_infinite() {
        return "for ever".to_owned();
    }
    let minutes = (span_s / S_PER_MIN).round() as u64;
    let hours = (span_s / S_PER_H).round() as u64;
    match span_s {
        _ if span_s < 1.5 * S_PER_MIN => format!("{span_s:.0} s"),
        _ if minutes < 60 => format!("{minutes} min"),
        _ if hours < 48 => format!("{} h {:02} min", minutes / 60, minutes % 60),
        _ => format!("{} d {} h", hours / 24, hours % 24),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(value: f64, sigma: f64) -> String {
        quantity(Estimate::new(value, sigma), "Wh").text
    }

    #[test]
    fn digits_end_where_the_sigma_does() {
        assert_eq!(text(22.834, 0.412), "22.83 ± 0.41 Wh");
        assert_eq!(text(22.834, 1.24), "22.8 ± 1.2 Wh");
        assert_eq!(text(1234.5, 23.4), "1234 ± 23 Wh");
        assert_eq!(text(0.5, 0.0004), "0.50 ± 0.00 Wh");
        assert_eq!(text(0.5, 0.0), "0.5 ± 0.0 Wh");
        assert_eq!(text(-0.001, 0.5), "0.00 ± 0.50 Wh");
        assert_eq!(percent(Estimate::new(0.195, 0.012)).text, "19.5 ± 1.2 %");
    }

    #[test]
    fn spans_are_told_in_the_unit_that_fits() {
        let told: Vec<String> = [45.0, 89.0, 720.0, 3599.0, 11_100.0, 187_200.0].into_iter().map(span_text).collect();
        assert_eq!(told, ["45 s", "89 s", "12 min", "1 h 00 min", "3 h 05 min", "2 d 4 h"]);
        let told = |value: f64, sigma: f64| span(Estimate::new(value, sigma)).text;
        assert_eq!(told(5000.0, 240.0), "1 h 23 min ± 4 min");
        assert_eq!(told(2004.0, 66.0), "33.4 ± 1.1 min");
        assert_eq!(told(40.0, 3.0), "40 ± 3 s");
        assert_eq!(reading(-0.001, "A", 2).text, "0.00 A");
    }

    #[test]
    fn what_is_less_than_asked_does_not_read_like_it() {
        let told = |probability: f64| likely_of(probability, 0.95);
        assert_eq!([0.951, 0.95, 0.9497, 0.9464, 0.5].map(told), ["95 %", "95 %", "94.97 %", "94.6 %", "50 %"]);
        assert_eq!(
            [12.34, 0.05, 0.012, 0.003, 0.0].map(|wh| short(wh, [false; 4])),
            ["12.3 Wh", "0.1 Wh", "0.01 Wh", "0.003 Wh", "0.0 Wh"]
        );
        let short_of = |lacks: [bool; 4]| short(7.0, lacks);
        assert_eq!(short_of([true, true, false, false]), "power");
        assert_eq!([short_of([false, true, false, false]), short_of([false, false, true, false])], ["a bay", "a charged spare"]);
    }
}
