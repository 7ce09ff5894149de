//! The lab's answer, read from the JSON contract of `lab discover --format json`.

use std::collections::{BTreeMap, BTreeSet};

use energy::Channel;
use serde_json::Value;

/// What the lab says of a case.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Answer {
    /// `complete`, `missing`, `ambiguous`, `unknown`; anything else is no answer.
    pub verdict: String,
    /// Effects that it names, in order.
    pub selected: Vec<String>,
    /// Effects between which it cannot tell.
    pub equivalent: BTreeSet<String>,
    /// The experiment that it proposes.
    pub experiment: String,
    /// Held-out RMS by channel, on the last rung of the ladder.
    pub holdout_rms: BTreeMap<String, f64>,
    /// Estimates: effect, parameter, value, sigma.
    pub parameters: Vec<(String, String, f64, f64)>,
}

impl Answer {
    /// Reads an answer. What is not there is taken as not said.
    #[must_use]
    pub fn read(json: &Value) -> Self {
        let text = |value: &Value| value.as_str().map(str::to_owned);
        let texts = |name: &str| json[name].as_array().into_iter().flatten().filter_map(text).collect::<Vec<_>>();
        let verdict = text(&json["verdict"]).unwrap_or_default();
        let mut selected = texts("selected");
        // A verdict without a list names the best of the ranking.
        if selected.is_empty() && verdict == "missing" {
            selected.extend(text(&json["ranking"][0]["effect"]));
        }
        let last = json["ladder"].as_array().and_then(|ladder| ladder.last()).cloned().unwrap_or_default();
        let rms = last["holdout_rms"].as_object().into_iter().flatten();
        let holdout_rms = rms.filter_map(|(channel, rms)| Some((channel.clone(), rms.as_f64()?))).collect();
        let mut parameters = Vec::new();
        for (effect, own) in json["parameters"].as_object().into_iter().flatten() {
            for (name, estimate) in own.as_object().into_iter().flatten() {
                if let (Some(value), Some(sigma)) = (estimate["value"].as_f64(), estimate["sigma"].as_f64()) {
                    parameters.push((effect.clone(), name.clone(), value, sigma));
                }
            }
        }
        Self {
            equivalent: texts("equivalent").into_iter().collect(),
            experiment: text(&json["experiment"]).unwrap_or_default(),
            holdout_rms,
            verdict,
            selected,
            parameters,
        }
    }

    /// Held-out RMS of the channel that a system is judged by; without one, NaN.
    #[must_use]
    pub fn main_holdout(&self, system: energy::System) -> f64 {
        let channel: Channel = system.targets()[0];
        self.holdout_rms.get(channel.name()).copied().unwrap_or(f64::NAN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_last_rung_and_the_estimates_are_read() {
        let answer = Answer::read(&json!({
            "verdict": "missing", "selected": [], "ranking": [{ "effect": "rc1" }, { "effect": "rc2" }], "experiment": "rest",
            "ladder": [
                { "holdout_rms": { "voltage_v": 9e-3 } }, { "holdout_rms": { "voltage_v": 2e-3 } }
            ],
            "parameters": { "rc1": { "tau_s": { "value": 50.0, "sigma": 2.0 } } }
        }));
        assert_eq!(answer.selected, ["rc1"]);
        assert!((answer.main_holdout(energy::System::Battery) - 2e-3).abs() < 1e-12);
        assert_eq!(answer.parameters, [("rc1".to_owned(), "tau_s".to_owned(), 50.0, 2.0)]);
        assert_eq!(Answer::read(&Value::Null), Answer::default());
    }
}
