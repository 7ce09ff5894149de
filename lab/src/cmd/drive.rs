//! `lab drive`: makes a robot's first model of data sheets.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, ensure};
use lab::drive::RobotSheet;
use lab::model_source::parse_beside;
use lab::output::write_whole;
use lab::report::drive::DriveReport;

use super::inputs::same_file;
use super::save::SaveArgs;
use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// What data sheets say of motors, gears and wheels: a TOML file such as scenarios/sheets/explorer.toml.
    #[arg(value_name = "SHEET.toml")]
    sheet: PathBuf,
    #[command(flatten)]
    save: SaveArgs,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    args.save.check()?;
    if let Some(output) = args.save.output() {
        ensure!(!same_file(&args.sheet, output), "{} is the data sheet that is read here; write to another file", output.display());
    }
    let file = args.sheet.display().to_string();
    let sheet = RobotSheet::parse(&file, &fs::read_to_string(&args.sheet).with_context(|| format!("cannot read {file}"))?)?;
    let named = args.sheet.file_name().map_or_else(|| file.clone(), |name| name.to_string_lossy().into_owned());
    let date = args.save.date().map_or_else(String::new, |date| format!(", {date}"));
    let text = sheet.model_text(&format!("lab {} of {}{date}", env!("CARGO_PKG_VERSION"), named.escape_debug()));
    let place = args.save.output().unwrap_or(Path::new("the model"));
    let model = parse_beside(place, &text).with_context(|| format!("{} would not load again, so it was not written", place.display()))?;
    if let Some(path) = args.save.output() {
        write_whole(path, text.as_bytes())?;
    }
    let report = DriveReport::of(&sheet, &Arc::new(model), args.save.told());
    print(format, &report, || {
        let wrote =
            report.output.as_ref().map_or_else(|| "nothing written: say -o MODEL.toml\n".to_owned(), |path| format!("wrote {path}\n"));
        report.human() + &wrote
    })?;
    Ok(Answer::Yes)
}
