//! Pictures as files: SVG, or PNG through a rasteriser.

use std::path::Path;
use std::sync::Arc;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, fontdb};

use super::bars::{Bars, draw_bars};
use super::time::draw_trace;
use super::{Look, Svg, Trace};

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The file's ending says neither.
    #[error("cannot plot to {file}: it must end in .svg or .png")]
    Kind {
        /// The file asked for.
        file: String,
    },
    /// The rasteriser failed.
    #[error("cannot turn the plot into PNG: {0}")]
    Png(String),
}

/// What a picture is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Scalable vector graphics.
    Svg,
    /// Pixels.
    Png,
}

impl Kind {
    /// By the ending of a file.
    ///
    /// # Errors
    /// When it is neither .svg nor .png.
    pub fn of(path: &Path) -> Result<Kind, PlotError> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("svg") => Ok(Kind::Svg),
            Some("png") => Ok(Kind::Png),
            _ => Err(PlotError::Kind { file: path.display().to_string() }),
        }
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// When the picture is too large for the rasteriser.
    pub fn bytes(self, svg: String) -> Result<Vec<u8>, PlotError> {
        match self {
            Kind::Svg => Ok(svg.into_bytes()),
            Kind::Png => png(&svg),
        }
    }
}

/// Width of a picture in a file, pixels at half the resolution of PNG.
const WIDTH: f64 = 820.0;
/// Pixels of PNG for one of SVG.
const FINE: f32 = 2.0;

/// One panel for each channel of each log, below each other.
#[must_use]
pub fn traces_svg(model: &str, traces: &[Trace]) -> String {
    let mut svg = Svg::new(WIDTH, Look::File);
    svg.grow(6.0);
    for trace in traces {
        draw_trace(&mut svg, trace);
        svg.grow(8.0);
    }
    svg.finish(&format!("{model}: measured and predicted over time"))
}

/// Charts of bars below each other.
#[must_use]
pub fn bars_svg(title: &str, charts: &[Bars]) -> String {
    let mut svg = Svg::new(WIDTH, Look::File);
    svg.grow(6.0);
    for chart in charts {
        draw_bars(&mut svg, chart);
        svg.grow(8.0);
    }
    svg.finish(title)
}

fn png(svg: &str) -> Result<Vec<u8>, PlotError> {
    let failed = |error: &dyn std::fmt::Display| PlotError::Png(error.to_string());
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.load_font_data(dejavu::sans::bold().to_vec());
    let options = usvg::Options { fontdb: Arc::new(fonts), ..usvg::Options::default() };
    let tree = usvg::Tree::from_str(svg, &options).map_err(|error| failed(&error))?;
    let size = tree.size();
    let (width, height) = ((size.width() * FINE).ceil(), (size.height() * FINE).ceil());
    let mut pixels = Pixmap::new(width as u32, height as u32).ok_or_else(|| failed(&"it is empty or too large"))?;
    resvg::render(&tree, Transform::from_scale(FINE, FINE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| failed(&error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::svg::{Anchor, Ink};

    #[test]
    fn the_ending_decides_and_another_is_refused() {
        assert_eq!(Kind::of(Path::new("a.SVG")).unwrap(), Kind::Svg);
        assert!(Kind::of(Path::new("a.jpg")).unwrap_err().to_string().contains(".svg or .png"));
    }

    #[test]
    fn words_are_drawn_without_a_font_on_the_machine() {
        let picture = |words: &str| {
            let mut svg = Svg::new(200.0, Look::File);
            svg.grow(40.0);
            svg.text((10.0, 25.0), Anchor::Start, 20.0, Ink::Text, words);
            Kind::Png.bytes(svg.finish("test")).unwrap()
        };
        assert!(picture("Tender")[1..4] == *b"PNG" && picture("Tender") != picture(""));
    }
}
