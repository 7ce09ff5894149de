//! Texts and models from disk.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use energy::{DocumentError, Model, System};
use proto::NamedModel;
use serde::{Deserialize, Serialize};

/// Longest configuration, scenario or model that is read, bytes.
const TEXT_BYTES_MAX: u64 = 16 * 1024 * 1024;

/// Reads a text file; the error names it.
///
/// # Errors
/// When it is missing, not a file, too long, or not UTF-8.
pub fn read_text(path: &Path) -> anyhow::Result<String> {
    let length = std::fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?.len();
    anyhow::ensure!(length <= TEXT_BYTES_MAX, "{}: {length} bytes; at most {TEXT_BYTES_MAX} are read", path.display());
    std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

/// Whether a file with a secret can be read by its owner alone.
///
/// # Errors
/// When others can read it, with what to do.
pub fn only_its_owners(path: &Path) -> anyhow::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    let mode = std::fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?.permissions().mode() & 0o777;
    anyhow::ensure!(mode & 0o077 == 0, "{} can be read by others (mode {mode:03o}): chmod 600 {}", path.display(), path.display());
    Ok(())
}

/// Loads a model by built-in name, or by path relative to `beside` (the file that names it).
///
/// # Errors
/// Says what is wrong with the model and where.
pub fn model(name: &str, beside: Option<&Path>) -> Result<Arc<Model>, DocumentError> {
    energy::load_model(&found_at(name, beside), &|path| read_text(path).map_err(|error| format!("{error:#}"))).map(Arc::new)
}

/// A built-in name, or the path of what a file beside it names.
fn found_at(name: &str, beside: Option<&Path>) -> String {
    match beside.and_then(Path::parent) {
        Some(folder) if energy::built_in(name).is_none() => folder.join(name).to_string_lossy().into_owned(),
        _ => name.to_owned(),
    }
}

/// Whether a model that `key` names in a configuration is one of this system.
///
/// # Errors
/// Says of what it is.
pub fn is_of(model: &Model, system: System, key: &str) -> anyhow::Result<()> {
    let (name, its, wanted) = (&model.name, model.system.name(), system.name());
    anyhow::ensure!(model.system == system, "{key}: `{name}` is the model of a {its}, not of a {wanted}");
    Ok(())
}

/// A model named in a configuration: a name or path, or the same with effects left out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected the name or file of a model, or { model = NAME, without = [EFFECT, ...] }")]
pub enum ModelRef {
    /// A built-in name or a path beside the configuration.
    Name(String),
    /// The same, without some of its effects.
    Reduced(ReducedModel),
}

/// A model without some of its effects.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReducedModel {
    /// A built-in name or a path beside the configuration.
    pub model: String,
    /// Effects to leave out: `"hotel"`, or `"*"` for all.
    pub without: Vec<String>,
}

impl ModelRef {
    /// The name or path.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            ModelRef::Name(name) => name,
            ModelRef::Reduced(reduced) => &reduced.model,
        }
    }

    /// The same for people: a path beside `beside` is one from where this program runs.
    #[must_use]
    pub fn named(&self, beside: Option<&Path>) -> NamedModel {
        let without = match self {
            ModelRef::Name(_) => Vec::new(),
            ModelRef::Reduced(reduced) => reduced.without.clone(),
        };
        let model = found_at(self.name(), beside);
        let here = std::env::current_dir().ok();
        let from_here = here.and_then(|here| Path::new(&model).strip_prefix(here).ok().map(|path| path.to_string_lossy().into_owned()));
        NamedModel { model: from_here.unwrap_or(model), without }
    }

    /// Loads the model; paths are relative to `beside`.
    ///
    /// # Errors
    /// Says what is wrong with the model, or which effect to leave out it does not have.
    pub fn load(&self, beside: Option<&Path>) -> Result<Arc<Model>, DocumentError> {
        let whole = model(self.name(), beside)?;
        let ModelRef::Reduced(ReducedModel { without, .. }) = self else { return Ok(whole) };
        let ids: Vec<&str> = whole.effects().map(|effect| effect.spec().id).collect();
        if let Some(unknown) = without.iter().find(|name| *name != "*" && !ids.contains(&name.as_str())) {
            let message = format!("without: the model has no effect `{unknown}`; it has {}", ids.join(", "));
            return Err(DocumentError { file: self.name().to_owned(), place: None, message });
        }
        Ok(Arc::new(whole.without(|id| without.iter().any(|name| name == "*" || name == id))))
    }

    /// The same, of a model of this system; `key` is what names it in the configuration.
    ///
    /// # Errors
    /// When it cannot be loaded, or is the model of something else.
    pub fn load_as(&self, system: System, key: &str, beside: Option<&Path>) -> anyhow::Result<Arc<Model>> {
        let model = self.load(beside).with_context(|| key.to_owned())?;
        is_of(&model, system, key)?;
        Ok(model)
    }

    /// The same, of a battery that a gauge is to follow.
    ///
    /// # Errors
    /// Those of [`ModelRef::load_as`], and when the model has cells that differ: a gauge takes all cells of a pack as alike, and would tell
    /// of the mean one what the weakest cannot give.
    pub fn load_for_gauge(&self, key: &str, beside: Option<&Path>) -> anyhow::Result<Arc<Model>> {
        let model = self.load_as(System::Battery, key, beside)?;
        let words = "a gauge takes all cells as alike, and this model has [[battery.cell]]: say what is known of a weak cell as its effect `weak_cell`";
        anyhow::ensure!(model.battery().all_alike(), "{key}: {}: {words}", self.name());
        Ok(model)
    }
}

/// The file beside `path` that is written before it takes its place.
fn draft_of(path: &Path) -> std::io::Result<PathBuf> {
    let name = path.file_name().ok_or_else(|| std::io::Error::other("not a file name"))?;
    Ok(path.with_file_name(format!(".{}.{}", name.to_string_lossy(), std::process::id())))
}

/// Sees whether [`write_text`] could write there, and leaves nothing behind.
///
/// # Errors
/// Why it could not.
pub fn try_write(path: &Path) -> anyhow::Result<()> {
    let try_draft = || draft_of(path).and_then(|draft| std::fs::write(&draft, "").and_then(|()| std::fs::remove_file(&draft)));
    try_draft().with_context(|| format!("cannot write {}", path.display()))
}

/// Writes a text so that a reader sees the old file or the new one, never half of it.
///
/// # Errors
/// When the folder cannot be written to; the old file is then as it was.
pub fn write_text(path: &Path, text: &str) -> anyhow::Result<()> {
    let write = || -> std::io::Result<()> {
        // A device or a folder is not replaced by a file.
        if std::fs::metadata(path).is_ok_and(|known| !known.is_file()) {
            return Err(std::io::Error::other("it is there already, and is not a file"));
        }
        let draft = draft_of(path)?;
        let written = std::fs::write(&draft, text)
            .and_then(|()| std::fs::File::open(&draft)?.sync_all())
            .and_then(|()| std::fs::rename(&draft, path));
        if written.is_err() {
            let _ = std::fs::remove_file(&draft);
        }
        written?;
        // The new name must survive a power cut too; where a folder cannot be synced it is moot.
        if let Ok(folder) = std::fs::File::open(path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))) {
            let _ = folder.sync_all();
        }
        Ok(())
    };
    write().with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gauge_is_given_no_pack_of_unlike_cells() {
        let folder = tempfile::tempdir().unwrap();
        let known = energy::built_in("explorer-3s1p-1320mah").unwrap();
        let (head, effects) = known.split_once("[[effect]]").unwrap();
        let unlike = format!("{head}[[battery.cell]]\nseries = 2\ncapacity_factor = 0.8\n\n[[effect]]{effects}");
        std::fs::write(folder.path().join("weak.toml"), unlike).unwrap();
        let config = folder.path().join("robot.toml");
        let weak = ModelRef::Name("weak.toml".to_owned());
        assert!(weak.load_as(System::Battery, "battery", Some(&config)).is_ok(), "a body may have such a pack");
        let refused = weak.load_for_gauge("battery", Some(&config)).unwrap_err().to_string();
        assert!(refused.starts_with("battery: weak.toml: ") && refused.ends_with("as its effect `weak_cell`"), "{refused}");
        assert!(ModelRef::Name("explorer-3s1p-1320mah".to_owned()).load_for_gauge("battery", None).is_ok());
    }
}
