//! `coordinator run`: the live service.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::config::Config;
use crate::service;
use crate::store::StoreError;

/// Runs beside a fleet until Ctrl-C.
#[derive(clap::Args)]
pub struct Args {
    /// Configuration file.
    #[arg(long, value_name = "FILE", default_value = "coordinator.toml")]
    config: PathBuf,
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
}

/// Runs the command.
///
/// # Errors
/// When configuration, models, store or network cannot be had.
pub async fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let mut config = Config::read(&args.config)?;
    if !args.listen.is_empty() {
        config.network.listen.clone_from(&args.listen);
    }
    if !args.connect.is_empty() {
        config.network.connect.clone_from(&args.connect);
        config.network.listen.clear();
    }
    if let Some(store) = &args.store {
        let address = store.to_str().is_some_and(|text| text.contains("://"));
        config.store = if address { store.clone() } else { std::path::absolute(store)? };
    }
    let mut stop = std::pin::pin!(node::told_to_stop());
    loop {
        match service::run(&config, Some(&args.config), &mut stop).await {
            Err(error) if matches!(error.downcast_ref(), Some(StoreError::Deposed { .. })) => {
                tracing::warn!("{error}: this one stands by");
            }
            ended => return ended.map(|()| ExitCode::SUCCESS),
        }
    }
}
