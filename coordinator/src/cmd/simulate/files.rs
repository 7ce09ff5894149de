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

/// Where scenarios are kept, seen from the folder that holds everything.
const SCENARIOS: &str = "scenarios";

/// Reads a scenario. Where there is no such file, the error tells the one that may be meant.
pub(super) fn scenario(path: &Path) -> anyhow::Result<String> {
    match node::files::read_text(path) {
        Err(error) if !path.exists() => match meant(path, Path::new("")) {
            Some(near) => Err(error.context(format!("there is no scenario {}; did you mean `{}`?", path.display(), near.display()))),
            None => Err(error),
        },
        read => read,
    }
}

/// The scenario whose name comes nearest, of those in the same folder and of those where scenarios are kept.
fn meant(path: &Path, here: &Path) -> Option<PathBuf> {
    let wrong = path.file_name()?.to_str()?;
    let wrong = wrong.strip_suffix(".toml").unwrap_or(wrong);
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut known: Vec<PathBuf> = [folder, Path::new(SCENARIOS)].into_iter().flat_map(|folder| tomls(here, folder)).collect();
    known.sort();
    let name = |path: &PathBuf| path.file_stem().and_then(|stem| stem.to_str()).map(str::to_owned);
    let names: Vec<String> = known.iter().filter_map(name).collect();
    let near = energy::document::nearest(wrong, names.iter().map(String::as_str))?;
    known.iter().find(|path| name(path).as_deref() == Some(near)).cloned()
}

/// Files of that folder, which is relative to `here`, that end as scenarios do.
fn tomls(here: &Path, folder: &Path) -> Vec<PathBuf> {
    let looked_at = here.join(folder);
    let looked_at = if looked_at.as_os_str().is_empty() { PathBuf::from(".") } else { looked_at };
    let entries = std::fs::read_dir(looked_at).into_iter().flatten().flatten();
    let files = entries.map(|entry| folder.join(entry.file_name()));
    files.filter(|path| path.extension().is_some_and(|ending| ending == "toml")).collect()
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scenario_that_is_not_there_is_told_by_the_nearest_that_is() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join(SCENARIOS)).unwrap();
        for file in ["scenarios/mds-three-explorers.toml", "scenarios/one-bay.toml", "scenarios/one-bay.txt", "yard.toml"] {
            std::fs::write(folder.path().join(file), "").unwrap();
        }
        let told = |path: &str| meant(Path::new(path), folder.path()).map(|near| near.display().to_string());
        let three = Some("scenarios/mds-three-explorers.toml".to_owned());
        assert_eq!([told("mds-three-explorers"), told("scenarios/mds-three-explorer.toml")], [three.clone(), three]);
        assert_eq!(told("yrad.toml").as_deref(), Some("yard.toml"));
        assert_eq!(told("scenarios/nothing-of-that-kind.toml"), None);
    }
}
