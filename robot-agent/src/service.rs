//! The agent on Zenoh and a clock.

use std::time::Duration;

use energy::Channel;
use node::session::{QUESTIONS, command, decoded, refuse, reply};
use node::{Clock, Diary, LOAD_INPUTS, LOOK_S, Link, LiveLog, MemoryFile, Pace, Sole, Step, told_to_stop};
use proto::{Key, Pattern, RobotCommand, SimSupply, Timestamp, plain};
use tokio::sync::mpsc;
use tracing::warn;
use zenoh::query::Query;

use crate::agent::{Agent, Input, Output};
use crate::config::Config;
use crate::source::{Observation, Place, Source};

/// Runs until the source ends or the process is told to stop; `log` is where what the source shows is
/// written.
///
/// # Errors
/// When the session cannot be opened or is lost for good.
pub async fn run(
    config: &Config,
    mut agent: Agent,
    mut source: Box<dyn Source>,
    mut memory: MemoryFile,
    mut log: Option<LiveLog>,
) -> anyhow::Result<()> {
    let link = Link::open(&config.network, config.site.clone()).await?;
    let robot = &config.id;
    let clock = Clock::new(config.clock);
    let (alive, said) = (Key::RobotAlive(robot.clone()), Key::RobotState(robot.clone()));
    let period = clock.real(config.publish.state_period_s);
    let mut sole = Sole::claim(&link, format!("robot {robot}"), &alive, &said, period).await?;
    let (commands_in, mut commands) = mpsc::channel(QUESTIONS);
    let _commands = link.serve(Key::RobotCommand(robot.clone()).build(&link.site), commands_in).await?;
    let (supplies_in, mut supplies) = mpsc::unbounded_channel::<SimSupply>();
    let supplied = move |sample: zenoh::sample::Sample| match decoded::<SimSupply>(sample.payload()) {
        Ok(supply) => drop(supplies_in.send(supply)),
        Err(error) => warn!("{} was refused: {error}", plain(sample.key_expr())),
    };
    let _supplies = link.listen(&Pattern::SimSupplyTo(robot.clone()), supplied).await?;
    let (lives_in, mut lives) = mpsc::unbounded_channel();
    let _lives = link.watch(&Key::CoordinatorAlive, lives_in).await?;
    let mut diary = Diary::begin(format!("robot {robot}"));
    if !agent.reaches_a_station() {
        warn!("no way to any station is known: {robot} is watched and never serviced; give travel_s, or --travel STATION=SECONDS");
    }

    let mut ticks = tokio::time::interval(clock.real(LOOK_S).max(Duration::from_millis(5)));
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut pace = Pace::new(source.stride(), clock);
    let mut station = None;
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
                    drain(&link, config, &mut agent, source.as_mut(), None, &mut station, &mut memory, log.as_mut(), &mut diary).await?;
                }
                diary.alone(agent.is_alone(clock.now()), config.alone.silent_s);
                log.as_mut().map(LiveLog::flush);
                if let (Some(at), Some(draw)) = (&station, source.draw()) {
                    link.publish(&Key::SimDraw(Clone::clone(at), robot.clone()), &draw).await?;
                }
            }
            Some(supply) = supplies.recv() => source.supply(&supply),
            Some(heard) = lives.recv() => {
                diary.coordinator(heard);
                agent.handle(clock.now(), Input::Coordinator(heard));
            }
            Some(query) = commands.recv() => {
                if let Some(why) = sole.doubt() {
                    refuse(&query, why).await;
                } else if let Some(command) = command::<RobotCommand>(&query).await {
                    let now = clock.now();
                    agent.handle(now, Input::Command(command.clone()));
                    let asked = Some((&query, now, &command));
                    drain(&link, config, &mut agent, source.as_mut(), asked, &mut station, &mut memory, log.as_mut(), &mut diary).await?;
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
    link: &Link,
    config: &Config,
    agent: &mut Agent,
    source: &mut dyn Source,
    asked: Option<(&Query, Timestamp, &RobotCommand)>,
    station: &mut Option<proto::StationId>,
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
                link.publish(&Key::RobotGauge(config.id.clone()), &gauge).await?;
            }
            Output::State(state) => {
                station.clone_from(&state.station);
                tracing::debug!("robot {}: {}", config.id, state.phase);
                link.publish(&Key::RobotState(config.id.clone()), &state).await?;
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
