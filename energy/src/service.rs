//! What one service of a robot takes from a station's packs: energy with its doubt and its causes,
//! and the time on the charger.
//!
//! The battery is charged step by step on its CC-CV charger, and at every step the station's model
//! says what its pack gives for that: converters whose efficiency depends on their load make the
//! mean power a wrong input. A service's energy is what the station takes *beyond* what it takes
//! anyway.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::charger::PowerPath;
use crate::effect::{Phase, find};
use crate::forecast::{self, charge_within};
use crate::protection::Trip;
use crate::system::System;
use crate::units::{REFERENCE_DEGC, S_PER_H};
use crate::{Channel, Estimate, Model, Need, Run, Start};

/// A station's handling of robots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Handling {
    /// Time to lift a robot into a bay, s.
    pub load_s: f64,
    /// Time to lift a robot out of a bay, s.
    pub unload_s: f64,
    /// Time to exchange a robot's pack, s.
    pub swap_s: f64,
}

/// Under which circumstances a robot is serviced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circumstances {
    /// Voltage of the station's active pack, V; 0 when it is not known, and then effects that
    /// depend on it are left out.
    pub pack_v: f64,
    /// Robots that charge side by side (>= 1): converters and chargers that share a load have other
    /// losses than one alone, and each robot bears its part of them.
    pub at_once: f64,
    /// Most power that the station's converters give to all bays together, W; infinite for none.
    pub converter_w_max: f64,
    /// Temperature of the robot's battery at the start, °C.
    pub temperature_degc: f64,
    /// Temperature around it at the station, °C: what it warms up or cools down to while its protection lets it take nothing.
    pub ambient_degc: f64,
    /// Whether the charge rests while the battery's protection finds it too hot or too cold.
    pub protected: bool,
}

impl Circumstances {
    /// One robot alone, at a pack voltage of 0 (not known), without a limit.
    pub const ALONE: Circumstances = Circumstances {
        pack_v: 0.0,
        at_once: 1.0,
        converter_w_max: f64::INFINITY,
        temperature_degc: REFERENCE_DEGC,
        ambient_degc: REFERENCE_DEGC,
        protected: true,
    };
}

/// What one recharge takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Recharge {
    /// Time on the charger, s.
    pub charge_s: f64,
    /// Why that never ends, and the state of charge that it stops at: the battery stays too hot or too cold to be charged.
    pub stopped: Option<(Trip, f64)>,
    /// Energy from the station's packs, Wh.
    pub need: Need,
    /// The same by cause, Wh: the charge itself, then each effect of the station's model. It sums to
    /// the mean of the need.
    pub breakdown_wh: BTreeMap<String, f64>,
}

/// The station's inputs: what goes on in its bays.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Situation {
    /// Power into the batteries of all robots, W.
    pub charge_w: f64,
    /// Robots in powered bays.
    pub docked: f64,
    /// Robots whose batteries take charge.
    pub charging: f64,
    /// Sum of the squared bay currents, A².
    pub squared_a2: f64,
    /// Lift movements under way.
    pub lift: f64,
    /// Voltage of the active pack, V.
    pub pack_v: f64,
}

impl Situation {
    /// Sets a station's inputs.
    pub fn set(&self, run: &mut Run<f64>) {
        let inputs = [
            (Channel::ChargePowerW, self.charge_w),
            (Channel::RobotsDocked, self.docked),
            (Channel::RobotsCharging, self.charging),
            (Channel::BaySquaredCurrentA2, self.squared_a2),
            (Channel::LiftActive, self.lift),
            (Channel::PackVoltageV, self.pack_v),
        ];
        for (channel, value) in inputs {
            run.channels[channel] = value;
        }
    }
}

/// One stretch of a charge.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stretch {
    hours: f64,
    /// Into the robot's battery, W.
    charge_w: f64,
    current_a: f64,
}

/// A robot's stay at the station, or that of a pack alone.
struct Stay {
    /// Robots that hang on the bays for each battery that charges: 1, or 0 for packs alone.
    docked: f64,
    stretches: Vec<Stretch>,
    load_h: f64,
    unload_h: f64,
}

impl Stay {
    /// What goes on, for how long, and how many services share it.
    fn situations(&self, around: &Circumstances) -> impl Iterator<Item = (Situation, f64, f64)> + '_ {
        let (robots, pack_v) = (around.at_once.max(1.0), around.pack_v);
        let lifting = |docked, hours| (Situation { docked, lift: 1.0, pack_v, ..Situation::default() }, hours, 1.0);
        let charging = self.stretches.iter().map(move |stretch| {
            let situation = Situation {
                charge_w: robots * stretch.charge_w,
                docked: robots * self.docked,
                charging: if stretch.charge_w > 0.0 { robots } else { 0.0 },
                squared_a2: robots * stretch.current_a.powi(2),
                lift: 0.0,
                pack_v,
            };
            (situation, stretch.hours, robots)
        });
        // A robot that is lifted out hangs on its bay until it is out.
        charging.chain([lifting(0.0, self.load_h), lifting(self.docked, self.unload_h)])
    }

    fn energy_wh(&self, run: &mut Run<f64>, around: &Circumstances) -> f64 {
        let idle_w = power_w(run, &idle(around));
        self.situations(around).map(|(situation, hours, robots)| (power_w(run, &situation) - idle_w) * hours / robots).sum()
    }
}

/// Energy that one recharge of a robot from `soc` to `target_soc` takes from the station's active
/// pack, beyond what the station takes anyway (E, Wh), with its standard deviation and its causes:
///
/// `E = sum over the charge of (P_pack(n P_charge(t), n docked) - P_pack(0, 0)) dt / n + lift`
///
/// with `n` robots at once. The doubt of the station's parameters is shared by all services, that
/// of the robot's battery (charge, capacity, parameters) is its own. Everything is carried to first
/// order by central differences.
#[must_use]
pub fn service_energy(
    station: &Arc<Model>,
    handling: Handling,
    battery: &Arc<Model>,
    soc: Estimate,
    target_soc: f64,
    around: &Circumstances,
) -> Recharge {
    recharge(station, Some(handling), battery, soc, target_soc, around)
}

/// The same for a robot's pack that is charged at the station without its robot: no lift and no own
/// load, but the same converters and chargers.
#[must_use]
pub fn pack_energy(station: &Arc<Model>, battery: &Arc<Model>, soc: Estimate, target_soc: f64, around: &Circumstances) -> Recharge {
    recharge(station, None, battery, soc, target_soc, around)
}

fn recharge(
    station: &Arc<Model>,
    handling: Option<Handling>,
    battery: &Arc<Model>,
    soc: Estimate,
    target_soc: f64,
    around: &Circumstances,
) -> Recharge {
    let mut load = Run::new(Arc::clone(station), Start::at_soc(0.0));
    let docked = if handling.is_some() { 1.0 } else { 0.0 };
    let battery_v = battery.battery().stored_wh() / battery.battery().capacity_ah;
    let bay_w_max = charge_w_max(&mut load, docked, battery_v, around) / around.at_once.max(1.0);
    let [load_h, unload_h] = handling.map_or([0.0; 2], |handling| [handling.load_s / S_PER_H, handling.unload_s / S_PER_H]);
    let stay = |values: &[f64]| {
        let mut stretches = Vec::new();
        let mut run = forecast::pack_at(battery, values, around.temperature_degc);
        run.channels_mut()[Channel::AmbientDegc] = around.ambient_degc;
        // With the same current, and behind the same converters, a larger battery takes longer.
        let stretch = |dt_s: f64, current_a: f64, power_w: f64| {
            stretches.push(Stretch { hours: values[1] * dt_s / S_PER_H, charge_w: power_w, current_a });
        };
        let charge = charge_within(&mut run, target_soc, bay_w_max, around.protected, stretch);
        let stay = Stay { docked, stretches, load_h, unload_h };
        (stay, charge)
    };
    let inputs = forecast::uncertain(battery, soc);
    let expected: Vec<f64> = inputs.iter().map(|input| input.value).collect();
    let (mean, charge) = stay(&expected);
    let own = crate::propagate(&inputs, |values| stay(values).0.energy_wh(&mut load, around));
    let mut need = need(station, |values| {
        let mut run = Run::with_parameters(Arc::clone(station), values.to_vec(), Start::at_soc(0.0));
        mean.energy_wh(&mut run, around)
    });
    need.own_variance = own.sigma.powi(2);
    let charge_s = expected[1] * charge.time_s;
    Recharge { charge_s, stopped: charge.stopped.map(|why| (why, charge.soc)), need, breakdown_wh: breakdown(station, &mean, around) }
}

fn breakdown(station: &Arc<Model>, stay: &Stay, around: &Circumstances) -> BTreeMap<String, f64> {
    let mut run = Run::new(Arc::clone(station), Start::at_soc(0.0));
    let charge_wh = stay.stretches.iter().map(|stretch| stretch.charge_w * stretch.hours).sum();
    let mut breakdown_wh = BTreeMap::from([("charge".to_owned(), charge_wh)]);
    let idle = shares(&mut run, &idle(around));
    for (situation, hours, robots) in stay.situations(around) {
        for ((cause, share_w), (_, idle_w)) in shares(&mut run, &situation).into_iter().zip(&idle) {
            *breakdown_wh.entry(cause.to_owned()).or_insert(0.0) += (share_w - idle_w) * hours / robots;
        }
    }
    breakdown_wh.retain(|_, wh| wh.abs() > 1e-9);
    breakdown_wh
}

/// What the station takes in an hour in which it services nobody.
#[must_use]
pub fn overhead_per_h(station: &Arc<Model>, pack_v: f64) -> Need {
    need(station, |values| power_w(&mut run_with(station, values), &Situation { pack_v, ..Situation::default() }))
}

/// The station's overhead in an hour by cause, Wh.
#[must_use]
pub fn overhead_breakdown(station: &Arc<Model>, pack_v: f64) -> BTreeMap<String, f64> {
    let mut run = run_with(station, &station.values());
    let shares = shares(&mut run, &Situation { pack_v, ..Situation::default() });
    shares.into_iter().map(|(cause, w)| (cause.to_owned(), w)).filter(|(_, w)| w.abs() > 1e-9).collect()
}

/// How the robots of a station are joined to their bays, by its model: whether their own load passes
/// their chargers. None when the model knows of no own load.
#[must_use]
pub fn power_path(station: &Model) -> Option<PowerPath> {
    let has = |id: &str| station.effects().any(|effect| effect.spec().id == id);
    match (has(DIRECT), has(SELECTED)) {
        (true, _) => Some(PowerPath::Direct),
        (false, true) => Some(PowerPath::Selected),
        (false, false) => None,
    }
}

/// The same station with robots that are joined to their bays the other way: what the other power
/// path would save or cost is the difference between the two. None when the model knows of no own
/// load, or of both ways at once.
#[must_use]
pub fn with_other_path(station: &Model) -> Option<Model> {
    station.exchanged(DIRECT, SELECTED).or_else(|| station.exchanged(SELECTED, DIRECT))
}

/// Effects that say where the robots' own load is taken.
const DIRECT: &str = "robot_own_load";
const SELECTED: &str = "path_selection";

/// What an exchange of a robot's pack takes: the station's handling, at the power of its lift.
#[must_use]
pub fn exchange(station: &Arc<Model>, handling: Handling, pack_v: f64) -> Need {
    let nothing = Situation { pack_v, ..Situation::default() };
    let lifting = Situation { lift: 1.0, ..nothing };
    need(station, |values| {
        let mut run = run_with(station, values);
        (power_w(&mut run, &lifting) - power_w(&mut run, &nothing)) * handling.swap_s / S_PER_H
    })
}

/// Power that the bays' converters give in a situation, W: all that is charged and lost behind them.
#[must_use]
pub fn converter_output_w(load: &mut Run<f64>, situation: &Situation) -> f64 {
    let behind = |id: &str| find(System::Station, id).is_some_and(|(_, effect)| effect.spec().phase < Phase::Converter);
    let shares = shares(load, situation);
    situation.charge_w + shares.iter().filter(|(id, _)| behind(id)).map(|(_, share_w)| share_w).sum::<f64>()
}

/// Most power into all batteries of this voltage (V) that charge at once, W, where so many robots hang on the bays for each of them, when the
/// converters give at most what the circumstances say; infinite without a limit, 0 when the robots' own loads take it all.
fn charge_w_max(load: &mut Run<f64>, docked: f64, battery_v: f64, around: &Circumstances) -> f64 {
    if around.converter_w_max.is_infinite() {
        return f64::INFINITY;
    }
    let charging = around.at_once.max(1.0);
    let nothing = Situation { docked: docked * charging, charging, pack_v: around.pack_v, ..Situation::default() };
    // What contacts lose of it goes by the square of each one's current.
    let squared_a2 = |charge_w: f64| charging * (charge_w / charging / battery_v).powi(2);
    charge_w_within(load, around.converter_w_max, |charge_w| Situation { charge_w, squared_a2: squared_a2(charge_w), ..nothing })
}

/// The greatest charge power (W) at which the converters give at most `limit_w` in the situation
/// that `at` makes of it. Their output rises with the charge power, so halving finds it.
#[must_use]
pub fn charge_w_within(load: &mut Run<f64>, limit_w: f64, at: impl Fn(f64) -> Situation) -> f64 {
    // What goes into the batteries is never more than what the converters give.
    let (mut low_w, mut high_w) = (0.0, limit_w.max(0.0));
    for _ in 0..HALVINGS {
        let middle_w = f64::midpoint(low_w, high_w);
        if converter_output_w(load, &at(middle_w)) <= limit_w { low_w = middle_w } else { high_w = middle_w }
    }
    low_w
}

/// Halvings of a limit: 2^-30 of it is left open.
const HALVINGS: u32 = 30;

fn idle(around: &Circumstances) -> Situation {
    Situation { pack_v: around.pack_v, ..Situation::default() }
}

fn run_with(station: &Arc<Model>, values: &[f64]) -> Run<f64> {
    Run::with_parameters(Arc::clone(station), values.to_vec(), Start::at_soc(0.0))
}

fn power_w(run: &mut Run<f64>, situation: &Situation) -> f64 {
    situation.set(run);
    run.step(1.0);
    run.channels[Channel::PackPowerW]
}

fn shares(run: &mut Run<f64>, situation: &Situation) -> Vec<(&'static str, f64)> {
    situation.set(run);
    run.step_explained(1.0)
}

/// Value and change by each parameter's deviation (central differences).
fn need(station: &Arc<Model>, energy_wh: impl Fn(&[f64]) -> f64) -> Need {
    let mut values = station.values();
    let mean_wh = energy_wh(&values);
    let mut shared_wh = Vec::new();
    for (index, parameter) in station.parameters().iter().enumerate() {
        let mut at = |value: f64| {
            values[index] = value.clamp(parameter.min, parameter.max);
            energy_wh(&values)
        };
        let change = (at(parameter.value + parameter.sigma) - at(parameter.value - parameter.sigma)) / 2.0;
        values[index] = parameter.value;
        shared_wh.push(change);
    }
    Need { mean_wh, shared_wh, own_variance: 0.0 }
}

#[cfg(test)]
mod tests;
