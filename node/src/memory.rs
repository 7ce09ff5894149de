//! What an agent must not forget when it is restarted, in a file.

use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;
use serde::de::DeserializeOwned;
use tracing::error;

use crate::files;

/// A file that holds the newest memory of one agent; each write replaces it as a whole.
#[derive(Debug)]
pub struct MemoryFile {
    path: Option<PathBuf>,
    failed: bool,
}

impl MemoryFile {
    /// The file `path`, relative to `beside` (the configuration that names it); none: nothing is kept.
    #[must_use]
    pub fn new(path: Option<&Path>, beside: Option<&Path>) -> Self {
        let folder = beside.and_then(Path::parent);
        Self { path: path.map(|path| folder.map_or_else(|| path.to_owned(), |folder| folder.join(path))), failed: false }
    }

    /// What was kept; nothing where nothing is.
    ///
    /// # Errors
    /// When there is a file that cannot be read as a memory: who starts over from nothing might act
    /// twice, so a person has to say so.
    pub fn read<M: DeserializeOwned>(&self) -> anyhow::Result<Option<M>> {
        let Some(path) = self.path.as_deref().filter(|path| path.exists()) else { return Ok(None) };
        let text = files::read_text(path)?;
        let memory = serde_json::from_str(&text);
        memory.map(Some).with_context(|| format!("{}: not a memory of this agent; remove it to start without one", path.display()))
    }

    /// Keeps it: when this returns, it survives a kill and a power cut. A disk that cannot be written
    /// is told of once; the agent goes on, for a robot that stands still helps nobody.
    pub fn keep<M: Serialize>(&mut self, memory: &M) {
        let Some(path) = &self.path else { return };
        let text = serde_json::to_string(memory).expect("a memory is plain data");
        match files::write_text(path, &text) {
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
    fn is_read_as_it_was_kept_and_a_foreign_file_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let config = folder.path().join("robot.toml");
        let mut file = MemoryFile::new(Some(Path::new("robot.memory.json")), Some(&config));
        assert_eq!(file.read::<Vec<u32>>().unwrap(), None);
        file.keep(&vec![1, 2]);
        file.keep(&vec![3]);
        assert_eq!(file.read::<Vec<u32>>().unwrap(), Some(vec![3]));
        std::fs::write(folder.path().join("robot.memory.json"), "{").unwrap();
        let error = format!("{:#}", file.read::<Vec<u32>>().unwrap_err());
        assert!(error.contains("robot.memory.json: not a memory"), "{error}");
    }
}
