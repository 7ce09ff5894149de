//! A station that drives.

use std::sync::Arc;

use energy::{Channel, Model, Run, Start};
use node::Part;
use node::mission::Course;

/// The drive of a station.
pub(super) struct Drive {
    load: Run<f64>,
    course: Course,
    robot_kg: f64,
    /// What is still to come of its way, s: how long each part of it takes and whether it takes robots in meanwhile; the last is for good.
    ahead: Vec<(f64, bool)>,
    /// What it takes at a standstill, W: that is the station's own load.
    still_w: f64,
    /// What driving took in the last step, W.
    power_w: f64,
}

impl Drive {
    pub(super) fn new(model: Arc<Model>, parts: Vec<Part>, robot_kg: f64) -> Self {
        let mut load = Run::new(model, Start::at_soc(0.0));
        load.step(1.0);
        let still_w = load.channels[Channel::PowerW];
        // What is of one kind counts as one; the next is at the end, where it is taken off.
        let mut ahead: Vec<(f64, bool)> = Vec::new();
        for part in parts.iter().rev() {
            match ahead.last_mut() {
                Some((time_s, open)) if *open == part.open => *time_s += part.stretch.time_s,
                _ => ahead.push((part.stretch.time_s, part.open)),
            }
        }
        let course = Course::new(parts.into_iter().map(|part| part.stretch).collect());
        Self { load, course, robot_kg, ahead, still_w, power_w: 0.0 }
    }

    /// What driving takes in this step beyond standing still, W, with so many robots aboard.
    pub(super) fn step(&mut self, aboard: f64, dt_s: f64) -> f64 {
        self.load.channels[Channel::PayloadKg] = aboard * self.robot_kg;
        let (drove, mut left_s) = (self.is_driving(), dt_s);
        while let Some((time_s, _)) = self.ahead.last_mut() {
            let part_s = left_s.min(*time_s);
            (*time_s, left_s) = (*time_s - part_s, left_s - part_s);
            if *time_s > 0.0 {
                break;
            }
            self.ahead.pop();
        }
        let power_w = self.course.step(&mut self.load, dt_s) - self.still_w;
        self.power_w = if drove || self.is_driving() { power_w } else { 0.0 };
        self.power_w
    }

    fn is_driving(&self) -> bool {
        self.ahead.last().is_some_and(|(_, open)| !open)
    }

    /// What driving took in the last step, W; none while it stands.
    pub(super) fn power_w(&self) -> Option<f64> {
        self.is_driving().then_some(self.power_w)
    }

    /// How long it still drives, s; none while it stands.
    pub(super) fn arrives_s(&self) -> Option<f64> {
        self.ahead.last().filter(|(_, open)| !open).map(|(time_s, _)| *time_s)
    }

    /// When it sets off again after it stands, and when it stands once more, s, one after the other.
    pub(super) fn away_s(&self) -> Vec<(f64, Option<f64>)> {
        let mut begins_s = 0.0;
        let drives = self.ahead.iter().rev().skip(usize::from(self.is_driving())).filter_map(|&(time_s, open)| {
            let leaves_s = begins_s;
            begins_s += time_s;
            (!open).then_some((leaves_s, Some(begins_s)))
        });
        let first_s = self.arrives_s().unwrap_or(0.0);
        drives.map(|(leaves_s, returns_s)| (first_s + leaves_s, returns_s.map(|returns_s| first_s + returns_s))).collect()
    }

    pub(super) fn inputs<const N: usize>(&self, channels: [Channel; N]) -> [f64; N] {
        channels.map(|channel| self.load.channels[channel])
    }
}
