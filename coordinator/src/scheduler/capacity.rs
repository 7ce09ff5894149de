//! How many robots the remaining energy can still service, which, in which order and how certainly: the
//! thesis' question, for each pack alone and for each station.
//!
//! Robots are taken in the order of the plan, then those without a place in it that could come, when they want a service, each with
//! what it then needs; after them come services from where one is wanted. The packs hold enough for the first k of them with probability
//!
//! `Phi((usable - need_k) / sqrt(sigma_usable² + sigma_need_k²))`
//!
//! where `need_k` has the doubt that services share (a converter's efficiency) and what each has of its
//! own (a gauge's error) added up as [`Need`] does. Where that is a close thing the difference is not counted at full
//! power in every bay but found by stepping the packs' models along these services ([`Load::spare_wh`]).

use std::collections::BTreeMap;

use energy::units::S_PER_H;
use energy::{Estimate, Need};
use proto::{Capacity, PackCapacity, PackId, Promise, RobotId, StationCapacity, StationId, Timestamp};
use statrs::distribution::{ContinuousCDF, Normal};

use super::carry::{Load, Part, SIGMAS_MAX};
use super::charging::Course;
use super::problem::{PackState, StationView};
use super::recharging::Recharging;

/// More services than this are not counted.
const SERVICES_MAX: usize = 10_000;
/// Services with less probability than this are not told one by one.
const TOLD_MIN: f64 = 0.005;
/// Neither are services without a robot of their own that come after so many.
const TOLD_MAX: usize = 12;

/// Packs are stepped along no more services than this: of many, what full bays and gentle endings leave over is little beside
/// the doubt that they share.
const STEPPED_MAX: usize = 32;
/// Margins of this many standard deviations are told as certain: 99.95 %.
const CERTAIN_SIGMAS: f64 = 3.3;

/// What a station is asked. Times are s from now.
#[derive(Debug, Clone)]
pub struct Question {
    /// Which.
    pub station: StationId,
    /// When the services that have begun are over: what is drawn until then for them and by the station itself is theirs.
    pub begun_until_s: f64,
    /// Its packs, each by itself.
    pub packs: Vec<Holding>,
    /// All of them together.
    pub together: Supply,
    /// Robots in the order in which they come.
    pub robots: Vec<Coming>,
    /// A service from where one is wanted to where it is done.
    pub service: Wanted,
    /// The same by cause, Wh.
    pub breakdown_wh: BTreeMap<String, f64>,
    /// What charging packs that robots left takes after that.
    pub recharging: Vec<Recharging>,
    /// When each bay is free.
    pub bays_s: Vec<f64>,
    /// The kind of each of its spares, and when it is charged and there to be handed out.
    pub spares: Vec<(u16, f64)>,
    /// What the packs are short of for the robot that the plan comes closest to serving, Wh; none where it leaves out nobody for that.
    pub planned_short_wh: Option<f64>,
    /// What the station takes in an hour beside services.
    pub overhead_per_h: Need,
    /// The same by cause, Wh.
    pub overhead_breakdown: BTreeMap<String, f64>,
}

/// A service.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Energy from the station's packs.
    pub need: Need,
    /// Time that it takes with handling, s.
    pub time_s: f64,
    /// What it draws when.
    pub course: Course,
    /// What it takes beside energy.
    pub place: Place,
    /// The charge of the pack that it leaves, s from its beginning; then that is a spare.
    pub left: Option<Recharging>,
}

/// What a service takes that others cannot have meanwhile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A bay, until it is over.
    Bay,
    /// A bay in vain: its battery is not charged, however long it stays.
    InVain,
    /// A spare of this kind, or of any; what it leaves becomes one of the same ([`Wanted::left`]).
    Spare(Option<u16>),
}

impl Wanted {
    /// What the packs give for all of it.
    fn whole(&self) -> Need {
        self.left.iter().fold(self.need.clone(), |sum, left| sum.plus(&left.need))
    }
}

/// A robot that comes.
#[derive(Debug, Clone)]
pub struct Coming {
    /// Which.
    pub robot: RobotId,
    /// What for.
    pub wanted: Wanted,
    /// From when it is there and wants it, s from now; 0 or less is at once.
    pub from_s: f64,
    /// Whether it begins then, as planned, or when a bay is free.
    pub is_planned: bool,
}

/// What a pack holds.
#[derive(Debug, Clone)]
pub struct Holding {
    /// Which.
    pub pack: PackId,
    /// What its gauge says, Wh.
    pub remaining_wh: Estimate,
    /// What services that have not begun can draw from it, were it the only one.
    pub alone: Supply,
    /// Whether it is there now.
    pub is_there: bool,
}

/// What services can draw on.
#[derive(Debug, Clone)]
pub struct Supply {
    /// What it gives, Wh.
    pub usable_wh: Estimate,
    /// What of that is for services that have begun, and for the station itself until these are over.
    pub begun: Need,
    /// What is drawn anyway and when (from, to, W).
    pub parts: Vec<Part>,
    /// From when it pays what the station takes by itself, s from now.
    pub overhead_from_s: f64,
    /// Its packs in the order in which they are drained, from when each is there (s from now) and how it stands then; none where
    /// that is not known, or would take too long.
    pub packs: Option<Vec<(f64, PackState)>>,
    /// What comes into them from outside, and when (s from now, Wh).
    pub comes: Vec<(f64, f64)>,
}

impl Supply {
    /// All packs of a station, from now on.
    #[must_use]
    pub fn of(station: &StationView) -> Self {
        let held = station.packs.iter().fold(Need::default(), |sum, pack| sum.plus(&Need::own(pack.usable_wh)));
        Self {
            usable_wh: held.estimate(),
            begun: station.begun(),
            parts: station.begun_parts(),
            overhead_from_s: 0.0,
            packs: station.packs.iter().map(|pack| Some((pack.available_s, pack.state.clone()?))).collect(),
            comes: station.packs.iter().flat_map(|pack| pack.refill().levels()).map(|level| (level.at_s, level.more_wh)).collect(),
        }
    }
}

/// What one amount of energy is enough for.
struct Count {
    /// As told, or what it comes to along these services.
    usable_wh: Estimate,
    promises: Vec<Promise>,
    /// Probability of the first k services, while it is not negligible.
    probabilities: Vec<f64>,
    short_wh: f64,
    /// By how much less that is for the robot that is planned next than for the one that wants a service next.
    planned_less_wh: f64,
    /// What the first that is not promised lacks, if that is not energy.
    lacks: Option<Lack>,
}

/// What a service may lack however much energy there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lack {
    Bay,
    Spare,
    /// Its battery is too hot or too cold to be charged, and stays so.
    RightTemperature,
}

/// Places and spares, and from when each is free, s.
struct Free {
    bays_s: Vec<f64>,
    /// By kind.
    spares: Vec<(u16, f64)>,
}

/// Answers for every pack and station, at this confidence.
#[must_use]
pub fn capacity(at: Timestamp, questions: &[Question], confidence: f64) -> Capacity {
    let (mut packs, mut stations) = (Vec::new(), Vec::new());
    for question in questions {
        let mut together = question.count(&question.together, confidence);
        // Who is planned next is not who wants a service next: one that comes earlier, or leaves with less, may take less.
        if let Some(short_wh) = question.planned_short_wh.filter(|_| together.lacks.is_none()) {
            together.planned_less_wh = (together.short_wh - short_wh).max(0.0);
            together.short_wh -= together.planned_less_wh;
        }
        packs.extend(question.packs.iter().map(|pack| of_pack(question, pack, &together, confidence)));
        stations.push(of_station(question, together, confidence));
    }
    Capacity {
        at,
        robots_expected: stations.iter().map(|station: &StationCapacity| station.robots_expected).sum(),
        robots_promised: stations.iter().map(|station| station.robots_promised).sum(),
        packs,
        stations,
        confidence,
    }
}

fn of_pack(question: &Question, holding: &Holding, together: &Count, confidence: f64) -> PackCapacity {
    let mut count = question.count(&holding.alone, confidence);
    // A part has no more for services than the whole: alone it is asked as if what has begun were drawn before, not beside them.
    if holding.is_there {
        count.no_more_than(together, confidence);
    }
    let per_service_h = question.service.time_s / S_PER_H / question.bays_s.len().max(1) as f64;
    let mut breakdown_wh = question.breakdown_wh.clone();
    for (cause, w) in &question.overhead_breakdown {
        *breakdown_wh.entry(cause.clone()).or_insert(0.0) += w * per_service_h;
    }
    let service_wh = question.service.whole().plus(&question.overhead_per_h.scaled(per_service_h)).estimate();
    PackCapacity {
        station: question.station.clone(),
        pack: holding.pack.clone(),
        remaining_wh: node::wire(holding.remaining_wh),
        usable_wh: node::wire(count.usable_wh),
        service_wh: node::wire(service_wh),
        breakdown_wh,
        robots_expected: count.at_least(0.5),
        robots_promised: count.at_least(confidence),
        confidence,
        short_for_next_wh: count.short_wh,
        lacks_power: false,
        lacks_bay: count.lacks == Some(Lack::Bay),
        lacks_spare: count.lacks == Some(Lack::Spare),
        lacks_right_temperature: count.lacks == Some(Lack::RightTemperature),
        promises: count.promises,
    }
}

/// All packs of the station together: a service may begin on one and end on the next.
fn of_station(question: &Question, count: Count, confidence: f64) -> StationCapacity {
    StationCapacity {
        station: question.station.clone(),
        usable_wh: node::wire(count.usable_wh),
        robots_expected: count.at_least(0.5),
        robots_promised: count.at_least(confidence),
        short_for_next_wh: count.short_wh,
        lacks_power: false,
        lacks_bay: count.lacks == Some(Lack::Bay),
        lacks_spare: count.lacks == Some(Lack::Spare),
        lacks_right_temperature: count.lacks == Some(Lack::RightTemperature),
        promises: count.promises,
    }
}

impl Question {
    /// How many services that have not begun these packs are enough for.
    fn count(&self, supply: &Supply, confidence: f64) -> Count {
        let begun = supply.begun.estimate();
        let usable_wh = Estimate::new((supply.usable_wh.value - begun.value).max(0.0), supply.usable_wh.sigma.hypot(begun.sigma));
        let mut count =
            Count { usable_wh, promises: Vec::new(), probabilities: Vec::new(), short_wh: 0.0, planned_less_wh: 0.0, lacks: None };
        let (mut services, mut recharging, mut parts) = (Need::default(), self.recharging.clone(), supply.parts.clone());
        let mut free = Free { bays_s: self.bays_s.iter().copied().take(SERVICES_MAX).collect(), spares: self.spares.clone() };
        let (mut ends_s, mut before, mut is_enough) = (self.begun_until_s.max(0.0), 1.0_f64, true);
        for number in 1..=SERVICES_MAX {
            let robot = self.robots.get(number - 1);
            let wanted = robot.map_or(&self.service, |coming| &coming.wanted);
            services.add(&wanted.need, 1.0);
            let soonest_s = robot.map_or(0.0, |coming| coming.from_s.max(0.0));
            let (start_s, lack) = free.take(wanted, soonest_s, robot.is_some_and(|coming| coming.is_planned));
            // What the station takes by itself meanwhile, also while it waits for whoever wants nothing yet.
            ends_s = ends_s.max(start_s + wanted.time_s);
            parts.extend(wanted.course.parts(start_s, start_s + wanted.time_s));
            let left = wanted.left.as_ref().map(|left| left.later(start_s));
            parts.extend(left.as_ref().map(Recharging::part));
            recharging.extend(left);
            let overhead = self.overhead_per_h.scaled((ends_s - self.begun_until_s.max(0.0)) / S_PER_H);
            let need = recharging.iter().fold(services.plus(&overhead), |sum, pack| sum.plus(&pack.by(ends_s)));
            let (need, all) = (need.estimate(), need.plus(&supply.begun).estimate());
            let sigma_wh = supply.usable_wh.sigma.hypot(all.sigma).max(1e-9);
            let comes_wh: f64 = supply.comes.iter().filter(|(at_s, _)| *at_s < ends_s).map(|(_, wh)| wh).sum();
            let counted_wh = supply.usable_wh.value + comes_wh - all.value;
            // Counted energy errs on the safe side: what it says is certain is certain.
            let is_close = number <= STEPPED_MAX && (-SIGMAS_MAX..CERTAIN_SIGMAS).contains(&(counted_wh / sigma_wh));
            let stepped_wh = is_close.then(|| self.stepped_wh(supply, &parts, ends_s, sigma_wh)).flatten();
            let spare_wh = stepped_wh.unwrap_or(counted_wh);
            // What is told is what decides: how much the packs give to the services that they are just or just not enough for.
            if (stepped_wh.is_some() || comes_wh > 0.0) && is_enough {
                count.usable_wh.value = (need.value + spare_wh).max(0.0);
            }
            let (probability, short_wh) = margin(Estimate::new(spare_wh, sigma_wh), confidence);
            // One more is never likelier.
            let probability = if lack.is_some() { 0.0 } else { probability.min(before) };
            before = probability;
            if probability < confidence && is_enough {
                (is_enough, count.short_wh, count.lacks) = (false, short_wh, lack);
            }
            count.probabilities.push(probability);
            if probability >= TOLD_MIN && (robot.is_some() || number <= TOLD_MAX) {
                let robot = robot.map(|coming| coming.robot.clone());
                count.promises.push(Promise { robot, part_to_soc: None, probability, need_wh: node::wire(need) });
            }
            if probability < TOLD_MIN {
                break;
            }
        }
        count
    }

    /// How much more than these services the packs could carry, Wh, where that is known.
    fn stepped_wh(&self, supply: &Supply, parts: &[Part], until_s: f64, sigma_wh: f64) -> Option<f64> {
        let packs: Vec<_> = supply.packs.as_ref()?.iter().map(|(from_s, state)| (*from_s, state)).collect();
        let load = Load { parts, overhead_w: self.overhead_per_h.mean_wh, overhead_from_s: supply.overhead_from_s, until_s };
        Some(load.spare_wh(&packs, sigma_wh))
    }
}

impl Count {
    /// How many services are at least as sure as that.
    fn at_least(&self, probability: f64) -> u32 {
        self.probabilities.iter().take_while(|&&sure| sure >= probability).count() as u32
    }

    /// Tells no more of the same services than another count does.
    fn no_more_than(&mut self, other: &Self, confidence: f64) {
        let promised_before = self.at_least(confidence);
        let most = |number: usize| other.probabilities.get(number).copied().unwrap_or(0.0);
        for (number, probability) in self.probabilities.iter_mut().enumerate() {
            *probability = probability.min(most(number));
        }
        for (number, promise) in self.promises.iter_mut().enumerate() {
            promise.probability = promise.probability.min(most(number));
        }
        self.promises.retain(|promise| promise.probability >= TOLD_MIN);
        self.usable_wh.value = self.usable_wh.value.min(other.usable_wh.value);
        match (self.at_least(confidence), other.at_least(confidence)) {
            (promised, most) if promised < most => {}
            _ if promised_before > self.at_least(confidence) => (self.short_wh, self.lacks) = (other.short_wh, other.lacks),
            _ => self.short_wh = (self.short_wh - other.planned_less_wh).max(other.short_wh),
        }
    }
}

impl Free {
    /// When a service begins that can at `soonest_s`, and what it lacks. One that is planned begins then, whatever else is said
    /// of its bay or spare; any other one when these are free.
    fn take(&mut self, wanted: &Wanted, soonest_s: f64, is_planned: bool) -> (f64, Option<Lack>) {
        let Free { bays_s, spares } = self;
        let first = match wanted.place {
            Place::InVain => None,
            Place::Bay => soonest((0..bays_s.len()).map(|bay| (bay, bays_s[bay])), soonest_s),
            Place::Spare(kind) => {
                let own = (0..spares.len()).filter(|&spare| kind.is_none_or(|kind| kind == spares[spare].0));
                soonest(own.map(|spare| (spare, spares[spare].1)), soonest_s)
            }
        };
        let start_s = first.filter(|_| !is_planned).map_or(soonest_s, |(_, free_s)| free_s.max(soonest_s));
        let lack = match (wanted.place, first) {
            (Place::Bay, Some((bay, free_s))) => {
                bays_s[bay] = free_s.max(start_s + wanted.time_s);
                None
            }
            (Place::Spare(kind), found) => {
                let taken = found.map(|(spare, _)| spares.swap_remove(spare).0);
                let kind = taken.or(kind).unwrap_or(0);
                spares.extend(wanted.left.as_ref().map(|left| (kind, start_s + left.until_s)));
                if found.is_none() { Some(Lack::Spare) } else { None }
            }
            (Place::Bay, None) => Some(Lack::Bay),
            (Place::InVain, _) => Some(Lack::RightTemperature),
        };
        (start_s, lack.filter(|_| !is_planned))
    }
}

/// Which is free first for whoever comes then; of several that are free already, the one that has been so for the shortest time: the
/// others are left to whoever comes sooner.
fn soonest(free: impl Iterator<Item = (usize, f64)>, comes_s: f64) -> Option<(usize, f64)> {
    let waits_s = |free_s: f64| (free_s - comes_s).max(0.0);
    free.min_by(|(_, a), (_, b)| waits_s(*a).total_cmp(&waits_s(*b)).then(b.total_cmp(a)))
}

/// Probability that what is spare (Wh, normal) is more than nothing, and what is short at `confidence`, Wh.
fn margin(spare: Estimate, confidence: f64) -> (f64, f64) {
    let (normal, sigma) = (Normal::standard(), spare.sigma.max(1e-9));
    (normal.cdf(spare.value / sigma), (normal.inverse_cdf(confidence) * sigma - spare.value).max(0.0))
}

#[cfg(test)]
mod tests;
