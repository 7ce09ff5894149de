//! The table of the open-circuit voltage, by least squares.
//!
//! A row shows `v = OCV(soc) - R(soc) I`: I is 0 at rest, R is what a slow current costs in all its time, as a straight
//! line between a few states of charge. Where a battery was both charged and discharged slowly, R is what lies between,
//! half of a hysteresis included, and the table is the middle. Where it was not, R is as roughly known as what is stated for
//! it before, and so is the table.

use energy::{Estimate, OcvTable};
use nalgebra::{DMatrix, DVector};

use super::OcvError;
use super::anchor::{COUNTED, HYSTERESIS_V};
use super::passage::Known;
use super::shown::{Kind, Shown, place};
use super::step::{OF_STEP, UNSEEN_V};

/// Points that a table takes.
pub(super) const LEAST: usize = 4;
/// Where what a slow current costs may turn, as a state of charge: near the end it rises.
const TURNS: [f64; 7] = [0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0];
/// A table is known no better than this, V per cell: a hysteresis of layered oxides that nothing need have shown. A guess.
const KNOWN_V: f64 = 2e-3;
/// A table that rises by less than this between a third and two thirds of the charge, V per cell, is of a cell whose lithium moves between two phases
/// (iron phosphate: some 40 mV; layered oxides: 150 and more).
const FLAT_V: f64 = 0.1;
/// Half of a hysteresis of such a cell, V: the A123 cell of `lab/README.md` has 12 to 32 mV.
const FLAT_HYSTERESIS_V: f64 = 0.02;
/// A table that must be bent by more than this not to fall, V, is of rows that belong to something else. A guess: far more than noise.
const FALLS_V: f64 = 0.02;
/// Places at which the deviation of a table is taken.
const GRID: u32 = 200;
/// Points nearer to each other than this state of charge are one: less than half of the least place. A guess.
const APART: f64 = 1e-3;
/// Below this state of charge a table is as steep as it is uncertain.
const STEEP: f64 = 0.05;

/// Which way a battery went where its voltage was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Branch {
    /// Only while, or after, it was discharged.
    Discharge,
    /// Only while, or after, it was charged.
    Charge,
    /// Both.
    Both,
    /// It rested, and nothing says what came before.
    Unknown,
}

/// The open-circuit voltage of one cell, as logs show it.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The points.
    pub ocv: OcvTable,
    /// Standard deviation of each, V, as far as it is known from what was stated and from how the rows agree.
    pub sigma_v: Vec<f64>,
    /// Standard deviation of the table above a twentieth of the charge, V, RMS: of its points, and of the straight lines between.
    pub rms_sigma_v: f64,
    /// What was shown lies so far from the table, V, RMS; none where each point rests on one place.
    pub left_v: Option<f64>,
    /// What a slow current costs at half the charge, ohm per cell in series; none where there was none.
    pub slow_ohm: Option<Estimate>,
    /// Which way the battery went.
    pub branch: Branch,
}

/// Shares of the straight lines between `knots` at `at`; the outer ones go on.
fn shares(knots: &[f64], at: f64, go_on: bool) -> [(usize, f64); 2] {
    let high = knots.partition_point(|knot| *knot <= at).clamp(1, knots.len() - 1);
    let share = (at - knots[high - 1]) / (knots[high] - knots[high - 1]);
    let share = if go_on { share } else { share.clamp(0.0, 1.0) };
    [(high - 1, 1.0 - share), (high, share)]
}

/// One point of the table at each place where something was shown; two places may meet at their boundary.
fn knots(shown: &[Shown]) -> Vec<f64> {
    let mut sorted: Vec<f64> = shown.iter().map(|shown| shown.soc).collect();
    sorted.sort_by(f64::total_cmp);
    let mut knots: Vec<(f64, f64)> = Vec::new();
    for socs in sorted.chunk_by(|a, b| place(*a) == place(*b)) {
        let (sum, count) = (socs.iter().sum::<f64>(), socs.len() as f64);
        match knots.last_mut() {
            Some((before, many)) if sum / count - *before / *many < APART => (*before, *many) = (*before + sum, *many + count),
            _ => knots.push((sum, count)),
        }
    }
    knots.into_iter().map(|(sum, count)| sum / count).collect()
}

/// The table; nothing where too little was shown.
pub(super) fn solve(shown: &[Shown], step_ohm: Option<Estimate>, known: &Known) -> Result<Option<Table>, OcvError> {
    let knots = knots(shown);
    if knots.len() < LEAST {
        return Ok(None);
    }
    let own_ohm = own_ohm(step_ohm, known.capacity_ah.value);
    let before = |half_v: f64| Estimate::new(own_ohm.value, own_ohm.sigma.hypot(half_v / current_both_ways_a(shown)));
    let mut equations = Equations::of(shown, &knots, before(HYSTERESIS_V));
    // How steep the table is tells what the state of charge, which is not exact, does to a voltage.
    let Some(rough) = equations.solved(&shown.iter().map(|shown| shown.sigma_v).collect::<Vec<_>>()) else { return Ok(None) };
    equations.before = before(half_hysteresis_v(&knots, rough.answer.as_slice()));
    // Of each point, and between them as the table itself: a shift of all rows is then one of all points, which no row contradicts.
    let at_knot = |knot: usize| {
        let (low, high) = (knot.saturating_sub(1), (knot + 1).min(knots.len() - 1));
        ((rough.answer[high] - rough.answer[low]) / (knots[high] - knots[low])).abs()
    };
    let steep_v = |soc: f64| shares(&knots, soc, false).map(|(knot, share)| share * at_knot(knot)).iter().sum::<f64>();
    let sigmas: Vec<f64> = shown.iter().map(|shown| shown.sigma_v.hypot(COUNTED * steep_v(shown.soc))).collect();
    let equations = equations.shifted(shown, known, steep_v);
    let Some(solved) = equations.solved(&sigmas) else { return Ok(None) };
    let sigma_v: Vec<f64> = (0..knots.len()).map(|knot| solved.covariance[(knot, knot)].sqrt()).collect();
    let found = &solved.answer.as_slice()[..knots.len()];
    let volts = never_falling(found.to_vec(), &sigma_v);
    let bent =
        found.iter().zip(&volts).zip(&knots).map(|((found, volts), soc)| ((found - volts).abs(), *soc)).filter(|(_, soc)| *soc >= STEEP);
    let (fall_v, soc) = bent.fold((0.0, 0.0), |most, bent| if bent.0 > most.0 { bent } else { most });
    if fall_v > FALLS_V {
        return Err(OcvError::Falls { fall_v, soc: 100.0 * soc });
    }
    // A rest or two after a charge do not tell what lies between the branches.
    let count = |discharged: bool| shown.iter().filter(|shown| shown.discharged == Some(discharged)).count();
    let went = |discharged: bool| count(discharged) > 0 && (count(discharged) >= LEAST || count(!discharged) < LEAST);
    let branch = match (went(true), went(false)) {
        (true, false) => Branch::Discharge,
        (false, true) => Branch::Charge,
        (true, true) => Branch::Both,
        (false, false) => Branch::Unknown,
    };
    let slow = shown.iter().any(|shown| shown.kind == Kind::Slow);
    // Where a table is steep a count that is a little off looks like volts, which say nothing of the rest.
    let off: Vec<f64> = solved.off.iter().zip(shown).filter(|(_, shown)| shown.soc >= STEEP).map(|(off, _)| *off).collect();
    let left_v = (off.len() > knots.iter().filter(|knot| **knot >= STEEP).count())
        .then(|| (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt());
    // What was shown and lies elsewhere may be right: no table is known better.
    let rms_sigma_v = deviation_v(&knots, &volts, &sigma_v).max(KNOWN_V).max(left_v.unwrap_or(0.0));
    // Of one branch all points may be off together by half of a hysteresis: nothing that was shown contradicts that.
    let half_v = if branch == Branch::Both { 0.0 } else { half_hysteresis_v(&knots, &volts) };
    let (sigma_v, rms_sigma_v) = (sigma_v.iter().map(|sigma_v| sigma_v.hypot(half_v)).collect(), rms_sigma_v.hypot(half_v));
    let slow_ohm = slow.then(|| equations.cost(&solved, 0.5));
    Ok(OcvTable::new(knots, volts).ok().map(|ocv| Table { ocv, sigma_v, rms_sigma_v, left_v, slow_ohm, branch }))
}

/// What a slow current costs without hysteresis, ohm per cell in series.
fn own_ohm(step_ohm: Option<Estimate>, capacity_ah: f64) -> Estimate {
    let (times, of) = step_ohm.map_or((UNSEEN_V, 1.0 / capacity_ah), |ohm| (OF_STEP, ohm.value));
    Estimate::new(times.0 * of, times.1 * of)
}

/// Half of a hysteresis that a table may hide, V.
fn half_hysteresis_v(knots: &[f64], volts: &[f64]) -> f64 {
    let at = |soc: f64| shares(knots, soc, true).map(|(knot, share)| share * volts[knot]).iter().sum::<f64>();
    if at(2.0 / 3.0) - at(1.0 / 3.0) < FLAT_V { FLAT_HYSTERESIS_V } else { HYSTERESIS_V }
}

/// The slow current of a battery that went both ways, A, by which half of a hysteresis looks like something that the current costs; infinite where it went one way.
fn current_both_ways_a(shown: &[Shown]) -> f64 {
    let mean_a = |discharged: bool| {
        let slow = shown.iter().filter(|shown| shown.kind == Kind::Slow && shown.discharged == Some(discharged));
        let (sum, count) = slow.fold((0.0, 0.0), |(sum, count), shown| (sum + shown.current_a.abs(), count + 1.0));
        (count > 0.0).then(|| sum / count)
    };
    mean_a(true).zip(mean_a(false)).map_or(f64::INFINITY, |(out_a, in_a)| f64::midpoint(out_a, in_a))
}

/// What was shown, as linear equations in the points of the table and in what a slow current costs at its turns.
struct Equations {
    /// Coefficients, one list for each thing shown.
    rows: Vec<Vec<(usize, f64)>>,
    volts: Vec<f64>,
    points: usize,
    before: Estimate,
    shifts: Vec<Shift>,
}

/// A state of charge that is off for many rows together.
struct Shift {
    sigma: f64,
    /// What one of it does to each thing shown, V.
    does_v: Vec<f64>,
}

struct Solved {
    answer: DVector<f64>,
    covariance: DMatrix<f64>,
    /// What was shown less what the answer says, V.
    off: Vec<f64>,
}

impl Equations {
    fn of(shown: &[Shown], knots: &[f64], before: Estimate) -> Equations {
        let row = |shown: &Shown| {
            let volts = shares(knots, shown.soc, true);
            let costs = shares(&TURNS, shown.soc, false).map(|(turn, share)| (knots.len() + turn, -shown.current_a * share));
            volts.into_iter().chain(costs).collect()
        };
        Equations {
            rows: shown.iter().map(row).collect(),
            volts: shown.iter().map(|shown| shown.cell_v).collect(),
            points: knots.len(),
            before,
            shifts: Vec::new(),
        }
    }

    /// The same where the state of charge of all of a log's ways out, or in, may be off, as a straight line between its least and its most.
    fn shifted(mut self, shown: &[Shown], known: &Known, steep_v: impl Fn(f64) -> f64) -> Equations {
        let ends = known.ends.iter().flatten().flatten();
        self.shifts = ends.map(|end| Shift { sigma: end.sigma, does_v: vec![0.0; shown.len()] }).collect();
        for (row, shown) in shown.iter().enumerate() {
            let way = usize::from(shown.discharged == Some(false));
            let [least, most] = known.ends[shown.log][way].map(|end| end.value);
            let share = ((shown.soc - least) / (most - least).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            let (steep_v, low) = (steep_v(shown.soc), 4 * shown.log + 2 * way);
            self.shifts[low].does_v[row] = (1.0 - share) * steep_v;
            self.shifts[low + 1].does_v[row] = share * steep_v;
        }
        self
    }

    fn solved(&self, sigma_v: &[f64]) -> Option<Solved> {
        let unknowns = self.points + TURNS.len();
        let mut normal = DMatrix::<f64>::zeros(unknowns, unknowns);
        let mut right = DVector::<f64>::zeros(unknowns);
        for ((row, volts), sigma_v) in self.rows.iter().zip(&self.volts).zip(sigma_v) {
            let weight = sigma_v.powi(-2);
            for &(i, of_i) in row {
                right[i] += weight * of_i * volts;
                row.iter().for_each(|&(j, of_j)| normal[(i, j)] += weight * of_i * of_j);
            }
        }
        for turn in self.points..unknowns {
            normal[(turn, turn)] += self.before.sigma.powi(-2);
            right[turn] += self.before.sigma.powi(-2) * self.before.value;
        }
        // What a slow current costs does not differ from one turn to the next by more than it is itself.
        let alike = self.before.value.powi(-2);
        for turn in self.points + 1..unknowns {
            for (i, j, sign) in [(turn, turn, 1.0), (turn - 1, turn - 1, 1.0), (turn, turn - 1, -1.0), (turn - 1, turn, -1.0)] {
                normal[(i, j)] += sign * alike;
            }
        }
        let factor = normal.cholesky()?;
        let (answer, mut covariance) = (factor.solve(&right), factor.inverse());
        let says = |row: &Vec<(usize, f64)>| row.iter().map(|&(i, of_i)| of_i * answer[i]).sum::<f64>();
        let off: Vec<f64> = self.rows.iter().zip(&self.volts).map(|(row, volts)| volts - says(row)).collect();
        let squared: f64 = off.iter().zip(sigma_v).map(|(off, sigma_v)| (off / sigma_v).powi(2)).sum();
        // Where rows agree worse than they say, nothing is known as well as they say.
        covariance *= (squared / (self.rows.len() as f64 - self.points as f64).max(1.0)).max(1.0);
        // A shift is not solved for: what a current costs is too roughly known to tell it from that. It moves the answer by as much as if it were there.
        for shift in &self.shifts {
            let mut moves = DVector::<f64>::zeros(unknowns);
            for ((row, does_v), sigma_v) in self.rows.iter().zip(&shift.does_v).zip(sigma_v) {
                row.iter().for_each(|&(i, of_i)| moves[i] += of_i * does_v / sigma_v.powi(2));
            }
            let moved = factor.solve(&moves) * shift.sigma;
            covariance += &moved * moved.transpose();
        }
        Some(Solved { answer, covariance, off })
    }

    /// What a slow current costs at a state of charge, ohm.
    fn cost(&self, solved: &Solved, soc: f64) -> Estimate {
        let at = shares(&TURNS, soc, false).map(|(turn, share)| (self.points + turn, share));
        let variance: f64 = at.iter().map(|&(i, a)| at.iter().map(|&(j, b)| a * b * solved.covariance[(i, j)]).sum::<f64>()).sum();
        Estimate::new(at.iter().map(|&(i, share)| share * solved.answer[i]).sum(), variance.sqrt())
    }
}

/// Deviation of a table where it is not steep and something was shown, V, RMS: that of its points, and how far the curve may be from the straight lines between
/// them, by how it bends at the points next to each.
fn deviation_v(knots: &[f64], volts: &[f64], sigma_v: &[f64]) -> f64 {
    let slope = |at: usize| (volts[at + 1] - volts[at]) / (knots[at + 1] - knots[at]);
    let bend = |at: usize| ((slope(at) - slope(at - 1)) / (knots[at + 1] - knots[at - 1]) * 2.0).abs();
    let bend = |at: usize| bend(at.clamp(1, knots.len() - 2));
    let from = STEEP.max(knots[0]).min(knots[knots.len() - 2]);
    let square = |step: u32| {
        let soc = from + (knots[knots.len() - 1] - from) * f64::from(step) / f64::from(GRID);
        let [(low, _), (high, _)] = shares(knots, soc, true);
        let of_points: f64 = shares(knots, soc, false).map(|(knot, share)| share * sigma_v[knot].powi(2)).iter().sum();
        // A parabola through both ends.
        let of_line = bend(low).max(bend(high)) * (soc - knots[low]) * (knots[high] - soc) / 2.0;
        of_points + of_line.powi(2)
    };
    ((0..=GRID).map(square).sum::<f64>() / f64::from(GRID + 1)).sqrt()
}

/// The nearest voltages that never fall with the charge: neighbours that do are taken together, by how well each is known.
fn never_falling(volts: Vec<f64>, sigma_v: &[f64]) -> Vec<f64> {
    let mut levels: Vec<(f64, f64, usize)> = Vec::new();
    for (volts, sigma_v) in volts.into_iter().zip(sigma_v) {
        levels.push((volts, sigma_v.powi(-2), 1));
        while let [.., (low_v, low, below), (high_v, high, above)] = levels[..]
            && low_v > high_v
        {
            levels.truncate(levels.len() - 2);
            levels.push(((low * low_v + high * high_v) / (low + high), low + high, below + above));
        }
    }
    levels.into_iter().flat_map(|(volts, _, count)| std::iter::repeat_n(volts, count)).collect()
}
