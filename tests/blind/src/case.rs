//! One case: what the lab gets to see, and the truth that only the scorer sees.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use energy::{Channel, Model, System};
use lab::measurement::{GapCurrent, History, Log, LogFacts, Role, read_log};

/// What a case is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// One effect of the catalogue is hidden.
    Single,
    /// Two effects of the catalogue are hidden.
    Pair,
    /// Nothing is hidden: the base model is the truth.
    Null,
    /// The hidden physics is in the catalogue, its form is not.
    OtherForm,
    /// The hidden thing is no effect of the catalogue.
    Outside,
    /// These logs cannot tell two effects from each other, by construction.
    Collinear,
    /// The truth is an electrochemical cell.
    Electrochemical,
}

impl Kind {
    /// Every kind.
    pub const ALL: &'static [Kind] =
        &[Kind::Single, Kind::Pair, Kind::Null, Kind::OtherForm, Kind::Outside, Kind::Collinear, Kind::Electrochemical];

    /// Name in tables and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Kind::Single => "single",
            Kind::Pair => "pair",
            Kind::Null => "null",
            Kind::OtherForm => "other_form",
            Kind::Outside => "outside",
            Kind::Collinear => "collinear",
            Kind::Electrochemical => "electrochemical",
        }
    }
}

/// A log as the lab gets it: measured columns and what is known beside them.
#[derive(Debug, Clone)]
pub struct CaseLog {
    /// Name, without an ending.
    pub name: String,
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Measured channels, in the order of the file's columns.
    pub columns: Vec<(Channel, Vec<f64>)>,
    /// Start, history, role.
    pub facts: LogFacts,
}

impl CaseLog {
    /// The log in the canonical form of a CSV file.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = "time_s".to_owned();
        for (channel, _) in &self.columns {
            text += ",";
            text += channel.name();
        }
        for (row, time_s) in self.time_s.iter().enumerate() {
            let _ = write!(text, "\n{time_s}");
            for (_, values) in &self.columns {
                // Sensors show multiples of a step: their last digits are not worth a file.
                let _ = write!(text, ",{}", (values[row] * 1e6).round() / 1e6);
            }
        }
        text + "\n"
    }

    /// What stands in the file beside the log.
    #[must_use]
    pub fn facts_toml(&self) -> String {
        let mut text = "schema = 1\n".to_owned();
        if let (Some(soc), Some(sigma)) = (self.facts.soc_initial, self.facts.soc_initial_sigma) {
            let _ = writeln!(text, "soc_initial = {soc:.5}\nsoc_initial_sigma = {sigma}");
        }
        if let Some(history) = self.facts.history {
            let name = if history == History::Charged { "charged" } else { "discharged" };
            let _ = writeln!(text, "history = \"{name}\"");
        }
        if self.facts.gap_current == Some(GapCurrent::Stated) {
            text += "gap_current = \"stated\"\n";
        }
        let role = if self.facts.role == Some(Role::Holdout) { "holdout" } else { "train" };
        let _ = writeln!(text, "role = \"{role}\"");
        text
    }

    /// The log as the lab reads it.
    ///
    /// # Panics
    /// When the lab refuses its own canonical form.
    #[must_use]
    pub fn log(&self) -> Log {
        read_log(&format!("{}.csv", self.name), self.csv().as_bytes(), self.facts.clone()).unwrap_or_else(|error| panic!("{error}"))
    }
}

/// How much of a hidden effect a refit of the base model leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct Leaves {
    /// By target channel: RMS over the training logs, in mV per cell for a voltage and in sensor
    /// floors otherwise.
    pub by_channel: BTreeMap<Channel, f64>,
    /// The greatest of them, where 1 is 1 mV per cell or 2 sensor floors.
    pub strength: f64,
    /// How many deviations all rows together are from nothing, each with its sensor's white noise.
    pub deviations: f64,
}

impl Leaves {
    /// Nothing is left.
    #[must_use]
    pub fn nothing() -> Self {
        Self { by_channel: BTreeMap::new(), strength: 0.0, deviations: 0.0 }
    }

    /// Which bin the case falls into.
    #[must_use]
    pub fn bin(&self) -> Bin {
        match self.strength {
            strength if strength >= 1.0 => Bin::Clear,
            strength if strength >= 0.3 => Bin::Faint,
            _ => Bin::Below,
        }
    }
}

/// How visible a hidden effect is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bin {
    /// It leaves 1 mV per cell, or 2 sensor floors, or more.
    Clear,
    /// 0.3 mV to 1 mV per cell, or 0.6 to 2 sensor floors.
    Faint,
    /// Less: anything but a wrong name is right.
    Below,
}

/// An effect of the catalogue that is hidden in a world.
#[derive(Debug, Clone)]
pub struct Hidden {
    /// The effect.
    pub id: &'static str,
    /// Its true parameters.
    pub parameters: Vec<(&'static str, f64)>,
    /// What of it a refit of everything else leaves.
    pub leaves: Leaves,
}

/// What is right to answer.
#[derive(Debug, Clone)]
pub enum Right {
    /// All of these effects, or others of their classes.
    Effects(Vec<Hidden>),
    /// That nothing is missing.
    Complete,
    /// One of these effects or of their classes, and beside it what may help another form along.
    AnyOf {
        /// At least one of them, or of their classes.
        any: Vec<&'static str>,
        /// These are not wrong beside it.
        may: Vec<&'static str>,
        /// What of the truth a refit leaves.
        leaves: Leaves,
    },
    /// That it is nothing of the catalogue.
    Unknown {
        /// Effects that are no mistake beside saying so: what the catalogue does know of it.
        may: Vec<&'static str>,
        /// What of it a refit leaves.
        leaves: Leaves,
    },
    /// That the logs cannot tell.
    Set {
        /// All of these must be named.
        must: Vec<&'static str>,
        /// These may be named as well.
        may: Vec<&'static str>,
        /// What of the truth a refit leaves.
        leaves: Leaves,
    },
}

/// What is true and never shown to the lab.
#[derive(Debug, Clone)]
pub struct Truth {
    /// What is hidden, in words.
    pub story: String,
    /// The right answer.
    pub right: Right,
    /// Two effects that are hard to tell from each other are hidden together.
    pub confusable: bool,
    /// The lab's OCV table is wrong.
    pub wrong_ocv: bool,
    /// Held-out RMS over floor of the truth itself, told what the lab is told; NaN where the truth
    /// is no model of the catalogue.
    pub told_over_floor: f64,
    /// True values of the base model's own free parameters: effect, parameter, value.
    pub base: Vec<(&'static str, &'static str, f64)>,
}

impl Truth {
    /// What is left of the least visible part of what is hidden.
    #[must_use]
    pub fn leaves(&self) -> Leaves {
        match &self.right {
            Right::Complete => Leaves::nothing(),
            Right::AnyOf { leaves, .. } | Right::Unknown { leaves, .. } | Right::Set { leaves, .. } => leaves.clone(),
            Right::Effects(hidden) => {
                let least = hidden.iter().min_by(|a, b| a.leaves.strength.total_cmp(&b.leaves.strength));
                least.map_or_else(Leaves::nothing, |hidden| hidden.leaves.clone())
            }
        }
    }
}

/// One case.
#[derive(Debug, Clone)]
pub struct Case {
    /// Everything random in it follows from this.
    pub seed: u64,
    /// The system that it is about.
    pub system: System,
    /// Kind and subject.
    pub name: String,
    /// What it is about.
    pub kind: Kind,
    /// The model that the lab begins with.
    pub base_model_toml: String,
    /// Logs to learn from.
    pub train: Vec<CaseLog>,
    /// Logs to judge by.
    pub holdout: Vec<CaseLog>,
    /// What only the scorer knows.
    pub truth: Truth,
}

impl Case {
    /// The model that the lab begins with.
    ///
    /// # Panics
    /// When it is no valid file: a mistake of this benchmark.
    #[must_use]
    pub fn base_model(&self) -> Model {
        let refuse = |_: &str| Err("a base model names no files".to_owned());
        Model::parse("base.toml", &self.base_model_toml, &refuse).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Floor of the sensor of the channel that a system is judged by, in the channel's unit.
    #[must_use]
    pub fn main_floor(&self) -> f64 {
        self.base_model().sensor(self.system.targets()[0]).floor()
    }
}
