//! The one place at which the lab is called.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::Discovery;
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::infer::propose::propose;
use lab::measurement::Log;
use lab::prepare::{Prepared, prepare};
use serde_json::{Value, json};

use crate::case::Case;
use crate::foreign::AT_RANDOM;

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
    #[must_use]
    pub fn of(case: &Case) -> Self {
        let read = |logs: &[crate::CaseLog]| logs.iter().map(crate::CaseLog::log).collect();
        Self {
            model_toml: case.base_model_toml.clone(),
            model: Arc::new(case.base_model()),
            train: read(&case.train),
            holdout: read(&case.holdout),
        }
    }

    fn evidence(&self, logs: &[Log]) -> Result<Arc<Evidence>, String> {
        let prepared = logs.iter().map(|log| prepare(&self.model, log)).collect::<Result<Vec<Prepared>, _>>();
        Ok(Arc::new(Evidence::new(&self.model, prepared.map_err(|error| error.to_string())?)))
    }
}

/// Anything that answers questions: the lab, or a stand-in that tests the scorer.
pub type Ask<'a> = dyn Fn(&Question) -> Value + Sync + 'a;

/// Asks the lab: what `lab discover --format json` prints for these files.
#[must_use]
pub fn ask(question: &Question) -> Value {
    discover(question).unwrap_or_else(|error| json!({ "verdict": "error", "residual": error }))
}

fn discover(question: &Question) -> Result<Value, String> {
    let (train, holdout) = (question.evidence(&question.train)?, question.evidence(&question.holdout)?);
    let search = search(Arc::clone(&question.model), train, Some(&holdout));
    serde_json::to_value(Discovery::of(&search)).map_err(|error| error.to_string())
}

/// Held-out RMS over the sensor floor of the channel that a system is judged by, as `lab propose` tells it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Formula {
    /// With the base model, refitted.
    pub before: f64,
    /// With the formula that is proposed, or with what is told to come and go; the same where there is neither.
    pub after: f64,
    /// Whether what is hidden comes at random, so that no formula can say when.
    pub at_random: bool,
}

/// Asks the lab for a formula for what its catalogue does not explain; none where it cannot read the case.
#[must_use]
pub fn formula(case: &Case, question: &Question) -> Option<Formula> {
    let (train, holdout) = (question.evidence(&question.train).ok()?, question.evidence(&question.holdout).ok()?);
    let found = propose(Arc::clone(&question.model), &train, &holdout);
    let channel = question.model.system.targets()[0];
    // The sensor's own, whatever the lab adds to it.
    let floor = question.model.sensor(channel).floor();
    let over_floor = |rms: &[(Channel, f64)]| Some(rms.iter().find(|(of, _)| *of == channel)?.1 / floor);
    let after = match &found.switching {
        Some(switching) => switching.holdout.1 / floor,
        None => over_floor(&found.holdout)?,
    };
    let at_random = AT_RANDOM.iter().any(|name| case.name.ends_with(name));
    Some(Formula { before: over_floor(&found.base_holdout)?, after, at_random })
}
