//! Fleets in which it takes a while to find out who can be helped.

use super::*;

/// A crowded fleet: three stations with a bay or two, robots that can come to some of them, by a generator of numbers.
fn crowded(seed: u64) -> View {
    let mut state = seed;
    let mut dice = |most: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % most
    };
    let robots = (0..14).map(|n| {
        let mut ways = Vec::new();
        for station in 0..3 {
            if dice(3) > 0 {
                ways.push((station, 60.0 * (1 + dice(8)) as f64));
            }
        }
        if ways.is_empty() {
            ways.push((0, 120.0));
        }
        robot(&format!("r{n:02}"), 0.12 + 0.0064 * dice(100) as f64, &ways)
    });
    let robots = robots.collect();
    let stations = (0..3).map(|n| station(&format!("s{n}"), 1 + (n % 2), &[90.0 + 10.0 * n as f64, 90.0], &[])).collect();
    view(robots, stations)
}

#[test]
fn a_robot_that_can_be_helped_is_helped_though_it_takes_long_to_find_out_how() {
    let few = Settings { moves_per_robot: settings().moves_per_robot / 10, ..settings() };
    for seed in [49, 833] {
        let stranded = |settings: &Settings| solve(crowded(seed), settings, &Plan::default(), Effort::Whole).plan.quality.stranded;
        assert!(stranded(&settings()) < stranded(&few), "seed {seed}");
    }
}
