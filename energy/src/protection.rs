//! Protection of a pack as a gauge's analogue front end does it: two switches that open when a
//! cell leaves its limits.
//!
//! Kottas, chapter 6: the front end watches voltages, current and temperature and drives one
//! transistor for charge and one for discharge. Each limit has a threshold, a delay for which it
//! must be passed without a break before the switch opens, and a release: a value on the safe
//! side of the threshold (hysteresis) that must hold for a time of its own before it closes.
//!
//! | limit | watches | opens |
//! | --- | --- | --- |
//! | over-voltage | highest cell | charge |
//! | under-voltage | lowest cell | discharge |
//! | over-current on charge | current into the pack | charge |
//! | over-current on discharge | current out of the pack | discharge |
//! | short circuit | current out of the pack | both |
//! | too hot or too cold to charge | cell temperature | charge |
//! | too hot or too cold to discharge | cell temperature | discharge |
//!
//! Temperature limits hold whether or not a current flows: the answer is what may begin. A
//! measurement that is not a number counts as beyond every limit. Pure state machine: no clock.

use std::fmt;

use crate::BatteryFacts;

/// What the front end measured over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Voltage of the cell with the lowest, V.
    pub cell_min_v: f64,
    /// Voltage of the cell with the highest, V.
    pub cell_max_v: f64,
    /// Current out of the pack, A (charging is negative).
    pub current_a: f64,
    /// Temperature of the cells, °C.
    pub temperature_degc: f64,
}

/// Why a switch is open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Trip {
    /// A current as only a short draws it: opens both switches.
    ShortCircuit,
    /// Too much current out of the pack.
    OverCurrentDischarge,
    /// Too much current into the pack.
    OverCurrentCharge,
    /// A cell is above its highest voltage.
    OverVoltage,
    /// A cell is below its lowest voltage.
    UnderVoltage,
    /// The cells are too hot to be charged.
    OverTemperatureCharge,
    /// The cells are too hot to be discharged.
    OverTemperatureDischarge,
    /// The cells are too cold to be charged: lithium would plate.
    UnderTemperatureCharge,
    /// The cells are too cold to be discharged.
    UnderTemperatureDischarge,
}

impl Trip {
    /// Every reason, the most urgent first.
    pub const ALL: [Trip; 9] = [
        Trip::ShortCircuit,
        Trip::OverCurrentDischarge,
        Trip::OverCurrentCharge,
        Trip::OverVoltage,
        Trip::UnderVoltage,
        Trip::OverTemperatureCharge,
        Trip::OverTemperatureDischarge,
        Trip::UnderTemperatureCharge,
        Trip::UnderTemperatureDischarge,
    ];

    /// The limit's key in the `[protection]` table of a model, with its unit.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Trip::ShortCircuit => "short_circuit_a",
            Trip::OverCurrentDischarge => "over_current_discharge_a",
            Trip::OverCurrentCharge => "over_current_charge_a",
            Trip::OverVoltage => "over_voltage_v",
            Trip::UnderVoltage => "under_voltage_v",
            Trip::OverTemperatureCharge => "over_temperature_charge_degc",
            Trip::OverTemperatureDischarge => "over_temperature_discharge_degc",
            Trip::UnderTemperatureCharge => "under_temperature_charge_degc",
            Trip::UnderTemperatureDischarge => "under_temperature_discharge_degc",
        }
    }

    /// Whether the limit is passed downwards.
    #[must_use]
    pub const fn is_lower(self) -> bool {
        matches!(self, Trip::UnderVoltage | Trip::UnderTemperatureCharge | Trip::UnderTemperatureDischarge)
    }

    /// Whether it opens the switch for charge.
    #[must_use]
    pub const fn stops_charge(self) -> bool {
        matches!(
            self,
            Trip::ShortCircuit | Trip::OverCurrentCharge | Trip::OverVoltage | Trip::OverTemperatureCharge | Trip::UnderTemperatureCharge
        )
    }

    /// Whether it opens the switch for discharge.
    #[must_use]
    pub const fn stops_discharge(self) -> bool {
        matches!(
            self,
            Trip::ShortCircuit
                | Trip::OverCurrentDischarge
                | Trip::UnderVoltage
                | Trip::OverTemperatureDischarge
                | Trip::UnderTemperatureDischarge
        )
    }

    /// The number that the limit watches.
    fn watched(self, measured: &Measured) -> f64 {
        match self {
            Trip::ShortCircuit | Trip::OverCurrentDischarge => measured.current_a,
            Trip::OverCurrentCharge => -measured.current_a,
            Trip::OverVoltage => measured.cell_max_v,
            Trip::UnderVoltage => measured.cell_min_v,
            Trip::OverTemperatureCharge
            | Trip::OverTemperatureDischarge
            | Trip::UnderTemperatureCharge
            | Trip::UnderTemperatureDischarge => measured.temperature_degc,
        }
    }
}

impl fmt::Display for Trip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Trip::ShortCircuit => "short circuit",
            Trip::OverCurrentDischarge => "too much current out of the pack",
            Trip::OverCurrentCharge => "too much current into the pack",
            Trip::OverVoltage => "a cell is above its highest voltage",
            Trip::UnderVoltage => "a cell is below its lowest voltage",
            Trip::OverTemperatureCharge => "too hot to charge",
            Trip::OverTemperatureDischarge => "too hot to discharge",
            Trip::UnderTemperatureCharge => "too cold to charge",
            Trip::UnderTemperatureDischarge => "too cold to discharge",
        })
    }
}

/// One limit. Threshold and release are in the unit of what it watches: V, A or °C.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// Beyond this value the switch opens.
    pub trip: f64,
    /// Time for which the threshold must be passed without a break, s.
    pub delay_s: f64,
    /// Back at this value the switch may close: not beyond the threshold.
    pub release: f64,
    /// Time for which the release must hold without a break, s.
    pub release_s: f64,
}

/// The limits of a pack.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits(Box<[Limit; Trip::ALL.len()]>);

impl Limits {
    /// Limits of a pack for which nothing is stated, from its own voltages, charge current and
    /// capacity. Guesses after the presets of gauge chips (Texas Instruments bq28z610): 4.3 V and
    /// back at 4.1 V for cells of 4.2 V; 10 % below the end of discharge and back at it; delays of
    /// 2 s, 6 s for a discharge current; currents release after 5 s near zero. Charge at 0-45 °C,
    /// discharge at -20-60 °C, as cell makers state.
    #[must_use]
    pub fn of(full_v_per_cell: f64, eod_v_per_cell: f64, charge_current_a: f64, capacity_ah: f64) -> Self {
        let slow = |trip, release| Limit { trip, delay_s: 2.0, release, release_s: 0.0 };
        let rest = |trip, delay_s| Limit { trip, delay_s, release: 0.01 * trip, release_s: 5.0 };
        Self(Box::new(Trip::ALL.map(|trip| match trip {
            Trip::ShortCircuit => rest(10.0 * capacity_ah, 0.0),
            Trip::OverCurrentDischarge => rest(4.0 * capacity_ah, 6.0),
            Trip::OverCurrentCharge => rest(1.5 * charge_current_a, 2.0),
            Trip::OverVoltage => slow(1.024 * full_v_per_cell, 0.976 * full_v_per_cell),
            Trip::UnderVoltage => slow(0.9 * eod_v_per_cell, eod_v_per_cell),
            Trip::OverTemperatureCharge => slow(45.0, 40.0),
            Trip::OverTemperatureDischarge => slow(60.0, 55.0),
            Trip::UnderTemperatureCharge => slow(0.0, 5.0),
            Trip::UnderTemperatureDischarge => slow(-20.0, -15.0),
        })))
    }

    /// The limit of that reason.
    #[must_use]
    pub fn get(&self, trip: Trip) -> &Limit {
        &self.0[trip as usize]
    }

    /// Whether cells at this temperature are too hot or too cold to be charged, °C, where `was` is what they were before: a limit
    /// that was passed holds until its release. Delays are left out: they are seconds, and temperatures take minutes.
    #[must_use]
    pub fn no_charge_at(&self, cell_degc: f64, was: Option<Trip>) -> Option<Trip> {
        [Trip::OverTemperatureCharge, Trip::UnderTemperatureCharge].into_iter().find(|&trip| {
            let limit = self.get(trip);
            let sign = if trip.is_lower() { -1.0 } else { 1.0 };
            let bound = if was == Some(trip) { limit.release } else { limit.trip };
            sign * cell_degc > sign * bound
        })
    }

    /// The limit of that reason, to be changed.
    pub fn get_mut(&mut self, trip: Trip) -> &mut Limit {
        &mut self.0[trip as usize]
    }
}

/// Which switches may be closed, or why not: the most urgent reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Allowed {
    /// Whether current may flow into the pack.
    pub charge: Result<(), Trip>,
    /// Whether current may flow out of it.
    pub discharge: Result<(), Trip>,
}

/// A limit's memory.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Guard {
    open: bool,
    /// For how long the value has been such that the switch should change, s.
    since_s: f64,
}

/// The front end's memory: which limits are tripped, and for how long others have been passed.
#[derive(Debug, Clone, PartialEq)]
pub struct Protection {
    limits: Limits,
    guards: [Guard; Trip::ALL.len()],
}

impl Protection {
    /// Both switches closed.
    #[must_use]
    pub fn new(limits: &Limits) -> Self {
        Self { limits: limits.clone(), guards: [Guard::default(); Trip::ALL.len()] }
    }

    /// With the limits of this pack.
    #[must_use]
    pub fn of(facts: &BatteryFacts) -> Self {
        Self::new(&facts.protection)
    }

    /// Takes in what was measured over `dt_s` seconds (>= 0) and says what may flow from now on.
    /// Measurements hold over the step, so a step as long as a delay trips at its end.
    pub fn step(&mut self, dt_s: f64, measured: &Measured) -> Allowed {
        for (trip, guard) in Trip::ALL.into_iter().zip(&mut self.guards) {
            let limit = self.limits.get(trip);
            let sign = if trip.is_lower() { -1.0 } else { 1.0 };
            let watched = sign * trip.watched(measured);
            // What is not a number trips and does not release.
            let (due, wait_s) = if guard.open {
                (watched <= sign * limit.release, limit.release_s)
            } else {
                (watched > sign * limit.trip || watched.is_nan(), limit.delay_s)
            };
            guard.since_s = if due { guard.since_s + dt_s } else { 0.0 };
            if due && guard.since_s >= wait_s {
                *guard = Guard { open: !guard.open, since_s: 0.0 };
            }
        }
        self.allowed()
    }

    /// What may flow now.
    #[must_use]
    pub fn allowed(&self) -> Allowed {
        let first = |stops: fn(Trip) -> bool| self.tripped().find(|&trip| stops(trip)).map_or(Ok(()), Err);
        Allowed { charge: first(Trip::stops_charge), discharge: first(Trip::stops_discharge) }
    }

    /// Every limit that is tripped, the most urgent first.
    pub fn tripped(&self) -> impl Iterator<Item = Trip> + '_ {
        Trip::ALL.into_iter().zip(&self.guards).filter(|(_, guard)| guard.open).map(|(trip, _)| trip)
    }
}

#[cfg(test)]
mod tests;
