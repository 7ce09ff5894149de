//! Rows of a log over which every input holds: for a model they are one row that lasts longer.

use energy::{Channel, Sensor};

use crate::prepare::Prepared;

/// Deviations of its noise that an input may leave the first of such rows by.
pub(super) const HOLDS: f64 = 4.0;
/// The same where no noise is stated, as a share of the input's largest value. The rows count with their mean, so that a
/// model sees no more of it than the square of this share, and no sign changes among them.
const HARDLY: f64 = 1.0 / 300.0;

/// Share by which two rows may differ in how long they last: clocks of loggers jitter.
const EVEN: f64 = 0.05;

/// How far the inputs of a log may move and still hold.
pub(super) struct Steady<'a> {
    time_s: &'a [f64],
    inputs: Vec<Input<'a>>,
}

struct Input<'a> {
    values: &'a [f64],
    reach: f64,
    /// What a value may not change among them, however little it moves: whether it is zero, where a sensor has a dead band; its
    /// sign, where no noise is stated.
    kind: fn(f64) -> i8,
}

impl<'a> Steady<'a> {
    /// Of a log whose channels are measured by these sensors.
    pub(super) fn of(log: &'a Prepared, sensor: impl Fn(Channel) -> Sensor) -> Steady<'a> {
        let input = |(channel, values): &'a (Channel, Vec<f64>)| {
            let (sensor, largest) = (sensor(*channel), values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs())));
            let noise = HOLDS * sensor.floor();
            match () {
                () if noise > 0.0 && sensor.dead_band > 0.0 => Input { values, reach: noise, kind: |value| i8::from(value != 0.0) },
                () if noise > 0.0 => Input { values, reach: noise, kind: |_| 0 },
                () => Input { values, reach: HARDLY * largest, kind: |value| i8::from(value > 0.0) - i8::from(value < 0.0) },
            }
        };
        Steady { time_s: &log.time_s, inputs: log.inputs.iter().map(input).collect() }
    }

    /// Whether every input is at a row what it was at the first.
    pub(super) fn holds(&self, first: usize, row: usize) -> bool {
        self.inputs.iter().all(|Input { values, reach, kind }| {
            let (first, now) = (values[first], values[row]);
            (now - first).abs() <= *reach && kind(now) == kind(first)
        })
    }

    /// Whether a row lasts about as long as the one before: what runs smoothly through such rows is summed as if they were even.
    pub(super) fn even(&self, row: usize) -> bool {
        let step_s = |row: usize| self.time_s[row] - self.time_s[row - 1];
        row > 1 && (step_s(row) - step_s(row - 1)).abs() <= EVEN * step_s(row)
    }
}
