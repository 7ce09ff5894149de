//! Packs of unlike cells.

use std::sync::Arc;

use energy::forecast::{charge, discharge};
use energy::load::Terminals as _;
use energy::pack::Battery as _;
use energy::{Channel, Model, Pack, Run, Start, load_model};
use proptest::prelude::*;

use crate::{everything, everything_with};

/// A pack of cells of 2 Ah with 50 milliohm, in a table of that OCV.
fn pack_with(series: u32, parallel: u32, ocv_v: [f64; 2], extra: &str) -> Arc<Model> {
    let capacity_ah = 2.0 * f64::from(parallel);
    let [empty_v, full_v] = ocv_v;
    let text = format!(
        "schema = 1\nsystem = \"battery\"\nname = \"p\"\n[battery]\nseries = {series}\nparallel = {parallel}\ncapacity_ah = {capacity_ah}\n\
         full_v_per_cell = 4.2\neod_v_per_cell = 3.0\ncharge_current_a = 1.0\ncharge_cutoff_a = 0.02\n\
         ocv = {{ soc = [0.0, 1.0], voltage_v = [{empty_v}, {full_v}] }}\n{extra}\n\
         [[effect]]\nid = \"ohmic\"\nresistance_ohm = {{ value = 0.05, source = \"test\" }}\n"
    );
    Arc::new(Model::parse("p", &text, &|_| unreachable!()).unwrap())
}

fn cell(series: u32, text: &str) -> String {
    format!("[[battery.cell]]\nseries = {series}\n{text}\n")
}

#[test]
fn like_cells_stepped_one_by_one_do_what_one_lumped_run_does() {
    // What a rate does to capacity counts the current at the terminals in a lumped run, and with
    // what the terminals do not see in a cell; everything else is the same.
    let model = Arc::new(everything().without(|id| id == "parasitic_load"));
    let start = Start { soc: 0.8, temperature_degc: 15.0, cycle_count: 100.0, age_days: 200.0, history: 0.0, clock_s: 0.0 };
    let mut lumped = Run::new(Arc::clone(&model), start);
    let (mut single, mut pack) = (Pack::cell_by_cell(Arc::clone(&model), start), Pack::new(model, start));
    for step in 0..400 {
        let current_a = f64::from(step % 9) - 3.0;
        lumped.step_current(current_a, 5.0);
        single.step_current(current_a, 5.0);
        pack.step_current(current_a, 5.0);
        for &channel in Channel::ALL {
            let (one, many) = (lumped.channels[channel], single.channels()[channel]);
            assert!((one - many).abs() <= 1e-9 * (1.0 + one.abs()), "{}: {one} and {many}", channel.name());
            assert_eq!(one, pack.channels()[channel], "{}", channel.name());
        }
    }
}

#[test]
fn cells_in_parallel_share_by_resistance_at_the_first_instant() {
    // R and 2 R at equal state of charge: 2/3 and 1/3 of 3 A.
    let pair = cell(1, "parallel = 2\nresistance_factor = 2.0");
    let mut pack = Pack::new(pack_with(1, 2, [3.0, 4.2], &pair), Start::at_soc(0.5));
    pack.step_current(3.0, 1e-3);
    assert!((pack.cell(0, 0).current_a - 2.0).abs() < 1e-4 && (pack.cell(0, 1).current_a - 1.0).abs() < 1e-4);
    assert!((pack.cell(0, 0).voltage_v - (3.6 - 0.1)).abs() < 1e-5);
    // After long the one that gave more is emptier and the shares turn to those of the capacity.
    for _ in 0..600 {
        pack.step_current(3.0, 2.0);
    }
    assert!((pack.cell(0, 0).current_a - 1.5).abs() < 0.05, "{:?}", pack.cell(0, 0));
    // Cells of 0.6 and 0.5 at rest: OCV apart by 0.12 V over 0.15 ohm.
    let apart = cell(1, "parallel = 2\nresistance_factor = 2.0\nsoc_offset = -0.1");
    let mut pack = Pack::new(pack_with(1, 2, [3.0, 4.2], &apart), Start::at_soc(0.6));
    pack.step_current(0.0, 1e-3);
    assert!((pack.cell(0, 0).current_a - 0.8).abs() < 1e-4 && (pack.cell(0, 1).current_a + 0.8).abs() < 1e-4);
}

#[test]
fn a_weak_cell_ends_the_discharge() {
    // 2 Ah cells at 1 A, the second of 1.6 Ah. OCV 3.0 + 1.2 s meets 3.0 + 0.05 V at s = 0.0417,
    // so the weak cell ends after 0.9583 * 1.6 h where the others last 0.9583 * 2 h.
    let start = Start::at_soc(1.0);
    let lasts_s = |model: Arc<Model>| {
        let mut pack = Pack::new(model, start);
        let mut time_s = 0.0_f64;
        while !pack.is_empty() {
            pack.step_current(1.0, 1.0);
            time_s += 1.0;
        }
        (time_s, pack)
    };
    let (like_s, _) = lasts_s(pack_with(3, 1, [3.0, 4.2], ""));
    let (weak_s, pack) = lasts_s(pack_with(3, 1, [3.0, 4.2], &cell(2, "capacity_factor = 0.8")));
    let share = 1.0_f64 - 0.05 / 1.2;
    assert!((like_s - share * 2.0 * 3600.0).abs() < 2.0, "{like_s}");
    assert!((weak_s - share * 1.6 * 3600.0).abs() < 2.0, "{weak_s}");
    // The pack's voltage alone would not have told: it is above three times the end of discharge.
    assert!(pack.channels()[Channel::VoltageV] > 9.4 && pack.cell(1, 0).voltage_v < 3.0);
    // The charge left in the pack is that in its weakest cell, of 1.6 Ah.
    assert!((pack.channels()[Channel::Soc] - pack.cell(1, 0).soc).abs() < 1e-12);
    assert!((pack.channels()[Channel::CapacityAh] - 1.6).abs() < 1e-12);
}

#[test]
fn a_packs_state_of_charge_counts_from_its_first_empty_to_its_first_full_cell() {
    // Cells of 2 Ah at 50 %, 30 % and 60 %: 0.6 Ah until the second is empty, 0.8 Ah until the
    // third is full.
    let extra = cell(2, "soc_offset = -0.2") + &cell(3, "soc_offset = 0.1");
    let pack = Pack::new(pack_with(3, 1, [3.0, 4.2], &extra), Start::at_soc(0.5));
    assert!((pack.channels()[Channel::Soc] - 0.6 / 1.4).abs() < 1e-12);
    assert!((pack.channels()[Channel::VoltageV] - (9.0 + 1.2 * 1.4)).abs() < 1e-12);
    // A cell never starts above full.
    let pack = Pack::new(pack_with(3, 1, [3.0, 4.2], &extra), Start::at_soc(1.0));
    assert_eq!((pack.channels()[Channel::Soc], pack.cell(2, 0).soc), (1.0, 1.0));
}

/// One cell 1 % (20 mAh) above the other, 10 mA past it.
fn unbalanced(at_rest: bool) -> Pack {
    let extra = cell(2, "soc_offset = -0.01")
        + &format!("[battery.balancing]\nbypass_a_max = 0.01\nstart_v = 3.5\ndifference_v = 0.0\nat_rest = {at_rest}\n");
    Pack::new(pack_with(2, 1, [3.0, 4.2], &extra), Start::at_soc(0.9))
}

#[test]
fn ten_milliamperes_past_a_cell_take_away_20_milliampere_hours_in_two_hours() {
    let mut pack = unbalanced(true);
    let mut time_s = 0.0_f64;
    while pack.cell(0, 0).soc > pack.cell(1, 0).soc + 1e-6 {
        pack.step_current(0.0, 1.0);
        time_s += 1.0;
        assert!(time_s < 20_000.0);
    }
    // 20 mAh at 10 mA, and a step until the first measurement.
    assert!((time_s - 7201.0).abs() < 3.0, "{time_s}");
    // A coarse step removes as much and no more.
    let mut coarse = unbalanced(true);
    for _ in 0..20 {
        coarse.step_current(0.0, 600.0);
    }
    assert!((coarse.cell(0, 0).soc - coarse.cell(1, 0).soc).abs() < 1e-3);
    // Without leave to balance at rest nothing happens there, nor during a discharge.
    for (at_rest, current_a) in [(false, 0.0), (true, 0.1)] {
        let mut pack = unbalanced(at_rest);
        for _ in 0..600 {
            pack.step_current(current_a, 1.0);
        }
        // The first step still balances: the one before it was a rest.
        assert!((pack.cell(0, 0).soc - pack.cell(1, 0).soc - 0.01).abs() < 2e-6);
    }
}

#[test]
fn balancing_while_charging_brings_the_cells_together_and_closes_the_energy_balance() {
    let extra = cell(2, "soc_offset = -0.02\ncapacity_factor = 0.95\nresistance_factor = 1.3")
        + "[battery.balancing]\nbypass_a_max = 0.1\nstart_v = 3.2\ndifference_v = 0.005\n";
    let mut pack = Pack::new(pack_with(3, 1, [3.0, 4.2], &extra), Start::at_soc(0.1));
    let apart = |pack: &Pack| pack.channels()[Channel::CellMaxV] - pack.channels()[Channel::CellMinV];
    let charge_of = |pack: &Pack| pack.cells().map(|cell| cell.soc * cell.capacity_ah).collect::<Vec<f64>>();
    pack.step_current(-0.2, 1.0);
    let (mut in_j, mut stored_j, mut heat_j, mut bypass_j) = (0.0, 0.0, 0.0, 0.0);
    let first = apart(&pack);
    let mut bypassed = 0;
    for _ in 0..20_000 {
        let before = charge_of(&pack);
        pack.step_current(-0.2, 1.0);
        in_j -= pack.channels()[Channel::PowerW];
        heat_j += pack.heat_w();
        bypass_j += pack.bypass_w();
        bypassed += usize::from(pack.bypass_w() > 0.0);
        for ((cell, before_ah), after_ah) in pack.cells().zip(before).zip(charge_of(&pack)) {
            // The charge enters at the OCV of the step's end.
            stored_j += (3.0 + 1.2 * cell.soc) * (after_ah - before_ah) * 3600.0;
        }
    }
    assert!(bypassed > 1000 && bypass_j > 0.0);
    assert!(apart(&pack) < 0.3 * first && apart(&pack) < 0.02, "{} after {first}", apart(&pack));
    assert!((in_j - stored_j - heat_j - bypass_j).abs() <= 1e-9 * in_j, "{in_j} {stored_j} {heat_j} {bypass_j}");
}

#[test]
fn with_a_flat_ocv_the_energy_balance_closes_without_any_discretisation() {
    // Cells alike but for their resistance: the one with more shows more voltage and is bypassed.
    let extra = cell(1, "resistance_factor = 2.0") + "[battery.balancing]\nbypass_a_max = 0.05\nstart_v = 3.5\ndifference_v = 0.01\n";
    let mut pack = Pack::new(pack_with(2, 1, [3.7, 3.7], &extra), Start::at_soc(0.2));
    let (mut in_j, mut lost_j) = (0.0, 0.0);
    for _ in 0..200 {
        pack.step_current(-1.0, 10.0);
        in_j -= pack.channels()[Channel::PowerW] * 10.0;
        lost_j += (pack.heat_w() + pack.bypass_w()) * 10.0;
    }
    let stored_j: f64 = pack.cells().map(|cell| (cell.soc - 0.2) * 2.0 * 3.7 * 3600.0).sum();
    assert!((in_j - stored_j - lost_j).abs() <= 1e-9 * in_j, "{in_j} {stored_j} {lost_j}");
    // By hand: in all but the first of 200 steps of 10 s flow 50 mA past the first cell.
    assert!((pack.cell(1, 0).soc - pack.cell(0, 0).soc - 0.05 * 1990.0 / 7200.0).abs() < 1e-9);
}

#[test]
fn forecasts_are_those_of_the_run_for_like_cells_and_shorter_for_a_weak_one() {
    let model = Arc::new(load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap());
    let start = Start::at_soc(0.9);
    let (mut run, mut pack) = (Run::new(Arc::clone(&model), start), Pack::new(Arc::clone(&model), start));
    let mut single = Pack::cell_by_cell(model, start);
    let of_run = discharge(&mut run, 4.0);
    assert_eq!(of_run, discharge(&mut pack, 4.0));
    assert!((discharge(&mut single, 4.0).energy_wh / of_run.energy_wh - 1.0).abs() < 1e-9);
    for battery in [&mut pack, &mut single] {
        battery.restart(Start::at_soc(0.1));
    }
    assert!((charge(&mut single, 0.95).energy_wh / charge(&mut pack, 0.95).energy_wh - 1.0).abs() < 1e-6);
    // A third of the capacity is missing in one cell: so it is of what the pack gives.
    let wh = |extra: &str| discharge(&mut Pack::new(pack_with(3, 1, [3.4, 4.2], extra), Start::at_soc(1.0)), 5.0).energy_wh;
    let (like_wh, weak_wh) = (wh(""), wh(&cell(1, "capacity_factor = 0.6667")));
    // Less than a third: the two strong cells stop where their voltage is still high.
    assert!((0.667..0.72).contains(&(weak_wh / like_wh)), "{}", weak_wh / like_wh);
}

proptest! {
    /// Totals: finite, the current conserved and the voltages equal, also with an empty cell.
    #[test]
    fn any_pack_is_finite_and_shares_its_current_exactly(
        factors in proptest::collection::vec((0.05..2.0_f64, 0.1..20.0_f64, -0.5..0.5_f64), 4),
        currents_a in proptest::collection::vec(-20.0..20.0_f64, 1..12),
        soc in -0.1..1.1_f64,
        dt_s in 0.001..10_000.0_f64,
    ) {
        let mut extra = String::new();
        for (index, (capacity, resistance, offset)) in factors.into_iter().enumerate() {
            extra += &format!(
                "[[battery.cell]]\nseries = {}\nparallel = {}\ncapacity_factor = {capacity}\nresistance_factor = {resistance}\nsoc_offset = {offset}\n",
                1 + index / 2, 1 + index % 2
            );
        }
        extra += "[battery.balancing]\nbypass_a_max = 0.1\nstart_v = 3.0\ndifference_v = 0.01\nat_rest = true\n";
        let model = everything_with(&extra);
        let start = Start { soc, temperature_degc: 20.0, cycle_count: 10.0, age_days: 30.0, history: 0.0, clock_s: 0.0 };
        let (mut pack, mut lumped) = (Pack::new(Arc::clone(&model), start), Run::new(model, start));
        for current_a in currents_a {
            pack.step_current(current_a, dt_s);
            for &channel in Channel::ALL {
                prop_assert!(pack.channels()[channel].is_finite(), "{} = {}", channel.name(), pack.channels()[channel]);
            }
            // With what is drawn unseen by the terminals.
            lumped.step_current(current_a, dt_s);
            let drawn_a = 2.0 * lumped.channels[Channel::CellCurrentA];
            for series in 0..3 {
                let cells = [0, 1].map(|parallel| pack.cell(series, parallel));
                let sum_a = cells[0].current_a + cells[1].current_a - pack.bypass_a(series);
                prop_assert!((sum_a - drawn_a).abs() < 1e-12 * (1.0 + cells[0].current_a.abs()), "{sum_a} and {drawn_a}");
                // Far outside of its table a cell has no physics that could share a current.
                let real = cells.iter().all(|cell| (-0.2..1.2).contains(&cell.soc) && cell.temperature_degc < 200.0);
                prop_assert!(!real || (cells[0].voltage_v - cells[1].voltage_v).abs() < 1e-6, "{cells:?}");
            }
        }
    }
}
