//! Who has to be out of a station before it leaves, or before its packs give out.

use proto::Timestamp;

use super::Core;
use crate::fleet::{Robot, Station};
use crate::scheduler::HANDOVER_S;
use crate::service_run::{How, ServiceRun, Stage};
use crate::when::minute_from;

/// Packs that last so many times as long as it takes to let everybody out are not looked at more closely.
const PLENTY: f64 = 5.0;

impl Core {
    /// Why a robot is let go before it is charged: its station leaves or will have no power, and all who charge there have to be let out before.
    pub(super) fn must_be_out(&self, now: Timestamp, run: &ServiceRun, robot: &Robot, station: &Station) -> Option<String> {
        let charges = |stage: Stage| matches!(stage, Stage::Charging | Stage::ChargingItself);
        robot.heard().filter(|_| charges(run.stage) && run.cut_short.is_none())?;
        let lift_s = self.models.stations.get(&run.station)?.handling.unload_s;
        let inside = |other: &&ServiceRun| other.station == run.station && (charges(other.stage) || other.stage == Stage::Unloading);
        let all_s = lift_s * self.running.values().filter(inside).count() as f64;
        let (left_s, why) = self.leaves(now, run, station, all_s).or_else(|| self.gives_out(now, run, station, all_s))?;
        // Who would be ready last goes last.
        let basis = self.basis(now);
        let own_s = basis.ends_s(run);
        let goes_later = |other: &&ServiceRun| basis.ends_s(other).total_cmp(&own_s).then(other.robot.cmp(&run.robot)).is_ge();
        let after = self.running.values().filter(inside).filter(goes_later).count();
        (left_s <= lift_s * after as f64).then_some(why)
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
        // Where something comes it waits for that.
        let comes = models.recharge_w > 0.0 || state.packs.iter().any(|pack| !pack.connected && pack.back.is_some());
        if comes || !state.powered || state.pack_power_w <= 0.0 {
            return None;
        }
        let lasts_s = |wh: f64| wh * energy::units::S_PER_H / state.pack_power_w - HANDOVER_S;
        let here = state.packs.iter().filter(|pack| pack.connected && !pack.depleted);
        let gauged_wh: f64 = here.filter_map(|pack| station.packs.get(&pack.pack)).map(|gauge| gauge.remaining_wh.value).sum();
        // Mostly there is plenty, by any account.
        if lasts_s(gauged_wh) > PLENTY * (all_s + HANDOVER_S) {
            return None;
        }
        let packs = self.basis(now).packs(&run.station, models, station, state);
        let held_wh = packs.iter().map(|pack| pack.usable_wh.value.max(0.0)).sum::<f64>();
        let left_s = lasts_s(held_wh.min(gauged_wh));
        (left_s <= all_s).then(|| (left_s, format!("the packs of {} hold no more than lets everybody out", run.station)))
    }

    /// Why a robot that is on its way, or waits, is not taken in any more: its station leaves before that would be done.
    pub(super) fn comes_too_late(&self, now: Timestamp, run: &ServiceRun, station: &Station) -> Option<String> {
        let comes_s = match run.stage {
            Stage::Travelling => run.start.seconds_since(now).max(0.0),
            Stage::Waiting => 0.0,
            _ => return None,
        };
        let handling = &self.models.stations.get(&run.station)?.handling;
        let takes_s = if matches!(run.how, How::Swap { .. }) { handling.swap_s } else { handling.load_s + handling.unload_s };
        // Who comes while it is away waits until it is back, if it comes back.
        let (begins, ends) = (now.plus_s(comes_s), now.plus_s(comes_s + takes_s));
        let away = station.heard()?.away.iter().find(|away| away.leaves < ends && (begins < away.leaves || away.returns.is_none()))?;
        Some(format!("{} leaves at {}, before it would be let out again", run.station, minute_from(now, away.leaves)))
    }
}
