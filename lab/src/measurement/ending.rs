//! Whether a last row without a line end is whole. Many programs write no end after the last line, and
//! a logger that was stopped leaves as little; only the last cell tells them apart: what was cut has
//! fewer digits than such cells have.

/// Of the cells seen, one in this many must have been as short.
const RARE: usize = 20;

/// Lengths of the cells of one kind: how many there are of each.
#[derive(Debug, Default)]
struct Lengths {
    counts: Vec<usize>,
    all: usize,
}

impl Lengths {
    fn add(&mut self, length: usize) {
        if length >= self.counts.len() {
            self.counts.resize(length + 1, 0);
        }
        self.counts[length] += 1;
        self.all += 1;
    }

    /// Whether so short a cell is no rarity.
    fn usual(&self, length: usize) -> bool {
        let shorter: usize = self.counts.iter().take(length + 1).sum();
        shorter > 0 && shorter * RARE >= self.all
    }
}

/// What the last cells of a log's rows look like.
#[derive(Debug, Default)]
pub(super) struct LastCells {
    /// Digits after the point.
    decimals: Lengths,
    /// Characters of numbers without a point.
    whole: Lengths,
    /// The same of zeros alone: they may be written short where nothing else is.
    zeros: Lengths,
    texts: Lengths,
    missing: usize,
}

impl LastCells {
    /// Takes the last cell of a row that is known to be whole.
    pub(super) fn add(&mut self, cell: &str) {
        match cell.parse::<f64>() {
            _ if cell.is_empty() => self.missing += 1,
            Ok(0.0) => self.zeros.add(cell.len()),
            Ok(_) => {
                let decimals = decimals(cell);
                self.decimals.add(decimals);
                if decimals == 0 {
                    self.whole.add(cell.len());
                }
            }
            Err(_) => self.texts.add(cell.len()),
        }
    }

    /// Whether this cell, at whose end no line ends, is as long as others are. The first row has
    /// none to be compared with.
    pub(super) fn looks_whole(&self, cell: &str) -> bool {
        let all = self.decimals.all + self.zeros.all + self.texts.all + self.missing;
        let common = |count: usize| count > 0 && count * RARE >= all;
        match cell.parse::<f64>() {
            _ if all == 0 => true,
            _ if cell.is_empty() => common(self.missing),
            Ok(0.0) if common(self.zeros.all) => self.zeros.usual(cell.len()),
            Ok(_) => {
                let decimals = decimals(cell);
                self.decimals.usual(decimals) && (decimals > 0 || self.whole.usual(cell.len()))
            }
            Err(_) => self.texts.usual(cell.len()),
        }
    }
}

fn decimals(cell: &str) -> usize {
    cell.split_once('.').map_or(0, |(_, after)| after.bytes().take_while(u8::is_ascii_digit).count())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(cells: &[&str], last: &str) -> bool {
        let mut seen = LastCells::default();
        cells.iter().for_each(|cell| seen.add(cell));
        seen.looks_whole(last)
    }

    #[test]
    fn a_number_with_fewer_digits_than_all_others_was_cut() {
        let volts = ["4.10000", "3.95432", "3.90000"];
        assert!(whole(&volts, "3.89123") && whole(&volts, "12.89123"));
        for cut in ["3.8912", "3.", "3", "-", ""] {
            assert!(!whole(&volts, cut), "{cut}");
        }
        assert!(whole(&["3912", "3897"], "3881") && !whole(&["3912", "3897"], "388"));
    }

    #[test]
    fn a_number_as_short_as_others_are_now_and_then_is_whole() {
        let shortest = ["4.1", "3.95", "4", "3.952"];
        assert!(whole(&shortest, "3.9") && whole(&shortest, "4"));
        let mostly_rest = ["0", "0", "2.08105", "0", "2.08111"];
        assert!(whole(&mostly_rest, "0") && !whole(&mostly_rest, "2"));
        assert!(whole(&["1", "", "2"], "") && whole(&[], "3"));
        assert!(whole(&["mud", "grass"], "mud") && !whole(&["mud", "grass"], "gr"));
    }
}
