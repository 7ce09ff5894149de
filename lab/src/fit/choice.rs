//! Which parameters a fit may change.

use energy::Model;
use energy::document::hint;

/// Why it is not clear what may change.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChoiceError {
    /// The model has no such parameter.
    #[error("{flag} {name}: the model has no such parameter{hint} It has: {known}")]
    Unknown {
        /// `--free` or `--fix`.
        flag: &'static str,
        /// What was asked for.
        name: String,
        /// The nearest, or a full stop.
        hint: String,
        /// All parameters of the model.
        known: String,
    },
    /// There is nothing to fit.
    #[error("no parameter of {model} is free: mark some with free = true in the model, or say --free EFFECT.PARAMETER. It has: {known}")]
    NothingFree {
        /// The model.
        model: String,
        /// All parameters of the model.
        known: String,
    },
    /// What was to be fitted is held.
    #[error("--fix {fixed} leaves no parameter of {model} free: fix fewer, or free others by --free EFFECT.PARAMETER. It has: {known}")]
    AllFixed {
        /// The model.
        model: String,
        /// What was asked to stay.
        fixed: String,
        /// All parameters of the model.
        known: String,
    },
    /// There is nothing that could be fitted.
    #[error("{model} has no effects, so it has no parameters to fit")]
    NoParameters {
        /// The model.
        model: String,
    },
}

/// Indices of the parameters that may change: those that the model marks free and those of
/// `free`, without those of `fix`. An entry is `EFFECT.PARAMETER`, or `EFFECT` for all of its
/// parameters.
///
/// # Errors
/// When an entry names nothing, or when nothing is left.
pub fn free_parameters(model: &Model, free: &[String], fix: &[String]) -> Result<Vec<usize>, ChoiceError> {
    let names: Vec<String> = model.parameters().iter().map(|p| format!("{}.{}", p.effect, p.name)).collect();
    if names.is_empty() {
        return Err(ChoiceError::NoParameters { model: model.name.clone() });
    }
    let mut chosen: Vec<bool> = model.parameters().iter().map(|parameter| parameter.free).collect();
    let mut any = chosen.contains(&true);
    for (flag, entries, value) in [("--free", free, true), ("--fix", fix, false)] {
        for entry in entries {
            let effect = |index: usize| model.parameters()[index].effect;
            let meant: Vec<usize> = (0..names.len()).filter(|&index| names[index] == *entry || effect(index) == entry).collect();
            if meant.is_empty() {
                let hint = hint(entry, names.iter().map(String::as_str));
                let hint = if hint.is_empty() { ".".to_owned() } else { hint };
                return Err(ChoiceError::Unknown { flag, name: entry.clone(), hint, known: names.join(", ") });
            }
            meant.into_iter().for_each(|index| chosen[index] = value);
            any |= value;
        }
    }
    let chosen: Vec<usize> = (0..names.len()).filter(|&index| chosen[index]).collect();
    if chosen.is_empty() && any {
        return Err(ChoiceError::AllFixed { model: model.name.clone(), fixed: fix.join(" --fix "), known: names.join(", ") });
    }
    if chosen.is_empty() {
        return Err(ChoiceError::NothingFree { model: model.name.clone(), known: names.join(", ") });
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_model;

    fn list(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn flags_add_to_and_take_from_what_the_model_says() {
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        assert_eq!(free_parameters(&model, &[], &[]), Ok(vec![0]));
        let error = free_parameters(&model, &[], &list(&["ohmic.resistance_ohm"])).unwrap_err();
        assert!(error.to_string().starts_with("--fix ohmic.resistance_ohm leaves no parameter"), "{error}");
        let robot = load_model("explorer-robot").unwrap().model;
        let at = |name: &str| robot.parameters().iter().position(|p| p.effect == "motion" && p.name == name).unwrap();
        let expected = vec![at("rolling_coefficient"), at("drive_efficiency")];
        assert_eq!(free_parameters(&robot, &list(&["motion"]), &list(&["motion.mass_kg"])), Ok(expected));
    }

    #[test]
    fn an_unknown_parameter_is_answered_with_the_nearest() {
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        let error = free_parameters(&model, &list(&["ohmic.resistence_ohm"]), &[]).unwrap_err().to_string();
        assert!(error.contains("--free ohmic.resistence_ohm") && error.contains("did you mean `ohmic.resistance_ohm`?"), "{error}");
    }
}
