//! What truly happens: a model, or a model with something in it that no effect of the catalogue
//! is, walked along a script.

use std::fmt;
use std::sync::Arc;

use energy::load::Terminals as _;
use energy::units::{S_PER_DAY, S_PER_H};
use energy::{Channel, Channels, Model, Run, Start, System};

use crate::draft::Draft;

/// One row of a world, as something foreign sees it.
pub struct Moment<'a> {
    /// Time at the end of the row's step, s.
    pub time_s: f64,
    /// Length of the step, s.
    pub dt_s: f64,
    /// All channels: before the step for a current, after it for a target.
    pub channels: &'a Channels<f64>,
}

/// What something foreign adds in a row.
pub type Adds = Box<dyn FnMut(&Moment<'_>) -> f64>;

/// Something that no effect of the catalogue is, in one log.
#[derive(Default)]
pub struct Foreign {
    /// A current out of a pack that its gauge does not see, A.
    pub current_a: Option<Adds>,
    /// What it adds to the measured voltage of one cell, V, or to the measured power, W.
    pub target: Option<Adds>,
}

/// Makes it for the log of that number, at a size.
pub type MakeForeign = Arc<dyn Fn(f64, usize) -> Foreign + Send + Sync>;

/// A truth.
#[derive(Clone)]
pub struct World {
    /// Its catalogue part.
    pub draft: Draft,
    /// What is in it besides, and how large.
    pub foreign: Option<(MakeForeign, f64)>,
}

impl fmt::Debug for World {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("World").field("draft", &self.draft).finish_non_exhaustive()
    }
}

/// A stretch of a battery's log; rates are currents over capacity, 1/h, discharge positive.
#[derive(Debug, Clone, Copy)]
pub enum Stretch {
    /// A constant current.
    Hold {
        /// 1/h.
        rate: f64,
        /// Length, s.
        seconds: f64,
    },
    /// Constant current, then constant voltage.
    Charge {
        /// 1/h, positive.
        rate: f64,
        /// Length, s.
        seconds: f64,
    },
    /// Weeks on a shelf, of which the log holds the last row only.
    Shelf {
        /// Length, days.
        days: f64,
    },
}

/// What happens in one log.
#[derive(Debug, Clone)]
pub struct Script {
    /// Name of the log.
    pub name: String,
    /// Whether it is held out.
    pub holdout: bool,
    /// Where it begins.
    pub start: Start,
    /// Length of a row, s.
    pub dt_s: f64,
    /// Whether a water bath keeps a battery at its first temperature.
    pub bath: bool,
    /// What a battery does; empty for the other systems.
    pub stretches: Vec<Stretch>,
    /// Inputs, row by row, of the other systems.
    pub inputs: Vec<(Channel, Vec<f64>)>,
}

/// What truly happened in one log.
#[derive(Debug, Clone)]
pub struct Course {
    /// Name of the log.
    pub name: String,
    /// Whether it is held out.
    pub holdout: bool,
    /// Where it began.
    pub start: Start,
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Inputs and targets, in the order of the log's columns.
    pub columns: Vec<(Channel, Vec<f64>)>,
}

impl Course {
    /// A column.
    #[must_use]
    pub fn of(&self, channel: Channel) -> Option<&[f64]> {
        self.columns.iter().find(|(known, _)| *known == channel).map(|(_, values)| values.as_slice())
    }

    /// Whether a part of it was spent on a shelf.
    #[must_use]
    pub fn was_shelved(&self) -> bool {
        self.time_s.windows(2).any(|pair| on_shelf(pair[1] - pair[0]))
    }
}

/// Whether a row so long is of a battery on a shelf.
#[must_use]
pub fn on_shelf(row_s: f64) -> bool {
    row_s > S_PER_H
}

/// Warming of a cell at a rate of 1/h when no effect of the world predicts it, K.
const WARMING_K: f64 = 4.0;
/// Time constant of that, s.
const WARMING_TAU_S: f64 = 900.0;
/// State of charge below which a robot has stopped.
const EMPTY_SOC: f64 = 0.03;

/// Walks a world along its scripts.
#[must_use]
pub fn courses(world: &World, scripts: &[Script]) -> Vec<Course> {
    let model = world.draft.model();
    let make = |(index, script): (usize, &Script)| {
        let foreign = world.foreign.as_ref().map(|(make, size)| make(*size, index)).unwrap_or_default();
        match world.draft.system {
            System::Battery => battery(&model, script, foreign),
            System::Robot => load(&model, script, foreign, Channel::PowerW),
            System::Station => load(&model, script, foreign, Channel::PackPowerW),
        }
    };
    scripts.iter().enumerate().map(make).collect()
}

/// Columns of a battery's log. Where no effect of the world says how the cell warms, the
/// temperature is an input like the current, and the log does not know the surroundings: a model
/// that is told both is taken to say that they are the same.
const COLUMNS: [Channel; 6] =
    [Channel::CurrentA, Channel::VoltageV, Channel::TemperatureDegc, Channel::AmbientDegc, Channel::CycleCount, Channel::AgeDays];

fn battery(model: &Arc<Model>, script: &Script, mut foreign: Foreign) -> Course {
    let facts = model.battery().clone();
    let series = f64::from(facts.series);
    let mut run = Run::new(Arc::clone(model), script.start);
    let mut course =
        Course { name: script.name.clone(), holdout: script.holdout, start: script.start, time_s: Vec::new(), columns: Vec::new() };
    let kept = COLUMNS.iter().filter(|&&channel| channel != Channel::AmbientDegc || model.predicts_temperature());
    course.columns = kept.map(|&channel| (channel, Vec::new())).collect();
    let (mut time_s, mut warming_k) = (0.0, 0.0);
    let mut row = |dt_s: f64, stretch: Stretch| {
        run.channels[Channel::AmbientDegc] = script.start.temperature_degc;
        run.channels[Channel::CycleCount] = script.start.cycle_count;
        run.channels[Channel::AgeDays] = script.start.age_days;
        if !model.predicts_temperature() {
            run.channels[Channel::TemperatureDegc] = script.start.temperature_degc + warming_k;
        }
        time_s += dt_s;
        let current_a = if dt_s > 0.0 {
            let before = Moment { time_s, dt_s, channels: &run.channels };
            let hidden_a = foreign.current_a.as_mut().map_or(0.0, |adds| adds(&before));
            step(&mut run, stretch, facts.capacity_ah, facts.full_v(), hidden_a, dt_s)
        } else {
            0.0
        };
        let keep = (-dt_s / WARMING_TAU_S).exp();
        let warms_k = if script.bath { 0.0 } else { WARMING_K };
        warming_k = warming_k * keep + (1.0 - keep) * warms_k * (current_a / facts.capacity_ah).powi(2);
        let after = Moment { time_s, dt_s, channels: &run.channels };
        let extra_v = foreign.target.as_mut().map_or(0.0, |adds| adds(&after)) * series;
        course.time_s.push(time_s);
        for (channel, values) in &mut course.columns {
            values.push(match channel {
                Channel::CurrentA => current_a,
                Channel::VoltageV => run.channels[Channel::VoltageV] + extra_v,
                channel => run.channels[*channel],
            });
        }
    };
    row(0.0, Stretch::Hold { rate: 0.0, seconds: 0.0 });
    for &stretch in &script.stretches {
        match stretch {
            Stretch::Hold { seconds, .. } | Stretch::Charge { seconds, .. } => {
                (0..(seconds / script.dt_s).round() as usize).for_each(|_| row(script.dt_s, stretch));
            }
            Stretch::Shelf { days } => row(days * S_PER_DAY, Stretch::Hold { rate: 0.0, seconds: 0.0 }),
        }
    }
    course
}

/// Steps a battery and returns the current that its gauge sees, A.
fn step(run: &mut Run<f64>, stretch: Stretch, capacity_ah: f64, full_v: f64, hidden_a: f64, dt_s: f64) -> f64 {
    let current_a = match stretch {
        Stretch::Hold { rate, .. } => {
            let stopped = rate > 0.0 && run.channels[Channel::Soc] < EMPTY_SOC;
            let full = rate < 0.0 && run.channels[Channel::VoltageV] > full_v;
            if stopped || full { 0.0 } else { rate * capacity_ah }
        }
        Stretch::Charge { rate, .. } => {
            run.save();
            let current_a = run.step_charge(rate * capacity_ah, full_v, dt_s);
            run.restore();
            if current_a > -capacity_ah / 20.0 { 0.0 } else { current_a }
        }
        Stretch::Shelf { .. } => 0.0,
    };
    run.channels[Channel::CurrentA] = current_a + hidden_a;
    run.step(dt_s);
    current_a
}

fn load(model: &Arc<Model>, script: &Script, mut foreign: Foreign, target: Channel) -> Course {
    let rows = script.inputs.first().map_or(0, |(_, values)| values.len());
    let mut run = Run::new(Arc::clone(model), script.start);
    let (mut time, mut power_w) = (Vec::with_capacity(rows), Vec::with_capacity(rows));
    for row in 0..rows {
        for (channel, values) in &script.inputs {
            run.channels[*channel] = values[row];
        }
        run.step(script.dt_s);
        let time_s = row as f64 * script.dt_s;
        let after = Moment { time_s, dt_s: script.dt_s, channels: &run.channels };
        time.push(time_s);
        power_w.push(run.channels[target] + foreign.target.as_mut().map_or(0.0, |adds| adds(&after)));
    }
    let mut columns = script.inputs.clone();
    columns.insert(0, (target, power_w));
    Course { name: script.name.clone(), holdout: script.holdout, start: script.start, time_s: time, columns }
}
