//! The state of charge of every row, from where it is known and the charge counted between.

use energy::Estimate;

use super::anchor::{Anchor, COUNTED};
use super::counted::Counted;
use super::passage::Counting;

/// State of charge of every row, and how well it is known where it is least and most: while or after the battery was discharged, and charged.
pub(super) struct Course {
    pub(super) soc: Vec<f64>,
    pub(super) ends: [[Estimate; 2]; 2],
}

/// What is known of a log from row to row. Nothing where there is no anchor.
pub(super) fn course(log: &Counted<'_>, anchors: &[Anchor], counting: &Counting) -> Option<Course> {
    let known = smoothed(log, anchors, counting);
    known.first()?;
    let moved_ah = &log.moved_ah;
    let mut soc = Vec::with_capacity(moved_ah.len());
    let mut next = 0;
    for row in 0..moved_ah.len() {
        while next < anchors.len() && anchors[next].row <= row {
            next += 1;
        }
        let from = next.saturating_sub(1);
        let counted = known[from].value + counting.between(log, anchors[from].row, row);
        // What the count is off by between two anchors has come about with the charge that moved.
        let off = if next > 0 && next < anchors.len() {
            let (begin, end) = (anchors[from].row, anchors[next].row);
            let share = (moved_ah[row] - moved_ah[begin]) / (moved_ah[end] - moved_ah[begin]).max(f64::MIN_POSITIVE);
            share * (known[next].value - known[from].value - counting.between(log, begin, end))
        } else {
            0.0
        };
        soc.push(counted + off);
    }
    let sigma = |row: usize| {
        let from = anchors.partition_point(|anchor| anchor.row <= row).saturating_sub(1);
        let nearest = [Some(from), (from + 1 < anchors.len()).then_some(from + 1)].into_iter().flatten();
        let of = |at: usize| known[at].sigma.hypot(counting.way(log, anchors[at].row, row).sigma);
        nearest.map(of).fold(f64::INFINITY, f64::min).max(COUNTED)
    };
    let by_soc = |a: &usize, b: &usize| soc[*a].total_cmp(&soc[*b]);
    let went = log.went_in();
    let ends = [false, true].map(|charged| {
        let rows = || (0..soc.len()).filter(|&row| went[row] == charged);
        let end = |row: Option<usize>| row.map_or(Estimate::new(0.0, COUNTED), |row| Estimate::new(soc[row], counting.worse * sigma(row)));
        [end(rows().min_by(by_soc)), end(rows().max_by(by_soc))]
    });
    Some(Course { soc, ends })
}

/// How full a log begins, by its anchors; nothing where there is none.
pub(super) fn begins(log: &Counted<'_>, anchors: &[Anchor], counting: &Counting) -> Option<Estimate> {
    let (known, way) = (*smoothed(log, anchors, counting).first()?, counting.way(log, anchors[0].row, 0));
    Some(Estimate::new(known.value + way.value, known.sigma.hypot(way.sigma)))
}

/// Each anchor corrected by the others, by how well each is known (the smoother of Rauch, Tung and Striebel 1965, of one state).
fn smoothed(log: &Counted<'_>, anchors: &[Anchor], counting: &Counting) -> Vec<Estimate> {
    let forward = filtered(log, anchors, counting);
    let mut known = forward.clone();
    for at in (0..anchors.len().saturating_sub(1)).rev() {
        let way = counting.way(log, anchors[at].row, anchors[at + 1].row);
        let ahead_variance = forward[at].sigma.powi(2) + way.sigma.powi(2);
        let gain = forward[at].sigma.powi(2) / ahead_variance;
        let value = forward[at].value + gain * (known[at + 1].value - forward[at].value - way.value);
        let variance = forward[at].sigma.powi(2) + gain.powi(2) * (known[at + 1].sigma.powi(2) - ahead_variance);
        known[at] = Estimate::new(value, variance.max(0.0).sqrt());
    }
    known
}

/// What each anchor and those before it say.
fn filtered(log: &Counted<'_>, anchors: &[Anchor], counting: &Counting) -> Vec<Estimate> {
    let mut known: Vec<Estimate> = Vec::with_capacity(anchors.len());
    for (at, anchor) in anchors.iter().enumerate() {
        let Some(before) = known.last() else {
            known.push(anchor.soc);
            continue;
        };
        let way = counting.way(log, anchors[at - 1].row, anchor.row);
        let counted = Estimate::new(before.value + way.value, before.sigma.hypot(way.sigma));
        known.push(together(counted, anchor.soc));
    }
    known
}

/// Two estimates of one number.
fn together(one: Estimate, other: Estimate) -> Estimate {
    let (of_one, of_other) = (one.sigma.powi(-2), other.sigma.powi(-2));
    Estimate::new((of_one * one.value + of_other * other.value) / (of_one + of_other), (of_one + of_other).sqrt().recip())
}
