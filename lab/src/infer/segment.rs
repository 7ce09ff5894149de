//! The judged rows of one target of one log, and what a late sensor shows there.

use energy::Channel;

/// The judged rows of one target of one log.
#[derive(Debug, Clone)]
pub struct Segment {
    /// Index of the log.
    pub log: usize,
    /// The target.
    pub channel: Channel,
    /// Rows of the log that count.
    pub rows: Vec<usize>,
    /// Among the judged rows, counted from `begin`, the one that each of them goes into.
    pub(in crate::infer) block_of: Vec<usize>,
    /// How many of them each judged row is the mean of.
    pub counts: Vec<f64>,
    /// How many independent readings it is worth: fewer where readings are rounded and stay (see [`crate::rounding::worth`]).
    pub worth: Vec<f64>,
    /// Time of each judged row, s.
    pub time_s: Vec<f64>,
    /// What was measured.
    pub observed: Vec<f64>,
    /// Where its judged rows begin among all.
    pub begin: usize,
}

impl Segment {
    /// Between which judged rows stands what a sensor that reads `late_s` late shows at a row: the earlier, the later, and
    /// the share of the later. Before the first row and after the last nothing is known to change: those stand for it.
    pub(super) fn shown_late(&self, row: usize, late_s: f64) -> Between {
        let true_s = self.time_s[row] - late_s;
        let high = self.time_s.partition_point(|&time_s| time_s < true_s);
        match high.checked_sub(1) {
            Some(low) if high < self.time_s.len() => {
                let dt_s = self.time_s[high] - self.time_s[low];
                Between { low, high, share: (true_s - self.time_s[low]) / dt_s, per_s: dt_s.recip() }
            }
            _ => {
                let end = high.min(self.time_s.len() - 1);
                Between { low: end, high: end, share: 0.0, per_s: 0.0 }
            }
        }
    }

    /// How what a sensor shows at a row changes with the time by which it is late, per s: towards the row before where it is
    /// late, the next where it is early, both where it is prompt.
    pub(super) fn slope(&self, prompt: &[f64], row: usize, late_s: f64) -> f64 {
        let of = |between: Between| (prompt[between.low] - prompt[between.high]) * between.per_s;
        if late_s != 0.0 {
            return of(self.shown_late(row, late_s));
        }
        let next = row + 1;
        if row == 0 || next == self.time_s.len() {
            return 0.0;
        }
        let towards = |low: usize, high: usize| Between { low, high, share: 0.0, per_s: (self.time_s[high] - self.time_s[low]).recip() };
        f64::midpoint(of(towards(row - 1, row)), of(towards(row, next)))
    }

    /// Where its judged rows stand among all.
    #[must_use]
    pub fn range(&self) -> std::ops::Range<usize> {
        self.begin..self.begin + self.counts.len()
    }
}

/// A moment between two judged rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Between {
    /// The row before it.
    pub(super) low: usize,
    /// The row after it.
    pub(super) high: usize,
    /// Where it stands from one (0) to the other (1).
    pub(super) share: f64,
    /// What a second is of the time between them, 1/s.
    per_s: f64,
}
