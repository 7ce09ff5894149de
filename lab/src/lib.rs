//! Compares energy models with measurements, row by row, and calibrates them.
//!
//! ```text
//!   measurement/   one file per source format -> columns -> Log (canonical channels, missing = NaN)
//!        |                         model_source   built-in name or path -> Model
//!        v                              v
//!        |            ocv/   a battery's first model, of its logs alone; drive   a robot's, of data sheets
//!   prepare        a log seen by a model: inputs, start, targets with their sensor floors
//!        |
//!   predict        the same walk for plain numbers and for exact derivatives
//!        |            input_noise   what noise of the inputs adds to the floors
//!   residual ──> regime, concentration   where the squared error lies
//!        |   ├─> whiteness, floor         is there still something in it
//!        |   └─> compare                  error against the sensor floor, worst regimes in words
//!        v
//!   fit/           free parameters, bounded least squares, honest sigmas
//!        |
//!   infer/         which effect is missing: evidence for every one that the model lacks
//!        |
//!   model_edit     the numbers, effects and tables found, written into the model's own text
//!        |            learned   what a search found, as such edits
//!        |            decision  what they change in what the coordinator plans with
//!        v
//!   report/        terminal tables, serde structs for `--format json`, one HTML file
//!   plot/          SVG and PNG, for files and for that HTML
//! ```
//!
//! Nothing here reads a clock or draws a random number. Only `model_source`, `output`, the
//! coordinator's store in `measurement/` and the program's `cmd/` touch the disk. Residual is always observed minus predicted.

pub mod compare;
pub mod concentration;
pub mod decision;
pub mod drive;
pub mod fit;
pub mod floor;
pub mod infer;
pub mod input_noise;
pub mod learned;
pub mod measurement;
pub mod model_edit;
pub mod model_source;
pub mod ocv;
pub mod output;
mod persistence;
pub mod plot;
pub mod predict;
pub mod prepare;
pub mod regime;
pub mod report;
pub mod residual;
mod rounding;
pub mod whiteness;

pub use compare::{Comparison, compare};
pub use measurement::{Log, LogError, LogFacts};
pub use model_source::{ModelSource, load_model};
pub use prepare::{PrepareError, Prepared, prepare};
