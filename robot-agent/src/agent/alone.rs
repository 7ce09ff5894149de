//! What a robot does by itself while no coordinator is heard: it goes to the nearest station before
//! its energy gives out, and charges there when it is taken in.

use anyhow::ensure;
use energy::units::S_PER_H;
use proto::{RobotPhase, Timestamp};
use serde::{Deserialize, Serialize};

use super::Agent;
use crate::source::{Act, Observation, Place};

/// `[alone]`: what a robot does by itself while no coordinator is heard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Alone {
    /// Time without a coordinator after which it decides by itself, s.
    pub silent_s: f64,
    /// State of charge that must be left when it arrives at a station, for the wait there.
    pub reserve_soc: f64,
    /// How many standard deviations of what is left and of what the way takes it allows for.
    pub sigmas: f64,
    /// Level to which it charges.
    pub charge_to_soc: f64,
}

impl Default for Alone {
    fn default() -> Self {
        Self { silent_s: 60.0, reserve_soc: 0.05, sigmas: 3.0, charge_to_soc: 0.95 }
    }
}

impl Alone {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the key and the allowed range.
    pub fn check(&self) -> anyhow::Result<()> {
        for (key, value, most) in [
            ("silent_s", self.silent_s, 86_400.0),
            ("reserve_soc", self.reserve_soc, 1.0),
            ("sigmas", self.sigmas, 10.0),
            ("charge_to_soc", self.charge_to_soc, 1.0),
        ] {
            ensure!((0.0..=most).contains(&value), "alone.{key} = {value}: must be between 0 and {most}");
        }
        ensure!(
            self.reserve_soc < self.charge_to_soc,
            "alone.reserve_soc = {} must lie below alone.charge_to_soc = {}",
            self.reserve_soc,
            self.charge_to_soc
        );
        Ok(())
    }
}

impl Agent {
    /// Whether it decides by itself: no coordinator has been heard for long enough.
    pub fn is_alone(&mut self, now: Timestamp) -> bool {
        self.silence.lasts_s(now) >= self.profile.alone.silent_s
    }

    pub(super) fn act_alone(&mut self, now: Timestamp, observation: &Observation) {
        if !self.is_alone(now) {
            return;
        }
        match (self.phase, observation.place) {
            (RobotPhase::Working, Place::Mission) if self.must_leave() => {
                // The quickest way; its energy was asked for by `must_leave`.
                let nearest = self.profile.travel.iter().min_by(|a, b| a.1.time_s.total_cmp(&b.1.time_s));
                if let Some(station) = nearest.map(|(station, _)| station.clone()) {
                    (self.phase, self.station, self.bay) = (RobotPhase::Travelling, Some(station.clone()), None);
                    self.outputs.push_back(super::Output::Act(Act::TravelTo { station, bay: None }));
                }
            }
            // Some chargers give nothing before they are asked to. Who waits for an exchange stands in no bay, whatever its program calls it.
            (RobotPhase::Docked | RobotPhase::Waiting, Place::InBay) if self.phase == RobotPhase::Docked || self.bay.is_some() => {
                self.target_soc = Some(self.profile.alone.charge_to_soc);
                self.charge = super::charge::Watch::default();
                self.phase = RobotPhase::Charging;
                self.outputs.push_back(super::Output::Act(Act::Charge));
            }
            _ => {}
        }
    }

    /// Whether what is left, less its doubt, is no more than the way to the nearest station, the
    /// reserve, and the work until the next look. What its gauge says is as old as the last sample: since then it has worked.
    fn must_leave(&mut self) -> bool {
        let Some(way) = self.profile.travel.values().min_by(|a, b| a.time_s.total_cmp(&b.time_s)).copied() else { return false };
        let Alone { reserve_soc, sigmas, .. } = self.profile.alone;
        let reading = self.gauge.reading();
        let used_wh = self.profile.drain_w.scaled((self.passed_s - self.sampled_s.unwrap_or(0.0)) / S_PER_H);
        // Before a gauge has said anything its deviation is that of ignorance, which would send any robot off at once: then the middle of what
        // it may have counts, less its work since the agent's start.
        let gauge_sigma_wh = if self.sampled_s.is_some() { reading.remaining_wh.sigma } else { 0.0 };
        let sigma_wh = gauge_sigma_wh.hypot(used_wh.sigma).hypot(way.energy_wh.sigma);
        let left_wh = reading.remaining_wh.value - used_wh.value - sigmas * sigma_wh;
        let next_look_wh = self.profile.drain_w.value * self.profile.publish.gauge_period_s / S_PER_H;
        left_wh <= way.energy_wh.value + reserve_soc * reading.full_wh.value + next_look_wh
    }
}
