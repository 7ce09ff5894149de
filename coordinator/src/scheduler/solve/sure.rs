//! New promises are as certain as is asked for once the packs are stepped along their load.
//!
//! Counting errs on the safe side where all robots are alike. Where unlike ones come, it is done at their mean power, and a plan can promise what the
//! packs do not hold for sure.

use std::collections::BTreeSet;

use proto::RobotId;

use super::{Asked, Solved};
use crate::scheduler::again::{as_is_lacking, count_less, unsure};
use crate::scheduler::effort::Effort;
use crate::scheduler::plan::Rejected;
use crate::scheduler::translate::Offer;

/// How often less is counted on, each time by as much as is lacking: after that who is not sure goes without.
const TIMES: usize = 4;

impl Asked<'_> {
    /// The plan, or one that counts on less where its new promises are not sure enough; if no such plan is found that breaks no more promises, the
    /// same without them. A policy that is told what to do does that.
    pub(super) fn made_sure(&self, best: Solved, offer: Offer<'_>) -> Solved {
        let first = self.new_and_unsure(&best);
        if first.is_empty() || !self.is_small() || !self.settings.policy.searches() {
            return best;
        }
        let (full, mut view) = (&best.task.view, best.task.view.clone());
        let (mut last, mut now) = (best.clone(), first.clone());
        for _ in 0..TIMES {
            count_less(&mut view, &last.plan, &now, as_is_lacking(self.settings.confidence));
            last = self.planned(view.clone(), offer);
            now = self.new_and_unsure(&last);
            if now.is_empty() {
                break;
            }
        }
        if !now.is_empty() || self.broken(&last) > self.broken(&best) {
            return self.without(&best, &first);
        }
        last.plan.quality.no_more_is_proven_than(best.plan.quality);
        // What is asked of the plan after this begins from what the packs hold.
        for (station, full) in last.task.view.stations.iter_mut().zip(&full.stations) {
            station.packs.clone_from(&full.packs);
        }
        last
    }

    /// Whom a plan promises something for the first time that is less certain than is asked. What was promised is held to as it is.
    fn new_and_unsure(&self, solved: &Solved) -> BTreeSet<RobotId> {
        let held = |robot: &RobotId| self.view.robots.iter().any(|view| view.held && view.robot == *robot);
        let unsure = unsure(&solved.plan, &solved.plan, self.before, self.settings.confidence);
        unsure.into_iter().filter(|robot| !held(robot)).collect()
    }

    /// The plan without the services of these, and all others as they are.
    fn without(&self, best: &Solved, unsure: &BTreeSet<RobotId>) -> Solved {
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
