//! `coordinator schedule`: asks the running coordinator over Zenoh, or reads its store when none
//! runs.

mod chart;
mod tell;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::Subcommand;
use node::NetworkConfig;
use proto::{Capacity, Explanation, Key, Message, RobotId, Schedule, SiteId};

use super::Format;
use crate::config::Config;
use crate::service;
use crate::store::{Reader, Store};

/// The configuration where none is named.
const CONFIG: &str = "coordinator.toml";

/// Shows what the coordinator has decided.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: Option<What>,
    /// The coordinator's configuration: tells site, address and store.
    #[arg(long, value_name = "FILE", default_value = CONFIG, env = "TENDER_CONFIG", global = true)]
    config: PathBuf,
    /// The store to read when no coordinator answers.
    #[arg(long, value_name = "FILE", global = true)]
    store: Option<PathBuf>,
    /// Address of the coordinator or router.
    #[arg(long, value_name = "ADDRESS", global = true)]
    connect: Vec<String>,
    /// How to print.
    #[arg(long, value_enum, default_value_t, global = true)]
    format: Format,
}

#[derive(Subcommand)]
enum What {
    /// Who docks where and when, and who does not.
    Show {
        /// Draws who is where when, in the terminal.
        #[arg(long)]
        gantt: bool,
        /// Draws the same into an SVG file.
        #[arg(long, value_name = "FILE")]
        svg: Option<PathBuf>,
    },
    /// How many robots each pack can still service.
    Capacity,
    /// Why a robot is serviced as it is.
    Explain {
        /// The robot.
        robot: RobotId,
    },
    /// Shows the schedule again whenever it changes, until Ctrl-C.
    Watch,
    /// What happened last, from the store.
    History {
        /// How many events.
        #[arg(long, default_value_t = 40)]
        events: usize,
    },
}

/// Where answers come from.
struct Place {
    network: NetworkConfig,
    site: SiteId,
    store: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// When neither a coordinator answers nor a store can be read, or the robot is not known.
pub async fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let place = place(args)?;
    node::begin_with_one_thread(&place.network)?;
    match args.what.as_ref().unwrap_or(&What::Show { gantt: false, svg: None }) {
        What::Show { gantt, svg } => {
            let schedule: Schedule = match live(&place, &Key::Schedule).await? {
                Some(schedule) => schedule,
                None => stored(&place).await?.latest_schedule().await?.context("the store holds no plan yet")?,
            };
            if let Some(file) = svg {
                node::files::write_text(file, &chart::svg(&schedule))?;
            }
            print(args.format, &schedule, if *gantt { chart::show } else { show });
        }
        What::Capacity => {
            let capacity: Capacity = match live(&place, &Key::Capacity).await? {
                Some(capacity) => capacity,
                None => stored(&place).await?.latest_capacity().await?.context("the store holds no capacity yet")?,
            };
            print(args.format, &capacity, tell::show_capacity);
        }
        What::Explain { robot } => {
            let explanation: Explanation = match live(&place, &Key::Explain(robot.clone())).await? {
                Some(explanation) => explanation,
                None => {
                    let store = stored(&place).await?;
                    let Some(explanation) = store.latest_explanation(robot).await? else {
                        let known = store.explained().await?;
                        let hint = energy::document::hint(robot.as_ref(), known.iter().map(String::as_str));
                        anyhow::bail!("the store holds nothing about robot {robot}{hint} Known: {}", known.join(", "));
                    };
                    explanation
                }
            };
            print(args.format, &explanation, tell::show_explanation);
        }
        What::Watch => watch(&place, args.format).await?,
        What::History { events } => {
            let events = stored(&place).await?.events(*events).await?;
            match args.format {
                Format::Table => events.iter().for_each(tell::show_event),
                Format::Json => say!("{}", serde_json::to_string_pretty(&events)?),
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Follows the schedule as the coordinator publishes it. A new plan that says the same is not shown.
async fn watch(place: &Place, format: Format) -> anyhow::Result<()> {
    let link = node::Link::open(&place.network, place.site.clone()).await?;
    let (heard, mut plans) = tokio::sync::mpsc::unbounded_channel::<Schedule>();
    let plan_heard = move |sample: zenoh::sample::Sample| match node::session::decoded(sample.payload()) {
        Ok(schedule) => drop(heard.send(schedule)),
        Err(error) => tracing::warn!("{}: {error}", sample.key_expr()),
    };
    let subscriber = link.session.declare_subscriber(Key::Schedule.build(&link.site)).callback(plan_heard);
    let _subscriber = subscriber.await.map_err(|error| anyhow::anyhow!("{error}"))?;
    let mut shown = None;
    let mut show_new = |schedule: Schedule| {
        let said = (schedule.services.clone(), schedule.unserved.clone(), schedule.doubts.clone());
        if shown.as_ref() == Some(&said) {
            return;
        }
        match format {
            Format::Table => {
                show(&schedule);
                say!();
            }
            // One line each, for programs that read as it comes.
            Format::Json => say!("{}", String::from_utf8_lossy(&proto::encode(&schedule))),
        }
        shown = Some(said);
    };
    match live(place, &Key::Schedule).await? {
        Some(schedule) => show_new(schedule),
        None => eprintln!("waiting for a plan"),
    }
    let mut stop = std::pin::pin!(node::told_to_stop());
    loop {
        tokio::select! {
            Some(schedule) = plans.recv() => show_new(schedule),
            () = &mut stop => return Ok(()),
        }
    }
}

fn place(args: &Args) -> anyhow::Result<Place> {
    // Flags alone are enough; a configuration that is named, or lies here, says the rest.
    let config = if args.config.exists() || args.config != Path::new(CONFIG) {
        Some(Config::read(&args.config)?)
    } else if args.store.is_none() && args.connect.is_empty() {
        anyhow::bail!("there is no {CONFIG} here: name a configuration by --config, or use --store or --connect");
    } else {
        None
    };
    let connect = match (&config, args.connect.is_empty()) {
        (_, false) => args.connect.clone(),
        (Some(config), true) => [config.network.listen.clone(), config.network.connect.clone()].concat(),
        (None, true) => Vec::new(),
    };
    let store = match (&args.store, &config) {
        (Some(store), _) => store.clone(),
        (None, Some(config)) => config.store_path(Some(&args.config)),
        (None, None) => PathBuf::from("tender.db"),
    };
    let site = match &config {
        Some(config) => config.site.clone(),
        None => SiteId::new("site")?,
    };
    let tls = config.and_then(|config| config.network.tls);
    let network = NetworkConfig { connect, tls, ..NetworkConfig::agent() };
    if !network.connect.is_empty() {
        network.check()?;
    }
    Ok(Place { network, site, store })
}

async fn live<M: Message>(place: &Place, key: &Key) -> anyhow::Result<Option<M>> {
    if place.network.connect.is_empty() {
        return Ok(None);
    }
    let answer = service::ask(&place.network, &place.site, key).await?;
    if answer.is_none() {
        eprintln!(
            "no coordinator answers at {}: this is the last that the store {} holds",
            place.network.connect.join(", "),
            place.store.display()
        );
    }
    Ok(answer)
}

async fn stored(place: &Place) -> anyhow::Result<Reader> {
    Ok(Store::open_read_only(&place.store).await?)
}

pub(super) use tell::show;

fn print<M: Message>(format: Format, message: &M, show: impl Fn(&M)) {
    match format {
        Format::Table => show(message),
        Format::Json => say!("{}", proto::encode_pretty(message)),
    }
}
