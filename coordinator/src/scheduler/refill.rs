//! What an outside supply will have put into a pack that rests by the time that it is its turn.
//!
//! Only packs that are being charged now are counted on, each until it is full, with an equal share of the supply. What comes
//! after that, when a pack that feeds the station now rests in its turn, is more.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use energy::Model;
use energy::units::S_PER_H;
use proto::Timestamp;

use super::charging::step_degc;
use super::translate::HORIZON_MAX_S;
use crate::forecast;

/// How a pack is charged while it rests; empty where it is not.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Refill {
    /// What is counted on, ascending.
    levels: Vec<Level>,
    /// The charge from empty on; also of a pack that does not rest yet.
    course: Option<Arc<Course>>,
}

/// How far a charge has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// When, s from now.
    pub at_s: f64,
    /// How much more the pack gives then than at the level before, Wh.
    pub more_wh: f64,
}

impl Refill {
    /// Nothing comes.
    pub const NOTHING: Self = Self { levels: Vec::new(), course: None };

    /// Of a pack that feeds the station, and will be charged like that once it rests.
    #[must_use]
    pub fn later(course: Arc<Course>) -> Self {
        Self { levels: Vec::new(), course: Some(course) }
    }

    /// The charge of a pack from `soc` on, as of times that are whole multiples of `step_s`; the next one is in `first_s`, s. `usable_wh` is what the
    /// pack gives at a state of charge.
    #[must_use]
    pub fn along(course: Arc<Course>, soc: f64, [first_s, step_s]: [f64; 2], usable_wh: impl Fn(f64) -> f64) -> Self {
        let (Some(&(full_s, _)), begun_s) = (course.last(), time_s(&course, soc)) else { return Self::NOTHING };
        let (mut levels, mut before_wh) = (Vec::new(), usable_wh(soc));
        let last = ((full_s - begun_s - first_s) / step_s).clamp(0.0, HORIZON_MAX_S / step_s).ceil() as u32;
        for step in 0..=last {
            let at_s = first_s + f64::from(step) * step_s;
            let now_wh = usable_wh(soc_at(&course, begun_s + at_s).max(soc));
            if now_wh > before_wh {
                levels.push(Level { at_s, more_wh: now_wh - before_wh });
                before_wh = now_wh;
            }
        }
        Self { levels, course: Some(course) }
    }

    /// Each time at which more of it counts.
    pub fn levels(&self) -> impl Iterator<Item = &Level> {
        self.levels.iter()
    }

    /// What has come into it by then (s from now), Wh; what comes at that time does not count yet.
    #[must_use]
    pub fn before_wh(&self, at_s: f64) -> f64 {
        self.levels.iter().filter(|level| level.at_s < at_s).map(|level| level.more_wh).sum()
    }

    /// State of charge of a pack that had `soc` and has rested since, for so long (s); none where nothing charges it.
    #[must_use]
    pub fn rested(&self, soc: f64, for_s: f64) -> Option<f64> {
        let course = self.course.as_ref()?;
        Some(soc_at(course, time_s(course, soc) + for_s).max(soc))
    }
}

/// When a charge from empty on has come so far, s.
fn time_s(course: &Course, soc: f64) -> f64 {
    between(course, soc, |&(at_s, at)| (at, at_s))
}

/// How far a charge from empty on has come by then, s.
fn soc_at(course: &Course, at_s: f64) -> f64 {
    between(course, at_s, |&(at_s, soc)| (at_s, soc))
}

/// On the straight lines through these points; beyond the ends, the ends.
fn between(course: &Course, x: f64, point: impl Fn(&(f64, f64)) -> (f64, f64)) -> f64 {
    let above = course.partition_point(|at| point(at).0 < x).min(course.len().saturating_sub(1));
    let Some([low, high]) = above.checked_sub(1).map(|below| [point(&course[below]), point(&course[above])]) else {
        return course.first().map_or(0.0, |first| point(first).1);
    };
    low.1 + (high.1 - low.1) * ((x - low.0) / (high.0 - low.0).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}

/// Steps in which a charge is counted, s: the longest in which no more comes than this share of what the pack holds. That much is counted too late at most,
/// and what comes is a row of the planner's books each time.
const STEPS_S: [f64; 6] = [1800.0, 1200.0, 600.0, 300.0, 120.0, 60.0];
const STEP_SHARE: f64 = 0.04;

/// The steps in which a pack is counted on that is charged with this power, W, and when the next is, s from now: all plans have the same, so that none
/// counts on less at a time than the one before.
#[must_use]
pub fn steps_s(pack: &Model, power_w: f64, now: Timestamp) -> [f64; 2] {
    let step_wh = STEP_SHARE * pack.battery().stored_wh();
    let step_s = STEPS_S.into_iter().find(|step_s| power_w * step_s / S_PER_H <= step_wh).unwrap_or(STEPS_S[STEPS_S.len() - 1]);
    [step_s - now.seconds_since(Timestamp::from_unix_ms(0)).rem_euclid(step_s), step_s]
}

/// Kind of pack, power (bits), temperature.
type Kind = (usize, u64, i32);
/// A charge from empty on: s, state of charge.
pub type Course = [(f64, f64)];

/// All charges that were asked for so far. They follow from models that never change.
#[derive(Debug, Default)]
pub struct Refills {
    known: Mutex<BTreeMap<Kind, Arc<Course>>>,
}

impl Refills {
    /// The charge of a pack with this power (W) at this temperature.
    #[must_use]
    pub fn course(&self, pack: &Arc<Model>, power_w: f64, temperature_degc: f64) -> Arc<Course> {
        let degc = step_degc(pack, temperature_degc);
        let kind = (Arc::as_ptr(pack).addr(), power_w.to_bits(), degc as i32);
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(known.entry(kind).or_insert_with(|| forecast::refill(pack, power_w, degc).into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pack_is_counted_on_with_what_is_in_it_by_then_and_no_more() {
        // By hand: a quarter of 100 Wh an hour, up to nine tenths. It has 25 now, and what is in it counts every half hour, ten minutes from now first.
        let course = [(0.0, 0.0), (3600.0, 0.25), (3.6 * 3600.0, 0.9)];
        let refill = Refill::along(course.into(), 0.25, [600.0, 1800.0], |soc| 100.0 * soc);
        let told: Vec<[i64; 2]> = refill.levels().map(|level| [level.at_s, 1e2 * level.more_wh].map(|x| x.round() as i64)).collect();
        assert_eq!(told[..2], [[600, 417], [2400, 1250]]);
        assert_eq!((told.len(), told[5][0]), (6, 9600));
        assert_eq!([600.0, 601.0, 1e9].map(|at_s| (refill.before_wh(at_s) * 100.0).round()), [0.0, 417.0, 6500.0]);
        for (for_s, soc) in [(0.0, 0.25), (300.0, 0.25 + 0.25 / 12.0), (9600.0, 0.9), (1e6, 0.9)] {
            assert!((refill.rested(0.25, for_s).unwrap() - soc).abs() < 1e-9, "{for_s}");
        }
    }

    #[test]
    fn a_full_pack_gets_nothing_more_and_neither_does_one_that_nothing_charges() {
        let course = [(0.0, 0.0), (3600.0, 0.9)];
        for (course, soc) in [(&course[..], 0.95), (&course[..1], 0.4), (&[], 0.4)] {
            let refill = Refill::along(course.into(), soc, [60.0, 60.0], |soc| 100.0 * soc);
            assert_eq!((refill.levels().count(), refill.rested(soc, 1e6).unwrap_or(soc)), (0, soc));
        }
        assert_eq!(Refill::default().rested(0.4, 100.0), None);
    }

    #[test]
    fn a_charge_takes_as_long_as_the_energy_and_the_power_say() {
        // 84 Wh behind 42 W, of which the pack's own resistance takes a part: two hours and a little, most of it at constant power.
        let pack = Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
        let refills = Refills::default();
        let course = refills.course(&pack, 42.0, 25.0);
        let (end_s, full_soc) = course[course.len() - 1];
        assert!(full_soc > 0.98 && (7200.0..9000.0).contains(&end_s), "{end_s} {full_soc}");
        let half_s = time_s(&course, 0.5);
        assert!((3200.0..4200.0).contains(&half_s), "{half_s}");
        // 3.4 Wh are 42 W in nearly five minutes: it is two; and 7 W in nearly half an hour.
        let now = Timestamp::from_unix_ms(1_767_225_600_000).plus_s(7.0 * 60.0);
        assert_eq!([42.0, 7.0].map(|power_w| steps_s(&pack, power_w, now)), [[60.0, 120.0], [780.0, 1200.0]]);
    }
}
