//! Who is planned without some kinds of spares. A plan knows one kind for each robot and station, in whole ticks; where that does not
//! come out, it is made again.

use std::collections::BTreeSet;

use planner::{Mode, Session};
use proto::RobotId;

use super::problem::{RobotView, View};
use super::solve::Solved;
use super::translate::Task;

/// Kinds of spares that a robot is not planned with at a station, by index of robot, station and the view's kinds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Unfit {
    /// Which robot.
    robot: usize,
    /// Where.
    station: usize,
    /// Which kinds.
    kinds: Vec<usize>,
}

impl Task {
    /// The kind of spare that a robot is given at a station, as one that it cannot be given; none where it is given none.
    fn unfit(&self, robot: usize, station: usize) -> Option<Unfit> {
        let given = self.racks.given(&self.view, &self.view.robots[robot], station)?;
        Some(Unfit { robot, station, kinds: self.racks.alike(station, given).collect() })
    }
}

impl Solved {
    /// Who would have an exchange and no spare for it: robot and station.
    pub(super) fn without_a_spare(&self) -> Vec<Unfit> {
        let without: BTreeSet<&RobotId> =
            self.plan.planned.iter().filter(|planned| planned.spare.is_none()).map(|planned| &planned.robot).collect();
        let exchanges = self.sessions.iter().filter(|session| !matches!(session.mode, Mode::Charge(_)));
        let is_without = |session: &&Session| without.contains(&self.task.view.robots[session.robot].robot);
        exchanges.filter(is_without).filter_map(|session| self.task.unfit(session.robot, session.station)).collect()
    }

    /// Robots that strand where all spares of the kind that they are given are taken, although another that fits lies there, with what they would
    /// have to be given none of. A plan knows one kind for each.
    pub(super) fn with_another_kind(&self) -> Vec<Unfit> {
        let Task { view, racks, problem, .. } = &self.task;
        let served: BTreeSet<usize> = self.sessions.iter().map(|session| session.robot).collect();
        let exchanges = || self.sessions.iter().filter(|session| !matches!(session.mode, Mode::Charge(_)));
        let taken = |station: usize, kind: u16| {
            exchanges()
                .filter(|other| other.station == station && racks.given(view, &view.robots[other.robot], station) == Some(kind))
                .count()
        };
        let is_left = |robot: &RobotView, station: usize, given: u16| {
            let spares = || racks.all_next(view, station);
            let are_left = |kind: u16| spares().filter(|(known, _)| *known == kind).count() > taken(station, kind);
            let fitting = spares().filter(|(kind, spare)| *kind != given && robot.takes(station, spare.kind));
            let others: BTreeSet<u16> = fitting.map(|(kind, _)| kind).collect();
            !are_left(given) && others.into_iter().any(are_left)
        };
        let strands = (0..view.robots.len()).filter(|robot| !served.contains(robot) && problem.strands(*robot));
        let places = strands.filter(|_| (0..view.stations.len()).any(|station| racks.are_several(station)));
        let places = places.flat_map(|index| view.robots[index].ways.iter().map(move |way| (index, way.station)));
        let of = |(index, station): (usize, usize)| {
            let given = racks.given(view, &view.robots[index], station)?;
            is_left(&view.robots[index], station, given).then(|| self.task.unfit(index, station)).flatten()
        };
        places.filter_map(of).collect()
    }
}

/// Has robots planned without some kinds of spares.
pub(super) fn forbid(view: &mut View, without: Vec<Unfit>) {
    for Unfit { robot, station, kinds } in without {
        view.robots[robot].unfit.extend(kinds.into_iter().map(|kind| (station, kind)));
    }
}
