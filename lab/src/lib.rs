//! Compares energy models with measurements, row by row, and calibrates them.
//!
//! ```text
//!   measurement/   one file per source format -> columns -> Log (canonical channels, missing = NaN)
//!        |                         model_source   built-in name or path -> Model
//!        v                              v
//!   prepare        a log seen by a model: inputs, start, targets with their sensor floors
//!        |
//!   predict        the same walk for plain numbers and for exact derivatives
//!        |
//!   residual ──> regime     where the squared error lies
//!        |   └─> compare    error against the sensor floor, worst regimes in words
//!        v
//!   fit/           free parameters, bounded least squares, honest sigmas
//!        |
//!   model_edit     the fitted numbers, written back into the model's own text
//!        v
//!   report/        terminal tables and serde structs for `--format json`
//! ```
//!
//! Nothing here reads a clock or draws a random number. Only `model_source`, `output` and the
//! program's `cmd/` touch the disk. Residual is always observed minus predicted.

pub mod compare;
pub mod fit;
pub mod infer;
pub mod measurement;
pub mod model_edit;
pub mod model_source;
pub mod output;
pub mod predict;
pub mod prepare;
pub mod regime;
pub mod report;
pub mod residual;

pub use compare::{Comparison, compare};
pub use measurement::{Log, LogError, LogFacts};
pub use model_source::{ModelSource, ModelSourceError, load_model};
pub use prepare::{PrepareError, Prepared, prepare};
