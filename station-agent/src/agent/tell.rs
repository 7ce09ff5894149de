//! What a station says of itself, and when.

use node::{gauge_message, why_senseless};
use proto::{Absence, BayState, PackState, StationState, Timestamp};

use super::{Agent, Bay, Output, Pack};

/// Expected times that differ by no more than this are the same one, s: nobody need plan anew for a rounding.
const SAME_S: f64 = 1.0;

/// A time that is expected, as it is told: as before, where nothing has changed.
pub(super) fn again(told: Option<Timestamp>, expected: Timestamp) -> Timestamp {
    told.filter(|told| told.seconds_since(expected).abs() <= SAME_S).unwrap_or(expected)
}

/// Absences that are expected, in seconds from now, as they are told.
pub(super) fn away(told: &[Absence], now: Timestamp, away_s: &[(f64, Option<f64>)]) -> Vec<Absence> {
    let told = told.iter().copied().map(Some).chain(std::iter::repeat(None));
    let one = |(&(leaves_s, returns_s), told): (&(f64, Option<f64>), Option<Absence>)| Absence {
        leaves: again(told.map(|told| told.leaves), now.plus_s(leaves_s)),
        returns: returns_s.map(|returns_s| again(told.and_then(|told| told.returns), now.plus_s(returns_s))),
    };
    away_s.iter().zip(told).map(one).collect()
}

impl Agent {
    /// Publishes what is due: gauges by their period, the state by its period and on change.
    pub(super) fn tell(&mut self, now: Timestamp) {
        let known = self.packs.iter().all(|pack| pack.last.is_some() || !pack.connected);
        if known && self.packs.iter().any(|pack| pack.connected && pack.fresh) && self.gauge_due.is(now) {
            self.gauge_due.done(now, self.profile.publish.gauge_period_s);
            for pack in self.packs.iter_mut().filter(|pack| pack.connected) {
                // What has not been measured anew is not said anew: who listens shall see that it grows old.
                let Some(sample) = pack.last.filter(|_| std::mem::take(&mut pack.fresh)) else { continue };
                let reading = pack.gauge.reading();
                self.gauge_seq += 1;
                let series = pack.gauge.model().battery().series;
                let gauge = gauge_message(now, self.gauge_seq, &sample, &reading, series, &self.profile.source);
                pack.senseless = why_senseless(&gauge);
                if pack.senseless.is_none() {
                    self.outputs.push_back(Output::Gauge(pack.id.clone(), gauge));
                }
            }
        }
        let telling: Vec<_> = self.bays.iter().map(|bay| (bay.phase, bay.robot.clone())).collect();
        let here = self.packs.iter().map(|pack| pack.connected).collect();
        let power = (
            self.powered,
            self.active_pack.clone(),
            self.swapping.as_ref().map(|(robot, _)| robot.clone()),
            here,
            self.arrives,
            self.away.clone(),
        );
        // Who listens goes by what was said before: a station that calls itself dark breaks every promise.
        if !self.known {
            return;
        }
        let changed = self.told.as_ref() != Some(&telling) || self.told_power.as_ref() != Some(&power);
        if changed || self.state_due.is(now) {
            (self.told, self.told_power) = (Some(telling), Some(power));
            self.state_due.done(now, self.profile.publish.state_period_s);
            let message = self.state_message(now);
            self.outputs.push_back(Output::State(message));
        }
    }

    /// What a person should look after.
    fn note(&self) -> Option<String> {
        let senseless = self.packs.iter().filter(|pack| pack.connected);
        let senseless = senseless.filter_map(|pack| Some(format!("{}: {}", pack.id, pack.senseless.as_ref()?)));
        let all: Vec<String> = self.trouble.iter().cloned().chain(senseless).collect();
        let told = (!all.is_empty()).then(|| all.join("; "));
        told.or_else(|| (!self.powered).then(|| self.why_down().to_owned()))
    }

    fn why_down(&self) -> &'static str {
        if self.packs.iter().all(|pack| pack.depleted || !pack.connected) { "every pack is depleted or away" } else { "it starts again" }
    }

    pub(super) fn state_message(&mut self, now: Timestamp) -> StationState {
        self.state_seq += 1;
        let bay = |bay: &Bay| BayState { bay: bay.id.clone(), phase: bay.phase, robot: bay.robot.clone() };
        let pack = |pack: &Pack| PackState { pack: pack.id.clone(), connected: pack.connected, depleted: pack.depleted, back: pack.back };
        StationState {
            at: now,
            seq: self.state_seq,
            bays: self.bays.iter().map(bay).collect(),
            lift_busy: self.lifting,
            swapping: self.swapping.as_ref().map(|(robot, _)| robot.clone()),
            packs: self.packs.iter().map(pack).collect(),
            active_pack: self.active_pack.clone(),
            powered: self.powered,
            pack_power_w: self.pack_power_w,
            arrives: self.arrives,
            away: self.away.clone(),
            spares: self.spares.clone(),
            last_command: self.last_command.clone(),
            note: self.note(),
        }
    }
}
