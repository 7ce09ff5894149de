//! What was worked out of models so far, each made when it is first asked for: charges, discharges, and how many charge side by side.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use energy::{Estimate, Model};

use super::charging::{Table, step_degc};
use super::crowd::Fed;
use super::refill::Refills;
use super::usable::Usable;
use super::worn::Worn;
use crate::forecast::{self, Draw};
use crate::models::{Alike, StationModels};

/// Station, battery, robots and packs alone side by side, temperature of a robot's battery and of the station.
type Kind = (Alike, usize, [usize; 2], [i32; 2]);
/// Station, kind of pack, packs side by side, temperature, hundredths of charge.
type Beside = (Alike, usize, usize, i32, i32);
/// Station and its bays, kind of pack, power (bits), temperature.
type Ending = (Alike, usize, usize, u64, i32);

/// All tables that were asked for so far. They follow from models that never change, so keeping them
/// saves time and changes nothing.
#[derive(Debug, Default)]
pub struct Tables {
    known: Mutex<BTreeMap<Kind, Arc<Table>>>,
    /// What gentle endings gain, Wh.
    gains: Mutex<BTreeMap<Ending, f64>>,
    /// How long packs are charged side by side, s.
    beside: Mutex<BTreeMap<Beside, Option<f64>>>,
    /// How many robots with a kind of battery are charged side by side.
    fed: Mutex<BTreeMap<(Alike, usize, usize), Fed>>,
    /// What packs give.
    pub usable: Usable,
    /// How packs are charged from outside.
    pub refills: Refills,
    /// Batteries as their gauges have found them.
    pub worn: Worn,
}

impl Tables {
    /// The table of a battery at a station, made when it is first asked for; `at_once` is how many robots, and how many packs that robots left, are
    /// charged side by side, `degc` is how warm it is when its robot comes, and how warm it is at the station, where a robot
    /// may have left it, and `levels` at which charge a service is wanted and done.
    #[must_use]
    pub fn of(&self, station: &StationModels, at_once: [usize; 2], battery: &Arc<Model>, degc: [f64; 2], levels: [f64; 2]) -> Arc<Table> {
        let degc = degc.map(|degc| step_degc(battery, degc));
        let kind = (station.alike(), Arc::as_ptr(battery).addr(), at_once, degc.map(|degc| degc as i32));
        let origin = self.worn.origin(battery);
        let origin = origin.map(|(origin, share)| (self.of(station, at_once, &origin, degc, levels), origin, share));
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let made = || match origin {
            Some((table, origin, share)) => table.scaled(share, [&origin, battery].map(|model| model.uncertainty.capacity_relative_sigma)),
            None => Table::new(station, at_once, battery, degc, levels),
        };
        Arc::clone(known.entry(kind).or_insert_with(|| Arc::new(made())))
    }

    /// How long it takes to charge a pack of this kind that a robot left beside others of it, s, where they share what the station's
    /// converters give; none where they do not.
    #[must_use]
    pub fn charged_beside(
        &self,
        station: &StationModels,
        battery: &Arc<Model>,
        at_once: usize,
        temperature_degc: f64,
        soc: f64,
    ) -> Option<f64> {
        if at_once < 2 || station.converter_w_max.is_infinite() {
            return None;
        }
        let (percent, degc) = ((soc * 100.0).round(), step_degc(battery, temperature_degc));
        let mut known = self.beside.lock().unwrap_or_else(PoisonError::into_inner);
        let made = || forecast::spare_again(station, battery, at_once, degc, percent / 100.0).map(|(_, charge_s)| charge_s);
        let key = (station.alike(), Arc::as_ptr(battery).addr(), at_once, degc as i32, percent as i32);
        *known.entry(key).or_insert_with(made)
    }

    /// How many of `most` robots with this battery a station's converters charge side by side.
    #[must_use]
    pub fn fed(&self, station: &StationModels, most: usize, battery: &Arc<Model>, [from_soc, to_soc]: [f64; 2]) -> Fed {
        let charge_s = |at_once: usize| {
            let circumstances = ([energy::units::REFERENCE_DEGC; 2], true);
            forecast::recharge(station, at_once, battery, circumstances, Estimate::exact(from_soc), to_soc).charge_s
        };
        let mut known = self.fed.lock().unwrap_or_else(PoisonError::into_inner);
        *known.entry((station.alike(), most, Arc::as_ptr(battery).addr())).or_insert_with(|| Fed::of(most, charge_s))
    }

    /// How much more a pack of this kind gives because the load of the station's bays ends gently, Wh.
    #[must_use]
    pub fn gain_wh(&self, station: &StationModels, bays: usize, pack: &Arc<Model>, temperature_degc: f64, draw: &Draw) -> f64 {
        let degc = step_degc(pack, temperature_degc);
        let kind = (station.alike(), bays, Arc::as_ptr(pack).addr(), draw.power_w.to_bits(), degc as i32);
        let mut gains = self.gains.lock().unwrap_or_else(PoisonError::into_inner);
        *gains.entry(kind).or_insert_with(|| energy::forecast::ending::gain_wh(pack, degc, draw))
    }
}
