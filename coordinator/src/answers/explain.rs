//! Why robots are serviced as they are, and what has changed for them.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::Model;
use proto::{Alternative, Doubt, Explanation, Gauge, Mode, RobotId, Schedule, Service, ServiceStatus, Timestamp, Unserved};

use crate::models::from_wire;
use crate::scheduler::Accounts;
use crate::service_run::{ServiceRun, Stage};
use crate::trust::Owner;
use crate::view::Basis;
use crate::when;

/// Explains robot after robot from one plan.
pub struct Explainer<'a, 'w> {
    basis: Basis<'a>,
    accounts: Option<Accounts<'w, 'a>>,
    services: BTreeMap<&'a RobotId, &'a Service>,
    unserved: BTreeMap<&'a RobotId, &'a Unserved>,
    doubts: Vec<Doubt>,
}

impl<'a, 'w> Explainer<'a, 'w> {
    /// Of what is believed now, the problem that the last plan solved, and what it came to.
    #[must_use]
    pub fn new(basis: Basis<'a>, accounts: Option<Accounts<'w, 'a>>, schedule: &'a Schedule) -> Self {
        Self {
            services: services(schedule),
            unserved: schedule.unserved.iter().map(|unserved| (&unserved.robot, unserved)).collect(),
            doubts: basis.watch.doubts(basis.now, basis.fleet, basis.models),
            basis,
            accounts,
        }
    }

    /// Why a robot is serviced as it is. `changed` is what is different from the plan before.
    ///
    /// # Errors
    /// When the robot is not known, with the nearest that is.
    pub fn explain(&mut self, robot: &RobotId, changed: &[String]) -> Result<Explanation, String> {
        let basis = &self.basis;
        let Some(belief) = basis.fleet.robots.get(robot) else {
            return Err(basis.fleet.unknown(robot));
        };
        let service = self.services.get(robot).copied();
        let mut reasons = Vec::new();
        let since = belief.lost_since.map(|since| when::minute_from(basis.now, since));
        reasons.extend(since.map(|since| format!("it has not been heard since {since}: what follows is what it said before")));
        if let Some((gauge, state)) = belief.known() {
            let (soc, left) = (gauge.soc, gauge.remaining_wh);
            reasons.push(format!(
                "{} at {:.1} ± {:.1} % charge, {:.1} ± {:.1} Wh left",
                state.phase,
                soc.value * 100.0,
                soc.sigma * 100.0,
                left.value,
                left.sigma
            ));
        } else if belief.gauge.is_some() && belief.state.is_none() && !basis.models.robots.contains_key(robot) {
            reasons.push("nothing but its gauge is taken: it is not configured, and its battery is not known by what it calls it: add it to [robots]".to_owned());
        } else {
            reasons.push("it has not been heard, or was lost".to_owned());
        }
        if let Some((gauge, state)) = belief.known()
            && let Some(model) = basis.models.battery(robot, &state.battery)
        {
            reasons.extend(learned(basis, &Owner::Robot(robot.clone()), model, gauge));
        }
        reasons.extend(basis.running.get(robot).map(|run| stands(basis.now, run)));
        let fault = basis.trust.fault(basis.now, &Owner::Robot(robot.clone()));
        reasons.extend(fault.map(|fault| format!("its gauge {fault}: the plan counts on less, and less certainly")));
        match (service, self.unserved.get(robot)) {
            (Some(service), _) => reasons.extend(service.why.iter().cloned()),
            (None, Some(unserved)) => {
                // What it does stands above already.
                let phase = belief.known().map(|(_, state)| state.phase.to_string());
                reasons.extend(unserved.reasons.iter().filter(|reason| Some(*reason) != phase.as_ref()).cloned());
            }
            (None, None) => reasons.push("no service is planned".to_owned()),
        }
        let at = service.map(|service| &service.station);
        for (station, pack) in service.into_iter().flat_map(|service| service.packs.iter().map(move |pack| (&service.station, pack))) {
            let owner = Owner::Pack(station.clone(), pack.clone());
            let fault = basis.trust.fault(basis.now, &owner);
            reasons.extend(fault.map(|fault| format!("the gauge of {owner} {fault}: the plan counts on less of it, and less certainly")));
            let gauge = basis.fleet.stations.get(station).and_then(|station| station.packs.get(pack));
            let model = basis.models.stations.get(station).and_then(|models| models.packs.get(pack));
            reasons.extend(gauge.zip(model).and_then(|(gauge, model)| learned(basis, &owner, model, gauge)));
        }
        // What a service rests on: the robot's own models, and those of its station.
        let concerns = |doubt: &&Doubt| doubt.robot.as_ref() == Some(robot) || doubt.station.is_some() && doubt.station.as_ref() == at;
        let doubts = self.doubts.iter().filter(concerns).cloned().collect();
        // What has begun is kept: there is nothing else to it.
        let begun = basis.running.contains_key(robot);
        let told = self.accounts.as_mut().filter(|_| !begun).map(|accounts| accounts.of(robot)).unwrap_or_default();
        reasons.extend(told.when_wanted);
        let alternatives = told.others.into_iter().map(|other| Alternative {
            station: other.station,
            mode: other.mode.to_owned(),
            start: other.start,
            why_not: other.why_not,
        });
        Ok(Explanation {
            at: basis.now,
            robot: robot.clone(),
            service: service.cloned(),
            reasons,
            alternatives: alternatives.collect(),
            doubts,
            earlier: told.earlier,
            changed: changed.to_vec(),
        })
    }
}

/// What a gauge has learned of its battery's capacity, where that is planned with.
fn learned(basis: &Basis<'_>, owner: &Owner, model: &Arc<Model>, gauge: &Gauge) -> Option<String> {
    basis.tables.worn.origin(&basis.worn(owner, model, gauge))?;
    let soh = from_wire(gauge.soh);
    let text = format!("{:.1} ± {:.1} % of the rated capacity", 100.0 * soh.value, 100.0 * soh.sigma);
    Some(format!("the gauge of {owner} finds {text}, which is planned with"))
}

/// Where a service that has begun stands, and what it waits for.
fn stands(now: Timestamp, run: &ServiceRun) -> String {
    let at = match run.stage {
        Stage::Travelling => "it was told to come",
        Stage::Waiting => "it waits at the station",
        Stage::Loading => "it is brought into its bay",
        Stage::Charging | Stage::ChargingItself => "it is in its bay to be charged",
        Stage::Handing => "its pack is about to be exchanged",
        Stage::Swapping => "its pack is being exchanged",
        Stage::Unloading => "it is let out",
        Stage::LetOut => "it was let out, and has not said so yet",
    };
    let waits = match (&run.asked, &run.again) {
        (Some(command), _) => format!("; {command} has not been answered yet"),
        (None, Some(again)) => format!("; it is asked again at {}: {}", when::second_from(now, again.at), again.why),
        (None, None) => String::new(),
    };
    format!("its service has begun: {at}{waits}")
}

fn services(schedule: &Schedule) -> BTreeMap<&RobotId, &Service> {
    schedule.services.iter().map(|service| (&service.robot, service)).collect()
}

/// What is different for robots between two schedules, a sentence each. Services that began as planned are
/// no difference.
#[must_use]
pub fn changes(before: &Schedule, after: &Schedule) -> Vec<(RobotId, String)> {
    let told = |service: &Service| {
        let start: String = service.start.to_string().chars().skip(11).take(8).collect();
        let how = match &service.mode {
            Mode::Recharge { to_soc } => format!("to {:.0} %", to_soc * 100.0),
            Mode::Swap { spare } => format!("for {spare}"),
        };
        let bay = service.bay.as_ref().map_or_else(String::new, |bay| format!(" {bay}"));
        format!("{start} at {}{bay} ({how})", service.station)
    };
    let because = format!("plan {}, because {}", after.plan, after.trigger);
    let (old, new) = (services(before), services(after));
    let of_new = |(robot, new): (&&RobotId, &&Service)| {
        let given = || Some(format!("{because}: it was given a service, {}", told(new)));
        let what = match old.get(*robot) {
            None => given(),
            // The one before is over.
            Some(old) if old.status != ServiceStatus::Planned && new.status == ServiceStatus::Planned => given(),
            Some(old) if new.status == ServiceStatus::Planned => {
                let moved = old.station != new.station || old.start != new.start || old.mode != new.mode;
                moved.then(|| format!("{because}: it was moved from {} to {}", told(old), told(new)))
            }
            Some(_) => None,
        }?;
        Some((RobotId::clone(robot), what))
    };
    let lost = |robot: &RobotId| {
        let old = old.get(robot).filter(|old| old.status == ServiceStatus::Planned && !new.contains_key(robot))?;
        Some((robot.clone(), format!("{because}: it lost its service, {}", told(old))))
    };
    // Who had none and is to run empty now.
    let runs_empty = |schedule: &Schedule, robot: &RobotId| schedule.unserved.iter().any(|left| left.robot == *robot && left.runs_empty);
    let left_out = after
        .unserved
        .iter()
        .filter(|left| left.runs_empty)
        .map(|left| &left.robot)
        .filter(|robot| !runs_empty(before, robot) && old.get(robot).is_none_or(|old| old.status != ServiceStatus::Planned));
    let left_out = left_out.map(|robot| (robot.clone(), format!("{because}: it is left without a service, and runs empty")));
    new.iter().filter_map(of_new).chain(old.keys().filter_map(|robot| lost(robot))).chain(left_out).collect()
}

#[cfg(test)]
mod tests {
    use proto::{Estimate, Timestamp};

    use super::*;

    fn at(after_s: i64) -> Timestamp {
        Timestamp::from_unix_ms(1_767_225_600_000 + after_s * 1000)
    }

    fn id<T: std::str::FromStr<Err = proto::IdError>>(text: &str) -> T {
        text.parse().unwrap()
    }

    /// A service of robot r that begins then, for this spare.
    fn service(start_s: i64, spare: &str, status: ServiceStatus) -> Service {
        Service {
            robot: id("r"),
            station: id("s"),
            mode: Mode::Swap { spare: id(spare) },
            bay: None,
            packs: Vec::new(),
            leave: at(start_s - 60),
            start: at(start_s),
            end: at(start_s + 60),
            pack_energy_wh: Estimate::new(0.2, 0.0),
            probability: None,
            status,
            why: Vec::new().into(),
        }
    }

    fn schedule(services: Vec<Service>, runs_empty: bool) -> Schedule {
        let left = Unserved { robot: id("r"), runs_empty, reasons: Vec::new() };
        Schedule {
            at: at(0),
            plan: 7,
            policy: "optimise".to_owned(),
            trigger: "q joined".to_owned(),
            unserved: if services.is_empty() { vec![left] } else { Vec::new() },
            services,
            doubts: Vec::new(),
            quality: None,
        }
    }

    /// What is told of robot r, without the words that are always the same.
    fn told(before: &Schedule, after: &Schedule) -> Option<String> {
        let all = changes(before, after);
        assert!(all.len() <= 1, "{all:?}");
        let (_, what) = all.into_iter().next()?;
        Some(what.strip_prefix("plan 7, because q joined: it ").unwrap().to_owned())
    }

    #[test]
    fn what_is_different_is_told_once_and_as_what_it_is() {
        use ServiceStatus::{Charging, Planned};
        let with = |service: Service| schedule(vec![service], false);
        let (planned, none, empty) = (with(service(3600, "spare-1", Planned)), schedule(vec![], false), schedule(vec![], true));
        assert_eq!(told(&none, &planned).unwrap(), "was given a service, 01:00:00 at s (for spare-1)");
        assert_eq!(told(&planned, &planned), None);
        let moved = with(service(3600, "spare-2", Planned));
        assert_eq!(told(&planned, &moved).unwrap(), "was moved from 01:00:00 at s (for spare-1) to 01:00:00 at s (for spare-2)");
        // One that has begun is no move; the next one after it is a service of its own.
        assert_eq!(told(&planned, &with(service(3605, "spare-1", Charging))), None);
        let next = with(service(7200, "spare-1", Planned));
        assert_eq!(told(&with(service(3600, "spare-1", Charging)), &next).unwrap(), "was given a service, 02:00:00 at s (for spare-1)");
        assert_eq!(told(&planned, &empty).unwrap(), "lost its service, 01:00:00 at s (for spare-1)");
        assert_eq!(told(&none, &empty).unwrap(), "is left without a service, and runs empty");
        assert_eq!(told(&empty, &empty), None);
    }
}
