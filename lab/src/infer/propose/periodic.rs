//! Formulas with a period: at a phase of its own in every log, unless all of them share one.

use std::f64::consts::TAU;
use std::sync::Arc;

use energy::Channel;

use super::dictionary::{COEFFICIENTS, Term};
use super::{Look, Seen, error, extended, unknown, with_term};
use crate::infer::evidence::Evidence;
use crate::infer::frame::Frame;
use crate::infer::lens::whiten_all;
use crate::infer::rough::Rough;
use crate::infer::state::{State, residual};
use crate::infer::trial::held_out;
use crate::measurement::rows_after_gaps;
use crate::whiteness::{Slots, quarters};

/// Phases that are looked at, and what of a period the deviation of a clock is: three of them reach every phase.
const PHASES: usize = 16;
pub(super) const CLOCK: f64 = 0.25;
/// Share of the period by which logs may differ that find it at one phase.
const ONE_PHASE: f64 = 0.03;
/// Share by which the held-out error may be higher with one phase for all logs.
const AS_GOOD: f64 = 0.05;

/// Periods that the longest piece of a log must hold, and readings that a period must have.
const PERIODS: usize = 3;
const READINGS: f64 = 4.0;
/// By how many times the power at a period must exceed the usual one.
const STANDS_OUT: f64 = 10.0;

/// A piece of a log without a pause: its rows, and what is left of them in floors.
struct Piece<'a> {
    time_s: &'a [f64],
    left: &'a [f64],
}

impl Piece<'_> {
    /// What beats with this frequency, as a sine and a cosine.
    fn beats(&self, frequency: f64) -> [f64; 2] {
        self.time_s.iter().zip(self.left).fold([0.0; 2], |[sine, cosine], (&time_s, &value)| {
            let (s, c) = (TAU * frequency * time_s).sin_cos();
            [sine + s * value, cosine + c * value]
        })
    }
}

/// The period at which the residual of these rows has most power, s, if it has several times the usual one: at a phase of its own in every log.
pub(super) fn period_s(state: &State) -> Option<f64> {
    let frame = state.frame.by_rows();
    let mut left = residual(&frame, &state.x);
    let segments = &frame.evidence.segments;
    for segment in segments {
        left[segment.range()].iter_mut().for_each(|left| *left /= frame.evidence.floor(segment.channel));
    }
    let pieces: Vec<Vec<Piece<'_>>> = segments.iter().map(|segment| pieces(&segment.time_s, &left[segment.range()])).collect();
    let slots: Vec<Slots> = pieces.iter().flatten().filter_map(|piece| Slots::of(piece.time_s, piece.left)).collect();
    let lasts_s = |slots: &Slots| slots.values.len() as f64 * slots.interval_s;
    let longest = slots.iter().max_by(|a, b| lasts_s(a).total_cmp(&lasts_s(b)))?;
    // In quarters of the least frequency that the longest piece tells from the next one.
    let quarter = 0.25 / lasts_s(longest);
    let mut powers = vec![0.0; (1.0 / (READINGS * longest.interval_s * quarter)) as usize];
    for slots in &slots {
        let (own, own_quarter) = (quarters(slots), 0.25 / lasts_s(slots));
        let seen = own.len().min((1.0 / (READINGS * slots.interval_s * own_quarter)) as usize);
        for (place, power) in powers.iter_mut().enumerate() {
            let at = (place as f64 * quarter / own_quarter).round() as usize;
            *power += if at < seen { own[at] } else { 0.0 };
        }
    }
    let from = 4 * PERIODS;
    let peak = (from..powers.len()).max_by(|&a, &b| powers[a].total_cmp(&powers[b]))?;
    let mut sorted = powers[from..].to_vec();
    sorted.sort_by(f64::total_cmp);
    if powers[peak] <= STANDS_OUT * sorted[sorted.len() / 2] {
        return None;
    }
    // Between the frequencies that were tried, at the times of the rows: an edge must be met to a row or two. First each piece at a phase of its own, then
    // all pieces of a log at one, which tells more, but only near the right one.
    let square = |[sine, cosine]: [f64; 2]| sine * sine + cosine * cosine;
    let apart = |frequency: f64| pieces.iter().flatten().map(|piece| square(piece.beats(frequency))).sum::<f64>();
    let of_log = |pieces: &Vec<Piece<'_>>, frequency: f64| {
        let beats = pieces.iter().map(|piece| piece.beats(frequency));
        square(beats.fold([0.0; 2], |[sine, cosine], [s, c]| [sine + s, cosine + c]))
    };
    let together = |frequency: f64| pieces.iter().map(|pieces| of_log(pieces, frequency)).sum::<f64>();
    let near = highest(peak as f64 * quarter, quarter, apart);
    let span_s = segments.iter().map(|segment| span_s(&segment.time_s)).fold(0.0, f64::max);
    Some(highest(near, 0.5 / span_s, together).recip())
}

/// Frequencies that are tried on each side of one.
const TRIED: i32 = 20;

/// Where power is highest within so much of a frequency: at the top of the parabola through the highest of those tried and its neighbours.
fn highest(about: f64, reach: f64, power: impl Fn(f64) -> f64) -> f64 {
    let step = reach / f64::from(TRIED);
    let tried: Vec<f64> = (-TRIED..=TRIED).map(|steps| power(about + f64::from(steps) * step)).collect();
    let top = (1..tried.len() - 1).max_by(|&a, &b| tried[a].total_cmp(&tried[b])).unwrap_or(TRIED as usize);
    let (before, at, after) = (tried[top - 1], tried[top], tried[top + 1]);
    let bend = before - 2.0 * at + after;
    let beside = if bend < 0.0 { ((before - after) / (2.0 * bend)).clamp(-1.0, 1.0) } else { 0.0 };
    about + (top as f64 - f64::from(TRIED) + beside) * step
}

/// A log cut at its pauses.
fn pieces<'a>(time_s: &'a [f64], left: &'a [f64]) -> Vec<Piece<'a>> {
    let mut cuts = rows_after_gaps(time_s, &[]);
    cuts.push(time_s.len());
    let mut from = 0;
    let piece = |to: usize| {
        let rows = from..to;
        from = to;
        Piece { time_s: &time_s[rows.clone()], left: &left[rows] }
    };
    cuts.into_iter().map(piece).collect()
}

impl Look<'_> {
    /// A periodic term where every log finds it at the phase at which it explains the log best.
    pub(super) fn at_its_phases(&self, term: &Term) -> Option<Seen> {
        let (logs, period_s) = (self.state.frame.evidence.logs.len(), term.period_s?);
        let (frame, mut x) = extended(self.state, with_term(self.state, term, "term_0".to_owned(), &[0.0])?);
        let by = [unknown(&frame, "term_0", COEFFICIENTS[0])?];
        // How far each log speaks for the term at each phase; less than nothing where it speaks for its opposite.
        let mut speaks = vec![vec![0.0; PHASES]; logs];
        let clocks: Vec<f64> = (0..PHASES).map(|phase| (phase as f64 / PHASES as f64 - 0.5) * period_s).collect();
        for (phase, &clock_s) in clocks.iter().enumerate() {
            set_clocks(&frame, &mut x, &vec![clock_s; logs]);
            let slopes = whiten_all(&frame, &self.slow.filters, frame.linearise(&x, &by).1);
            for segment in &frame.evidence.segments {
                let range = segment.range();
                let (slopes, left) = (&slopes.as_slice()[range.clone()], &self.slow.whitened.as_slice()[range]);
                let mean = slopes.iter().sum::<f64>() / slopes.len().max(1) as f64;
                speaks[segment.log][phase] += slopes.iter().zip(left).map(|(slope, left)| (slope - mean) * left).sum::<f64>();
            }
        }
        let at_best = |sign: f64| -> (f64, Vec<f64>) {
            let best = |of_log: &Vec<f64>| (0..PHASES).max_by(|&a, &b| (sign * of_log[a]).total_cmp(&(sign * of_log[b]))).unwrap_or(0);
            let phases: Vec<usize> = speaks.iter().map(best).collect();
            let sum = phases.iter().zip(&speaks).map(|(&phase, of_log)| sign * of_log[phase]).sum();
            (sum, phases.into_iter().map(|phase| clocks[phase]).collect())
        };
        let (_, clocks_s) = [at_best(1.0), at_best(-1.0)].into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
        set_clocks(&frame, &mut x, &clocks_s);
        Some(Seen { clocks_s, ..self.gain(frame.linearise(&x, &by).1)? })
    }
}

/// Sets the clocks of the logs.
pub(super) fn set_clocks(frame: &Frame, x: &mut [f64], clocks_s: &[f64]) {
    for (place, known) in frame.known.iter().enumerate() {
        if let (Rough::Clock(_), Some(&clock_s)) = (known.what, known.log().and_then(|log| clocks_s.get(log))) {
            x[frame.free.len() + place] = clock_s;
        }
    }
}

/// The same where all logs, the held-out ones too, find it at one phase: then the formula says which, and a file holds all of it.
/// `with` is the base with the term of that name, each log at a phase of its own.
pub(super) fn at_one_phase(
    base: &State,
    with: &State,
    term: &Term,
    name: &str,
    holdout: &Arc<Evidence>,
) -> Option<(State, Vec<(Channel, f64)>)> {
    let period_s = with.x[unknown(&with.frame, name, super::dictionary::PERIOD)?];
    let clocks = with.frame.known.iter().enumerate().filter(|(_, known)| matches!(known.what, Rough::Clock(_)));
    let clocks_s: Vec<f64> = clocks.map(|(place, _)| with.x[with.frame.free.len() + place]).collect();
    let first_s = clocks_s.first()?;
    let apart_s = |clock_s: &f64| {
        let apart_s = clock_s - first_s;
        apart_s - period_s * (apart_s / period_s).round()
    };
    if clocks_s.iter().any(|clock_s| apart_s(clock_s).abs() > ONE_PHASE * period_s) {
        return None;
    }
    let mean_s = first_s + clocks_s.iter().map(apart_s).sum::<f64>() / clocks_s.len() as f64;
    let sizes = [with.x[unknown(&with.frame, name, COEFFICIENTS[0])?]];
    let (frame, _) = extended(base, with_term(base, &term.at_one_phase(-mean_s), name.to_owned(), &sizes)?);
    let start = frame.like(with, None);
    let state = State::search(Arc::new(frame), &start, f64::NEG_INFINITY);
    let (own, one) = (held_out(with, holdout), held_out(&state, holdout));
    (error(holdout, &one) < (1.0 + AS_GOOD) * error(holdout, &own)).then_some((state, one))
}

fn span_s(time_s: &[f64]) -> f64 {
    time_s.last().zip(time_s.first()).map_or(0.0, |(last, first)| last - first)
}
