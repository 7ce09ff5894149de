//! Files that a command reads: none of its answers is written over them.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use lab::model_source::Origin;
use lab::output::directory_of;

use super::ModelArg;
use super::facts::named_by_facts;

/// What the answer of a command is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::cmd) enum Answered {
    /// A model, which may take the place of the one that was read.
    Model,
    /// Anything else.
    Other,
}

/// What a coordinator's store lies in beside its own file, while the coordinator works.
const STORE_ENDINGS: [&str; 4] = ["", "-wal", "-shm", "-journal"];

impl ModelArg {
    /// Refuses to write over the tables that the model names, and over the model itself, unless
    /// by a model.
    pub(in crate::cmd) fn spare(&self, output: Option<&Path>, answered: Answered) -> anyhow::Result<()> {
        let Some(output) = output else { return Ok(()) };
        let source = self.load()?;
        if let Origin::File(path) = &source.origin {
            let over = answered == Answered::Other && same_file(path, output);
            ensure!(!over, "{} is the model that is read here; write to another file", output.display());
        }
        for table in &source.tables {
            let (at, model) = (output.display(), &source.model.name);
            ensure!(!same_file(table, output), "{at} is a table of the model {model}; write to another file");
        }
        Ok(())
    }
}

/// Refuses to write over this log, over a part of it, over the facts beside it, or over the file that these are of.
pub(in crate::cmd) fn spare(log: &Path, output: &Path) -> anyhow::Result<()> {
    if let Some(data) = named_by_facts(log) {
        ensure!(!same_file(&data, output), "{} is a log that is read here; write to another file", output.display());
    }
    let part = log.is_dir() && output.exists() && same_file(log, &directory_of(output));
    ensure!(!part && !same_file(log, output), "{} is a log that is read here; write to another file", output.display());
    let facts = log.with_extension("toml");
    ensure!(!same_file(&facts, output), "{} holds the facts of the log {}; write to another file", output.display(), log.display());
    Ok(())
}

/// Refuses to write over this store of a coordinator.
pub(super) fn spare_store(store: &Path, output: &Path) -> anyhow::Result<()> {
    for ending in STORE_ENDINGS {
        let mut file = store.as_os_str().to_owned();
        file.push(ending);
        ensure!(!same_file(&PathBuf::from(file), output), "{} is the store that is read here; write to another file", output.display());
    }
    Ok(())
}

/// Whether two paths name one file, be it there or not.
pub(in crate::cmd) fn same_file(one: &Path, other: &Path) -> bool {
    let whole = |path: &Path| path.canonicalize().ok().or_else(|| Some(directory_of(path).canonicalize().ok()?.join(path.file_name()?)));
    one == other || matches!((whole(one), whole(other)), (Some(one), Some(other)) if one == other)
}
