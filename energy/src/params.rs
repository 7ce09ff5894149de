//! Parameter sets that come with the program, each named after its source.

use std::path::Path;

use crate::document::hint;
use crate::{DocumentError, Model};

/// Built-in models: name and text.
static MODELS: &[(&str, &str)] = &[
    ("enertech-lco-2280mah", include_str!("../params/enertech-lco-2280mah.toml")),
    ("explorer-3s1p-1320mah", include_str!("../params/explorer-3s1p-1320mah.toml")),
    ("mds-3s4p-7600mah", include_str!("../params/mds-3s4p-7600mah.toml")),
    ("aquapod-2s1p-1900mah", include_str!("../params/aquapod-2s1p-1900mah.toml")),
    ("roomba-4s2p-2640mah", include_str!("../params/roomba-4s2p-2640mah.toml")),
    ("enertech-lco-2280mah-full", include_str!("../params/enertech-lco-2280mah-full.toml")),
    ("a123-lfp-26650-2p3ah", include_str!("../params/a123-lfp-26650-2p3ah.toml")),
    ("samsung-inr18650-30q-3ah", include_str!("../params/samsung-inr18650-30q-3ah.toml")),
    ("melasta-lipo-3p7ah", include_str!("../params/melasta-lipo-3p7ah.toml")),
    ("nissan-leaf-33ah", include_str!("../params/nissan-leaf-33ah.toml")),
    ("explorer-robot", include_str!("../params/explorer-robot.toml")),
    ("roomba-robot", include_str!("../params/roomba-robot.toml")),
    ("mds-vehicle", include_str!("../params/mds-vehicle.toml")),
    ("aquapod-robot", include_str!("../params/aquapod-robot.toml")),
    ("mds-station", include_str!("../params/mds-station.toml")),
    ("mds-station-path-selection", include_str!("../params/mds-station-path-selection.toml")),
];

/// Tables that built-in models name.
static TABLES: &[(&str, &str)] = &[
    ("enertech-lco-2280mah-ocv.csv", include_str!("../params/enertech-lco-2280mah-ocv.csv")),
    ("enertech-lco-2280mah-full-ocv.csv", include_str!("../params/enertech-lco-2280mah-full-ocv.csv")),
    ("a123-lfp-26650-2p3ah-ocv.csv", include_str!("../params/a123-lfp-26650-2p3ah-ocv.csv")),
    ("samsung-inr18650-30q-3ah-ocv.csv", include_str!("../params/samsung-inr18650-30q-3ah-ocv.csv")),
    ("melasta-lipo-3p7ah-ocv.csv", include_str!("../params/melasta-lipo-3p7ah-ocv.csv")),
    ("nissan-leaf-33ah-ocv.csv", include_str!("../params/nissan-leaf-33ah-ocv.csv")),
];

/// Names of all built-in models.
pub fn built_in_names() -> impl Iterator<Item = &'static str> {
    MODELS.iter().map(|(name, _)| *name)
}

/// The text of a built-in model or table.
#[must_use]
pub fn built_in(name: &str) -> Option<&'static str> {
    MODELS.iter().chain(TABLES).find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// A model with the text that it was read from.
#[derive(Debug)]
pub struct FoundModel {
    /// The model.
    pub model: Model,
    /// Its TOML text, as written.
    pub text: String,
    /// Whether it comes with the program; otherwise its name is the path of a file.
    pub built_in: bool,
}

/// Loads a model by built-in name or by path. `read` fetches the text of a file; a table that
/// the model names lies beside it.
///
/// # Errors
/// Everything that [`Model::parse`] refuses, and a name that is neither built in nor a file.
pub fn load_model(name: &str, read: &dyn Fn(&Path) -> Result<String, String>) -> Result<Model, DocumentError> {
    find_model(name, read).map(|found| found.model)
}

/// Like [`load_model`], and keeps the text for those who change it.
///
/// # Errors
/// As [`load_model`].
pub fn find_model(name: &str, read: &dyn Fn(&Path) -> Result<String, String>) -> Result<FoundModel, DocumentError> {
    if built_in_names().any(|known| known == name) {
        let text = built_in(name).unwrap_or_default().to_owned();
        let model = Model::parse(name, &text, &|table| built_in(table).map(str::to_owned).ok_or_else(|| "not built in".to_owned()))?;
        return Ok(FoundModel { model, text, built_in: true });
    }
    let path = Path::new(name);
    let text = read(path).map_err(|error| {
        let hint = hint(name, built_in_names());
        let known = built_in_names().collect::<Vec<_>>().join(", ");
        DocumentError { file: name.to_owned(), place: None, message: format!("{error}{hint} Built-in models: {known}") }
    })?;
    let model = parse_beside(path, &text, read)?;
    Ok(FoundModel { model, text, built_in: false })
}

/// Reads a model text as if it stood in the file at `path`: a table that it names lies beside
/// that file, or else comes with the program.
///
/// # Errors
/// As [`Model::parse`].
pub fn parse_beside(path: &Path, text: &str, read: &dyn Fn(&Path) -> Result<String, String>) -> Result<Model, DocumentError> {
    let table = |table: &str| read(&path.with_file_name(table)).or_else(|error| built_in(table).map(str::to_owned).ok_or(error));
    Model::parse(&path.display().to_string(), text, &table)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::forecast::remaining_wh;
    use crate::{Estimate, System, find};

    #[test]
    fn every_built_in_model_is_valid_and_says_where_its_numbers_come_from() {
        for name in built_in_names() {
            let model = load_model(name, &|_| unreachable!("built in")).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(model.name, name);
            for parameter in model.parameters() {
                // A number at which nothing is done by it makes no claim: an amplitude that is the same at every charge.
                let (_, effect) = find(model.system, parameter.effect).unwrap();
                let spec = effect.spec().parameters.iter().find(|spec| spec.name == parameter.name).unwrap();
                let claims = spec.null != Some(parameter.value);
                assert!(!claims || !parameter.source.starts_with("catalogue default"), "{name}: {parameter:?}");
            }
        }
    }

    fn batteries() -> impl Iterator<Item = Arc<Model>> {
        let all = built_in_names().map(|name| load_model(name, &|_| unreachable!("built in")).unwrap());
        all.filter(|model| model.system == System::Battery).map(Arc::new)
    }

    /// The mean OCV of a full discharge lies near the nominal voltage, which makers state under a
    /// light load: Samsung INR18650-30Q 3.60 V, A123 ANR26650 3.3 V, AESC's Leaf cell 3.75 V,
    /// Enertech and other LiCoO2 pouches 3.7 V, LiPo of 4.35 V 3.8 V.
    #[test]
    fn the_mean_voltage_of_every_cell_is_what_its_maker_states() {
        for model in batteries() {
            let facts = model.battery();
            let mean_v = facts.stored_wh() / facts.capacity_ah / f64::from(facts.series);
            let nominal_v = match model.name.split('-').next() {
                Some("samsung") => 3.6,
                Some("a123") => 3.3,
                Some("nissan") => 3.75,
                Some("melasta") => 3.8,
                _ => 3.7,
            };
            assert!((mean_v / nominal_v - 1.0).abs() < 0.04, "{}: {mean_v} V, stated {nominal_v} V", model.name);
        }
    }

    /// At a two-hour rate a good cell gives all but a few per cent, and a sigma says how well that is known.
    #[test]
    fn every_battery_can_be_asked_how_long_it_lasts() {
        for model in batteries() {
            let stored_wh = model.battery().stored_wh();
            let left = remaining_wh(&model, Estimate::new(0.9, 0.005), 25.0, stored_wh / 2.0);
            assert!((0.75..0.9).contains(&(left.value / stored_wh)), "{}: {left:?} of {stored_wh} Wh", model.name);
            assert!((0.002..0.05).contains(&(left.sigma / stored_wh)), "{}: {left:?} of {stored_wh} Wh", model.name);
        }
    }
}
