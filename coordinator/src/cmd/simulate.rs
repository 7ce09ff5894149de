//! `coordinator simulate`: a scenario, faster than real time.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, bail};
use comfy_table::{Cell, CellAlignment};
use energy::System;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::serve::Stage;
use super::{Format, table};
use crate::scenario::{RunEntry, Scenario, Verdict};
use crate::sim::{self, Outcome};
use crate::web::report::{self, Report};
use crate::web::{Books, Past, WebConfig};

/// Runs a scenario and says whether it came as its [expect] says.
#[derive(clap::Args)]
pub struct Args {
    /// The scenario file.
    scenario: PathBuf,
    /// Another seed than the scenario's.
    #[arg(long, allow_negative_numbers = true)]
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
    /// Shows the runs on the dashboard while they go on, and their end until Ctrl-C.
    #[arg(long)]
    serve: bool,
    /// Port of the dashboard on this machine; 0 for any that is free.
    #[arg(long, value_name = "PORT", default_value_t = WebConfig::PORT, requires = "serve")]
    port: u16,
    /// Simulated seconds per real second while it is shown.
    #[arg(long, value_name = "FACTOR", default_value_t = 60.0, requires = "serve")]
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
    let text = node::files::read_text(&args.scenario)?;
    let mut scenario = Scenario::parse(&args.scenario, &text)?;
    for model in &args.model {
        believe(&mut scenario, model)?;
    }
    let seed = args.seed.unwrap_or(scenario.seed);
    let runs = by_policy(chosen(&scenario, args.run.as_deref())?, &args.policy);
    let mut stage = args.serve.then(|| Stage::open(args.port, args.speed)).transpose()?;
    let mut finished = Vec::new();
    for run in runs {
        let (outcome, past) = simulate(&scenario, &run, seed, args, stage.as_mut())?;
        let verdicts = scenario.verdicts(&run, &outcome.measured.metrics);
        finished.push(Finished { run, outcome, past, verdicts });
    }
    write_files(args, &scenario, seed, &finished)?;
    match args.format {
        Format::Table => print_tables(&scenario, seed, &finished, &args.policy),
        Format::Json => say!("{}", serde_json::to_string_pretty(&as_json(&scenario, seed, &finished))?),
    }
    if let (Some(stage), Some(last)) = (stage, finished.last_mut()) {
        stage.stay(&mut last.outcome, &last.past, &title(&scenario, &last.run));
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

/// Every run with every policy, named after it; the runs themselves when no policy is named.
fn by_policy(runs: Vec<RunEntry>, policies: &[String]) -> Vec<RunEntry> {
    if policies.is_empty() {
        return runs;
    }
    let alone = runs.len() == 1;
    let with = |run: &RunEntry, policy: &String| RunEntry {
        name: if alone { policy.clone() } else { format!("{}, {policy}", run.name) },
        policy: Some(policy.clone()),
        ..run.clone()
    };
    runs.iter().flat_map(|run| policies.iter().map(|policy| with(run, policy)).collect::<Vec<_>>()).collect()
}

/// Puts a model in place of the believed one of its name, or of the only one of its system.
fn believe(scenario: &mut Scenario, model: &str) -> anyhow::Result<()> {
    let given = node::files::model(model, None)?;
    let mut of_system = Vec::new();
    for name in scenario.model_names() {
        let beside = scenario.folder.join("scenario.toml");
        let known = node::files::model(name, Some(&beside))?;
        if known.name == given.name {
            of_system = vec![name.to_owned()];
            break;
        }
        if known.system == given.system {
            of_system.push(name.to_owned());
        }
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
    let path =
        if energy::built_in(model).is_some() { model.to_owned() } else { std::path::absolute(model)?.to_string_lossy().into_owned() };
    scenario.believed.replace.insert(replaced.clone(), path);
    Ok(())
}

fn title(scenario: &Scenario, run: &RunEntry) -> String {
    if run.name == scenario.name { run.name.clone() } else { format!("{}: {}", scenario.name, run.name) }
}

fn simulate(scenario: &Scenario, run: &RunEntry, seed: u64, args: &Args, mut stage: Option<&mut Stage>) -> anyhow::Result<(Outcome, Past)> {
    let duration_s = *scenario.duration_s.get_ref();
    let bar = if std::io::stderr().is_terminal() { ProgressBar::new(duration_s as u64) } else { ProgressBar::hidden() };
    let style = ProgressStyle::with_template("{msg:24} {bar:40} {percent:>3} % {eta}").unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style);
    bar.set_message(run.name.clone());
    bar.enable_steady_tick(Duration::from_millis(200));
    let deployment = scenario.deploy(run, seed)?;
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
            stage.step(step, Books { site: &site, title: &title, past: &past, ladder: None });
        }
    };
    let outcome = sim::simulate(&deployment, duration_s, scenario.temperature_degc, args.telemetry.is_some(), &mut watch);
    bar.finish_and_clear();
    Ok((outcome.with_context(|| format!("run \"{}\"", run.name))?, past))
}

/// One folder per run when there are several.
fn folder_of(base: &Path, finished: &[Finished], run: &Finished) -> PathBuf {
    if finished.len() == 1 { base.to_owned() } else { base.join(run.run.folder()) }
}

fn write_files(args: &Args, scenario: &Scenario, seed: u64, finished: &[Finished]) -> anyhow::Result<()> {
    if let Some(base) = &args.out {
        std::fs::create_dir_all(base).with_context(|| format!("cannot make {}", base.display()))?;
        let run = |run: &Finished| report::Run::new(&run.run.name, &run.outcome, &run.past, &run.verdicts);
        let (title, note) = (scenario.name.clone(), scenario.note.clone());
        let report = Report { title, note, seed, version: env!("CARGO_PKG_VERSION"), runs: finished.iter().map(run).collect() };
        node::files::write_text(&base.join("report.html"), &report.html())?;
    }
    for run in finished {
        if let (Some(base), Some(telemetry)) = (&args.telemetry, &run.outcome.telemetry) {
            telemetry.write(&folder_of(base, finished, run))?;
        }
        if let Some(base) = &args.out {
            let folder = folder_of(base, finished, run);
            std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
            node::files::write_text(&folder.join("trace.txt"), &run.outcome.trace())?;
            node::files::write_text(&folder.join("schedule.json"), &proto::encode_pretty(&run.outcome.schedule))?;
        }
    }
    Ok(())
}

fn print_tables(scenario: &Scenario, seed: u64, finished: &[Finished], policy: &[String]) {
    say!("{} (seed {seed})", scenario.name);
    if !scenario.note.is_empty() {
        say!("{}", scenario.note);
    }
    for run in finished {
        say!("\n── {} ──", run.run.name);
        print_capacity(run);
        print_timeline(run);
    }
    say!();
    if !policy.is_empty() {
        print_policies(finished);
        say!();
    }
    print_comparison(finished);
}

/// What policies are compared by: `(heading, metric)`.
const COMPARED: &[(&str, &str)] = &[
    ("robots served", "robots_served"),
    ("services", "services_done"),
    ("stranded", "robots_stranded"),
    ("promises broken", "promises_broken"),
    ("mission hours", "mission_h"),
    ("pack Wh per service", "energy_per_service_wh"),
    ("gap", "plan_gap"),
    ("moved", "services_moved"),
];

fn print_policies(finished: &[Finished]) {
    let mut table = table();
    table.set_header(std::iter::once("policy").chain(COMPARED.iter().map(|(heading, _)| *heading)));
    for run in finished {
        let cell = |metric: &str| {
            let value = run.outcome.measured.metrics.get(metric).copied().unwrap_or(f64::NAN);
            let text = match metric {
                "plan_gap" => format!("{:.1} %", value * 100.0),
                _ if value.is_nan() => "-".to_owned(),
                _ => number(value),
            };
            Cell::new(text).set_alignment(CellAlignment::Right)
        };
        table.add_row(std::iter::once(Cell::new(&run.run.name)).chain(COMPARED.iter().map(|(_, metric)| cell(metric))));
    }
    super::say_text(&super::text(&table));
}

/// Kinds of event that tell the story; the rest is in the trace.
fn tells(kind: proto::EventKind) -> bool {
    use proto::EventKind as K;
    !matches!(kind, K::Joined | K::PhaseChanged | K::CommandSent | K::CommandAccepted)
}

fn print_timeline(run: &Finished) {
    let mut last = String::new();
    for event in run.outcome.events.iter().filter(|event| tells(event.kind)) {
        let minutes = event.at.seconds_since(run.outcome.start) / 60.0;
        let text = format!("{:<16} {}", event.kind.to_string(), event.text);
        if text != last {
            say!("{minutes:>7.1} min  {text}");
        }
        last = text;
    }
}

fn print_capacity(run: &Finished) {
    let Some(capacity) = &run.outcome.measured.first_capacity else { return };
    for pack in &capacity.packs {
        let causes: Vec<String> = pack.breakdown_wh.iter().map(|(cause, wh)| format!("{cause} {wh:.1}")).collect();
        say!(
            "    promise  {} of {} holds {:.1} ± {:.1} Wh usable, a service takes {:.1} ± {:.1} Wh ({}): {} robots at {:.0} %",
            pack.pack,
            pack.station,
            pack.usable_wh.value,
            pack.usable_wh.sigma,
            pack.service_wh.value,
            pack.service_wh.sigma,
            causes.join(", "),
            pack.robots_promised,
            pack.confidence * 100.0
        );
    }
}

fn print_comparison(finished: &[Finished]) {
    let mut table = table();
    let names = finished.iter().map(|run| Cell::new(&run.run.name).set_alignment(CellAlignment::Right));
    table.set_header(std::iter::once(Cell::new("")).chain(names));
    let metrics: Vec<&String> = finished.first().map_or_else(Vec::new, |run| run.outcome.measured.metrics.keys().collect());
    for metric in metrics {
        let values = finished.iter().map(|run| {
            let value = run.outcome.measured.metrics.get(metric).copied().unwrap_or(f64::NAN);
            let verdict = run.verdicts.iter().find(|verdict| verdict.metric == *metric);
            let mark = verdict.map_or(String::new(), |v| if v.holds() { " ✓".to_owned() } else { format!(" ✗ expected {}", v.expected) });
            Cell::new(format!("{}{mark}", number(value))).set_alignment(CellAlignment::Right)
        });
        table.add_row(std::iter::once(Cell::new(metric)).chain(values));
    }
    super::say_text(&super::text(&table));
    let (held, all) = finished.iter().flat_map(|run| &run.verdicts).fold((0, 0), |(held, all), v| (held + usize::from(v.holds()), all + 1));
    if all > 0 {
        say!("[expect]: {held} of {all} hold");
    }
}

fn number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e9 { format!("{value:.0}") } else { format!("{value:.3}") }
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
