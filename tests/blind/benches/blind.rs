//! The whole benchmark: asks the lab about every case and prints the table.
//!
//! `cargo bench -p blind` runs the development seeds, one case after another, so that times mean
//! something; `-- --help` lists what else it can do.

use std::path::PathBuf;

use blind::plan::{DEVELOPMENT_SEED, PUBLISHED_SEED};
use blind::score::deviations;
use blind::{Choice, Kind, Outcome, ask, run, table, tally, with_formulas};
use clap::Parser;
use energy::System;

/// Blind benchmark of the lab.
#[derive(Debug, Parser)]
struct Arguments {
    /// At most so many cases, spread over the plan; more than it has begin it again.
    #[arg(long)]
    cases: Option<usize>,
    /// Seed of the first case. The published table takes --published instead.
    #[arg(long, default_value_t = DEVELOPMENT_SEED)]
    seed_from: u64,
    /// The seeds of the published table. Never tune on them.
    #[arg(long, conflicts_with_all = ["seed_from", "only", "verbose", "dump"])]
    published: bool,
    /// Only cases of this kind.
    #[arg(long, value_parser = kind)]
    kind: Option<Kind>,
    /// Only cases of this system.
    #[arg(long, value_parser = system)]
    system: Option<System>,
    /// Only cases whose name contains this.
    #[arg(long)]
    only: Option<String>,
    /// Tells each case's truth and the answer to it.
    #[arg(long)]
    verbose: bool,
    /// Many cases at a time: quicker, and times mean nothing. Also by BLIND_PARALLEL=1.
    #[arg(long)]
    parallel: bool,
    /// JSON instead of Markdown.
    #[arg(long)]
    json: bool,
    /// Writes base model and logs of every case into this folder.
    #[arg(long)]
    dump: Option<PathBuf>,
    /// Given by cargo.
    #[arg(long, hide = true)]
    bench: bool,
}

fn kind(text: &str) -> Result<Kind, String> {
    let known = || Kind::ALL.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ");
    Kind::ALL.iter().copied().find(|kind| kind.name() == text).ok_or_else(|| format!("known kinds: {}", known()))
}

fn system(text: &str) -> Result<System, String> {
    let all = [System::Battery, System::Robot, System::Station];
    all.into_iter().find(|system| system.name() == text).ok_or_else(|| "known systems: battery, robot, station".to_owned())
}

fn main() {
    let arguments = Arguments::parse();
    let choice = Choice {
        seed_from: if arguments.published { PUBLISHED_SEED } else { arguments.seed_from },
        cases: arguments.cases,
        kind: arguments.kind,
        system: arguments.system,
        only: arguments.only.clone(),
        formulas: true,
        parallel: arguments.parallel || std::env::var_os("BLIND_PARALLEL").is_some(),
    };
    let each = |outcome: &Outcome| {
        if arguments.verbose {
            tell(outcome);
        }
        if let Some(folder) = &arguments.dump {
            dump(folder, outcome).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        }
    };
    let outcomes = run(&choice, &ask, &worked_s, &each);
    let formulas: Vec<_> = outcomes.iter().filter_map(|outcome| outcome.formula).collect();
    let marks: Vec<_> = outcomes.into_iter().map(|outcome| outcome.mark).collect();
    let mut lines = tally(&marks);
    lines.extend(with_formulas(&formulas));
    if arguments.json {
        println!("{:#}", table::json(&lines));
    } else {
        println!("{} cases, seeds from {}\n\n{}", marks.len(), choice.seed_from, table::markdown(&lines));
    }
}

/// Time that this thread has worked, s: what other programs do on the machine does not count.
/// Where the kernel does not tell, the time on the wall.
#[expect(clippy::disallowed_methods, reason = "a bench measures time")]
fn worked_s() -> f64 {
    use std::sync::OnceLock;
    use std::time::Instant;
    static BEGIN: OnceLock<Instant> = OnceLock::new();
    let begin = BEGIN.get_or_init(Instant::now);
    let kernel = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let worked_ns = kernel.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    worked_ns.map_or_else(|| begin.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

fn tell(Outcome { case, answer, mark, formula }: &Outcome) {
    let verdict = if mark.right { "right" } else { "not right" };
    println!("{} (seed {}): {verdict}", case.name, case.seed);
    println!("  truth: {}", case.truth.story);
    println!("  leaves: {:?}, {:?}", case.truth.leaves().by_channel, mark.bin);
    println!(
        "  answer: {} selected {:?} equivalent {:?}; held out {:.3} x floor, {:.3} s",
        answer.verdict, answer.selected, answer.equivalent, mark.holdout_over_floor, mark.cpu_s
    );
    for (effect, parameter, truth, value, deviations) in deviations(case, answer) {
        println!("  {effect}.{parameter} is {truth:.4e}, said to be {value:.4e}: {deviations:+.2} sigma");
    }
    if let Some(formula) = formula {
        println!("  formula: held out {:.3} -> {:.3} x floor", formula.before, formula.after);
    }
    if !mark.wrong.is_empty() {
        println!("  wrong names: {:?}", mark.wrong);
    }
}

fn dump(folder: &std::path::Path, Outcome { case, .. }: &Outcome) -> std::io::Result<()> {
    let folder = folder.join(format!("{}-{}", case.name.replace('/', "-"), case.seed));
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("base.toml"), &case.base_model_toml)?;
    for log in case.train.iter().chain(&case.holdout) {
        std::fs::write(folder.join(format!("{}.csv", log.name)), log.csv())?;
        std::fs::write(folder.join(format!("{}.toml", log.name)), log.facts_toml())?;
    }
    Ok(())
}
