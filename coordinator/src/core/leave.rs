//! Who has to be out of a station before it leaves, or before its packs give out.

use energy::units::S_PER_H;
use proto::{PackId, RobotId, StationId, Timestamp};

use super::Core;
use crate::fleet::{Robot, Station};
use crate::scheduler::HANDOVER_S;
use crate::service_run::{How, ServiceRun, Stage};
use crate::trust::Owner;
use crate::when::minute_from;

/// Packs that last so many times as long as it takes to let everybody out are not looked at more closely.
const PLENTY: f64 = 5.0;

/// A pack that should have been back by so long ago is not waited for, s.
const OVERDUE_S: f64 = 60.0;

/// Why somebody has to be out.
pub(super) enum Leave {
    /// The station leaves, or the robot is charged in vain.
    Otherwise(String),
    /// The station will have no power.
    Power(String),
}

impl Leave {
    /// The same in words.
    pub(super) fn why(&self) -> &str {
        match self {
            Leave::Otherwise(why) | Leave::Power(why) => why,
        }
    }
}

impl Core {
    /// Why somebody has to be out, in words. Where there is no power nobody is sent again at once.
    pub(super) fn why_left(&mut self, now: Timestamp, robot: &RobotId, station: &StationId, leave: Leave) -> String {
        if let Leave::Power(why) = &leave {
            self.refusals.note(now, robot, station, false, why.clone());
        }
        match leave {
            Leave::Otherwise(why) | Leave::Power(why) => why,
        }
    }

    /// Why a robot is let go before it is charged: its station leaves or will have no power, and all who charge there have to be let out before.
    pub(super) fn must_be_out(&self, now: Timestamp, run: &ServiceRun, robot: &Robot, station: &Station) -> Option<Leave> {
        robot.heard().filter(|_| charges(run.stage) && run.cut_short.is_none())?;
        let lift_s = self.models.stations.get(&run.station)?.handling.unload_s;
        let all_s = lift_s * self.inside(run).count() as f64;
        let leaves = || self.leaves(now, run, station, all_s).map(|(left_s, why)| (left_s, Leave::Otherwise(why)));
        let (left_s, why) =
            leaves().or_else(|| self.gives_out(now, run, station, all_s).map(|(left_s, why)| (left_s, Leave::Power(why))))?;
        // Who would be ready last goes last.
        let basis = self.basis(now);
        let own_s = basis.ends_s(run);
        let goes_later = |other: &&ServiceRun| basis.ends_s(other).total_cmp(&own_s).then(other.robot.cmp(&run.robot)).is_ge();
        let after = self.inside(run).filter(goes_later).count();
        (left_s <= lift_s * after as f64).then_some(why)
    }

    /// Who has to get out of that station: whoever charges there or is moved by its lift, who is brought in now too.
    fn inside(&self, run: &ServiceRun) -> impl Iterator<Item = &ServiceRun> {
        let station = run.station.clone();
        let lifted = |stage: Stage| matches!(stage, Stage::Loading | Stage::Unloading);
        self.running.values().filter(move |other| other.station == station && (charges(other.stage) || lifted(other.stage)))
    }

    /// How long there is until a station leaves, s, where all who are in its bays take as long to be let out; and when that is.
    fn leaves(&self, now: Timestamp, run: &ServiceRun, station: &Station, all_s: f64) -> Option<(f64, String)> {
        // Who is aboard once it has left goes along.
        let leaves = station.heard()?.away.iter().map(|away| away.leaves).find(|leaves| *leaves > now)?;
        let left_s = leaves.seconds_since(now) - self.settings.deadline_s;
        (left_s <= all_s).then(|| (left_s, format!("{} leaves at {}", run.station, minute_from(now, leaves))))
    }

    /// The same until its packs have given out: in a station without power nobody gets out of a bay.
    fn gives_out(&self, now: Timestamp, run: &ServiceRun, station: &Station, all_s: f64) -> Option<(f64, String)> {
        let (state, models) = (station.heard()?, self.models.stations.get(&run.station)?);
        if !state.powered || state.pack_power_w <= 0.0 {
            return None;
        }
        let basis = self.basis(now);
        let lasts_s = |wh: f64| wh * S_PER_H / state.pack_power_w - HANDOVER_S;
        let gauged_wh = |pack: &PackId| {
            let (gauge, model) = (station.packs.get(pack)?, models.packs.get(pack)?);
            let owner = Owner::Pack(run.station.clone(), pack.clone());
            Some(self.trust.belief(now, &owner, gauge, model.battery().stored_wh()).1.value)
        };
        let here = state.packs.iter().filter(|pack| pack.connected && !pack.depleted);
        let gauged_wh: f64 = here.filter_map(|pack| gauged_wh(&pack.pack)).sum();
        // Mostly there is plenty, by any account.
        if lasts_s(gauged_wh) > PLENTY * (all_s + HANDOVER_S) {
            return None;
        }
        let packs = basis.packs(&run.station, models, station, state);
        let held_wh: f64 = packs.iter().filter(|pack| pack.available_s <= 0.0).map(|pack| pack.usable_wh.value.max(0.0)).sum();
        let left_s = lasts_s(held_wh.min(gauged_wh));
        // What is there in time is waited for, and so is what comes into packs that rest.
        let in_time = |at: Timestamp| (-OVERDUE_S..left_s.max(0.0)).contains(&at.seconds_since(now));
        let comes = state.packs.iter().any(|pack| !pack.connected && pack.back.is_some_and(|back| in_time(back.at)));
        let waits = comes || basis.is_charged_from_outside(&run.station, models, station, state);
        (left_s <= all_s && !waits).then(|| (left_s, format!("the packs of {} hold no more than lets everybody out", run.station)))
    }

    /// Why a robot that is on its way, or waits, is not taken in any more: its station leaves before that would be done, or its packs last no
    /// longer than it takes to bring it in and everybody out.
    pub(super) fn comes_too_late(&self, now: Timestamp, run: &ServiceRun, station: &Station) -> Option<Leave> {
        let comes_s = match run.stage {
            Stage::Travelling => run.start.seconds_since(now).max(0.0),
            Stage::Waiting => 0.0,
            _ => return None,
        };
        let handling = &self.models.stations.get(&run.station)?.handling;
        let takes_s = if matches!(run.how, How::Swap { .. }) { handling.swap_s } else { handling.load_s + handling.unload_s };
        // Who comes while it is away waits until it is back, if it comes back.
        let (begins, ends) = (now.plus_s(comes_s), now.plus_s(comes_s + takes_s));
        let away = station.heard()?.away.iter().find(|away| away.leaves < ends && (begins < away.leaves || away.returns.is_none()));
        if let Some(away) = away {
            let when = minute_from(now, away.leaves);
            return Some(Leave::Otherwise(format!("{} leaves at {when}, before it would be let out again", run.station)));
        }
        // Until it has come, others may have left, and the plan knows of them. An exchange takes nobody into a bay.
        let others = if matches!(run.how, How::Swap { .. }) { 0 } else { self.inside(run).count() };
        let all_s = takes_s + handling.unload_s * others as f64;
        let gives_out = || self.gives_out(now, run, station, all_s).map(|(_, why)| Leave::Power(why));
        if run.stage == Stage::Waiting { gives_out() } else { None }
    }
}

/// Whether somebody is charged in a bay.
fn charges(stage: Stage) -> bool {
    matches!(stage, Stage::Charging | Stage::ChargingItself)
}
