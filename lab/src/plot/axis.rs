//! Axes: round ticks, and units that fit.

/// One axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Label, with unit.
    pub label: String,
    /// Low end.
    pub low: f64,
    /// High end.
    pub high: f64,
}

impl Axis {
    /// An axis over all of these values with a little room; never of no length.
    #[must_use]
    pub fn over(label: String, values: impl Iterator<Item = f64>) -> Axis {
        let (low, high) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |ends, value| (ends.0.min(value), ends.1.max(value)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let room = if high > low { 0.05 * (high - low) } else { (low.abs() * 0.01).max(1e-6) };
        Axis { label, low: low - room, high: high + room }
    }

    /// Where a value lies, 0 at the low end and 1 at the high one.
    #[must_use]
    pub fn place(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// Round places, at most this many, with the words at them.
    #[must_use]
    pub fn ticks(&self, most: usize) -> Vec<(f64, String)> {
        let rough = (self.high - self.low) / most.max(1) as f64;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|step| step * power).into_iter().find(|step| *step >= rough * 0.999).unwrap_or(10.0 * power);
        let digits = (-(step * 1.001).log10().floor()).clamp(0.0, 9.0) as usize;
        let (first, last) = ((self.low / step - 1e-9).ceil() as i64, (self.high / step + 1e-9).floor() as i64);
        let tick = |index: i64| {
            let value = index as f64 * step;
            (value, format!("{:.digits$}", if index == 0 { 0.0 } else { value }).replace('-', "\u{2212}"))
        };
        (first..=last).map(tick).collect()
    }
}

/// A unit of time in which a span is read easily: seconds in it, and its name.
#[must_use]
pub fn time_unit(span_s: f64) -> (f64, &'static str) {
    match span_s {
        span if span <= 300.0 => (1.0, "s"),
        span if span <= 3.0 * 3600.0 => (60.0, "min"),
        span if span <= 4.0 * 86_400.0 => (3600.0, "h"),
        _ => (86_400.0, "days"),
    }
}

/// A unit in which numbers of this size are read easily: what to multiply with, and its name.
#[must_use]
pub fn readable_unit(largest: f64, unit: &str) -> (f64, String) {
    if largest < 0.999_5 && ["V", "A", "ohm", "W", "Ah"].contains(&unit) { (1e3, format!("m{unit}")) } else { (1.0, unit.to_owned()) }
}

/// A channel as people call it: `voltage_v` is voltage.
#[must_use]
pub fn title_of(channel: &str) -> String {
    let bare = channel.rsplit_once('_').map_or(channel, |(name, _)| name);
    bare.replace('_', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_lie_inside() {
        let words = |low, high, most| -> Vec<String> {
            Axis { label: String::new(), low, high }.ticks(most).into_iter().map(|tick| tick.1).collect()
        };
        assert_eq!(words(-0.13, 0.41, 6), ["\u{2212}0.1", "0.0", "0.1", "0.2", "0.3", "0.4"]);
        assert_eq!(words(0.0, 125.0, 5), ["0", "50", "100"]);
        assert_eq!(words(3.0, 3.1, 5), ["3.00", "3.02", "3.04", "3.06", "3.08", "3.10"]);
    }

    #[test]
    fn an_axis_has_a_length_whatever_the_values() {
        for values in [vec![], vec![2.0, 2.0], vec![f64::NAN], vec![0.0]] {
            let axis = Axis::over(String::new(), values.into_iter());
            assert!(axis.high > axis.low && !axis.ticks(5).is_empty());
        }
    }
}
