//! The core on tokio and Zenoh.
//!
//! ```text
//!   Zenoh ──> intake ──> Core::handle ──> poll ──> records ──> store (beside the core, one batch at a time)
//!                                            └──> commands ──> query; the answer is an input
//! ```
//!
//! What a command rests on is in the store before the command leaves, as long as the store takes it. When it cannot be
//! written, or has not answered for two seconds, the fleet is served on: commands leave, what is to be kept waits in memory, and
//! telemetry makes room.

mod hear;
mod keep;
mod lead;
mod sift;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, anyhow, ensure};
use node::access::Members;
use node::session::{Answer, QUESTIONS};
use node::{Clock, Link};
use proto::{Key, Message, Pattern, SiteId, encode};
use tokio::net::TcpListener;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tracing::{debug, error, info, warn};
use zenoh::query::Query;

use hear::{Gate, subscribe};
use keep::Keeping;
use lead::{Leading, monotonic};

use crate::config::Config;
use crate::core::{Core, Input, Numbering, Output};
use crate::intake::Intake;
use crate::outbox::Outbox;
use crate::store::{Record, Store, StoreError, shown};
use crate::web::{self, Asked, Books, Desk, Past, WebConfig};

/// Messages that the core takes in before it looks at anything else again.
const AT_ONCE: usize = 256;
/// Longest real time between two writes of telemetry.
const FLUSH: Duration = Duration::from_millis(500);
/// Shortest real time that an answer to a command is waited for.
const ANSWER_MIN: Duration = Duration::from_secs(1);
/// An input that takes the core so long is noted in a log of level debug: everybody else waited for it.
const SLOW: Duration = Duration::from_millis(25);
/// By how much a study's thread is nicer than the others.
const STUDY_NICE: i32 = 10;
/// Real time between two steps of deleting what is old.
const SWEEP: Duration = Duration::from_secs(1);

/// A coordinator at work.
struct Service {
    link: Link,
    clock: Clock,
    core: Core,
    store: Arc<Store>,
    outbox: Outbox,
    keeping: Keeping,
    leading: Leading,
    answers: mpsc::UnboundedSender<Input>,
    patience_s: f64,
    past: Past,
}

/// Runs until `stop` comes.
///
/// # Errors
/// When models, store or network cannot be had, another coordinator serves the site, or at the end the store does not
/// answer.
pub async fn run(config: &Config, path: Option<&Path>, stop: impl Future<Output = ()>) -> anyhow::Result<()> {
    let (settings, models) = config.load(path)?;
    let place = config.store_path(path);
    let mut stop = std::pin::pin!(stop);
    let store = tokio::select! {
        store = Store::open_for(&place, config.site.as_ref()) => store?,
        () = &mut stop => return Ok(()),
    };
    let numbering = Numbering { epoch: store.epoch(), event: store.next_event_seq().await?, plan: store.next_plan().await? };
    // Without it the fleet is served all the same.
    let before = store.latest_schedule().await.inspect_err(|failure| warn!("what was promised before is not known: {failure}"));
    // Before anybody hears of this coordinator: a port that another has ends it.
    let listener = if config.web.enabled { Some(web::bind(&config.web).await?) } else { None };
    let mut network = config.network.clone();
    network.members = Some(Members {
        robots: config.robots.keys().cloned().collect(),
        stations: config.stations.keys().cloned().collect(),
        viewers: config.viewers.clone(),
    });
    // A router that nobody has started yet may be waited for in vain.
    let link = tokio::select! {
        link = Link::open(&network, config.site.clone()) => link?,
        () = &mut stop => return Ok(()),
    };
    // On a server the lease says who leads; the one before may not be missed on the network yet.
    ensure!(
        store.lease().is_some() || !link.alive(&Key::CoordinatorAlive).await,
        "another coordinator serves site {} already: two would command the same robots; stop it, or give this one another site",
        link.site
    );
    let alive = link.announce(&Key::CoordinatorAlive).await?;

    let clock = Clock::new(config.clock);
    let intake = Gate::new(clock.real(config.telemetry.every_s));
    let (news_in, mut news) = mpsc::unbounded_channel();
    let (questions_in, mut questions) = mpsc::channel(QUESTIONS);
    let subscribers = subscribe(&link, &intake, &news_in).await?;
    let queryables = answer(&link, &questions_in).await?;
    let (listen, connect) = (&config.network.listen, &config.network.connect);
    let meets = if listen.is_empty() { format!("through {}", connect.join(", ")) } else { format!("listening on {}", listen.join(", ")) };
    info!("coordinator of site {} is up: store {}, {meets}", link.site, shown(&place).display());

    let core = Core::new(settings, models, numbering);
    let patience_s = settings.deadline_s;
    // While the network came up another may have taken the lease.
    let asked = monotonic();
    store.renew().await?;
    let store = Arc::new(store);
    let mut service = Service {
        link,
        clock,
        core,
        outbox: Outbox::new(numbering.epoch),
        leading: Leading::begin(&store, asked),
        store,
        keeping: Keeping::default(),
        answers: news_in.clone(),
        patience_s,
        past: Past::default(),
    };
    if let Ok(Some(schedule)) = before {
        service.take(Input::Before(Arc::new(schedule))).await;
    }
    let (desk, mut asked) = web::desk();
    let _web = listener.map(|listener| serve_web(listener, &config.web, desk)).transpose()?;
    let mut ticks = tokio::time::interval(clock.real(1.0).max(Duration::from_millis(5)));
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut flushes = tokio::time::interval(FLUSH);
    let mut sweeps = tokio::time::interval(SWEEP);
    sweeps.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let deposed = loop {
        tokio::select! {
            Some(input) = news.recv() => service.take(input).await,
            () = intake.ready() => service.take_in(&intake).await,
            _ = ticks.tick() => service.take(Input::Tick).await,
            _ = flushes.tick() => service.write(),
            done = service.keeping.done() => service.kept(done).await,
            _ = sweeps.tick() => service.keeping.may_sweep(),
            Some(query) = questions.recv() => service.tell(&query).await,
            Some(asked) = asked.recv() => service.show(asked, config, path).await,
            () = &mut stop => break false,
        }
        service.sweep(config);
        service.leading.is_at_work();
        if service.leading.is_over() {
            break true;
        }
    };
    // Who closes a session that others still speak to is told of each of their words, as an error.
    drop((queryables, subscribers));
    let kept = deposed || service.flush().await;
    drop(alive);
    let _ = service.link.session.close().await;
    if deposed {
        // A write that hangs keeps the store alive: nobody may take the lease again for it.
        service.leading.end().await;
        let path = shown(&place);
        let is_replaced = service.leading.is_replaced();
        return Err(if is_replaced { StoreError::Deposed { path } } else { StoreError::Lapsed { path } }.into());
    }
    ensure!(kept, "the store {} cannot be written: what waited for it is not kept", shown(&place).display());
    service.leading.end().await;
    if let Some(store) = Arc::into_inner(service.store) {
        store.close().await;
    }
    info!("coordinator of site {} has stopped", service.link.site);
    Ok(())
}

/// Serves the dashboard in the background.
fn serve_web(listener: TcpListener, config: &WebConfig, desk: Desk) -> anyhow::Result<AbortOnDrop> {
    let address = listener.local_addr()?;
    info!("dashboard at http://{address}/");
    if !config.address.is_loopback() {
        warn!("whoever reaches {address} sees the whole fleet: web.address is not this machine's own");
    }
    let config = config.clone();
    let serving = tokio::spawn(async move {
        if let Err(failure) = web::serve(listener, &config, desk).await {
            error!("{failure:#}");
        }
    });
    Ok(AbortOnDrop(serving))
}

/// A task that ends with what it serves.
struct AbortOnDrop(JoinHandle<()>);

impl Drop for AbortOnDrop {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// Whatever must live as long as the service.
type Kept = Vec<Box<dyn std::any::Any + Send>>;

/// Serves questions about schedule, capacity and single robots.
async fn answer(link: &Link, questions: &mpsc::Sender<Query>) -> anyhow::Result<Kept> {
    let mut kept: Kept = Vec::new();
    let keys = [Key::Schedule.build(&link.site), Key::Capacity.build(&link.site), Pattern::AllExplains.build(&link.site)];
    for key in keys {
        kept.push(Box::new(link.serve(key, questions.clone()).await?));
    }
    Ok(kept)
}

impl Service {
    async fn take(&mut self, input: Input) {
        let now = self.clock.now();
        if input == Input::Tick {
            self.past.look(now, &self.core);
            self.past.keep_a_day(now);
        }
        let (before, begin, name) = (self.outbox.records().len(), monotonic(), input.name());
        self.outbox.handle(&mut self.core, now, input);
        let decided = begin.elapsed();
        self.follow(before).await;
        if decided >= SLOW {
            debug!("{name} took the core {} ms, and {} ms until it was told", decided.as_millis(), begin.elapsed().as_millis());
        }
    }

    /// Gives the core what waits for it, some at a time.
    async fn take_in(&mut self, gate: &Gate) {
        for _ in 0..AT_ONCE {
            let Some(input) = gate.with(Intake::next) else { break };
            self.take(input).await;
        }
        let lost = gate.with(|intake, _| intake.take_lost());
        if lost > 0 {
            warn!("{lost} messages found no place: more senders or changes of state than can wait");
        }
    }

    /// Answers the dashboard.
    async fn show(&mut self, asked: Asked, config: &Config, path: Option<&Path>) {
        let now = self.clock.now();
        let standing = self.standing();
        let ladder = asked.shows_ladder().then(|| config.web.ladder(path)).flatten();
        let books = Books { site: &self.link.site, title: "", ended: None, past: &self.past, store: Some(&standing), ladder };
        let told = asked.answer(now, &mut self.core, books);
        if let Some(wish) = told {
            let before = self.outbox.records().len();
            self.outbox.came(&mut self.core, now, wish);
            self.follow(before).await;
        }
    }

    /// Does what the core wants done: what came since the record at `before`; commands leave when that is kept.
    async fn follow(&mut self, before: usize) {
        for record in &self.outbox.records()[before..] {
            match record {
                Record::Event(event) => {
                    let (kind, text) = (event.kind, &event.text);
                    if kind.is_warning() {
                        warn!("{kind}: {text}")
                    } else {
                        info!("{kind}: {text}")
                    }
                    self.past.event(event);
                }
                // Whoever follows the schedule hears of each new plan without asking.
                Record::Plan(schedule) => self.tell_all(&Key::Schedule, schedule.as_ref()).await,
                Record::Capacity(capacity) => self.tell_all(&Key::Capacity, capacity).await,
                _ => {}
            }
        }
        self.run_studies();
        if self.outbox.urgent() {
            self.write();
        }
    }

    fn command(&self, command: Output) {
        match command {
            Output::ToRobot(robot, command) => self.send(Key::RobotCommand(robot), command),
            Output::ToStation(station, command) => self.send(Key::StationCommand(station), command),
            Output::Record(_) | Output::Study(_) => {}
        }
    }

    /// Makes plans that take long on threads of their own, which step back behind whatever somebody waits for; that
    /// one is done is an input.
    fn run_studies(&mut self) {
        for study in self.outbox.take_studies() {
            let (answers, (made, is_made)) = (self.answers.clone(), tokio::sync::oneshot::channel());
            std::thread::spawn(move || {
                // Where this may not be asked for, it works all the same.
                let _ = rustix::process::nice(STUDY_NICE);
                study.run();
                let _ = made.send(());
            });
            tokio::spawn(async move {
                // Also when it failed: then the core fails with it, instead of never making a whole plan again.
                drop(is_made.await);
                drop(answers.send(Input::Studied));
            });
        }
    }

    async fn tell_all<M: Message>(&self, key: &Key, message: &M) {
        if let Err(failure) = self.link.publish(key, message).await {
            warn!("{}: {failure:#}", key.build(&self.link.site));
        }
    }

    /// Sends a command; its answer comes back as an input. No answer: the core sends it again.
    fn send<M: Message + Send + Sync + 'static>(&self, key: Key, command: M) {
        let (link, answers) = (self.link.clone(), self.answers.clone());
        let timeout = self.clock.real(self.patience_s).max(ANSWER_MIN);
        tokio::spawn(async move {
            match link.ask(&key, Some(&command), timeout).await {
                Answer::Given(reply) => drop(answers.send(Input::Reply(reply))),
                Answer::Refused(why) => drop(answers.send(Input::Refused(format!("{}: {why}", key.build(&link.site))))),
                Answer::Nobody => {}
            }
        });
    }

    async fn tell(&self, query: &Query) {
        let now = self.clock.now();
        let said = match Key::parse(query.key_expr().as_str()) {
            Ok((_, Key::Schedule)) => Ok(encode(self.core.schedule())),
            Ok((_, Key::Capacity)) => Ok(encode(&self.core.capacity(now))),
            Ok((_, Key::Explain(robot))) => self.core.explain(now, &robot).map(|explanation| encode(&explanation)),
            Ok(_) => Err("nothing is told under this key".to_owned()),
            Err(error) => Err(error.to_string()),
        };
        let sent = match said {
            Ok(bytes) => query.reply(query.key_expr().clone(), bytes).await,
            Err(why) => query.reply_err(why).await,
        };
        if let Err(failure) = sent {
            warn!("an answer was not sent: {failure}");
        }
    }
}

/// Asks a running coordinator.
///
/// # Errors
/// When it refuses to answer, with its reason. Nobody there is `Ok(None)`.
pub async fn ask<M: Message>(network: &node::NetworkConfig, site: &SiteId, key: &Key) -> anyhow::Result<Option<M>> {
    let Ok(link) = Link::try_open(network, site.clone()).await else { return Ok(None) };
    let answer = link.ask::<M, M>(key, None, Duration::from_secs(2)).await;
    let closed = link.session.close().await.map_err(|e| anyhow!("{e}")).context("closing the session");
    match answer {
        Answer::Given(message) => closed.map(|()| Some(message)),
        Answer::Refused(why) => Err(anyhow!("{why}")),
        Answer::Nobody => Ok(None),
    }
}
