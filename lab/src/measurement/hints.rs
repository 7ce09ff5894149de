//! How a column of another name or unit may become one of ours, told by its name or its numbers: said to the user, never done for
//! him.

use energy::document::nearest;

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
    ("s", "us", "/1e6"),
    ("kg", "g", "/1000"),
];
/// A count of seconds since 1970 reaches this in the year 5138, one of milliseconds did in 1973.
const MILLISECONDS_MIN: f64 = 1e11;
/// The same of milliseconds and microseconds, and of microseconds and nanoseconds.
const MICROSECONDS_MIN: f64 = 1e14;
const NANOSECONDS_MIN: f64 = 1e17;

/// The last word of a name, which is its unit where it has one.
fn unit(name: &str) -> String {
    let bare = name.trim_end_matches([')', ']']);
    bare.rsplit(|c: char| !c.is_alphanumeric()).next().unwrap_or(bare).to_lowercase()
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

/// The same for a column of times, by its numbers where its name says nothing: those since 1970 tell their unit.
pub(super) fn conversion_of_time(wanted: &str, column: &str, first: Option<f64>) -> &'static str {
    match conversion(wanted, column) {
        "" => match first.unwrap_or(0.0) {
            time if time >= NANOSECONDS_MIN => "/1e9",
            time if time >= MICROSECONDS_MIN => "/1e6",
            time if time >= MILLISECONDS_MIN => "/1000",
            _ => "",
        },
        by_name => by_name,
    }
}

/// Why times in seconds that begin there are hardly seconds.
pub(super) fn odd_epoch(time_s: &[f64], column: &str, scale: f64) -> Option<String> {
    let (first, second) = (*time_s.first()?, *time_s.get(1)?);
    let how = conversion_of_time("time", "time", Some(first));
    let unit = match how {
        "/1000" => "milliseconds",
        "/1e6" => "microseconds",
        "/1e9" => "nanoseconds",
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
    match nearest(wanted, columns.into_iter()) {
        Some(near) => (format!("; did you mean `{near}`?"), as_flag(wanted, near, conversion(wanted, near))),
        None => (".".to_owned(), format!("--column {wanted}=SOURCE")),
    }
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
        assert_eq!(flag("current_a", "zzz"), "--column current_a=SOURCE");
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
        assert_eq!(conversion_of_time("time_s", "timestamp", Some(1.7645e12)), "/1000");
        assert_eq!(conversion_of_time("time_s", "timestamp", Some(1.7645e9)), "");
        assert_eq!(conversion_of_time("time_s", "timestamp", Some(1.7645e18)), "/1e9");
        assert_eq!(conversion_of_time("time_s", "time_ms", Some(0.0)), "/1000");
        let told = odd_epoch(&[1_764_500_000_000.0, 1_764_500_002_000.0], "timestamp", 1.0).unwrap();
        assert!(told.contains("2000 s apart") && told.ends_with("are they milliseconds: --column time_s=timestamp/1000?"), "{told}");
        assert_eq!(odd_epoch(&[1_764_500_000.0, 1_764_500_002.0], "timestamp", 1.0), None);
    }
}
