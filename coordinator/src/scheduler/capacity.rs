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
    /// Robots in the order in which they come.
    pub robots: Vec<Coming>,
    /// A service from where one is wanted to where it is done.
    pub service: Wanted,
    /// The same by cause, Wh.
    pub breakdown_wh: BTreeMap<String, f64>,
    /// Services at once.
    pub bays: u32,
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
    /// Whether it takes a bay.
    pub in_bay: bool,
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
    /// How much more it gives alone, Wh.
    pub gain_wh: f64,
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
    /// Whether the first that is not promised lacks a bay.
    lacks_bay: bool,
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
    let usable_wh = Estimate::new(holding.usable_wh.value + holding.gain_wh, holding.usable_wh.sigma);
    // Asked alone, a pack is there.
    let count = question.count(usable_wh, &[Holding { from_s: 0.0, ..holding.clone() }], confidence);
    let per_service_h = question.service.time_s / S_PER_H / f64::from(question.bays.max(1));
    let mut breakdown_wh = question.breakdown_wh.clone();
    for (cause, w) in &question.overhead_breakdown {
        *breakdown_wh.entry(cause.clone()).or_insert(0.0) += w * per_service_h;
    }
    let service_wh = question.service.need.plus(&question.overhead_per_h.scaled(per_service_h)).estimate();
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
        lacks_bay: count.lacks_bay,
        promises: count.promises,
    }
}

/// All packs of the station together: a service may begin on one and end on the next.
fn of_station(question: &Question, confidence: f64) -> StationCapacity {
    let together = question.packs.iter().fold(Need::default(), |sum, pack| sum.plus(&Need::own(pack.usable_wh))).estimate();
    let count = question.count(together, &question.packs, confidence);
    StationCapacity {
        station: question.station.clone(),
        usable_wh: node::wire(count.usable_wh),
        robots_expected: count.expected,
        robots_promised: count.promised,
        short_for_next_wh: count.short_wh,
        lacks_bay: count.lacks_bay,
        promises: count.promises,
    }
}

impl Question {
    /// How many services these packs, which count as `usable_wh`, are enough for.
    fn count(&self, usable_wh: Estimate, packs: &[Holding], confidence: f64) -> Count {
        let (mut promises, mut expected, mut promised) = (Vec::new(), 0, 0);
        let (mut services, mut parts, mut short_wh) = (Need::default(), Vec::new(), None);
        let mut lacks_bay = false;
        let mut bays_free_s = vec![0.0_f64; self.bays.clamp(1, SERVICES_MAX as u32) as usize];
        let (mut ends_s, mut before, mut told_wh) = (0.0_f64, 1.0_f64, usable_wh.value);
        for number in 1..=SERVICES_MAX {
            let robot = self.robots.get(number - 1);
            let wanted = robot.map_or(&self.service, |coming| &coming.wanted);
            services.add(&wanted.need, 1.0);
            let soonest_s = robot.map_or(0.0, |coming| coming.from_s.max(0.0));
            let bay = bays_free_s.iter_mut().min_by(|a, b| a.total_cmp(b)).filter(|_| wanted.in_bay);
            let start_s =
                bay.as_ref().filter(|_| robot.is_none_or(|coming| !coming.is_planned)).map_or(soonest_s, |free_s| free_s.max(soonest_s));
            if let Some(free_s) = bay {
                *free_s = free_s.max(start_s + wanted.time_s);
            }
            // What the station takes by itself meanwhile, also while it waits for whoever wants nothing yet.
            ends_s = ends_s.max(start_s + wanted.time_s);
            parts.extend(wanted.course.parts(start_s, start_s + wanted.time_s));
            let need = services.plus(&self.overhead_per_h.scaled(ends_s / S_PER_H)).estimate();
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
            if self.bays == 0 && wanted.in_bay {
                probability = 0.0;
            }
            // One more is never likelier.
            probability = probability.min(before);
            before = probability;
            expected += u32::from(probability >= 0.5);
            promised += u32::from(probability >= confidence);
            if probability < confidence && short_wh.is_none() {
                short_wh = Some(short);
                lacks_bay = self.bays == 0 && wanted.in_bay;
            }
            if probability >= TOLD_MIN && (robot.is_some() || number <= TOLD_MAX) {
                promises.push(Promise { robot: robot.map(|coming| coming.robot.clone()), probability, need_wh: node::wire(need) });
            }
            if probability < TOLD_MIN {
                break;
            }
        }
        let usable_wh = Estimate::new(told_wh, usable_wh.sigma);
        Count { usable_wh, promises, expected, promised, short_wh: short_wh.unwrap_or(0.0), lacks_bay }
    }

    /// How much more than these services the packs could carry, Wh, where that is known.
    fn stepped_wh(&self, packs: &[Holding], parts: &[Part], until_s: f64, sigma_wh: f64) -> Option<f64> {
        let holding = packs.iter().filter(|pack| pack.usable_wh.value > 0.0);
        let there: Option<Vec<_>> = holding.map(|pack| Some((pack.from_s, pack.state.as_ref()?))).collect();
        let load = Load { parts, overhead_w: self.overhead_per_h.mean_wh, until_s };
        there.map(|packs| load.spare_wh(&packs, sigma_wh))
    }
}

/// Probability that what is spare (Wh, normal) is more than nothing, and what is short at `confidence`, Wh.
fn margin(spare: Estimate, confidence: f64) -> (f64, f64) {
    let sigma = spare.sigma.max(1e-9);
    let normal = Normal::standard();
    (normal.cdf(spare.value / sigma), (normal.inverse_cdf(confidence) * sigma - spare.value).max(0.0))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use energy::load::Terminals as _;
    use energy::pack::Battery as _;

    use super::*;

    fn question(usable_wh: &[f64], bays: u32) -> Question {
        let pack = |(n, wh): (usize, &f64)| {
            let (pack, wh) = (PackId::new(format!("p-{n}")).unwrap(), Estimate::exact(*wh));
            Holding { pack, remaining_wh: wh, usable_wh: wh, gain_wh: 0.0, state: None, from_s: 0.0 }
        };
        Question {
            station: StationId::new("s").unwrap(),
            packs: usable_wh.iter().enumerate().map(pack).collect(),
            robots: Vec::new(),
            service: wanted(20.0),
            breakdown_wh: BTreeMap::new(),
            bays,
            overhead_per_h: Need { mean_wh: 6.0, ..Need::default() },
            overhead_breakdown: BTreeMap::from([("hotel".to_owned(), 6.0)]),
        }
    }

    fn wanted(wh: f64) -> Wanted {
        Wanted {
            need: Need { mean_wh: wh, ..Need::default() },
            time_s: 3600.0,
            course: Course { even_wh: wh, ..Course::default() },
            in_bay: true,
        }
    }

    fn coming(name: &str, wh: f64, from_s: f64) -> Coming {
        Coming { robot: RobotId::new(name).unwrap(), wanted: wanted(wh), from_s, is_planned: false }
    }

    fn first(question: &Question) -> PackCapacity {
        capacity(Timestamp::from_unix_ms(0), std::slice::from_ref(question), 0.95).packs.remove(0)
    }

    #[test]
    fn a_margin_of_one_sigma_holds_with_84_percent() {
        let (probability, short_wh) = margin(Estimate::new(50.0 - 45.0, 3.0_f64.hypot(4.0)), 0.95);
        assert!((probability - 0.8413).abs() < 1e-4);
        // 1.645 sigma are needed, one is there: 0.645 x 5 Wh short.
        assert!((short_wh - 0.6449 * 5.0).abs() < 1e-3);
    }

    #[test]
    fn three_at_once_share_the_hotel_and_one_by_one_does_not() {
        // 3 x 20 + 6 = 66; one by one 3 x 26 = 78.
        assert_eq!(first(&question(&[70.0], 3)).robots_promised, 3);
        assert_eq!(first(&question(&[70.0], 1)).robots_promised, 2);
        let answer = first(&question(&[70.0], 3));
        // A fourth needs a second round: 4 x 20 + 2 x 6 = 92.
        assert!((answer.short_for_next_wh - 22.0).abs() < 1e-6);
        let sum: f64 = answer.breakdown_wh.values().sum();
        assert!((sum - 2.0).abs() < 1e-12, "a third of the hotel for each");
    }

    #[test]
    fn what_two_packs_lack_alone_they_have_together() {
        // One by one: two services and two hours are 52 Wh; 40 + 40 Wh are three services together.
        let answer = capacity(Timestamp::from_unix_ms(0), &[question(&[40.0, 40.0], 1)], 0.95);
        assert_eq!(answer.packs.iter().map(|pack| pack.robots_promised).collect::<Vec<_>>(), [1, 1]);
        assert_eq!((answer.stations[0].robots_promised, answer.robots_promised), (3, 3));
    }

    #[test]
    fn robots_come_first_and_each_with_its_own_need() {
        let mut asked = question(&[60.0], 3);
        let robot = |name: &str, wh: f64| coming(name, wh, 0.0);
        asked.robots = vec![robot("a", 10.0), robot("b", 24.0)];
        // 10 + 24 + 20 + 6 = 60.
        let told: Vec<(Option<String>, f64)> =
            first(&asked).promises.iter().map(|promise| (promise.robot.as_ref().map(ToString::to_string), promise.need_wh.value)).collect();
        assert_eq!(told, [(Some("a".to_owned()), 16.0), (Some("b".to_owned()), 40.0), (None, 60.0)]);
    }

    #[test]
    fn a_station_that_waits_for_a_robot_pays_for_itself_meanwhile() {
        let mut asked = question(&[70.0], 3);
        let robot = |name: &str, from_s: f64| coming(name, 20.0, from_s);
        asked.robots = vec![robot("a", 0.0), robot("b", 1800.0), robot("c", 5.0 * 3600.0)];
        // Services of 20 Wh and an hour; the station takes 6 Wh in each of 1, 1.5 and 6 hours.
        let told: Vec<f64> = first(&asked).promises.iter().map(|promise| promise.need_wh.value).collect();
        assert_eq!((told, first(&asked).robots_promised), (vec![26.0, 49.0], 2));
    }

    #[test]
    fn an_empty_pack_and_a_station_without_bays_serve_nobody() {
        assert_eq!(first(&question(&[0.0], 3)).robots_expected, 0);
        let without_bays = first(&question(&[70.0], 0));
        assert_eq!((without_bays.robots_expected, without_bays.lacks_bay), (0, true));
        // An exchange takes none: it is the charge after it that lacks one.
        let mut asked = question(&[70.0], 0);
        asked.robots = vec![coming("a", 20.0, 0.0)];
        asked.robots[0].wanted.in_bay = false;
        let answer = first(&asked);
        assert_eq!((answer.robots_promised, answer.lacks_bay), (1, true));
    }

    /// Whether a pack carries services of 20 W for half an hour and 8 W for ten minutes, begun at these seconds, and 6 W beside
    /// them, by stepping it second by second.
    fn carries(pack: &Arc<energy::Model>, soc: f64, begun_s: &[i32]) -> bool {
        let mut pack = energy::Pack::new(pack.clone(), energy::Start { temperature_degc: 25.0, ..energy::Start::at_soc(soc) });
        let drawn_w = |since_s: i32| match since_s {
            0..1800 => 20.0,
            1800..2400 => 8.0,
            _ => 0.0,
        };
        (0..begun_s.last().unwrap() + 2400).all(|second| {
            let power_w = 6.0 + begun_s.iter().map(|begun_s| drawn_w(second - begun_s)).sum::<f64>();
            pack.step_power(power_w, 1.0).is_ok() && !pack.is_empty()
        })
    }

    #[test]
    fn a_pack_that_just_carries_two_services_is_enough_for_them_at_even_odds_whatever_was_counted() {
        let model = Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
        for (bays, begun_s) in [(2, [0, 0]), (1, [0, 2400])] {
            let (mut low, mut high) = (0.05, 0.9);
            for _ in 0..20 {
                let middle = f64::midpoint(low, high);
                if carries(&model, middle, &begun_s) { high = middle } else { low = middle }
            }
            let odds = |soc: f64, counted_wh: f64| {
                let mut asked = question(&[0.0], bays);
                let course = Course { charge: vec![(1800.0, 20.0), (600.0, 8.0)], ..Course::default() };
                asked.service =
                    Wanted { need: Need { mean_wh: 10.0 + 8.0 / 6.0, ..Need::default() }, time_s: 2400.0, course, in_bay: true };
                asked.packs[0].usable_wh = Estimate::new(counted_wh, 1.0);
                asked.packs[0].state = Some(PackState { model: model.clone(), soc: Estimate::exact(soc), temperature_degc: 25.0 });
                first(&asked).promises.get(1).map_or(0.0, |second| second.probability)
            };
            let needed_wh = 2.0 * (10.0 + 8.0 / 6.0) + 6.0 * f64::from(begun_s[1] + 2400) / S_PER_H;
            for counted_wh in [needed_wh - 5.0, needed_wh, needed_wh + 3.0] {
                let even = odds(high, counted_wh);
                assert!((even - 0.5).abs() < 0.06, "{bays} bays, {counted_wh} Wh counted: {even}");
            }
            // A hundredth of its charge more is 0.86 Wh, at a sigma of 1 Wh 80 %.
            let more = odds(high + 0.01, needed_wh);
            assert!((0.75..0.86).contains(&more), "{bays} bays: {more}");
        }
    }
}
