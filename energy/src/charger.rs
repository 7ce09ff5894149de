//! The CC-CV charger as a device: its limits, its states, and what it does when a robot hangs on
//! its output or when several share a converter.
//!
//! ```text
//!              cells below 3 V         above          voltage reached     output below cutoff
//!   Waiting ──────────────────> Precharge ──> Current ──────────────> Voltage ──────────> Done
//!      ^         (no request: below 0 °C, above 45 °C, pack absent)                         │
//!      └──────────────────────── cells below the recharge threshold ────────────────────────┘
//! ```
//!
//! Two power paths (Kottas, section B.2.1). *Direct connection*: charger output, battery and the
//! robot's rail are one node. The charger measures what leaves it, so the robot's own current
//! counts against its current limit (the battery is charged more slowly, or is even drained when
//! the robot takes more than the charger gives), and it counts in the taper: a robot that takes
//! more than the cutoff current keeps the charge from ever ending, and its battery floats at full
//! voltage (Texas Instruments says the same of its bq24153A, section "System Load After Sensing
//! Resistor"). Then the gauge must end the charge, as our agents do by state of charge. Once the
//! charger is off, the robot lives on its battery until the recharge threshold. *Path selection*:
//! the robot's rail hangs on the bay, the charger serves the battery alone.

use crate::Channel;
use crate::load::Terminals;
use crate::system::BatteryFacts;

/// Limits of a charger. Currents are positive into the battery.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Charger {
    /// Most current from its output, A (> 0).
    pub output_a_max: f64,
    /// Output voltage of the constant-voltage part, V of the pack (> 0).
    pub output_v_max: f64,
    /// Current while the cells are very low, A (> 0).
    pub precharge_a: f64,
    /// Cells below this are pre-charged, V per cell.
    pub precharge_below_v_per_cell: f64,
    /// The charge is done when the output current stays below this in the constant-voltage part, A.
    pub cutoff_a: f64,
    /// For how long it must stay there, s (>= 0).
    pub cutoff_hold_s: f64,
    /// A charge that was done begins anew when the cells fall below this, V per cell.
    pub recharge_below_v_per_cell: f64,
    /// How robot, battery and charger are joined.
    pub path: PowerPath,
}

/// How a robot, its battery and its charger are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PowerPath {
    /// All on one node.
    Direct,
    /// The robot's rail on the bay, the battery alone on the charger.
    Selected,
}

/// What a pack asks its charger for, as a smart battery does over the bus (Smart Battery Data
/// Specification 1.1, `ChargingCurrent` and `ChargingVoltage`): the charger gives the lesser of
/// this and its own limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChargeRequest {
    /// Most current, A; 0 for no charge.
    pub current_a: f64,
    /// Most voltage, V of the pack.
    pub voltage_v: f64,
}

/// What the gauge of a pack asks for: its rated current while its temperature allows a charge, else 0.
#[must_use]
pub fn request(facts: &BatteryFacts, allowed: bool) -> ChargeRequest {
    ChargeRequest { current_a: if allowed { facts.charge.current_a } else { 0.0 }, voltage_v: facts.full_v() }
}

/// What the charger is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The pack asks for nothing.
    Waiting,
    /// Small current into very low cells.
    Precharge,
    /// Constant current.
    Current,
    /// Constant voltage.
    Voltage,
    /// The taper has ended.
    Done,
}

/// A charger at work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Charging {
    /// What it is doing.
    pub stage: Stage,
    /// How long its output has been below the cutoff, s.
    below_cutoff_s: f64,
}

/// What flowed in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flow {
    /// Current into the battery, A; negative when the robot drains it.
    pub battery_a: f64,
    /// Current from the charger's output, A.
    pub output_a: f64,
    /// Power from the charger's output, W.
    pub output_w: f64,
    /// Power that the robot takes from the bay past the charger, W.
    pub bypass_w: f64,
}

/// What stands around a charger during a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surroundings {
    /// What the pack asks for.
    pub request: ChargeRequest,
    /// Cells in series.
    pub series: u32,
    /// Power that the robot takes beside its battery, W (>= 0).
    pub own_load_w: f64,
    /// Most power that the output may give because a converter is shared, W; infinite for none.
    pub output_w_max: f64,
}

impl Charger {
    /// A charger made for a pack, with the thresholds of common three-cell charger circuits
    /// (bq24610: a tenth of the current below 3.1 V, begins anew 0.1 V below full).
    #[must_use]
    pub fn for_pack(facts: &BatteryFacts, path: PowerPath) -> Self {
        Self {
            output_a_max: facts.charge.current_a,
            output_v_max: facts.full_v(),
            precharge_a: 0.1 * facts.charge.current_a,
            precharge_below_v_per_cell: facts.eod_v_per_cell,
            cutoff_a: facts.charge.cutoff_a,
            cutoff_hold_s: 30.0,
            recharge_below_v_per_cell: facts.full_v_per_cell - 0.1,
            path,
        }
    }

    /// A charge that begins.
    #[must_use]
    pub fn begin(&self) -> Charging {
        Charging { stage: Stage::Current, below_cutoff_s: 0.0 }
    }

    /// Steps a battery on this charger by `dt_s` seconds and moves the charger's state on.
    ///
    /// The battery's voltage is found with its current, as in [`Terminals::step_charge`]; the
    /// own load is turned into a current at the voltage before the step.
    pub fn step(&self, charging: &mut Charging, pack: &mut impl Terminals, around: &Surroundings, dt_s: f64) -> Flow {
        let before_v = pack.channel(Channel::TerminalVoltageV).max(0.1);
        let asked_a = self.asks_a(charging, &around.request, before_v / f64::from(around.series.max(1)));
        let direct = self.path == PowerPath::Direct;
        let own_a = if direct { around.own_load_w / before_v } else { 0.0 };
        let output_a_max = self.output_a_max.min(around.output_w_max / before_v).max(0.0);
        let room_a = output_a_max - own_a;
        let voltage_v_max = self.output_v_max.min(around.request.voltage_v);
        let off = matches!(charging.stage, Stage::Waiting | Stage::Done);
        let limit_a = if off { 0.0 } else { asked_a.min(room_a) };
        let battery_a = if limit_a > 0.0 {
            -pack.step_charge(limit_a, voltage_v_max, dt_s)
        } else {
            // The charger is off, or the robot takes more than it gives: the battery stands in.
            let given_a = if off { own_a } else { -room_a.min(0.0) };
            pack.step_current(given_a, dt_s);
            -given_a
        };
        let voltage_v = pack.channel(Channel::TerminalVoltageV);
        let output_a = battery_a + own_a;
        self.saw(charging, limit_a > 0.0 && battery_a < 0.999 * limit_a, output_a, dt_s);
        let bypass_w = if direct { 0.0 } else { around.own_load_w };
        Flow { battery_a, output_a, output_w: output_a * voltage_v, bypass_w }
    }

    /// The current into the battery that the charger is after at this cell voltage, A: the state
    /// moves on by what a charger sees before it acts.
    pub fn asks_a(&self, charging: &mut Charging, request: &ChargeRequest, cell_v: f64) -> f64 {
        charging.stage = match charging.stage {
            _ if request.current_a <= 0.0 => Stage::Waiting,
            Stage::Done if cell_v >= self.recharge_below_v_per_cell => Stage::Done,
            Stage::Voltage => Stage::Voltage,
            _ if cell_v < self.precharge_below_v_per_cell => Stage::Precharge,
            _ => Stage::Current,
        };
        if charging.stage != Stage::Voltage {
            charging.below_cutoff_s = 0.0;
        }
        match charging.stage {
            Stage::Waiting | Stage::Done => 0.0,
            Stage::Precharge => self.precharge_a.min(request.current_a),
            Stage::Current | Stage::Voltage => request.current_a.min(self.output_a_max),
        }
    }

    /// The state moves on by what came of a step of `dt_s`: whether the voltage limited the current,
    /// and the current from the output, A.
    pub fn saw(&self, charging: &mut Charging, limited_by_voltage: bool, output_a: f64, dt_s: f64) {
        if matches!(charging.stage, Stage::Current | Stage::Voltage) {
            charging.stage = if limited_by_voltage { Stage::Voltage } else { Stage::Current };
        }
        if charging.stage == Stage::Voltage && output_a < self.cutoff_a {
            charging.below_cutoff_s += dt_s;
            if charging.below_cutoff_s >= self.cutoff_hold_s {
                charging.stage = Stage::Done;
            }
        } else {
            charging.below_cutoff_s = 0.0;
        }
    }
}

/// Shares a limit among those who ask: who asks for less than an equal share gets it all, and what
/// that leaves is shared equally by the others, until nothing is left (max-min fairness; Bertsekas
/// and Gallager, Data Networks, section 6.5.2). All in the same unit, >= 0; `shares` gets as many
/// values as there are in `asked`. The sum of the shares is the lesser of limit and sum asked.
///
/// # Panics
/// When the slices differ in length.
pub fn share_fairly(limit: f64, asked: &[f64], shares: &mut [f64]) {
    assert_eq!(asked.len(), shares.len(), "one share for each who asks");
    let level = fair_level(limit, asked);
    shares.iter_mut().zip(asked).for_each(|(share, asked)| *share = asked.min(level));
}

/// The level of [`share_fairly`]: nobody gets more, who asks for less gets all of it. Infinite
/// when the limit holds everybody.
#[must_use]
pub fn fair_level(limit: f64, asked: &[f64]) -> f64 {
    if asked.iter().sum::<f64>() <= limit {
        return f64::INFINITY;
    }
    let (mut level, mut settled) = (0.0, usize::MAX);
    // Each round settles at least one more of those who ask for less than the level.
    for _ in 0..=asked.len() {
        let below = asked.iter().filter(|asked| **asked < level);
        let (count, sum) = below.fold((0, 0.0), |(count, sum), asked| (count + 1, sum + asked));
        if count == settled || count == asked.len() {
            break;
        }
        settled = count;
        level = (limit.max(0.0) - sum) / (asked.len() - count) as f64;
    }
    level
}

#[cfg(test)]
mod tests;
