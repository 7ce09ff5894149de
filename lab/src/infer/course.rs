//! How a model walks a log: as few steps as show all that is judged.
//!
//! Rows that go into one mean, and over which every input holds within its sensor's noise, become
//! one step with the means of the inputs, two or more for a mean. What a model shows within two such
//! steps is taken from the parabola through their ends (Simpson's rule), within a single one from the
//! straight line, since means are short beside the time since an input jumped; but for the open-circuit
//! voltage, which bends where its table does.

use std::ops::RangeInclusive;

use energy::Channel;

use super::evidence::Segment;
use super::steady::Steady;
use crate::prepare::Prepared;

/// A log as a model walks it.
#[derive(Debug, Clone)]
pub(super) struct Course {
    /// Times at which the steps end, s; the first is where the walk begins.
    pub(super) time_s: Vec<f64>,
    /// Inputs; a value holds over the step that ends there.
    pub(super) inputs: Vec<(Channel, Vec<f64>)>,
    /// What each step shows, step by step.
    shows: Vec<Show>,
    /// Where the shows of each step begin; one more than there are steps.
    first: Vec<usize>,
}

/// The share of one step in a judged row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Show {
    /// Place of the segment among all.
    pub(super) segment: usize,
    /// The judged row among all.
    pub(super) row: usize,
    /// Weights of what is shown at the end of the step, at its beginning, and at the beginning of the step before.
    pub(super) weights: [f64; 3],
    /// Rows of the log in the step, and in the one before where both count together.
    pub(super) rows: [usize; 2],
    /// Weight of each of them.
    pub(super) each: f64,
}

impl Course {
    /// Every row is a step.
    pub(super) fn row_by_row(index: usize, log: &Prepared, segments: &[Segment]) -> Course {
        Course::of(index, log, segments, &(0..log.time_s.len()).map(|row| End { row, goes_on: false }).collect::<Vec<_>>(), line)
    }

    /// Rows that hold and go into one mean are a step, or as many steps as are asked for.
    pub(super) fn in_means(index: usize, log: &Prepared, segments: &[Segment], steps: usize, steady: &Steady<'_>) -> Course {
        Course::of(index, log, segments, &ends(index, log, segments, steps, steady), line)
    }

    /// The same in one step each, for a model that forgets at once: what its inputs ask for holds from the first row to the last.
    pub(super) fn in_spells(index: usize, log: &Prepared, segments: &[Segment], steady: &Steady<'_>) -> Course {
        Course::of(index, log, segments, &ends(index, log, segments, 1, steady), |rows| [rows as f64, 0.0, 0.0])
    }

    /// Steps that end at these rows of the log; `alone` weighs what a step shows that no other one shows with it.
    fn of(index: usize, log: &Prepared, segments: &[Segment], ends: &[End], alone: fn(usize) -> [f64; 3]) -> Course {
        let begins = |step: usize| if step == 0 { 0 } else { ends[step - 1].row + 1 };
        let mean = |values: &[f64], step: usize| mean(&log.time_s, values, begins(step)..=ends[step].row);
        let inputs = log.inputs.iter().map(|(channel, values)| (*channel, (0..ends.len()).map(|step| mean(values, step)).collect()));
        let own: Vec<(usize, Vec<Option<usize>>)> = segments
            .iter()
            .enumerate()
            .filter(|(_, segment)| segment.log == index)
            .map(|(place, segment)| (place, block_of(segment, log.time_s.len())))
            .collect();
        let (mut shows, mut first) = (Vec::new(), vec![0]);
        for (step, end) in ends.iter().enumerate() {
            let parts = |step: usize| ends[step].row + 1 - begins(step);
            for (place, blocks) in &own {
                let Some(block) = blocks[end.row] else { continue };
                let segment = &segments[*place];
                let (row, each) = (segment.begin + block, segment.counts[block].recip());
                let show =
                    |rows, weights: [f64; 3]| Show { segment: *place, row, weights: weights.map(|weight| weight * each), rows, each };
                match ends.get(step + 1) {
                    // The next one shows it.
                    Some(next) if next.goes_on => {}
                    _ if end.goes_on => shows.push(show([parts(step), parts(step - 1)], parabola(parts(step - 1), parts(step)))),
                    _ => shows.push(show([parts(step), 0], alone(parts(step)))),
                }
            }
            first.push(shows.len());
        }
        Course { time_s: ends.iter().map(|end| log.time_s[end.row]).collect(), inputs: inputs.collect(), shows, first }
    }

    /// The same steps with the inputs of another log of the same rows.
    pub(super) fn with_inputs_of(&self, log: &Prepared) -> Course {
        let ends: Vec<usize> = self.time_s.iter().map(|end_s| log.time_s.partition_point(|time_s| time_s < end_s)).collect();
        let begins = |step: usize| if step == 0 { 0 } else { ends[step - 1] + 1 };
        let mean = |values: &[f64], step: usize| mean(&log.time_s, values, begins(step)..=ends[step]);
        let inputs = log.inputs.iter().map(|(channel, values)| (*channel, (0..ends.len()).map(|step| mean(values, step)).collect()));
        Course { inputs: inputs.collect(), ..self.clone() }
    }

    /// The same steps where segments stand elsewhere: for each its place, where its rows began, and where they begin now.
    pub(super) fn with_segments_at(&self, moved: &[(usize, usize, usize)]) -> Course {
        let show = |show: &Show| {
            let (segment, began, begins) = moved[show.segment];
            Show { segment, row: show.row - began + begins, ..*show }
        };
        Course { shows: self.shows.iter().map(show).collect(), ..self.clone() }
    }

    /// What a step shows.
    #[inline]
    pub(super) fn shows(&self, step: usize) -> &[Show] {
        &self.shows[self.first[step]..self.first[step + 1]]
    }
}

/// Mean of an input over rows, by how long each row lasts, so that the charge that passes is kept.
fn mean(time_s: &[f64], values: &[f64], rows: RangeInclusive<usize>) -> f64 {
    let lasts = |row: usize| if row == 0 { 0.0 } else { time_s[row] - time_s[row - 1] };
    let (begin, end) = rows.into_inner();
    let sum: f64 = (begin + 1..=end).map(|row| (values[row] - values[begin]) * lasts(row)).sum();
    values[begin] + sum / (begin..=end).map(lasts).sum::<f64>().max(f64::MIN_POSITIVE)
}

/// Where a step ends.
struct End {
    /// The last row of the step.
    row: usize,
    /// Whether it is alike the step before, but that both would be too long a step.
    goes_on: bool,
}

/// Where steps end that are of rows which hold and go into one mean, as many at least for each mean as are asked for.
fn ends(index: usize, log: &Prepared, segments: &[Segment], steps: usize, steady: &Steady<'_>) -> Vec<End> {
    let rows = log.time_s.len();
    let blocks: Vec<(&Segment, Vec<Option<usize>>)> =
        segments.iter().filter(|s| s.log == index).map(|segment| (segment, block_of(segment, rows))).collect();
    let mut first = 0;
    let alike = |row: usize, first: usize| {
        let together = |(_, block): &(&Segment, Vec<Option<usize>>)| block[row] == block[row - 1] && block[row].is_some();
        first > 0 && !blocks.is_empty() && blocks.iter().all(together) && steady.even(row) && steady.holds(first, row)
    };
    // A step is a part of a mean at most.
    let fits = |row: usize, first: usize| {
        let fits = |(segment, block): &(&Segment, Vec<Option<usize>>)| {
            block[row].is_some_and(|block| steps * (row - first) < segment.counts[block] as usize)
        };
        blocks.iter().all(fits)
    };
    let mut ends: Vec<End> = Vec::new();
    for row in 0..rows {
        let alike = row > 0 && alike(row, first);
        if alike && fits(row, first) {
            ends.last_mut().expect("a step has begun").row = row;
        } else {
            // Two and two.
            let goes_on = alike && ends.last().is_some_and(|before| !before.goes_on);
            first = row;
            ends.push(End { row, goes_on });
        }
    }
    ends
}

/// The sum over the rows of a step of what runs straight from its beginning to its end: weights of end and beginning.
fn line(rows: usize) -> [f64; 3] {
    let now = (rows as f64 + 1.0) / 2.0;
    [now, rows as f64 - now, 0.0]
}

/// The sum over the rows of two steps of what runs on a parabola (Lagrange's polynomials): weights of the second's end, of where they
/// meet, and of the first's beginning.
fn parabola(first: usize, second: usize) -> [f64; 3] {
    let (meet, end) = (first as f64, (first + second) as f64);
    // Sums of 1, j and j² over the rows.
    let (one, linear) = (end, end * (end + 1.0) / 2.0);
    let square = linear * (2.0 * end + 1.0) / 3.0;
    [
        (square - meet * linear) / (end * (end - meet)),
        (square - end * linear) / (meet * (meet - end)),
        (square - (meet + end) * linear + meet * end * one) / (meet * end),
    ]
}

/// Among a segment's own judged rows, the one that each row of the log goes into.
fn block_of(segment: &Segment, rows: usize) -> Vec<Option<usize>> {
    let mut all = vec![None; rows];
    segment.rows.iter().zip(&segment.block_of).for_each(|(&row, &block)| all[row] = Some(block));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums over rows of 1, j and j², one by one, against the weights of the ends.
    #[test]
    fn lines_and_parabolas_are_summed_exactly() {
        for first in 1..6 {
            for second in 1..6 {
                let nodes = [f64::from(first + second), f64::from(first), 0.0];
                let weights = parabola(first as usize, second as usize);
                for power in 0..3 {
                    let sum: f64 = (1..=first + second).map(|row| f64::from(row).powi(power)).sum();
                    let found: f64 = nodes.iter().zip(weights).map(|(node, weight)| node.powi(power) * weight).sum();
                    assert!((sum - found).abs() < 1e-9, "{first} and {second} rows, power {power}: {found} of {sum}");
                }
            }
            let [end, begin, before] = line(first as usize);
            let sum: f64 = (1..=first).map(f64::from).sum();
            assert!((end * f64::from(first) - sum).abs() < 1e-9 && (end + begin - f64::from(first)).abs() < 1e-9 && before == 0.0);
        }
    }
}
