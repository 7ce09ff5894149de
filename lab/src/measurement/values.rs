//! Values that no sensor can have measured: what loggers write when nothing was measured, and
//! what lies outside the range of its channel. They become missing, and that is said. What may be real is counted, and stays.

use std::ops::RangeInclusive;

use energy::Channel;

use super::some_places;
use super::times::short;

/// What loggers write for "not measured": fill values, and the ends of integer and float types.
pub(super) const SENTINELS: &[f64] = &[-999.0, -9999.0, -99999.0, -32768.0, 32767.0, 65535.0, 2147483647.0, -2147483648.0, 4294967295.0];
/// No measurement is this large; fill values of floats are.
const SENTINEL_MIN: f64 = 1e30;
/// A sentinel is told from a measurement by its distance from all others, in their spread.
const SENTINEL_SPREADS: f64 = 3.0;

/// What a register of 16 bits shows at its end, without a sign and with one: what a device sends for "not available". Most send it in thousandths
/// to tenths of our units.
const REGISTER_ENDS: [f64; 3] = [65535.0, 32767.0, -32768.0];
const REGISTER_PARTS: [f64; 4] = [10.0, 100.0, 1000.0, 10_000.0];
/// Others come no nearer to such an end, as a share of it: a sensor that is driven to its end shows what lies before it as well.
const REGISTER_ALONE: f64 = 0.1;

/// What a channel can hold at all, far wider than any machine that models are made of.
fn plausible(channel: Channel) -> RangeInclusive<f64> {
    match channel {
        Channel::VoltageV | Channel::PackVoltageV => 0.0..=2e3,
        Channel::CurrentA | Channel::PackCurrentA => -1e4..=1e4,
        // Narrow enough that room temperature in kelvin does not pass for Celsius.
        Channel::TemperatureDegc | Channel::AmbientDegc => -80.0..=200.0,
        Channel::PowerW | Channel::PackPowerW | Channel::ChargePowerW => -1e6..=1e6,
        // Not percent.
        Channel::Soc | Channel::RadioDuty | Channel::CpuUtil => -0.2..=1.5,
        Channel::CycleCount | Channel::CpuMhz | Channel::PayloadKg => 0.0..=1e6,
        Channel::AgeDays => 0.0..=1e5,
        Channel::SpeedMps => -200.0..=200.0,
        Channel::AccelMps2 | Channel::YawRateRadps | Channel::TailAngleRad => -1e3..=1e3,
        // Not degrees: a slope stays below a right angle.
        Channel::PitchRad => -1.6..=1.6,
        Channel::RadioTxDbm => -200.0..=100.0,
        _ => -1e9..=1e9,
    }
}

/// Share of values that a channel cannot hold from which on the unit is doubted. A guess: what goes wrong in a sensor is seldom.
const MANY: f64 = 0.02;
/// As many as that may go wrong in any log.
const FEW: usize = 3;

/// How the unit that people use most beside ours becomes ours.
fn likely_unit(channel: Channel) -> &'static str {
    match channel {
        Channel::TemperatureDegc | Channel::AmbientDegc => "*1-273.15",
        Channel::Soc | Channel::RadioDuty | Channel::CpuUtil => "/100",
        Channel::PitchRad => "*0.0174533",
        _ => "/1000",
    }
}

/// Makes known sentinels of a column, as the logger wrote it, missing. Returns what is to be said.
pub(super) fn without_sentinels(name: &str, raw: &mut [f64], lines: &[u64], places: &str) -> Option<String> {
    let listed = |value: f64| value.abs() >= SENTINEL_MIN || SENTINELS.contains(&value);
    if !raw.iter().copied().any(listed) {
        return None;
    }
    let others = raw.iter().copied().filter(|&value| value.is_finite() && !listed(value));
    let (low, high) = others.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    let reach = SENTINEL_SPREADS * (high - low) + 0.1 * low.abs().max(high.abs());
    let foreign =
        |value: f64| listed(value) && (value.abs() >= SENTINEL_MIN || (low <= high && (value < low - reach || value > high + reach)));
    let rows: Vec<usize> = (0..raw.len()).filter(|&row| foreign(raw[row])).collect();
    let first = raw[*rows.first()?];
    rows.iter().for_each(|&row| raw[row] = f64::NAN);
    Some(format!(
        "`{name}`: {} such as {} no measurement but a logger's sign for none: taken as missing ({})",
        count(rows.len(), "value"),
        if rows.len() == 1 { format!("{} is", plain(first)) } else { format!("{} are", plain(first)) },
        at(&rows, lines, places)
    ))
}

/// What is to be said about a column that shows the end of a register, as the logger wrote it, far from all others. It may be what a sensor
/// showed that was driven to its end.
pub(super) fn register_ends(name: &str, raw: &[f64], lines: &[u64], places: &str) -> Option<String> {
    let is_end = |value: f64| REGISTER_PARTS.iter().any(|part| REGISTER_ENDS.iter().any(|end| value == end / part));
    let known = || raw.iter().copied().filter(|value| !value.is_nan());
    let (least, greatest) = (known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max));
    let lies_alone = |end: f64| known().all(|value| value == end || (value - end).abs() > REGISTER_ALONE * end.abs());
    let ends: Vec<f64> = [least, greatest].into_iter().filter(|&end| least < greatest && is_end(end) && lies_alone(end)).collect();
    let told = |end: &f64| {
        let rows: Vec<usize> = (0..raw.len()).filter(|&row| raw[row] == *end).collect();
        format!(
            "`{name}`: {} of {end}, far from all others: a register of 16 bits shows that at its end; not removed, unless --missing {name}={end} \
             says that this is no measurement ({})",
            count(rows.len(), "value"),
            at(&rows, lines, places)
        )
    };
    (!ends.is_empty()).then(|| ends.iter().map(told).collect::<Vec<_>>().join("; "))
}

/// Makes values outside a channel's range missing, which come from a column of that name. Returns what is to be said.
///
/// # Errors
/// When most are outside: then the unit is wrong, not the sensor.
pub(super) fn within_range(
    channel: Channel,
    source: &str,
    values: &mut [f64],
    lines: &[u64],
    places: &str,
) -> Result<Option<String>, (usize, String)> {
    let range = plausible(channel);
    let rows: Vec<usize> = (0..values.len()).filter(|&row| !values[row].is_nan() && !range.contains(&values[row])).collect();
    let Some(&first) = rows.first() else { return Ok(None) };
    let known = values.iter().filter(|value| !value.is_nan()).count();
    let (name, low, high) = (channel.name(), plain(*range.start()), plain(*range.end()));
    let mapped =
        format!("is the unit right? Map it, for example --column {}", for_a_shell(&format!("{name}={source}{}", likely_unit(channel))));
    if 2 * rows.len() > known {
        let message = format!(
            "column `{name}`: {} of {known} values lie outside {low} to {high}, such as {}; {mapped}",
            rows.len(),
            plain(values[first])
        );
        return Err((first, message));
    }
    // An angle in degrees that is mostly small.
    let doubt = if rows.len() > FEW && rows.len() as f64 > MANY * known as f64 { format!("; {mapped}") } else { String::new() };
    let note = format!(
        "`{name}`: {} outside {low} to {high}, such as {}: taken as missing ({}){doubt}",
        count(rows.len(), "value"),
        plain(values[first]),
        at(&rows, lines, places)
    );
    rows.iter().for_each(|&row| values[row] = f64::NAN);
    Ok(Some(note))
}

/// A word as it is typed in a shell.
pub(super) fn for_a_shell(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "_-.=/*+".contains(c);
    if word.chars().all(plain) { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// Makes the numbers missing that the user names as a logger's sign for "not measured".
pub(super) fn without_given(raw: &mut [f64], given: &[f64]) {
    if !given.is_empty() {
        raw.iter_mut().filter(|value| given.contains(value)).for_each(|value| *value = f64::NAN);
    }
}

/// What is to be said about values that are missing. The first row never counts, and a logger
/// that opens its log with an unmeasured one does well.
pub(super) fn missing(name: &str, values: &[f64], lines: &[u64], places: &str) -> Option<String> {
    let rows: Vec<usize> = (1..values.len()).filter(|&row| values[row].is_nan()).collect();
    let some = !rows.is_empty();
    some.then(|| format!("`{name}`: {} of {} values are missing ({})", rows.len(), values.len(), at(&rows, lines, places)))
}

/// `1 value`, `2 values`.
pub(super) fn count(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

pub(super) fn at(rows: &[usize], lines: &[u64], places: &str) -> String {
    some_places(places, &rows.iter().map(|&row| lines[row]).collect::<Vec<_>>())
}

/// A number as the user would find it in the log.
pub(super) fn plain(value: f64) -> String {
    if value.abs() >= 1e9 { format!("{value:e}") } else { short_or_exact(value) }
}

fn short_or_exact(value: f64) -> String {
    let exact = value.to_string();
    if exact.len() <= 9 { exact } else { short(value) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINES: [u64; 5] = [2, 3, 4, 5, 6];

    fn cleaned(raw: [f64; 5], given: &[f64]) -> ([f64; 5], Option<String>) {
        let mut values = raw;
        without_given(&mut values, given);
        let notes = without_sentinels("u", &mut values, &LINES, "lines");
        (values.map(|value| if value.is_nan() { -1.0 } else { value }), notes)
    }

    #[test]
    fn fill_values_far_from_all_others_are_missing() {
        let (values, notes) = cleaned([3.7, -3.4028235e38, 3.6, 65535.0, -9999.0], &[]);
        assert_eq!(values, [3.7, -1.0, 3.6, -1.0, -1.0]);
        let note = "`u`: 3 values such as -3.4028235e38 are no measurement but a logger's sign for none: taken as missing (lines 3, 5, 6)";
        assert_eq!(notes.unwrap(), note);
    }

    #[test]
    fn a_number_that_others_come_near_is_a_measurement() {
        assert_eq!(cleaned([65530.0, 65535.0, 65533.0, 64000.0, 65000.0], &[]).0[1], 65535.0);
        assert_eq!(cleaned([32767.0; 5], &[]).0, [32767.0; 5]);
        assert_eq!(cleaned([1.0, 0.0, 2.0, 3.0, 0.0], &[0.0]).0, [1.0, -1.0, 2.0, 3.0, -1.0]);
    }

    #[test]
    fn what_a_channel_cannot_hold_is_missing_and_most_of_it_a_wrong_unit() {
        let mut values = [3.7, -0.001, 3.6, f64::NAN, 3.7];
        let note = within_range(Channel::VoltageV, "U_mV", &mut values, &LINES, "lines").unwrap().unwrap();
        assert!(values[1].is_nan());
        assert_eq!(note, "`voltage_v`: 1 value outside 0 to 2000, such as -0.001: taken as missing (line 3)");
        let (row, error) = within_range(Channel::TemperatureDegc, "T [K]", &mut [298.15; 5], &LINES, "lines").unwrap_err();
        assert!(row == 0 && error.contains("5 of 5 values lie outside -80 to 200, such as 298.15; is the unit right?"), "{error}");
        assert!(error.ends_with("for example --column 'temperature_degc=T [K]*1-273.15'"), "{error}");
    }

    #[test]
    fn the_end_of_a_register_is_told_where_nothing_comes_near() {
        let told = |raw: &[f64]| register_ends("current_a", raw, &LINES, "lines");
        let note = "`current_a`: 2 values of 655.35, far from all others: a register of 16 bits shows that at its end; not removed, unless \
                    --missing current_a=655.35 says that this is no measurement (lines 3, 4)";
        assert_eq!(told(&[2.28, 655.35, 655.35, f64::NAN, 2.28]).as_deref(), Some(note));
        assert!(told(&[3.7, 6.5535, 3.6, -32.768, 3.7]).unwrap().matches("far from all others").count() == 2);
        // A sensor that is driven to its end, and a column of nothing else.
        assert_eq!(told(&[2.0, 31.0, 32.767, 32.767, 2.0]), None);
        assert_eq!(told(&[32.767; 5]), None);
        assert_eq!(told(&[2.0, 65.0, 2.0, 2.0, 2.0]), None);
    }
}
