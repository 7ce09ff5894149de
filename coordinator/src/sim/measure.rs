//! What is counted in a run.

use std::collections::{BTreeMap, BTreeSet};

use proto::{Capacity, Event, EventKind, RobotId, Schedule};

/// What a run came to.
#[derive(Debug, Clone, Default)]
pub struct Measured {
    /// Every metric by name; see [`crate::scenario::METRICS`].
    pub metrics: BTreeMap<String, f64>,
    /// The first plan.
    pub first_plan: Option<Schedule>,
    /// What each pack could service at the first plan.
    pub first_capacity: Option<Capacity>,
    served: BTreeSet<RobotId>,
    broken: BTreeSet<RobotId>,
    switches: u32,
    depleted: u32,
    swaps: u32,
    doubted: u32,
    services: u32,
    moved: usize,
    /// Sum of the plans' gaps, and how many there were.
    gaps: (f64, u32),
    /// True state of charge of every pack when the last service so far was done.
    socs_after_services: Vec<(String, f64)>,
}

impl Measured {
    pub(super) fn event(&mut self, event: &Event, socs: impl FnOnce() -> Vec<(String, f64)>) {
        match (event.kind, &event.robot) {
            (EventKind::ServiceDone, Some(robot)) => {
                self.served.insert(robot.clone());
                // A promise that was broken and then kept after all is a kept one; what was kept before says nothing of it.
                self.broken.remove(robot);
                self.services += 1;
                self.socs_after_services = socs();
            }
            (EventKind::PromiseBroken, Some(robot)) => drop(self.broken.insert(robot.clone())),
            (EventKind::PackSelected, _) => self.switches += 1,
            (EventKind::PackDepleted, _) => self.depleted += 1,
            (EventKind::ModelDoubted, _) => self.doubted += 1,
            _ => {}
        }
    }

    pub(super) fn plan(&mut self, plan: &Schedule) {
        if let Some(quality) = &plan.quality {
            self.moved += quality.moved.len();
            if let Some(gap) = quality.gap() {
                self.gaps = (self.gaps.0 + gap, self.gaps.1 + 1);
            }
        }
        if self.first_plan.is_none() {
            self.first_plan = Some(plan.clone());
        }
    }

    pub(super) fn swap(&mut self) {
        self.swaps += 1;
    }

    /// Ends the count with what bodies hold: totals by metric, and each pack's true state of charge.
    pub(super) fn finish(&mut self, totals: &[(&str, f64)], socs: Vec<(String, f64)>) {
        let promised = self.first_plan.as_ref().map_or(0, |plan| plan.services.len());
        let per_pack = self.first_capacity.as_ref().map_or(0, |capacity| capacity.robots_promised);
        let counted = [
            ("services_promised", promised as f64),
            ("robots_promised", f64::from(per_pack)),
            ("robots_served", self.served.len() as f64),
            ("promises_broken", self.broken.len() as f64),
            ("packs_depleted", f64::from(self.depleted)),
            ("pack_switches", f64::from(self.switches)),
            ("swaps", f64::from(self.swaps)),
            ("models_doubted", f64::from(self.doubted)),
            ("services_done", f64::from(self.services)),
            ("services_moved", self.moved as f64),
            ("plan_gap", self.gaps.0 / f64::from(self.gaps.1.max(1))),
        ];
        self.metrics.extend(counted.iter().chain(totals).map(|&(name, value)| (name.to_owned(), value + 0.0)));
        let energy_wh = self.metrics.get("pack_energy_wh").copied().unwrap_or(0.0);
        self.metrics.insert("energy_per_service_wh".to_owned(), energy_wh / f64::from(self.services.max(1)));
        let after = std::mem::take(&mut self.socs_after_services);
        let after = if after.is_empty() { socs.clone() } else { after };
        self.metrics.extend(after.into_iter().map(|(pack, soc)| (format!("soc_after_services.{pack}"), soc)));
        self.metrics.extend(socs.into_iter().map(|(pack, soc)| (format!("soc.{pack}"), soc)));
    }
}

#[cfg(test)]
mod tests {
    use proto::Timestamp;

    use super::*;

    #[test]
    fn a_service_done_mends_only_what_was_broken_before_it() {
        let broken = |kinds: &[EventKind]| {
            let mut measured = Measured::default();
            for (number, &kind) in kinds.iter().enumerate() {
                let robot = Some(RobotId::new("r-1").unwrap());
                let event = Event {
                    seq: number as u64,
                    at: Timestamp::from_unix_ms(number as i64),
                    kind,
                    robot,
                    station: None,
                    pack: None,
                    text: String::new(),
                };
                measured.event(&event, Vec::new);
            }
            measured.finish(&[], Vec::new());
            measured.metrics["promises_broken"]
        };
        assert_eq!(broken(&[EventKind::PromiseBroken, EventKind::ServiceDone]), 0.0);
        assert_eq!(broken(&[EventKind::ServiceDone, EventKind::PromiseBroken]), 1.0);
    }
}
