//! Pictures: measured and predicted over time, error by regime, and the charts of the report.
//!
//! Everything is drawn as SVG by one small piece of code: as a file, inside HTML (where colours
//! follow the page, light or dark), and as PNG through a rasteriser with its own font, so that a
//! machine without fonts draws the same picture.

pub mod axis;
pub mod bars;
pub mod file;
pub mod heat;
pub mod panel;
pub mod regimes;
pub mod svg;
pub mod time;
pub mod trace;

pub use svg::{Look, Svg};
pub use trace::{Trace, traces};
