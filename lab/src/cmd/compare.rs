//! `lab compare`: where a model fails.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use lab::compare::{Verdict, calibrate, compare};
use lab::output::{check_writable, write_whole};
use lab::plot::file::{Kind, bars_svg, traces_svg};
use lab::plot::regimes::charts;
use lab::plot::traces;
use lab::report::comparison::human;

use super::inputs::{Answered, LogArgs, ModelArg, same_file};
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    model: ModelArg,
    #[command(flatten)]
    logs: LogArgs,
    /// Judge what is left once the offsets and gains of sensors, and how each log begins, are at their best within what the model and the
    /// logs state of them.
    #[arg(long)]
    calibrate: bool,
    /// Draw measured and predicted over time, with the residual, into this .svg or .png file.
    #[arg(long, value_name = "OUT.svg|.png")]
    plot: Option<PathBuf>,
    /// Draw the error by regime into this .svg or .png file.
    #[arg(long, value_name = "OUT.svg|.png")]
    plot_regimes: Option<PathBuf>,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    for path in args.plot.iter().chain(&args.plot_regimes) {
        Kind::of(path)?;
        check_writable(path)?;
        args.logs.spare(Some(path))?;
        args.model.spare(Some(path), Answered::Other)?;
    }
    if let (Some(traces), Some(regimes)) = (&args.plot, &args.plot_regimes) {
        ensure!(!same_file(traces, regimes), "--plot and --plot-regimes both name {}; give each a file of its own", regimes.display());
    }
    let source = args.model.load()?;
    let (model, values) = (&source.model, source.model.values());
    let logs = args.logs.prepare(model)?;
    let (logs, found) = if args.calibrate { calibrate(model, &values, logs) } else { (logs, Vec::new()) };
    let result = compare(model, &values, &logs);
    let result = if args.calibrate { result.calibrated(found) } else { result.with_calibration(model, &values, &logs) };
    if let Some(path) = &args.plot {
        draw(path, traces_svg(&model.name, &traces(model, &values, &logs)))?;
    }
    if let Some(path) = &args.plot_regimes {
        draw(path, bars_svg(&format!("{}: error by regime", model.name), &charts(&result.regimes)))?;
    }
    print(format, &result, || human(&result))?;
    Ok(answer(result.verdict))
}

/// What the exit status says about a verdict.
pub(super) fn answer(verdict: Verdict) -> Answer {
    match verdict {
        Verdict::WithinFloor => Answer::Yes,
        Verdict::LeavesError => Answer::No,
        Verdict::FloorUnknown => Answer::CannotTell,
    }
}

fn draw(path: &Path, svg: String) -> anyhow::Result<()> {
    write_whole(path, &Kind::of(path)?.bytes(svg)?)?;
    eprintln!("lab: wrote {}", path.display());
    Ok(())
}
