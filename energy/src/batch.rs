//! Many runs of one model, stepped together: a fleet of like packs.
//!
//! The runs are stepped in blocks that fit a processor's nearest cache, effect by effect, so that
//! the way to an effect is found once per block instead of once per run.

use std::sync::Arc;

use crate::effect::{Many, Phase};
use crate::model::{Model, Placed};
use crate::run::{Known, begin, prepare};
use crate::step::{self, Parts};
use crate::{Channels, Start};

/// Runs stepped together: with their channels, states and parameters they take about 20 KB of the
/// 32 KB of a processor's nearest cache.
const BLOCK: usize = 32;

/// Many runs of one model. Set the input channels of each, step all, read the output channels.
#[derive(Clone)]
pub struct Batch {
    model: Arc<Model>,
    parameters: Vec<f64>,
    prepared: Vec<f64>,
    prepared_dt_s: f64,
    states: Vec<f64>,
    /// The value of every channel of every run.
    pub channels: Vec<Channels<f64>>,
}

impl Batch {
    /// One run per start, all with the model's own parameter values.
    #[must_use]
    pub fn new(model: Arc<Model>, starts: &[Start]) -> Self {
        let values = model.values();
        let runs: Vec<_> = starts.iter().map(|start| (values.clone(), *start)).collect();
        Self::with_parameters(model, &runs)
    }

    /// One run per entry: its parameter values, in the order of [`Model::parameters`], and its
    /// start.
    ///
    /// # Panics
    /// When there are not as many values as the model has parameters.
    #[must_use]
    pub fn with_parameters(model: Arc<Model>, runs: &[(Vec<f64>, Start)]) -> Self {
        let mut batch = Self {
            parameters: Vec::new(),
            prepared: vec![0.0; runs.len() * model.prepared_count()],
            prepared_dt_s: f64::NAN,
            states: vec![0.0; runs.len() * model.state_count()],
            channels: vec![Channels::filled(0.0); runs.len()],
            model,
        };
        let states_len = batch.model.state_count();
        for (index, (parameters, start)) in runs.iter().enumerate() {
            assert_eq!(parameters.len(), batch.model.parameters().len(), "one value per parameter of {}", batch.model.name);
            let states = &mut batch.states[index * states_len..(index + 1) * states_len];
            begin(&batch.model, parameters, states, &mut batch.channels[index], *start);
            batch.parameters.extend(parameters);
        }
        batch
    }

    /// How many runs there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.channels.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.channels.is_empty()
    }

    /// Advances all runs by `dt_s` seconds (> 0).
    pub fn step(&mut self, dt_s: f64) {
        let model = &*self.model;
        let (p, q, n) = (model.parameters().len(), model.prepared_count(), model.state_count());
        if self.prepared_dt_s != dt_s {
            for index in 0..self.channels.len() {
                let own = &mut self.prepared[index * q..(index + 1) * q];
                prepare(model, dt_s, &self.parameters[index * p..(index + 1) * p], own, Known::Nothing);
            }
            self.prepared_dt_s = dt_s;
        }
        for (block, channels) in self.channels.chunks_mut(BLOCK).enumerate() {
            let (first, end) = (block * BLOCK, block * BLOCK + channels.len());
            let mut parts = Block {
                model,
                dt_s,
                parameters: (&self.parameters[first * p..end * p], p),
                prepared: (&self.prepared[first * q..end * q], q),
                states: (&mut self.states[first * n..end * n], n),
                channels,
            };
            step::step(model, dt_s, &mut parts);
        }
    }
}

struct Block<'a> {
    model: &'a Model,
    dt_s: f64,
    parameters: (&'a [f64], usize),
    prepared: (&'a [f64], usize),
    states: (&'a mut [f64], usize),
    channels: &'a mut [Channels<f64>],
}

impl Parts<f64> for Block<'_> {
    #[inline]
    fn act(&mut self, phase: Phase) {
        self.act_among(self.model.placed_in(phase));
    }

    #[inline]
    fn act_among(&mut self, placed: &[Placed]) {
        for placed in placed {
            let many = Many {
                parameters: (self.parameters.0, self.parameters.1, placed.parameters.clone()),
                prepared: (self.prepared.0, self.prepared.1, placed.prepared.clone()),
                states: (self.states.0, self.states.1, placed.states.clone()),
                channels: self.channels,
            };
            placed.plain.step_many(&self.model.facts, self.dt_s, many);
        }
    }

    #[inline]
    fn each(&mut self, between: impl Fn(&mut [f64], &mut Channels<f64>)) {
        // A robot's or station's runs may have no state.
        let length = self.states.1;
        for (index, channels) in self.channels.iter_mut().enumerate() {
            between(&mut self.states.0[index * length..(index + 1) * length], channels);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Channel, Run, load_model};

    #[test]
    fn a_batch_does_exactly_what_lone_runs_do() {
        let model = Arc::new(load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
        let starts: Vec<Start> = (0..37).map(|index| Start::at_soc(0.1 + 0.02 * f64::from(index))).collect();
        let mut batch = Batch::new(Arc::clone(&model), &starts);
        let mut runs: Vec<_> = starts.iter().map(|start| Run::new(Arc::clone(&model), *start)).collect();
        for step in 0..50 {
            for (index, (run, channels)) in runs.iter_mut().zip(&mut batch.channels).enumerate() {
                let current_a = f64::from((index as i32 * 7 + step) % 11) - 4.0;
                (run.channels[Channel::CurrentA], channels[Channel::CurrentA]) = (current_a, current_a);
                run.step(2.0);
            }
            batch.step(2.0);
        }
        for (run, channels) in runs.iter().zip(&batch.channels) {
            for &channel in Channel::ALL {
                assert_eq!(run.channels[channel], channels[channel], "{}", channel.name());
            }
        }
    }
}
