//! The agent on Zenoh and a clock.

use std::time::Duration;

use energy::Channel;
use node::session::{QUESTIONS, command, decoded, refuse, reply};
use node::{Clock, Diary, LOAD_INPUTS, LOOK_S, Link, LiveLog, MemoryFile, Pace, Sole, Step, told_to_stop};
use proto::{Key, Pattern, RobotCommand, SimSupply, StationId, StationState, Timestamp, plain};
use tokio::sync::mpsc;
use tracing::warn;
use zenoh::pubsub::Subscriber;
use zenoh::query::Query;

use crate::agent::{Agent, Input, Output};
use crate::config::Config;
use crate::source::{Observation, Place, Source};

/// What comes from the network, wherever that is.
struct Inbox {
    commands: mpsc::Sender<Query>,
    supplies: mpsc::UnboundedSender<SimSupply>,
    lives: mpsc::UnboundedSender<bool>,
    stations: mpsc::UnboundedSender<(StationId, StationState)>,
}

/// The network, once it is there.
struct Net {
    link: Link,
    sole: Sole,
    stations: mpsc::UnboundedSender<(StationId, StationState)>,
    /// The station whose word is heard.
    host: Option<(StationId, Subscriber<()>)>,
    _kept: [Box<dyn std::any::Any + Send>; 3],
}

impl Net {
    async fn join(link: Link, config: &Config, clock: &Clock, inbox: &Inbox) -> anyhow::Result<Self> {
        let robot = &config.id;
        let (alive, said) = (Key::RobotAlive(robot.clone()), Key::RobotState(robot.clone()));
        let period = clock.real(config.publish.state_period_s);
        let sole = Sole::claim(&link, format!("robot {robot}"), &alive, &said, period).await?;
        let commands = link.serve(Key::RobotCommand(robot.clone()).build(&link.site), inbox.commands.clone()).await?;
        let heard = inbox.supplies.clone();
        let supplied = move |sample: zenoh::sample::Sample| match decoded::<SimSupply>(sample.payload()) {
            Ok(supply) => drop(heard.send(supply)),
            Err(error) => warn!("{} was refused: {error}", plain(sample.key_expr())),
        };
        let supplies = link.listen(&Pattern::SimSupplyTo(robot.clone()), supplied).await?;
        let lives = link.watch(&Key::CoordinatorAlive, inbox.lives.clone()).await?;
        let kept: [Box<dyn std::any::Any + Send>; 3] = [Box::new(commands), Box::new(supplies), Box::new(lives)];
        Ok(Self { link, sole, stations: inbox.stations.clone(), host: None, _kept: kept })
    }

    /// Hears the station at which the robot is, or to which it is on its way.
    async fn attend(&mut self, station: Option<&StationId>) -> anyhow::Result<()> {
        if self.host.as_ref().map(|(heard, _)| heard) == station {
            return Ok(());
        }
        self.host = None;
        let Some(station) = station.cloned() else { return Ok(()) };
        let (said, from) = (self.stations.clone(), station.clone());
        let heard = move |sample: zenoh::sample::Sample| match decoded::<StationState>(sample.payload()) {
            Ok(state) => drop(said.send((from.clone(), state))),
            Err(error) => warn!("{} was refused: {error}", plain(sample.key_expr())),
        };
        let subscriber = self.link.hear(&Key::StationState(station.clone()), heard).await?;
        self.host = Some((station, subscriber));
        Ok(())
    }
}

/// Runs until the source ends or the process is told to stop; `log` is where what the source shows is
/// written. Without a network it looks after its robot all the same.
///
/// # Errors
/// When the session is refused or lost for good, or another process speaks as this robot.
pub async fn run(
    config: &Config,
    mut agent: Agent,
    mut source: Box<dyn Source>,
    mut memory: MemoryFile,
    mut log: Option<LiveLog>,
) -> anyhow::Result<()> {
    let robot = &config.id;
    let clock = Clock::new(config.clock);
    let (commands_in, mut commands) = mpsc::channel(QUESTIONS);
    let (supplies_in, mut supplies) = mpsc::unbounded_channel();
    let (lives_in, mut lives) = mpsc::unbounded_channel();
    let (stations_in, mut stations) = mpsc::unbounded_channel();
    let inbox = Inbox { commands: commands_in, supplies: supplies_in, lives: lives_in, stations: stations_in };
    let mut opening = Box::pin(Link::open(&config.network, config.site.clone()));
    let mut net = match Link::soon(opening.as_mut()).await? {
        Some(link) => Some(Net::join(link, config, &clock, &inbox).await?),
        None => None,
    };
    let mut joining = std::pin::pin!(async { Net::join(opening.await?, config, &clock, &inbox).await });
    let mut diary = Diary::begin(format!("robot {robot}"));
    if !agent.reaches_a_station() {
        warn!("no way to any station is known: {robot} is watched and never serviced; give travel_s, or --travel STATION=SECONDS");
    }

    let mut ticks = tokio::time::interval(clock.real(LOOK_S).max(Duration::from_millis(5)));
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut pace = Pace::new(source.stride(), clock);
    let mut stop = std::pin::pin!(told_to_stop());
    loop {
        tokio::select! {
            _ = ticks.tick() => {
                for Step { at, dt_s, passed_s } in pace.due() {
                    source.held(agent.held());
                    let Some(observation) = source.advance(dt_s) else {
                        diary.end("the source has ended");
                        return Ok(());
                    };
                    if let Some(log) = &mut log {
                        note(log, config, passed_s, &agent, source.as_ref(), &observation);
                    }
                    agent.handle(at, Input::Observed(observation));
                    drain(net.as_ref(), config, &mut agent, source.as_mut(), None, &mut memory, log.as_mut(), &mut diary).await?;
                }
                diary.alone(agent.is_alone(clock.now()), config.alone.silent_s);
                log.as_mut().map(LiveLog::flush);
                if let Some(net) = &mut net {
                    net.attend(agent.station()).await?;
                    if let (Some(at), Some(draw)) = (agent.station(), source.draw()) {
                        net.link.publish(&Key::SimDraw(at.clone(), robot.clone()), &draw).await?;
                    }
                }
            }
            joined = &mut joining, if net.is_none() => {
                net = Some(joined?);
                agent.handle(clock.now(), Input::Joined);
            }
            Some(supply) = supplies.recv() => source.supply(&supply),
            Some((station, state)) = stations.recv() => {
                agent.handle(clock.now(), Input::Station(station, state));
                drain(net.as_ref(), config, &mut agent, source.as_mut(), None, &mut memory, log.as_mut(), &mut diary).await?;
            }
            Some(heard) = lives.recv() => {
                diary.coordinator(heard);
                agent.handle(clock.now(), Input::Coordinator(heard));
            }
            Some(query) = commands.recv() => {
                if let Some(why) = net.as_mut().and_then(|net| net.sole.doubt()) {
                    refuse(&query, why).await;
                } else if let Some(command) = command::<RobotCommand>(&query).await {
                    let now = clock.now();
                    agent.handle(now, Input::Command(command.clone()));
                    let asked = Some((&query, now, &command));
                    drain(net.as_ref(), config, &mut agent, source.as_mut(), asked, &mut memory, log.as_mut(), &mut diary).await?;
                }
            }
            () = &mut stop => {
                diary.end("it was told to");
                return Ok(());
            }
        }
    }
}

/// Logs one observation: the battery always, the load where its inputs are measured.
fn note(log: &mut LiveLog, config: &Config, now_s: f64, agent: &Agent, source: &dyn Source, seen: &Observation) {
    let Some(sample) = &seen.sample else { return };
    log.battery(now_s, config.id.as_ref(), sample, agent.soc(), agent.put_in(seen));
    // In a bay the battery's power is not that of the load.
    if seen.place != Place::InBay
        && !seen.depleted
        && let Some(inputs) = source.load_inputs(&LOAD_INPUTS)
    {
        let power = [(Channel::PowerW, sample.current_a * sample.voltage_v)];
        let channels: Vec<_> = power.into_iter().chain(LOAD_INPUTS.into_iter().zip(inputs)).collect();
        log.row(now_s, sample.dt_s, &format!("{}-load", config.id), &channels, &[]);
    }
}

#[allow(clippy::too_many_arguments, reason = "everything that an output may go to")]
async fn drain(
    net: Option<&Net>,
    config: &Config,
    agent: &mut Agent,
    source: &mut dyn Source,
    asked: Option<(&Query, Timestamp, &RobotCommand)>,
    memory: &mut MemoryFile,
    mut log: Option<&mut LiveLog>,
    diary: &mut Diary,
) -> anyhow::Result<()> {
    while let Some(output) = agent.poll() {
        match output {
            Output::Gauge(gauge) => {
                if let Some(log) = &mut log {
                    log.gauge(config.id.as_ref(), &gauge);
                }
                if let Some(net) = net {
                    net.link.publish(&Key::RobotGauge(config.id.clone()), &gauge).await?;
                }
            }
            Output::State(state) => {
                tracing::debug!("robot {}: {}", config.id, state.phase);
                if let Some(net) = net {
                    net.link.publish(&Key::RobotState(config.id.clone()), &state).await?;
                }
            }
            Output::Act(act) => {
                diary.does(&act);
                source.act(&act);
            }
            Output::Keep(kept) => memory.keep(&kept),
            Output::Reply(answer) => {
                if let Some((query, now, command)) = asked {
                    diary.answered(now, command, &answer);
                    reply(query, &answer).await;
                }
            }
        }
    }
    Ok(())
}
