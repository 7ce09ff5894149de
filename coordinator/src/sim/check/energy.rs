//! Energy comes from somewhere: what robots take in bays is what stations give there, and what packs
//! lose in charge is what flowed out of them.

use std::collections::BTreeMap;

use energy::Channel;
use energy::units::S_PER_H;
use proto::{PackId, RobotId, StationId};
use robot_agent::source::{RobotBody, Source as _};
use station_agent::source::StationBody;

use crate::sim::host::STEP_S;

/// Relative error of a sum of so many steps that is still rounding.
const CLOSED: f64 = 1e-9;
/// What a pack's charge hangs on.
const CHARGE: [Channel; 5] = [Channel::Soc, Channel::CapacityAh, Channel::TerminalCurrentA, Channel::LostCurrentA, Channel::SocPerA];
/// How many breaches are told; the first ones say it.
const TOLD_MAX: usize = 5;

/// Sums over a run.
#[derive(Debug, Default)]
pub(in crate::sim) struct Balance {
    /// What stations give in this step, and what robots took in the one before, W: a station is told
    /// what its robots take one step later, in simulations as over a wire.
    given_w: f64,
    taken_w: f64,
    taking_w: f64,
    robots: BTreeMap<RobotId, Charge>,
    packs: BTreeMap<(StationId, PackId), Charge>,
    pub(super) found: Vec<String>,
}

/// A pack's charge, C: at the start, what flowed out since, now.
#[derive(Debug, Clone, Copy)]
struct Charge {
    begin_c: f64,
    out_c: f64,
    now_c: f64,
}

impl Charge {
    /// Charge now, C, and what flowed out in the last step, A.
    fn now(&[soc, capacity_ah, terminal_a, lost_a, soc_per_a]: &[f64; 5]) -> (f64, f64) {
        // What leaks inside the cells is told for one of those in parallel.
        let parallel = soc_per_a * capacity_ah * S_PER_H / STEP_S;
        (soc * capacity_ah * S_PER_H, terminal_a + lost_a * parallel)
    }

    /// Before the last step.
    fn before(values: &[f64; 5]) -> Self {
        let (charge_c, out_a) = Self::now(values);
        Self { begin_c: charge_c + out_a * STEP_S, out_c: 0.0, now_c: charge_c }
    }

    fn step(&mut self, values: &[f64; 5]) {
        let (charge_c, out_a) = Self::now(values);
        self.out_c += out_a * STEP_S;
        self.now_c = charge_c;
    }
}

impl Balance {
    /// The next step begins.
    pub(in crate::sim) fn step(&mut self) {
        if (self.given_w - self.taken_w).abs() > CLOSED * self.given_w.abs().max(1.0) && self.found.len() < TOLD_MAX {
            self.found.push(format!("stations gave {} W to their bays, robots had taken {} W there", self.given_w, self.taken_w));
        }
        (self.given_w, self.taken_w, self.taking_w) = (0.0, self.taking_w, 0.0);
    }

    /// A station has made a step.
    pub(in crate::sim) fn station(&mut self, id: &StationId, body: &StationBody) {
        self.given_w += body.truth(Channel::ChargePowerW);
        let values = CHARGE.map(|channel| body.packs_truth(channel).map(|(_, value)| value).collect::<Vec<_>>());
        for (index, (pack, _)) in body.packs_truth(Channel::Soc).enumerate() {
            let values = values.each_ref().map(|of| of[index]);
            let known = self.packs.entry((id.clone(), pack.clone())).or_insert_with(|| Charge::before(&values));
            known.step(&values);
        }
    }

    /// A robot has made a step; `exchanged`: with another pack than before.
    pub(in crate::sim) fn robot(&mut self, id: &RobotId, body: &RobotBody, exchanged: bool) {
        self.taking_w += body.draw().map_or(0.0, |draw| draw.charge_power_w);
        let values = CHARGE.map(|channel| body.truth(channel));
        let known = self.robots.entry(id.clone()).or_insert_with(|| Charge::before(&values));
        if exchanged {
            *known = Charge::before(&values);
        }
        known.step(&values);
    }

    /// Closes the books.
    pub(in crate::sim) fn close(&mut self) {
        let robots = self.robots.iter().map(|(robot, charge)| (robot.to_string(), charge));
        let packs = self.packs.iter().map(|((station, pack), charge)| (format!("{pack} of {station}"), charge));
        for (pack, charge) in robots.chain(packs) {
            let lost_c = charge.begin_c - charge.now_c;
            if (lost_c - charge.out_c).abs() > CLOSED * charge.begin_c.abs().max(1.0) {
                self.found.push(format!("{pack} lost {lost_c} C of charge, {} C flowed out", charge.out_c));
            }
        }
    }
}
