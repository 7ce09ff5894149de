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

/// What one unit of it does to the rows of a channel.
pub(super) struct Answer {
    /// In all.
    pub(super) whole: Vec<f64>,
    /// By being there in that row: the rest comes of the rows before.
    pub(super) at_once: Vec<f64>,
}

/// What may be drawn beside the sensor of a system so that it is not shown at once only: of a battery, a current.
pub(super) fn remembered(system: System) -> Option<Channel> {
    (system == System::Battery).then_some(Channel::CurrentA)
}

impl Rows {
    /// What one unit does where it is there, looked at with this size of it.
    pub(super) fn answer(&self, frame: &Frame, act: Act, there: &[bool], size: f64) -> Answer {
        let channel = match act {
            Act::Shown(times) => {
                let at_once = self.measured(frame, times);
                let whole = at_once.iter().zip(there).map(|(one, there)| if *there { *one } else { 0.0 }).collect();
                return Answer { whole, at_once };
            }
            Act::Driving(channel) => channel,
        };
        let plain = frame.predict(&self.x);
        let of = |there: &[bool]| -> Vec<f64> {
            let moved = self.driven(frame, channel, there, size).predict(&self.x);
            self.judged.iter().map(|&(place, ..)| (moved[place] - plain[place]) / size).collect()
        };
        // There in every other row, it shows by the difference to the row before what it does at once.
        let every_other: Vec<bool> = (0..there.len()).map(|row| row % 2 == 1).collect();
        let turns = of(&every_other);
        let step = |row: usize| if every_other[row] { turns[row] - turns[row - 1] } else { turns[row - 1] - turns[row] };
        let is_first = |row: usize| row == 0 || self.judged[row].1 != self.judged[row - 1].1;
        let mut at_once: Vec<f64> = (0..there.len()).map(|row| if is_first(row) { 0.0 } else { step(row) }).collect();
        for row in (0..there.len().saturating_sub(1)).rev().filter(|&row| is_first(row)) {
            at_once[row] = at_once[row + 1];
        }
        Answer { whole: of(there), at_once }
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
