//! The agent on Zenoh and a clock.

use std::time::Duration;

use anyhow::anyhow;
use node::session::decoded;
use node::{Clock, Link};
use proto::{Key, RobotCommand, SimSupply, encode};
use tokio::sync::mpsc;
use tracing::{info, warn};
use zenoh::query::Query;

use crate::agent::{Agent, Input, Output};
use crate::config::Config;
use crate::source::Source;

/// Fleet seconds between two looks at the source.
const STEP_S: f64 = 1.0;

/// Runs until the source ends or the process is told to stop.
///
/// # Errors
/// When the session cannot be opened or is lost for good.
pub async fn run(config: &Config, mut agent: Agent, mut source: Box<dyn Source>) -> anyhow::Result<()> {
    let link = Link::open(&config.network, config.site.clone()).await?;
    let robot = &config.id;
    let _alive =
        link.session.liveliness().declare_token(Key::RobotAlive(robot.clone()).build(&link.site)).await.map_err(|e| anyhow!("{e}"))?;
    let (commands_in, mut commands) = mpsc::unbounded_channel::<Query>();
    let _commands = link
        .session
        .declare_queryable(Key::RobotCommand(robot.clone()).build(&link.site))
        .callback(move |query| {
            let _ = commands_in.send(query);
        })
        .await
        .map_err(|e| anyhow!("{e}"))?;
    let (supplies_in, mut supplies) = mpsc::unbounded_channel::<SimSupply>();
    let _supplies = link
        .session
        .declare_subscriber(proto::Pattern::SimSupplyTo(robot.clone()).build(&link.site))
        .callback(move |sample| match decoded::<SimSupply>(sample.payload()) {
            Ok(supply) => drop(supplies_in.send(supply)),
            Err(error) => warn!("{} was refused: {error}", sample.key_expr()),
        })
        .await
        .map_err(|e| anyhow!("{e}"))?;
    info!("robot {robot} is up");

    let clock = Clock::new(config.clock);
    let mut ticks = tokio::time::interval(clock.real(STEP_S).max(Duration::from_millis(5)));
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut last = clock.now();
    let mut station = None;
    loop {
        tokio::select! {
            _ = ticks.tick() => {
                let now = clock.now();
                let behind_s = now.seconds_since(last);
                let steps = (behind_s / STEP_S).floor();
                for _ in 0..steps as u64 {
                    last = last.plus_s(STEP_S);
                    let Some(observation) = source.advance(STEP_S) else {
                        info!("robot {robot}: the source has ended");
                        return Ok(());
                    };
                    agent.handle(last, Input::Observed(observation));
                    drain(&link, config, &mut agent, source.as_mut(), None, &mut station).await?;
                }
                if let (Some(at), Some(draw)) = (&station, source.draw()) {
                    link.publish(&Key::SimDraw(Clone::clone(at), robot.clone()), &draw).await?;
                }
            }
            Some(supply) = supplies.recv() => source.supply(&supply),
            Some(query) = commands.recv() => {
                match query.payload().map(decoded::<RobotCommand>) {
                    Some(Ok(command)) => {
                        agent.handle(clock.now(), Input::Command(command));
                        drain(&link, config, &mut agent, source.as_mut(), Some(&query), &mut station).await?;
                    }
                    Some(Err(error)) => drop(query.reply_err(error.to_string()).await),
                    None => drop(query.reply_err("a command needs a payload").await),
                }
            }
            _ = tokio::signal::ctrl_c() => return Ok(()),
        }
    }
}

async fn drain(
    link: &Link,
    config: &Config,
    agent: &mut Agent,
    source: &mut dyn Source,
    query: Option<&Query>,
    station: &mut Option<proto::StationId>,
) -> anyhow::Result<()> {
    while let Some(output) = agent.poll() {
        match output {
            Output::Gauge(gauge) => link.publish(&Key::RobotGauge(config.id.clone()), &gauge).await?,
            Output::State(state) => {
                station.clone_from(&state.station);
                info!("robot {}: {}", config.id, state.phase);
                link.publish(&Key::RobotState(config.id.clone()), &state).await?;
            }
            Output::Act(act) => source.act(&act),
            Output::Reply(reply) => {
                if let Some(query) = query
                    && let Err(error) = query.reply(query.key_expr().clone(), encode(&reply)).await
                {
                    warn!("the answer to {} was not sent: {error}", reply.id);
                }
            }
        }
    }
    Ok(())
}
