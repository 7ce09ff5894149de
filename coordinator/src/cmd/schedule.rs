//! `coordinator schedule`: asks the running coordinator over Zenoh, or reads its store when none
//! runs.

mod chart;
mod history;
mod tell;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::Subcommand;
use node::{Link, NetworkConfig};
use proto::{Capacity, Explanation, Key, Message, RobotId, Schedule, SiteId};

use super::Format;
use super::presence::Present;
use crate::config::Config;
use crate::service;
use crate::store::{Reader, Store, shown};

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
    /// The site, where no configuration says it, or another one.
    #[arg(long, value_name = "SITE", global = true)]
    site: Option<SiteId>,
    /// The store to read when no coordinator answers.
    #[arg(long, value_name = "FILE", global = true)]
    store: Option<PathBuf>,
    /// Address of the coordinator or router. When nobody answers there, only a store named by --store is read.
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
    History(history::Args),
}

/// Where answers come from.
struct Place {
    network: NetworkConfig,
    site: SiteId,
    /// Whether somebody said that site.
    knows_site: bool,
    store: Option<PathBuf>,
    /// Whether the store may answer where no coordinator does: what lies here need not be of whom --connect names.
    falls_back: bool,
    config: Option<Config>,
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
            if schedule.plan == 0 && args.format == Format::Table {
                say_who_is_missing(&place).await;
            }
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
        What::History(asked) => {
            let events = history::read(&stored(&place).await?, asked).await?;
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
    let link = Link::open(&place.network, place.site.clone()).await?;
    let (heard, mut plans) = tokio::sync::mpsc::unbounded_channel::<Schedule>();
    let plan_heard = move |sample: zenoh::sample::Sample| match node::session::decoded(sample.payload()) {
        Ok(schedule) => drop(heard.send(schedule)),
        Err(error) => tracing::warn!("{}: {error}", proto::plain(sample.key_expr())),
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
    match service::ask(&place.network, &place.site, &Key::Schedule).await? {
        Some(schedule) => show_new(schedule),
        None => eprintln!("waiting for a plan of site {}{}", place.site, others(place).await),
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
    let store = args.store.clone().or_else(|| config.as_ref().map(|config| config.store_path(Some(&args.config))));
    let falls_back = args.store.is_some() || args.connect.is_empty();
    let site = match (&args.site, &config) {
        (Some(site), _) => site.clone(),
        (None, Some(config)) => config.site.clone(),
        (None, None) => SiteId::new("site")?,
    };
    // A store does not change while no coordinator writes it.
    anyhow::ensure!(
        !connect.is_empty() || !matches!(args.what, Some(What::Watch)),
        "watch follows a running coordinator: say where by --connect, or name its configuration by --config; \
         `schedule show --store FILE` shows what a store holds"
    );
    let tls = config.as_ref().and_then(|config| config.network.tls.clone());
    let network = NetworkConfig { connect, tls, ..NetworkConfig::agent() };
    if !network.connect.is_empty() {
        network.check()?;
    }
    let knows_site = args.site.is_some() || config.is_some();
    Ok(Place { network, site, knows_site, store, falls_back, config })
}

async fn live<M: Message>(place: &Place, key: &Key) -> anyhow::Result<Option<M>> {
    if place.network.connect.is_empty() {
        return Ok(None);
    }
    let answer = service::ask(&place.network, &place.site, key).await?;
    if answer.is_none() {
        let nobody =
            format!("no coordinator of site {} answers at {}{}", place.site, place.network.connect.join(", "), others(place).await);
        anyhow::ensure!(place.falls_back, "{nobody}; --store FILE shows what a store holds");
        let reader = stored(place).await?;
        let whose = whose(&reader).await?;
        eprintln!("{nobody}: this is the last of the store {}{whose}", shown(reader.path()).display());
    }
    Ok(answer)
}

/// Whose coordinators do answer there.
async fn others(place: &Place) -> String {
    let Ok(link) = Link::try_open(&place.network, place.site.clone()).await else { return String::new() };
    let sites: Vec<String> = link.sites().await.iter().filter(|site| **site != place.site).map(ToString::to_string).collect();
    // It is asked nothing more.
    let _ = link.session.close().await;
    if sites.is_empty() { String::new() } else { format!("; there is one of {} (--site)", sites.join(", ")) }
}

/// Says whom the first plan waits for, where a configuration tells who is to come.
async fn say_who_is_missing(place: &Place) {
    let Some(config) = &place.config else { return };
    let Ok(link) = Link::try_open(&place.network, place.site.clone()).await else { return };
    let absent = Present::look(&link).await.absent(config);
    let _ = link.session.close().await;
    if !absent.is_empty() {
        say!("not there: {}", absent.join(", "));
    }
}

async fn stored(place: &Place) -> anyhow::Result<Reader> {
    let store = place.store.as_ref().context("which store? name it by --store, or a configuration that says it by --config")?;
    let reader = Store::open_read_only(store).await?;
    if let Some(site) = reader.site().await?.filter(|site| place.knows_site && *site != place.site.as_str()) {
        anyhow::bail!(
            "store {} belongs to site {site}, not to {}: name another store, or --site {site}",
            shown(store).display(),
            place.site
        );
    }
    Ok(reader)
}

/// Whose the store is, and how old what it holds.
async fn whose(reader: &Reader) -> anyhow::Result<String> {
    let site = reader.site().await?.map_or_else(String::new, |site| format!(" of site {site}"));
    let age = reader.latest_schedule().await?.map_or_else(String::new, |plan| format!(", with a plan of {}", plan.at));
    Ok(format!("{site}{age}"))
}

pub(super) use tell::show;

fn print<M: Message>(format: Format, message: &M, show: impl Fn(&M)) {
    match format {
        Format::Table => show(message),
        Format::Json => say!("{}", proto::encode_pretty(message)),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn who_watches_has_to_say_where_a_coordinator_runs() {
        let place = |words: &[&str]| place(&Command::parse_from(["schedule"].iter().chain(words)).args);
        let refused = place(&["watch", "--store", "tender.db"]).err().unwrap().to_string();
        assert!(refused.contains("--connect") && refused.contains("--config") && refused.contains("show --store"), "{refused}");
        assert!(place(&["watch", "--store", "tender.db", "--connect", "tcp/127.0.0.1:7447"]).is_ok());
        assert!(place(&["show", "--store", "tender.db"]).is_ok());
    }
}
