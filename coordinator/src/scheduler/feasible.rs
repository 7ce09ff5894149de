//! Whether a robot can be serviced in a certain way: a slot, or the reasons why not.

use std::fmt;

use energy::Estimate;
use energy::units::S_PER_H;
use proto::{BayId, PackId, SpareId};
use statrs::distribution::{ContinuousCDF, Normal};

use super::problem::{OptionView, Problem, RobotView, StationView, Way};
use energy::Need;

/// A promise that was given is kept as long as it is more likely than not that it can be.
const KEEP_CONFIDENCE: f64 = 0.5;

/// Where and when a robot is serviced. Times are seconds from the problem's now.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    /// Index of the station.
    pub station: usize,
    /// The bay, for a recharge.
    pub bay: Option<BayId>,
    /// The spare, for an exchange.
    pub spare: Option<SpareId>,
    /// Level at which a recharge is done.
    pub to_soc: Option<f64>,
    /// When the robot leaves its work, s.
    pub leave_s: f64,
    /// When the service begins, s.
    pub start_s: f64,
    /// When the robot is let go, s.
    pub end_s: f64,
    /// Energy from the station's packs.
    pub need: Need,
    /// Packs that pay, in order.
    pub packs: Vec<PackId>,
    /// Probability that the packs hold enough for all services up to this one.
    pub probability: f64,
}

/// Why a robot cannot be serviced in a certain way.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// The station takes no part.
    OutOfOrder(String),
    /// It would be empty before it is serviced.
    EmptyBefore {
        /// When the slot would begin to feed it, s.
        start_s: f64,
        /// When the robot may be empty, s.
        empty_s: f64,
    },
    /// The packs do not hold the energy.
    Energy {
        /// What is missing at the problem's confidence, Wh.
        short_wh: f64,
        /// The probability that it would do.
        probability: f64,
        /// The confidence asked for.
        confidence: f64,
    },
    /// No bay works.
    NoBay,
    /// No charged spare is left.
    NoSpare,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refusal::OutOfOrder(why) => write!(f, "the station takes no part: {why}"),
            Refusal::EmptyBefore { start_s, empty_s } => {
                write!(f, "it may be empty in {:.0} min, the first free slot feeds it in {:.0} min", empty_s / 60.0, start_s / 60.0)
            }
            Refusal::Energy { short_wh, probability, confidence } => write!(
                f,
                "the packs are {short_wh:.1} Wh short: enough with probability {:.0} %, asked for {:.0} %",
                probability * 100.0,
                confidence * 100.0
            ),
            Refusal::NoBay => write!(f, "no bay works"),
            Refusal::NoSpare => write!(f, "no charged spare is left"),
        }
    }
}

/// What is already promised at one station: bays, lift, spares and energy, each once.
#[derive(Debug, Clone)]
pub struct Book {
    bays: Vec<(BayId, Option<f64>)>,
    lift: Vec<(f64, f64)>,
    swap_free_s: f64,
    /// With their state of charge, the fullest first.
    spares: Vec<(SpareId, f64)>,
    need: Need,
    until_s: f64,
}

impl Book {
    /// A book that holds what has begun.
    #[must_use]
    pub fn new(station: &StationView) -> Self {
        let mut spares: Vec<_> = station.spares.iter().map(|spare| (spare.spare.clone(), spare.soc.value)).collect();
        spares.sort_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        Self {
            bays: station.bays.iter().map(|bay| (bay.bay.clone(), bay.free_s)).collect(),
            lift: station.lift_busy.clone(),
            swap_free_s: station.swap_free_s,
            spares,
            need: station.committed.clone(),
            until_s: station.committed_until_s,
        }
    }

    /// Finds the earliest slot for this way of servicing a robot.
    ///
    /// # Errors
    /// Says why there is none.
    pub fn slot(&self, problem: &Problem, robot: &RobotView, option: &OptionView) -> Result<Slot, Refusal> {
        let station = &problem.stations[option.station];
        if let Some(why) = &station.out_of_order {
            return Err(Refusal::OutOfOrder(why.clone()));
        }
        let ready_s = option.travel_s.max(robot.wanted_s);
        let mut slot = match &option.way {
            Way::Recharge { to_soc, recharge, charge_s_per_s, need_share_per_s } => {
                let (bay, free_s) = self.first_bay().ok_or(Refusal::NoBay)?;
                let load_s = station.handling.load_s;
                let start_s = self.lift_gap(ready_s.max(free_s), load_s);
                let waited_s = (start_s - ready_s).max(0.0);
                let charged_s = start_s + load_s + recharge.charge_s + waited_s * charge_s_per_s;
                let unload_s = station.handling.unload_s;
                let end_s = self.lift_gap(charged_s, unload_s) + unload_s;
                let need = recharge.need.scaled(1.0 + waited_s * need_share_per_s);
                (Some(bay), None, Some(*to_soc), start_s, end_s, need)
            }
            Way::Swap { need } => {
                let start_s = ready_s.max(self.swap_free_s);
                let (spare, soc) = self.spares.first().cloned().ok_or(Refusal::NoSpare)?;
                // A spare that is no fuller than the robot's own pack helps nobody.
                if soc <= robot.soc.value - robot.drain_soc_per_s * start_s {
                    return Err(Refusal::NoSpare);
                }
                (None, Some(spare), None, start_s, start_s + station.handling.swap_s, need.clone())
            }
        };
        let (start_s, end_s) = (slot.3, slot.4);
        // The robot lives on its own pack until it is in the bay, or has the other pack.
        let fed_s = start_s + if slot.0.is_some() { station.handling.load_s } else { station.handling.swap_s };
        if fed_s > robot.empty_s {
            return Err(Refusal::EmptyBefore { start_s: fed_s, empty_s: robot.empty_s });
        }
        let total = self.total(station, &slot.5, end_s);
        let confidence = if robot.promised { KEEP_CONFIDENCE } else { problem.confidence };
        let (probability, short_wh) = covered(station, &total, confidence);
        if probability < confidence {
            return Err(Refusal::Energy { short_wh, probability, confidence });
        }
        let packs = self.paying(station, &total, &slot.5);
        Ok(Slot {
            station: option.station,
            bay: slot.0.take(),
            spare: slot.1.take(),
            to_soc: slot.2,
            leave_s: (start_s - option.travel_s).max(0.0),
            start_s,
            end_s,
            need: slot.5,
            packs,
            probability,
        })
    }

    /// Writes a slot into the book.
    pub fn take(&mut self, station: &StationView, slot: &Slot) {
        if let Some(bay) = &slot.bay {
            if let Some(known) = self.bays.iter_mut().find(|(id, _)| id == bay) {
                known.1 = Some(slot.end_s);
            }
            self.lift.push((slot.start_s, slot.start_s + station.handling.load_s));
            self.lift.push((slot.end_s - station.handling.unload_s, slot.end_s));
            self.lift.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        if let Some(spare) = &slot.spare {
            self.spares.retain(|(id, _)| id != spare);
            self.swap_free_s = slot.end_s;
        }
        self.need = self.need.plus(&slot.need);
        self.until_s = self.until_s.max(slot.end_s);
    }

    fn first_bay(&self) -> Option<(BayId, f64)> {
        let free = self.bays.iter().filter_map(|(bay, free_s)| free_s.map(|free_s| (bay.clone(), free_s)));
        free.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// First time at or after `from_s` at which the lift is free for `span_s`.
    fn lift_gap(&self, from_s: f64, span_s: f64) -> f64 {
        let mut at_s = from_s;
        for &(busy_from_s, busy_to_s) in &self.lift {
            if at_s + span_s <= busy_from_s {
                break;
            }
            at_s = at_s.max(busy_to_s);
        }
        at_s
    }

    /// Everything that the packs give up to `end_s` if one more need is promised.
    fn total(&self, station: &StationView, need: &Need, end_s: f64) -> Need {
        let hours = self.until_s.max(end_s) / S_PER_H;
        self.need.plus(need).plus(&station.overhead_per_h.scaled(hours))
    }

    /// Packs over which this need falls when all are drained in order.
    fn paying(&self, station: &StationView, total: &Need, need: &Need) -> Vec<PackId> {
        let (from_wh, to_wh) = (total.mean_wh - need.mean_wh, total.mean_wh);
        let mut start_wh = 0.0;
        let mut paying = Vec::new();
        for pack in &station.packs {
            let end_wh = start_wh + pack.usable_wh.value;
            if from_wh < end_wh && to_wh > start_wh {
                paying.push(pack.pack.clone());
            }
            start_wh = end_wh;
        }
        paying
    }
}

/// Probability that the station's packs cover a need, and what is short at `confidence`, Wh.
#[must_use]
pub fn covered(station: &StationView, need: &Need, confidence: f64) -> (f64, f64) {
    let usable = station.packs.iter().fold(Need::default(), |sum, pack| sum.plus(&Need::own(pack.usable_wh))).estimate();
    margin(usable, need.estimate(), confidence)
}

/// Probability that `usable` exceeds `need` (both normal), and what is short at `confidence`, Wh.
#[must_use]
pub fn margin(usable: Estimate, need: Estimate, confidence: f64) -> (f64, f64) {
    let sigma = usable.sigma.hypot(need.sigma).max(1e-9);
    let normal = Normal::standard();
    let spare_wh = usable.value - need.value;
    let probability = normal.cdf(spare_wh / sigma);
    (probability, (normal.inverse_cdf(confidence) * sigma - spare_wh).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_margin_of_one_sigma_holds_with_84_percent() {
        let (probability, short_wh) = margin(Estimate::new(50.0, 3.0), Estimate::new(45.0, 4.0), 0.95);
        assert!((probability - 0.8413).abs() < 1e-4);
        // 1.645 sigma are needed, one is there: 0.645 x 5 Wh short.
        assert!((short_wh - 0.6449 * 5.0).abs() < 1e-3);
    }
}
