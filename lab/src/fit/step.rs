//! One damped step within bounds.

use nalgebra::{DMatrix, DVector};

/// Fall of the sum of squares that the derivatives promise for a step.
pub(crate) fn promised(normal: &DMatrix<f64>, gradient: &DVector<f64>, step: &DVector<f64>) -> f64 {
    -(2.0 * gradient.dot(step) + step.dot(&(normal * step)))
}

/// Turns of [`damped_step`] for each parameter: every one binds a parameter or lets one go.
const TURNS: usize = 4;
/// Share of a slope by which rounding may pull.
const ROUNDING: f64 = 1e-10;

/// The step within the bounds of which the damped derivatives promise most: a convex quadratic in a
/// box, by an active set (Nocedal and Wright, Numerical Optimization, 2006, section 16.5). A
/// parameter that meets its bound on the way rests there and the others are asked again; one that
/// rests is let go where the slope pulls it inside. Cut off alone, a step of parameters that
/// belong together would lead nowhere, or up.
pub(crate) fn damped_step(
    normal: &DMatrix<f64>,
    gradient: &DVector<f64>,
    scale: &[f64],
    damping: f64,
    moving: &[usize],
    at: &[f64],
    bounds: &[(f64, f64)],
) -> DVector<f64> {
    let mut system = normal.clone();
    for (index, &scale) in scale.iter().enumerate() {
        // A parameter that nothing depends on stays where it is.
        system[(index, index)] += if scale > 0.0 { damping * scale } else { 1.0 };
    }
    let room = |index: usize| (bounds[index].0 - at[index], bounds[index].1 - at[index]);
    let (mut step, mut inside) = (DVector::zeros(at.len()), moving.to_vec());
    for _ in 0..TURNS * at.len() {
        let slope = gradient + &system * &step;
        let part = DMatrix::from_fn(inside.len(), inside.len(), |i, j| system[(inside[i], inside[j])]);
        let Some(cholesky) = part.cholesky() else { return step };
        let change = cholesky.solve(&DVector::from_fn(inside.len(), |i, _| -slope[inside[i]]));
        // The share of the change after which a parameter is at its bound.
        let share = |i: usize| {
            let (low, high) = room(inside[i]);
            let end = if change[i] < 0.0 { low } else { high };
            if change[i] == 0.0 { f64::INFINITY } else { (end - step[inside[i]]) / change[i] }
        };
        let shares = (0..inside.len()).map(|i| (i, share(i)));
        let meets = shares.filter(|(_, share)| *share < 1.0).min_by(|a, b| a.1.total_cmp(&b.1));
        let whole = meets.map_or(1.0, |(_, share)| share.max(0.0));
        for (&index, change) in inside.iter().zip(change.iter()) {
            let (low, high) = room(index);
            step[index] = (step[index] + whole * change).clamp(low, high);
        }
        if let Some((i, _)) = meets {
            let index = inside.remove(i);
            step[index] = if change[i] < 0.0 { room(index).0 } else { room(index).1 };
            continue;
        }
        let pulled = |index: usize| {
            let ((low, high), slope) = (room(index), gradient[index] + system.row(index).tr_dot(&step));
            let inwards = if step[index] <= low { -slope } else { slope };
            (low < high && inwards > ROUNDING * gradient[index].abs()).then(|| (index, inwards / system[(index, index)].sqrt()))
        };
        let resting = (0..at.len()).filter(|index| !inside.contains(index));
        match resting.filter_map(pulled).max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((index, _)) => inside.push(index),
            None => return step,
        }
    }
    step
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};

    /// At the least of a convex function in a box the slope is nil inside, and pushes against a bound
    /// (Karush, Kuhn and Tucker).
    #[test]
    fn no_other_step_within_the_bounds_promises_more() {
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        for count in [1, 2, 5, 12, 30] {
            for _ in 0..50 {
                let rows = DMatrix::from_fn(count + 2, count, |_, _| random.random_range(-1.0..1.0));
                // Parameters that nearly do the same.
                let rows = &rows + DMatrix::from_fn(count + 2, count, |i, _| 3.0 * rows[(i, 0)]);
                let normal = rows.tr_mul(&rows);
                let gradient = DVector::from_fn(count, |_, _| random.random_range(-1.0..1.0));
                let bounds: Vec<(f64, f64)> =
                    (0..count).map(|_| (random.random_range(-1.0..-0.1), random.random_range(0.1..1.0))).collect();
                let at: Vec<f64> = bounds
                    .iter()
                    .map(|&(min, max)| match random.random_range(0..3) {
                        0 => min,
                        1 => max,
                        _ => 0.0,
                    })
                    .collect();
                let (scale, damping): (Vec<f64>, f64) = (normal.diagonal().iter().copied().collect(), 1e-3);
                let step = damped_step(&normal, &gradient, &scale, damping, &(0..count).collect::<Vec<_>>(), &at, &bounds);
                assert!(promised(&normal, &gradient, &step) >= 0.0);
                for index in 0..count {
                    let slope = gradient[index] + (&normal * &step)[index] + damping * scale[index] * step[index];
                    let x = at[index] + step[index];
                    let (min, max) = bounds[index];
                    assert!(x >= min - 1e-12 && x <= max + 1e-12, "{x} of {min}..{max}");
                    let right = if x <= min + 1e-12 {
                        slope > -1e-7
                    } else if x >= max - 1e-12 {
                        slope < 1e-7
                    } else {
                        slope.abs() < 1e-7
                    };
                    assert!(right, "{count} numbers, number {index} at {x} of {min}..{max}: slope {slope}");
                }
            }
        }
    }
}
