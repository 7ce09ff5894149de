//! Questions from the web to whoever owns the core, and what it answers.
//!
//! Nothing is computed while nobody looks: a page is made from the core when it is asked for.

use std::time::Duration;

use proto::{Event, Gauge, PackId, RobotId, RobotState, SiteId, StationId, StationState, Timestamp};
use serde::Serialize;
use tokio::sync::{mpsc, oneshot};

use super::metrics;
use super::past::Past;
use super::report::Ended;
use super::view::{Ladder, View, Wanted};
use crate::core::{Core, Input, NotForgotten};
use crate::store::Standing;

/// Questions that may wait.
const QUEUE: usize = 64;
/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(5);

/// How `/healthz` says that the store cannot be written; `coordinator doctor` looks for it.
pub const NOTHING_IS_KEPT: &str = "nothing is kept";

/// What may be asked.
#[derive(Debug, Clone)]
pub enum Question {
    /// The whole page.
    View(Wanted),
    /// One robot in full.
    Robot(RobotId),
    /// How energy of a pack went.
    Pack(StationId, PackId),
    /// The plan in force.
    Schedule,
    /// How many robots more.
    Capacity,
    /// Why a robot is serviced as it is.
    Explain(RobotId),
    /// The newest word of every robot and station.
    Fleet,
    /// What happened last.
    Events(usize),
    /// Whether all is well.
    Health,
    /// Metrics for Prometheus.
    Metrics,
    /// Make a new plan.
    Replan,
    /// Forget a robot that is gone for good.
    Forget(RobotId),
}

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NoAnswer {
    /// What was asked for is not known.
    Unknown(String),
    /// That cannot be done as things stand.
    Conflict(String),
    /// The coordinator has no time, or has stopped.
    Busy,
}

/// An answer: JSON, or the text of metrics.
pub type Answer = Result<String, NoAnswer>;

/// A question and where its answer goes.
pub struct Asked {
    /// The question.
    pub question: Question,
    answer: oneshot::Sender<Answer>,
}

/// The side that asks.
#[derive(Debug, Clone)]
pub struct Desk {
    asked: mpsc::Sender<Asked>,
}

/// A desk, and the queue that whoever owns the core reads.
#[must_use]
pub fn desk() -> (Desk, mpsc::Receiver<Asked>) {
    let (asked, queue) = mpsc::channel(QUEUE);
    (Desk { asked }, queue)
}

impl Desk {
    /// Whether nobody will ever answer again.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.asked.is_closed()
    }

    /// Asks, and waits a little.
    ///
    /// # Errors
    /// When what is asked for is not known, or nobody answers.
    pub async fn ask(&self, question: Question) -> Answer {
        let (answer, answered) = oneshot::channel();
        self.asked.try_send(Asked { question, answer }).map_err(|_| NoAnswer::Busy)?;
        let waited = tokio::time::timeout(PATIENCE, answered).await;
        waited.map_or(Err(NoAnswer::Busy), |answer| answer.unwrap_or(Err(NoAnswer::Busy)))
    }
}

/// Why there is a new plan when somebody asked for one.
const REPLAN_WHY: &str = "asked for on the dashboard";

/// The newest word of a robot, as it came over the wire.
#[derive(Serialize)]
struct RobotWord<'a> {
    lost: bool,
    gauge: Option<&'a Gauge>,
    state: Option<&'a RobotState>,
}

/// The newest word of a station.
#[derive(Serialize)]
struct StationWord<'a> {
    lost: bool,
    state: Option<&'a StationState>,
    packs: &'a std::collections::BTreeMap<PackId, Gauge>,
}

/// What answers are made from.
#[derive(Clone)]
pub struct Books<'a> {
    /// The site.
    pub site: &'a SiteId,
    /// What is shown, when it is not a live site: a scenario and its run.
    pub title: &'a str,
    /// What runs of a scenario came to, when all have ended.
    pub ended: Option<&'a Ended>,
    /// What was shown so far.
    pub past: &'a Past,
    /// How the store stands; none where nothing is kept.
    pub store: Option<&'a Standing>,
    /// The lab's last search, or why it cannot be read; none when none is configured.
    pub ladder: Option<Result<Ladder, String>>,
}

impl Asked {
    /// Whether the answer tells of the lab's last search: it is in a file, which nothing else need wait for.
    #[must_use]
    pub fn shows_ladder(&self) -> bool {
        matches!(self.question, Question::View(_))
    }

    /// Answers from the core. What the core was told with that is returned, and what it wants done must be drained by the caller.
    pub fn answer(self, now: Timestamp, core: &mut Core, books: Books<'_>) -> Option<Input> {
        // Who was told meanwhile that nobody has time must not find done what it will ask again.
        if self.answer.is_closed() {
            return None;
        }
        let wish = self.question.wish();
        let answer = self.question.answer(now, core, books);
        let told = wish.filter(|_| answer.is_ok());
        // Whoever asked may have gone.
        let _ = self.answer.send(answer);
        told
    }
}

impl Question {
    /// What it asks the core to do, where it is more than a question.
    fn wish(&self) -> Option<Input> {
        match self {
            Question::Replan => Some(Input::Replan(REPLAN_WHY.to_owned())),
            Question::Forget(robot) => Some(Input::Forget(robot.clone())),
            _ => None,
        }
    }

    fn answer(self, now: Timestamp, core: &mut Core, books: Books<'_>) -> Answer {
        let (past, wish) = (books.past, self.wish());
        match self {
            Question::View(wanted) => Ok(json(&View::new(now, core, books, &wanted))),
            Question::Robot(robot) => View::robot(now, core, past, &robot).map(|detail| json(&detail)).map_err(NoAnswer::Unknown),
            Question::Pack(station, pack) => {
                let series = past.packs.get(&(station.clone(), pack.clone()));
                series.map(json).ok_or_else(|| NoAnswer::Unknown(format!("nothing was heard of {pack} of {station}")))
            }
            Question::Schedule => Ok(json(core.schedule())),
            Question::Capacity => Ok(json(&core.capacity(now))),
            Question::Explain(robot) => core.explain(now, &robot).map(|explanation| json(&explanation)).map_err(NoAnswer::Unknown),
            Question::Fleet => Ok(fleet(now, core)),
            Question::Events(last) => Ok(json(&past.events.iter().rev().take(last).collect::<Vec<&Event>>())),
            Question::Metrics => Ok(metrics::text(now, core, past, books.store)),
            Question::Health => Ok(match books.store.and_then(Standing::complaint) {
                Some(complaint) => format!("ok, but {NOTHING_IS_KEPT} {complaint}\n"),
                None => "ok\n".to_owned(),
            }),
            Question::Replan => {
                wish.into_iter().for_each(|wish| core.handle(now, wish));
                Ok(json(&serde_json::json!({ "asked": "replan", "plan": core.schedule().plan })))
            }
            Question::Forget(robot) => {
                core.can_forget(&robot).map_err(|why| match why {
                    NotForgotten::Unknown(why) => NoAnswer::Unknown(why),
                    NotForgotten::Heard(why) => NoAnswer::Conflict(why),
                })?;
                wish.into_iter().for_each(|wish| core.handle(now, wish));
                Ok(json(&serde_json::json!({ "asked": "forget", "robot": robot })))
            }
        }
    }
}

fn fleet(now: Timestamp, core: &Core) -> String {
    let robots: std::collections::BTreeMap<_, _> = core
        .fleet()
        .robots
        .iter()
        .map(|(id, robot)| (id, RobotWord { lost: robot.is_lost(), gauge: robot.gauge.as_ref(), state: robot.state.as_ref() }))
        .collect();
    let stations: std::collections::BTreeMap<_, _> = core
        .fleet()
        .stations
        .iter()
        .map(|(id, station)| (id, StationWord { lost: station.is_lost(), state: station.state.as_ref(), packs: &station.packs }))
        .collect();
    json(&serde_json::json!({ "at": now, "robots": robots, "stations": stations }))
}

fn json<T: Serialize>(answer: &T) -> String {
    serde_json::to_string(answer).expect("answers have text keys and finite numbers")
}
