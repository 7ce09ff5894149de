//! `coordinator plan`: plans an instance of the docking problem, and says how good the plan is.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use comfy_table::{Cell, CellAlignment};
use planner::{Budget, Capacity, Instance, Mode, Moves, NoPlan, Plan};

use super::{Format, say_text, table, text};
use crate::counted::counted;

/// Plans an instance (`mds-inst-1`) and proves how far the plan may be from the best.
#[derive(clap::Args)]
pub struct Args {
    /// The instance.
    instance: PathBuf,
    /// How long to better the plan, ms of wall time.
    #[arg(long, value_name = "MS", default_value_t = 1000, conflicts_with = "iterations")]
    budget_ms: u64,
    /// A number of moves in place of a time: the same plan on every machine.
    #[arg(long, value_name = "MOVES")]
    iterations: Option<u64>,
    /// Seed of the search.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true, value_parser = super::seed)]
    seed: u64,
    /// How to plan: optimise, threshold, lowest_soc, earliest_deadline or least_slack.
    #[arg(long, default_value = "optimise")]
    policy: String,
    /// How to print; JSON is an `mds-sol-1` schedule.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    /// Writes the schedule as JSON to this file as well.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Runs the command. Exit 0: there is a plan; 1: no plan can keep to the rules.
///
/// # Errors
/// When the instance cannot be read, the policy is not known or the output cannot be written.
pub fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let text = node::files::read_text(&args.instance)?;
    let instance = Instance::parse(&text).with_context(|| format!("{} cannot be planned", args.instance.display()))?;
    let mut budget: Box<dyn Budget> = match args.iterations {
        Some(moves) => Box::new(Moves(moves)),
        None => Box::new(wall_time(args.budget_ms)),
    };
    let plan = match planner::plan(&instance.problem, &args.policy, args.seed, &mut *budget) {
        Ok(plan) => plan,
        Err(error @ NoPlan::Policy { .. }) => return Err(error.into()),
        Err(NoPlan::Impossible(reasons)) => {
            reasons.iter().for_each(|reason| eprintln!("no plan is possible: {reason}"));
            return Ok(ExitCode::from(1));
        }
    };
    let capacity = planner::capacity(&instance.problem);
    let json = planner::solution::to_json(&instance, &args.policy, &plan, &capacity);
    if let Some(path) = &args.output {
        node::files::write_text(path, &format!("{json}\n"))?;
    }
    match args.format {
        Format::Json => say!("{json}"),
        Format::Table => show(&instance, &plan, &capacity),
    }
    Ok(ExitCode::SUCCESS)
}

#[allow(clippy::disallowed_methods, reason = "the command line keeps the time; the planner only asks how much is used")]
fn wall_time(budget_ms: u64) -> impl FnMut(u64) -> f64 {
    let start = std::time::Instant::now();
    move |_| if budget_ms == 0 { 1.0 } else { start.elapsed().as_secs_f64() * 1e3 / budget_ms as f64 }
}

fn show(instance: &Instance, plan: &Plan, capacity: &Capacity) {
    let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
    let mut levels = table();
    levels.set_header(["level", "plan", "bound", "gap"]);
    let names = ["robots stranded", "missed work", "energy, mWh", "packs drawn from"];
    for (level, name) in names.into_iter().enumerate() {
        let gap = match (plan.objective.all()[level], plan.bound.all()[level]) {
            (value, bound) if value == bound => "proven best".to_owned(),
            // There is no share of nothing.
            (value, 0) => format!("{value} above"),
            _ => format!("{:.2} %", plan.gaps()[level] * 100.0),
        };
        levels.add_row([
            Cell::new(name),
            right(plan.objective.all()[level].to_string()),
            right(plan.bound.all()[level].to_string()),
            right(gap),
        ]);
    }
    say_text(&text(&levels));
    let mut sessions = table();
    sessions.set_header(["robot", "station", "how", "bay", "start", "end"]);
    for session in &plan.sessions {
        let how = match session.mode {
            Mode::Charge(level) => {
                let battery = instance.problem.battery(session.robot);
                format!("charge to {:.0} %", 100.0 * battery.targets[usize::from(level)] as f64 / battery.capacity as f64)
            }
            Mode::Swap => "exchange".to_owned(),
            Mode::SwapAndRecharge => "exchange, recharge the old pack".to_owned(),
        };
        sessions.add_row([
            right(instance.robot_ids[session.robot].to_string()),
            right(instance.station_ids[session.station].to_string()),
            Cell::new(how),
            right(session.bay.map_or_else(String::new, |bay| bay.to_string())),
            right(session.start.to_string()),
            right(session.end.to_string()),
        ]);
    }
    say!();
    say_text(&text(&sessions));
    for one in &plan.unserved {
        let stranded = if one.stranded { ", runs empty" } else { "" };
        say!("robot {} unserved{stranded}: {}", instance.robot_ids[one.robot], one.reasons.join("; "));
    }
    say!(
        "the packs hold energy for {} wholly from one pack each (at most {}), {} if packs share (at most {})",
        counted(capacity.atomic.len(), "robot"),
        capacity.atomic_bound,
        capacity.split,
        capacity.split_bound
    );
}
