//! Passes against trying everything.

use std::collections::BTreeMap;

use super::*;
use crate::construct::{self, Order};
use crate::draft::Draft;
use crate::instance::Instance;
use crate::prices::{Level, Prices};
use crate::way::Ways;

/// Tries all ways of all robots from this one on beside those that are in the draft, and notes what each set costs at least.
fn try_all(draft: &mut Draft<'_, '_>, robot: usize, found: &mut BTreeMap<u32, i64>) {
    if robot == draft.chosen.len() {
        let served = (0..robot).filter(|&robot| draft.chosen[robot] != crate::draft::NONE);
        let set = served.clone().fold(0, |set, robot| set | 1 << robot);
        let cost: i64 = served.map(|robot| draft.cost_of(robot)).sum();
        found.entry(set).and_modify(|least| *least = cost.min(*least)).or_insert(cost);
        return;
    }
    try_all(draft, robot + 1, found);
    let choices = draft.ways.of(robot);
    for (way, place) in choices.ways.iter().zip(0..) {
        if draft.books[usize::from(way.station)].fits(choices, way) {
            draft.serve(robot, place);
            try_all(draft, robot + 1, found);
            draft.release(robot);
        }
    }
}

#[test]
fn a_wide_pass_finds_the_least_cost_of_every_set() {
    for (text, few, every) in [
        (include_str!("../../../tests/instances/12-2-1.json"), 5, 17),
        (include_str!("../../../tests/instances/16-2-1.json"), 5, 23),
        (include_str!("../../../tests/instances/6-1-1.json"), 6, 11),
    ] {
        let instance = Instance::parse(text).expect("a valid instance");
        let all = Ways::all(&instance.problem);
        let mut plan = Draft::new(&all);
        construct::greedy(&mut plan, &construct::ranked(&all, Order::Deadline), 0.0);
        for station in 0..instance.problem.stations.len() {
            // Few ways of few robots, early and late, so that all of them can be tried with all others.
            let mut left = few;
            let kept: Vec<Vec<u32>> = (0..instance.problem.robots.len())
                .map(|robot| {
                    let here = |way: &u32| usize::from(all.of(robot).ways[*way as usize].station) == station;
                    let ways: Vec<u32> = (0..all.of(robot).ways.len() as u32).filter(here).step_by(every).take(7).collect();
                    left -= i32::from(!ways.is_empty());
                    if left >= 0 { ways } else { Vec::new() }
                })
                .collect();
            let worth: Vec<i64> = (0..kept.len()).map(|robot| i64::from(all.of(robot).unserved_cost)).collect();
            let (few, _) = all.apart(station, &kept, 1, &worth).expect("costs that can be counted");
            let mut prices = Prices::new(&few, Level::Cost { stranded_max: 0 });
            (0..20).for_each(|_| {
                prices.improve(0);
            });
            let mut found = BTreeMap::new();
            try_all(&mut Draft::new(&few), 0, &mut found);
            assert!(found.len() > 4);
            for room in [20, 100, 100_000] {
                let reduced = prices.reduced(prices.bound() + room);
                let beyond = |set: u32, cost: i64| {
                    let others = (0..32).zip(&reduced.unserved).filter(|(robot, _)| set >> robot & 1 == 0);
                    reduced.column(station, set, cost) + others.map(|(_, unserved)| unserved).sum::<i64>()
                };
                let site = Site::new(&few, station, &reduced).expect("a small station");
                let passed = pass(&site, 100_000, |_| true);
                assert!(passed.complete);
                let mut planned: BTreeMap<u32, i64> = BTreeMap::new();
                for plan in &passed.plans {
                    let mut draft = Draft::new(&few);
                    let mut ways = plan.ways.clone();
                    ways.sort_unstable_by_key(|&(robot, way)| few.of(robot as usize).ways[way as usize].start);
                    for &(robot, way) in &ways {
                        let choices = few.of(robot as usize);
                        assert!(draft.books[station].fits(choices, &choices.ways[way as usize]), "{ways:?}");
                        draft.serve(robot as usize, way);
                    }
                    let cost: i64 = ways.iter().map(|&(robot, _)| draft.cost_of(robot as usize)).sum();
                    assert_eq!(plan.reduced, beyond(plan.robots, cost));
                    planned.entry(plan.robots).and_modify(|least| *least = cost.min(*least)).or_insert(cost);
                }
                let has_room = |&(&set, &cost): &(&u32, &i64)| beyond(set, cost) <= reduced.room;
                let expected: BTreeMap<u32, i64> = found.iter().filter(has_room).map(|(set, cost)| (*set, *cost)).collect();
                assert_eq!(planned, expected, "station {station} room {room}");
            }
        }
    }
}
