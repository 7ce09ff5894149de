//! What the noise of a current adds up to in the count of charge, and what that does to what was found.
//!
//! The same as [`crate::fit::count`] says of a plain fit, through the noise of a state: with q_j the deviation of the charge that row j
//! counts, D what a step of charge does to every judged row, W what turns rows into innovations, and G what each innovation moves the unknowns by,
//!
//! `Cov = Σ_j q_j² g_j g_jᵀ`,  `g_j = G W (D after j)`.
//!
//! Rows that follow each other are taken together, as many as count a like part of the walk.

use std::sync::Arc;

use energy::{EffectSpec, Facts, Model};
use nalgebra::{DMatrix, DVector};

use super::evidence::Evidence;
use super::frame::Frame;
use super::lens::Lens;
use super::state::State;
use crate::fit::count::{NOTHING, STEP_SOC, steps};
use crate::measurement::rows_after_gaps;
use crate::prepare::Prepared;

/// Parts of which a walk is made, about. That a part begins all at once, and not row by row, is a 24th of it early.
const PARTS: usize = 24;

/// Share of the squared distance that is left where walks are most of the deviations.
const MOST: f64 = 0.5;

/// A part of a walk: from when on its charge is counted, s, and its variance, as state of charge squared.
type Part = (f64, f64);

impl State {
    /// What the walks of all logs add to the covariance of the unknowns; `influence` is what each innovation of the lens moves each of them by.
    pub(super) fn of_counts(&self, lens: &Lens, influence: &DMatrix<f64>) -> DMatrix<f64> {
        let walks: Vec<Vec<Part>> = self.frame.evidence.logs.iter().map(|log| self.walk(log, true)).collect();
        self.of_walks(&walks, lens, influence)
    }

    fn of_walks(&self, walks: &[Vec<Part>], lens: &Lens, influence: &DMatrix<f64>) -> DMatrix<f64> {
        let evidence = &self.frame.evidence;
        let mut sum = DMatrix::zeros(influence.nrows(), influence.nrows());
        if walks.iter().all(Vec::is_empty) {
            return sum;
        }
        let slopes = self.by_charge();
        for (log, parts) in walks.iter().enumerate() {
            for &(from_s, variance) in parts {
                let mut moved = DVector::zeros(influence.nrows());
                for (segment, filter) in evidence.segments.iter().zip(&lens.filters).filter(|(segment, _)| segment.log == log) {
                    let own = segment.time_s.iter().zip(&slopes[segment.range()]);
                    let mut after: Vec<f64> = own.map(|(&time_s, slope)| if time_s >= from_s { *slope } else { 0.0 }).collect();
                    filter.apply(&mut after);
                    moved.gemv(1.0, &influence.columns(segment.begin, after.len()), &DVector::from_vec(after), 1.0);
                }
                sum.ger(variance, &moved, &moved, 1.0);
            }
        }
        sum
    }

    /// Whether an effect seems certain because the walks of all logs are not counted: with them in the deviations its sizes are together not far
    /// enough from where it does nothing, `least` squared deviations beyond what so many numbers cost, and they are most of these deviations. A walk
    /// looks like an offset of the current, a leak or another capacity, and no row says that it is none. What flowed in gaps is what was said of them.
    pub(super) fn is_made_of_counts(&self, spec: &EffectSpec, least: f64) -> bool {
        let frame = &self.frame;
        let walks: Vec<Vec<Part>> = frame.evidence.logs.iter().map(|log| self.walk(log, false)).collect();
        let size = |(place, &index): (usize, &usize)| {
            let parameter = &frame.model.parameters()[index];
            let own = spec.parameters.iter().find(|own| parameter.effect == spec.id && own.name == parameter.name);
            Some((place, self.x[place] - own?.null?))
        };
        let sizes: Vec<(usize, f64)> = frame.free.iter().enumerate().filter_map(size).collect();
        if walks.iter().all(Vec::is_empty) || sizes.is_empty() {
            return false;
        }
        let (lens, covariance) = (self.lens(&self.noise), self.covariance());
        let counted = &covariance + self.of_walks(&walks, &lens, &(&covariance * &lens.design));
        let off = DVector::from_iterator(sizes.len(), sizes.iter().map(|(_, off)| *off));
        let cost = sizes.len() as f64 * (frame.evidence.rows() as f64).ln();
        let distance = |covariance: &DMatrix<f64>| {
            let of_sizes = DMatrix::from_fn(sizes.len(), sizes.len(), |i, j| covariance[(sizes[i].0, sizes[j].0)]);
            of_sizes.cholesky().map(|factor| off.dot(&factor.solve(&off)))
        };
        let both = distance(&counted).zip(distance(&covariance));
        both.is_some_and(|(counted, plain)| counted - cost < least && counted < MOST * plain)
    }

    /// The walk of one log, perhaps without what the row after a gap says of that; empty where it comes to nothing beside the noise of its rows.
    fn walk(&self, log: &Prepared, over_gaps: bool) -> Vec<Part> {
        let model: &Model = &self.frame.model;
        let Facts::Battery(facts) = &model.facts else { return Vec::new() };
        let mut steps = steps(model, log, facts.capacity_ah);
        if !over_gaps {
            rows_after_gaps(&log.time_s, &log.readings).into_iter().for_each(|row| steps[row] = 0.0);
        }
        let whole: f64 = steps.iter().map(|step| step * step).sum();
        let volts_per_soc = facts.stored_wh() / facts.capacity_ah;
        let most = |target: &crate::prepare::Target| whole.sqrt() * volts_per_soc / self.frame.evidence.floor(target.channel);
        if log.targets.iter().map(most).fold(0.0, f64::max) < NOTHING {
            return Vec::new();
        }
        parts(&steps, &log.time_s)
    }

    /// What a step of charge at the start of its log does to every judged row, in the channel's unit.
    fn by_charge(&self) -> Vec<f64> {
        let evidence = &self.frame.evidence;
        let fuller = |log: &Prepared| {
            let mut log = log.clone();
            log.start.soc += STEP_SOC;
            log
        };
        let moved: Evidence = evidence.with_inputs_of(evidence.logs.iter().map(fuller).collect());
        let moved = Frame::new(Arc::clone(&self.frame.model), Arc::new(moved));
        moved.predict(&self.x).iter().zip(self.frame.predict(&self.x)).map(|(fuller, as_it_is)| (fuller - as_it_is) / STEP_SOC).collect()
    }
}

/// A walk of these steps in parts of like variance.
fn parts(steps: &[f64], time_s: &[f64]) -> Vec<Part> {
    let whole: f64 = steps.iter().map(|step| step * step).sum();
    let (mut parts, mut variance, mut from): (Vec<Part>, f64, usize) = (Vec::new(), 0.0, 0);
    for (row, step) in steps.iter().enumerate() {
        // A row after a long pause is a part of its own.
        let is_whole = step * step * PARTS as f64 >= whole;
        if is_whole && variance > 0.0 {
            parts.push((time_s[from], variance));
            (variance, from) = (0.0, row);
        }
        variance += step * step;
        if variance * PARTS as f64 >= whole {
            parts.push((time_s[from], variance));
            (variance, from) = (0.0, row + 1);
        }
    }
    parts.extend((variance > 0.0).then(|| (time_s[from], variance)));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_a_walk_is_dated_by_when_it_is_counted() {
        let time_s: Vec<f64> = (0..=2400).map(f64::from).collect();
        let even = parts(&vec![1e-4; 2401], &time_s);
        assert!((PARTS..=PARTS + 1).contains(&even.len()) && even[1].0 == 101.0, "{even:?}");
        // What flowed in a pause of an hour is counted at its end, however little came before.
        let mut steps = vec![1e-4; 2401];
        steps[1200] = 0.36;
        let paused = parts(&steps, &time_s);
        let of_pause = paused.iter().find(|(from_s, _)| *from_s == 1200.0).unwrap();
        assert!((of_pause.1 / 0.36_f64.powi(2) - 1.0).abs() < 1e-9 && paused.len() == 3, "{paused:?}");
        let sum: f64 = paused.iter().map(|part| part.1).sum();
        assert!((sum / steps.iter().map(|step| step * step).sum::<f64>() - 1.0).abs() < 1e-9);
    }
}
