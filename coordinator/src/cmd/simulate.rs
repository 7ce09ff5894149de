//! `coordinator simulate`: a scenario, faster than real time.

mod files;
mod tables;

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use energy::System;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::Format;
use super::serve::Stage;
use crate::models::Kept;
use crate::scenario::{RunEntry, Scenario, Verdict};
use crate::sim::{self, Outcome};
use crate::web::report::{Ended, Measured};
use crate::web::{Books, Past, WebConfig};

/// Runs a scenario and says whether it came as its [expect] says.
#[derive(clap::Args)]
pub struct Args {
    /// The scenario file.
    scenario: PathBuf,
    /// Another seed than the scenario's.
    #[arg(long, allow_negative_numbers = true, value_parser = super::seed)]
    seed: Option<u64>,
    /// A model to believe in place of the believed one of the same name, or of the same system.
    #[arg(long, value_name = "FILE")]
    model: Vec<String>,
    /// Only the run of this name.
    #[arg(long, value_name = "NAME")]
    run: Option<String>,
    /// Policies to compare, such as `threshold,least_slack,optimise`: each run is made with each.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    policy: Vec<String>,
    /// Folder for logs that `lab` reads: one CSV per battery, robot load and station.
    #[arg(long, value_name = "DIR")]
    telemetry: Option<PathBuf>,
    /// Folder for report.html, and the trace and the schedule of each run.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// New file for the store that a live coordinator would have kept: for `schedule --store` and `lab --store`.
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Shows the runs on the dashboard while they go on, and their end until Ctrl-C.
    #[arg(long)]
    serve: bool,
    /// Port of the dashboard on this machine; 0 for any that is free.
    #[arg(long, value_name = "PORT", default_value_t = WebConfig::PORT, requires = "serve")]
    port: u16,
    /// Simulated seconds per real second while it is shown.
    #[arg(long, value_name = "FACTOR", default_value_t = 60.0, requires = "serve", allow_negative_numbers = true)]
    speed: f64,
    /// How to print.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

struct Finished {
    run: RunEntry,
    outcome: Outcome,
    past: Past,
    verdicts: Vec<Verdict>,
}

/// Runs the command. Exit 0: as expected; 1: not as expected.
///
/// # Errors
/// When the scenario cannot be read or a folder cannot be written.
pub fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let text = files::scenario(&args.scenario)?;
    let mut scenario = Scenario::parse(&args.scenario, &text)?;
    let seed = args.seed.unwrap_or(scenario.seed);
    let mut runs = by_policy(&scenario, chosen(&scenario, args.run.as_deref())?, &args.policy)?;
    for model in &args.model {
        believe(&mut scenario, &mut runs, model)?;
    }
    // A simulation may take hours: what it is to be written to is there before.
    for folder in args.out.iter().chain(&args.telemetry) {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    }
    if let Some(store) = &args.store {
        ensure!(runs.len() == 1, "--store: a store is of one run, and this makes {}: choose one by --run or --policy", runs.len());
        ensure!(!store.exists(), "--store {}: it is there already; name a new file, or remove that one", store.display());
        let folder = store.parent().filter(|folder| !folder.as_os_str().is_empty());
        let is_there = folder.is_none_or(std::path::Path::is_dir);
        ensure!(is_there, "--store {}: there is no folder to put it into; make it first", store.display());
    }
    let mut stage = args.serve.then(|| Stage::open(args.port, args.speed)).transpose()?;
    let mut finished = Vec::new();
    let alone = runs.len() == 1;
    for run in runs {
        let kept = match (&args.telemetry, &args.store) {
            (Some(base), _) => Kept::Logs(files::folder_of(base, alone, &run).display().to_string()),
            (None, Some(store)) => Kept::Store(store.display().to_string()),
            (None, None) => Kept::Nowhere,
        };
        let (outcome, past) = simulate(&scenario, &run, seed, (args, kept), stage.as_mut())?;
        let verdicts = scenario.verdicts(&run, &outcome.measured.metrics);
        finished.push(Finished { run, outcome, past, verdicts });
    }
    match args.format {
        Format::Table => tables::print(&scenario, seed, &finished, &args.policy),
        Format::Json => say!("{}", serde_json::to_string_pretty(&as_json(&scenario, seed, &finished))?),
    }
    files::write(args, &scenario, seed, &finished)?;
    let measured = |run: &Finished| Measured::new(&run.run.name, &run.outcome, &run.verdicts);
    let ended = Ended { note: scenario.note.clone(), runs: finished.iter().map(measured).collect() };
    if let (Some(stage), Some(last)) = (stage, finished.last_mut()) {
        stage.stay(&mut last.outcome, &last.past, &title(&scenario, &last.run), &ended);
    }
    let held = finished.iter().flat_map(|run| &run.verdicts).all(Verdict::holds);
    Ok(if held { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn chosen(scenario: &Scenario, only: Option<&str>) -> anyhow::Result<Vec<RunEntry>> {
    let runs = scenario.runs();
    let Some(name) = only else { return Ok(runs) };
    let names: Vec<String> = runs.iter().map(|run| run.name.clone()).collect();
    let chosen: Vec<RunEntry> = runs.into_iter().filter(|run| run.name == name).collect();
    if chosen.is_empty() {
        let hint = energy::document::hint(name, names.iter().map(String::as_str));
        bail!("--run {name}: there is no such run{hint} The scenario has: {}", names.join(", "));
    }
    Ok(chosen)
}

/// Every run with every policy, named after it; the runs themselves when no policy is named. What the scenario expects of a run it
/// expects of the policy that it names for it.
fn by_policy(scenario: &Scenario, runs: Vec<RunEntry>, policies: &[String]) -> anyhow::Result<Vec<RunEntry>> {
    if policies.is_empty() {
        return Ok(runs);
    }
    for (index, policy) in policies.iter().enumerate() {
        ensure!(!policies[..index].contains(policy), "--policy: `{policy}` is named twice");
    }
    let alone = runs.len() == 1;
    let with = |run: &RunEntry, policy: &String| RunEntry {
        name: if alone { policy.clone() } else { format!("{}, {policy}", run.name) },
        is_other: scenario.policy_of(run) != *policy,
        policy: Some(policy.clone()),
        ..run.clone()
    };
    Ok(runs.iter().flat_map(|run| policies.iter().map(|policy| with(run, policy)).collect::<Vec<_>>()).collect())
}

/// Puts a model in place of the believed one of its name, or of the only one of its system; also of one that a run believes in instead.
fn believe(scenario: &mut Scenario, runs: &mut [RunEntry], model: &str) -> anyhow::Result<()> {
    let given = node::files::model(model, None)?;
    let path =
        if energy::built_in(model).is_some() { model.to_owned() } else { std::path::absolute(model)?.to_string_lossy().into_owned() };
    let beside = scenario.folder.join("scenario.toml");
    let mut is_a_runs = false;
    for other in runs.iter_mut().flat_map(|run| run.believed.replace.values_mut()) {
        if node::files::model(other, Some(&beside))?.name == given.name {
            other.clone_from(&path);
            is_a_runs = true;
        }
    }
    let mut of_system = Vec::new();
    for name in scenario.model_names() {
        let known = node::files::model(name, Some(&beside))?;
        if known.name == given.name {
            of_system = vec![name.to_owned()];
            break;
        }
        if known.system == given.system {
            of_system.push(name.to_owned());
        }
    }
    if is_a_runs && !of_system.iter().any(|name| node::files::model(name, Some(&beside)).is_ok_and(|known| known.name == given.name)) {
        return Ok(());
    }
    let [replaced] = &of_system[..] else {
        let system = given.system.name();
        match (of_system.len(), given.system) {
            (0, System::Battery | System::Robot | System::Station) => bail!("--model {model}: the scenario has no model of a {system}"),
            _ => bail!(
                "--model {model}: its name `{}` is none of the scenario's, which has several models of a {system}: {}",
                given.name,
                of_system.join(", ")
            ),
        }
    };
    // What a run believes in instead comes after what all believe in.
    for run in runs.iter() {
        if let Some(other) = run.believed.replace.get(replaced) {
            eprintln!("coordinator: note: --model {model}: run \"{}\" goes on to believe in {other} in its place", run.name);
        }
    }
    scenario.believed.replace.insert(replaced.clone(), path);
    Ok(())
}

fn title(scenario: &Scenario, run: &RunEntry) -> String {
    if run.name == scenario.name { run.name.clone() } else { format!("{}: {}", scenario.name, run.name) }
}

fn simulate(
    scenario: &Scenario,
    run: &RunEntry,
    seed: u64,
    (args, kept): (&Args, Kept),
    mut stage: Option<&mut Stage>,
) -> anyhow::Result<(Outcome, Past)> {
    let duration_s = *scenario.duration_s.get_ref();
    let bar = if std::io::stderr().is_terminal() { ProgressBar::new(duration_s as u64) } else { ProgressBar::hidden() };
    let style = ProgressStyle::with_template("{msg:24} {bar:40} {percent:>3} % {eta}").unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style);
    bar.set_message(run.name.clone());
    bar.enable_steady_tick(Duration::from_millis(200));
    let deployment = scenario.deploy(run, seed).with_context(|| args.scenario.display().to_string())?;
    let mut past = Past::default();
    let seen = args.out.is_some() || stage.is_some();
    let (site, title) = (deployment.coordinator.site.clone(), title(scenario, run));
    if let Some(stage) = &mut stage {
        stage.begin();
    }
    let mut watch = |step: sim::Step<'_>| {
        bar.set_position(step.elapsed_s as u64);
        if seen {
            step.news.iter().for_each(|event| past.event(event));
            past.look(step.now, step.core);
        }
        if let Some(stage) = &mut stage {
            stage.step(step, Books { site: &site, title: &title, ended: None, past: &past, store: None, ladder: None });
        }
    };
    let outcome = sim::simulate(&deployment, duration_s, scenario.temperature_degc, kept, &mut watch);
    bar.finish_and_clear();
    Ok((outcome.with_context(|| format!("run \"{}\"", run.name))?, past))
}

fn as_json(scenario: &Scenario, seed: u64, finished: &[Finished]) -> serde_json::Value {
    let run = |run: &Finished| {
        let verdicts: Vec<_> = run
            .verdicts
            .iter()
            .map(|v| json!({ "metric": v.metric, "expected": v.expected.to_string(), "measured": v.measured, "holds": v.holds() }))
            .collect();
        json!({
            "name": run.run.name,
            "metrics": run.outcome.measured.metrics,
            "expect": verdicts,
            "first_plan": run.outcome.measured.first_plan,
            "first_capacity": run.outcome.measured.first_capacity,
            "last_schedule": run.outcome.schedule,
            "events": run.outcome.events,
        })
    };
    json!({ "scenario": scenario.name, "seed": seed, "runs": finished.iter().map(run).collect::<Vec<_>>() })
}
