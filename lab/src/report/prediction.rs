//! Predictions as a log that any reader of logs can read again.

use std::fmt;

use energy::Model;
use serde::Serialize;

use crate::predict::Prediction;
use crate::prepare::Prepared;

/// A prediction, for CSV and JSON: time, the inputs it rests on, then what is predicted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Predicted {
    /// Version of this structure.
    pub schema: u32,
    /// Name of the model.
    pub model: String,
    /// Name of the log.
    pub log: String,
    /// Names of the predicted columns.
    pub predicted: Vec<&'static str>,
    /// Columns by name, in the order of the CSV; null where nothing is predicted.
    pub columns: Vec<NamedColumn>,
}

/// One column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NamedColumn {
    /// Canonical name, with unit.
    pub name: &'static str,
    /// One value per row of the log.
    pub values: Vec<f64>,
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PredictionSummary {
    /// Version of this structure.
    pub schema: u32,
    /// Name of the model.
    pub model: String,
    /// Name of the log.
    pub log: String,
    /// Names of the predicted columns.
    pub predicted: Vec<&'static str>,
    /// Rows written.
    pub rows: usize,
    /// The file.
    pub output: String,
}

impl Predicted {
    /// Puts the columns together.
    #[must_use]
    pub fn of(model: &Model, prepared: &Prepared, prediction: &Prediction) -> Predicted {
        let column = |name, values: &[f64]| NamedColumn { name, values: values.to_vec() };
        let mut columns = vec![column("time_s", &prepared.time_s)];
        columns.extend(prepared.inputs.iter().map(|(channel, values)| column(channel.name(), values)));
        let inputs = columns.len();
        if !prediction.soc.is_empty() {
            columns.push(column("soc", &prediction.soc));
        }
        columns.extend(prediction.channels.iter().map(|(channel, values)| column(channel.name(), values)));
        let predicted = columns[inputs..].iter().map(|column| column.name).collect();
        Predicted { schema: 1, model: model.name.clone(), log: prepared.name.clone(), predicted, columns }
    }

    /// What will have been written to `output`.
    #[must_use]
    pub fn summary(&self, output: String) -> PredictionSummary {
        PredictionSummary {
            schema: self.schema,
            model: self.model.clone(),
            log: self.log.clone(),
            predicted: self.predicted.clone(),
            rows: self.columns[0].values.len(),
            output,
        }
    }
}

impl fmt::Display for PredictionSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} on {}: {} rows of {} written to {}", self.model, self.log, self.rows, self.predicted.join(", "), self.output)
    }
}

/// The CSV text: a log again, with empty cells where nothing is predicted.
#[must_use]
pub fn csv_text(predicted: &Predicted) -> String {
    let names: Vec<&str> = predicted.columns.iter().map(|column| column.name).collect();
    let mut text = names.join(",") + "\n";
    for row in 0..predicted.columns[0].values.len() {
        let cell = |column: &NamedColumn| if column.values[row].is_nan() { String::new() } else { column.values[row].to_string() };
        text += &predicted.columns.iter().map(cell).collect::<Vec<_>>().join(",");
        text.push('\n');
    }
    text
}
