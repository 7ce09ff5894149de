//! The agent on Zenoh and a clock.

use std::time::Duration;

use energy::{Channel, Estimate};
use node::session::{QUESTIONS, command, decoded, refuse, reply};
use node::{Clock, Diary, LOOK_S, Link, LiveLog, MemoryFile, Newest, Pace, STATION_INPUTS, Sole, Step, told_to_stop};
use proto::{Key, PackId, Pattern, RobotId, RobotState, SimDraw, StationCommand, Timestamp, plain};
use tokio::sync::mpsc;
use tracing::warn;
use zenoh::query::Query;

use crate::agent::{Agent, Input, Output};
use crate::config::Config;
use crate::source::{Observation, Source};

/// Robots whose states wait to be looked at.
const ROBOTS_MAX: usize = 1024;

/// What comes from the network, wherever that is.
struct Inbox {
    commands: mpsc::Sender<Query>,
    draws: mpsc::UnboundedSender<(RobotId, SimDraw)>,
    lives: mpsc::UnboundedSender<bool>,
    robots: Newest<RobotId, RobotState>,
}

/// The network, once it is there.
struct Net {
    link: Link,
    sole: Sole,
    _kept: [Box<dyn std::any::Any + Send>; 4],
}

impl Net {
    async fn join(link: Link, config: &Config, clock: &Clock, inbox: &Inbox) -> anyhow::Result<Self> {
        let station = &config.id;
        let (alive, said) = (Key::StationAlive(station.clone()), Key::StationState(station.clone()));
        let period = clock.real(config.publish.state_period_s);
        let sole = Sole::claim(&link, format!("station {station}"), &alive, &said, period).await?;
        let commands = link.serve(Key::StationCommand(station.clone()).build(&link.site), inbox.commands.clone()).await?;
        let heard = inbox.draws.clone();
        let drawn = move |sample: zenoh::sample::Sample| match draw_in(&sample) {
            Ok(draw) => drop(heard.send(draw)),
            Err(why) => warn!("{} was refused: {}", plain(sample.key_expr()), plain(&why)),
        };
        let draws = link.listen(&Pattern::SimDrawAt(station.clone()), drawn).await?;
        let lives = link.watch(&Key::CoordinatorAlive, inbox.lives.clone()).await?;
        // Without a coordinator it looks after robots by what they say.
        let heard = inbox.robots.clone();
        let said = move |sample: zenoh::sample::Sample| {
            if let (Ok((_, Key::RobotState(robot))), Ok(state)) =
                (Key::parse(sample.key_expr().as_str()), decoded::<RobotState>(sample.payload()))
            {
                heard.say(robot, state);
            }
        };
        let robots = link.listen(&Pattern::AllRobotStates, said).await?;
        let kept: [Box<dyn std::any::Any + Send>; 4] = [Box::new(commands), Box::new(draws), Box::new(lives), Box::new(robots)];
        Ok(Self { link, sole, _kept: kept })
    }
}

/// Runs until the source ends or the process is told to stop; `log` is where what the source shows is
/// written. Without a network it looks after its station all the same.
///
/// # Errors
/// When the session is refused or lost for good, or another process speaks as this station.
pub async fn run(
    config: &Config,
    mut agent: Agent,
    mut source: Box<dyn Source>,
    mut memory: MemoryFile,
    mut log: Option<LiveLog>,
) -> anyhow::Result<()> {
    let station = &config.id;
    let clock = Clock::new(config.clock);
    let (commands_in, mut commands) = mpsc::channel(QUESTIONS);
    let (draws_in, mut draws) = mpsc::unbounded_channel();
    let (lives_in, mut lives) = mpsc::unbounded_channel();
    let robots = Newest::of(ROBOTS_MAX);
    let inbox = Inbox { commands: commands_in, draws: draws_in, lives: lives_in, robots: robots.clone() };
    let mut opening = Box::pin(Link::open(&config.network, config.site.clone()));
    let mut net = match Link::soon(opening.as_mut()).await? {
        Some(link) => Some(Net::join(link, config, &clock, &inbox).await?),
        None => None,
    };
    let mut joining = std::pin::pin!(async { Net::join(opening.await?, config, &clock, &inbox).await });
    let mut diary = Diary::begin(format!("station {station}"));

    let mut ticks = tokio::time::interval(clock.real(LOOK_S).max(Duration::from_millis(5)));
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut pace = Pace::new(source.stride(), clock);
    let mut stop = std::pin::pin!(told_to_stop());
    loop {
        tokio::select! {
            _ = ticks.tick() => {
                for Step { at, dt_s, passed_s } in pace.due() {
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
                // Only the newest supply of each robot matters, except a pack put in.
                let mut supplies = source.supplies();
                let newest: std::collections::BTreeMap<_, _> = supplies.iter().enumerate().map(|(i, (robot, _))| (robot.clone(), i)).collect();
                for (index, (robot, supply)) in supplies.drain(..).enumerate() {
                    if let Some(Net { link, .. }) = &net
                        && (supply.exchanged.is_some() || newest.get(&robot) == Some(&index))
                    {
                        link.publish(&Key::SimSupply(station.clone(), robot), &supply).await?;
                    }
                }
            }
            joined = &mut joining, if net.is_none() => {
                net = Some(joined?);
                agent.handle(clock.now(), Input::Joined);
            }
            Some((robot, draw)) = draws.recv() => source.draw(&robot, &draw),
            states = robots.taken() => {
                states.into_iter().for_each(|(robot, state)| agent.handle(clock.now(), Input::Robot(robot, state)));
            }
            Some(heard) = lives.recv() => {
                diary.coordinator(heard);
                agent.handle(clock.now(), Input::Coordinator(heard));
            }
            Some(query) = commands.recv() => {
                if let Some(why) = net.as_mut().and_then(|net| net.sole.doubt()) {
                    refuse(&query, why).await;
                } else if let Some(command) = command::<StationCommand>(&query).await {
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

/// What a simulated robot says that it draws.
fn draw_in(sample: &zenoh::sample::Sample) -> Result<(RobotId, SimDraw), String> {
    match Key::parse(sample.key_expr().as_str()) {
        Ok((_, Key::SimDraw(_, robot))) => decoded(sample.payload()).map(|draw| (robot, draw)).map_err(|error| error.to_string()),
        Ok(_) => Err("nothing is expected under this key".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

fn pack_stem(config: &Config, pack: &PackId) -> String {
    format!("{}-{pack}", config.id)
}

/// Logs one observation: every pack in its place, and the station's load where its inputs are measured.
fn note(log: &mut LiveLog, config: &Config, now_s: f64, agent: &Agent, source: &dyn Source, seen: &Observation) {
    for reading in seen.packs.iter().filter(|reading| reading.connected) {
        let Some(sample) = &reading.sample else { continue };
        let soc = agent.socs().find(|(pack, _)| **pack == reading.pack).map_or(Estimate::new(0.5, 0.5), |(_, soc)| soc);
        log.battery(now_s, &pack_stem(config, &reading.pack), sample, soc, reading.exchanged);
    }
    let active = seen.packs.iter().find(|reading| seen.active_pack.as_ref() == Some(&reading.pack)).filter(|_| seen.powered);
    let sample = active.and_then(|reading| reading.sample);
    if let (Some(sample), Some(inputs)) = (sample, source.load_inputs(&STATION_INPUTS)) {
        let pack = [
            (Channel::PackCurrentA, sample.current_a),
            (Channel::PackVoltageV, sample.voltage_v),
            (Channel::PackPowerW, sample.current_a * sample.voltage_v),
        ];
        let channels: Vec<_> = STATION_INPUTS.into_iter().zip(inputs).chain(pack).collect();
        let robot = |(number, robot): (usize, Option<&RobotId>)| {
            (format!("bay_{}_robot", number + 1), robot.map_or(String::new(), ToString::to_string))
        };
        let bays: Vec<_> = agent.bays().enumerate().map(robot).collect();
        log.row(now_s, sample.dt_s, config.id.as_ref(), &channels, &bays);
    }
}

#[allow(clippy::too_many_arguments, reason = "everything that an output may go to")]
async fn drain(
    net: Option<&Net>,
    config: &Config,
    agent: &mut Agent,
    source: &mut dyn Source,
    asked: Option<(&Query, Timestamp, &StationCommand)>,
    memory: &mut MemoryFile,
    mut log: Option<&mut LiveLog>,
    diary: &mut Diary,
) -> anyhow::Result<()> {
    while let Some(output) = agent.poll() {
        match output {
            Output::Gauge(pack, gauge) => {
                if let Some(log) = &mut log {
                    log.gauge(&pack_stem(config, &pack), &gauge);
                }
                if let Some(Net { link, .. }) = net {
                    link.publish(&Key::PackGauge(config.id.clone(), pack), &gauge).await?;
                }
            }
            Output::State(state) => {
                if let Some(Net { link, .. }) = net {
                    link.publish(&Key::StationState(config.id.clone()), &state).await?;
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
