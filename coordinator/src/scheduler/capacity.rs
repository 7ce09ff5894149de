//! How many robots each pack's remaining energy can still service: the thesis' question.

use std::collections::BTreeMap;

use energy::Estimate;
use energy::units::S_PER_H;
use proto::{Capacity, PackCapacity, PackId, StationId, Timestamp};

use super::feasible::margin;
use crate::forecast::Recharge;
use energy::Need;

/// More services than this are not counted.
const ROBOTS_MAX: u32 = 10_000;

/// What one pack has and what one service of it takes.
#[derive(Debug, Clone)]
pub struct PackQuestion {
    /// Where.
    pub station: StationId,
    /// Which pack.
    pub pack: PackId,
    /// What its gauge says it holds, Wh.
    pub remaining_wh: Estimate,
    /// What it gives at the station's working power, Wh.
    pub usable_wh: Estimate,
    /// The service that is counted.
    pub service: Recharge,
    /// Time of one service with handling, s.
    pub service_s: f64,
    /// Services at once.
    pub bays: u32,
    /// What the station takes in an hour beside services.
    pub overhead_per_h: Need,
    /// The same by cause.
    pub overhead_breakdown: BTreeMap<String, f64>,
}

/// Answers for every pack, at this confidence.
#[must_use]
pub fn capacity(at: Timestamp, questions: &[PackQuestion], confidence: f64) -> Capacity {
    let packs: Vec<PackCapacity> = questions.iter().map(|question| answer(question, confidence)).collect();
    Capacity {
        at,
        robots_expected: packs.iter().map(|pack| pack.robots_expected).sum(),
        robots_promised: packs.iter().map(|pack| pack.robots_promised).sum(),
        packs,
        confidence,
    }
}

/// Energy for `robots` services, in rounds of as many as there are bays.
fn need(question: &PackQuestion, robots: u32) -> Need {
    let rounds = robots.div_ceil(question.bays.max(1));
    let hours = f64::from(rounds) * question.service_s / S_PER_H;
    question.service.need.times(robots).plus(&question.overhead_per_h.scaled(hours))
}

fn answer(question: &PackQuestion, confidence: f64) -> PackCapacity {
    let enough = |robots: u32, confidence: f64| {
        question.bays > 0 && margin(question.usable_wh, need(question, robots).estimate(), confidence).0 >= confidence
    };
    let count = |confidence: f64| (1..=ROBOTS_MAX).take_while(|&robots| enough(robots, confidence)).last().unwrap_or(0);
    let (expected, promised) = (count(0.5), count(confidence));
    let (_, short_wh) = margin(question.usable_wh, need(question, promised + 1).estimate(), confidence);
    let per_service_h = question.service_s / S_PER_H / f64::from(question.bays.max(1));
    let mut breakdown_wh = question.service.breakdown_wh.clone();
    for (cause, w) in &question.overhead_breakdown {
        *breakdown_wh.entry(cause.clone()).or_insert(0.0) += w * per_service_h;
    }
    let service_wh = question.service.need.plus(&question.overhead_per_h.scaled(per_service_h)).estimate();
    PackCapacity {
        station: question.station.clone(),
        pack: question.pack.clone(),
        remaining_wh: node::wire(question.remaining_wh),
        usable_wh: node::wire(question.usable_wh),
        service_wh: node::wire(service_wh),
        breakdown_wh,
        robots_expected: expected,
        robots_promised: promised,
        confidence,
        short_for_next_wh: short_wh,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(usable_wh: f64, bays: u32) -> PackQuestion {
        let service = Recharge { charge_s: 3600.0, need: Need { mean_wh: 20.0, ..Need::default() }, breakdown_wh: BTreeMap::new() };
        PackQuestion {
            station: StationId::new("s").unwrap(),
            pack: PackId::new("p").unwrap(),
            remaining_wh: Estimate::exact(usable_wh),
            usable_wh: Estimate::exact(usable_wh),
            service,
            service_s: 3600.0,
            bays,
            overhead_per_h: Need { mean_wh: 6.0, ..Need::default() },
            overhead_breakdown: BTreeMap::from([("hotel".to_owned(), 6.0)]),
        }
    }

    #[test]
    fn three_at_once_share_the_hotel_and_one_by_one_does_not() {
        // 3 x 20 + 6 = 66; one by one 3 x 26 = 78.
        assert_eq!(answer(&question(70.0, 3), 0.95).robots_promised, 3);
        assert_eq!(answer(&question(70.0, 1), 0.95).robots_promised, 2);
        let answer = answer(&question(70.0, 3), 0.95);
        // A fourth needs a second round: 4 x 20 + 2 x 6 = 92.
        assert!((answer.short_for_next_wh - 22.0).abs() < 1e-6);
        let sum: f64 = answer.breakdown_wh.values().sum();
        assert!((sum - 2.0).abs() < 1e-12, "a third of the hotel for each");
    }

    #[test]
    fn an_empty_pack_and_a_station_without_bays_serve_nobody() {
        assert_eq!(answer(&question(0.0, 3), 0.95).robots_expected, 0);
        assert_eq!(answer(&question(70.0, 0), 0.95).robots_expected, 0);
    }
}
