//! A plan leaves nobody out: every robot that is known has a service or the reasons why not.

use std::collections::BTreeSet;

use proto::Schedule;

use crate::fleet::Fleet;

/// Who is in no list, in two, or without a reason; and a bay or spare that two services have at once.
pub(in crate::sim) fn plan_tells_of_everybody(plan: &Schedule, fleet: &Fleet) -> Vec<String> {
    let mut found = Vec::new();
    let mut told = BTreeSet::new();
    let named = plan.services.iter().map(|service| &service.robot).chain(plan.unserved.iter().map(|unserved| &unserved.robot));
    for robot in named {
        if !told.insert(robot) {
            found.push(format!("plan {} names {robot} twice", plan.plan));
        }
    }
    for (robot, belief) in &fleet.robots {
        if belief.known().is_some() && !told.contains(robot) {
            found.push(format!("plan {} does not tell of {robot}", plan.plan));
        }
    }
    for unserved in plan.unserved.iter().filter(|unserved| unserved.reasons.iter().all(String::is_empty)) {
        found.push(format!("plan {} leaves {} out without a reason", plan.plan, unserved.robot));
    }
    for (index, one) in plan.services.iter().enumerate() {
        for other in plan.services[..index].iter().filter(|other| other.station == one.station) {
            let at_once = one.start < other.end && other.start < one.end;
            if one.bay.is_some() && one.bay == other.bay && at_once {
                found.push(format!("plan {} gives one bay to {} and {}: {one:?} {other:?}", plan.plan, one.robot, other.robot));
            }
            if let (proto::Mode::Swap { spare: mine }, proto::Mode::Swap { spare: yours }) = (&one.mode, &other.mode)
                && mine == yours
            {
                found.push(format!("plan {} gives {mine} to {} and {}", plan.plan, one.robot, other.robot));
            }
        }
    }
    found
}
