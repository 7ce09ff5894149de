//! Commands: sent with an id, sent again until answered, given up at their deadline.

use proto::{
    Command, CommandId, CommandReply, EventKind, Outcome, Rejection, RobotAction, RobotCommand, RobotId, RobotPhase, StationAction,
    StationCommand, StationId, Timestamp,
};

use super::{Core, Output};
use crate::clocks::Agent;
use crate::fleet::Robot;
use crate::service_run::{Again, Stage};
use crate::store::Record;

/// A command that waits for its answer.
#[derive(Debug, Clone)]
pub(super) struct Asked {
    command: AskedCommand,
    /// The service that it carries on and the stage that follows.
    service: Option<(RobotId, Stage)>,
    sent: Timestamp,
    deadline: Timestamp,
}

impl Asked {
    /// Whether it is for that robot.
    pub(super) fn is_for(&self, robot: &RobotId) -> bool {
        matches!(&self.command, AskedCommand::Robot(whom, _) if whom == robot)
    }

    pub(super) fn set_back(&mut self, by_ms: i64) {
        (self.sent, self.deadline) = (self.sent.plus_ms(-by_ms), self.deadline.plus_ms(-by_ms));
    }
}

#[derive(Debug, Clone)]
pub(super) enum AskedCommand {
    Robot(RobotId, RobotCommand),
    Station(StationId, StationCommand),
}

impl AskedCommand {
    fn whom(&self) -> String {
        match self {
            Self::Robot(robot, _) => robot.to_string(),
            Self::Station(station, _) => station.to_string(),
        }
    }
}

/// What it mostly means that an agent obeys a later start of a coordinator than this one.
const STALE: &str = ": another coordinator of this site has begun later, or this one's store is younger than the agents' memory";

impl Core {
    pub(super) fn next_command<A>(&mut self, now: Timestamp, action: A) -> Command<A> {
        self.commands += 1;
        let id = CommandId::new(format!("c{}-{}", self.numbering.epoch, self.commands)).expect("a valid id");
        Command { id, epoch: self.numbering.epoch, at: now, deadline: now.plus_s(self.settings.deadline_s), action }
    }

    pub(super) fn ask_robot(&mut self, now: Timestamp, robot: &RobotId, action: RobotAction, service: Option<(RobotId, Stage)>) {
        let mut command = self.next_command(now, action);
        let given_up = command.deadline;
        // Who is asked reads the deadline on its own clock.
        command.deadline = given_up.plus_s(self.clocks.ahead_s(&Agent::Robot(robot.clone())));
        self.record(Record::RobotCommand { robot: robot.clone(), command: command.clone() });
        let text = format!("{} to {robot}: {}", command.id, command.action);
        self.event(now, EventKind::CommandSent, Some(robot), None, None, text);
        let asked = AskedCommand::Robot(robot.clone(), command.clone());
        self.remember(now, command.id.clone(), given_up, asked, service);
        self.outputs.push_back(Output::ToRobot(robot.clone(), command));
    }

    pub(super) fn ask_station(&mut self, now: Timestamp, station: &StationId, action: StationAction, service: Option<(RobotId, Stage)>) {
        let mut command = self.next_command(now, action);
        let given_up = command.deadline;
        command.deadline = given_up.plus_s(self.clocks.ahead_s(&Agent::Station(station.clone())));
        self.record(Record::StationCommand { station: station.clone(), command: command.clone() });
        let text = format!("{} to {station}: {}", command.id, command.action);
        self.event(now, EventKind::CommandSent, service.as_ref().map(|(robot, _)| robot).cloned().as_ref(), Some(station), None, text);
        let asked = AskedCommand::Station(station.clone(), command.clone());
        self.remember(now, command.id.clone(), given_up, asked, service);
        self.outputs.push_back(Output::ToStation(station.clone(), command));
    }

    pub(super) fn remember(
        &mut self,
        now: Timestamp,
        id: CommandId,
        deadline: Timestamp,
        command: AskedCommand,
        service: Option<(RobotId, Stage)>,
    ) {
        if let Some((robot, _)) = &service
            && let Some(run) = self.running.get_mut(robot)
        {
            run.asked = Some(id.clone());
        }
        self.asked.insert(id, Asked { command, service, sent: now, deadline });
    }

    pub(super) fn replied(&mut self, now: Timestamp, reply: &CommandReply) {
        // A late copy of an answer that was already taken in.
        let Some(asked) = self.asked.remove(&reply.id) else { return };
        self.record(Record::Reply(reply.clone()));
        let Some((robot, stage)) = asked.service else {
            if let Outcome::Rejected { detail, .. } = &reply.outcome {
                self.event(now, EventKind::CommandRejected, None, None, None, format!("{}: {detail}", reply.id));
            }
            return;
        };
        if let Some(run) = self.running.get_mut(&robot) {
            run.asked = None;
        }
        match &reply.outcome {
            Outcome::Accepted => self.enter(now, &robot, stage),
            Outcome::Rejected { reason, detail } => self.refused(now, &robot, *reason, detail, asked.command.whom(), &reply.id),
        }
    }

    /// A command of a service was refused. What cannot be done at the moment is asked again; else robot and station are not brought together for a while.
    fn refused(&mut self, now: Timestamp, robot: &RobotId, reason: Rejection, detail: &str, whom: String, id: &CommandId) {
        use RobotPhase::{Charged, Charging, Docked};
        let is_in_a_bay = matches!(self.fleet.robots.get(robot).and_then(Robot::phase), Some(Docked | Charging | Charged));
        let Some(run) = self.running.get_mut(robot) else { return };
        let (station, at_place) = (run.station.clone(), run.at_place() || is_in_a_bay);
        let times = run.again.as_ref().map_or(1, |again| again.times + 1);
        let is_news = run.again.as_ref().is_none_or(|again| again.why != detail);
        if reason == Rejection::Busy {
            let after_s = (self.settings.resend_s * f64::from(2_u32.saturating_pow(times - 1))).min(self.settings.deadline_s);
            let phase = self.fleet.robots.get(robot).and_then(Robot::phase);
            run.again = Some(Again { at: now.plus_s(after_s), times, why: detail.to_owned(), phase });
            if is_news {
                let text = format!("{id}: {reason}: {detail}; it is asked again");
                self.event(now, EventKind::CommandRejected, Some(robot), Some(&station), None, text);
            }
            return;
        }
        let cause = if reason == Rejection::StaleEpoch { STALE } else { "" };
        self.event(now, EventKind::CommandRejected, Some(robot), Some(&station), None, format!("{id}: {reason}: {detail}{cause}"));
        self.refusals.note(now, robot, &station, at_place, format!("{whom} refused ({reason}: {detail}{cause})"));
        self.fail(now, robot, &format!("{whom} refused: {detail}"));
    }

    /// Whether a robot has still to answer.
    pub(super) fn has_to_answer(&self, robot: &RobotId) -> bool {
        self.asked.values().any(|asked| asked.is_for(robot))
    }

    /// Sends again what was not answered, with the same id, until its deadline.
    pub(super) fn resend(&mut self, now: Timestamp) {
        let overdue: Vec<CommandId> = self
            .asked
            .iter()
            .filter(|(_, asked)| now.seconds_since(asked.sent) >= self.settings.resend_s)
            .map(|(id, _)| id.clone())
            .collect();
        for id in overdue {
            let Some(asked) = self.asked.get_mut(&id) else { continue };
            if now > asked.deadline {
                let service = asked.service.clone();
                let whom = asked.command.whom();
                self.asked.remove(&id);
                self.event(
                    now,
                    EventKind::CommandUnanswered,
                    service.as_ref().map(|(robot, _)| robot),
                    None,
                    None,
                    format!("{id} was not answered by {whom}"),
                );
                if let Some((robot, _)) = service {
                    // It may have been obeyed and the answer lost: robot and station are left as they
                    // are until their own words tell where the robot is.
                    self.give_up(now, &robot, &format!("{whom} has not answered {id}"));
                }
                continue;
            }
            asked.sent = now;
            self.outputs.push_back(match asked.command.clone() {
                AskedCommand::Robot(robot, command) => Output::ToRobot(robot, command),
                AskedCommand::Station(station, command) => Output::ToStation(station, command),
            });
        }
    }
}
