//! How many robots the packs can serve from what they hold: energy alone, no time, no bays.
//!
//! One service charges to the problem's `capacity_target` on earliest arrival. A pack alone serves
//! most if it takes the smallest needs first, which is exact. Together the robots are shared out:
//! by prices on each station's energy, which also bound from above what any sharing reaches.

use crate::packing::share_more;
use crate::problem::Problem;
use crate::way::charge_need;

/// What the packs can serve.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Capacity {
    /// `(station, pack, most robots that it could serve alone)`, exact.
    pub packs: Vec<(usize, usize, usize)>,
    /// `(robot, station, pack)`: each robot wholly from one pack.
    pub atomic: Vec<(usize, usize, usize)>,
    /// No such sharing serves more.
    pub atomic_bound: usize,
    /// Robots served if a service may be paid by several packs of its station.
    pub split: usize,
    /// No such sharing serves more.
    pub split_bound: usize,
}

/// A robot's need at one station, mWh.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Need {
    pub(crate) station: usize,
    pub(crate) energy: i64,
}

/// What the problem's packs can serve.
#[must_use]
pub fn capacity(problem: &Problem) -> Capacity {
    let needs: Vec<Vec<Need>> = (0..problem.robots.len()).map(|robot| needs(problem, robot)).collect();
    let mut at: Vec<Vec<i64>> = vec![Vec::new(); problem.stations.len()];
    for need in needs.iter().flatten() {
        at[need.station].push(need.energy);
    }
    let mut found = Capacity::default();
    let mut pools = Vec::new();
    let mut most = Vec::new();
    for (station, sizes) in at.iter_mut().enumerate() {
        sizes.sort_unstable();
        let mut alone = 0;
        for (pack, energy) in problem.stations[station].packs.iter().map(|pack| pack.usable().max(0)).enumerate() {
            let served = fill(sizes, energy);
            found.packs.push((station, pack, served));
            alone += served;
        }
        let pool: i64 = problem.stations[station].packs.iter().map(|pack| pack.usable().max(0)).sum();
        pools.push(pool);
        most.push((alone.min(sizes.len()), fill(sizes, pool)));
    }
    // A pack below its reserve serves nobody, not even who needs nothing.
    let packs = problem.stations.iter().enumerate().flat_map(|(station, at)| at.packs.iter().enumerate().map(move |held| (station, held)));
    let bins: Vec<(usize, usize, i64)> =
        packs.filter(|(_, (_, held))| held.usable() >= 0).map(|(station, (pack, held))| (station, pack, held.usable())).collect();
    let pooled: Vec<(usize, usize, i64)> = pools.iter().enumerate().map(|(station, &pool)| (station, 0, pool)).collect();
    let in_need = needs.iter().filter(|needs| !needs.is_empty()).count();
    let (split_bound, prices) = bound(&needs, &pools, &most.iter().map(|&(_, split)| split).collect::<Vec<_>>());
    let (atomic_bound, _) = bound(&needs, &pools, &most.iter().map(|&(atomic, split)| atomic.min(split)).collect::<Vec<_>>());
    found.split_bound = split_bound.min(in_need);
    found.atomic_bound = atomic_bound.min(found.split_bound);
    found.atomic = share(&needs, &bins, &prices, found.atomic_bound);
    found.split = share(&needs, &pooled, &prices, found.split_bound).len().max(found.atomic.len());
    found
}

/// What one service of a robot takes at each station where it can have one.
fn needs(problem: &Problem, robot: usize) -> Vec<Need> {
    let battery = problem.battery(robot);
    let Some(&target) = battery.targets.get(problem.capacity_target) else { return Vec::new() };
    let robot = &problem.robots[robot];
    // Energy alone: when the horizon ends does not matter.
    let here = robot.travel.iter().chain(&robot.beyond).filter_map(|travel| {
        let (station, soonest) = (&problem.stations[travel.station], problem.soonest(travel));
        let energy = robot.left_at(travel, soonest);
        if i64::from(soonest) > robot.last_start(travel, battery.floor) || target - energy < robot.least_gain(battery) {
            return None;
        }
        let handling = i64::from(station.load_ticks) * station.load_draw + i64::from(station.unload_ticks) * station.unload_draw;
        Some(Need { station: travel.station, energy: handling + charge_need(battery, station.charger, energy, target) })
    });
    here.collect()
}

/// How many of the sizes, ascending, an amount holds.
fn fill(sizes: &[i64], energy: i64) -> usize {
    let mut left = energy;
    sizes
        .iter()
        .take_while(|&&size| {
            left -= size;
            left >= 0
        })
        .count()
}

/// Steps of the prices.
const STEPS: u32 = 200;
/// Whole prices: so many make one robot.
const UNIT: i64 = 1 << 40;

/// An upper bound on the robots served, by prices on each station's energy, and these prices.
///
/// At most `most[s]` robots are served at station s, each only if one robot is worth its energy.
fn bound(needs: &[Vec<Need>], pools: &[i64], most: &[usize]) -> (usize, Vec<i64>) {
    let mut prices: Vec<f64> = vec![0.0; pools.len()];
    let (mut best, mut best_prices) = (i128::from(UNIT) * most.iter().sum::<usize>() as i128, vec![0; pools.len()]);
    for step in 0..STEPS {
        let whole: Vec<i64> = prices.iter().map(|price| (price * UNIT as f64) as i64).collect();
        let mut used = vec![0_i64; pools.len()];
        let mut value: i128 = whole.iter().zip(pools).map(|(&price, &pool)| i128::from(price) * i128::from(pool)).sum();
        for needs in needs {
            let worth = |need: &Need| i128::from(UNIT) - i128::from(whole[need.station]) * i128::from(need.energy);
            if let Some(need) = needs.iter().max_by_key(|need| worth(need)).filter(|need| worth(need) > 0) {
                value += worth(need);
                used[need.station] += need.energy;
            }
        }
        if value < best {
            (best, best_prices) = (value, whole);
        }
        let reach = 1.0 / (1.0 + f64::from(step) * 0.15);
        for (station, price) in prices.iter_mut().enumerate() {
            let pool = pools[station].max(1) as f64;
            let over = (used[station] as f64 - pool) / pool;
            *price = (*price + reach * 3e-5 * over.clamp(-1.0, 2.0)).max(0.0);
        }
    }
    ((best / i128::from(UNIT)) as usize, best_prices)
}

/// Robots up to which all ways of sharing them out are tried.
const FEW: usize = 32;

/// Shares robots out to bins `(station, pack, energy)`: smallest priced need first, each to the bin
/// that it fills best; then room is made for who is left by moving one other, and where that serves fewer than `most` robots, of few
/// robots all ways are tried.
fn share(needs: &[Vec<Need>], bins: &[(usize, usize, i64)], prices: &[i64], most: usize) -> Vec<(usize, usize, usize)> {
    let mut at = vec![Vec::new(); prices.len()];
    for (bin, &(station, _, _)) in bins.iter().enumerate() {
        at[station].push(bin);
    }
    let order = |priced: bool| -> Vec<usize> {
        let key = |robot: &usize| {
            needs[*robot]
                .iter()
                .map(
                    |need| if priced { i128::from(prices[need.station].max(1)) * i128::from(need.energy) } else { i128::from(need.energy) },
                )
                .min()
        };
        let mut order: Vec<usize> = (0..needs.len()).filter(|&robot| !needs[robot].is_empty()).collect();
        order.sort_by_key(|robot| (key(robot), *robot));
        order
    };
    let tried = [true, false].map(|priced| {
        let mut left: Vec<i64> = bins.iter().map(|&(_, _, energy)| energy).collect();
        let mut place: Vec<Option<usize>> = vec![None; needs.len()];
        let order = order(priced);
        for &robot in &order {
            place[robot] = best_bin(&needs[robot], &at, &left, prices, priced);
            take(&needs[robot], bins, &mut left, place[robot]);
        }
        let mut held: Vec<Vec<usize>> = vec![Vec::new(); bins.len()];
        for (robot, bin) in place.iter().enumerate().filter_map(|(robot, bin)| Some((robot, (*bin)?))) {
            held[bin].push(robot);
        }
        for &robot in order.iter().filter(|&&robot| place[robot].is_none()).collect::<Vec<_>>() {
            make_room(robot, needs, &at, &mut left, (&mut place, &mut held));
        }
        place
    });
    let mut best = tried.into_iter().max_by_key(|place| place.iter().flatten().count()).unwrap_or_default();
    if best.iter().flatten().count() < most && needs.len() <= FEW {
        best = share_more(needs, bins, &at, best, most);
    }
    let assigned = best.iter().enumerate().filter_map(|(robot, bin)| bin.map(|bin| (robot, bins[bin].0, bins[bin].1)));
    assigned.collect()
}

fn take(needs: &[Need], bins: &[(usize, usize, i64)], left: &mut [i64], bin: Option<usize>) {
    if let Some(bin) = bin
        && let Some(need) = needs.iter().find(|need| need.station == bins[bin].0)
    {
        left[bin] -= need.energy;
    }
}

fn best_bin(needs: &[Need], at: &[Vec<usize>], left: &[i64], prices: &[i64], priced: bool) -> Option<usize> {
    let fitting = needs.iter().flat_map(|need| at[need.station].iter().map(move |&bin| (need, bin)));
    let fitting = fitting.filter(|(need, bin)| left[*bin] >= need.energy);
    let key = |need: &Need, bin: usize| {
        let paid = if priced { i128::from(prices[need.station].max(1)) * i128::from(need.energy) } else { i128::from(need.energy) };
        (paid, left[bin] - need.energy, bin)
    };
    fitting.min_by_key(|&(need, bin)| key(need, bin)).map(|(_, bin)| bin)
}

/// Moves one robot out of a bin to another if that lets `robot` in. `held` names the robots in each bin.
fn make_room(
    robot: usize,
    needs: &[Vec<Need>],
    at: &[Vec<usize>],
    left: &mut [i64],
    (place, held_by): (&mut [Option<usize>], &mut [Vec<usize>]),
) {
    for need in &needs[robot] {
        for &bin in &at[need.station] {
            for among in 0..held_by[bin].len() {
                let other = held_by[bin][among];
                let Some(held) = needs[other].iter().find(|held| held.station == need.station) else { continue };
                if left[bin] + held.energy < need.energy {
                    continue;
                }
                let elsewhere = needs[other].iter().flat_map(|need| at[need.station].iter().map(move |&to| (need, to)));
                let found = elsewhere.filter(|&(need, to)| to != bin && left[to] >= need.energy).map(|(need, to)| (need.energy, to)).min();
                if let Some((energy, to)) = found {
                    left[to] -= energy;
                    left[bin] += held.energy - need.energy;
                    place[other] = Some(to);
                    place[robot] = Some(bin);
                    held_by[to].push(other);
                    held_by[bin][among] = robot;
                    return;
                }
            }
        }
    }
}
