//! New promises are as certain as is asked for once the packs are stepped along their load.
//!
//! Counting errs on the safe side where all robots are alike. Where unlike ones come, it is done at their mean power, and a plan can promise what the
//! packs do not hold for sure.

use std::collections::{BTreeMap, BTreeSet};

use proto::{RobotId, StationId};

use super::{Asked, Solved};
use crate::scheduler::again::{as_is_lacking, count_less, unsure};
use crate::scheduler::effort::Effort;
use crate::scheduler::plan::{Planned, Rejected};
use crate::scheduler::translate::Offer;

/// How often less is counted on, each time by as much as is lacking: after that who is not sure goes without.
const TIMES: usize = 4;
/// So often one service of each station is left out at a time, and after that all that are unsure.
const ONE_EACH: usize = 8;

impl Asked<'_> {
    /// The plan, or one that counts on less where its new promises are not sure enough; if no such plan is found that breaks no more promises, the
    /// same without them. A policy that is told what to do does that.
    pub(super) fn made_sure(&self, best: Solved, offer: Offer<'_>) -> Solved {
        let first = self.new_and_unsure(&best);
        if first.is_empty() || !self.is_small() || !self.settings.policy.searches() {
            return best;
        }
        let mut view = best.task.view.clone();
        let (mut last, mut now) = (best.clone(), first.clone());
        for _ in 0..TIMES {
            count_less(&mut view, &last.plan, &now, as_is_lacking(self.settings.confidence));
            last = self.planned(view.clone(), offer);
            now = self.new_and_unsure(&last);
            if now.is_empty() {
                break;
            }
        }
        let without = self.without(best, first);
        if !now.is_empty() || self.is_better(&without, &last) {
            return without;
        }
        last.plan.quality.no_more_is_proven_than(without.plan.quality);
        // What is asked of the plan after this begins from what the packs hold.
        for (station, full) in last.task.view.stations.iter_mut().zip(&without.task.view.stations) {
            station.packs.clone_from(&full.packs);
        }
        last
    }

    /// Whether what a plan promises anew is as certain as is asked.
    pub(super) fn is_sure(&self, solved: &Solved) -> bool {
        self.new_and_unsure(solved).is_empty()
    }

    /// Whom a plan promises something for the first time that is less certain than is asked. What was promised is held to as it is.
    fn new_and_unsure(&self, solved: &Solved) -> BTreeSet<RobotId> {
        let held = |robot: &RobotId| self.view.robots.iter().any(|view| view.held && view.robot == *robot);
        let unsure = unsure(&solved.plan, &solved.plan, self.before, self.settings.confidence);
        unsure.into_iter().filter(|robot| !held(robot)).collect()
    }

    /// The plan without those of its unsure services that begin last, at each station one after the other, until the rest is sure: who shares the
    /// moment at which the packs give out with one too many is as unsure as that one.
    fn without(&self, mut best: Solved, mut unsure: BTreeSet<RobotId>) -> Solved {
        // To leave all out is done once: whatever a mended plan then promises, it ends.
        for round in 0..=ONE_EACH {
            let mut last: BTreeMap<&StationId, &Planned> = BTreeMap::new();
            for planned in best.plan.planned.iter().filter(|planned| unsure.contains(&planned.robot)) {
                let latest = last.entry(&planned.station).or_insert(planned);
                if planned.start > latest.start {
                    *latest = planned;
                }
            }
            let one_each: BTreeSet<RobotId> = last.into_values().map(|planned| planned.robot.clone()).collect();
            best = self.but(&best, if round < ONE_EACH { &one_each } else { &unsure });
            unsure = self.new_and_unsure(&best);
            if unsure.is_empty() {
                break;
            }
        }
        best
    }

    /// The plan without the services of these, and all others as they are.
    fn but(&self, best: &Solved, unsure: &BTreeSet<RobotId>) -> Solved {
        let mut kept = best.plan.clone();
        kept.planned.retain(|planned| !unsure.contains(&planned.robot));
        let strands = |robot: &RobotId| {
            let index = best.task.view.robots.iter().position(|view| view.robot == *robot);
            index.is_some_and(|index| best.task.problem.strands(index))
        };
        kept.rejected.extend(unsure.iter().map(|robot| Rejected {
            robot: robot.clone(),
            stranded: strands(robot),
            reasons: vec!["the packs are not sure enough to last for it".to_owned()],
            short: None,
        }));
        let nobody = BTreeSet::new();
        Asked { effort: Effort::Mend, ..*self }.beside(&kept, (best.task.view.clone(), &best.plan), &nobody, Offer::Usual).0
    }
}
