//! Everything the dashboard shows, in words and numbers: the page draws it and decides nothing.
//!
//! ```text
//!   Core + Past ──> View
//!                     summary.rs   the tiles at the top
//!                     fleet.rs     one row per robot
//!                     station.rs   bays, spares, and packs as stacked energy (stack.rs)
//!                     plan.rs      services over time, lane by lane
//!                     capacity.rs  how many robots more
//!                     health.rs    whether models still explain what is measured; the lab's last ladder
//!                     robot.rs     one robot in full: facts, why, alternatives
//! ```

mod capacity;
mod fleet;
mod health;
mod plan;
mod robot;
mod stack;
mod station;
mod summary;

use proto::{EventKind, SiteId, Timestamp};
use serde::{Deserialize, Serialize};

use crate::core::Core;
use crate::web::desk::Books;
use crate::web::past::Past;
use crate::web::report::Ended;
use crate::when::{date, minute, second};

pub use capacity::CapacityPanel;
pub(crate) use capacity::{by_station, whom};
pub use fleet::{FleetTable, RobotRow};
pub use health::{HealthPanel, Ladder, Step};
pub use plan::{Bar, Lane, PlanChart};
pub use robot::RobotDetail;
pub use stack::Stack;
pub use station::StationCard;
pub use summary::Tile;

/// How something stands: the page has a colour and a sign for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Tone {
    /// As it should be.
    Good,
    /// Worth a look.
    Warn,
    /// Needs somebody.
    Bad,
    /// Going on.
    Active,
    /// Nothing to say.
    Quiet,
}

/// Which part of a large fleet is shown.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// Only robots whose id or phase contains this.
    #[serde(default)]
    pub find: String,
    /// `name` or `urgency`.
    #[serde(default)]
    pub sort: Sort,
    /// Most robots; 0 for as many as a page takes.
    #[serde(default)]
    pub rows: usize,
}

/// Order of robots.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sort {
    /// By id.
    #[default]
    Name,
    /// Whoever runs empty first comes first.
    Urgency,
}

/// The whole page.
#[derive(Debug, Clone, Serialize)]
pub struct View {
    /// The instant it shows.
    pub at: Timestamp,
    /// That instant's date and time of day, UTC.
    pub clock: String,
    /// The site.
    pub site: SiteId,
    /// What is shown: the site, or a scenario and its run.
    pub title: String,
    /// Whether it is a simulation, which nobody can change.
    pub simulated: bool,
    /// What its runs came to, when all have ended: nothing moves any more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ended: Option<Ended>,
    /// The plan in force, in a sentence.
    pub headline: String,
    /// The tiles at the top.
    pub tiles: Vec<Tile>,
    /// Robots.
    pub fleet: FleetTable,
    /// Stations.
    pub stations: Vec<StationCard>,
    /// Services over time.
    pub plan: PlanChart,
    /// How many robots more.
    pub capacity: CapacityPanel,
    /// Whether models still hold.
    pub health: HealthPanel,
    /// What happened last, newest first.
    pub events: Vec<EventLine>,
}

/// A line of the event log.
#[derive(Debug, Clone, Serialize)]
pub struct EventLine {
    /// Number of the event: tells lines apart.
    pub seq: u64,
    /// Time of day, UTC.
    pub clock: String,
    /// What sort of thing.
    pub kind: EventKind,
    /// That in words.
    pub label: String,
    /// How it stands.
    pub tone: Tone,
    /// One line for people.
    pub text: String,
}

/// Events that a page shows.
const EVENTS_SHOWN: usize = 100;

impl View {
    /// Looks at a core and its past.
    #[must_use]
    pub fn new(now: Timestamp, core: &Core, books: Books<'_>, wanted: &Wanted) -> Self {
        let Books { site, title, ended, past, store, ladder } = books;
        let (basis, schedule, capacity) = (core.basis(now), core.schedule(), core.capacity(now));
        let stacks = stack::stacks(&basis, schedule);
        let health = health::panel(now, core, ladder);
        Self {
            at: now,
            clock: format!("{} {} UTC", date(now), second(now)),
            site: site.clone(),
            title: if title.is_empty() { format!("Site {site}") } else { title.to_owned() },
            simulated: !title.is_empty(),
            ended: ended.cloned(),
            headline: headline(core),
            tiles: summary::tiles(&basis, schedule, &capacity, &health, store),
            fleet: fleet::table(&basis, schedule, wanted),
            stations: station::cards(&basis, schedule, &stacks),
            plan: plan::chart(now, &basis, schedule, past),
            capacity: capacity::panel(&capacity),
            health,
            events: past.events.iter().rev().take(EVENTS_SHOWN).map(event_line).collect(),
        }
    }

    /// One robot in full.
    ///
    /// # Errors
    /// When the robot is not known, with the nearest that is.
    pub fn robot(now: Timestamp, core: &Core, past: &Past, robot: &proto::RobotId) -> Result<RobotDetail, String> {
        robot::detail(now, core, past, robot)
    }
}

fn headline(core: &Core) -> String {
    let schedule = core.schedule();
    if schedule.plan == 0 {
        return format!("No plan yet: {}", schedule.trigger);
    }
    format!("Plan {} of {} by {} ({})", schedule.plan, minute(schedule.at), schedule.policy, schedule.trigger)
}

fn event_line(event: &proto::Event) -> EventLine {
    use EventKind as K;
    let tone = match event.kind {
        K::ServiceDone | K::ModelTrusted | K::GaugeTrusted => Tone::Good,
        K::CommandRejected | K::CommandUnanswered | K::InputRefused | K::ModelDoubted | K::GaugeDoubted | K::PackDepleted => Tone::Warn,
        K::Lost | K::RobotStranded | K::ServiceFailed | K::StationDark | K::PromiseBroken => Tone::Bad,
        K::ServiceStarted | K::PlanMade | K::PackSelected => Tone::Active,
        _ => Tone::Quiet,
    };
    let label = event.kind.to_string().replace('_', " ");
    EventLine { seq: event.seq, clock: second(event.at), kind: event.kind, label, tone, text: event.text.clone() }
}
