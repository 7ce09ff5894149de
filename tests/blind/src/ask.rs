//! The one place at which the lab is called.

use std::sync::Arc;

use energy::Model;
use lab::measurement::Log;
use lab::prepare::{Prepared, predicted_channels, prepare};
use serde_json::{Value, json};

use crate::case::Case;

/// All that the lab gets to see of a case, read as its command reads it.
#[derive(Debug)]
pub struct Question {
    /// Text of the base model's file.
    pub model_toml: String,
    /// The base model.
    pub model: Arc<Model>,
    /// Logs to learn from.
    pub train: Vec<Log>,
    /// Logs to judge by.
    pub holdout: Vec<Log>,
}

impl Question {
    /// What the lab sees of that case.
    ///
    /// # Panics
    /// When the base model is no valid file: a mistake of this benchmark.
    #[must_use]
    pub fn of(case: &Case) -> Self {
        let refuse = |_: &str| Err("a base model names no files".to_owned());
        let model = Model::parse("base.toml", &case.base_model_toml, &refuse).unwrap_or_else(|error| panic!("{error}"));
        let read = |logs: &[crate::CaseLog]| logs.iter().map(crate::CaseLog::log).collect();
        Self { model_toml: case.base_model_toml.clone(), model: Arc::new(model), train: read(&case.train), holdout: read(&case.holdout) }
    }
}

/// Anything that answers questions: the lab, or a stand-in that tests the scorer.
pub type Ask<'a> = dyn Fn(&Question) -> Value + Sync + 'a;

/// Asks the lab.
///
/// Until `lab::discover` is there, a plain fit of the base stands in for it: it never finds
/// anything, and its ladder has one rung.
#[must_use]
pub fn ask(question: &Question) -> Value {
    fit_only(question).unwrap_or_else(|error| json!({ "verdict": "error", "residual": error }))
}

fn fit_only(question: &Question) -> Result<Value, String> {
    let prepared = |logs: &[Log]| logs.iter().map(|log| prepare(&question.model, log)).collect::<Result<Vec<Prepared>, _>>();
    let train = prepared(&question.train).map_err(|error| error.to_string())?;
    let holdout = prepared(&question.holdout).map_err(|error| error.to_string())?;
    let free: Vec<usize> = (0..question.model.parameters().len()).filter(|&index| question.model.parameters()[index].free).collect();
    let values = if free.is_empty() {
        question.model.values()
    } else {
        lab::fit::fit(&question.model, &train, &free, &mut |_| {}).map_err(|error| error.to_string())?.values
    };
    let rung = |logs: &[Prepared]| {
        let mut sums = serde_json::Map::new();
        for &channel in &predicted_channels(&question.model) {
            let mut squares = (0.0, 0.0);
            for log in logs {
                let prediction = lab::predict::predict(&question.model, log, &values);
                for target in log.targets.iter().filter(|target| target.channel == channel) {
                    let rows = prediction.of(channel).unwrap_or_default().iter().zip(&target.observed).zip(&target.used);
                    for ((predicted, observed), _) in rows.filter(|(_, used)| **used) {
                        squares = (squares.0 + (observed - predicted).powi(2), squares.1 + 1.0);
                    }
                }
            }
            sums.insert(channel.name().to_owned(), json!((squares.0 / f64::max(squares.1, 1.0)).sqrt()));
        }
        sums
    };
    let floors = predicted_channels(&question.model);
    let floor: serde_json::Map<_, _> =
        floors.iter().map(|&channel| (channel.name().to_owned(), json!(question.model.sensor(channel).floor()))).collect();
    let ladder = json!([{ "effect": null, "train_rms": rung(&train), "holdout_rms": rung(&holdout), "floor": floor }]);
    Ok(json!({ "verdict": "complete", "selected": [], "equivalent": [], "ladder": ladder, "parameters": {}, "experiment": "" }))
}
