//! `coordinator doctor`: what a coordinator needs on this machine, and what to do about what is not
//! there.
//!
//! ```text
//!   config.rs    does the file hold, do its models load
//!   certificates.rs  for whom, until when, and whose the key is
//!   network.rs   ports, router, who is there, whether their clocks agree
//!   fleet.rs     who runs empty, what the coordinator complains of
//!   machine.rs   the store, the dashboard's port, this machine's clock
//! ```

mod certificates;
mod config;
mod fleet;
mod machine;
mod network;

use std::path::PathBuf;
use std::process::ExitCode;

use serde::Serialize;

use super::{Format, table, text};
use crate::config::Config;

/// Checks configuration, models, certificates, store, ports, router, agents and clocks, and says what to do.
/// Changes nothing. Exit status 0: nothing stands in the way; 1: something does.
#[derive(clap::Args)]
pub struct Args {
    /// Configuration file of the coordinator.
    #[arg(long, value_name = "FILE", default_value = "coordinator.toml", env = "TENDER_CONFIG")]
    config: PathBuf,
    /// Sets a key of the configuration, as `coordinator run` does.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// How to print.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// How a check came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    Ok,
    Note,
    Fail,
}

/// What a check found.
#[derive(Debug, Serialize)]
struct Finding {
    check: &'static str,
    verdict: Verdict,
    found: String,
    /// What to do; empty when there is nothing to do.
    advice: String,
}

impl Finding {
    fn ok(check: &'static str, found: impl Into<String>) -> Self {
        Self { check, verdict: Verdict::Ok, found: found.into(), advice: String::new() }
    }

    fn note(check: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { check, verdict: Verdict::Note, found: found.into(), advice: advice.into() }
    }

    fn fail(check: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { check, verdict: Verdict::Fail, found: found.into(), advice: advice.into() }
    }
}

/// Runs the command.
///
/// # Errors
/// When the answer cannot be printed as JSON.
pub async fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let findings = match Config::read_with(&args.config, &args.set) {
        Ok(config) => {
            node::begin_with_one_thread(&config.network)?;
            all(args, &config).await
        }
        Err(error) => vec![config::unreadable(&args.config, &error)],
    };
    match args.format {
        Format::Table => print(&findings),
        Format::Json => say!("{}", serde_json::to_string_pretty(&findings)?),
    }
    let failed = findings.iter().any(|finding| finding.verdict == Verdict::Fail);
    Ok(ExitCode::from(u8::from(failed)))
}

async fn all(args: &Args, config: &Config) -> Vec<Finding> {
    let mut findings = config::check(config, &args.config);
    findings.extend(certificates::check(config));
    let seen = network::check(config).await;
    findings.push(machine::store(config, &args.config, seen.running).await);
    findings.extend(seen.findings);
    findings.push(machine::web(config, seen.running).await);
    findings.push(machine::clock());
    findings
}

fn print(findings: &[Finding]) {
    let mut rows = table();
    rows.set_header(["", "check", "found"]);
    for finding in findings {
        let sign = match finding.verdict {
            Verdict::Ok => "✓",
            Verdict::Note => "!",
            Verdict::Fail => "✗",
        };
        rows.add_row([sign, finding.check, finding.found.as_str()]);
    }
    super::say_text(&text(&rows));
    let to_do: Vec<&Finding> = findings.iter().filter(|finding| !finding.advice.is_empty()).collect();
    if to_do.is_empty() {
        say!("Nothing stands in the way.");
    }
    for finding in to_do {
        let sign = if finding.verdict == Verdict::Fail { "✗" } else { "!" };
        say!("{sign} {}: {}", finding.check, finding.advice);
    }
}
