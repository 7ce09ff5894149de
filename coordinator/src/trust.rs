//! Whether gauges of robots and packs can be believed: one may fall silent, freeze, or jump to where no charge
//! can have gone. A plan then rests on what the load tells, with a wider sigma, and says why.

use std::collections::BTreeMap;

use energy::Estimate;
use proto::{Gauge, PackId, RobotId, StationId, Timestamp};

use crate::models::from_wire;
use crate::when::second_from;

/// A robot's gauge is silent when it has not been heard for longer than this, s, and for longer than [`PERIODS_MAX`] of its own periods.
/// Then its last word says too little of what is left.
const SILENT_S: f64 = 120.0;
/// The same for a pack's gauge, s: one that rests, and whose device measures no current, is heard of every five minutes.
const PACK_SILENT_S: f64 = 360.0;
/// A gauge that usually speaks less often has to be left out so many times before it is silent.
const PERIODS_MAX: f64 = 12.0;
/// A gauge that repeats itself for so long while its battery is drawn from is frozen, s. No gauge that measures
/// repeats a voltage to the last digit for that long.
const FROZEN_S: f64 = 120.0;
/// Fewest repetitions that count for that.
const FROZEN_MIN: u32 = 8;
/// Sigmas that a state of charge may move beside what current can have moved.
const JUMP_SIGMAS: f64 = 5.0;
/// Greatest current that can have moved it, in capacities per hour.
const RATE_MAX_PER_H: f64 = 4.0;
/// A gauge that jumped is believed again after this time without another jump, s.
const JUMP_FORGOTTEN_S: f64 = 900.0;
/// What is uncertain of a load that nobody has counted, as a share of it.
const UNCOUNTED_SHARE: f64 = 0.3;

/// Whose gauge it is.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Owner {
    /// A robot's.
    Robot(RobotId),
    /// That of a station's pack.
    Pack(StationId, PackId),
}

impl std::fmt::Display for Owner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Owner::Robot(robot) => write!(f, "{robot}"),
            Owner::Pack(station, pack) => write!(f, "{pack} of {station}"),
        }
    }
}

/// What is wrong with a gauge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// It has not been heard since.
    Silent(Timestamp),
    /// It has repeated itself since.
    Frozen(Timestamp),
    /// Its state of charge moved by so much at once.
    Jumped(Timestamp, f64),
}

impl Fault {
    fn since(&mut self) -> &mut Timestamp {
        match self {
            Fault::Silent(since) | Fault::Frozen(since) | Fault::Jumped(since, _) => since,
        }
    }
}

/// A fault, as it is told at `now`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// What is wrong.
    pub fault: Fault,
    /// When it is told, by the coordinator's clock.
    pub now: Timestamp,
}

impl std::fmt::Display for Found {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let time = |at: &Timestamp| second_from(self.now, *at);
        match &self.fault {
            Fault::Silent(since) => write!(f, "has not been heard since {}", time(since)),
            Fault::Frozen(since) => write!(f, "has said the same since {}, though its battery is drawn from", time(since)),
            Fault::Jumped(at, by) => {
                let percent = by * 100.0;
                write!(f, "jumped by {percent:+.*} % of charge at {}, which no current explains", decimals(percent), time(at))
            }
        }
    }
}

/// Decimals with which a number that is not 0 is not told as 0, at most 4.
fn decimals(number: f64) -> usize {
    [0.5, 0.05, 0.005, 0.0005].iter().position(|least| number.abs() >= *least).unwrap_or(4)
}

/// What one gauge has said.
#[derive(Debug, Clone, Default)]
struct Track {
    last: Option<Gauge>,
    /// When that arrived, by the coordinator's clock, by which all else here is timed.
    arrived: Option<Timestamp>,
    /// Since when, and how often, it has said the same.
    same: Option<(Timestamp, u32)>,
    jumped: Option<(Timestamp, f64)>,
    /// Time between its last two messages, s, and between those before.
    gaps_s: [Option<f64>; 2],
    /// Energy drawn from its battery since it last said something new, or since it was last heard at rest, Wh, and until when that is counted.
    uncounted_wh: f64,
    counted: Option<Timestamp>,
    /// Until when its silence is not told: it was away with its agent, which is back.
    excused: Option<Timestamp>,
    /// What was told of it last.
    told: Option<Fault>,
}

impl Track {
    /// Time between its messages, s; 0 while there has been but one. A silence that has ended does not count.
    fn period_s(&self) -> f64 {
        self.gaps_s.iter().flatten().copied().reduce(f64::min).unwrap_or(0.0)
    }
}

/// All gauges.
#[derive(Debug, Clone, Default)]
pub struct Trust {
    gauges: BTreeMap<Owner, Track>,
}

impl Trust {
    /// Takes in a message. `drawn` says that something draws from its battery, and `swapped` that the battery may have
    /// been exchanged meanwhile.
    pub fn heard(&mut self, now: Timestamp, owner: &Owner, gauge: &Gauge, drawn: bool, swapped: bool) {
        let track = self.gauges.entry(owner.clone()).or_default();
        if swapped {
            *track = Track { told: track.told, ..Track::default() };
        }
        if let Some(last) = &track.last {
            // A clock that was set back says nothing of how long it has been: then by when it was heard.
            let by_its_own_s = gauge.at.seconds_since(last.at);
            let passed_s = if by_its_own_s < 0.0 { track.arrived.map_or(0.0, |arrived| now.seconds_since(arrived)) } else { by_its_own_s };
            let hours = passed_s.max(0.0) / energy::units::S_PER_H;
            let by = gauge.soc.value - last.soc.value;
            track.gaps_s = [track.arrived.map(|arrived| now.seconds_since(arrived)), track.gaps_s[0]];
            let possible = RATE_MAX_PER_H * hours + JUMP_SIGMAS * last.soc.sigma.hypot(gauge.soc.sigma);
            if by.abs() > possible {
                track.jumped = Some((now, by));
            }
            let same = last.soc.value == gauge.soc.value && last.voltage_v == gauge.voltage_v && last.current_a == gauge.current_a;
            track.same = match track.same {
                Some((since, times)) if same && drawn => Some((since, times + 1)),
                None if same && drawn => Some((track.arrived.unwrap_or(now), 1)),
                _ => None,
            };
        }
        if track.same.is_none() {
            (track.uncounted_wh, track.counted) = (0.0, Some(now));
        }
        (track.last, track.arrived) = (Some(gauge.clone()), Some(now));
    }

    /// Takes in that `drawn_w` (W) has been drawn from a battery since this was last said, whether or not its gauge says so.
    pub fn drawn(&mut self, now: Timestamp, owner: &Owner, drawn_w: f64) {
        let Some(track) = self.gauges.get_mut(owner) else { return };
        if let Some(before) = track.counted.replace(now) {
            track.uncounted_wh += drawn_w.max(0.0) * now.seconds_since(before).max(0.0) / energy::units::S_PER_H;
        }
    }

    /// Takes in that who was gone is there again: it has a moment to speak before its silence is told.
    pub fn back(&mut self, now: Timestamp, owner: &Owner) {
        if let Some(track) = self.gauges.get_mut(owner) {
            track.excused = Some(now.plus_s(SILENT_S));
        }
    }

    /// Takes in that a battery is away: whatever comes in its place is known by nothing that was said before. Whether its gauge was told
    /// to be doubted.
    pub fn forget(&mut self, owner: &Owner) -> bool {
        self.gauges.remove(owner).is_some_and(|track| track.told.is_some())
    }

    /// Takes in that the clock by which all is timed here was set back: it has been as long as before since everything.
    pub fn set_back(&mut self, by_ms: i64) {
        for track in self.gauges.values_mut() {
            let since = track
                .arrived
                .iter_mut()
                .chain(&mut track.counted)
                .chain(&mut track.excused)
                .chain(track.same.as_mut().map(|(since, _)| since));
            let since = since.chain(track.jumped.as_mut().map(|(at, _)| at)).chain(track.told.as_mut().map(Fault::since));
            since.for_each(|at| *at = at.plus_ms(-by_ms));
        }
    }

    /// What is wrong with a gauge now, if anything is.
    #[must_use]
    pub fn fault(&self, now: Timestamp, owner: &Owner) -> Option<Found> {
        self.wrong(now, owner).map(|fault| Found { fault, now })
    }

    fn wrong(&self, now: Timestamp, owner: &Owner) -> Option<Fault> {
        let track = self.gauges.get(owner)?;
        let arrived = track.arrived?;
        let silent_s = if matches!(owner, Owner::Pack(..)) { PACK_SILENT_S } else { SILENT_S };
        if now.seconds_since(arrived) > silent_s.max(PERIODS_MAX * track.period_s()) {
            return Some(Fault::Silent(arrived));
        }
        if let Some((since, times)) = track.same
            && times >= FROZEN_MIN
            && now.seconds_since(since) > FROZEN_S
        {
            return Some(Fault::Frozen(since));
        }
        track.jumped.filter(|(at, _)| now.seconds_since(*at) < JUMP_FORGOTTEN_S).map(|(at, by)| Fault::Jumped(at, by))
    }

    /// What is to be told of a gauge, if that is something else than before: its fault, or that it has
    /// none any more.
    pub fn news(&mut self, now: Timestamp, owner: &Owner) -> Option<Option<Found>> {
        let fault = self.wrong(now, owner);
        let track = self.gauges.get_mut(owner)?;
        if matches!(fault, Some(Fault::Silent(_))) && track.excused.is_some_and(|until| now < until) {
            return None;
        }
        (std::mem::replace(&mut track.told, fault) != fault).then_some(fault.map(|fault| Found { fault, now }))
    }

    /// How long ago a gauge was last heard, s; none where it never was.
    #[must_use]
    pub fn heard_ago_s(&self, now: Timestamp, owner: &Owner) -> Option<f64> {
        Some(now.seconds_since(self.gauges.get(owner)?.arrived?))
    }

    /// Gauges that were heard.
    pub fn owners(&self) -> impl Iterator<Item = &Owner> {
        self.gauges.keys()
    }

    /// State of charge and energy (Wh) that a battery is believed to have: its gauge's, or less and less
    /// certain what is left of it after what was drawn and nobody has counted. `stored_wh` is what it holds when full, Wh.
    #[must_use]
    pub fn belief(&self, now: Timestamp, owner: &Owner, gauge: &Gauge, stored_wh: f64) -> (Estimate, Estimate) {
        let (soc, remaining_wh) = (from_wire(gauge.soc), from_wire(gauge.remaining_wh));
        match self.wrong(now, owner) {
            None => (soc, remaining_wh),
            Some(Fault::Jumped(_, by)) => {
                // It was wrong before or is wrong now.
                let wider = |estimate: Estimate, by: f64| Estimate::new(estimate.value, estimate.sigma.hypot(by));
                (wider(soc, by), wider(remaining_wh, by * stored_wh))
            }
            Some(Fault::Silent(_) | Fault::Frozen(_)) => {
                let uncounted_wh = self.gauges.get(owner).map_or(0.0, |track| track.uncounted_wh);
                let less =
                    |estimate: Estimate, by: f64| Estimate::new((estimate.value - by).max(0.0), estimate.sigma.hypot(UNCOUNTED_SHARE * by));
                (less(soc, uncounted_wh / stored_wh), less(remaining_wh, uncounted_wh))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gauge(at_s: f64, soc: f64, voltage_v: f64) -> Gauge {
        let estimate = proto::Estimate::new;
        let json = serde_json::json!({
            "at": Timestamp::from_unix_ms(0).plus_s(at_s), "seq": 1, "full_wh": estimate(14.6, 0.1), "power_w": 4.4,
            "cells_series": 3, "source": "test", "soc": estimate(soc, 0.01), "remaining_wh": estimate(14.6 * soc, 0.1), "soh": estimate(1.0, 0.01),
            "voltage_v": voltage_v, "current_a": 0.4, "temperature_degc": 25.0,
        });
        serde_json::from_value(json).unwrap_or_else(|error| panic!("{error}"))
    }

    fn robot() -> Owner {
        Owner::Robot(RobotId::new("r").unwrap())
    }

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_unix_ms(0).plus_s(seconds)
    }

    #[test]
    fn a_gauge_that_falls_by_its_current_is_believed() {
        let mut trust = Trust::default();
        for n in 0..300 {
            let time_s = f64::from(n);
            trust.heard(at(time_s), &robot(), &gauge(time_s, 0.5 - 8e-5 * time_s, 11.1 - 1e-5 * time_s), true, false);
        }
        assert_eq!(trust.wrong(at(300.0), &robot()), None);
        assert_eq!(trust.wrong(at(600.0), &robot()), Some(Fault::Silent(at(299.0))));
    }

    #[test]
    fn a_long_silence_that_has_ended_is_no_period() {
        let mut trust = Trust::default();
        let mut heard = |time_s: f64| trust.heard(at(time_s), &robot(), &gauge(time_s, 0.5, 11.1), false, false);
        (0..10).for_each(|n| heard(f64::from(n)));
        heard(43_200.0);
        heard(43_201.0);
        assert_eq!(trust.wrong(at(43_400.0), &robot()), Some(Fault::Silent(at(43_201.0))));
        // One that speaks every ten minutes is silent after two hours.
        let mut trust = Trust::default();
        (0..10).for_each(|n| trust.heard(at(600.0 * f64::from(n)), &robot(), &gauge(600.0 * f64::from(n), 0.5, 11.1), false, false));
        assert_eq!(trust.wrong(at(5_400.0 + 7_000.0), &robot()), None);
        assert!(trust.wrong(at(5_400.0 + 7_300.0), &robot()).is_some());
    }

    #[test]
    fn what_a_silent_pack_gave_since_is_taken_off_and_less_certain() {
        let pack = Owner::Pack(StationId::new("depot").unwrap(), PackId::new("pack-1").unwrap());
        let mut trust = Trust::default();
        trust.heard(at(0.0), &pack, &gauge(0.0, 0.5, 11.1), true, false);
        let belief = |now_s: f64, trust: &Trust| trust.belief(at(now_s), &pack, &gauge(0.0, 0.5, 11.1), 14.6);
        trust.drawn(at(60.0), &pack, 7.2);
        assert_eq!(belief(60.0, &trust).1.value, 7.3, "its gauge is believed still");
        trust.drawn(at(500.0), &pack, 7.2);
        // What it draws now says nothing of what it drew before.
        trust.drawn(at(1_000.0), &pack, 0.0);
        // 7.2 W for 500 s are 1 Wh, of which 30 % are uncertain beside the gauge's 0.1 Wh.
        let (soc, left_wh) = belief(1_000.0, &trust);
        assert!((left_wh.value - 6.3).abs() < 1e-12 && (left_wh.sigma - 0.1_f64.hypot(0.3)).abs() < 1e-12, "{left_wh:?}");
        assert!((soc.value - (0.5 - 1.0 / 14.6)).abs() < 1e-12, "{soc:?}");
        // The coordinator's clock is set back: it has been silent for as long as before, and nothing of that is news.
        assert!(trust.news(at(1_000.0), &pack).is_some());
        trust.set_back(900_000);
        assert_eq!((belief(100.0, &trust).1, trust.news(at(100.0), &pack)), (left_wh, None));
        assert!(trust.forget(&pack), "it was doubted");
        assert_eq!(belief(1_000.0, &trust).1.value, 7.3);
    }

    #[test]
    fn who_is_back_is_not_told_to_be_silent_but_what_it_drew_meanwhile_is_gone() {
        let mut trust = Trust::default();
        trust.heard(at(0.0), &robot(), &gauge(0.0, 0.5, 11.1), true, false);
        trust.drawn(at(3_600.0), &robot(), 3.65);
        trust.back(at(3_600.0), &robot());
        assert_eq!(trust.news(at(3_601.0), &robot()), None);
        // 3.65 of 14.6 Wh are a quarter.
        assert!((trust.belief(at(3_601.0), &robot(), &gauge(0.0, 0.5, 11.1), 14.6).0.value - 0.25).abs() < 1e-12);
        assert!(matches!(trust.news(at(3_800.0), &robot()), Some(Some(found)) if found.fault == Fault::Silent(at(0.0))));
    }

    #[test]
    fn a_clock_that_is_set_back_makes_no_jump() {
        let mut trust = Trust::default();
        trust.heard(at(0.0), &robot(), &gauge(3600.0, 0.5, 11.1), true, false);
        trust.heard(at(1.0), &robot(), &gauge(1.0, 0.4999, 11.1), true, false);
        assert_eq!(trust.wrong(at(2.0), &robot()), None);
    }

    #[test]
    fn a_jump_is_never_told_as_none() {
        let told = |by: f64| Found { fault: Fault::Jumped(at(0.0), by), now: at(0.0) }.to_string();
        assert!(told(0.12).starts_with("jumped by +12 %"), "{}", told(0.12));
        assert!(told(-0.0031).starts_with("jumped by -0.3 %"), "{}", told(-0.0031));
        assert!(told(0.0001).starts_with("jumped by +0.01 %"), "{}", told(0.0001));
    }

    #[test]
    fn a_fault_since_another_day_is_told_with_its_date() {
        let mut trust = Trust::default();
        trust.heard(at(0.0), &robot(), &gauge(0.0, 0.5, 11.1), true, false);
        let told = |now_s: f64| trust.fault(at(now_s), &robot()).unwrap().to_string();
        assert_eq!(told(3_600.0), "has not been heard since 00:00:00");
        assert_eq!(told(90_000.0), "has not been heard since 1970-01-01 00:00:00");
    }

    #[test]
    fn a_jump_is_no_charge_and_is_forgotten_after_a_while() {
        let mut trust = Trust::default();
        trust.heard(at(0.0), &robot(), &gauge(0.0, 0.5, 11.1), true, false);
        trust.heard(at(1.0), &robot(), &gauge(1.0, 0.8, 11.1), true, false);
        assert!(matches!(trust.wrong(at(2.0), &robot()), Some(Fault::Jumped(..))));
        for n in 2..1000 {
            trust.heard(at(f64::from(n)), &robot(), &gauge(f64::from(n), 0.8, 11.1 + 1e-4 * f64::from(n % 3)), true, false);
        }
        assert_eq!(trust.wrong(at(1000.0), &robot()), None);
        // A new pack is a new gauge.
        trust.heard(at(1001.0), &robot(), &gauge(1001.0, 0.1, 11.0), true, true);
        assert_eq!(trust.wrong(at(1002.0), &robot()), None);
    }

    #[test]
    fn who_says_the_same_for_minutes_at_work_is_frozen_and_in_a_bay_is_not() {
        for (drawn, frozen) in [(true, true), (false, false)] {
            let mut trust = Trust::default();
            (0..200).for_each(|n| trust.heard(at(f64::from(n)), &robot(), &gauge(f64::from(n), 0.5, 11.1), drawn, false));
            assert_eq!(trust.wrong(at(200.0), &robot()).is_some(), frozen);
            assert_eq!(trust.news(at(200.0), &robot()).is_some(), frozen);
            assert!(trust.news(at(201.0), &robot()).is_none(), "told once");
        }
    }
}
