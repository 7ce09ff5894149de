//! Any problem: small, often tight, sometimes with nothing to plan with.

use planner::problem::{Battery, Chance, Charger, Critical, LeftPacks, Ongoing, Pack, Problem, Robot, Segment, Spare, Station, Travel};
use proptest::collection::vec;
use proptest::prelude::*;

/// A small battery: three segments of taper.
pub fn battery() -> Battery {
    let segment = |below, gain, draw, draw_bare| Segment { below, gain, gain_bare: gain, draw, draw_bare };
    Battery {
        capacity: 1000,
        floor: 100,
        min_gain: 80,
        targets: vec![600, 800, 970],
        chargers: vec![Charger {
            swap_energy: 960,
            again_energy: 985,
            curve: vec![segment(800, 60, 75, 66), segment(930, 40, 52, 45), segment(1000, 15, 24, 18)],
            owed: Vec::new(),
        }],
    }
}

fn pack(name: usize) -> impl Strategy<Value = Pack> {
    (0_i64..6000, 0_i64..300, prop_oneof![3 => Just(0_i64), 1 => 1_i64..30]).prop_map(move |(remaining, reserve, available_from)| Pack {
        name: name.to_string(),
        remaining,
        reserve,
        available_from,
    })
}

/// A station that can feed itself: its first pack is large enough for that.
pub fn station() -> impl Strategy<Value = Station> {
    let packs = (pack(0), vec(pack(1), 0..4));
    let sizes = (0_u32..4, 0_i64..3, 0_i64..3, 0_i64..60, 0_u32..3, 0_u32..3, 0_u32..4);
    let opens = prop_oneof![3 => Just(0), 1 => 0_u32..20];
    let away = vec((0_u32..40, 0_u32..20).prop_map(|(from, ticks)| from..from + ticks), 0..3);
    let away = prop_oneof![3 => Just(Vec::new()), 1 => away];
    let away = (away, 0_u32..4);
    let spare = (0_u32..40, prop_oneof![2 => Just(0_u16), 1 => Just(1)]).prop_map(|(ready, kind)| Spare { ready, kind });
    (packs, sizes, 0_i64..300, vec(spare, 0..4), any::<bool>(), opens, away).prop_map(
        |(
            (mut first, mut more),
            (bays, lift_slots, swap_slots, switch_cost, load_ticks, unload_ticks, swap_ticks),
            power,
            spares,
            busy,
            opens,
            (away, away_slack),
        )| {
            let ongoing = Ongoing { bay: Some(0), from: 0, load_ticks: 0, until: 7, draw: 60, unload_ticks: 1 };
            let ongoing = if busy && bays > 0 && lift_slots > 0 { vec![ongoing] } else { Vec::new() };
            first.available_from = 0;
            first.remaining += first.reserve + 5 * 40 + 7 * 60;
            more.iter_mut().zip(1..).for_each(|(pack, name)| pack.name = format!("{name}"));
            Station {
                name: "any".to_owned(),
                charger: 0,
                opens,
                away,
                away_slack,
                bays,
                lift_slots,
                swap_slots,
                hotel: 5,
                p_max: 65 + power,
                switch_cost,
                load_ticks,
                load_draw: 30,
                unload_ticks,
                unload_draw: 20,
                swap_ticks,
                swap_draw: 15,
                spares,
                left_packs: LeftPacks::AsPlanned,
                chance: None,
                packs: std::iter::once(first).chain(more).collect(),
                ongoing,
            }
        },
    )
}

fn robot(stations: usize) -> impl Strategy<Value = Robot> {
    let critical = proptest::option::of((0_i64..40, 0_i64..12, 1_i64..5));
    let spares = prop_oneof![4 => Just(Some(0_u16)), 2 => Just(Some(1)), 1 => Just(None)];
    // A way may take less than as much work, and more than the robot has.
    let extra = (-20_i64..60, 0_i64..30);
    let travel = vec(proptest::option::of((0_u32..9, extra, spares)), stations);
    (0_i64..=1000, 0_i64..30, 1_i64..8, 0_i64..60, 1_i64..4, critical, travel, 0_usize..3).prop_map(
        |(energy, drain, caution, mission_end, weight, critical, travel, lowest_target)| Robot {
            name: "any".to_owned(),
            battery: 0,
            not_before: 0,
            wanted: None,
            held: false,
            lowest_target,
            energy,
            drain,
            drain_hi: drain + caution,
            drain_served: drain + caution,
            mission_end,
            weight,
            critical: critical.map(|(from, length, weight)| Critical { from, to: from + length, weight }),
            travel: travel
                .into_iter()
                .enumerate()
                .filter_map(|(station, reach)| {
                    let (ticks, (extra, caution), spares) = reach?;
                    // What a way takes is more than nothing.
                    let extra = extra.max(-drain * i64::from(ticks));
                    Some(Travel { station, ticks, extra, extra_hi: extra + caution, variance: 0.0, spares })
                })
                .collect(),
            beyond: Vec::new(),
        },
    )
}

/// A problem that can be planned.
pub fn problem() -> impl Strategy<Value = Problem> {
    let owed = prop_oneof![Just(Vec::new()), Just(vec![6, 3, 0])];
    (vec(station(), 0..3), owed).prop_flat_map(|(stations, owed)| {
        vec(robot(stations.len()), 0..14).prop_map(move |robots| Problem {
            name: "any".to_owned(),
            tick_s: 60,
            horizon: 40,
            capacity_target: 1,
            units_per_wh: 1000,
            batteries: vec![Battery {
                chargers: battery().chargers.into_iter().map(|charger| Charger { owed: owed.clone(), ..charger }).collect(),
                ..battery()
            }],
            stations: stations.clone(),
            robots,
        })
    })
}

/// A problem whose stations' packs are not known for certain.
pub fn doubtful() -> impl Strategy<Value = Problem> {
    let doubt = (0.0_f64..400.0, 0.0_f64..0.2, 0_i64..12, 0_i64..600);
    (problem(), doubt, vec(any::<bool>(), 14), vec(0.0_f64..60.0, 14)).prop_map(|(mut problem, (sigma, share, hotel, begun), held, own)| {
        for station in &mut problem.stations {
            (station.hotel, station.switch_cost) = (0, 0);
            // So little that what is there at first is short now and then, and what comes later is needed.
            station.packs.iter_mut().for_each(|pack| pack.remaining /= 3);
            let mut shared = [[0.0; 3]; 3];
            shared[2][2] = share * share;
            station.chance = Some(Chance { quantile: 1.645, quantile_held: 0.0, hotel, begun, variance: sigma * sigma, shared });
        }
        for ((robot, held), own) in problem.robots.iter_mut().zip(held).zip(own) {
            robot.held = held;
            robot.travel.iter_mut().for_each(|travel| travel.variance = own * own);
        }
        problem
    })
}
