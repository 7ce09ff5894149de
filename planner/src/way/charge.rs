//! Charges by whole runs of equal draw instead of ticks.

use super::{NEVER, Way};
use crate::problem::{Battery, Charger, Tick};

/// A number of ticks with the same draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Run {
    ticks: u32,
    draw: i64,
    /// Segment of the charger's curve that has this draw.
    segment: u32,
}

/// The runs of many charges, one after the other. There are some twenty for each tick in which a robot can begin, so
/// what they draw is kept once.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Runs {
    /// Draws of the segments of each curve in use.
    draws: Vec<i64>,
    /// Where those of a charger begin, with the robot powered or its pack alone.
    curves: Vec<((usize, bool), u32)>,
    /// Ticks, and where their draw is.
    runs: Vec<(u32, u32)>,
}

impl Runs {
    /// The runs from a place on: how long and how much, those of the next charge after those of this one.
    #[inline]
    pub(super) fn from(&self, place: u32) -> impl Iterator<Item = (Tick, i64)> + '_ {
        self.runs[place as usize..].iter().map(|&(ticks, draw)| (ticks, self.draws[draw as usize]))
    }

    /// Adds a charge at the charger of this index; where its runs begin.
    fn add(&mut self, (charger, bare): (usize, bool), at: &Charger, charge: &Charge) -> u32 {
        let known = self.curves.iter().find(|(curve, _)| *curve == (charger, bare)).map(|(_, begin)| *begin);
        let begin = known.unwrap_or_else(|| {
            let begin = self.draws.len() as u32;
            self.draws.extend(at.curve.iter().map(|segment| if bare { segment.draw_bare } else { segment.draw }));
            self.curves.push(((charger, bare), begin));
            begin
        });
        let place = self.runs.len() as u32;
        self.runs.extend(charge.runs.iter().map(|run| (run.ticks, begin + run.segment)));
        place
    }

    /// Those alone that these ways need, which then find them where they are now.
    pub(super) fn only(&self, ways: &mut [Way]) -> Self {
        let mut order: Vec<(u32, usize)> = ways.iter().map(|way| way.runs).zip(0..).collect();
        order.sort_unstable();
        let mut made = Self { draws: self.draws.clone(), curves: self.curves.clone(), runs: Vec::new() };
        for same in order.chunk_by(|one, other| one.0 == other.0) {
            // No charge is longer than its way, and none of a spare than until it is ready.
            let lasts = |&(_, way): &(u32, usize)| {
                let Way { start, end, ready, .. } = ways[way];
                Tick::from(if ready == NEVER { end } else { ready } - start)
            };
            let mut left = same.iter().map(lasts).max().unwrap_or(0);
            let begin = made.runs.len() as u32;
            for &run in &self.runs[same[0].0 as usize..] {
                if left == 0 {
                    break;
                }
                left = left.saturating_sub(run.0);
                made.runs.push(run);
            }
            same.iter().for_each(|&(_, way)| ways[way].runs = begin);
        }
        made.closed()
    }

    /// The same, in no more memory than they take.
    pub(super) fn closed(mut self) -> Self {
        self.runs.shrink_to_fit();
        self
    }
}

/// A charge from one level up: what it takes to reach each target.
pub(super) struct Charge {
    /// Ticks until each target and what is stored then, in order of targets.
    pub(super) reached: Vec<(Tick, i64)>,
    pub(super) runs: Vec<Run>,
}

/// Ticks of one draw that are told apart: far more than a plan has.
const STEPS_MAX: i64 = 1 << 20;

/// Charges from `energy` through all `targets` (ascending).
fn charge(battery: &Battery, charger: &Charger, energy: i64, targets: &[i64], bare: bool) -> Charge {
    let (mut energy, mut ticks) = (energy, 0);
    let mut charge = Charge { reached: Vec::with_capacity(targets.len()), runs: Vec::with_capacity(charger.curve.len()) };
    let mut at = 0;
    for &target in targets {
        while energy < target {
            while energy >= charger.curve[at].below {
                at += 1;
            }
            let segment = &charger.curve[at];
            let stop = segment.below.min(target);
            let (gain, draw) = if bare { (segment.gain_bare, segment.draw_bare) } else { (segment.gain, segment.draw) };
            let steps = (stop - energy + gain - 1) / gain;
            energy = (energy + steps * gain).min(battery.capacity);
            // What takes longer than any horizon does not end in it, however much longer that is.
            let steps = steps.min(STEPS_MAX) as Tick;
            ticks += steps;
            match charge.runs.last_mut() {
                Some(run) if run.draw == draw => run.ticks += steps,
                _ => charge.runs.push(Run { ticks: steps, draw, segment: at as u32 }),
            }
        }
        charge.reached.push((ticks, energy));
    }
    charge
}

/// More than all packs hold, and little enough to add up that of all robots.
const NEED_MAX: i64 = 1 << 48;

/// What the station's packs give to charge from `energy` to `target`, mWh.
#[must_use]
pub fn charge_need(battery: &Battery, charger: usize, energy: i64, target: i64) -> i64 {
    let (mut energy, mut need) = (energy, 0_i64);
    for segment in &battery.chargers[charger].curve {
        let steps = ((segment.below.min(target) - energy).max(0) + segment.gain - 1) / segment.gain;
        energy = (energy + steps * segment.gain).min(battery.capacity);
        need = need.saturating_add(steps.saturating_mul(segment.draw)).min(NEED_MAX);
    }
    need
}

/// What the first ticks of a charge draw.
pub(super) fn taken(runs: &[Run], ticks: Tick) -> i64 {
    let mut left = ticks;
    let mut sum = 0;
    for run in runs {
        let now = run.ticks.min(left);
        sum += i64::from(now) * run.draw;
        left -= now;
    }
    sum
}

/// A start at a charger: what charging takes from there.
pub(super) struct From {
    pub(super) charger: usize,
    pub(super) charged: Charge,
    pub(super) charged_runs: u32,
    pub(super) bare: Option<Charge>,
    pub(super) bare_runs: u32,
}

impl From {
    /// `swapped_from` is what an exchange must add at least; none where there is none.
    pub(super) fn new(
        battery: &Battery,
        charger: usize,
        energy: i64,
        (targets, swapped_from): (&[i64], Option<i64>),
        runs: &mut Runs,
    ) -> Self {
        let at = &battery.chargers[charger];
        let charged = charge(battery, at, energy, targets, false);
        let charged_runs = runs.add((charger, false), at, &charged);
        let swap = swapped_from.is_some_and(|least_gain| at.swap_energy - energy >= least_gain);
        let bare = swap.then(|| charge(battery, at, energy, &[at.again_energy], true));
        let bare_runs = bare.as_ref().map_or(0, |bare| runs.add((charger, true), at, bare));
        Self { charger, charged, charged_runs, bare, bare_runs }
    }
}
