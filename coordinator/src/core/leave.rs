//! Who has to be out of a station before it leaves, or before its packs give out.

use energy::Estimate;
use energy::units::S_PER_H;
use proto::{PackId, RobotAction, RobotId, StationId, Timestamp};

use super::Core;
use crate::fleet::{Robot, Station};
use crate::models::{ShortEnergy, StationModels};
use crate::scheduler::HANDOVER_S;
use crate::scheduler::shed::{Draw, shed};
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

    /// Has a robot let out of its bay before it is charged.
    pub(super) fn let_go(&mut self, now: Timestamp, robot: &RobotId, leave: Leave) {
        let (Some(run), Some(belief)) = (self.running.get(robot), self.fleet.robots.get(robot)) else { return };
        let (stage, station, again) = (run.stage, run.station.clone(), self.again(now, belief, leave.why()));
        let why = self.why_left(now, robot, &station, leave);
        if let Some(run) = self.running.get_mut(robot) {
            (run.again, run.cut_short) = (Some(again), Some(why));
        }
        self.ask_robot(now, robot, RobotAction::Undock, Some((robot.clone(), stage)));
    }

    /// Lets go who takes from others what they were promised, where packs turn out to hold less than all of that. Where as many as
    /// possible are to get something, each goes on until nothing is left.
    pub(super) fn shed(&mut self, now: Timestamp) {
        if self.settings.short_energy == ShortEnergy::MostRobots {
            return;
        }
        let basis = self.basis(now);
        let goes = |(id, models): (&StationId, &StationModels)| {
            let station = self.fleet.stations.get(id)?;
            let runs: Vec<&ServiceRun> =
                self.running.values().filter(|run| run.station == *id && run.stage != Stage::LetOut && run.cut_short.is_none()).collect();
            if runs.len() < 2 || !station.heard()?.powered {
                return None;
            }
            let draw = |run: &&ServiceRun| {
                let ends_s = basis.ends_s(run);
                let is_heard = self.fleet.robots.get(&run.robot).is_some_and(|robot| robot.heard().is_some());
                let may_end = (charges(run.stage) || run.under_way()) && run.asked.is_none() && is_heard;
                Draw { ends_s, need: basis.still_needs(run, models, ends_s), may_end }
            };
            let draws: Vec<Draw> = runs.iter().map(draw).collect();
            let index = shed(&basis.station(id, models, Some(station)), &draws, self.settings.confidence)?;
            Some((runs[index].robot.clone(), id.clone(), runs[index].stage))
        };
        let gone: Vec<_> = self.models.stations.iter().filter_map(goes).collect();
        for (robot, station, stage) in gone {
            let leave = Leave::Power(format!("the packs of {station} hold less than was promised of them, and more is kept without it"));
            if charges(stage) {
                self.let_go(now, &robot, leave);
            } else {
                let why = self.why_left(now, &robot, &station, leave);
                self.fail(now, &robot, &why);
            }
        }
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

    /// How long there is until a station's packs have given out, s, and why somebody has to be out; none where that is longer than it takes
    /// to let all out (`all_s`), or where more energy comes in time. Without power nobody gets out of a bay.
    ///
    /// There are three accounts of what the packs hold: their gauges', their models' at the present load and, of a pack whose model is
    /// doubted, its voltage's. The least of them counts.
    fn gives_out(&self, now: Timestamp, run: &ServiceRun, station: &Station, all_s: f64) -> Option<(f64, String)> {
        let (state, models) = (station.heard()?, self.models.stations.get(&run.station)?);
        if !state.powered || state.pack_power_w <= 0.0 {
            return None;
        }
        let lasts_s = |wh: f64| wh * S_PER_H / state.pack_power_w - HANDOVER_S;
        let here = || state.packs.iter().filter(|pack| pack.connected && !pack.depleted);
        let gauged_wh = |pack: &PackId| {
            let (gauge, model) = (station.packs.get(pack)?, models.packs.get(pack)?);
            let owner = Owner::Pack(run.station.clone(), pack.clone());
            Some(self.trust.belief(now, &owner, gauge, model.battery().stored_wh()).1)
        };
        let gauged_wh = sum(here().filter_map(|pack| gauged_wh(&pack.pack)));
        let surely_wh = gauged_wh.value - self.settings.caution() * gauged_wh.sigma;
        // Where a pack's model is doubted, its voltage knows better in the end. It holds no more than that would mean at no current.
        let shown_at_most_wh = |pack: &PackId| {
            let soc = self.watch.shown_soc(&run.station, pack);
            soc.map_or(f64::INFINITY, |soc| models.packs.get(pack).map_or(0.0, |model| soc * model.battery().stored_wh()))
        };
        let shown_at_most_wh: f64 = here().map(|pack| shown_at_most_wh(&pack.pack)).sum();
        // Mostly there is plenty by any account, and the costly look below is not needed.
        if lasts_s(surely_wh.min(shown_at_most_wh)) > PLENTY * (all_s + HANDOVER_S) {
            return None;
        }
        let basis = self.basis(now);
        let view = basis.station(&run.station, models, Some(station));
        let held_wh = sum(view.packs.iter().filter(|pack| pack.available_s <= 0.0).map(|pack| pack.usable_wh)).value;
        // While promises are expected to be kept, the expected energy counts: none is broken only because it might be. Once they cannot be
        // kept anyway, only what is there for certain counts, so that at least nobody is left in a dark station.
        let is_enough = held_wh.min(gauged_wh.value) >= view.begun().mean_wh;
        let gauged_wh = if is_enough { gauged_wh.value } else { surely_wh };
        let left_s = lasts_s(held_wh.min(gauged_wh).min(basis.shown_wh(&run.station, models, station, state)));
        // A pack that is brought in time is waited for, and so is what charges packs that rest.
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

/// What several packs hold, each uncertain by itself, Wh.
fn sum(packs: impl Iterator<Item = Estimate>) -> Estimate {
    packs.fold(Estimate::exact(0.0), |sum, pack| Estimate::new(sum.value + pack.value.max(0.0), sum.sigma.hypot(pack.sigma)))
}

/// Whether somebody is charged in a bay.
fn charges(stage: Stage) -> bool {
    matches!(stage, Stage::Charging | Stage::ChargingItself)
}
