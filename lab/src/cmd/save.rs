//! Arguments of verbs that write a model.

use std::path::{Path, PathBuf};

use lab::output::check_writable;
use proto::Timestamp;

#[derive(Debug, clap::Args)]
pub(super) struct SaveArgs {
    /// Where to write the model that comes of it; nothing is written when left out.
    #[arg(short, long, value_name = "MODEL2")]
    output: Option<PathBuf>,
    /// Date to record as the origin of the numbers, YYYY-MM-DD.
    #[arg(long, value_name = "DATE", value_parser = date)]
    date: Option<String>,
}

impl SaveArgs {
    /// Refuses a place that cannot be written, before the work begins.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        Ok(self.output().map_or(Ok(()), check_writable)?)
    }

    pub(super) fn output(&self) -> Option<&Path> {
        self.output.as_deref()
    }

    pub(super) fn date(&self) -> Option<&str> {
        self.date.as_deref()
    }

    /// The place as it was given, for answers.
    pub(super) fn told(&self) -> Option<String> {
        self.output().map(|path| path.display().to_string())
    }
}

/// A date as people and files write it.
pub(super) fn date(text: &str) -> Result<String, String> {
    let shape = text.len() == 10 && text.split('-').map(str::len).eq([4, 2, 2]);
    match format!("{text}T00:00:00Z").parse::<Timestamp>() {
        Ok(_) if shape => Ok(text.to_owned()),
        _ => Err("write a day of the calendar as YYYY-MM-DD".to_owned()),
    }
}
