//! One step of each system: what happens between the phases.
//!
//! Written once for a lone run and for a batch of runs.

use crate::effect::Phase;
use crate::model::{Model, Placed};
use crate::power::PowerTree;
use crate::real::Real;
use crate::system::{BatteryFacts, Facts};
use crate::units::{H_PER_S, KELVIN_AT_0_DEGC};
use crate::{Channel, Channels};

/// One or many runs of a model.
pub(crate) trait Parts<S> {
    /// Lets the effects of a phase act.
    fn act(&mut self, phase: Phase);

    /// Lets some effects of a phase act.
    fn act_among(&mut self, placed: &[Placed]);

    /// Does what the system itself does between phases, on the states and channels of every run.
    fn each(&mut self, between: impl Fn(&mut [S], &mut Channels<S>));
}

/// Advances by `dt_s` seconds.
#[inline(always)]
pub(crate) fn step<S: Real>(model: &Model, dt_s: f64, parts: &mut impl Parts<S>) {
    match &model.facts {
        Facts::Battery(facts) => battery(model, facts, dt_s, parts),
        Facts::Robot(robot) => {
            parts.each(|_, now| {
                now[Channel::PowerW] = S::from(0.0);
                now[Channel::TractionN] = S::from(0.0);
                now[Channel::CopperW] = S::from(0.0);
            });
            match &robot.tree {
                None => parts.act(Phase::Load),
                Some(tree) => rails(model, tree, parts),
            }
            parts.act(Phase::Converter);
            parts.act(Phase::Drive);
        }
        Facts::Station => {
            parts.each(|_, now| now[Channel::PackPowerW] = now[Channel::ChargePowerW]);
            parts.act(Phase::Load);
            parts.act(Phase::Charger);
            parts.act(Phase::Bypass);
            parts.act(Phase::Converter);
            parts.act(Phase::Overhead);
        }
    }
}

/// What loads take from the battery over the rails that they hang on. What effects ask of each
/// rail is kept in the robot's own states.
#[inline(never)]
fn rails<S: Real>(model: &Model, tree: &PowerTree, parts: &mut impl Parts<S>) {
    let count = tree.rails().len();
    parts.each(|asked_w, _| asked_w[..count].fill(S::from(0.0)));
    for group in model.placed_in(Phase::Load).chunk_by(|a, b| a.rail == b.rail) {
        parts.act_among(group);
        if let Some(rail) = group[0].rail {
            parts.each(|asked_w, now| {
                asked_w[rail] = now[Channel::PowerW];
                now[Channel::PowerW] = S::from(0.0);
            });
        }
    }
    parts.each(|asked_w, now| {
        let flow = tree.flow(model.facts.supply_v(now), now[Channel::AmbientDegc], |channel| now[channel], &asked_w[..count]);
        now.add(Channel::PowerW, flow.battery_w);
    });
}

/// A battery of like cells: between the two halves of its terminals lie the cells themselves.
#[inline(always)]
fn battery<S: Real>(model: &Model, facts: &BatteryFacts, dt_s: f64, parts: &mut impl Parts<S>) {
    let warms = model.predicts_temperature();
    sensed(warms, parts);
    let has = |phase| !model.placed_in(phase).is_empty();
    let kinds = Kinds { fades: has(Phase::Capacity), loses: has(Phase::Current), shifts: has(Phase::Equilibrium) };
    cells(facts, kinds, dt_s, parts);
    terminals(warms, parts);
}

/// From the current as its sensor shows it to the one that flowed.
#[inline(always)]
pub(crate) fn sensed<S: Real>(warms: bool, parts: &mut impl Parts<S>) {
    parts.each(|_, now| {
        now[Channel::TerminalCurrentA] = now[Channel::CurrentA];
        if !warms {
            now[Channel::CellDegc] = now[Channel::TemperatureDegc];
        }
    });
    parts.act(Phase::Sensed);
}

/// From the current at a pack's terminals to that of its cells, where these are stepped by
/// themselves: what the terminals do not see is drawn from all of them.
pub(crate) fn drawn<S: Real>(parallel: u32, parts: &mut impl Parts<S>) {
    parts.each(|_, now| {
        now[Channel::CellCurrentA] = now[Channel::TerminalCurrentA] * (1.0 / f64::from(parallel));
        now[Channel::LostCurrentA] = S::from(0.0);
    });
    parts.act(Phase::Current);
}

/// What the effects of a model's cells touch: what none touches need not be calculated.
#[derive(Clone, Copy)]
struct Kinds {
    /// Whether an effect changes the capacity.
    fades: bool,
    /// Whether an effect draws a current that does not reach the terminals.
    loses: bool,
    /// Whether an effect shifts the equilibrium voltage.
    shifts: bool,
}

#[inline(always)]
fn cells<S: Real>(facts: &BatteryFacts, kinds: Kinds, dt_s: f64, parts: &mut impl Parts<S>) {
    let Kinds { fades, loses, shifts } = kinds;
    let (series, parallel, hours) = (f64::from(facts.series), f64::from(facts.parallel), dt_s * H_PER_S);
    let per_parallel = if facts.parallel == 1 { 1.0 } else { 1.0 / parallel };
    let (resistance, self_discharge) = (facts.cell.resistance, facts.cell.self_discharge);
    let soc_per_a = facts.capacity_ah.recip() * (parallel * hours);
    parts.each(|_, now| {
        now[Channel::CapacityAh] = S::from(facts.capacity_ah);
        now[Channel::SocPerA] = S::from(soc_per_a);
        now[Channel::CellCurrentA] = now[Channel::TerminalCurrentA] * per_parallel;
        now[Channel::LostCurrentA] = S::from(0.0);
    });
    if fades {
        parts.act(Phase::Capacity);
        parts.each(|_, now| now[Channel::SocPerA] = now[Channel::CapacityAh].recip() * (parallel * hours));
    }
    parts.act(Phase::Current);
    parts.each(|states, now| {
        // The cell's charge over the cell's capacity, exact for a held current.
        let mut drained_a = now[Channel::CellCurrentA];
        if loses {
            now[Channel::LostCurrentA] *= self_discharge;
            drained_a += now[Channel::LostCurrentA];
        }
        states[0] -= if fades { drained_a * now[Channel::SocPerA] } else { drained_a * soc_per_a };
        now[Channel::Soc] = states[0];
        now[Channel::OcvV] = facts.ocv.voltage_v(states[0]);
        now[Channel::OverpotentialV] = S::from(0.0);
    });
    if shifts {
        parts.each(|_, now| now[Channel::EntropyVPerK] = S::from(0.0));
        parts.act(Phase::Equilibrium);
    }
    // A cell of more resistance is one of less electrode: the same current is denser in it.
    if resistance != 1.0 {
        parts.each(|_, now| now[Channel::CellCurrentA] *= resistance);
    }
    parts.act(Phase::Series);
    parts.each(|_, now| {
        now[Channel::CellVoltageV] = now[Channel::OcvV] - now[Channel::OverpotentialV];
        now[Channel::OverpotentialV] = S::from(0.0);
    });
    parts.act(Phase::Polarisation);
    parts.each(|_, now| {
        if resistance != 1.0 {
            now[Channel::CellCurrentA] /= resistance;
        }
        let polarisation_v = now[Channel::OverpotentialV];
        now[Channel::CellVoltageV] -= polarisation_v;
        now[Channel::OverpotentialV] = now[Channel::OcvV] - now[Channel::CellVoltageV];
        // Bernardi's balance: what the resistances burn, and what the change of entropy gives.
        // Without a change of entropy the heat need not wait for the temperature.
        let mut lost_v = now[Channel::OverpotentialV];
        if shifts {
            lost_v -= (now[Channel::CellDegc] + KELVIN_AT_0_DEGC) * now[Channel::EntropyVPerK];
        }
        now[Channel::HeatW] = lost_v * now[Channel::CellCurrentA];
        now[Channel::CellMinV] = now[Channel::CellVoltageV];
        now[Channel::CellMaxV] = now[Channel::CellVoltageV];
        now[Channel::TerminalVoltageV] = now[Channel::CellVoltageV] * series;
    });
    parts.act(Phase::Heat);
}

/// From the cells' voltage to the terminals and to what sensors show.
#[inline(always)]
pub(crate) fn terminals<S: Real>(warms: bool, parts: &mut impl Parts<S>) {
    parts.act(Phase::Connection);
    parts.each(|_, now| {
        now[Channel::PowerW] = now[Channel::TerminalVoltageV] * now[Channel::TerminalCurrentA];
        now[Channel::VoltageV] = now[Channel::TerminalVoltageV];
        now[Channel::TemperatureDegc] = now[Channel::CellDegc];
    });
    parts.act(Phase::Shown);
    if !warms {
        // A temperature that is an input already is what a sensor showed.
        parts.each(|_, now| now[Channel::TemperatureDegc] = now[Channel::CellDegc]);
    }
}
