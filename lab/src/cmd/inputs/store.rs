//! A coordinator's store as one of the logs.

use std::path::PathBuf;

use anyhow::bail;
use lab::measurement::{Log, LogFacts, StoreQuery, Subject, instant, read_store};

use super::say;

#[derive(Debug, clap::Args)]
pub(super) struct StoreArgs {
    /// A coordinator's store, a file or `postgres://` address, read as one more log, also while the coordinator works with it.
    #[arg(long, value_name = "STORE.db")]
    pub(super) store: Option<PathBuf>,
    /// Whose battery to read from the store.
    #[arg(long, requires = "store", conflicts_with = "station")]
    robot: Option<String>,
    /// Which station to read from the store; with --pack, that pack of it.
    #[arg(long, requires = "store")]
    station: Option<String>,
    /// Which pack of the station.
    #[arg(long, requires = "station")]
    pack: Option<String>,
    /// Begin of the part to read: RFC 3339, or seconds since 1970.
    #[arg(long, value_name = "TIME", requires = "store", allow_negative_numbers = true)]
    from: Option<String>,
    /// End of the part to read.
    #[arg(long, value_name = "TIME", requires = "store", allow_negative_numbers = true)]
    to: Option<String>,
}

impl StoreArgs {
    /// The log that the flags name, if they do.
    pub(super) fn read(&self, facts: LogFacts) -> anyhow::Result<Option<Log>> {
        let Some(path) = &self.store else { return Ok(None) };
        let subject = match (&self.robot, &self.station, &self.pack) {
            (Some(robot), _, _) => Subject::Robot(robot.clone()),
            (None, Some(station), Some(pack)) => Subject::Pack { station: station.clone(), pack: pack.clone() },
            (None, Some(station), None) => Subject::Station(station.clone()),
            (None, None, _) => bail!("--store: say whose log with --robot or --station"),
        };
        let time = |flag: &str, text: &Option<String>| {
            text.as_deref().map(|text| instant(text).map_err(|error| anyhow::anyhow!("{flag}: {error}"))).transpose()
        };
        let (from, to) = (time("--from", &self.from)?, time("--to", &self.to)?);
        if let (Some(begin), Some(end)) = (from, to)
            && begin > end
        {
            bail!("--from {begin} is after --to {end}");
        }
        let log = read_store(path, &StoreQuery { subject, from, to }, facts)?;
        say(&log.notes);
        Ok(Some(log))
    }
}
