//! Energy and time until a discharge or a charge ends, found by stepping the model.
//!
//! Usable energy is less than stored energy: it ends where the voltage under load meets the end
//! of discharge (Kottas, section 3.1), so it is never a division.

pub mod ending;
mod remaining;

pub use remaining::{remaining_from, remaining_wh};

use std::sync::Arc;

use crate::load::Terminals as _;
use crate::pack::Battery;
use crate::protection::Trip;
use crate::units::{S_PER_DAY, S_PER_H};
use crate::{Channel, Estimate, Facts, Model, Pack, RobotFacts, Run, Start, propagate};

/// A discharge at constant power, to the end of discharge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Discharge {
    /// Energy delivered at the terminals, Wh.
    pub energy_wh: f64,
    /// Time it takes, s.
    pub time_s: f64,
}

/// A CC-CV charge to a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Charge {
    /// Energy into the terminals, Wh.
    pub energy_wh: f64,
    /// Time it takes, s; [`TIME_MAX_S`] where it never ends.
    pub time_s: f64,
    /// State of charge at the end: the target, or less when the charger's current fell below
    /// its cutoff first.
    pub soc: f64,
    /// Why it never ends: the pack stays too hot or too cold to be charged.
    pub stopped: Option<Trip>,
}

/// Steps of a forecast: four times as many change its energy by less than 0.1 % (see the tests).
const STEPS: f64 = 40.0;
/// Longest forecast, s: a week.
pub const TIME_MAX_S: f64 = 7.0 * S_PER_DAY;
/// Change of a temperature that counts as none, K per s: a kelvin in a day.
const SETTLED_K_PER_S: f64 = 1.0 / S_PER_DAY;
/// Power below which a pack counts as unloaded for a forecast, as a share of its stored energy
/// per hour (C/100: slower discharges deliver no more energy).
const POWER_SHARE_MIN: f64 = 0.01;

/// Share of its rated capacity that a battery of this model has after so many full cycles, at rest and at the reference temperature.
#[must_use]
pub fn health(model: &Arc<Model>, cycle_count: f64) -> f64 {
    let mut run = Run::new(Arc::clone(model), Start { cycle_count, ..Start::at_soc(0.5) });
    run.step_current(0.0, 1.0);
    run.channels[Channel::CapacityAh] / model.battery().capacity_ah
}

/// Discharges a pack at `power_w` until it, or its weakest cell, reaches the end of discharge.
///
/// A power below 1 % of the stored energy per hour is taken as that: it delivers what the pack
/// can deliver at rest, and the time is that of the small power.
#[must_use]
pub fn discharge(run: &mut impl Battery, power_w: f64) -> Discharge {
    discharge_behind(run, power_w, |_| 0.0)
}

/// [`discharge`] of a pack that has more resistance than the run's model: `extra_ohm` of the whole
/// pack over state of charge, which may be negative. A gauge that learned a resistance asks this.
#[must_use]
pub fn discharge_behind(run: &mut impl Battery, power_w: f64, extra_ohm: impl Fn(f64) -> f64) -> Discharge {
    let model = Arc::clone(run.model());
    let facts = model.battery();
    let stored_wh = facts.stored_wh();
    let drawn_w = power_w.max(POWER_SHARE_MIN * stored_wh);
    let soc = run.channel(Channel::Soc);
    let expected_s = (soc.max(0.0) * stored_wh / drawn_w * S_PER_H).min(TIME_MAX_S);
    let longest_s = (expected_s / STEPS).max(1.0);
    let (mut dt_s, mut time_s, mut energy_wh) = (longest_s, 0.0, 0.0);
    // How far the voltage, or that of the weakest cell, lies above its end after a step.
    let above_v =
        |voltage_v: f64, lowest_v: f64| (voltage_v - facts.eod_v()).min((lowest_v - facts.eod_v_per_cell) * f64::from(facts.series));
    let (mut before_v, mut before_above_v) = (None, 0.0);
    let mut last_a = drawn_w / run.channel(Channel::TerminalVoltageV).max(facts.eod_v());
    while time_s < TIME_MAX_S {
        let more_ohm = extra_ohm(run.channel(Channel::Soc));
        let is_met = run.step_power(drawn_w + more_ohm * last_a * last_a, dt_s).is_ok();
        // What flows and what is delivered does not hang on what sensors show of it; where it ends does: nothing else sees the voltage.
        let current_a = run.channel(Channel::TerminalCurrentA);
        let more_v = more_ohm * current_a;
        let voltage_v = run.channel(Channel::TerminalVoltageV) - more_v;
        let lowest_v = run.channel(Channel::CellMinV) - more_v / f64::from(facts.series);
        let now_above_v = above_v(run.channel(Channel::VoltageV) - more_v, lowest_v);
        if is_met && now_above_v >= 0.0 {
            // The step holds the current that gives this power at its end; the voltage fell to
            // there from that of the step before, so the step's energy is that of their mean.
            energy_wh += current_a * f64::midpoint(before_v.unwrap_or(voltage_v), voltage_v) * dt_s / S_PER_H;
            (before_v, before_above_v, last_a) = (Some(voltage_v), now_above_v, current_a);
            time_s += dt_s;
            continue;
        }
        // The end lies inside this step: go back and approach it by halves, in the last of them on a straight line. Without
        // that the energy would be a sawtooth over whatever the model hangs on, and a small deviation of it any deviation.
        run.restore();
        if dt_s < 0.01 * longest_s {
            if let Some(before_v) = before_v.filter(|_| is_met) {
                let share = before_above_v / (before_above_v - now_above_v);
                energy_wh += current_a * f64::midpoint(before_v, before_v + share * (voltage_v - before_v)) * share * dt_s / S_PER_H;
            }
            break;
        }
        dt_s /= 2.0;
    }
    Discharge { energy_wh, time_s: energy_wh * S_PER_H / power_w.max(1e-9) }
}

/// Charges a pack by its own charger settings until `target_soc` or the cutoff current, as if no temperature ever stopped it.
#[must_use]
pub fn charge(run: &mut impl Battery, target_soc: f64) -> Charge {
    charge_within(run, target_soc, f64::INFINITY, false, |_, _, _| {})
}

/// [`charge`] with at most `power_w_max` into the battery, W: several share what charges
/// them, and a charge for which nothing is left never ends. A `protected` one rests while the pack is too hot or too cold to be charged, as long as that helps; its surroundings
/// keep their temperature. Says of each stretch how long it was (s) and what went into the battery (A, W; nothing
/// while it rests).
pub fn charge_within(
    run: &mut impl Battery,
    target_soc: f64,
    power_w_max: f64,
    protected: bool,
    mut stretch: impl FnMut(f64, f64, f64),
) -> Charge {
    let model = Arc::clone(run.model());
    let facts = model.battery();
    let most_a = |terminal_v: f64| facts.charge.current_a.min(power_w_max / terminal_v.max(0.1));
    let begin_a = most_a(run.channel(Channel::TerminalVoltageV)).max(POWER_SHARE_MIN * facts.charge.current_a);
    let expected_s = (target_soc - run.channel(Channel::Soc)).max(0.0) * facts.capacity_ah / begin_a * S_PER_H;
    let dt_s = (expected_s / STEPS).max(1.0);
    let (mut energy_wh, mut time_s) = (0.0, 0.0);
    let (mut barred, mut without_it) = (None, None);
    while time_s < TIME_MAX_S && run.channel(Channel::Soc) < target_soc {
        let cell_degc = run.channel(Channel::CellDegc);
        barred = if protected { facts.protection.no_charge_at(cell_degc, barred) } else { None };
        if barred.is_some() {
            run.step_current(0.0, dt_s);
            if (run.channel(Channel::CellDegc) - cell_degc).abs() < SETTLED_K_PER_S * dt_s {
                time_s = TIME_MAX_S;
                break;
            }
            stretch(dt_s, 0.0, 0.0);
            time_s += dt_s;
            continue;
        }
        let before = run.channel(Channel::Soc);
        let limit_a = most_a(run.channel(Channel::TerminalVoltageV));
        let current_a = -run.step_charge(limit_a, facts.full_v(), dt_s);
        let after = run.channel(Channel::Soc);
        if limit_a <= 0.0 {
            // Nothing is left for it.
            time_s = TIME_MAX_S;
            break;
        }
        // A current cut by a shared limit is not the end of the charge; a step below the cutoff comes after it.
        if current_a < facts.charge.cutoff_a.min(0.999 * limit_a) {
            without_it = Some(before);
            break;
        }
        // The last step counts only up to the target.
        let share = if after > target_soc { (target_soc - before) / (after - before) } else { 1.0 };
        let power_w = -run.channel(Channel::PowerW);
        stretch(share * dt_s, current_a, power_w);
        energy_wh += power_w * share * dt_s / S_PER_H;
        time_s += share * dt_s;
    }
    let stopped = barred.filter(|_| time_s >= TIME_MAX_S);
    Charge { energy_wh, time_s, soc: without_it.unwrap_or_else(|| run.channel(Channel::Soc)).min(target_soc), stopped }
}

/// What a pack's estimate depends on, for a forecast with sigma: its charge, its parameters and
/// its capacity.
pub(crate) fn uncertain(model: &Model, soc: Estimate) -> Vec<Estimate> {
    let mut inputs = vec![soc, Estimate::new(1.0, model.uncertainty.capacity_relative_sigma)];
    inputs.extend(model.estimates());
    inputs
}

/// A pack of the model at one draw of its uncertain inputs. The capacity's factor is left to the
/// caller: it scales energy and time of any forecast that keeps the power per capacity.
pub(crate) fn pack_at(model: &Arc<Model>, inputs: &[f64], temperature_degc: f64) -> Pack {
    let start = Start { temperature_degc, ..Start::at_soc(inputs[0].clamp(0.0, 1.0)) };
    let parameters = inputs[2..].iter().zip(model.parameters()).map(|(&value, p)| value.clamp(p.min, p.max)).collect();
    Pack::with_parameters(Arc::clone(model), parameters, start)
}

/// Evaluates `f` at a robot's or station's parameters and carries their deviations, and those of the
/// loads on its rails, to first order. Values are those of [`Model::parameters`], not clamped.
pub fn propagate_loads(model: &Arc<Model>, mut f: impl FnMut(&Arc<Model>, &[f64]) -> f64) -> Estimate {
    let known = propagate(&model.estimates(), |values| f(model, values));
    let Facts::Robot(RobotFacts { tree: Some(tree), .. }) = &model.facts else { return known };
    let values = model.values();
    let mut variance = known.sigma.powi(2);
    for pair in tree.deviations() {
        let [above, below] = pair.map(|tree| {
            let mut facts = model.facts.clone();
            if let Facts::Robot(robot) = &mut facts {
                robot.tree = Some(tree);
            }
            f(&Arc::new(model.part(facts, |_| true).0), &values)
        });
        variance += ((above - below) / 2.0).powi(2);
    }
    Estimate::new(known.value, variance.sqrt())
}

/// Power that a robot or station draws with the given inputs, W, with its deviation.
#[must_use]
pub fn power_w(model: &Arc<Model>, inputs: &[(Channel, f64)]) -> Estimate {
    let target = model.system.targets()[0];
    propagate_loads(model, |model, values| {
        let mut run = Run::with_parameters(Arc::clone(model), values.to_vec(), Start::at_soc(0.0));
        for &(channel, value) in inputs {
            run.channels[channel] = value;
        }
        run.step(1.0);
        run.channels[target]
    })
}

#[cfg(test)]
mod tests;
