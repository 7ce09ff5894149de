//! `coordinator import`: other programs' descriptions of a fleet as a scenario.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, ensure};
use clap::Subcommand;
use node::files::{read_text, write_text};

use super::Format;
use crate::counted::counted;
use crate::rmf::{Fleet, Graph, Import, Wishes, import};

/// Makes a scenario of another program's description of a fleet.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    from: From,
}

#[derive(Subcommand)]
enum From {
    /// The fleet configuration of an Open-RMF fleet adapter (YAML).
    Rmf(RmfArgs),
}

#[derive(clap::Args)]
struct RmfArgs {
    /// The fleet configuration.
    #[arg(value_name = "FLEET.yaml")]
    fleet: PathBuf,
    /// Its navigation graph: chargers, and how far it is to them.
    #[arg(long, value_name = "GRAPH.yaml")]
    graph: Option<PathBuf>,
    /// Folder for scenario and models; made when it is not there. Nothing in it is overwritten.
    #[arg(short, long, value_name = "DIR", default_value = ".")]
    output: PathBuf,
    /// Simulated time, h.
    #[arg(long, default_value_t = 24.0)]
    hours: f64,
    /// Share of its working time that a robot drives, 0 to 1.
    #[arg(long, default_value_t = 1.0)]
    driving: f64,
    /// How far the numbers of power may be off, a robot's and a charger's: standard deviation over number, 0 to 1.
    #[arg(long, default_value_t = 0.1)]
    sigma: f64,
    /// How to print.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Runs the command.
///
/// # Errors
/// When the description cannot be read, or a file is there already.
pub fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let From::Rmf(args) = &args.from;
    let fleet = Fleet::parse(&args.fleet.display().to_string(), &read_text(&args.fleet)?)?;
    let graph = args.graph.as_ref().map(|path| Graph::parse(&path.display().to_string(), &read_text(path)?)).transpose()?;
    let imported = import(&fleet, graph.as_ref(), Wishes { hours: args.hours, driving: args.driving, sigma: args.sigma })?;
    write(&args.output, &imported)?;
    let scenario = args.output.join(&imported.scenario);
    match args.format {
        Format::Json => say!("{}", serde_json::to_string_pretty(&imported)?),
        Format::Table => show(&fleet, &imported, &args.output, &scenario),
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes every file, or none when one of them is there already.
fn write(folder: &Path, imported: &Import) -> anyhow::Result<()> {
    for (name, _) in &imported.files {
        let path = folder.join(name);
        ensure!(!path.exists(), "{} is there already: give another folder with --output, or move it away", path.display());
    }
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    imported.files.iter().try_for_each(|(name, text)| write_text(&folder.join(name), text))
}

fn show(fleet: &Fleet, imported: &Import, folder: &Path, scenario: &Path) {
    say!("fleet {}, {}: {}", fleet.name, counted(fleet.robots.len(), "robot"), scenario.display());
    for (name, _) in &imported.files[1..] {
        say!("  model {}", folder.join(name).display());
    }
    for (title, lines) in [
        ("taken", &imported.taken),
        ("assumed", &imported.assumed),
        ("not modelled by RMF", &imported.not_modelled),
        ("not used", &imported.unused),
    ] {
        if !lines.is_empty() {
            say!("{title}:");
            lines.iter().for_each(|line| say!("  - {line}"));
        }
    }
    say!("run it: coordinator simulate {}", scenario.display());
}
