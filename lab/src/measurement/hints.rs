//! How a column of another name or unit may become one of ours, told by its name or its numbers: said to the user, never done for
//! him.

use std::ops::RangeInclusive;

use energy::document::nearest;

use super::no_time::words;
use super::values::for_a_shell;

/// What makes our unit, by its last word in our names, of another one by its last word in others' names.
const UNITS: &[(&str, &str, &str)] = &[
    ("degc", "k", "*1-273.15"),
    ("degc", "kelvin", "*1-273.15"),
    ("mps", "kmh", "/3.6"),
    ("degc", "f", "*0.5555555556-17.7777777778"),
    ("degc", "degf", "*0.5555555556-17.7777777778"),
    ("degc", "fahrenheit", "*0.5555555556-17.7777777778"),
    ("s", "min", "*60"),
    ("s", "mins", "*60"),
    ("s", "minute", "*60"),
    ("s", "minutes", "*60"),
    ("s", "h", "*3600"),
    ("s", "hr", "*3600"),
    ("s", "hrs", "*3600"),
    ("s", "hour", "*3600"),
    ("s", "hours", "*3600"),
    ("s", "days", "*86400"),
    ("s", "milliseconds", "/1000"),
    ("s", "msec", "/1000"),
    ("s", "us", "/1e6"),
    ("s", "usec", "/1e6"),
    ("a", "ua", "/1e6"),
    ("v", "uv", "/1e6"),
    ("kg", "g", "/1000"),
];
/// A count of seconds since 1970 reaches this in the year 5138, one of milliseconds did in 1973.
const MILLISECONDS_MIN: f64 = 1e11;
/// The same of milliseconds and microseconds, and of microseconds and nanoseconds.
const MICROSECONDS_MIN: f64 = 1e14;
const NANOSECONDS_MIN: f64 = 1e17;
/// Days as spreadsheets count them, from 1900 on: these were between 1982 and 2064. Their rows come closer than this part of a day, 86 s: a
/// log of seconds has such steps at more than a thousand rows a second alone.
const SERIAL_DAYS: RangeInclusive<f64> = 30_000.0..=60_000.0;
const SERIAL_STEP_MAX: f64 = 1e-3;
/// Words for what a channel of ours measures, in others' names of columns.
const QUANTITIES: [(&str, &[&str]); 3] = [
    ("current", &["current", "amps", "amp", "i"]),
    ("voltage", &["voltage", "volts", "volt", "ecell", "ewe", "u"]),
    ("temperature", &["temperature", "temp"]),
];

/// The last word of a name, which is its unit where it has one.
pub(super) fn unit(name: &str) -> String {
    let bare = name.trim_end_matches([')', ']']);
    let unit = bare.rsplit(|c: char| !c.is_alphanumeric()).next().unwrap_or(bare).to_lowercase();
    // Both letters stand for a millionth.
    if let Some(rest) = unit.strip_prefix(['\u{b5}', '\u{3bc}']) { format!("u{rest}") } else { unit }
}

/// What stands behind a column's name in `--column WANTED=...` when it is of the unit that its name says; nothing where that is ours or
/// not known.
#[must_use]
pub fn conversion(wanted: &str, column: &str) -> &'static str {
    let (ours, theirs) = (unit(wanted), unit(column));
    match theirs.strip_prefix('m') {
        Some(rest) if rest == ours => "/1000",
        _ => UNITS.iter().find(|(known, other, _)| *known == ours && *other == theirs).map_or("", |(_, _, how)| how),
    }
}

/// The same for a column of times, by its numbers where its name says nothing: those since 1970 tell their unit, and those of a spreadsheet.
pub(super) fn conversion_of_time(wanted: &str, column: &str, times: &[f64]) -> &'static str {
    match conversion(wanted, column) {
        "" => match times.iter().copied().find(|time| !time.is_nan()).unwrap_or(0.0) {
            time if time >= NANOSECONDS_MIN => "/1e9",
            time if time >= MICROSECONDS_MIN => "/1e6",
            time if time >= MILLISECONDS_MIN => "/1000",
            _ if are_serial_days(times) => "*86400",
            _ => "",
        },
        by_name => by_name,
    }
}

fn are_serial_days(times: &[f64]) -> bool {
    times.len() > 1 && times.iter().all(|time| SERIAL_DAYS.contains(time)) && (0.0..SERIAL_STEP_MAX).contains(&super::usual_step_s(times))
}

/// Why times in seconds that begin there are hardly seconds.
pub(super) fn odd_epoch(time_s: &[f64], column: &str, scale: f64) -> Option<String> {
    let (first, second) = (*time_s.first()?, *time_s.get(1)?);
    let how = conversion_of_time("time", "time", time_s);
    let unit = match how {
        "/1000" => "milliseconds",
        "/1e6" => "microseconds",
        "/1e9" => "nanoseconds",
        "*86400" => "days, as spreadsheets count them",
        _ => return None,
    };
    let better = if scale == 1.0 { format!(": {}", as_flag("time_s", column, how)) } else { String::new() };
    Some(format!(
        "times such as {first} s, {} s apart, are no seconds since any day that was: are they {unit}{better}?",
        super::short(second - first)
    ))
}

/// The flag that takes a channel from a column.
#[must_use]
pub fn as_flag(wanted: &str, column: &str, conversion: &str) -> String {
    format!("--column {}", for_a_shell(&format!("{wanted}={column}{conversion}")))
}

/// Of a log that holds no column of a name: what comes near, as the end of a sentence, and the flag that maps that or says how one is mapped.
#[must_use]
pub fn for_missing<'a>(wanted: &str, columns: impl Iterator<Item = &'a str>) -> (String, String) {
    let columns: Vec<&str> = columns.collect();
    if let Some((out, into)) = both_ways(wanted, &columns) {
        let words = format!(
            "; `{out}` and `{into}` look like its two halves, and a log has one column of both signs, positive while discharging: write \
             {wanted} = {out} - {into} into the file, where both hold amounts."
        );
        return (words, String::new());
    }
    match nearest(wanted, columns.iter().copied()).or_else(|| of_quantity(wanted, &columns)) {
        Some(near) => (format!("; did you mean `{near}`?"), as_flag(wanted, near, conversion(wanted, near))),
        None => (".".to_owned(), format!("--column {wanted}=SOURCE")),
    }
}

/// The column whose name says what the wanted one measures, in a unit of that; the shortest name of several, which says the least besides.
fn of_quantity<'a>(wanted: &str, columns: &[&'a str]) -> Option<&'a str> {
    let (_, says) = QUANTITIES.iter().find(|(quantity, _)| wanted.contains(quantity))?;
    let ours = unit(wanted);
    let fits = |column: &&&str| {
        let theirs = unit(column);
        let of_unit =
            theirs == ours || theirs == "c" && ours == "degc" || !conversion(wanted, column).is_empty() || says.contains(&theirs.as_str());
        of_unit && words(column).any(|word| says.contains(&word.as_str()))
    };
    columns.iter().filter(fits).min_by_key(|column| column.len()).copied()
}

/// Columns of a current that is told in two: what flows out and what flows in.
fn both_ways<'a>(wanted: &str, columns: &[&'a str]) -> Option<(&'a str, &'a str)> {
    let is_current = unit(wanted) == "a";
    let of = |name: &&&str| unit(name) == "a" || unit(name) == "ma";
    let goes_out = |name: &&str| name.to_lowercase().contains("discharg");
    let out = columns.iter().filter(of).find(|name| goes_out(name))?;
    let into = columns.iter().filter(of).find(|name| !goes_out(name) && name.to_lowercase().contains("charg"))?;
    is_current.then_some((*out, *into))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_tells_its_unit() {
        let flag = |wanted: &str, column: &str| for_missing(wanted, [column].into_iter()).1;
        assert_eq!(flag("current_a", "current_ma"), "--column current_a=current_ma/1000");
        assert_eq!(flag("voltage_v", "Voltage(mV)"), "--column 'voltage_v=Voltage(mV)/1000'");
        assert_eq!(flag("temperature_degc", "temperature_k"), "--column temperature_degc=temperature_k*1-273.15");
        assert_eq!(flag("speed_mps", "speed_kmh"), "--column speed_mps=speed_kmh/3.6");
        assert_eq!(flag("current_a", "current"), "--column current_a=current");
        assert_eq!(flag("time_s", "time(msec)"), "--column 'time_s=time(msec)/1000'");
        assert_eq!(flag("current_a", "current_ua"), "--column current_a=current_ua/1e6");
        assert_eq!(flag("voltage_v", "voltage_\u{b5}V"), "--column voltage_v=voltage_\u{b5}V/1e6");
        assert_eq!(flag("current_a", "zzz"), "--column current_a=SOURCE");
    }

    #[test]
    fn a_column_that_says_what_it_measures_is_near() {
        let flag = |wanted: &str| {
            let columns = ["time/s", "control/V/mA", "<I>/mA", "Pack Voltage (V)", "Pack Voltage rise (V)", "Temp 1 (\u{b0}F)", "State"];
            for_missing(wanted, columns.into_iter()).1
        };
        assert_eq!(flag("current_a"), "--column 'current_a=<I>/mA/1000'");
        assert_eq!(flag("voltage_v"), "--column 'voltage_v=Pack Voltage (V)'");
        assert_eq!(flag("temperature_degc"), "--column 'temperature_degc=Temp 1 (\u{b0}F)*0.5555555556-17.7777777778'");
        assert_eq!(flag("soc"), "--column soc=SOURCE");
        assert_eq!(for_missing("current_a", ["Rec", "Amps", "Volts"].into_iter()).1, "--column current_a=Amps");
    }

    #[test]
    fn a_current_in_two_columns_is_not_taken_for_one_of_them() {
        let columns = ["time_s", "charge_a", "discharge_a", "voltage_v"];
        let (words, flag) = for_missing("current_a", columns.into_iter());
        assert!(words.contains("write current_a = discharge_a - charge_a into the file"), "{words}");
        assert_eq!(flag, "");
        let (words, _) = for_missing("current_a", ["charge_a", "voltage_v"].into_iter());
        assert!(!words.contains("halves"), "{words}");
    }

    #[test]
    fn times_since_1970_tell_their_unit() {
        assert_eq!(conversion_of_time("time_s", "timestamp", &[1.7645e12]), "/1000");
        assert_eq!(conversion_of_time("time_s", "timestamp", &[1.7645e9]), "");
        assert_eq!(conversion_of_time("time_s", "timestamp", &[1.7645e18]), "/1e9");
        assert_eq!(conversion_of_time("time_s", "time_ms", &[0.0]), "/1000");
        let told = odd_epoch(&[1_764_500_000_000.0, 1_764_500_002_000.0], "timestamp", 1.0).unwrap();
        assert!(told.contains("2000 s apart") && told.ends_with("are they milliseconds: --column time_s=timestamp/1000?"), "{told}");
        assert_eq!(odd_epoch(&[1_764_500_000.0, 1_764_500_002.0], "timestamp", 1.0), None);
        // Days of a spreadsheet, and seconds that are as many.
        let days = [46_082.0, 46_082.000_011_57, 46_082.000_023_15];
        assert_eq!(conversion_of_time("time_s", "Date", &days), "*86400");
        assert!(odd_epoch(&days, "Date", 1.0).unwrap().ends_with("are they days, as spreadsheets count them: --column time_s=Date*86400?"));
        assert_eq!(conversion_of_time("time_s", "t", &[46_082.0, 46_083.0, 46_084.0]), "");
        assert_eq!(conversion_of_time("time_s", "t", &[40_000.0, 40_000.005, 40_000.01]), "");
        assert_eq!(conversion_of_time("time_s", "t", &[46_082.0, 46_082.000_694, 46_082.001_389]), "*86400");
    }
}
