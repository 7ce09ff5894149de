//! What holds at the terminals: power near its limit, mixes of loads, jumps.

use std::sync::Arc;

use energy::load::{CannotDeliver, Mix, Terminals};
use energy::{Channel, Model, Pack, Run, Start};
use proptest::prelude::*;

use crate::everything;

/// One cell, OCV 4 V flat, 0.1 ohm: P = 4 I - 0.1 I^2, at most 40 W at 20 A.
fn cell() -> Run<f64> {
    let text = r#"
        schema = 1
        system = "battery"
        name = "flat"
        battery = { series = 1, parallel = 1, capacity_ah = 100.0, full_v_per_cell = 4.2, eod_v_per_cell = 1.0, charge_current_a = 5.0, charge_cutoff_a = 0.1, ocv = { soc = [0.0, 1.0], voltage_v = [4.0, 4.0] } }
        [[effect]]
        id = "ohmic"
        resistance_ohm = { value = 0.1, source = "test" }
    "#;
    Run::new(Arc::new(Model::parse("flat", text, &|_| unreachable!()).unwrap()), Start::at_soc(0.5))
}

#[test]
fn power_just_below_the_limit_is_found_and_just_above_it_is_refused_without_a_trace() {
    for below in [1e-3, 1e-4, 1e-6] {
        for (limit, last_a) in [(40.0, 0.0), (40.0, 19.0), (40.0, 25.0)] {
            let mut run = cell();
            run.step_current(last_a, 1e-3);
            let power_w = limit * (1.0 - below);
            let current_a = run.step_power(power_w, 1.0).unwrap();
            // By hand: I = 20 - sqrt(400 - 10 P).
            let by_hand_a = 20.0 - (400.0_f64 - 10.0 * power_w).sqrt();
            assert!((current_a - by_hand_a).abs() < 1e-4, "{current_a} and {by_hand_a}");
            assert!((run.channels[Channel::PowerW] - power_w).abs() <= 1e-9 * power_w);
            let above_w = limit * (1.0 + below);
            let before = run.clone();
            assert_eq!(run.step_power(above_w, 1.0), Err(CannotDeliver { power_w: above_w }));
            assert_eq!(run.states(), before.states());
            for &channel in Channel::ALL {
                assert_eq!(run.channels[channel], before.channels[channel], "{}", channel.name());
            }
        }
    }
}

#[test]
fn loads_of_constant_power_current_and_resistance_add_up() {
    // V = 4 - 0.1 I and I = 3 / V + 1 + V / 2: 1.05 V^2 - 3.9 V + 0.3 = 0.
    let by_hand_v = (3.9 + (3.9_f64 * 3.9 - 4.0 * 1.05 * 0.3).sqrt()) / 2.1;
    let mut run = cell();
    let current_a = run.step_mix(Mix { power_w: 3.0, current_a: 1.0, conductance_s: 0.5 }, 1.0).unwrap();
    assert!((run.channels[Channel::TerminalVoltageV] - by_hand_v).abs() < 1e-8);
    assert!((current_a - (4.0 - by_hand_v) / 0.1).abs() < 1e-7);
    // A lone resistor of 1.9 ohm: 2 A; a lone current is itself; nothing draws nothing.
    let lone = |mix: Mix| cell().step_mix(mix, 1.0).unwrap();
    assert!((lone(Mix { conductance_s: 1.0 / 1.9, ..Mix::default() }) - 2.0).abs() < 1e-7);
    assert!((lone(Mix { current_a: 7.0, ..Mix::default() }) - 7.0).abs() < 1e-7);
    assert_eq!(lone(Mix::default()), 0.0);
    assert!(cell().step_mix(Mix { power_w: 30.0, current_a: 10.0, conductance_s: 0.5 }, 1.0).is_err());
}

/// A pack behind a current sensor that shows nothing below 0.5 A, then counts from there.
#[derive(Clone)]
struct DeadBand(Run<f64>);

impl Terminals for DeadBand {
    fn save(&mut self) {
        self.0.save();
    }
    fn restore(&mut self) {
        self.0.restore();
    }
    fn step_current(&mut self, current_a: f64, dt_s: f64) {
        let flowed_a = if current_a == 0.0 { 0.0 } else { current_a + 0.5 * current_a.signum() };
        self.0.step_current(flowed_a, dt_s);
    }
    fn channel(&self, channel: Channel) -> f64 {
        self.0.channels[channel]
    }
}

#[test]
fn a_power_that_a_dead_band_jumps_over_is_refused_and_others_are_met() {
    for power_w in [-20.0, -10.0, -2.5, -1.0, 1e-3, 1.0, 1.9, 2.5, 10.0, 39.9, 40.1] {
        let mut pack = DeadBand(cell());
        // Of half an ampere: 1.975 W out, 2.025 W in.
        let possible = (1.975..=40.0).contains(&power_w) || power_w <= -2.025;
        let stepped = pack.step_power(power_w, 1.0);
        assert_eq!(stepped.is_ok(), possible, "{power_w} W: {stepped:?}");
        if possible {
            assert!((pack.channel(Channel::PowerW) - power_w).abs() <= 1e-9 * power_w.abs());
        } else {
            assert_eq!(pack.channel(Channel::Soc), 0.5);
        }
    }
    // A charger for 4.03 V: between the 4.05 V of the least current and the 4 V of none.
    let mut pack = DeadBand(cell());
    assert_eq!(pack.step_charge(5.0, 4.03, 1.0), 0.0);
    assert!(pack.channel(Channel::TerminalVoltageV) <= 4.03);
}

/// Currents of the scan on each side of no load, densest there.
const SCAN: i32 = 2000;
const MOST_A: f64 = 400.0;

fn scanned_a(point: i32) -> f64 {
    let share = f64::from(point) / f64::from(SCAN);
    MOST_A * share * share.abs()
}

/// Scanned currents with their power where the voltage is not reversed: cells emptied beyond
/// nothing neither feed a load nor take a charge. A discharge ends where the voltage first
/// collapses, though parameters that no cell has may bring it back at a higher current.
fn scan(pack: &mut impl Terminals, dt_s: f64) -> Vec<(f64, f64)> {
    pack.save();
    let mut curve = Vec::new();
    for current_a in (-SCAN..=SCAN).map(scanned_a) {
        let (voltage_v, power_w) = pack.trial(current_a, dt_s);
        if voltage_v > 0.0 {
            curve.push((current_a, power_w));
        } else if current_a > 0.0 {
            break;
        }
    }
    pack.restore();
    curve
}

/// A current that gives this power, where two neighbours of the scan have it between them with
/// the power rising. Where their gap shrinks to a jump, no current does.
fn met_between(pack: &mut impl Terminals, dt_s: f64, power_w: f64, mut low_a: f64, mut high_a: f64) -> Option<f64> {
    pack.save();
    let mut found = None;
    loop {
        let middle_a = f64::midpoint(low_a, high_a);
        if middle_a <= low_a || middle_a >= high_a {
            break;
        }
        let (voltage_v, given_w) = pack.trial(middle_a, dt_s);
        let excess_w = given_w - power_w;
        if voltage_v > 0.0 && excess_w.abs() <= 1e-9 * power_w.abs() {
            found = Some(middle_a);
            break;
        }
        if excess_w < 0.0 { low_a = middle_a } else { high_a = middle_a }
    }
    pack.restore();
    found
}

fn answers_truly(pack: &mut (impl Terminals + Clone), share: f64, dt_s: f64) -> Result<(), TestCaseError> {
    let curve = scan(pack, dt_s);
    let limit_w = curve.iter().map(|point| point.1).fold(f64::NEG_INFINITY, f64::max);
    let power_w = share * limit_w.clamp(1e-3, 2000.0);
    let before = pack.clone();
    match pack.step_power(power_w, dt_s) {
        Ok(_) => {
            let given_w = pack.channel(Channel::PowerW);
            prop_assert!((given_w - power_w).abs() <= 1e-9 * power_w.abs() + 1e-12, "{given_w} for {power_w}");
        }
        Err(_) => {
            prop_assert_eq!(pack.channel(Channel::Soc), before.channel(Channel::Soc));
            prop_assert_eq!(pack.channel(Channel::CurrentA), before.channel(Channel::CurrentA));
            for pair in curve.windows(2).filter(|pair| pair[0].1 < power_w && power_w <= pair[1].1) {
                let met_a = met_between(pack, dt_s, power_w, pair[0].0, pair[1].0);
                prop_assert!(met_a.is_none(), "refused {power_w} W, and {met_a:?} A gives it");
            }
        }
    }
    Ok(())
}

proptest! {
    /// Whatever the effects, a power is met or there is no current that gives it.
    #[test]
    fn a_power_is_met_or_no_current_gives_it(
        shares in proptest::collection::vec(0.0..1.0_f64, 64),
        history_a in proptest::collection::vec(-6.0..12.0_f64, 0..6),
        soc in 0.0..1.0_f64,
        dt_s in 0.1..60.0_f64,
        share in prop_oneof![-1.0..1.5_f64, 0.99..1.01_f64, Just(1.0 - 1e-3), Just(1.0 - 1e-4), Just(1.0 - 1e-6)],
    ) {
        let model = everything();
        let parameters: Vec<f64> = model
            .parameters()
            .iter()
            .zip(shares.iter().cycle())
            // Half of the models keep near the defaults, where real packs are. None has a resistance
            // below zero (a table beyond R0 may hold such): a pack is no source of power in itself.
            .map(|(p, share)| if shares[0] < 0.5 { p.value } else { p.min.max(0.0) + share.powi(3) * (p.max - p.min.max(0.0)) })
            .collect();
        let start = Start { soc, temperature_degc: 20.0, cycle_count: 300.0, age_days: 400.0, history: 0.0, clock_s: 0.0 };
        let mut run = Run::with_parameters(Arc::clone(&model), parameters.clone(), start);
        let mut pack = Pack::with_parameters(model, parameters, start);
        for current_a in history_a {
            run.step_current(current_a, 5.0);
            pack.step_current(current_a, 5.0);
        }
        answers_truly(&mut run, share, dt_s)?;
        // A pack of like cells answers as its run does, to the bit.
        answers_truly(&mut pack, share, dt_s)?;
        prop_assert_eq!(run.channels[Channel::CurrentA], pack.channels()[Channel::CurrentA]);
    }
}
