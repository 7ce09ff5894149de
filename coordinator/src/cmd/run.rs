//! `coordinator run`: the live service.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::config::Config;
use crate::service;

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
    /// Store in place of the configured one.
    #[arg(long, value_name = "FILE")]
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
        config.store = std::path::absolute(store)?;
    }
    service::run(&config, Some(&args.config), node::told_to_stop()).await?;
    Ok(ExitCode::SUCCESS)
}
