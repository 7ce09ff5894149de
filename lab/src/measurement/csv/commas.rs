//! What a comma in a number means where semicolons or tabs separate columns: its decimal point, unless the file shows that it stands
//! between thousands.

use super::super::Mark;
use super::super::values::SENTINELS;

/// What was seen of the numbers of a file.
#[derive(Debug, Default)]
pub(super) struct Commas {
    /// Numbers that say that nothing was measured: they are not written as others are.
    marks: Vec<f64>,
    /// Whether a number had a comma.
    any: bool,
    /// The first number with a point, by line.
    point: Option<(u64, String)>,
    /// By column.
    columns: Vec<Column>,
}

#[derive(Debug, Default, Clone)]
struct Column {
    /// The first number with three digits behind its comma and no zero alone before it, as between thousands.
    grouped: Option<(u64, String)>,
    /// The first whole number of three digits.
    bare: Option<(u64, String)>,
    /// Whether a comma was a decimal point for sure, or a whole number had thousands and no comma.
    is_decimal: bool,
}

impl Commas {
    /// Nothing yet, of a log in which these stand for "nothing was measured".
    pub(super) fn beside(marks: &[Mark]) -> Commas {
        Commas { marks: SENTINELS.iter().copied().chain(marks.iter().map(|mark| mark.value)).collect(), ..Commas::default() }
    }

    /// A cell as a number with a point, where it has a comma in place of that.
    pub(super) fn of(&mut self, line: u64, column: usize, cell: &str) -> Option<String> {
        let number = decimal_comma(cell);
        if self.columns.len() <= column {
            self.columns.resize(column + 1, Column::default());
        }
        let seen = &mut self.columns[column];
        let first = |place: &mut Option<(u64, String)>| {
            place.get_or_insert_with(|| (line, cell.to_owned()));
        };
        if number.is_some() {
            self.any = true;
            if is_grouped(cell) { first(&mut seen.grouped) } else { seen.is_decimal = true }
        } else if let Some(digits) = digits(cell) {
            let is_mark = || cell.parse().is_ok_and(|value| self.marks.contains(&value));
            match digits.len() {
                3 if !is_mark() => first(&mut seen.bare),
                4.. if !is_mark() => seen.is_decimal = true,
                _ => {}
            }
        } else if self.point.is_none() && cell.contains('.') && cell.parse::<f64>().is_ok() {
            first(&mut self.point);
        }
        number
    }

    /// Whether a comma was a decimal point.
    pub(super) fn any(&self) -> bool {
        self.any
    }

    /// Where the numbers contradict that commas are decimal points: the line, and how.
    pub(super) fn check(&self) -> Result<(), (u64, String)> {
        let contradicts = |(line, comma): &(u64, String), (other, number): &(u64, String), what: &str| {
            let message = format!(
                "`{comma}` has a comma and `{number}` in line {other} {what}: are there commas between thousands? Take them out, or write all \
                 numbers with a decimal point, or all with a decimal comma"
            );
            Err((*line, message))
        };
        for column in self.columns.iter().filter(|column| !column.is_decimal) {
            match (&column.grouped, &self.point, &column.bare) {
                (Some(grouped), Some(point), _) => return contradicts(grouped, point, "a decimal point"),
                (Some(grouped), None, Some(bare)) => return contradicts(grouped, bare, "of the same column has none"),
                _ => {}
            }
        }
        Ok(())
    }
}

/// A number with a comma for its decimal point, with a point; none for anything else.
fn decimal_comma(text: &str) -> Option<String> {
    let number = text.replacen(',', ".", 1);
    (number != text && number.parse::<f64>().is_ok()).then_some(number)
}

/// The digits of a whole number; none for anything else.
fn digits(text: &str) -> Option<&str> {
    let bare = text.strip_prefix(['-', '+']).unwrap_or(text);
    (!bare.is_empty() && bare.bytes().all(|byte| byte.is_ascii_digit())).then_some(bare)
}

/// Whether a number with a comma could have it between its thousands.
fn is_grouped(text: &str) -> bool {
    let Some((thousands, rest)) = text.split_once(',') else { return false };
    let leads = digits(thousands).is_some_and(|digits| digits.len() <= 3 && !digits.starts_with('0'));
    leads && rest.len() == 3 && rest.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(rows: &[[&str; 2]]) -> Result<(), (u64, String)> {
        let mut commas = Commas::beside(&[(-777.0).into()]);
        for (line, row) in (2..).zip(rows) {
            row.iter().enumerate().for_each(|(column, cell)| {
                commas.of(line, column, cell);
            });
        }
        commas.check()
    }

    #[test]
    fn commas_between_thousands_are_told_from_decimal_ones() {
        let mixed = seen(&[["0", "800"], ["0.5", "1,250"]]).unwrap_err();
        let told = "`1,250` has a comma and `0.5` in line 3 a decimal point: are there commas between thousands? Take them out, or write all \
                    numbers with a decimal point, or all with a decimal comma";
        assert_eq!(mixed, (3, told.to_owned()));
        let (line, told) = seen(&[["0", "800"], ["1", "1,250"]]).unwrap_err();
        assert!(line == 3 && told.starts_with("`1,250` has a comma and `800` in line 2 of the same column has none"), "{told}");
        assert_eq!(seen(&[["999", "1"], ["1,000", "1"]]).unwrap_err().0, 3);
        // What decimal commas look like: small whole numbers, no more than a zero before the comma, other digits behind it.
        assert_eq!(seen(&[["0", "3,700"], ["1", "4"]]), Ok(()));
        assert_eq!(seen(&[["100", "3,700"], ["200", "3,800"]]), Ok(()));
        assert_eq!(seen(&[["0,125", "1"], ["999", "1"], ["1,125", "1"]]), Ok(()));
        assert_eq!(seen(&[["999,125", "1"], ["1000", "1"], ["1000,5", "1"]]), Ok(()));
        assert_eq!(seen(&[["1.2.3", "3,7"], ["v1.2", "3,8"]]), Ok(()));
    }

    #[test]
    fn a_whole_number_with_thousands_and_no_comma_groups_none_and_a_mark_says_nothing() {
        assert_eq!(seen(&[["1,250", "1"], ["1250", "1"]]), Ok(()));
        assert_eq!(seen(&[["1,250", "1"], ["1250", "1"], ["800", "0.5"]]), Ok(()));
        for mark in ["-9999", "-999", "65535", "-777"] {
            assert_eq!(seen(&[["0", "3,700"], ["1", "3,650"], ["2", mark]]), Ok(()), "{mark}");
            assert_eq!(seen(&[["800", "1"], ["1,250", "1"], [mark, "1"]]).unwrap_err().0, 3, "{mark}");
        }
        assert_eq!(seen(&[["0", "3,700"], ["2", "-778"]]).unwrap_err().0, 2);
    }

    #[test]
    fn a_point_refuses_only_commas_that_could_stand_between_thousands() {
        assert_eq!(seen(&[["0.0", "3,7"], ["1.5", "3,65"]]), Ok(()));
        assert_eq!(seen(&[["1.10", "3,700"], ["1.11", "3,65"]]), Ok(()));
        assert_eq!(seen(&[["1.10", "0,125"], ["1.11", "1,125"]]), Ok(()));
        // Another column's decimal comma says nothing of this one's.
        assert_eq!(seen(&[["0,5", "1,250"], ["1.5", "1,300"]]).unwrap_err().0, 2);
    }
}
