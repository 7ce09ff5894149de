//! What a robot draws at work, where no model of its loads says it: the mean of what was measured.

use std::collections::VecDeque;

use energy::Model;
use energy::gauge::Sample;
use energy::units::S_PER_H;
use proto::Estimate;
use statrs::statistics::Statistics as _;

use super::Agent;

/// Power is averaged over blocks of this length, s: long against the moments of a task, so that the
/// means of blocks differ as tasks do.
const BLOCK_S: f64 = 60.0;

/// Time in which a robot usually empties a full pack, h: a guess, with a deviation as large as what follows from
/// it, for the two minutes until it is measured.
const RUN_TIME_H: f64 = 3.0;

/// What a robot draws of whose work nothing has been measured yet, W: what empties its pack in the usual
/// time, give or take as much.
#[must_use]
pub fn unmeasured_w(battery: &Model) -> Estimate {
    let usual_w = battery.battery().stored_wh() / RUN_TIME_H;
    Estimate::new(usual_w, usual_w)
}

/// Blocks that are remembered: eight hours of work, a shift. What was drawn before that says little of what comes. A guess.
const BLOCKS_MAX: usize = 480;
/// Fewest batches of blocks whose scatter says something.
const BATCHES: usize = 4;

/// Means of blocks of work.
#[derive(Debug, Clone, Default)]
pub(super) struct Drain {
    energy_ws: f64,
    time_s: f64,
    /// Mean power of each block, W, oldest first.
    blocks_w: VecDeque<f64>,
}

impl Drain {
    fn update(&mut self, sample: &Sample) {
        self.energy_ws += sample.current_a * sample.voltage_v * sample.dt_s;
        self.time_s += sample.dt_s;
        // A robot at work draws something: nothing drawn says that the device has not told it yet.
        if self.time_s >= BLOCK_S && self.energy_ws != 0.0 {
            if self.blocks_w.len() == BLOCKS_MAX {
                self.blocks_w.pop_front();
            }
            self.blocks_w.push_back(self.energy_ws / self.time_s);
            (self.energy_ws, self.time_s) = (0.0, 0.0);
        }
    }

    /// The mean with its standard deviation: from two blocks on what they say, before that the only
    /// value that there is, and no better known than before it was measured.
    fn estimate(&mut self, unmeasured: Estimate) -> Option<Estimate> {
        let blocks_w = &*self.blocks_w.make_contiguous();
        if blocks_w.len() >= 2 {
            return Some(Estimate::new(blocks_w.mean(), sigma_of_mean(blocks_w)));
        }
        let seen_w = blocks_w.first().copied().unwrap_or(self.energy_ws / self.time_s);
        seen_w.is_finite().then(|| Estimate::new(seen_w, seen_w.abs().max(unmeasured.sigma)))
    }
}

/// Deviation of the mean of numbers of which neighbours may be alike, such as minutes of one task: the largest that batches of one, two,
/// four, ... of them give (Flyvbjerg and Petersen, Error estimates on averages of correlated data, 1989).
fn sigma_of_mean(numbers: &[f64]) -> f64 {
    let mut batches = numbers.to_vec();
    let mut sigma: f64 = 0.0;
    loop {
        sigma = sigma.max(batches.as_slice().std_dev() / (batches.len() as f64).sqrt());
        if batches.len() < 2 * BATCHES {
            return sigma;
        }
        batches = batches.chunks_exact(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    }
}

impl Agent {
    /// Learns from a sample at work. What is told changes only when it was wrong by more than its
    /// deviation, or is known twice as well or half as well: who watches the drain shall not have to begin anew with
    /// every message.
    pub(super) fn learn_drain(&mut self, sample: &Sample) {
        self.drain.update(sample);
        let Some(new) = self.drain.estimate(unmeasured_w(self.gauge.model())) else { return };
        let told = self.profile.drain_w;
        let worth = (new.value - told.value).abs() > told.sigma || new.sigma < 0.5 * told.sigma || new.sigma > 2.0 * told.sigma;
        if !worth {
            return;
        }
        self.profile.drain_w = new;
        // Ways that are known better need a model of the loads, and with that nothing is measured.
        for way in self.profile.travel.values_mut() {
            way.energy_wh = new.scaled(way.time_s / S_PER_H);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(powers_w: &[f64]) -> Estimate {
        let mut drain = Drain::default();
        for power_w in powers_w {
            (0..60).for_each(|_| drain.update(&Sample { dt_s: 1.0, current_a: power_w / 10.0, voltage_v: 10.0, temperature_degc: 25.0 }));
        }
        drain.estimate(Estimate::new(10.0, 10.0)).unwrap()
    }

    #[test]
    fn a_device_that_has_not_told_yet_what_it_draws_says_nothing_of_it() {
        let mut drain = Drain::default();
        let waited = |dt_s: f64, current_a: f64| Sample { dt_s, current_a, voltage_v: 10.0, temperature_degc: 25.0 };
        (0..2).for_each(|_| drain.update(&waited(300.0, 0.0)));
        assert_eq!(drain.estimate(Estimate::new(10.0, 10.0)), Some(Estimate::new(0.0, 10.0)));
        // A step of 600 J after a minute more: 600 J in 660 s.
        drain.update(&waited(60.0, 1.0));
        assert_eq!(drain.estimate(Estimate::new(10.0, 10.0)), Some(Estimate::new(600.0 / 660.0, 10.0)));
    }

    #[test]
    fn the_deviation_is_that_of_a_mean_and_large_while_little_was_seen() {
        assert_eq!(after(&[4.0]), Estimate::new(4.0, 10.0));
        // Two tasks, an hour each, are two numbers and not 120: by batches of 16 minutes, the first two of seven of the one and so on.
        let two = after(&[[50.0; 60], [150.0; 60]].concat());
        assert!((two.value - 100.0).abs() < 1e-9 && (15.0..30.0).contains(&two.sigma), "{two:?}");
        // What was long ago is forgotten.
        let later = after(&[[50.0; 480], [150.0; 480]].concat());
        assert_eq!((later.value, later.sigma), (150.0, 0.0));
        // By hand: mean of 3, 5, 4, 4 with a standard deviation of sqrt(2/3), over sqrt(4).
        let four = after(&[3.0, 5.0, 4.0, 4.0]);
        assert!((four.value - 4.0).abs() < 1e-12 && (four.sigma - (2.0_f64 / 3.0).sqrt() / 2.0).abs() < 1e-12, "{four:?}");
    }
}
