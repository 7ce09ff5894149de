use proptest::prelude::*;

use super::*;
use crate::power::{Consumer, ConsumerKind, ConverterLoss, EfficiencyTable, Ldo, Switch, SwitchMode};
use crate::real::{Dual, derivative, variable};

fn rail(id: &str, from: &str, kind: RailKind, loads: &[(ConsumerKind, f64)]) -> Rail {
    let loads = loads.iter().map(|&(kind, value)| Consumer { name: "load".to_owned(), kind, value, sigma: 0.0, when: None }).collect();
    Rail { id: id.to_owned(), from: from.to_owned(), kind, current_a_max: f64::INFINITY, loads, source: None }
}

fn ldo(output_v: f64) -> RailKind {
    RailKind::Linear(Ldo { output_v, ground_a: 0.0, dropout_v: 0.3, theta_ja_k_per_w: Some(100.0), junction_max_degc: 125.0 })
}

fn wire(resistance_ohm: f64) -> RailKind {
    RailKind::Switch(Switch { resistance_ohm })
}

fn polynomial(output_v: f64, fixed_w: f64, linear_v: f64, resistance_ohm: f64) -> RailKind {
    let loss = ConverterLoss::Polynomial { fixed_w, linear_v, resistance_ohm };
    RailKind::Switching(SwitchMode { output_v, input_v_min: 6.0, loss })
}

/// Kottas, Fig. 4.1: a 5 V converter G_A with a 3.3 V regulator G_C behind it, and a 5 V regulator
/// G_B beside it.
fn two_branches() -> PowerTree {
    use ConsumerKind::{Current, Power, Resistance};
    PowerTree::new(vec![
        rail("5v_a", "battery", polynomial(5.0, 0.1, 5.4, 0.2), &[(Power, 2.0), (Resistance, 50.0)]),
        rail("5v_b", "battery", ldo(5.0), &[(Current, 0.2)]),
        rail("3v3", "5v_a", ldo(3.3), &[(Current, 0.0355)]),
    ])
    .unwrap()
}

/// By hand, at 7.4 V:
/// 3v3: 35.5 mA, loss 1.7 V x 35.5 mA = 60.35 mW, at 100 K/W 6.035 K above 25 degC.
/// 5v_a: 2 W / 5 V + 5 V / 50 ohm + 35.5 mA = 0.5355 A; in: 0.1 + 5.4 x 0.5355 + 0.2 x 0.5355^2
///   = 3.04905205 W; out 2.6775 W; loss 0.37155205 W.
/// 5v_b: 0.2 A, loss 2.4 V x 0.2 A = 0.48 W; in 1.48 W.
/// Battery: 4.52905205 W; loads 2 + 0.5 + 0.11715 + 1.0 = 3.61715 W; losses 0.91190205 W.
#[test]
fn two_branches_worked_by_hand() {
    let tree = two_branches();
    let flow = tree.solve(7.4, 25.0, |_| 1.0, &[]).unwrap();
    let at = |id: &str| flow.rails()[tree.find(id).unwrap()];
    assert!((at("3v3").loss_w - 0.060_35).abs() < 1e-12);
    assert!((at("3v3").junction_degc.unwrap() - 31.035).abs() < 1e-9);
    // The GPS receiver: 35.5 mA at 3.3 V is 117.15 mW; Kottas, section 4.4, prints 118.86 mW.
    assert!((at("3v3").load_w - 0.117_15).abs() < 1e-12);
    assert!((at("5v_a").output_a - 0.5355).abs() < 1e-12);
    assert!((at("5v_a").loss_w - 0.371_552_05).abs() < 1e-12);
    assert!((at("5v_b").loss_w - 0.48).abs() < 1e-12);
    assert!((flow.battery_w - 4.529_052_05).abs() < 1e-9);
    assert!((flow.battery_a - 4.529_052_05 / 7.4).abs() < 1e-9);
    assert!((flow.load_w() + flow.loss_w() - flow.battery_w).abs() < 1e-9);
}

#[test]
fn what_effects_ask_of_a_rail_is_constant_power_on_it() {
    let tree = two_branches();
    let mut demand_w = [0.0; 3];
    demand_w[tree.find("5v_b").unwrap()] = 0.5;
    let (before, after) = (tree.flow(7.4_f64, 25.0, |_| 1.0, &[]), tree.flow(7.4, 25.0, |_| 1.0, &demand_w));
    // 0.1 A more through the linear regulator: 0.74 W more from the battery.
    assert!((after.battery_w - before.battery_w - 0.74).abs() < 1e-9);
}

#[test]
fn a_rail_that_cannot_deliver_is_named_with_its_cause() {
    let tree = two_branches();
    // 5.2 V is too little for the linear 5 V and for the converter: the first from the battery is named.
    let refused = tree.solve(5.2, 25.0, |_| 1.0, &[]).unwrap_err();
    assert_eq!(refused.rail, "5v_a");
    assert_eq!(refused.to_string(), "rail `5v_a` cannot deliver: 5.200 V at its input, 6.000 V needed");
    // 12.6 V over the linear regulator: 7.6 V x 0.2 A x 100 K/W = 152 K.
    let refused = tree.solve(12.6, 25.0, |_| 1.0, &[]).unwrap_err();
    assert_eq!(refused.rail, "5v_b");
    assert!(matches!(refused.cause, Cause::TooHot { junction_degc, .. } if (junction_degc - 177.0).abs() < 1e-9));
    let mut rails = two_branches().rails().to_vec();
    rails[2].current_a_max = 0.03;
    let refused = PowerTree::new(rails).unwrap().solve(7.4, 25.0, |_| 1.0, &[]).unwrap_err();
    assert_eq!(refused.rail, "3v3");
    assert_eq!(refused.cause, Cause::OverCurrent { output_a: 0.0355, output_a_max: 0.03 });
    assert!(refused.to_string().ends_with("A asked, 0.030 A at most"), "{refused}");
}

/// 12 V, 1 ohm, 27 W: V^2 - 12 V + 27 = 0, V = 6 +- 3; 36 W is the most (V = 6), 36.1 W too much.
#[test]
fn a_constant_power_behind_a_resistance_takes_the_higher_voltage_or_is_refused() {
    let tree = |watts: f64| PowerTree::new(vec![rail("motor", "battery", wire(1.0), &[(ConsumerKind::Power, watts)])]).unwrap();
    let flow = tree(27.0).solve(12.0, 25.0, |_| 1.0, &[]).unwrap();
    assert!((flow.rails()[0].output_v - 9.0).abs() < 1e-9);
    assert!((flow.battery_w - 36.0).abs() < 1e-9 && (flow.loss_w() - 9.0).abs() < 1e-9);
    let near = tree(35.999).solve(12.0, 25.0, |_| 1.0, &[]).unwrap();
    assert!((near.rails()[0].output_v - (6.0 + 0.001_f64.sqrt())).abs() < 1e-6);
    let refused = tree(36.1).solve(12.0, 25.0, |_| 1.0, &[]).unwrap_err();
    assert_eq!(refused.cause, Cause::NoOperatingPoint);
    assert!(tree(36.1).flow(12.0_f64, 25.0, |_| 1.0, &[]).battery_w.is_finite());
}

#[test]
fn a_resistance_on_a_wire_is_a_divider_however_large() {
    let tree = PowerTree::new(vec![rail("lamp", "battery", wire(3.0), &[(ConsumerKind::Resistance, 1.0)])]).unwrap();
    let flow = tree.solve(12.0, 25.0, |_| 1.0, &[]).unwrap();
    assert!((flow.rails()[0].output_v - 3.0).abs() < 1e-12 && (flow.battery_a - 3.0).abs() < 1e-12);
}

#[test]
fn resistances_in_a_row_add_up() {
    // 0.5 + 0.5 ohm, 27 W: as one ohm above, at the end of a chain of two.
    let tree =
        PowerTree::new(vec![rail("plug", "battery", wire(0.5), &[]), rail("motor", "plug", wire(0.5), &[(ConsumerKind::Power, 27.0)])]);
    let flow = tree.unwrap().solve(12.0, 25.0, |_| 1.0, &[]).unwrap();
    assert!((flow.rails()[0].output_v - 10.5).abs() < 1e-9 && (flow.rails()[1].output_v - 9.0).abs() < 1e-9);
}

#[test]
fn a_channel_switches_and_scales_a_load() {
    let mut rails = two_branches().rails().to_vec();
    rails[1].loads[0].when = Some(Channel::LiftActive);
    let tree = PowerTree::new(rails).unwrap();
    let battery_w = |share: f64| tree.flow(7.4, 25.0, |_| share, &[]).battery_w;
    assert!((battery_w(1.0) - battery_w(0.0) - 1.48).abs() < 1e-9);
    assert!((battery_w(0.25) - battery_w(0.0) - 0.37).abs() < 1e-9);
    assert_eq!(battery_w(7.0), battery_w(1.0));
    assert_eq!(battery_w(-1.0), battery_w(0.0));
}

#[test]
fn derivatives_pass_through_the_tree() {
    let rails = vec![
        rail("plug", "battery", wire(0.4), &[(ConsumerKind::Current, 0.3)]),
        rail("5v", "plug", polynomial(5.0, 0.1, 5.4, 0.2), &[]),
        rail("3v3", "5v", ldo(3.3), &[]),
    ];
    let tree = PowerTree::new(rails).unwrap();
    let plain = |battery_v: f64, watts: f64| tree.flow(battery_v, 25.0, |_| 1.0, &[0.0, 0.0, watts]).battery_w;
    let demand_w = [Dual::from(0.0), Dual::from(0.0), variable(1.2, 1)];
    let dual = tree.flow(variable(9.0, 0), Dual::from(25.0), |_| Dual::from(1.0), &demand_w).battery_w;
    let nudge = 1e-5;
    let by_volts = (plain(9.0 + nudge, 1.2) - plain(9.0 - nudge, 1.2)) / (2.0 * nudge);
    let by_watts = (plain(9.0, 1.2 + nudge) - plain(9.0, 1.2 - nudge)) / (2.0 * nudge);
    assert!((derivative(&dual, 0) - by_volts).abs() < 1e-7, "{} and {by_volts}", derivative(&dual, 0));
    assert!((derivative(&dual, 1) - by_watts).abs() < 1e-7, "{} and {by_watts}", derivative(&dual, 1));
}

fn any_kind() -> impl Strategy<Value = RailKind> {
    let volts = 1.0..15.0_f64;
    let table = (volts.clone(), 0.05..0.99_f64, 0.05..0.99_f64, 0.05..1.0_f64).prop_map(|(output_v, light, heavy, spread)| {
        let rows = [vec![light, heavy], vec![light * spread, heavy * spread]];
        let table = EfficiencyTable::new(vec![5.0, 15.0], vec![0.05, 2.0], &rows).unwrap();
        RailKind::Switching(SwitchMode { output_v, input_v_min: 0.0, loss: ConverterLoss::Table(table) })
    });
    let polynomial =
        (volts.clone(), 0.0..1.0_f64, 0.0..2.0_f64, 0.0..2.0_f64).prop_map(|(v, fixed, drop, ohm)| polynomial(v, fixed, v + drop, ohm));
    let linear = (volts, 0.0..0.01_f64, 0.0..2.0_f64).prop_map(|(output_v, ground_a, dropout_v)| {
        RailKind::Linear(Ldo { output_v, ground_a, dropout_v, theta_ja_k_per_w: Some(60.0), junction_max_degc: 150.0 })
    });
    prop_oneof![table, polynomial, linear, (0.0..5.0_f64).prop_map(wire)]
}

proptest! {
    /// Any tree at any voltage gives numbers; power is conserved; and it is solved or refused by name.
    #[test]
    fn every_valid_tree_is_solved_or_refused_by_name(
        kinds in proptest::collection::vec((any_kind(), 0..100_usize), 1..=RAILS_MAX),
        loads in proptest::collection::vec((0..3_usize, 0.0..20.0_f64), RAILS_MAX),
        battery_v in 0.0..20.0_f64,
        degc in -20.0..60.0_f64,
    ) {
        let rails = kinds.into_iter().zip(&loads).enumerate().map(|(index, ((kind, parent), &(which, size)))| {
            let from = if parent % (index + 1) == 0 { "battery".to_owned() } else { format!("r{}", parent % (index + 1) - 1) };
            let load = match which {
                0 => (ConsumerKind::Current, 0.1 * size),
                1 => (ConsumerKind::Power, size),
                _ => (ConsumerKind::Resistance, 0.1 + size * size),
            };
            rail(&format!("r{index}"), &from, kind, &[load])
        }).collect();
        let tree = PowerTree::new(rails).unwrap();
        let flow = tree.flow(battery_v, degc, |_| 1.0, &[]);
        prop_assert!(flow.battery_w.is_finite() && flow.battery_w >= 0.0, "{}", flow.battery_w);
        prop_assert!((flow.load_w() + flow.loss_w() - flow.battery_w).abs() <= 1e-9 * flow.battery_w.max(1.0));
        for at in flow.rails() {
            prop_assert!(at.loss_w >= -1e-9 && at.output_v.is_finite() && at.output_a.is_finite());
        }
        match tree.solve(battery_v, degc, |_| 1.0, &[]) {
            Ok(solved) => {
                // What is said to work does: Ohm's law holds over every switch.
                for (at, rail) in solved.rails().iter().zip(tree.rails()) {
                    if let RailKind::Switch(switch) = &rail.kind {
                        let drop_v = at.input_v - at.output_v;
                        prop_assert!((drop_v - switch.resistance_ohm * at.output_a).abs() <= 1e-9 * (1.0 + at.input_v));
                    }
                }
            }
            Err(refused) => prop_assert!(tree.find(&refused.rail).is_some()),
        }
    }
}
