//! Where the squared error lies: the shortest set of conditions that explains most of it.
//!
//! A condition is a group of bands of one regime ("below 15 % SoC"); a set holds one or two of
//! them. A set is good when it holds much of the error and few of the rows: the difference of the
//! two shares is 1 for an error that lies in one spot and 0 for one that is spread as the rows are.
//! A second condition must be worth its words, so it has a price.

use serde::Serialize;

use crate::regime::Dimension;

/// By how much a second condition must improve on the best single one.
const PRICE: f64 = 0.05;
/// Difference of shares below which nothing is worth a sentence.
const REMARKABLE: f64 = 0.1;
/// Share of the error that counts as most of it.
const MOST: f64 = 0.5;

/// One condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Condition {
    /// Name of the regime.
    pub dimension: &'static str,
    /// Its bands that are meant.
    pub bands: Vec<String>,
    /// The same in words.
    pub words: String,
}

/// Conditions under which much of the error lies, in few of the rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Concentration {
    /// One or two, of which all hold.
    pub conditions: Vec<Condition>,
    /// Share of the squared error, 0..1.
    pub share: f64,
    /// Share of the rows, 0..1.
    pub share_of_rows: f64,
}

impl Concentration {
    /// By how much the error is denser here than over all rows.
    fn excess(&self) -> f64 {
        self.share - self.share_of_rows
    }

    /// The conditions in words: `below 15 % SoC under load`.
    #[must_use]
    pub fn words(&self) -> String {
        match &self.conditions[..] {
            [one] => one.words.clone(),
            // "below 15 % SoC under load" needs no "and".
            [state, other] if state.dimension == "state" => format!("{} {}", other.words, state.words),
            [one, state] if state.dimension == "state" => format!("{} {}", one.words, state.words),
            all => all.iter().map(|condition| condition.words.as_str()).collect::<Vec<_>>().join(" and "),
        }
    }
}

/// The rows of one channel, from all logs: squared residual and, for each regime, the band.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sorted {
    /// Squared residuals.
    pub(crate) squares: Vec<f64>,
    /// For each regime, the band of each row.
    pub(crate) bands: Vec<Vec<Option<usize>>>,
}

impl Sorted {
    /// Rows that do not meet the conditions.
    pub(crate) fn without(&self, dimensions: &[Dimension], found: &Concentration) -> Sorted {
        let meets = |row: usize, condition: &Condition| {
            let Some(index) = dimensions.iter().position(|dimension| dimension.name == condition.dimension) else { return false };
            self.bands[index][row].is_some_and(|band| condition.bands.contains(&dimensions[index].bands[band]))
        };
        let kept: Vec<usize> =
            (0..self.squares.len()).filter(|&row| !found.conditions.iter().all(|condition| meets(row, condition))).collect();
        Sorted {
            squares: kept.iter().map(|&row| self.squares[row]).collect(),
            bands: self.bands.iter().map(|bands| kept.iter().map(|&row| bands[row]).collect()).collect(),
        }
    }
}

/// The shortest set that explains most; a set that explains less only when none explains most;
/// none when the error is spread about as the rows are.
pub(crate) fn worst(dimensions: &[Dimension], rows: &Sorted) -> Option<Concentration> {
    let mut sets: Vec<Concentration> = (0..dimensions.len()).flat_map(|index| singles(dimensions, rows, index)).collect();
    for a in 0..dimensions.len() {
        for b in a + 1..dimensions.len() {
            sets.extend(pairs(dimensions, rows, a, b));
        }
    }
    let best = |sets: &[Concentration], least: f64| {
        let worth = |set: &Concentration| set.excess() - PRICE * (set.conditions.len() as f64 - 1.0);
        let good = sets.iter().filter(|set| set.share >= least && worth(set) >= REMARKABLE);
        // Of equals the first: single conditions come first, and the regimes in order.
        good.fold(None, |best: Option<&Concentration>, set| match best {
            Some(known) if worth(set) <= worth(known) + 1e-9 => Some(known),
            _ => Some(set),
        })
        .cloned()
    };
    best(&sets, MOST).or_else(|| best(&sets, 0.0))
}

/// Squared error and rows.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    squares: f64,
    rows: f64,
}

impl Sum {
    fn add(&mut self, squares: f64, rows: f64) {
        self.squares += squares;
        self.rows += rows;
    }
}

fn concentration(sum: Sum, rows: &Sorted, conditions: Vec<Condition>) -> Concentration {
    let squares: f64 = rows.squares.iter().sum();
    let share = if squares > 0.0 { sum.squares / squares } else { 0.0 };
    Concentration { conditions, share, share_of_rows: sum.rows / rows.squares.len().max(1) as f64 }
}

fn condition(dimension: &Dimension, (bands, words): &(Vec<usize>, String)) -> Condition {
    let bands = bands.iter().map(|&band| dimension.bands[band].clone()).collect();
    Condition { dimension: dimension.name, bands, words: words.clone() }
}

fn singles(dimensions: &[Dimension], rows: &Sorted, index: usize) -> Vec<Concentration> {
    let dimension = &dimensions[index];
    let mut cells = vec![Sum::default(); dimension.bands.len()];
    for (&squares, band) in rows.squares.iter().zip(&rows.bands[index]) {
        if let Some(band) = *band {
            cells[band].add(squares, 1.0);
        }
    }
    let set = |group: &(Vec<usize>, String)| {
        let mut sum = Sum::default();
        group.0.iter().for_each(|&band| sum.add(cells[band].squares, cells[band].rows));
        concentration(sum, rows, vec![condition(dimension, group)])
    };
    dimension.groups.iter().map(set).collect()
}

/// The best intersection of two regimes, if any.
fn pairs(dimensions: &[Dimension], rows: &Sorted, a: usize, b: usize) -> Option<Concentration> {
    let width = dimensions[b].bands.len();
    let mut cells = vec![Sum::default(); dimensions[a].bands.len() * width];
    for ((&squares, a), b) in rows.squares.iter().zip(&rows.bands[a]).zip(&rows.bands[b]) {
        if let (Some(a), Some(b)) = (*a, *b) {
            cells[a * width + b].add(squares, 1.0);
        }
    }
    let whole: f64 = rows.squares.iter().sum();
    let count = rows.squares.len() as f64;
    let mut best: Option<(f64, Sum, usize, usize)> = None;
    for (i, (bands_a, _)) in dimensions[a].groups.iter().enumerate() {
        for (j, (bands_b, _)) in dimensions[b].groups.iter().enumerate() {
            let mut sum = Sum::default();
            for cell in bands_a.iter().flat_map(|&a| bands_b.iter().map(move |&b| a * width + b)) {
                sum.add(cells[cell].squares, cells[cell].rows);
            }
            // What holds most of the error goes before what is denser but holds less.
            let excess = sum.squares / whole - sum.rows / count + if sum.squares >= MOST * whole { 1.0 } else { 0.0 };
            if best.is_none_or(|(known, ..)| excess > known + 1e-9) {
                best = Some((excess, sum, i, j));
            }
        }
    }
    let (_, sum, i, j) = best?;
    let conditions = vec![condition(&dimensions[a], &dimensions[a].groups[i]), condition(&dimensions[b], &dimensions[b].groups[j])];
    Some(concentration(sum, rows, conditions))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dimension(name: &'static str, words: &[&str]) -> Dimension {
        let bands = words.iter().map(|&band| band.to_owned()).collect();
        let groups = words.iter().enumerate().map(|(index, &words)| (vec![index], words.to_owned())).collect();
        Dimension { name, bands, groups, of_row: Vec::new() }
    }

    fn setting(square: impl Fn(usize, usize) -> f64) -> (Vec<Dimension>, Sorted) {
        let dimensions = vec![dimension("soc", &["below 50 % SoC", "above 50 % SoC"]), dimension("state", &["at rest", "under load"])];
        let cells: Vec<(usize, usize)> = (0..400).map(|row| (row % 2, row / 2 % 2)).collect();
        let squares = cells.iter().map(|&(soc, state)| square(soc, state)).collect();
        let bands = vec![cells.iter().map(|cell| Some(cell.0)).collect(), cells.iter().map(|cell| Some(cell.1)).collect()];
        (dimensions, Sorted { squares, bands })
    }

    #[test]
    fn two_conditions_are_named_only_when_both_matter() {
        let (dimensions, rows) = setting(|soc, state| if (soc, state) == (0, 1) { 17.0 } else { 1.0 });
        let found = worst(&dimensions, &rows).unwrap();
        assert_eq!(found.words(), "below 50 % SoC under load");
        assert!((found.share - 0.85).abs() < 1e-12 && (found.share_of_rows - 0.25).abs() < 1e-12);
        assert_eq!(worst(&dimensions, &rows.without(&dimensions, &found)), None);
        let (dimensions, rows) = setting(|soc, _| if soc == 0 { 9.0 } else { 1.0 });
        let found = worst(&dimensions, &rows).unwrap();
        assert_eq!((found.words().as_str(), found.conditions.len()), ("below 50 % SoC", 1));
    }

    #[test]
    fn an_error_spread_as_the_rows_are_gives_no_sentence() {
        let (dimensions, rows) = setting(|_, _| 1.0);
        assert_eq!(worst(&dimensions, &rows), None);
        let (dimensions, rows) = setting(|_, _| 0.0);
        assert_eq!(worst(&dimensions, &rows), None);
    }
}
