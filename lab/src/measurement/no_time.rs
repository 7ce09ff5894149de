//! What is said of a log without a column of times: which of its columns may be that.

use super::Table;
use super::hints::{as_flag, conversion, conversion_of_time};
use super::log::TIME;

/// The words of a name, in small letters.
pub(super) fn words(name: &str) -> impl Iterator<Item = String> + '_ {
    // A hump begins a word, as in `TestTime`.
    let mut spaced = String::new();
    for (letter, before) in name.chars().zip(std::iter::once(' ').chain(name.chars())) {
        if letter.is_uppercase() && before.is_lowercase() {
            spaced.push(' ');
        }
        spaced.extend(letter.to_lowercase());
    }
    let words: Vec<String> =
        spaced.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_owned).collect();
    words.into_iter()
}

/// The column that is most likely the time of a log, among these: that of the whole test before that of a date, and that before one of a step,
/// which begins again with each. None where none is named after a time.
pub(super) fn time_among(names: &[String]) -> Option<usize> {
    const WHOLE: [&str; 6] = ["test", "total", "elapsed", "timestamp", "run", "experiment"];
    const PART: [&str; 4] = ["step", "cycle", "dpt", "date"];
    let rank = |name: &String| {
        let words: Vec<String> = words(name).collect();
        let has = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
        let is_time = words.iter().any(|word| ["time", "timestamp", "t", "datetime"].contains(&word.as_str()));
        is_time.then(|| if has(&PART) { 2 } else { usize::from(!has(&WHOLE)) })
    };
    (0..names.len()).filter_map(|index| Some((rank(&names[index])?, index))).min().map(|(_, index)| index)
}

/// That a log has no times, and the flag that says which column they are.
pub(super) fn no_time(table: &Table) -> String {
    let names = &table.names;
    let first = names.first().map_or("nothing", String::as_str);
    let has = |is: fn(&str) -> bool| names.iter().flat_map(|name| words(name)).any(|word| is(&word));
    if has(|word| word.starts_with("freq")) && has(|word| word == "z") {
        return format!(
            "no `{TIME}` column: it looks like an impedance spectrum, and a log is measured over time; found `{}`",
            names.join(", ")
        );
    }
    let named = time_among(names);
    let near = named.map_or(".".to_owned(), |index| format!("; did you mean `{}`?", names[index]));
    let flag = match named.or_else(|| rises(table).then_some(0)) {
        Some(index) => {
            let of_units = table.units.as_ref().map_or("", |units| conversion(TIME, &units.of[index]));
            let by_name = conversion_of_time(TIME, &names[index], table.columns[index].numbers());
            as_flag(TIME, &names[index], if of_units.is_empty() { by_name } else { of_units })
        }
        None => format!("--column {TIME}=SOURCE"),
    };
    format!("no `{TIME}` column{near} The first column must be `{TIME}` in seconds, found `{first}`; map it: {flag}")
}

/// Whether the first column rises from row to row, and does not only count them.
fn rises(table: &Table) -> bool {
    let Some(numbers) = table.columns.first().map(super::Cells::numbers) else { return false };
    let counts = numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0) && numbers.first().is_some_and(|first| [0.0, 1.0].contains(first));
    numbers.len() > 1 && numbers.windows(2).all(|pair| pair[1] > pair[0]) && !counts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(header: &str, row: &[f64]) -> String {
        let mut table = Table::of(header.split(',').map(str::to_owned).collect(), "lines");
        for _ in 0..3 {
            table.columns.iter_mut().zip(row).for_each(|(column, number)| column.push(*number));
            table.lines.push(2);
        }
        no_time(&table)
    }

    #[test]
    fn the_flag_is_for_the_time_of_the_whole_test() {
        for (header, flag) in [
            ("Data_Point,Test_Time(s),Date_Time,Step_Time(s),Current(A)", "--column 'time_s=Test_Time(s)'"),
            ("DataPoint,Step Type,Time,Total Time,Current(A)", "--column 'time_s=Total Time'"),
            ("mode,ox/red,time/s,Ecell/V", "--column time_s=time/s"),
            ("Rec#,Cyc#,Step,TestTime,StepTime,Amps", "--column time_s=TestTime"),
            ("DataPoint,Total Time(h),Current(A)", "--column 'time_s=Total Time(h)*3600'"),
            ("n,I,U", "--column time_s=SOURCE"),
        ] {
            let told = told(header, &[1.0; 8]);
            assert!(told.ends_with(flag), "{header}: {told}");
        }
        assert!(told("freq_hz,z_re_ohm,z_im_ohm", &[1000.0, 0.03, 0.0]).contains("impedance spectrum"));
    }
}
