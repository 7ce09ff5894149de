//! Whether gauges mean what they say: in many simulated worlds, the truth lies within one
//! deviation in 68 % of readings and within 1.96 in 95 %, and the errors stay small.
//!
//! `TENDER_FULL=1 cargo test -p energy coverage -- --nocapture` runs 2000 worlds per set and holds
//! them to 68 +- 5 % and 95 +- 3 %; the default is a sample of them with the tolerance that its
//! size allows. `TENDER_SEED=N` begins at another world: gauges were developed on worlds from
//! 1,000,000 on, and the table is that of worlds from 0.

use std::sync::Arc;

use energy::Estimate;
use energy::gauge::{Kind, Reading};

use crate::worlds::{Told, Truth, World, model};

/// Sets of worlds: a pack and what the gauge is told of the start.
const SETS: &[(&str, Told)] = &[
    ("explorer-3s1p-1320mah", Told::Remembered),
    ("explorer-3s1p-1320mah", Told::Within(0.1)),
    ("explorer-3s1p-1320mah+rc", Told::Remembered),
    ("mds-3s4p-7600mah", Told::Remembered),
    ("mds-3s4p-7600mah", Told::Within(0.1)),
];

/// Steps between two readings: 25 minutes.
const READ_EVERY: usize = 300;
/// Readings in a world: 10 hours.
const READINGS: usize = 24;

/// How one quantity fared.
#[derive(Debug, Clone, Default)]
struct Score {
    square: f64,
    bias: f64,
    count: f64,
    within_1: f64,
    within_2: f64,
}

impl Score {
    fn add(&mut self, estimate: Estimate, truth: f64, scale: f64) {
        let error = estimate.value - truth;
        self.square += (error / scale).powi(2);
        self.bias += error / scale;
        self.count += 1.0;
        self.within_1 += f64::from(error.abs() <= estimate.sigma);
        self.within_2 += f64::from(error.abs() <= 1.96 * estimate.sigma);
    }
    fn merge(&mut self, other: &Score) {
        self.square += other.square;
        self.bias += other.bias;
        self.count += other.count;
        self.within_1 += other.within_1;
        self.within_2 += other.within_2;
    }
    fn rms_percent(&self) -> f64 {
        100.0 * (self.square / self.count.max(1.0)).sqrt()
    }
    fn percent(&self) -> (f64, f64) {
        (100.0 * self.within_1 / self.count.max(1.0), 100.0 * self.within_2 / self.count.max(1.0))
    }
}

/// Scores of a gauge: SoC, remaining energy (of the full energy), time to empty (likewise), full
/// energy, SoH; and all but the last two only after the first rest.
#[derive(Debug, Clone, Default)]
struct Scores {
    soc: Score,
    energy: Score,
    time: Score,
    full: Score,
    soh: Score,
    soc_rested: Score,
    energy_rested: Score,
}

impl Scores {
    fn add(&mut self, reading: &Reading, truth: &Truth) {
        self.soc.add(reading.soc, truth.soc, 1.0);
        self.energy.add(reading.remaining_wh, truth.remaining_wh, truth.full_wh);
        self.full.add(reading.full_wh, truth.full_wh, truth.full_wh);
        self.soh.add(reading.soh, truth.soh, 1.0);
        if let (Some(estimate), Some(true_s)) = (reading.time_to_empty_s, truth.time_to_empty_s) {
            self.time.add(estimate, true_s, true_s * truth.full_wh / truth.remaining_wh.max(1e-9));
        }
        if truth.rested {
            self.soc_rested.add(reading.soc, truth.soc, 1.0);
            self.energy_rested.add(reading.remaining_wh, truth.remaining_wh, truth.full_wh);
        }
    }
    fn merge(&mut self, other: &Scores) {
        self.soc.merge(&other.soc);
        self.energy.merge(&other.energy);
        self.time.merge(&other.time);
        self.full.merge(&other.full);
        self.soh.merge(&other.soh);
        self.soc_rested.merge(&other.soc_rested);
        self.energy_rested.merge(&other.energy_rested);
    }
}

fn study(name: &str, told: Told, worlds: std::ops::Range<u64>) -> Vec<Scores> {
    let believed = Arc::new(model(name));
    let mut all = vec![Scores::default(); Kind::ALL.len()];
    for seed in worlds {
        let mut world = World::new(&believed, name, seed);
        let soc = world.told(told);
        let mut gauges: Vec<_> = Kind::ALL.iter().map(|kind| kind.open(Arc::clone(&believed), soc, 25.0)).collect();
        for _ in 0..READINGS {
            for _ in 0..READ_EVERY {
                let sample = world.step();
                gauges.iter_mut().for_each(|gauge| gauge.update(&sample));
            }
            let truth = world.truth();
            for (gauge, scores) in gauges.iter_mut().zip(&mut all) {
                scores.add(&gauge.reading(), &truth);
            }
        }
    }
    all
}

#[test]
fn intervals_of_every_gauge_cover_what_they_say() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let full = number("TENDER_FULL").is_some_and(|full| full > 0);
    let first = number("TENDER_SEED").unwrap_or(0);
    let count = number("TENDER_WORLDS").unwrap_or(if full { 2000 } else { 24 });
    let threads = if full { 2 } else { 2 };
    println!("gauge            set                                   after rest: SoC  energy    68 % and 95 %:   SoC        energy       time      | SoC rms  full rms 68 95     SoH rms 68 95");
    let mut pooled = vec![Scores::default(); Kind::ALL.len()];
    for &(name, told) in SETS {
        let part = count.div_ceil(threads);
        let parts: Vec<Vec<Scores>> = std::thread::scope(|scope| {
            let handles: Vec<_> = (0..threads)
                .map(|thread| scope.spawn(move || study(name, told, first + thread * part..first + ((thread + 1) * part).min(count))))
                .collect();
            handles.into_iter().map(|handle| handle.join().unwrap()).collect()
        });
        for (index, kind) in Kind::ALL.iter().enumerate() {
            let mut scores = Scores::default();
            parts.iter().for_each(|part| scores.merge(&part[index]));
            print_row(kind.name(), &format!("{name} {told:?}"), &scores);
            pooled[index].merge(&scores);
        }
    }
    for (kind, scores) in Kind::ALL.iter().zip(&pooled) {
        print_row(kind.name(), "all", scores);
    }
}

fn print_row(gauge: &str, set: &str, scores: &Scores) {
    let cover = |score: &Score| {
        let (one, two) = score.percent();
        format!("{one:5.1} {two:5.1}")
    };
    println!(
        "{gauge:16} {set:40} {:5.2} {:5.2}   {} | {} | {} | {:5.2} | {:5.2} {} | {:5.2} {} | bias {:5.2} {:5.2}",
        scores.soc_rested.rms_percent(),
        scores.energy_rested.rms_percent(),
        cover(&scores.soc),
        cover(&scores.energy),
        cover(&scores.time),
        scores.soc.rms_percent(),
        scores.full.rms_percent(),
        cover(&scores.full),
        scores.soh.rms_percent(),
        cover(&scores.soh),
        100.0 * scores.soc.bias / scores.soc.count,
        100.0 * scores.energy.bias / scores.energy.count,
    );
}
