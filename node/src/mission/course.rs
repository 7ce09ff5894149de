//! What a simulated robot or vehicle does in time: stretches one after the other, over and over or once.

use energy::{Channel, Run};

use super::Stretch;

/// Stretches that are followed.
#[derive(Debug, Clone)]
pub struct Course {
    stretches: Vec<Stretch>,
    /// The stretch that is under way, and for how long it has been.
    at: usize,
    gone_s: f64,
}

impl Course {
    /// At its beginning.
    #[must_use]
    pub fn new(stretches: Vec<Stretch>) -> Self {
        Self { stretches, at: 0, gone_s: 0.0 }
    }

    /// Begins anew.
    pub fn restart(&mut self) {
        (self.at, self.gone_s) = (0, 0.0);
    }

    /// Time of all stretches, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.stretches.iter().map(|stretch| stretch.time_s).sum()
    }

    /// Distance from the coordinator's radio, m.
    #[must_use]
    pub fn distance_m(&self) -> f64 {
        self.stretches.get(self.at).map_or(0.0, |stretch| stretch.distance_m)
    }

    /// Channels that it sets.
    pub fn channels(&self) -> impl Iterator<Item = Channel> + '_ {
        self.stretches.iter().flat_map(|stretch| stretch.inputs.iter().map(|(channel, _)| *channel))
    }

    /// Steps a load along the course, which begins anew at its end, and gives its mean power, W.
    pub fn step(&mut self, load: &mut Run<f64>, dt_s: f64) -> f64 {
        let (mut left_s, mut energy_j) = (dt_s, 0.0);
        while left_s > 0.0 && !self.stretches.is_empty() {
            let stretch = &self.stretches[self.at];
            let part_s = left_s.min(stretch.time_s - self.gone_s);
            if part_s > 0.0 {
                stretch.inputs.iter().for_each(|&(channel, value)| load.channels[channel] = value);
                load.step(part_s);
                energy_j += load.channels[Channel::PowerW] * part_s;
            }
            left_s -= part_s;
            self.gone_s += part_s;
            if self.gone_s >= stretch.time_s {
                (self.at, self.gone_s) = ((self.at + 1) % self.stretches.len(), 0.0);
            }
        }
        energy_j / dt_s
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use energy::Start;

    use super::*;

    #[test]
    fn a_step_over_several_stretches_draws_their_mean_and_the_course_begins_anew() {
        let model = Arc::new(energy::load_model("explorer-robot", &|_| unreachable!("built in")).unwrap());
        let mut load = Run::new(model, Start::at_soc(0.0));
        let stretch = |time_s, speed| Stretch { time_s, distance_m: speed, inputs: vec![(Channel::SpeedMps, speed)] };
        let mut one = |speed| Course::new(vec![stretch(f64::INFINITY, speed)]).step(&mut load, 1.0);
        let (slow_w, fast_w) = (one(0.1), one(0.5));
        let mut course = Course::new(vec![stretch(0.25, 0.1), stretch(1.0, 0.5)]);
        assert_eq!(course.time_s(), 1.25);
        assert!((course.step(&mut load, 1.0) - (0.25 * slow_w + 0.75 * fast_w)).abs() < 1e-12);
        assert_eq!(course.distance_m(), 0.5);
        assert!((course.step(&mut load, 1.0) - (0.25 * fast_w + 0.25 * slow_w + 0.5 * fast_w)).abs() < 1e-12);
    }
}
