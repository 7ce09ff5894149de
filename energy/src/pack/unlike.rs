//! A pack whose cells differ: each strand of like cells in motion by itself.

use std::ops::Range;
use std::sync::Arc;

use super::cell::{Balancing, CellFactors};
use super::share::share;
use super::strand::Strand;
use crate::effect::{EffectSpec, Phase};
use crate::system::Facts;
use crate::units::S_PER_H;
use crate::{Channel, Channels, Model, Run, Start};

/// Whether an effect belongs to a cell. The others belong to the pack's terminals: sensors,
/// connection, and what draws a current from all cells unseen.
fn of_a_cell(effect: &EffectSpec) -> bool {
    match effect.phase {
        Phase::Sensed | Phase::Connection | Phase::Shown => false,
        Phase::Current => effect.channel != Channel::CellCurrentA,
        _ => true,
    }
}

/// What surrounds all cells alike.
const SHARED: [Channel; 3] = [Channel::AmbientDegc, Channel::CycleCount, Channel::AgeDays];
/// A pack rests below this share of its capacity per hour; a guess, between a robot's standby
/// and the offset of a current sensor.
const REST_PER_H: f64 = 1e-3;
/// Least usable share of the capacity: the pack's state of charge stays finite when one cell is
/// empty while another is full.
const USABLE_MIN: f64 = 0.01;

/// Groups in series of strands in parallel.
#[derive(Clone)]
pub(super) struct Unlike {
    pub(super) model: Arc<Model>,
    /// What lies between the cells and who measures them; its channels are the pack's.
    pub(super) shell: Run<f64>,
    strands: Vec<Strand>,
    groups: Vec<Range<usize>>,
    /// The strand of every cell, group by group.
    strand_of: Vec<usize>,
    /// Current past each group, A; and that when the pack was kept.
    bypass_a: Vec<f64>,
    kept_bypass_a: Vec<f64>,
    /// Voltage of each group as balancing measured it, V.
    measured_v: Vec<f64>,
    /// Whether the model predicts temperature.
    warms: bool,
}

impl Unlike {
    /// Cells that are alike and in one group share a strand, unless `lone`.
    pub(super) fn new(model: Arc<Model>, parameters: &[f64], start: Start, lone: bool) -> Self {
        let facts = model.battery();
        let part = |facts: Facts, of_cells: bool| {
            let (part, kept) = model.part(facts, |effect| of_a_cell(effect) == of_cells);
            (Arc::new(part), kept.into_iter().map(|index| parameters[index]).collect::<Vec<f64>>())
        };
        let mut kinds: Vec<(u32, CellFactors, Arc<Model>, Vec<f64>)> = Vec::new();
        let (mut strands, mut groups, mut strand_of) = (Vec::new(), Vec::new(), Vec::new());
        for series in 0..facts.series {
            let first = strands.len();
            let mut members: Vec<(CellFactors, u32)> = Vec::new();
            for parallel in 0..facts.parallel {
                let factors = facts.factors(series, parallel);
                let known = members.iter().position(|member| member.0 == factors && !lone);
                let index = known.unwrap_or_else(|| {
                    members.push((factors, 0));
                    members.len() - 1
                });
                members[index].1 += 1;
                strand_of.push(first + index);
            }
            for (factors, count) in members {
                let known = kinds.iter().position(|kind| (kind.0, kind.1) == (count, factors));
                let index = known.unwrap_or_else(|| {
                    let (part, values) = part(Facts::Battery(facts.part(count, factors)), true);
                    kinds.push((count, factors, part, values));
                    kinds.len() - 1
                });
                let (_, _, part, values) = &kinds[index];
                strands.push(Strand::new(Arc::clone(part), values.clone(), count, factors));
            }
            groups.push(first..strands.len());
        }
        let (shell, values) = part(model.facts.clone(), false);
        let shell = Run::with_parameters(shell, values, start);
        let (none, warms) = (vec![0.0; groups.len()], model.predicts_temperature());
        let (bypass_a, kept_bypass_a, measured_v) = (none.clone(), none.clone(), none);
        let mut unlike = Self { shell, strands, groups, strand_of, bypass_a, kept_bypass_a, measured_v, warms, model };
        unlike.restart(start);
        unlike
    }

    pub(super) fn restart(&mut self, start: Start) {
        self.shell.restart(start);
        self.bypass_a.fill(0.0);
        for strand in &mut self.strands {
            strand.restart(start);
            // No step has said yet how much the strand holds.
            strand.run.channels[Channel::CapacityAh] = strand.run.model().battery().capacity_ah;
        }
        let channels = &mut self.shell.channels;
        let soc = gather(&self.strands, &self.groups, &self.model, channels);
        self.shell.states_mut()[0] = soc;
        let channels = &mut self.shell.channels;
        channels[Channel::VoltageV] = channels[Channel::TerminalVoltageV];
        // A run at rest has not told its capacity either.
        channels[Channel::CapacityAh] = 0.0;
    }

    pub(super) fn save(&mut self) {
        self.shell.save();
        self.kept_bypass_a.copy_from_slice(&self.bypass_a);
        self.strands.iter_mut().for_each(Strand::save);
    }

    pub(super) fn restore(&mut self) {
        self.shell.restore();
        self.bypass_a.copy_from_slice(&self.kept_bypass_a);
        self.strands.iter_mut().for_each(Strand::restore);
    }

    pub(super) fn step(&mut self, dt_s: f64) {
        self.balance(dt_s);
        let Unlike { model, shell, strands, groups, bypass_a, warms, .. } = self;
        let parallel = f64::from(model.battery().parallel);
        let mut range_v = (0.0, 0.0);
        shell.step_around(*warms, dt_s, |states, now| {
            for strand in strands.iter_mut() {
                for channel in SHARED {
                    strand.run.channels[channel] = now[channel];
                }
                if !*warms {
                    strand.run.channels[Channel::TemperatureDegc] = now[Channel::CellDegc];
                }
            }
            // `gather` overwrites it with what then flows through the cells.
            for (group, bypass_a) in groups.iter().zip(bypass_a.iter()) {
                let current_a = now[Channel::CellCurrentA] * parallel + bypass_a;
                match &mut strands[group.clone()] {
                    [lone] => {
                        lone.run.channels[Channel::CurrentA] = current_a;
                        lone.run.step(dt_s);
                    }
                    several => share(several, current_a, dt_s),
                }
            }
            states[0] = gather(strands, groups, model, now);
            range_v = (now[Channel::CellMinV], now[Channel::CellMaxV]);
        });
        // An effect on the whole string knows no cells: what they show counts beside it.
        let now = &mut shell.channels;
        (now[Channel::CellMinV], now[Channel::CellMaxV]) = (now[Channel::CellMinV].min(range_v.0), now[Channel::CellMaxV].max(range_v.1));
    }

    /// Switches the bypass of every group by what was measured at the end of the last step, so
    /// that the current of this one does not change it.
    fn balance(&mut self, dt_s: f64) {
        let facts = self.model.battery();
        let Some(Balancing { bypass_a_max, start_v, difference_v, at_rest }) = facts.balancing else { return };
        let (flowing_a, rest_a) = (self.shell.channels[Channel::TerminalCurrentA], REST_PER_H * facts.capacity_ah);
        if !(flowing_a < -rest_a || (at_rest && flowing_a.abs() <= rest_a)) {
            self.bypass_a.fill(0.0);
            return;
        }
        for ((group, measured_v), bypass_a) in self.groups.iter().zip(&mut self.measured_v).zip(&self.bypass_a) {
            let strands = &mut self.strands[group.clone()];
            *measured_v = if *bypass_a == 0.0 { voltage_v(strands) } else { paused_v(strands, flowing_a) };
        }
        let lowest_v = self.measured_v.iter().copied().fold(f64::INFINITY, f64::min);
        for ((group, measured_v), bypass_a) in self.groups.iter().zip(&self.measured_v).zip(&mut self.bypass_a) {
            let above_v = measured_v - lowest_v;
            *bypass_a = 0.0;
            if *measured_v >= start_v && above_v > difference_v {
                // A long step ends where the difference is gone: not all of it is bypassed.
                let per_v = |strand: &Strand| holds_ah(strand) / facts.ocv.slope_v(soc(strand)).max(1e-3);
                let excess_ah = above_v * self.strands[group.clone()].iter().map(per_v).sum::<f64>();
                *bypass_a = bypass_a_max.min(excess_ah * S_PER_H / dt_s);
            }
        }
    }

    /// Power that the bypasses turn into heat, W.
    pub(super) fn bypass_w(&self) -> f64 {
        self.groups.iter().zip(&self.bypass_a).map(|(group, bypass_a)| voltage_v(&self.strands[group.clone()]) * bypass_a).sum()
    }

    pub(super) fn bypass_a(&self, series: usize) -> f64 {
        self.bypass_a[series]
    }

    /// The strand of the cell at that place in the pack.
    pub(super) fn strand(&self, series: u32, parallel: u32) -> &Strand {
        &self.strands[self.strand_of[(series * self.model.battery().parallel + parallel) as usize]]
    }
}

fn soc(strand: &Strand) -> f64 {
    strand.run.channels[Channel::Soc]
}

fn holds_ah(strand: &Strand) -> f64 {
    strand.run.channels[Channel::CapacityAh]
}

/// Voltage of a group, V: the strands agree on it as closely as their shares were found.
fn voltage_v(strands: &[Strand]) -> f64 {
    strands.iter().map(|strand| strand.run.channels[Channel::TerminalVoltageV]).sum::<f64>() / strands.len() as f64
}

/// Voltage of a group with its bypass paused for a moment, V: the electronics do not take the
/// drop that they cause for a difference between cells.
fn paused_v(strands: &mut [Strand], current_a: f64) -> f64 {
    const MOMENT_S: f64 = 1e-3;
    match &mut *strands {
        [lone] => {
            lone.run.save();
            lone.run.channels[Channel::CurrentA] = current_a;
            lone.run.step(MOMENT_S);
        }
        several => share(several, current_a, MOMENT_S),
    }
    let paused_v = voltage_v(strands);
    strands.iter_mut().for_each(|strand| strand.run.restore());
    paused_v
}

/// Puts what the cells are into the pack's channels and returns the pack's state of charge.
fn gather(strands: &[Strand], groups: &[Range<usize>], model: &Model, now: &mut Channels<f64>) -> f64 {
    let facts = model.battery();
    let (mut sum_v, mut low_v, mut high_v) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
    let (mut left_ah, mut room_ah, mut all_ah) = (f64::INFINITY, f64::INFINITY, 0.0);
    for group in groups {
        let strands = &strands[group.clone()];
        let group_v = voltage_v(strands);
        (sum_v, low_v, high_v) = (sum_v + group_v, low_v.min(group_v), high_v.max(group_v));
        let group_ah: f64 = strands.iter().map(holds_ah).sum();
        let charge_ah: f64 = strands.iter().map(|strand| soc(strand) * holds_ah(strand)).sum();
        (left_ah, room_ah, all_ah) = (left_ah.min(charge_ah), room_ah.min(group_ah - charge_ah), all_ah + group_ah);
    }
    let series = groups.len() as f64;
    let mean = |channel: Channel| {
        let sum: f64 = strands.iter().map(|strand| strand.run.channels[channel] * f64::from(strand.count)).sum();
        sum / (series * f64::from(facts.parallel))
    };
    for channel in [
        Channel::CellCurrentA,
        Channel::LostCurrentA,
        Channel::SocPerA,
        Channel::OcvShiftEmpty,
        Channel::OcvShiftFull,
        Channel::LogRelaxationTime,
        Channel::EntropyVPerK,
        Channel::OcvV,
        Channel::HeatW,
        Channel::CellDegc,
    ] {
        now[channel] = mean(channel);
    }
    let usable_ah = (left_ah + room_ah).max(USABLE_MIN * all_ah / series);
    now[Channel::CellVoltageV] = sum_v / series;
    now[Channel::OverpotentialV] = now[Channel::OcvV] - now[Channel::CellVoltageV];
    (now[Channel::CellMinV], now[Channel::CellMaxV]) = (low_v, high_v);
    now[Channel::TerminalVoltageV] = sum_v;
    (now[Channel::CapacityAh], now[Channel::Soc]) = (usable_ah, left_ah / usable_ah);
    now[Channel::Soc]
}
