//! Why a service is planned as it is.

use planner::problem::Tick;
use planner::{Mode, Session};
use proto::{PackId, Timestamp};

use super::list;
use crate::scheduler::translate::Task;
use crate::when::{date, is_soon, minute};

/// Why a service is planned as it is, as far as it is told: figures as whole numbers of what is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Grounds {
    /// When it comes, against when it is wanted, min.
    comes: Comes,
    /// When the robot may be empty without it, or how likely it lasts until then, %.
    without: Without,
    /// Level at which a charge ends below the usual one, %.
    only_to: Option<i64>,
    /// Whether the packs may not last for charging what an exchange leaves.
    leaves_uncharged: bool,
    /// What it takes, tenths of a Wh.
    need: i64,
    /// How likely the packs hold that, tenths of a percent.
    covered: i64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Comes {
    Before(i64),
    /// The same, and it was promised so.
    BeforeAsPromised(i64),
    After(i64),
    AtOnce,
    #[default]
    WhenWanted,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Without {
    /// Minutes since 1970.
    EmptyAt(i64),
    /// The same, on another day.
    EmptyOn(i64),
    Lasts(i64),
}

impl Default for Without {
    fn default() -> Self {
        Self::EmptyAt(0)
    }
}

impl Grounds {
    /// Those of a service. Its packs cover it and the robot arrives with these probabilities.
    pub(in crate::scheduler) fn new(task: &Task, session: &Session, need_wh: f64, covered: f64, arrives: f64) -> Self {
        let robot = &task.problem.robots[session.robot];
        let wanted = robot.in_time(session.station);
        let minutes = |ticks: Tick| f64::from(ticks) * f64::from(task.grid.tick_s) / 60.0;
        let (before, after) = (minutes(wanted.saturating_sub(session.start)), minutes(session.start.saturating_sub(wanted)));
        let comes = if before >= 0.5 && robot.held && robot.not_before == session.start {
            Comes::BeforeAsPromised(before.round() as i64)
        } else if before >= 0.5 {
            Comes::Before(before.round() as i64)
        } else if after >= 0.5 {
            Comes::After(after.round() as i64)
        } else if robot.wanted.is_none_or(|at| at == 0 || wanted > at) {
            Comes::AtOnce
        } else {
            Comes::WhenWanted
        };
        let empty = Tick::try_from(task.problem.endurance(session.robot)).unwrap_or(Tick::MAX).min(task.problem.horizon);
        let without = if arrives < 1.0 {
            Without::Lasts((arrives * 100.0).round() as i64)
        } else {
            let at = task.grid.time(empty);
            let whole = at.unix_ms().div_euclid(60_000);
            if is_soon(at, task.view.now) { Without::EmptyAt(whole) } else { Without::EmptyOn(whole) }
        };
        let to_soc = task.to_soc(session.mode);
        let only_to =
            (session.mode != task.full_charge() && matches!(session.mode, Mode::Charge(_))).then(|| (to_soc * 100.0).round() as i64);
        let leaves_uncharged = session.mode == Mode::Swap && task.charge_after(session).is_some();
        Self {
            comes,
            without,
            only_to,
            leaves_uncharged,
            need: (need_wh * 10.0).round() as i64,
            covered: (covered * 1000.0).round() as i64,
        }
    }

    /// Why this service: what it saves, when it comes, and who pays.
    pub(in crate::scheduler) fn words(&self, packs: &[PackId]) -> Vec<String> {
        let comes = match self.comes {
            Comes::Before(minutes) => {
                format!("comes {minutes} min before it is wanted: later it would not fit beside what else is planned")
            }
            Comes::BeforeAsPromised(minutes) => format!("comes {minutes} min before it is wanted, as it was promised"),
            Comes::After(minutes) => format!("comes {minutes} min after it is wanted"),
            Comes::AtOnce => "comes as soon as the robot can be there".to_owned(),
            Comes::WhenWanted => "comes when it is wanted".to_owned(),
        };
        let without = match self.without {
            Without::Lasts(percent) => format!("the robot may be empty before that, and lasts with probability {percent} %"),
            Without::EmptyAt(whole) => format!("without it the robot may be empty at {}", minute(Timestamp::from_unix_ms(whole * 60_000))),
            Without::EmptyOn(whole) => {
                let at = Timestamp::from_unix_ms(whole * 60_000);
                format!("without it the robot may be empty on {} {}", date(at), minute(at))
            }
        };
        let tenths = |figure: i64| format!("{:.1}", figure as f64 / 10.0);
        let from = list(packs.iter().map(AsRef::as_ref), "no pack");
        // Nothing is certain.
        let covered = if self.covered > 999 { "> 99.9".to_owned() } else { tenths(self.covered) };
        let need = tenths(self.need);
        let only = self.only_to.map(|percent| {
            format!("is charged to {percent} % only: a whole charge would take place or energy from others, or more than there is")
        });
        let left = self.leaves_uncharged.then(|| "the pack that it leaves is charged as far as the station's packs last".to_owned());
        let takes = format!("takes {need} Wh from {from}; the packs hold it with probability {covered} %");
        [format!("{comes}; {without}")].into_iter().chain(only).chain([takes]).chain(left).collect()
    }
}
