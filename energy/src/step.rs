//! One step of each system: what happens between the phases.
//!
//! Written once for a lone run and for a batch of runs.

use crate::effect::Phase;
use crate::model::Model;
use crate::real::Real;
use crate::system::{BatteryFacts, Facts};
use crate::units::S_PER_H;
use crate::{Channel, Channels};

/// One or many runs of a model.
pub(crate) trait Parts<S> {
    /// Lets the effects of a phase act.
    fn act(&mut self, phase: Phase);

    /// Does what the system itself does between phases, on the states and channels of every run.
    fn each(&mut self, between: impl Fn(&mut [S], &mut Channels<S>));
}

/// Advances by `dt_s` seconds.
#[inline]
pub(crate) fn step<S: Real>(model: &Model, dt_s: f64, parts: &mut impl Parts<S>) {
    match &model.facts {
        Facts::Battery(facts) => battery(facts, model.predicts_temperature(), dt_s, parts),
        Facts::Robot => {
            parts.each(|_, now| now[Channel::PowerW] = S::from(0.0));
            parts.act(Phase::Load);
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

/// A battery of like cells: between the two halves of its terminals lie the cells themselves.
#[inline]
fn battery<S: Real>(facts: &BatteryFacts, warms: bool, dt_s: f64, parts: &mut impl Parts<S>) {
    sensed(warms, parts);
    cells(facts, dt_s, parts);
    terminals(warms, parts);
}

/// From the current as its sensor shows it to the one that flowed.
#[inline]
pub(crate) fn sensed<S: Real>(warms: bool, parts: &mut impl Parts<S>) {
    parts.each(|_, now| {
        now[Channel::TerminalCurrentA] = now[Channel::CurrentA];
        if !warms {
            now[Channel::CellDegc] = now[Channel::TemperatureDegc];
        }
    });
    parts.act(Phase::Sensed);
}

#[inline]
fn cells<S: Real>(facts: &BatteryFacts, dt_s: f64, parts: &mut impl Parts<S>) {
    let (series, parallel, hours) = (f64::from(facts.series), f64::from(facts.parallel), dt_s / S_PER_H);
    let (resistance, self_discharge) = (facts.cell.resistance, facts.cell.self_discharge);
    parts.each(|_, now| {
        now[Channel::CapacityAh] = S::from(facts.capacity_ah);
        now[Channel::CellCurrentA] = now[Channel::TerminalCurrentA] / parallel;
        now[Channel::LostCurrentA] = S::from(0.0);
    });
    parts.act(Phase::Capacity);
    parts.act(Phase::Current);
    parts.each(|states, now| {
        if self_discharge != 1.0 {
            now[Channel::LostCurrentA] *= self_discharge;
        }
        // The cell's charge over the cell's capacity, exact for a held current.
        let drained_a = now[Channel::CellCurrentA] + now[Channel::LostCurrentA];
        states[0] -= drained_a / now[Channel::CapacityAh] * (parallel * hours);
        now[Channel::Soc] = states[0];
        now[Channel::OcvV] = facts.ocv.voltage_v(states[0]);
        now[Channel::OverpotentialV] = S::from(0.0);
    });
    parts.act(Phase::Equilibrium);
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
            now[Channel::CellCurrentA] = now[Channel::CellCurrentA] / resistance;
        }
        now[Channel::CellVoltageV] = now[Channel::CellVoltageV] - now[Channel::OverpotentialV];
        now[Channel::OverpotentialV] = now[Channel::OcvV] - now[Channel::CellVoltageV];
        now[Channel::HeatW] = now[Channel::OverpotentialV] * now[Channel::CellCurrentA];
        now[Channel::CellMinV] = now[Channel::CellVoltageV];
        now[Channel::CellMaxV] = now[Channel::CellVoltageV];
        now[Channel::TerminalVoltageV] = now[Channel::CellVoltageV] * series;
    });
    parts.act(Phase::Heat);
}

/// From the cells' voltage to the terminals and to what sensors show.
#[inline]
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
