//! What an agent must not forget when it is restarted, in a file.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use tracing::error;

use crate::files;

/// The key under which a memory says whose it is.
const OF: &str = "of";

/// A file that holds the newest memory of one agent; each write replaces it as a whole.
#[derive(Debug)]
pub struct MemoryFile {
    /// Whose it is.
    of: String,
    path: Option<PathBuf>,
    failed: bool,
}

impl MemoryFile {
    /// The file `path` of the agent `of`, relative to `beside` (the configuration that names it); none: nothing is kept.
    #[must_use]
    pub fn new(of: &str, path: Option<&Path>, beside: Option<&Path>) -> Self {
        let folder = beside.and_then(Path::parent);
        let path = path.map(|path| folder.map_or_else(|| path.to_owned(), |folder| folder.join(path)));
        Self { of: of.to_owned(), path, failed: false }
    }

    /// What was kept; nothing where nothing is.
    ///
    /// # Errors
    /// When there is a file that cannot be read as a memory (who starts over from nothing might act
    /// twice, so a person has to say so), or that is the memory of another agent.
    pub fn read<M: DeserializeOwned>(&self) -> anyhow::Result<Option<M>> {
        if let Some(trouble) = self.trouble() {
            error!("{trouble}");
        }
        let Some(path) = self.path.as_deref().filter(|path| path.exists()) else { return Ok(None) };
        let text = files::read_text(path)?;
        let foreign = || format!("{}: not a memory of this agent; remove it to start without one", path.display());
        let mut kept: Value = serde_json::from_str(&text).with_context(foreign)?;
        // What was kept before memories had a name is whoever's asks for it.
        let of = kept.as_object_mut().and_then(|kept| kept.remove(OF));
        if let Some(of) = of.as_ref().and_then(Value::as_str).filter(|of| *of != self.of) {
            bail!("{}: the memory of {of}, not of {}; two agents need two files (`memory`)", path.display(), self.of);
        }
        serde_json::from_value(kept).map(Some).with_context(foreign)
    }

    /// Why nothing can be kept there: told at the start, while somebody is looking, and not with the first command.
    fn trouble(&self) -> Option<String> {
        let failure = files::try_write(self.path.as_deref()?).err()?;
        Some(format!("{failure:#}; `memory` must lie in a folder that this program may write to; going on, but a restart would forget all"))
    }

    /// Keeps it: when this returns, it survives a kill and a power cut. A disk that cannot be written
    /// is told of once; the agent goes on, for a robot that stands still helps nobody.
    pub fn keep<M: Serialize>(&mut self, memory: &M) {
        let Some(path) = &self.path else { return };
        let mut kept = serde_json::to_value(memory).expect("a memory is plain data");
        if let Some(kept) = kept.as_object_mut() {
            kept.insert(OF.to_owned(), self.of.clone().into());
        }
        match files::write_text(path, &kept.to_string()) {
            Ok(()) => self.failed = false,
            Err(failure) if !std::mem::replace(&mut self.failed, true) => {
                error!("{failure:#}; going on, but a restart would forget what was done since");
            }
            Err(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_kept_is_told_before_there_is_anything_to_keep() {
        let folder = tempfile::tempdir().unwrap();
        let of = |path: &str| MemoryFile::new("r1", Some(Path::new(path)), Some(&folder.path().join("robot.toml")));
        assert_eq!((of("memory.json").trouble(), std::fs::read_dir(&folder).unwrap().count()), (None, 0));
        let trouble = of("nowhere/memory.json").trouble().unwrap();
        assert!(trouble.contains("nowhere/memory.json") && trouble.contains("may write to"), "{trouble}");
        assert_eq!(MemoryFile::new("r1", None, None).trouble(), None);
    }

    #[test]
    fn is_read_as_it_was_kept_and_a_foreign_file_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let config = folder.path().join("robot.toml");
        type Kept = std::collections::BTreeMap<String, u32>;
        let of = |id: &str| MemoryFile::new(id, Some(Path::new("robot.memory.json")), Some(&config));
        let kept = |number: u32| Kept::from([("lifts".to_owned(), number)]);
        let mut file = of("r1");
        assert_eq!(file.read::<Kept>().unwrap(), None);
        file.keep(&kept(2));
        file.keep(&kept(3));
        assert_eq!(file.read::<Kept>().unwrap(), Some(kept(3)));
        let error = format!("{:#}", of("r2").read::<Kept>().unwrap_err());
        assert!(error.contains("robot.memory.json: the memory of r1, not of r2"), "{error}");
        // As it was before memories said whose they are.
        std::fs::write(folder.path().join("robot.memory.json"), r#"{"lifts":4}"#).unwrap();
        assert_eq!(of("r2").read::<Kept>().unwrap(), Some(kept(4)));
        std::fs::write(folder.path().join("robot.memory.json"), "{").unwrap();
        let error = format!("{:#}", file.read::<Kept>().unwrap_err());
        assert!(error.contains("robot.memory.json: not a memory"), "{error}");
    }
}
