//! Like cells in parallel, stepped as one.

use std::sync::Arc;

use super::cell::CellFactors;
use crate::{Channels, Model, Run, Start};

/// Like cells in parallel: one run of a model of just these cells.
#[derive(Clone)]
pub(super) struct Strand {
    pub(super) run: Run<f64>,
    /// How many cells it stands for.
    pub(super) count: u32,
    factors: CellFactors,
    /// Slope of voltage over current, ohm, and the step length it was found for, s.
    pub(super) slope: (f64, f64),
    /// Current and voltage, A and V, of the best guess and of the present one.
    pub(super) accepted: (f64, f64),
    pub(super) tried: (f64, f64),
    kept: Kept,
}

/// What a trial step at the pack's terminals changes.
#[derive(Clone)]
struct Kept {
    states: Vec<f64>,
    channels: Channels<f64>,
    slope: (f64, f64),
}

impl Strand {
    pub(super) fn new(model: Arc<Model>, parameters: Vec<f64>, count: u32, factors: CellFactors) -> Self {
        let run = Run::with_parameters(model, parameters, Start::at_soc(0.5));
        let slope = (0.0, f64::NAN);
        let kept = Kept { states: run.states().to_vec(), channels: run.channels, slope };
        Self { run, count, factors, slope, accepted: (0.0, 0.0), tried: (0.0, 0.0), kept }
    }

    pub(super) fn restart(&mut self, start: Start) {
        self.run.restart(Start { soc: self.factors.starts_at(start.soc), ..start });
        self.slope = (0.0, f64::NAN);
    }

    pub(super) fn save(&mut self) {
        self.kept.states.copy_from_slice(self.run.states());
        (self.kept.channels, self.kept.slope) = (self.run.channels, self.slope);
    }

    pub(super) fn restore(&mut self) {
        self.run.states_mut().copy_from_slice(&self.kept.states);
        (self.run.channels, self.slope) = (self.kept.channels, self.kept.slope);
    }
}
