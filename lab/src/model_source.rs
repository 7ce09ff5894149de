//! Models by built-in name or by path. Reads the disk.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use energy::document::{DocumentError, hint};
use energy::{Model, built_in, built_in_names};

use crate::output::directory_of;

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
}

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
pub enum ModelSourceError {
    /// Neither a built-in name nor a file.
    #[error("no model `{name}`: neither a file nor built in{hint} Built in: {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The nearest built-in name, or nothing.
        hint: String,
        /// Every built-in name.
        known: String,
    },
    /// The file cannot be read.
    #[error("cannot read {}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system reported.
        source: std::io::Error,
    },
    /// The text is not a model.
    #[error(transparent)]
    Invalid(#[from] DocumentError),
}

/// Loads a model: a built-in name, or else the path of a TOML file. Tables that the file names
/// are looked for relative to it.
///
/// # Errors
/// Says what is wrong with place and near match.
pub fn load_model(name_or_path: &str) -> Result<ModelSource, ModelSourceError> {
    if built_in_names().any(|name| name == name_or_path) {
        let text = built_in(name_or_path).unwrap_or_default().to_owned();
        let model = Model::parse(name_or_path, &text, &read_built_in)?;
        return Ok(ModelSource { model: Arc::new(model), text, origin: Origin::BuiltIn(name_or_path.to_owned()) });
    }
    let path = Path::new(name_or_path);
    if !path.exists() {
        let hint = hint(name_or_path, built_in_names());
        let known = built_in_names().collect::<Vec<_>>().join(", ");
        let hint = if hint.is_empty() { ".".to_owned() } else { hint };
        return Err(ModelSourceError::Unknown { name: name_or_path.to_owned(), hint, known });
    }
    let text = fs::read_to_string(path).map_err(|source| ModelSourceError::Read { path: path.to_path_buf(), source })?;
    let model = parse_beside(path, &text)?;
    Ok(ModelSource { model: Arc::new(model), text, origin: Origin::File(path.to_path_buf()) })
}

/// Reads a model text as if it stood in the file at `path`: tables are relative to it.
///
/// # Errors
/// Says what is wrong in the text, and where.
pub fn parse_beside(path: &Path, text: &str) -> Result<Model, DocumentError> {
    let directory = directory_of(path);
    let read = |table: &str| fs::read_to_string(directory.join(table)).map_err(|error| error.to_string());
    Model::parse(&path.display().to_string(), text, &read)
}

fn read_built_in(table: &str) -> Result<String, String> {
    built_in(table).map(str::to_owned).ok_or_else(|| "not built in".to_owned())
}

#[cfg(test)]
mod tests {
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
        fs::write(&path, built_in("enertech-lco-2280mah").unwrap()).unwrap();
        let error = load_model(&path.display().to_string()).unwrap_err().to_string();
        assert!(error.contains("ocv_csv"), "{error}");
        let table = "enertech-lco-2280mah-ocv.csv";
        fs::write(directory.path().join(table), built_in(table).unwrap()).unwrap();
        assert!(load_model(&path.display().to_string()).is_ok());
    }
}
