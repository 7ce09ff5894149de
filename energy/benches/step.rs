//! Steps per second of a battery pack, alone and in a batch.
//!
//! `cargo bench -p energy --bench step`. One item is one step of one pack.

use std::sync::Arc;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use energy::{Batch, Channel, Model, Run, Start};

fn main() {
    divan::main();
}

/// Steps of one sample.
const STEPS: usize = 3600;
/// Packs in the batch.
const PACKS: usize = 1000;

/// OCV, R(SoC), two RC pairs and a thermal mass; `more` adds effects.
fn model(more: &str) -> Arc<Model> {
    let effects = r#"
        [[effect]]
        id = "ohmic_soc"
        resistance_soc_000_ohm = { value = 0.30, source = "bench" }
        resistance_soc_020_ohm = { value = 0.12, source = "bench" }
        [[effect]]
        id = "rc1"
        [[effect]]
        id = "rc2"
        [[effect]]
        id = "thermal"
    "#;
    let battery = energy::built_in("explorer-3s1p-1320mah").unwrap();
    let facts = &battery[..battery.find("[[effect]]").unwrap()];
    let facts = &facts[..facts.rfind("\n\n").unwrap_or(facts.len())];
    let read = |table: &str| energy::built_in(table).map(str::to_owned).ok_or_else(|| "not built in".to_owned());
    Arc::new(Model::parse("bench", &format!("{facts}\n{effects}{more}"), &read).unwrap())
}

/// Current of a drive, A, at each second: driving, braking and standing between -1 A and 2 A.
fn profile() -> Vec<f64> {
    let wave = |second: usize, period: f64| (std::f64::consts::TAU * second as f64 / period).sin();
    (0..STEPS).map(|second| 0.5 + wave(second, 37.0) + 0.5 * wave(second, 11.0)).collect()
}

fn drive(bencher: Bencher<'_, '_>, more: &str) {
    let (model, profile) = (model(more), profile());
    let mut run = Run::new(model, Start::at_soc(0.9));
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        run.restart(Start::at_soc(0.9));
        for &current_a in &profile {
            run.channels[Channel::CurrentA] = current_a;
            run.step(1.0);
        }
        black_box(run.channels[Channel::VoltageV])
    });
}

/// An hour at 1 s: OCV, R(SoC), two RC pairs, thermal.
#[divan::bench]
fn lone_pack(bencher: Bencher<'_, '_>) {
    drive(bencher, "");
}

/// The same hour with hysteresis.
#[divan::bench]
fn lone_pack_with_hysteresis(bencher: Bencher<'_, '_>) {
    drive(bencher, "[[effect]]\nid = \"hysteresis\"\n");
}

fn fleet(bencher: Bencher<'_, '_>, more: &str) {
    let (model, profile) = (model(more), profile());
    let mut batch = Batch::new(model, &[Start::at_soc(0.9); PACKS]);
    bencher.counter(ItemsCount::new(PACKS * 60)).bench_local(|| {
        for &current_a in &profile[..60] {
            for channels in &mut batch.channels {
                channels[Channel::CurrentA] = current_a;
            }
            batch.step(1.0);
        }
        black_box(batch.channels[0][Channel::VoltageV])
    });
}

/// A minute of a thousand packs.
#[divan::bench]
fn batch_of_packs(bencher: Bencher<'_, '_>) {
    fleet(bencher, "");
}

/// The same with hysteresis.
#[divan::bench]
fn batch_of_packs_with_hysteresis(bencher: Bencher<'_, '_>) {
    fleet(bencher, "[[effect]]\nid = \"hysteresis\"\n");
}
