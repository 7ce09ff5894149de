//! Things worth a line in the journal.

use serde::{Deserialize, Serialize};

use super::display_as_on_the_wire;
use crate::codec::Message;
use crate::id::{PackId, RobotId, StationId};
use crate::time::Timestamp;

/// What sort of thing happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// An agent was heard for the first time, or again.
    Joined,
    /// An agent is no longer alive.
    Lost,
    /// A robot is gone for good: somebody has said so.
    Forgotten,
    /// A robot does something else now.
    PhaseChanged,
    /// A robot ran empty, and cannot go on by itself.
    RobotStranded,
    /// A new plan is in force.
    PlanMade,
    /// A command went out.
    CommandSent,
    /// A command was accepted.
    CommandAccepted,
    /// A command was refused.
    CommandRejected,
    /// A command got no answer before its deadline.
    CommandUnanswered,
    /// A service began.
    ServiceStarted,
    /// A service ended as planned.
    ServiceDone,
    /// A service ended otherwise.
    ServiceFailed,
    /// A station is fed from another pack now.
    PackSelected,
    /// A pack reached the end of its discharge.
    PackDepleted,
    /// A station has no power.
    StationDark,
    /// A service that was promised could not be paid for.
    PromiseBroken,
    /// A message was refused.
    InputRefused,
    /// A model no longer explains what is measured.
    ModelDoubted,
    /// A model explains again what is measured.
    ModelTrusted,
    /// A gauge is silent, frozen, or has jumped.
    GaugeDoubted,
    /// A gauge can be believed again.
    GaugeTrusted,
}
display_as_on_the_wire!(EventKind);

impl EventKind {
    /// All of them.
    pub const ALL: [Self; 22] = [
        Self::Joined,
        Self::Lost,
        Self::Forgotten,
        Self::PhaseChanged,
        Self::RobotStranded,
        Self::PlanMade,
        Self::CommandSent,
        Self::CommandAccepted,
        Self::CommandRejected,
        Self::CommandUnanswered,
        Self::ServiceStarted,
        Self::ServiceDone,
        Self::ServiceFailed,
        Self::PackSelected,
        Self::PackDepleted,
        Self::StationDark,
        Self::PromiseBroken,
        Self::InputRefused,
        Self::ModelDoubted,
        Self::ModelTrusted,
        Self::GaugeDoubted,
        Self::GaugeTrusted,
    ];

    /// Whether somebody should look: something has failed, fallen silent or run out, or is not believed.
    #[must_use]
    pub fn is_warning(self) -> bool {
        use EventKind::{
            CommandRejected, CommandUnanswered, GaugeDoubted, InputRefused, Lost, ModelDoubted, PackDepleted, PromiseBroken, RobotStranded,
            ServiceFailed, StationDark,
        };
        matches!(
            self,
            Lost | RobotStranded
                | CommandRejected
                | CommandUnanswered
                | ServiceFailed
                | PackDepleted
                | StationDark
                | PromiseBroken
                | InputRefused
                | ModelDoubted
                | GaugeDoubted
        )
    }
}

/// One thing that happened.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Event {
    /// When.
    pub at: Timestamp,
    /// Counts up by one per event; orders events of the same instant.
    pub seq: u64,
    /// What sort of thing.
    pub kind: EventKind,
    /// The robot concerned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<RobotId>,
    /// The station concerned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub station: Option<StationId>,
    /// The pack concerned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pack: Option<PackId>,
    /// One line for people.
    pub text: String,
}

impl Message for Event {
    const SCHEMA: &'static str = "tender.event/1";
}

#[cfg(test)]
mod tests {
    use super::EventKind;

    #[test]
    fn all_kinds_are_listed() {
        // What serde knows it tells whoever names none of them.
        let refused = serde_json::from_str::<EventKind>("\"none\"").unwrap_err().to_string();
        let known: Vec<&str> = refused.split('`').skip(3).step_by(2).collect();
        assert_eq!(EventKind::ALL.map(|kind| kind.to_string()).to_vec(), known, "{refused}");
    }
}
