//! What holds for every plan, whatever the problem.

use std::collections::{BTreeMap, BTreeSet};

use energy::Estimate;
use energy::units::S_PER_H;
use proptest::collection::vec;
use proptest::option::weighted;
use proptest::prelude::*;
use proto::{RobotId, SpareId};
use statrs::distribution::{ContinuousCDF, Normal};

use super::{need, plan, problem, recharge, robot, station};
use crate::forecast::{Handling, Recharge};
use crate::scheduler::*;
use energy::Need;

prop_compose! {
    fn any_station(name: usize)(
        bays in vec(weighted(0.8, 0.0..3000.0), 0..4),
        spares in vec(0.0..1.0, 0..4),
        packs in vec(0.0..100.0, 0..4),
        busy in vec((0.0..600.0, 1.0..60.0), 0..4),
        times_s in (0.0..90.0, 0.0..90.0, 0.0..200.0),
        committed in (0.0..40.0, 0.0..2.0, 0.0..4000.0),
        swap_free_s in 0.0..500.0,
        out_of_order in weighted(0.1, Just("it has no power".to_owned())),
    ) -> StationView {
        let mut at_s = 0.0;
        let lift_busy = busy.iter().map(|(gap_s, span_s)| { let from_s = at_s + gap_s; at_s = from_s + span_s; (from_s, at_s) }).collect();
        let (load_s, unload_s, swap_s) = times_s;
        StationView {
            handling: Handling { load_s, unload_s, swap_s },
            lift_busy,
            swap_free_s,
            committed: Need { mean_wh: committed.0, shared_wh: vec![committed.1], own_variance: committed.1 },
            committed_until_s: committed.2,
            out_of_order,
            ..station(name, &bays, &spares, &packs)
        }
    }
}

fn any_option(stations: usize) -> impl Strategy<Value = OptionView> {
    (0..stations, 0.0..900.0, any::<bool>(), 60.0..6000.0, 0.0..40.0, 0.0..1.0).prop_map(
        |(station, travel_s, swap, charge_s, wh, per_s)| {
            let recharge = Recharge { charge_s, need: need(wh), breakdown_wh: BTreeMap::new() };
            let charging = Way::Recharge { to_soc: 0.98, recharge, charge_s_per_s: per_s, need_share_per_s: 1e-3 * per_s };
            OptionView { station, travel_s, way: if swap { Way::Swap { need: need(0.01 * wh) } } else { charging } }
        },
    )
}

fn any_robot(stations: usize) -> impl Strategy<Value = RobotView> {
    let options = if stations == 0 { Just(Vec::new()).boxed() } else { vec(any_option(stations), 0..4).boxed() };
    (0.0..1.0, 0.0..20_000.0, 0.0..9000.0, weighted(0.3, Just(())), options).prop_map(|(soc, empty_s, wanted_s, promised, options)| {
        RobotView { soc: Estimate::new(soc, 0.01), wanted_s, promised: promised.is_some(), ..robot(0, empty_s, options) }
    })
}

fn any_problem() -> impl Strategy<Value = Problem> {
    let sized = (0_usize..4).prop_flat_map(|count| {
        let stations: Vec<_> = (0..count).map(any_station).collect();
        (stations, vec(any_robot(count), 0..14), 0.5..0.999)
    });
    sized.prop_map(|(stations, mut robots, confidence)| {
        for (index, each) in robots.iter_mut().enumerate() {
            each.robot = robot(index, 0.0, Vec::new()).robot;
        }
        Problem { confidence, robots, stations }
    })
}

/// Times and energies are sums of a few numbers up to 1e5.
const ROUNDING: f64 = 1e-6;

fn disjoint(mut spans: Vec<(f64, f64)>) -> bool {
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    spans.windows(2).all(|pair| pair[0].1 <= pair[1].0 + ROUNDING)
}

fn check_station(problem: &Problem, index: usize, plan: &Plan) -> Result<(), TestCaseError> {
    let station = &problem.stations[index];
    let slots: Vec<&Slot> = plan.planned.iter().map(|planned| &planned.slot).filter(|slot| slot.station == index).collect();
    prop_assert!(slots.is_empty() || station.out_of_order.is_none());
    let Handling { load_s, unload_s, swap_s } = station.handling;

    // No bay twice at a time, and none that is out of order or not yet free.
    for bay in &station.bays {
        let spans: Vec<_> =
            slots.iter().filter(|slot| slot.bay.as_ref() == Some(&bay.bay)).map(|slot| (slot.start_s, slot.end_s)).collect();
        prop_assert!(spans.iter().all(|(start_s, _)| bay.free_s.is_some_and(|free_s| *start_s >= free_s)), "{bay:?} {spans:?}");
        prop_assert!(disjoint(spans.clone()), "{bay:?} twice: {spans:?}");
    }

    // The lift moves one robot at a time, those of services that have begun included.
    let recharges = slots.iter().filter(|slot| slot.bay.is_some());
    let moves = recharges.flat_map(|slot| [(slot.start_s, slot.start_s + load_s), (slot.end_s - unload_s, slot.end_s)]);
    let moves: Vec<_> = moves.chain(station.lift_busy.iter().copied()).filter(|(from_s, to_s)| to_s > from_s).collect();
    prop_assert!(disjoint(moves.clone()), "two robots on the lift: {moves:?}");

    // One exchange at a time, each with its own spare.
    let swaps: Vec<&&Slot> = slots.iter().filter(|slot| slot.spare.is_some()).collect();
    let spans: Vec<_> = swaps.iter().map(|slot| (slot.start_s, slot.end_s)).collect();
    prop_assert!(spans.iter().all(|(start_s, end_s)| *start_s >= station.swap_free_s && (end_s - start_s - swap_s).abs() < ROUNDING));
    prop_assert!(disjoint(spans));
    let spares: BTreeSet<&SpareId> = swaps.iter().filter_map(|slot| slot.spare.as_ref()).collect();
    prop_assert_eq!(spares.len(), swaps.len());
    prop_assert!(spares.iter().all(|spare| station.spares.iter().any(|known| known.spare == **spare)));

    // The packs hold what is promised, at the confidence; at even odds for promises that were
    // given before.
    let Some(last_s) = slots.iter().map(|slot| slot.end_s).max_by(f64::total_cmp) else { return Ok(()) };
    let hours = last_s.max(station.committed_until_s) / S_PER_H;
    let needs = slots.iter().fold(station.committed.clone(), |sum, slot| sum.plus(&slot.need)).plus(&station.overhead_per_h.scaled(hours));
    let usable_wh: f64 = station.packs.iter().map(|pack| pack.usable_wh.value).sum();
    let variance: f64 = station.packs.iter().map(|pack| pack.usable_wh.sigma.powi(2)).sum();
    let sigma_wh = (variance + needs.estimate().sigma.powi(2)).sqrt().max(1e-9);
    let probability = Normal::standard().cdf((usable_wh - needs.mean_wh) / sigma_wh);
    let was_promised = |robot: &RobotId| problem.robots.iter().any(|view| view.robot == *robot && view.promised);
    let newly = plan.planned.iter().any(|planned| planned.slot.station == index && !was_promised(&planned.robot));
    let asked = if newly { problem.confidence } else { 0.5 };
    prop_assert!(probability >= asked - ROUNDING, "promised {needs:?} of {usable_wh} Wh: {probability} instead of {asked}");
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn nothing_is_promised_twice_and_nobody_is_forgotten(problem in any_problem(), which in 0..policies().len()) {
        let policy = policies()[which];
        let plan = construct(&problem, policy);
        prop_assert_eq!(&plan, &construct(&problem, policy), "the same problem, the same plan");
        for index in 0..problem.stations.len() {
            check_station(&problem, index, &plan)?;
        }
        let answered: Vec<&RobotId> =
            plan.planned.iter().map(|planned| &planned.robot).chain(plan.rejected.iter().map(|rejected| &rejected.robot)).collect();
        prop_assert_eq!(answered.len(), problem.robots.len());
        prop_assert_eq!(answered.into_iter().collect::<BTreeSet<_>>().len(), problem.robots.len());
        for rejected in &plan.rejected {
            prop_assert!(!rejected.reasons.is_empty() && rejected.reasons.iter().all(|reason| !reason.is_empty()), "{rejected:?}");
        }
        for Planned { robot, slot, why } in &plan.planned {
            let view = problem.robots.iter().find(|view| view.robot == *robot).unwrap();
            let ways = view.options.iter().filter(|option| option.station == slot.station);
            let in_time = |option: &OptionView| slot.leave_s + option.travel_s <= slot.start_s + ROUNDING;
            prop_assert!(ways.clone().any(in_time), "{slot:?}");
            prop_assert!(slot.start_s >= view.wanted_s && slot.start_s <= view.empty_s && slot.end_s >= slot.start_s, "{slot:?}");
            prop_assert!(slot.bay.is_some() != slot.spare.is_some(), "{slot:?}");
            prop_assert!(why.len() >= 2, "{why:?}");
        }
    }

    #[test]
    fn whoever_was_promised_a_service_loses_nothing_to_newcomers(problem in any_problem()) {
        let whole = plan(&problem);
        let before = plan(&Problem { robots: problem.robots.iter().filter(|robot| robot.promised).cloned().collect(), ..problem.clone() });
        for old in &before.planned {
            let now = whole.planned.iter().find(|planned| planned.robot == old.robot);
            prop_assert_eq!(now.map(|planned| &planned.slot), Some(&old.slot));
        }
    }

    #[test]
    fn more_energy_in_a_pack_never_serves_fewer_robots(count in 1_usize..12, wh in 0.0..300.0, more_wh in 0.0..100.0) {
        let served = |wh: f64| {
            let robots = (0..count).map(|n| robot(n, 20_000.0, vec![recharge(0, 60.0)])).collect();
            plan(&problem(robots, vec![station(0, &[Some(0.0); 3], &[], &[wh])])).planned.len()
        };
        prop_assert!(served(wh) <= served(wh + more_wh));
    }
}
