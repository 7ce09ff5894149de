//! A station that drives.

use std::sync::Arc;

use energy::{Channel, Model, Run, Start};
use node::mission::{Course, Stretch};

/// The drive of a station.
pub(super) struct Drive {
    load: Run<f64>,
    course: Course,
    robot_kg: f64,
    /// Driving time left, s.
    left_s: f64,
    /// What it takes at a standstill, W: that is the station's own load.
    still_w: f64,
    /// What driving took in the last step, W.
    power_w: f64,
}

impl Drive {
    pub(super) fn new(model: Arc<Model>, stretches: Vec<Stretch>, robot_kg: f64) -> Self {
        let mut load = Run::new(model, Start::at_soc(0.0));
        load.step(1.0);
        let still_w = load.channels[Channel::PowerW];
        let left_s = stretches.iter().map(|stretch| stretch.time_s).filter(|time_s| time_s.is_finite()).sum();
        Self { load, course: Course::new(stretches), robot_kg, left_s, still_w, power_w: 0.0 }
    }

    /// What driving takes in this step beyond standing still, W, with so many robots aboard.
    pub(super) fn step(&mut self, aboard: f64, dt_s: f64) -> f64 {
        self.power_w = 0.0;
        if self.left_s > 0.0 {
            self.load.channels[Channel::PayloadKg] = aboard * self.robot_kg;
            self.power_w = self.course.step(&mut self.load, dt_s) - self.still_w;
            self.left_s -= dt_s;
        }
        self.power_w
    }

    /// What driving took in the last step, W; none while it stands for good.
    pub(super) fn power_w(&self) -> Option<f64> {
        (self.left_s > 0.0).then_some(self.power_w)
    }

    /// How long it still drives, s; none while it stands for good.
    pub(super) fn left_s(&self) -> Option<f64> {
        (self.left_s > 0.0).then_some(self.left_s)
    }

    pub(super) fn inputs<const N: usize>(&self, channels: [Channel; N]) -> [f64; N] {
        channels.map(|channel| self.load.channels[channel])
    }
}
