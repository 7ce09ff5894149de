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
use super::problem::PackState;
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

/// What a station is asked.
#[derive(Debug, Clone)]
pub struct Question {
    /// Which.
    pub station: StationId,
    /// Its packs.
    pub packs: Vec<Holding>,
    /// What all of them give together when the services that have begun are paid for, Wh.
    pub usable_wh: Estimate,
    /// Robots in the order in which they come.
    pub robots: Vec<Coming>,
    /// A service from where one is wanted to where it is done.
    pub service: Wanted,
    /// The same by cause, Wh.
    pub breakdown_wh: BTreeMap<String, f64>,
    /// Packs that robots left, from when the services that have begun are over.
    pub recharging: Vec<Recharging>,
    /// Services at once.
    pub bays: u32,
    /// The kind of each of its spares, and when it is charged and there to be handed out, s from when the services that have begun
    /// are over.
    pub spares: Vec<(u16, f64)>,
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
    /// From when it is there and wants it, s from when the services that have begun are over; 0 or less is at once.
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
    /// What it gives to services as one of the station's packs, Wh.
    pub usable_wh: Estimate,
    /// How much more it gives alone, Wh, and how surely it is known what it gives at all.
    pub gain_wh: Estimate,
    /// How it stands when the services that have begun are over; none where that is not known, or would take too long.
    pub state: Option<PackState>,
    /// When it is there, s from when the services that have begun are over.
    pub from_s: f64,
}

/// What one amount of energy is enough for.
struct Count {
    /// As told, or what it comes to along these services.
    usable_wh: Estimate,
    promises: Vec<Promise>,
    expected: u32,
    promised: u32,
    short_wh: f64,
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
    let packs = questions.iter().flat_map(|question| question.packs.iter().map(move |pack| of_pack(question, pack, confidence))).collect();
    let stations: Vec<StationCapacity> = questions.iter().map(|question| of_station(question, confidence)).collect();
    Capacity {
        at,
        robots_expected: stations.iter().map(|station| station.robots_expected).sum(),
        robots_promised: stations.iter().map(|station| station.robots_promised).sum(),
        packs,
        stations,
        confidence,
    }
}

fn of_pack(question: &Question, holding: &Holding, confidence: f64) -> PackCapacity {
    let (usable, gain) = (holding.usable_wh, holding.gain_wh);
    let usable_wh = Estimate::new(usable.value + gain.value, usable.sigma.max(gain.sigma));
    // Asked alone, a pack is there.
    let count = question.count(usable_wh, &[Holding { from_s: 0.0, ..holding.clone() }], confidence);
    let per_service_h = question.service.time_s / S_PER_H / f64::from(question.bays.max(1));
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
        robots_expected: count.expected,
        robots_promised: count.promised,
        confidence,
        short_for_next_wh: count.short_wh,
        lacks_bay: count.lacks == Some(Lack::Bay),
        lacks_spare: count.lacks == Some(Lack::Spare),
        lacks_right_temperature: count.lacks == Some(Lack::RightTemperature),
        promises: count.promises,
    }
}

/// All packs of the station together: a service may begin on one and end on the next.
fn of_station(question: &Question, confidence: f64) -> StationCapacity {
    let count = question.count(question.usable_wh, &question.packs, confidence);
    StationCapacity {
        station: question.station.clone(),
        usable_wh: node::wire(count.usable_wh),
        robots_expected: count.expected,
        robots_promised: count.promised,
        short_for_next_wh: count.short_wh,
        lacks_bay: count.lacks == Some(Lack::Bay),
        lacks_spare: count.lacks == Some(Lack::Spare),
        lacks_right_temperature: count.lacks == Some(Lack::RightTemperature),
        promises: count.promises,
    }
}

impl Question {
    /// How many services these packs, which count as `usable_wh`, are enough for.
    fn count(&self, usable_wh: Estimate, packs: &[Holding], confidence: f64) -> Count {
        let (mut promises, mut expected, mut promised) = (Vec::new(), 0, 0);
        let (mut services, mut recharging, mut short_wh) = (Need::default(), self.recharging.clone(), None);
        let mut parts: Vec<Part> = recharging.iter().map(Recharging::part).collect();
        let mut lacks = None;
        let mut free = Free { bays_s: vec![0.0_f64; self.bays.min(SERVICES_MAX as u32) as usize], spares: self.spares.clone() };
        let (mut ends_s, mut before, mut told_wh) = (0.0_f64, 1.0_f64, usable_wh.value);
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
            let beside = recharging.iter().fold(self.overhead_per_h.scaled(ends_s / S_PER_H), |sum, pack| sum.plus(&pack.by(ends_s)));
            let need = services.plus(&beside).estimate();
            let sigma_wh = usable_wh.sigma.hypot(need.sigma).max(1e-9);
            let counted_wh = usable_wh.value - need.value;
            // Counted energy errs on the safe side: what it says is certain is certain.
            let is_close = number <= STEPPED_MAX && (-SIGMAS_MAX..CERTAIN_SIGMAS).contains(&(counted_wh / sigma_wh));
            let stepped_wh = is_close.then(|| self.stepped_wh(packs, &parts, ends_s, sigma_wh)).flatten();
            let spare_wh = stepped_wh.unwrap_or(counted_wh);
            // What is told is what decides: how much the packs give to the services that they are just or just not enough for.
            if stepped_wh.is_some() && short_wh.is_none() {
                told_wh = need.value + spare_wh;
            }
            let (mut probability, short) = margin(Estimate::new(spare_wh, sigma_wh), confidence);
            if lack.is_some() {
                probability = 0.0;
            }
            // One more is never likelier.
            probability = probability.min(before);
            before = probability;
            expected += u32::from(probability >= 0.5);
            promised += u32::from(probability >= confidence);
            if probability < confidence && short_wh.is_none() {
                short_wh = Some(short);
                lacks = lack;
            }
            if probability >= TOLD_MIN && (robot.is_some() || number <= TOLD_MAX) {
                promises.push(Promise { robot: robot.map(|coming| coming.robot.clone()), probability, need_wh: node::wire(need) });
            }
            if probability < TOLD_MIN {
                break;
            }
        }
        let usable_wh = Estimate::new(told_wh, usable_wh.sigma);
        Count { usable_wh, promises, expected, promised, short_wh: short_wh.unwrap_or(0.0), lacks }
    }

    /// How much more than these services the packs could carry, Wh, where that is known.
    fn stepped_wh(&self, packs: &[Holding], parts: &[Part], until_s: f64, sigma_wh: f64) -> Option<f64> {
        let holding = packs.iter().filter(|pack| pack.usable_wh.value > 0.0);
        let there: Option<Vec<_>> = holding.map(|pack| Some((pack.from_s, pack.state.as_ref()?))).collect();
        let load = Load { parts, overhead_w: self.overhead_per_h.mean_wh, until_s };
        there.map(|packs| load.spare_wh(&packs, sigma_wh))
    }
}

impl Free {
    /// When a service begins that can at `soonest_s`, and what it lacks. One that is planned begins then, whatever else is said
    /// of its bay or spare; any other one when these are free.
    fn take(&mut self, wanted: &Wanted, soonest_s: f64, is_planned: bool) -> (f64, Option<Lack>) {
        let Free { bays_s, spares } = self;
        let first = match wanted.place {
            Place::InVain => None,
            Place::Bay => (0..bays_s.len()).map(|bay| (bay, bays_s[bay])).min_by(|a, b| a.1.total_cmp(&b.1)),
            Place::Spare(kind) => {
                let own = (0..spares.len()).filter(|&spare| kind.is_none_or(|kind| kind == spares[spare].0));
                own.map(|spare| (spare, spares[spare].1)).min_by(|a, b| a.1.total_cmp(&b.1))
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

/// Probability that what is spare (Wh, normal) is more than nothing, and what is short at `confidence`, Wh.
fn margin(spare: Estimate, confidence: f64) -> (f64, f64) {
    let sigma = spare.sigma.max(1e-9);
    let normal = Normal::standard();
    (normal.cdf(spare.value / sigma), (normal.inverse_cdf(confidence) * sigma - spare.value).max(0.0))
}

#[cfg(test)]
mod tests;
