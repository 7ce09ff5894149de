//! What is still to be told of a new plan. It is told with the next ticks, a little at a time: the plan comes first,
//! and who joins meanwhile does not wait for it.

use std::collections::BTreeSet;
use std::ops::Bound;

use proto::{RobotId, Timestamp};

/// Robots that are explained at once: it takes a look at all that each could have.
const AT_ONCE: usize = 16;
/// Shortest time between two tellings of what packs can service, s, where plans are only mended.
const CAPACITY_APART_S: f64 = 5.0;

/// See the module's text.
#[derive(Debug, Default)]
pub(super) struct Untold {
    /// Whether what packs can service is to be told.
    capacity: bool,
    /// When that was last told.
    pub(super) counted: Option<Timestamp>,
    /// Robots for which something is different.
    changed: BTreeSet<RobotId>,
    /// Robots that may have other alternatives now.
    others: BTreeSet<RobotId>,
    /// The last of them that was told of: in a fleet that is planned anew before all were told of, nobody is left out.
    reached: Option<RobotId>,
}

impl Untold {
    /// There is a new plan, in which something is different for these.
    pub(super) fn plan<'a>(&mut self, changed: impl Iterator<Item = &'a RobotId>) {
        self.capacity = true;
        self.changed.extend(changed.cloned());
    }

    /// Everybody was planned anew.
    pub(super) fn plan_of_all<'a>(&mut self, robots: impl Iterator<Item = &'a RobotId>) {
        self.others.extend(robots.cloned());
    }

    /// Whether it is time to tell what packs can service.
    pub(super) fn capacity_due(&self, now: Timestamp) -> bool {
        self.capacity && self.counted.is_none_or(|counted| now.seconds_since(counted) >= CAPACITY_APART_S)
    }

    pub(super) fn capacity_told(&mut self, now: Timestamp) {
        self.capacity = false;
        self.counted = Some(now);
    }

    /// The robots to be told of next: those with news, then the others in turn.
    pub(super) fn robots(&mut self) -> Vec<RobotId> {
        let after = self.reached.clone().map_or(Bound::Unbounded, Bound::Excluded);
        let in_turn = self.others.range((after, Bound::Unbounded)).chain(&self.others).take(self.others.len());
        let others = in_turn.filter(|robot| !self.changed.contains(*robot));
        let next: Vec<RobotId> = self.changed.iter().chain(others).take(AT_ONCE).cloned().collect();
        for robot in &next {
            self.others.remove(robot);
            if !self.changed.remove(robot) {
                self.reached = Some(robot.clone());
            }
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fleet(robots: usize) -> Vec<RobotId> {
        (0..robots).map(|n| RobotId::new(format!("r{n:03}")).unwrap()).collect()
    }

    #[test]
    fn who_has_news_is_told_of_first_and_nobody_twice() {
        let (mut untold, fleet) = (Untold::default(), fleet(40));
        untold.plan_of_all(fleet.iter());
        untold.plan([&fleet[39], &fleet[7]].into_iter());
        let first = untold.robots();
        assert_eq!((&first[0], &first[1], &first[2]), (&fleet[7], &fleet[39], &fleet[0]));
        let mut all: Vec<RobotId> = first.into_iter().chain(untold.robots()).chain(untold.robots()).collect();
        assert!(untold.robots().is_empty());
        all.sort();
        assert_eq!(all, fleet);
    }

    #[test]
    fn nobody_is_left_out_of_a_fleet_that_is_planned_anew_before_all_were_told_of() {
        let (mut untold, fleet) = (Untold::default(), fleet(40));
        let mut told = BTreeSet::new();
        for _ in 0..3 {
            untold.plan_of_all(fleet.iter());
            told.extend(untold.robots());
        }
        assert_eq!(told.len(), 40);
    }
}
