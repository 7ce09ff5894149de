//! A tree of rails at work: from the battery's voltage to its current, with every loss on the way.
//!
//! Regulated rails fix their output voltage, so one pass from the loads up to the battery gives
//! every current. Where a switch has a resistance, the voltage behind it depends on the current
//! through it; then Newton's iteration on the whole tree, started from no load, finds the
//! operating point at the higher voltage (the one that a load reaches as it is switched on), in a
//! few passes up (currents and their slopes) and down (voltages).

use std::fmt;

use crate::power::tree::{PowerTree, RAILS_MAX, RailKind};
use crate::power::{Rail, Zip};
use crate::{Channel, Real};

/// Why a rail cannot deliver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cause {
    /// Its input voltage is too low.
    DropOut {
        /// Voltage at its input, V.
        input_v: f64,
        /// Least voltage that it needs there, V.
        needed_v: f64,
    },
    /// More current than it is made for.
    OverCurrent {
        /// Current asked of it, A.
        output_a: f64,
        /// Most that it delivers, A.
        output_a_max: f64,
    },
    /// Its junction is too hot.
    TooHot {
        /// Junction temperature, °C.
        junction_degc: f64,
        /// Temperature at which it shuts down, °C.
        junction_max_degc: f64,
    },
    /// No voltage behind its resistance satisfies its loads: more than V² / 4R is asked.
    NoOperatingPoint,
}

/// A rail cannot deliver what hangs on it.
#[derive(Debug, Clone, PartialEq)]
pub struct RailCannotDeliver {
    /// The rail.
    pub rail: String,
    /// Why.
    pub cause: Cause,
}

impl fmt::Display for RailCannotDeliver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "rail `{}` cannot deliver: ", self.rail)?;
        match self.cause {
            Cause::DropOut { input_v, needed_v } => write!(f, "{input_v:.3} V at its input, {needed_v:.3} V needed"),
            Cause::OverCurrent { output_a, output_a_max } => write!(f, "{output_a:.3} A asked, {output_a_max:.3} A at most"),
            Cause::TooHot { junction_degc, junction_max_degc } => {
                write!(f, "its junction would reach {junction_degc:.1} degC, {junction_max_degc:.1} degC at most")
            }
            Cause::NoOperatingPoint => write!(f, "its loads ask for more power than passes its resistance"),
        }
    }
}

impl std::error::Error for RailCannotDeliver {}

/// One rail at work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RailFlow<S> {
    /// Voltage at its input, V.
    pub input_v: S,
    /// Voltage on the rail, V.
    pub output_v: S,
    /// Current into its input, A.
    pub input_a: S,
    /// Current onto the rail, A.
    pub output_a: S,
    /// Power of the loads that hang on this rail itself, W.
    pub load_w: S,
    /// Power that turns into heat between input and rail, W.
    pub loss_w: S,
    /// Junction temperature of a linear regulator whose thermal resistance is known, °C.
    pub junction_degc: Option<S>,
    /// Why the rail cannot deliver, if it cannot.
    pub cause: Option<Cause>,
}

/// A whole tree at work.
#[derive(Debug, Clone, Copy)]
pub struct Flow<S> {
    rails: [RailFlow<S>; RAILS_MAX],
    count: usize,
    /// Current out of the battery into the tree, A.
    pub battery_a: S,
    /// Power out of the battery into the tree, W.
    pub battery_w: S,
}

impl<S: Real> Flow<S> {
    /// The rails, in the order of [`PowerTree::rails`].
    #[must_use]
    pub fn rails(&self) -> &[RailFlow<S>] {
        &self.rails[..self.count]
    }

    /// Power of all losses, W.
    #[must_use]
    pub fn loss_w(&self) -> S {
        self.rails().iter().fold(S::from(0.0), |sum, rail| sum + rail.loss_w)
    }

    /// Power of all loads, W.
    #[must_use]
    pub fn load_w(&self) -> S {
        self.rails().iter().fold(S::from(0.0), |sum, rail| sum + rail.load_w)
    }

    /// The first rail from the battery that cannot deliver, with its cause.
    #[must_use]
    pub fn refusal(&self) -> Option<(usize, Cause)> {
        self.rails().iter().enumerate().find_map(|(index, rail)| rail.cause.map(|cause| (index, cause)))
    }
}

/// Bound on Newton's iterations; quadratic convergence needs about five.
const ITERATIONS_MAX: usize = 60;
/// Largest relative change of a voltage in an iteration that counts as none.
const VOLTAGE_TOLERANCE: f64 = 1e-13;
/// Iterations after that, which settle the derivatives of dual numbers too.
const ITERATIONS_AFTER: usize = 2;

/// What a pass up the tree finds at one rail: current and its slope (A/V) over the voltage.
#[derive(Clone, Copy)]
struct Drawn<S> {
    current_a: S,
    slope_s: f64,
}

impl PowerTree {
    /// Every voltage, current and loss at a battery voltage (V), total for any input: a rail that
    /// cannot deliver is marked and counted as if it still did (below its drop-out a linear
    /// regulator's output follows its input).
    ///
    /// `share` gives the value of a channel that switches loads; `demand_w` a further constant
    /// power for each rail, W, >= 0 (rails beyond its end have none).
    #[must_use]
    pub fn flow<S: Real>(&self, battery_v: S, ambient_degc: S, share: impl Fn(Channel) -> S, demand_w: &[S]) -> Flow<S> {
        let zero = S::from(0.0);
        let mut zips = [Zip::none(); RAILS_MAX];
        for ((zip, rail), index) in zips.iter_mut().zip(self.rails()).zip(0..) {
            for load in &rail.loads {
                zip.join(load.zip(load.when.map_or(S::from(1.0), |channel| clamped(share(channel)))));
            }
            let demand_w = demand_w.get(index).copied().unwrap_or(zero);
            zip.power_w += if demand_w.re() > 0.0 { demand_w } else { zero };
        }
        let idle = RailFlow {
            input_v: zero,
            output_v: zero,
            input_a: zero,
            output_a: zero,
            load_w: zero,
            loss_w: zero,
            junction_degc: None,
            cause: None,
        };
        let mut flow = Flow { rails: [idle; RAILS_MAX], count: self.rails().len(), battery_a: zero, battery_w: zero };
        self.no_load(battery_v, &mut flow);
        if self.rails().iter().any(|rail| resistance_ohm(rail) > 0.0) {
            self.settle(battery_v, &zips, &mut flow);
        }
        self.account(battery_v, ambient_degc, &zips, &mut flow);
        flow
    }

    /// [`PowerTree::flow`] with plain numbers, refused when a rail cannot deliver.
    ///
    /// # Errors
    /// The first rail from the battery that cannot deliver, and why.
    pub fn solve(
        &self,
        battery_v: f64,
        ambient_degc: f64,
        share: impl Fn(Channel) -> f64,
        demand_w: &[f64],
    ) -> Result<Flow<f64>, RailCannotDeliver> {
        let flow = self.flow(battery_v, ambient_degc, share, demand_w);
        match flow.refusal() {
            Some((index, cause)) => Err(RailCannotDeliver { rail: self.rails()[index].id.clone(), cause }),
            None => Ok(flow),
        }
    }

    /// Voltages when no current flows.
    fn no_load<S: Real>(&self, battery_v: S, flow: &mut Flow<S>) {
        for (index, rail) in self.rails().iter().enumerate() {
            let input_v = self.parent(index).map_or(battery_v, |parent| flow.rails[parent].output_v);
            let at = &mut flow.rails[index];
            (at.input_v, at.output_v) = (input_v, unloaded_v(rail, input_v));
        }
    }

    /// Newton's iteration on the voltages behind switches with resistance.
    fn settle<S: Real>(&self, battery_v: S, zips: &[Zip<S>; RAILS_MAX], flow: &mut Flow<S>) {
        let none = Drawn { current_a: S::from(0.0), slope_s: 0.0 };
        let mut left = ITERATIONS_AFTER;
        for iteration in 0..ITERATIONS_MAX {
            // Up: what every rail draws at its present voltage, as a straight line about it.
            let mut drawn = [none; RAILS_MAX];
            for (index, rail) in self.rails().iter().enumerate().rev() {
                let (at, zip, mut own) = (&flow.rails[index], &zips[index], drawn[index]);
                own.current_a += zip.current_a(at.output_v);
                own.slope_s += slope_s(zip, at.output_v);
                drawn[index] = own;
                if let Some(parent) = self.parent(index) {
                    let input = at_input(rail, at, own);
                    drawn[parent].current_a += input.current_a;
                    drawn[parent].slope_s += input.slope_s;
                }
            }
            // Down: the voltages at which those lines meet.
            let mut still = true;
            for (index, rail) in self.rails().iter().enumerate() {
                let input_v = self.parent(index).map_or(battery_v, |parent| flow.rails[parent].output_v);
                let at = &mut flow.rails[index];
                at.input_v = input_v;
                let ohm = resistance_ohm(rail);
                if ohm == 0.0 || at.cause.is_some() {
                    // A switch that found no operating point passes half its input: the most power.
                    at.output_v = if at.cause.is_some() { input_v * 0.5 } else { unloaded_v(rail, input_v) };
                    continue;
                }
                let steepness = 1.0 + ohm * drawn[index].slope_s;
                let change_v = (input_v - drawn[index].current_a * ohm - at.output_v) / steepness;
                let after_v = at.output_v + change_v;
                let moved = change_v.re().abs() > VOLTAGE_TOLERANCE * input_v.re().abs();
                if steepness <= 0.0 || after_v.re().is_nan() || after_v.re() <= 0.0 || (moved && iteration + 1 == ITERATIONS_MAX) {
                    at.cause = Some(Cause::NoOperatingPoint);
                    at.output_v = input_v * 0.5;
                } else {
                    at.output_v = after_v;
                }
                still &= !moved;
            }
            left -= usize::from(still);
            if left == 0 {
                break;
            }
        }
    }

    /// Currents, losses and limits at the voltages found, from the loads up.
    fn account<S: Real>(&self, battery_v: S, ambient_degc: S, zips: &[Zip<S>; RAILS_MAX], flow: &mut Flow<S>) {
        for (index, rail) in self.rails().iter().enumerate().rev() {
            let at = &mut flow.rails[index];
            at.load_w = zips[index].power_w(at.output_v);
            at.output_a += zips[index].current_a(at.output_v);
            let live = at.input_v.re() > 0.0;
            let (input_a, loss_w, needed_v) = match &rail.kind {
                RailKind::Switching(converter) if live => {
                    let input_w = converter.input_w(at.input_v, at.output_a);
                    (input_w / at.input_v, converter.loss_w(at.input_v, at.output_a), converter.input_v_min)
                }
                RailKind::Linear(ldo) if live => {
                    let loss_w = ldo.loss_w(at.input_v, at.output_a);
                    at.junction_degc = ldo.junction_degc(ambient_degc, loss_w);
                    (ldo.input_a(at.output_a), loss_w, ldo.output_v + ldo.dropout_v)
                }
                RailKind::Switch(_) if live => (at.output_a, (at.input_v - at.output_v) * at.output_a, 0.0),
                RailKind::Switching(converter) => (S::from(0.0), S::from(0.0), converter.input_v_min.max(f64::MIN_POSITIVE)),
                RailKind::Linear(ldo) => (S::from(0.0), S::from(0.0), ldo.output_v + ldo.dropout_v),
                RailKind::Switch(_) => (S::from(0.0), S::from(0.0), f64::MIN_POSITIVE),
            };
            (at.input_a, at.loss_w) = (input_a, loss_w);
            let too_hot = match (&rail.kind, at.junction_degc) {
                (RailKind::Linear(ldo), Some(degc)) if degc.re() > ldo.junction_max_degc => {
                    Some(Cause::TooHot { junction_degc: degc.re(), junction_max_degc: ldo.junction_max_degc })
                }
                _ => None,
            };
            let dropped = at.input_v.re() < needed_v;
            let over = at.output_a.re() > rail.current_a_max;
            at.cause = at
                .cause
                .or(dropped.then_some(Cause::DropOut { input_v: at.input_v.re(), needed_v }))
                .or(over.then_some(Cause::OverCurrent { output_a: at.output_a.re(), output_a_max: rail.current_a_max }))
                .or(too_hot);
            match self.parent(index) {
                Some(parent) => flow.rails[parent].output_a += input_a,
                None => flow.battery_a += input_a,
            }
        }
        flow.battery_w = flow.battery_a * battery_v;
    }
}

fn clamped<S: Real>(share: S) -> S {
    if share.re() >= 1.0 {
        S::from(1.0)
    } else if share.re() > 0.0 {
        share
    } else {
        S::from(0.0)
    }
}

fn resistance_ohm(rail: &Rail) -> f64 {
    if let RailKind::Switch(switch) = &rail.kind { switch.resistance_ohm } else { 0.0 }
}

/// Voltage of a rail through which no current flows.
fn unloaded_v<S: Real>(rail: &Rail, input_v: S) -> S {
    if input_v.re() <= 0.0 {
        return S::from(0.0);
    }
    match &rail.kind {
        RailKind::Switching(converter) => S::from(converter.output_v),
        RailKind::Linear(ldo) => ldo.output_v(input_v),
        RailKind::Switch(_) => input_v,
    }
}

/// dI/dV of a sum of loads, S.
fn slope_s<S: Real>(zip: &Zip<S>, voltage_v: S) -> f64 {
    let volts = voltage_v.re();
    if volts > 0.0 { zip.conductance_s.re() - zip.power_w.re() / (volts * volts) } else { 0.0 }
}

/// What a rail draws at its input, from what is drawn on it.
fn at_input<S: Real>(rail: &Rail, at: &RailFlow<S>, drawn: Drawn<S>) -> Drawn<S> {
    let input_v = at.input_v.re();
    if input_v <= 0.0 {
        return Drawn { current_a: S::from(0.0), slope_s: 0.0 };
    }
    match &rail.kind {
        // The same power at a higher voltage is less current; efficiency changes far less.
        RailKind::Switching(converter) => {
            let current_a = converter.input_w(at.input_v, drawn.current_a) / at.input_v;
            Drawn { current_a, slope_s: -current_a.re() / input_v }
        }
        RailKind::Linear(ldo) => {
            let follows = at.output_v.re() < ldo.output_v;
            Drawn { current_a: ldo.input_a(drawn.current_a), slope_s: if follows { drawn.slope_s } else { 0.0 } }
        }
        RailKind::Switch(switch) => {
            let steepness = 1.0 + switch.resistance_ohm * drawn.slope_s;
            if steepness <= 0.0 || at.cause.is_some() {
                return drawn;
            }
            // The voltage behind the switch moves on to where its own line is met.
            let change_v = (at.input_v - drawn.current_a * switch.resistance_ohm - at.output_v) / steepness;
            Drawn { current_a: drawn.current_a + change_v * drawn.slope_s, slope_s: drawn.slope_s / steepness }
        }
    }
}

#[cfg(test)]
mod tests;
