//! `coordinator run`: the live service.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;

use crate::config::Config;
use crate::service;
use crate::store::StoreError;

/// Runs beside a fleet until Ctrl-C. A flag comes before the environment, that before the file.
#[derive(clap::Args)]
pub struct Args {
    /// Configuration file.
    #[arg(long, value_name = "FILE", default_value = "coordinator.toml", env = "TENDER_CONFIG")]
    config: PathBuf,
    /// Sets a key of the configuration, such as policy.confidence=0.9; before the environment's
    /// TENDER_SET_POLICY__CONFIDENCE.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Address to listen on in place of the configured one, such as tcp/127.0.0.1:7447.
    #[arg(long, value_name = "ADDRESS")]
    listen: Vec<String>,
    /// Router to connect to; then nothing is listened on.
    #[arg(long, value_name = "ADDRESS", conflicts_with = "listen")]
    connect: Vec<String>,
    /// Store in place of the configured one: a file, or postgres://USER@HOST/DATABASE (the password in
    /// PGPASSWORD); several coordinators may share that one, one of them leads.
    #[arg(long, value_name = "STORE")]
    store: Option<PathBuf>,
    /// Port of the dashboard in place of the configured one; 0 for any that is free.
    #[arg(long, value_name = "PORT")]
    web_port: Option<u16>,
    /// Runs without a dashboard.
    #[arg(long, conflicts_with = "web_port")]
    no_web: bool,
}

/// Time between two looks for a store's server that was there before.
const AGAIN: Duration = Duration::from_secs(1);

/// Files that may be open at a time, where the system allows it: each agent that is connected is one, and so is each page that is open.
const OPEN_FILES: u64 = 65_536;

/// Asks for as many open files as may be had: a thousand, which is usual, is too few for a thousand agents.
fn raise_open_files() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let most = limit.maximum.map_or(OPEN_FILES, |most| most.min(OPEN_FILES));
    if limit.current.is_some_and(|now| now < most)
        && let Err(why) = setrlimit(Resource::Nofile, Rlimit { current: Some(most), ..limit })
    {
        tracing::debug!("no more than {:?} files may be open: {why}", limit.current);
    }
}

/// Runs the command. Exit status 1 says that the store's server does not answer.
///
/// # Errors
/// When configuration, models, store or network cannot be had.
pub async fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let mut config = Config::read_with(&args.config, &args.set)?;
    if !args.listen.is_empty() {
        config.network.listen.clone_from(&args.listen);
        config.network.check().context("--listen")?;
    }
    if !args.connect.is_empty() {
        config.network.connect.clone_from(&args.connect);
        config.network.listen.clear();
        config.network.check().context("--connect")?;
    }
    if let Some(store) = &args.store {
        let address = store.to_str().is_some_and(|text| text.contains("://"));
        config.store = if address { store.clone() } else { std::path::absolute(store)? };
    }
    config.web.port = args.web_port.unwrap_or(config.web.port);
    config.web.enabled &= !args.no_web;
    raise_open_files();
    node::begin_with_one_thread(&config.network)?;
    let mut stop = std::pin::pin!(node::told_to_stop());
    // Who has led goes on to stand by, also while the store's server is away.
    let (mut has_led, mut warned) = (false, false);
    loop {
        let ended = service::run(&config, Some(&args.config), &mut stop).await;
        let store = ended.as_ref().err().and_then(|error| error.downcast_ref::<StoreError>());
        match store {
            Some(error @ (StoreError::Deposed { .. } | StoreError::Lapsed { .. })) => {
                tracing::warn!("{error}: this one stands by");
                (has_led, warned) = (true, false);
            }
            Some(error) if has_led && error.is_of_the_moment() => {
                if !std::mem::replace(&mut warned, true) {
                    tracing::warn!("{error} Asking again until it does.");
                }
                tokio::select! {
                    () = tokio::time::sleep(AGAIN) => {}
                    () = &mut stop => return Ok(ExitCode::SUCCESS),
                }
            }
            // That the server does not answer yet is nothing that somebody has to mend in the configuration.
            Some(error) if error.is_of_the_moment() => {
                eprintln!("coordinator: {error}");
                return Ok(ExitCode::FAILURE);
            }
            _ => return ended.map(|()| ExitCode::SUCCESS),
        }
    }
}
