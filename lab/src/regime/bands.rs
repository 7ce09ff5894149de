//! Bands made of values: between edges, at values, or by name.

use super::{Columns, Dimension};

/// How a number is said.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    /// Name of the dimension.
    pub(super) name: &'static str,
    /// What to multiply values with before they are said.
    pub(super) factor: f64,
    /// What follows the number: ` degC`, ` % SoC`.
    pub(super) suffix: &'static str,
    /// The same after a 1.
    pub(super) singular: &'static str,
    /// What goes before the number of a single value.
    pub(super) preposition: &'static str,
}

impl Scale {
    /// Values said as they are.
    pub(super) const fn of(name: &'static str, suffix: &'static str) -> Scale {
        Scale { name, factor: 1.0, suffix, singular: suffix, preposition: "at" }
    }

    /// Things that are counted.
    pub(super) const fn count(name: &'static str, singular: &'static str, plural: &'static str) -> Scale {
        Scale { name, factor: 1.0, suffix: plural, singular, preposition: "with" }
    }

    /// Fractions said as percent.
    pub(super) const fn percent(name: &'static str, suffix: &'static str) -> Scale {
        Scale { factor: 100.0, ..Scale::of(name, suffix) }
    }
}

/// At most this many different values get a band each.
const MOST_VALUES: usize = 6;
/// About this many bands are made of a range.
const BANDS: f64 = 5.0;

/// A band for each value when there are few, else bands between round numbers; none when all
/// values are the same.
pub(super) fn by_number(scale: Scale, columns: &Columns<'_>) -> Option<Dimension> {
    let mut values: Vec<f64> = Vec::new();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for value in
        columns.iter().flatten().flat_map(|column| column.iter()).map(|value| value * scale.factor).filter(|value| value.is_finite())
    {
        (low, high) = (low.min(value), high.max(value));
        if values.len() <= MOST_VALUES && !values.contains(&value) {
            values.push(value);
        }
    }
    if values.len() < 2 {
        return None;
    }
    if values.len() <= MOST_VALUES {
        values.sort_unstable_by(f64::total_cmp);
        return Some(at_values(scale, &values, columns));
    }
    Some(between(scale, &round_edges(low, high), columns))
}

/// Round numbers between two ends, about [`BANDS`] of them apart.
fn round_edges(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / BANDS;
    let power = 10f64.powf(rough.log10().floor());
    let step = power * [1.0, 2.0, 5.0, 10.0].into_iter().find(|step| step * power >= rough * 0.999).unwrap_or(10.0);
    let first = (low / step).floor() as i64 + 1;
    let last = (high / step).ceil() as i64 - 1;
    (first..=last).map(|index| index as f64 * step).collect()
}

/// Bands between the given edges, the outer ones open.
pub(super) fn between(scale: Scale, edges: &[f64], columns: &Columns<'_>) -> Dimension {
    let last = edges.len();
    let unit = scale.suffix;
    let edge = |index: usize| said(edges[index]);
    let band = |index: usize| match index {
        0 => format!("< {}{unit}", edge(0)),
        index if index == last => format!("> {}{unit}", edge(last - 1)),
        index => format!("{} to {}{unit}", edge(index - 1), edge(index)),
    };
    let below = (1..=last).map(|end| ((0..end).collect(), format!("below {}{unit}", edge(end - 1))));
    let above = (1..=last).map(|begin| ((begin..=last).collect(), format!("above {}{unit}", edge(begin - 1))));
    let middle = (1..last).map(|index| (vec![index], format!("between {} and {}{unit}", edge(index - 1), edge(index))));
    let of = |value: f64| value.is_finite().then(|| edges.partition_point(|&edge| edge <= value * scale.factor));
    Dimension {
        name: scale.name,
        bands: (0..=last).map(band).collect(),
        groups: below.chain(above).chain(middle).collect(),
        of_row: sort(columns, of),
    }
}

fn at_values(scale: Scale, values: &[f64], columns: &Columns<'_>) -> Dimension {
    let unit = |value: f64| if value == 1.0 { scale.singular } else { scale.suffix };
    let bands: Vec<String> = values.iter().map(|&value| format!("{}{}", said(value), unit(value))).collect();
    let at = scale.preposition;
    let last = bands.len() - 1;
    let single = bands.iter().enumerate().map(|(index, band)| (vec![index], format!("{at} {band}")));
    let from = (1..last).map(|begin| ((begin..=last).collect(), format!("{at} {} or more", bands[begin])));
    let to = (1..last).map(|end| ((0..=end).collect(), format!("{at} {} or less", bands[end])));
    let groups = single.chain(from).chain(to).collect();
    let of = |value: f64| values.iter().position(|&known| known == value * scale.factor);
    Dimension { name: scale.name, groups, of_row: sort(columns, of), bands }
}

/// Bands with names: of each its name, and the words that say that rows lie in it.
pub(super) fn named(name: &'static str, bands: &[(&str, &str)], columns: &Columns<'_>, of: impl Fn(f64) -> usize) -> Dimension {
    Dimension {
        name,
        bands: bands.iter().map(|(band, _)| (*band).to_owned()).collect(),
        groups: bands.iter().enumerate().map(|(index, (_, words))| (vec![index], (*words).to_owned())).collect(),
        of_row: sort(columns, |value| value.is_finite().then(|| of(value))),
    }
}

fn sort(columns: &Columns<'_>, of: impl Fn(f64) -> Option<usize>) -> Vec<Vec<Option<usize>>> {
    let column = |column: &Option<&[f64]>| column.map_or_else(Vec::new, |values| values.iter().map(|&value| of(value)).collect());
    columns.iter().map(column).collect()
}

/// A number without rounding dust: 0.30000000000000004 is 0.3.
fn said(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_round_and_inside() {
        assert_eq!(round_edges(-9.0, 41.0), [0.0, 10.0, 20.0, 30.0, 40.0]);
        assert_eq!(round_edges(20.0, 26.5), [22.0, 24.0, 26.0]);
        let edges: Vec<String> = round_edges(0.0, 0.51).into_iter().map(said).collect();
        assert_eq!(edges, ["0.2", "0.4"]);
    }

    #[test]
    fn few_values_have_a_band_each_and_many_share_round_ones() {
        let scale = Scale::count("docked", " robot docked", " robots docked");
        let dimension = by_number(scale, &vec![Some(&[2.0, 0.0, 1.0, f64::NAN]), None]).unwrap();
        assert_eq!(dimension.bands, ["0 robots docked", "1 robot docked", "2 robots docked"]);
        assert_eq!(dimension.of_row, [vec![Some(2), Some(0), Some(1), None], vec![]]);
        assert!(dimension.groups.contains(&(vec![1, 2], "with 1 robot docked or more".to_owned())));
        let many: Vec<f64> = (0..100).map(|k| 20.0 + 0.1 * f64::from(k)).collect();
        let dimension = by_number(Scale::of("temperature", " degC"), &vec![Some(&many)]).unwrap();
        assert_eq!(dimension.bands, ["< 22 degC", "22 to 24 degC", "24 to 26 degC", "26 to 28 degC", "> 28 degC"]);
        assert!(dimension.groups.contains(&(vec![0, 1], "below 24 degC".to_owned())));
        assert_eq!(by_number(scale, &vec![Some(&[1.0; 9])]), None);
    }
}
