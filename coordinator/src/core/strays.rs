//! Robots that are on their way, in a bay or being exchanged although no service of this coordinator
//! put them there: a coordinator before it did, or a command whose answer was lost, or robot and
//! station by themselves while no coordinator was heard.

use std::collections::BTreeMap;

use energy::Need;
use proto::{BayId, BayPhase, EventKind, RobotAction, RobotId, RobotPhase, StationAction, StationId, Timestamp};

use super::Core;
use crate::fleet::Station;
use crate::scheduler::translate::HORIZON_MAX_S;
use crate::service_run::{How, ServiceRun, Stage};

/// Where a station says that a robot is.
enum Held {
    /// In a bay.
    InBay(StationId, BayId),
    /// On the lift, or its pack is being exchanged: that ends by itself.
    Moving,
    /// Nowhere.
    Nowhere,
}

impl Core {
    /// Takes over what can be carried on, and frees what cannot. Before it frees anything it waits
    /// for longer than any command lives, so that no answer is under way.
    pub(super) fn find_strays(&mut self, now: Timestamp) {
        let mut held = self.held();
        for robot in self.fleet.robots.keys().cloned().collect::<Vec<_>>() {
            let place = held.remove(&robot).unwrap_or(Held::Nowhere);
            match self.stray(&robot, &place) {
                Some(phase) => {
                    let since = *self.strays.entry(robot.clone()).or_insert(now);
                    self.settle(now, &robot, phase, place, self.is_settled(now, since));
                }
                None => drop(self.strays.remove(&robot)),
            }
        }
    }

    /// Whether a robot has been astray for longer than any command lives.
    fn is_settled(&self, now: Timestamp, since: Timestamp) -> bool {
        now.seconds_since(since) > self.settings.deadline_s + self.settings.resend_s
    }

    /// Whether a station says that it moves or holds a robot that has just said that it is free: one of the two
    /// has not heard of the other yet.
    pub(super) fn is_being_moved(&self, now: Timestamp, robot: &RobotId) -> bool {
        let claims = |station: &Station| {
            let state = station.known();
            state.is_some_and(|state| {
                state.swapping.as_ref() == Some(robot) || state.bays.iter().any(|bay| bay.robot.as_ref() == Some(robot))
            })
        };
        self.fleet.stations.values().any(claims) && !self.strays.get(robot).is_some_and(|since| self.is_settled(now, *since))
    }

    /// What a robot without a service does, if that is anything that needs looking after.
    fn stray(&self, robot: &RobotId, place: &Held) -> Option<RobotPhase> {
        if self.running.contains_key(robot) {
            return None;
        }
        let (_, state) = self.fleet.robots.get(robot)?.heard()?;
        match state.phase {
            RobotPhase::Stranded => None,
            // It plans like any other, unless a station believes to have it.
            RobotPhase::Working | RobotPhase::Waiting => (!matches!(place, Held::Nowhere)).then_some(state.phase),
            phase => Some(phase),
        }
    }

    /// Where stations say that robots are; of two that say so, the first.
    fn held(&self) -> BTreeMap<RobotId, Held> {
        let mut held = BTreeMap::new();
        for (id, station) in &self.fleet.stations {
            let Some(state) = station.heard() else { continue };
            if let Some(robot) = &state.swapping {
                held.entry(robot.clone()).or_insert(Held::Moving);
            }
            for bay in &state.bays {
                let Some(robot) = &bay.robot else { continue };
                let in_bay = || Held::InBay(id.clone(), bay.bay.clone());
                held.entry(robot.clone()).or_insert_with(|| if bay.phase == BayPhase::Occupied { in_bay() } else { Held::Moving });
            }
        }
        held
    }

    fn settle(&mut self, now: Timestamp, robot: &RobotId, phase: RobotPhase, place: Held, settled: bool) {
        use RobotPhase::{Charged, Charging, Docked, Stranded, Swapping, Travelling, Waiting, Working};
        match (phase, place) {
            // Who charges is told how far: by itself it would go on to where its own rule ends.
            (Docked | Charging, Held::InBay(station, bay)) => self.adopt(now, robot, station, bay, Stage::Loading),
            (Charged, Held::InBay(station, bay)) => self.adopt(now, robot, station, bay, Stage::Charging),
            // It drove in by itself, which no station need see, or its station has forgotten it: nobody else is sent into that bay.
            (Docked | Charging, Held::Nowhere) => self.adopt_unseen(now, robot, Stage::Waiting),
            // Who was just let out says so a moment later.
            (Charged, Held::Nowhere) if settled => self.adopt_unseen(now, robot, Stage::ChargingItself),
            (Travelling, _) => {
                let Some(station) = self.fleet.robots.get(robot).and_then(|belief| belief.state.as_ref()?.station.clone()) else { return };
                // Who was just called back says so a moment later.
                if !settled && self.refusals.holds(now, robot, &station).is_some() {
                    return;
                }
                match self.says_bay(robot) {
                    Some((station, bay)) => self.adopt(now, robot, station, bay, Stage::Travelling),
                    // Without a bay it comes for an exchange that was promised, or goes by its own rule, and plans when it is there.
                    None => self.adopt_exchange(now, robot, &station),
                }
            }
            // The exchange was never begun: back to work, and planned anew.
            (Swapping, Held::Nowhere) if settled => {
                self.strays.insert(robot.clone(), now);
                self.ask_robot(now, robot, RobotAction::Undock, None);
            }
            // It is gone, and its bay still waits for it.
            (Working, Held::InBay(station, bay)) if settled => {
                self.strays.insert(robot.clone(), now);
                self.ask_station(now, &station, StationAction::Undock { robot: robot.clone(), bay }, None);
            }
            (Working | Waiting | Docked | Charging | Charged | Swapping | Stranded, _) => {}
        }
    }

    /// The bay that a robot names.
    fn says_bay(&self, robot: &RobotId) -> Option<(StationId, BayId)> {
        let state = self.fleet.robots.get(robot)?.state.as_ref()?;
        Some((state.station.clone()?, state.bay.clone()?))
    }

    /// Carries on what goes on in a bay that its station calls free.
    fn adopt_unseen(&mut self, now: Timestamp, robot: &RobotId, stage: Stage) {
        let Some((station, bay)) = self.says_bay(robot) else { return };
        let known = self.fleet.stations.get(&station);
        if known.is_some_and(|known| known.heard().is_some() && known.bay_phase(&bay) == Some(BayPhase::Free)) {
            self.adopt(now, robot, station, bay, stage);
        }
    }

    /// Carries on from `stage` what somebody else has begun.
    fn adopt(&mut self, now: Timestamp, robot: &RobotId, station: StationId, bay: BayId, stage: Stage) {
        // A bay belongs to one service; who comes second is planned anew when it stands there. Who is in it is let out,
        // also when somebody is on the way to it: nobody else would.
        let before = |run: &ServiceRun| run.is_in(&station, &bay) && (run.at_place() || (stage == Stage::Travelling && run.under_way()));
        // What was refused to who was there is asked again later; who comes all the same is waited for.
        let is_refused = self.refusals.holds(now, robot, &station).is_some_and(|refusal| refusal.at_place);
        if is_refused && stage != Stage::Travelling || self.running.values().any(before) || !self.models.stations.contains_key(&station) {
            return;
        }
        // In a bay without power nothing can be carried on before that comes back.
        let known = self.fleet.stations.get(&station).and_then(Station::known);
        if stage != Stage::Travelling && known.is_some_and(|state| !state.powered) {
            return;
        }
        let Some(state) = self.fleet.robots.get(robot).and_then(|belief| belief.state.as_ref()) else { return };
        let promised_soc = self.promised_soc(now, robot, &station);
        let to_soc = promised_soc.unwrap_or(self.settings.charge_to_soc);
        let charge_s = self.models.battery(robot, &state.battery).map_or(0.0, |battery| {
            let facts = battery.battery();
            to_soc * facts.capacity_ah / facts.charge.current_a * energy::units::S_PER_H
        });
        let is_unseen = matches!(stage, Stage::Waiting | Stage::ChargingItself);
        let unseen = if is_unseen { format!(", in {bay} by its own word, which is free by the station's") } else { String::new() };
        let promised = promised_soc.map(|to_soc| format!("to {:.0} %, as the coordinator before promised", to_soc * 100.0));
        self.carry_on_from(now, robot, &station, (How::Recharge { bay, to_soc }, stage, charge_s), (promised, &unseen));
    }

    /// Carries on an exchange that the coordinator before promised, and for which the robot is on its way.
    fn adopt_exchange(&mut self, now: Timestamp, robot: &RobotId, station: &StationId) {
        let Some(spare) = self.promised_spare(now, robot, station) else { return };
        let Some(swap_s) = self.models.stations.get(station).map(|models| models.handling.swap_s) else { return };
        let promised = format!("for {spare}, as the coordinator before promised");
        self.carry_on_from(now, robot, station, (How::Swap { spare }, Stage::Travelling, swap_s), (Some(promised), ""));
    }

    /// Carries on a service from a stage; it lasts so many seconds beside the way.
    fn carry_on_from(
        &mut self,
        now: Timestamp,
        robot: &RobotId,
        station: &StationId,
        (how, stage, lasts_s): (How, Stage, f64),
        (promised, unseen): (Option<String>, &str),
    ) {
        let known = self.fleet.stations.get(station).and_then(Station::known);
        let packs = known.and_then(|state| state.active_pack.clone()).into_iter().collect();
        let Some(state) = self.fleet.robots.get(robot).and_then(|belief| belief.state.as_ref()) else { return };
        let travel_s = if stage == Stage::Travelling { state.travel.get(station).map_or(0.0, |way| way.time_s) } else { 0.0 };
        // No place is held for who says that it comes later than anybody plans ahead.
        if travel_s > HORIZON_MAX_S {
            return;
        }
        let start = now.plus_s(travel_s);
        let mut why = vec!["begun by the coordinator before this one, or by the robot itself".to_owned()];
        why.extend(promised);
        let mut run = ServiceRun {
            robot: robot.clone(),
            station: station.clone(),
            how,
            left: now,
            start,
            end: start.plus_s(lasts_s),
            need: Need::default(),
            packs,
            why: why.into(),
            stage,
            asked: None,
            hands_over: None,
            takes_none_since: None,
            called_off_since: None,
            cut_short: None,
            again: None,
        };
        // Who was just called back because its station leaves is still on its way for a moment.
        if self.fleet.stations.get(station).is_some_and(|place| self.comes_too_late(now, &run, place).is_some()) {
            return;
        }
        let basis = self.basis(now);
        run.need = basis.still_needs(&run, &self.models.stations[station], basis.ends_s(&run));
        self.strays.remove(robot);
        self.changed.insert(robot.clone(), vec![format!("it is taken over at {station} as it was found")]);
        self.plan.planned.retain(|planned| planned.robot != *robot);
        self.event(now, EventKind::ServiceStarted, Some(robot), Some(station), None, format!("{robot} is taken over at {station}{unseen}"));
        self.running.insert(robot.clone(), run);
        self.refresh_schedule(now);
    }
}
