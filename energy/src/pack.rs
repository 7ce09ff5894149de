//! A pack in motion, cell by cell where cells differ.
//!
//! ```text
//!   terminals ── sensors, connection ──┬─ group 1: cells in parallel share the current
//!                                      ├─ group 2: ... all groups carry the same current,
//!                                      └─ group 3: ... less what their bypass takes
//! ```
//!
//! A pack of like cells is one [`Run`] and costs what a run costs. In a pack of unlike cells
//! every strand of like parallel cells is a run of its own, of the same effects and parameters;
//! sensors and connection stay those of the pack. Cells exchange no heat with one another.

mod cell;
mod share;
mod strand;
mod unlike;

use std::sync::Arc;

use crate::load::Terminals;
use crate::{Channel, Channels, Model, Run, Start};
pub use cell::{Balancing, CellFactors, UnlikeCell};
use unlike::Unlike;

/// A battery whose end of discharge is known: a run of like cells, or a pack.
pub trait Battery: Terminals {
    /// What it is a battery of.
    fn model(&self) -> &Arc<Model>;

    /// Whether the discharge has ended: the pack, or its weakest cell, is below its end of
    /// discharge.
    fn is_empty(&self) -> bool {
        let facts = self.model().battery();
        self.channel(Channel::VoltageV) < facts.eod_v() || self.channel(Channel::CellMinV) < facts.eod_v_per_cell
    }
}

impl Battery for Run<f64> {
    fn model(&self) -> &Arc<Model> {
        Run::model(self)
    }
}

/// One cell of a pack, at the end of the last step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellState {
    /// Its group in series, counted from 0.
    pub series: u32,
    /// Its place in the group, counted from 0.
    pub parallel: u32,
    /// State of charge.
    pub soc: f64,
    /// Voltage, V.
    pub voltage_v: f64,
    /// Current through it, A (discharge positive).
    pub current_a: f64,
    /// Temperature inside it, °C.
    pub temperature_degc: f64,
    /// Charge that it holds when full, Ah.
    pub capacity_ah: f64,
}

/// A pack of xSyP cells.
///
/// Its state of charge is that of its weakest cells: the charge that flows until the first group
/// is empty, as a share of what the pack can give between the first group being full and the
/// first being empty. It is 0 where the first group is empty, 1 where the first is full, and the
/// cells' own when all are alike. [`Channel::CapacityAh`] is that usable charge, Ah. What belongs
/// to one cell (overpotential, heat, temperature ...) is the mean of all cells.
#[derive(Clone)]
pub struct Pack(Cells);

#[derive(Clone)]
enum Cells {
    Alike(Box<Run<f64>>),
    Unlike(Box<Unlike>),
}

impl Pack {
    /// Starts with the model's own parameter values; see [`CellFactors::soc_offset`] for where
    /// unlike cells start.
    #[must_use]
    pub fn new(model: Arc<Model>, start: Start) -> Self {
        let parameters = model.values();
        Self::with_parameters(model, parameters, start)
    }

    /// Starts with the given parameter values, in the order of [`Model::parameters`].
    ///
    /// # Panics
    /// When the model is not of a battery, or there are not as many values as it has parameters.
    #[must_use]
    pub fn with_parameters(model: Arc<Model>, parameters: Vec<f64>, start: Start) -> Self {
        assert_eq!(parameters.len(), model.parameters().len(), "one value per parameter of {}", model.name);
        Self(if model.battery().all_alike() {
            Cells::Alike(Box::new(Run::with_parameters(model, parameters, start)))
        } else {
            Cells::Unlike(Box::new(Unlike::new(model, &parameters, start, false)))
        })
    }

    /// A pack in which every cell is stepped by itself even where cells are alike.
    ///
    /// # Panics
    /// When the model is not of a battery.
    #[must_use]
    pub fn cell_by_cell(model: Arc<Model>, start: Start) -> Self {
        let parameters = model.values();
        Self(Cells::Unlike(Box::new(Unlike::new(model, &parameters, start, true))))
    }

    /// Puts the pack back to a start, keeping its parameters.
    pub fn restart(&mut self, start: Start) {
        match &mut self.0 {
            Cells::Alike(run) => run.restart(start),
            Cells::Unlike(cells) => cells.restart(start),
        }
    }

    /// Advances by `dt_s` seconds (> 0) under the inputs in its channels.
    #[inline]
    pub fn step(&mut self, dt_s: f64) {
        match &mut self.0 {
            Cells::Alike(run) => run.step(dt_s),
            Cells::Unlike(cells) => cells.step(dt_s),
        }
    }

    /// What the pack is.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        match &self.0 {
            Cells::Alike(run) => run.model(),
            Cells::Unlike(cells) => &cells.model,
        }
    }

    /// The value of every channel.
    #[inline]
    #[must_use]
    pub fn channels(&self) -> &Channels<f64> {
        match &self.0 {
            Cells::Alike(run) => &run.channels,
            Cells::Unlike(cells) => &cells.shell.channels,
        }
    }

    /// Channels, to set inputs.
    #[inline]
    pub fn channels_mut(&mut self) -> &mut Channels<f64> {
        match &mut self.0 {
            Cells::Alike(run) => &mut run.channels,
            Cells::Unlike(cells) => &mut cells.shell.channels,
        }
    }

    /// Every cell, group by group.
    pub fn cells(&self) -> impl Iterator<Item = CellState> + '_ {
        let facts = self.model().battery();
        (0..facts.series).flat_map(move |series| (0..facts.parallel).map(move |parallel| self.cell(series, parallel)))
    }

    /// The cell at that place, counted from 0.
    ///
    /// # Panics
    /// When the pack has no such cell.
    #[must_use]
    pub fn cell(&self, series: u32, parallel: u32) -> CellState {
        let facts = self.model().battery();
        assert!(series < facts.series && parallel < facts.parallel, "no cell {series}, {parallel} in {}", self.model().name);
        let (now, count) = match &self.0 {
            Cells::Alike(run) => (&run.channels, facts.parallel),
            Cells::Unlike(cells) => {
                let strand = cells.strand(series, parallel);
                (&strand.run.channels, strand.count)
            }
        };
        CellState {
            series,
            parallel,
            soc: now[Channel::Soc],
            voltage_v: now[Channel::CellVoltageV],
            current_a: now[Channel::CellCurrentA],
            temperature_degc: now[Channel::CellDegc],
            capacity_ah: now[Channel::CapacityAh] / f64::from(count),
        }
    }

    /// Power that all cells turn into heat, W.
    #[must_use]
    pub fn heat_w(&self) -> f64 {
        let facts = self.model().battery();
        self.channels()[Channel::HeatW] * f64::from(facts.series) * f64::from(facts.parallel)
    }

    /// Power that balancing turns into heat, W: it comes out of cells and charger and warms no
    /// cell.
    #[must_use]
    pub fn bypass_w(&self) -> f64 {
        match &self.0 {
            Cells::Alike(_) => 0.0,
            Cells::Unlike(cells) => cells.bypass_w(),
        }
    }

    /// Current past a group in series (counted from 0), A.
    ///
    /// # Panics
    /// When the pack has no such group.
    #[must_use]
    pub fn bypass_a(&self, series: u32) -> f64 {
        match &self.0 {
            Cells::Alike(_) => 0.0,
            Cells::Unlike(cells) => cells.bypass_a(series as usize),
        }
    }
}

impl Terminals for Pack {
    fn save(&mut self) {
        match &mut self.0 {
            Cells::Alike(run) => run.save(),
            Cells::Unlike(cells) => cells.save(),
        }
    }

    fn restore(&mut self) {
        match &mut self.0 {
            Cells::Alike(run) => run.restore(),
            Cells::Unlike(cells) => cells.restore(),
        }
    }

    #[inline]
    fn step_current(&mut self, current_a: f64, dt_s: f64) {
        self.channels_mut()[Channel::CurrentA] = current_a;
        self.step(dt_s);
    }

    #[inline]
    fn channel(&self, channel: Channel) -> f64 {
        self.channels()[channel]
    }
}

impl Battery for Pack {
    fn model(&self) -> &Arc<Model> {
        Pack::model(self)
    }
}
