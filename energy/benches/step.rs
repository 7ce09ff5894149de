//! Steps per second of a battery pack, alone and in a batch.
//!
//! `cargo bench -p energy --bench step`. One item is one step of one pack.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use energy::real::{LANES, variable};
use energy::{Batch, Channel, Dual, Run, Start};

#[path = "../tests/drive/mod.rs"]
mod drive;

fn main() {
    // Speed that is bought with error is none: first the difference to the fine integration.
    for (name, more, amplitude_v) in [("OCV, R(SoC), 2 RC, thermal", "", 0.0), ("with hysteresis", drive::HYSTERESIS, 0.01)] {
        let (model, profile) = (drive::model(more), drive::profile());
        let [volts, kelvins] =
            drive::greatest_difference(&drive::stepped(&model, &profile), &drive::integrated(&model, &profile, amplitude_v));
        println!("{name}: 1 s steps against Runge-Kutta in 10 ms steps: at most {:.4} mV, {kelvins:.5} K", 1e3 * volts);
    }
    divan::main();
}

/// Packs in the batch.
const PACKS: usize = 1000;

fn lone(bencher: Bencher<'_, '_>, more: &str) {
    let (model, profile) = (drive::model(more), drive::profile());
    let mut run = Run::new(model, Start::at_soc(drive::SOC));
    bencher.counter(ItemsCount::new(profile.len())).bench_local(|| {
        run.restart(Start::at_soc(drive::SOC));
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
    lone(bencher, "");
}

/// The same hour with hysteresis.
#[divan::bench]
fn lone_pack_with_hysteresis(bencher: Bencher<'_, '_>) {
    lone(bencher, drive::HYSTERESIS);
}

/// The same hour with eight derivatives, as a fit walks a log: by the state of charge at its start
/// and by the model's last seven parameters.
fn derivatives(bencher: Bencher<'_, '_>, more: &str) {
    let (model, profile) = (drive::model(more), drive::profile());
    let values = model.values();
    let first = values.len() - LANES;
    let dual = |i: usize| if i <= first { Dual::from(values[i]) } else { variable(values[i], i - first) };
    let start = Start { soc: variable(drive::SOC, 0), ..Start::at_soc(drive::SOC).lifted() };
    let mut run = Run::with_parameters(model, (0..values.len()).map(dual).collect(), start);
    bencher.counter(ItemsCount::new(profile.len())).bench_local(|| {
        run.restart(start);
        for &current_a in &profile {
            run.channels[Channel::CurrentA] = Dual::from(current_a);
            run.step(1.0);
        }
        black_box(run.channels[Channel::VoltageV])
    });
}

/// OCV, R(SoC), two RC pairs, thermal, with eight derivatives.
#[divan::bench]
fn lone_pack_with_derivatives(bencher: Bencher<'_, '_>) {
    derivatives(bencher, "");
}

/// The same with hysteresis.
#[divan::bench]
fn lone_pack_with_hysteresis_and_derivatives(bencher: Bencher<'_, '_>) {
    derivatives(bencher, drive::HYSTERESIS);
}

fn fleet(bencher: Bencher<'_, '_>, more: &str) {
    let (model, profile) = (drive::model(more), drive::profile());
    let mut batch = Batch::new(model, &[Start::at_soc(drive::SOC); PACKS]);
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
    fleet(bencher, drive::HYSTERESIS);
}
