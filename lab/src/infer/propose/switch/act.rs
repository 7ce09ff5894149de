//! How something that comes and goes acts on what is shown.

use std::sync::Arc;

use energy::{Channel, System};

use super::rows::Rows;
use crate::infer::frame::Frame;

/// On what it acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Act {
    /// It is added to what is shown: a multiple of what is measured, or a constant.
    Shown(Option<Channel>),
    /// It is added to what drives the model, beside what the sensor of that sees: the model answers as it does to all
    /// that drives it, and remembers.
    Driving(Channel),
}

/// What may be drawn beside the sensor of a system so that it is not shown at once only: of a battery, a current.
pub(super) fn remembered(system: System) -> Option<Channel> {
    (system == System::Battery).then_some(Channel::CurrentA)
}

impl Rows {
    /// What one unit does to every row by being there in that row, looked at with this size of it: what it does beyond that comes
    /// of the rows before.
    pub(super) fn at_once(&self, frame: &Frame, act: Act, size: f64) -> Vec<f64> {
        let channel = match act {
            Act::Shown(times) => return self.measured(frame, times),
            Act::Driving(channel) => channel,
        };
        // There in every other row, it shows by the difference to the row before.
        let every_other: Vec<bool> = (0..self.judged.len()).map(|row| row % 2 == 1).collect();
        let turns = self.answer_of(frame, channel, &every_other, size);
        let step = |row: usize| if every_other[row] { turns[row] - turns[row - 1] } else { turns[row - 1] - turns[row] };
        let is_first = |row: usize| row == 0 || self.judged[row].1 != self.judged[row - 1].1;
        let mut at_once: Vec<f64> = (0..turns.len()).map(|row| if is_first(row) { 0.0 } else { step(row) }).collect();
        for row in (0..turns.len().saturating_sub(1)).rev().filter(|&row| is_first(row)) {
            at_once[row] = at_once[row + 1];
        }
        at_once
    }

    /// What one unit does to every row in all where it is there.
    pub(super) fn whole(&self, frame: &Frame, act: Act, there: &[bool], size: f64) -> Vec<f64> {
        match act {
            Act::Shown(times) => {
                self.measured(frame, times).into_iter().zip(there).map(|(one, there)| if *there { one } else { 0.0 }).collect()
            }
            Act::Driving(channel) => self.answer_of(frame, channel, there, size),
        }
    }

    /// The answer of the model to more of an input, for each unit of it.
    fn answer_of(&self, frame: &Frame, channel: Channel, there: &[bool], size: f64) -> Vec<f64> {
        if size == 0.0 {
            return vec![0.0; there.len()];
        }
        let moved = self.driven(frame, channel, there, size).predict(&self.x);
        self.judged.iter().map(|&(place, ..)| (moved[place] - self.predicted[place]) / size).collect()
    }

    /// The model on the same logs with so much more of an input where it is there; between judged rows, as in the next one.
    pub(super) fn driven(&self, frame: &Frame, channel: Channel, there: &[bool], size: f64) -> Frame {
        let mut logs = frame.evidence.logs.to_vec();
        let mut before = (usize::MAX, 0);
        for (&(_, log, row), there) in self.judged.iter().zip(there) {
            let from = if before.0 == log { before.1 + 1 } else { 0 };
            before = (log, row);
            let input = logs[log].inputs.iter_mut().find(|(input, _)| *input == channel);
            if let (true, Some((_, values))) = (there, input) {
                values[from..=row].iter_mut().for_each(|value| *value += size);
            }
        }
        let evidence = frame.evidence.with_inputs_of(logs);
        Frame::new(Arc::clone(&frame.model), Arc::new(evidence))
    }
}
