//! Parameter sets that come with the program, each named after its source.

/// Built-in models: name and text.
static MODELS: &[(&str, &str)] = &[
    ("enertech-lco-2280mah", include_str!("../params/enertech-lco-2280mah.toml")),
    ("explorer-3s1p-1320mah", include_str!("../params/explorer-3s1p-1320mah.toml")),
    ("mds-3s4p-7600mah", include_str!("../params/mds-3s4p-7600mah.toml")),
    ("explorer-robot", include_str!("../params/explorer-robot.toml")),
    ("mds-station", include_str!("../params/mds-station.toml")),
];

/// Tables that built-in models name.
static TABLES: &[(&str, &str)] = &[("enertech-lco-2280mah-ocv.csv", include_str!("../params/enertech-lco-2280mah-ocv.csv"))];

/// Names of all built-in models.
pub fn built_in_names() -> impl Iterator<Item = &'static str> {
    MODELS.iter().map(|(name, _)| *name)
}

/// The text of a built-in model or table.
#[must_use]
pub fn built_in(name: &str) -> Option<&'static str> {
    MODELS.iter().chain(TABLES).find(|(known, _)| *known == name).map(|(_, text)| *text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Model;

    #[test]
    fn every_built_in_model_is_valid_and_says_where_its_numbers_come_from() {
        for name in built_in_names() {
            let read = |table: &str| built_in(table).map(str::to_owned).ok_or_else(|| "not built in".to_owned());
            let model = Model::parse(name, built_in(name).unwrap(), &read).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(model.name, name);
            for parameter in model.parameters() {
                assert!(!parameter.source.starts_with("catalogue default"), "{name}: {parameter:?}");
            }
        }
    }
}
