//! Whose service ends early where a station's packs turn out to hold less than was promised to all whose services have begun.
//!
//! A pack may have aged, or its gauge may know better by now. If all went on until the packs give out, nobody would get what was
//! promised. So one robot is let go: the one without which most of the others are expected to get theirs.

use energy::Need;
use energy::units::S_PER_H;
use statrs::distribution::{ContinuousCDF, Normal};

use super::carry::{Load, Part};
use super::problem::StationView;
use super::recharging::Recharging;

/// A service that has begun.
#[derive(Debug, Clone)]
pub struct Draw {
    /// When it ends, s from now.
    pub ends_s: f64,
    /// What it still takes.
    pub need: Need,
    /// Whether it can be ended now.
    pub may_end: bool,
}

/// Which of the services that have begun at a station is to be ended, so that as many as possible get what they were promised. None where
/// it is best to go on with all of them, or where it is not known how the packs stand.
///
/// Whoever is let go does not get what was promised: that is one broken promise for certain. All counted, there have to be fewer of them by
/// more than `1 - asked`. So a service that would fail anyway goes on with what it can get, as long as the others are as sure of theirs,
/// together, as is asked of one.
#[must_use]
pub fn shed(station: &StationView, draws: &[Draw], asked: f64) -> Option<usize> {
    let all: Vec<&Draw> = draws.iter().collect();
    let with_all = broken(station, &all, f64::INFINITY)?;
    // Counted in promises that are expected to be broken: that of who is let go is one of them.
    let mut best = None;
    let mut fewest = with_all - 1.0 - (1.0 - asked);
    if fewest <= 0.0 {
        return None;
    }
    for (index, _) in draws.iter().enumerate().filter(|(_, draw)| draw.may_end) {
        let others: Vec<&Draw> = draws.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, draw)| draw).collect();
        if let Some(without) = broken(station, &others, fewest).filter(|without| *without < fewest) {
            (best, fewest) = (Some(index), without);
        }
    }
    best
}

/// How many of these services are expected to find the packs empty before they end. None where that is not known, or more than `most`:
/// then it does not matter how many.
fn broken(station: &StationView, draws: &[&Draw], most: f64) -> Option<f64> {
    let packs: Option<Vec<_>> = station.packs.iter().map(|pack| Some((pack.available_s, pack.state.as_ref()?))).collect();
    let packs = packs?;
    let services = draws.iter().map(|draw| (0.0, draw.ends_s, draw.need.mean_wh / draw.ends_s.max(1.0) * S_PER_H));
    let parts: Vec<Part> = services.chain(station.recharging.iter().map(Recharging::part)).collect();
    let held_sigma = station.packs.iter().map(|pack| pack.usable_wh.sigma).fold(0.0, f64::hypot);
    let fails = |until_s: f64| {
        let mut need = station.overhead_per_h.scaled(until_s / S_PER_H);
        draws.iter().for_each(|draw| need.add(&draw.need, (until_s / draw.ends_s.max(1.0)).min(1.0)));
        station.recharging.iter().for_each(|charged| need.add(&charged.by(until_s), 1.0));
        let sigma = held_sigma.hypot(need.estimate().sigma).max(1e-9);
        let load = Load { parts: &parts, overhead_w: station.overhead_per_h.mean_wh, overhead_from_s: 0.0, until_s };
        Normal::standard().cdf(-load.spare_wh(&packs, sigma) / sigma)
    };
    // A service that ends later is never surer than one that ends before it. So the last one comes first: where it is sure, all are.
    let mut ends: Vec<f64> = draws.iter().map(|draw| draw.ends_s.max(1.0)).collect();
    ends.sort_by(f64::total_cmp);
    let (mut sum, mut left) = (0.0, ends.len() as f64);
    for until_s in ends.into_iter().rev() {
        let fails = fails(until_s);
        (sum, left) = (sum + fails, left - 1.0);
        if fails * left < 1e-3 {
            break;
        }
        if sum > most {
            return None;
        }
    }
    Some(sum)
}
