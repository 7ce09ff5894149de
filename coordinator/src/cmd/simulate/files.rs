//! What a run leaves in files.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use proto::SiteId;

use super::{Args, Finished};
use crate::scenario::{RunEntry, Scenario};
use crate::store::{Record, Store};
use crate::web::report::{self, Report};

/// Records that are kept at a time.
const BATCH: usize = 10_000;

/// One folder per run when there are several.
pub(super) fn folder_of(base: &Path, alone: bool, run: &RunEntry) -> PathBuf {
    if alone { base.to_owned() } else { base.join(run.folder()) }
}

/// Writes everything that was asked for.
pub(super) fn write(args: &Args, scenario: &Scenario, seed: u64, finished: &[Finished]) -> anyhow::Result<()> {
    if let Some(base) = &args.out {
        std::fs::create_dir_all(base).with_context(|| format!("cannot make {}", base.display()))?;
        let run = |run: &Finished| report::Run::new(&run.run.name, &run.outcome, &run.past, &run.verdicts);
        let (title, note) = (scenario.name.clone(), scenario.note.clone());
        let report = Report { title, note, seed, version: env!("CARGO_PKG_VERSION"), runs: finished.iter().map(run).collect() };
        node::files::write_text(&base.join("report.html"), &report.html())?;
    }
    for run in finished {
        if let (Some(base), Some(telemetry)) = (&args.telemetry, &run.outcome.telemetry) {
            telemetry.write(&folder_of(base, finished.len() == 1, &run.run))?;
        }
        if let Some(base) = &args.out {
            let folder = folder_of(base, finished.len() == 1, &run.run);
            std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
            node::files::write_text(&folder.join("trace.txt"), &run.outcome.trace())?;
            node::files::write_text(&folder.join("schedule.json"), &proto::encode_pretty(&run.outcome.schedule))?;
        }
    }
    if let (Some(path), [run]) = (&args.store, finished) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        runtime.block_on(keep(path, &run.outcome.site, &run.outcome.records))?;
    }
    Ok(())
}

/// Writes a new store, in a folder of this process beside its place until it is whole: what a killed one leaves is in nobody's way.
async fn keep(path: &Path, site: &SiteId, records: &[Record]) -> anyhow::Result<()> {
    let name = path.file_name().with_context(|| format!("--store {}: that is no name of a file", path.display()))?;
    let folder = path.with_file_name(format!(".{}.{}.part", name.to_string_lossy(), std::process::id()));
    std::fs::create_dir(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let kept = async {
        let part = folder.join(name);
        let store = Store::open_for(&part, site.as_ref()).await?;
        for batch in records.chunks(BATCH) {
            store.append(batch).await?;
        }
        store.close().await;
        std::fs::rename(&part, path).with_context(|| format!("cannot write {}", path.display()))
    };
    let kept = kept.await;
    let cleared = std::fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()));
    kept.and(cleared)
}
