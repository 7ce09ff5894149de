//! Models by built-in name or by path. Reads the disk.

use std::cell::RefCell;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::bail;
use energy::document::hint;
use energy::{DocumentError, FoundModel, Model};

use crate::model_edit;

/// Where a model's text came from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// It comes with the program.
    BuiltIn(String),
    /// A file.
    File(PathBuf),
}

/// A model with the text it was read from.
#[derive(Debug)]
pub struct ModelSource {
    /// The model.
    pub model: Arc<Model>,
    /// Its TOML text, as written.
    pub text: String,
    /// Where the text came from.
    pub origin: Origin,
    /// Files that it names, and that were read for it.
    pub tables: Vec<PathBuf>,
}

/// Loads a model: a built-in name, or else the path of a TOML file. Tables that the file names
/// are looked for beside it.
///
/// # Errors
/// Says what is wrong with place and near match.
pub fn load_model(name_or_path: &str) -> Result<ModelSource, DocumentError> {
    let tables = RefCell::new(Vec::new());
    let reading = |path: &Path| {
        let text = read(path)?;
        tables.borrow_mut().push(path.to_path_buf());
        Ok(text)
    };
    let FoundModel { model, text, built_in } = energy::find_model(name_or_path, &reading)?;
    let origin = if built_in { Origin::BuiltIn(name_or_path.to_owned()) } else { Origin::File(PathBuf::from(name_or_path)) };
    let mut tables = tables.into_inner();
    tables.retain(|table| table != Path::new(name_or_path));
    Ok(ModelSource { model: Arc::new(model), text, origin, tables })
}

impl ModelSource {
    /// The same without some of its effects, as if its text had never had them; `"*"` is all of them.
    ///
    /// # Errors
    /// Names an effect that it does not have, with those that it has.
    pub fn without(self, effects: &[String]) -> anyhow::Result<ModelSource> {
        let ids: Vec<&str> = self.model.effects().map(|effect| effect.spec().id).collect();
        if let Some(unknown) = effects.iter().find(|name| *name != "*" && !ids.contains(&name.as_str())) {
            let hint = hint(unknown, ids.iter().copied());
            bail!("{} has no effect `{unknown}` to leave out{hint} It has: {}", self.model.name, ids.join(", "));
        }
        let is_left_out = |id: &str| effects.iter().any(|name| name == "*" || name == id);
        let text = model_edit::remove(&self.text, is_left_out)?;
        Ok(ModelSource { model: Arc::new(self.model.without(is_left_out)), text, ..self })
    }
}

/// Reads a model text as if it stood in the file at `path`: tables are relative to it.
///
/// # Errors
/// Says what is wrong in the text, and where.
pub fn parse_beside(path: &Path, text: &str) -> Result<Model, DocumentError> {
    energy::parse_beside(path, text, &read)
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => "neither a file nor built in".to_owned(),
        _ => format!("cannot be read: {error}"),
    })
}

#[cfg(test)]
mod tests {
    use energy::{built_in, built_in_names};

    use super::*;

    #[test]
    fn every_built_in_model_loads_and_a_misspelt_one_is_told_apart() {
        for name in built_in_names() {
            assert_eq!(load_model(name).unwrap().model.name, name);
        }
        let error = load_model("enertech-lco-2280").unwrap_err().to_string();
        assert!(error.contains("did you mean `enertech-lco-2280mah`?"), "{error}");
    }

    #[test]
    fn a_table_is_looked_for_beside_the_model_file() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("cell.toml");
        let table = "enertech-lco-2280mah-ocv.csv";
        let model = built_in("enertech-lco-2280mah").unwrap().replace(table, "own.csv");
        fs::write(&path, model).unwrap();
        let error = load_model(&path.display().to_string()).unwrap_err().to_string();
        assert!(error.contains("ocv_csv"), "{error}");
        fs::write(directory.path().join("own.csv"), built_in(table).unwrap()).unwrap();
        assert_eq!(load_model(&path.display().to_string()).unwrap().tables, [directory.path().join("own.csv")]);
    }
}
