//! `coordinator certs`: the certificates by which a site's processes know each other.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, ensure};
use clap::Subcommand;
use node::access::Members;
use proto::{RobotId, SiteId, StationId};

use crate::certs::{self, Holder};
use crate::config::Config;

/// Makes the certificates by which a site's processes know each other.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Makes a site's authority. Its key lets anybody in: keep it where no robot is.
    Init {
        /// The site.
        #[arg(long)]
        site: SiteId,
        /// Folder of the authority.
        #[arg(long, value_name = "DIR", default_value = "site-ca")]
        dir: PathBuf,
        /// How long it is valid, days.
        #[arg(long, default_value_t = 3650, value_parser = clap::value_parser!(u32).range(1..))]
        days: u32,
    },
    /// Issues a certificate: `coordinator`, `router`, `robot ID`, `station ID` or `viewer NAME`.
    Issue {
        /// Whom it is for, and its id.
        #[arg(num_args = 1..=2, required = true)]
        holder: Vec<String>,
        /// The site.
        #[arg(long)]
        site: SiteId,
        /// Folder of the authority.
        #[arg(long, value_name = "DIR", default_value = "site-ca")]
        dir: PathBuf,
        /// Folder for certificate and key.
        #[arg(long, value_name = "DIR", default_value = ".")]
        out: PathBuf,
        /// Name or address at which others reach it; loopback when none is given.
        #[arg(long, value_name = "HOST")]
        host: Vec<String>,
        /// How long it is valid, days.
        #[arg(long, default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..))]
        days: u32,
    },
    /// Prints the access rules of a site, for the configuration of a router of its own.
    Rules {
        /// The coordinator's configuration: its robots and stations are let in.
        #[arg(long, value_name = "FILE", default_value = "coordinator.toml")]
        config: PathBuf,
        /// Who may look.
        #[arg(long, value_name = "NAME")]
        viewer: Vec<String>,
    },
}

/// Runs the command.
///
/// # Errors
/// When a file is there already, or cannot be written.
pub fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    // A clock that is a little behind must not refuse what was issued today.
    let today = node::clock::unix_ms() / certs::MS_PER_DAY;
    match &args.command {
        Command::Init { site, dir, days } => {
            let files = certs::init(dir, site, today - 1..today + i64::from(*days))?;
            say!("{}  the authority of site {site}: every process needs it", files.certificate.display());
            say!("{}  its key: only for issuing, keep it away from the fleet", files.key.display());
        }
        Command::Issue { holder, site, dir, out, host, days } => {
            let holder = read(holder)?;
            let files = certs::issue(dir, site, &holder, host, today - 1..today + i64::from(*days), out)?;
            say!("[network.tls]");
            say!("ca = \"{}\"", dir.join("ca.pem").display());
            say!("certificate = \"{}\"", files.certificate.display());
            say!("key = \"{}\"", files.key.display());
        }
        Command::Rules { config, viewer } => {
            let config = Config::read(config)?;
            let members = Members {
                robots: config.robots.keys().cloned().collect(),
                stations: config.stations.keys().cloned().collect(),
                viewers: config.viewers.iter().chain(viewer).cloned().collect(),
            };
            let rules = serde_json::json!({ "access_control": members.rules(&config.site) });
            say!("{}", serde_json::to_string_pretty(&rules)?);
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn read(words: &[String]) -> anyhow::Result<Holder> {
    let id = || words.get(1).with_context(|| format!("{} needs an id: coordinator certs issue {} ID", words[0], words[0]));
    let holder = match words[0].as_str() {
        "coordinator" => Holder::Coordinator,
        "router" => Holder::Router,
        "robot" => Holder::Robot(RobotId::new(id()?.clone())?),
        "station" => Holder::Station(StationId::new(id()?.clone())?),
        "viewer" => Holder::Viewer(RobotId::new(id()?.clone()).context("a viewer's name")?.to_string()),
        other => anyhow::bail!("{other}: a certificate is for a coordinator, router, robot ID, station ID or viewer NAME"),
    };
    ensure!(words.len() == 1 || !matches!(holder, Holder::Coordinator | Holder::Router), "{} has no id but that of its site", words[0]);
    Ok(holder)
}
