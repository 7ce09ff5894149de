//! `lab ocv`: makes a battery's first model of its own logs.

use std::path::PathBuf;

use anyhow::Context as _;
use lab::measurement::{Log, Role};
use lab::model_source::parse_beside;
use lab::ocv::{Sheet, first_model, model_text};
use lab::output::write_whole;
use lab::report::first::FirstReport;

use super::inputs::{FactArgs, counted_twice, same_file, say, spare};
use super::save::SaveArgs;
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Logs of the battery: slow discharges and charges between full and empty, or pulses with rests. Facts about L.csv are
    /// read from L.toml beside it.
    #[arg(long = "log", value_name = "LOG", required = true, num_args = 1..)]
    logs: Vec<PathBuf>,
    /// Voltage to which a cell is charged, V.
    #[arg(long, value_name = "VOLTS")]
    full_v_per_cell: f64,
    /// Voltage of a cell at which a discharge ends, V.
    #[arg(long, value_name = "VOLTS")]
    eod_v_per_cell: f64,
    /// Cells in series.
    #[arg(long, default_value_t = 1, value_name = "CELLS")]
    series: u32,
    /// Cells in parallel.
    #[arg(long, default_value_t = 1, value_name = "CELLS")]
    parallel: u32,
    /// Capacity of the pack, Ah, where no log runs slowly between full and empty.
    #[arg(long, value_name = "AH")]
    capacity_ah: Option<f64>,
    /// Current with which it is charged, A; half the capacity an hour when left out.
    #[arg(long, value_name = "AMPERES")]
    charge_current_a: Option<f64>,
    /// Current at which a charge ends, A; a twentieth of the capacity an hour when left out.
    #[arg(long, value_name = "AMPERES")]
    charge_cutoff_a: Option<f64>,
    /// The fastest steady current that still shows the open-circuit voltage, as a share of the capacity an hour.
    #[arg(long, default_value_t = 0.5, value_name = "PER_HOUR")]
    slow_c_rate: f64,
    /// Name of the model; that of the file when left out.
    #[arg(long)]
    name: Option<String>,
    #[command(flatten)]
    facts: FactArgs,
    #[command(flatten)]
    save: SaveArgs,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    args.save.check()?;
    if let Some(output) = args.save.output() {
        args.logs.iter().try_for_each(|log| spare(log, output))?;
    }
    for (index, path) in args.logs.iter().enumerate() {
        let twice = args.logs[..index].iter().any(|known| same_file(known, path));
        anyhow::ensure!(!twice, "the log {} is given twice; it would count twice", path.display());
    }
    let logs: Vec<Log> = args.logs.iter().map(|path| args.facts.read(path)).collect::<Result<_, _>>()?;
    let (held, logs): (Vec<Log>, Vec<Log>) = logs.into_iter().partition(|log| log.facts.role == Some(Role::Holdout));
    say(&held.iter().map(|log| format!("{}: role = \"holdout\": it is kept to judge by, and not used", log.file)).collect::<Vec<_>>());
    anyhow::ensure!(!logs.is_empty(), "no log to learn from: the facts of each say role = \"holdout\"");
    say(&counted_twice(&logs));
    let found = first_model(&args.sheet(), &logs)?;
    if let Some(path) = args.save.output() {
        let names: Vec<&str> = logs.iter().map(|log| log.name.as_str()).collect();
        let date = args.save.date().map_or_else(String::new, |date| format!(", {date}"));
        let text = model_text(&found, &format!("lab {} of {}{date}", env!("CARGO_PKG_VERSION"), names.join(", ")));
        parse_beside(path, &text).with_context(|| format!("the model would not load again, so {} was not written", path.display()))?;
        write_whole(path, text.as_bytes())?;
    }
    let report = FirstReport::of(&found, args.save.told());
    print(format, &report, || {
        let wrote =
            report.output.as_ref().map_or_else(|| "nothing written: say -o MODEL.toml\n".to_owned(), |path| format!("wrote {path}\n"));
        report.human() + &wrote
    })?;
    Ok(Answer::Yes)
}

impl Args {
    fn sheet(&self) -> Sheet {
        let of_file = self.save.output().and_then(|path| path.file_stem()).map(|stem| stem.to_string_lossy().into_owned());
        Sheet {
            name: self.name.clone().or(of_file).unwrap_or_else(|| "battery".to_owned()),
            series: self.series,
            parallel: self.parallel,
            full_v_per_cell: self.full_v_per_cell,
            eod_v_per_cell: self.eod_v_per_cell,
            charge_current_a: self.charge_current_a,
            charge_cutoff_a: self.charge_cutoff_a,
            capacity_ah: self.capacity_ah,
            slow_per_hour: self.slow_c_rate,
        }
    }
}
