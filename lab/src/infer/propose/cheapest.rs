//! Viterbi's way through two states.

/// The way through two states of least cost: for each row its log and what either state costs there, and what a change costs.
/// A log begins in either.
pub(super) fn cheapest(logs: &[usize], costs: &[[f64; 2]], change: f64) -> Vec<bool> {
    let mut sums = [0.0, 0.0];
    // For each row and state, the state of the row before.
    let mut from: Vec<[bool; 2]> = Vec::with_capacity(costs.len());
    for (row, own) in costs.iter().enumerate() {
        let change = if row > 0 && logs[row - 1] == logs[row] { change } else { 0.0 };
        let step = |state: usize| {
            let (stays, comes) = (sums[state], sums[1 - state] + change);
            if comes < stays { (comes, state == 0) } else { (stays, state == 1) }
        };
        let [off, on] = [step(0), step(1)];
        from.push([off.1, on.1]);
        sums = [off.0 + own[0], on.0 + own[1]];
    }
    let mut state = sums[1] < sums[0];
    let mut there = vec![false; costs.len()];
    for row in (0..costs.len()).rev() {
        there[row] = state;
        state = from[row][usize::from(state)];
    }
    there
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};

    /// Against all ways there are: ten rows of two logs.
    #[test]
    fn no_other_way_is_cheaper() {
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        for change in [0.0, 0.3, 1.0, 5.0] {
            for _ in 0..100 {
                let logs: Vec<usize> = (0..10).map(|row| usize::from(row >= 4)).collect();
                let costs: Vec<[f64; 2]> = (0..10).map(|_| [random.random_range(0.0..1.0), random.random_range(0.0..1.0)]).collect();
                let cost = |way: &[bool]| {
                    let own: f64 = way.iter().zip(&costs).map(|(there, costs)| costs[usize::from(*there)]).sum();
                    let changes = (1..10).filter(|&row| way[row] != way[row - 1] && logs[row] == logs[row - 1]).count();
                    own + changes as f64 * change
                };
                let ways = (0..1_u32 << 10).map(|number| (0..10).map(|row| number >> row & 1 == 1).collect::<Vec<bool>>());
                let least = ways.map(|way| cost(&way)).fold(f64::INFINITY, f64::min);
                assert!((cost(&cheapest(&logs, &costs, change)) - least).abs() < 1e-12);
            }
        }
    }
}
