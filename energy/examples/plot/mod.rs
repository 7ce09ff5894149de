//! Plots for the examples: panels of lines, written as SVG and as PNG.
//!
//! The font comes as a crate, so that a machine without fonts draws the same picture.

use std::error::Error;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::register_font;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const FONT: &str = "sans-serif";
/// Pixels drawn for one pixel asked for: coordinates are whole pixels, in SVG too.
const FINE: i32 = 2;
const INK: RGBColor = RGBColor(40, 40, 40);
const GRID: RGBColor = RGBColor(222, 222, 222);

/// Colours that stay apart for colour-blind eyes and in print (Okabe and Ito, 2008).
pub const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(150, 110, 0),
    RGBColor(0, 0, 0),
];
/// Black, to be drawn over other colours.
#[allow(dead_code, reason = "not every example draws over a line")]
pub const BLACK: usize = 6;

/// A curve of a panel.
pub struct Line {
    /// Name in the legend; an empty one stays out of it.
    pub label: String,
    /// Points, in the units of the panel's axes.
    pub points: Vec<(f64, f64)>,
    /// Half width of a band about it, one for each point; empty for none.
    pub band: Vec<f64>,
    /// Place in [`COLOURS`].
    pub colour: usize,
    /// Whether it is drawn in dashes.
    pub dashed: bool,
    /// Whether the points are the corners of an area.
    pub filled: bool,
}

impl Line {
    /// A curve from the values of a function at 400 places.
    pub fn of(label: &str, colour: usize, x: Range<f64>, y: impl Fn(f64) -> f64) -> Self {
        let at = |step: u32| x.start + (x.end - x.start) * f64::from(step) / 400.0;
        Line::through(label, colour, (0..=400).map(|step| (at(step), y(at(step)))).collect())
    }

    /// A curve through points.
    pub fn through(label: &str, colour: usize, points: Vec<(f64, f64)>) -> Self {
        Line { label: label.to_owned(), points, band: Vec::new(), colour, dashed: false, filled: false }
    }

    /// The same curve in dashes.
    #[allow(dead_code, reason = "not every example draws dashes")]
    pub fn dashed(mut self) -> Self {
        self.dashed = true;
        self
    }

    /// The area between these corners.
    #[allow(dead_code, reason = "not every example draws areas")]
    pub fn filled(mut self) -> Self {
        self.filled = true;
        self
    }
}

/// A point of a panel with words beside it.
pub struct Mark {
    /// Place, in the units of the axes.
    pub at: (f64, f64),
    /// Words.
    pub text: String,
    /// Where the words stand, in pixels from the point: right and down are positive. Words to the
    /// left end at the point, words to the right begin there, words right above stand over it.
    pub offset: (i32, i32),
}

/// One set of axes.
pub struct Panel {
    /// Title above it.
    pub title: String,
    /// Label of the x axis, with unit.
    pub x_label: String,
    /// Ends of the x axis.
    pub x: Range<f64>,
    /// Label of the y axis, with unit.
    pub y_label: String,
    /// Ends of the y axis.
    pub y: Range<f64>,
    /// Curves.
    pub lines: Vec<Line>,
    /// Points of note.
    pub marks: Vec<Mark>,
    /// Where the legend stands.
    pub legend: SeriesLabelPosition,
    /// Whether the x axis is logarithmic: powers of ten are labelled.
    pub log_x: bool,
    /// Words in place of the numbers of the x axis.
    pub x_names: Vec<(f64, String)>,
}

impl Panel {
    /// Curves over axes: of each its label with unit, and its ends.
    pub fn new(title: &str, x: (&str, Range<f64>), y: (&str, Range<f64>), lines: Vec<Line>, legend: SeriesLabelPosition) -> Self {
        let (x_label, y_label) = (x.0.to_owned(), y.0.to_owned());
        let (marks, x_names) = (Vec::new(), Vec::new());
        Panel { title: title.to_owned(), x_label, x: x.1, y_label, y: y.1, lines, marks, legend, log_x: false, x_names }
    }

    /// The same panel with points of note.
    #[allow(dead_code, reason = "not every example marks points")]
    pub fn marked(mut self, marks: Vec<Mark>) -> Self {
        self.marks = marks;
        self
    }

    /// The same panel with a logarithmic x axis.
    #[allow(dead_code, reason = "not every example has a logarithmic axis")]
    pub fn log_x(mut self) -> Self {
        self.log_x = true;
        self
    }

    /// Place of a point in the coordinates that are drawn.
    fn place(&self, x: f64) -> f64 {
        if self.log_x { x.log10() } else { x }
    }

    /// Words at a tick of the x axis.
    fn x_tick(&self, x: f64) -> String {
        if self.log_x {
            // Grid lines between powers of ten stay without words.
            return if (x - x.round()).abs() < 1e-6 {
                number(10f64.powf(x.round()), (-x.round()).max(0.0) as usize)
            } else {
                String::new()
            };
        }
        if self.x_names.is_empty() {
            return number(x, digits(&self.x));
        }
        self.x_names.iter().find(|(at, _)| (at - x).abs() < 1e-6).map_or_else(String::new, |(_, name)| name.clone())
    }
}

/// Draws panels, `columns` side by side, each of `size` pixels at half the resolution, into `folder/name.svg` and
/// `folder/name.png`, and gives both paths.
///
/// # Errors
/// What the disk or the drawing library refuses.
pub fn save(folder: &Path, name: &str, columns: usize, size: (u32, u32), panels: &[Panel]) -> Result<[PathBuf; 2], Box<dyn Error>> {
    register_font(FONT, FontStyle::Normal, dejavu::sans::regular()).map_err(|_| "the font cannot be read")?;
    register_font(FONT, FontStyle::Bold, dejavu::sans::bold()).map_err(|_| "the font cannot be read")?;
    fs::create_dir_all(folder)?;
    let rows = panels.len().div_ceil(columns);
    let fine = FINE.unsigned_abs();
    let whole = (fine * size.0 * u32::try_from(columns)?, fine * size.1 * u32::try_from(rows)?);
    let paths = ["svg", "png"].map(|extension| folder.join(format!("{name}.{extension}")));
    draw(&SVGBackend::new(&paths[0], whole).into_drawing_area(), (rows, columns), panels)?;
    draw(&BitMapBackend::new(&paths[1], whole).into_drawing_area(), (rows, columns), panels)?;
    Ok(paths)
}

fn draw<B: DrawingBackend>(area: &DrawingArea<B, Shift>, grid: (usize, usize), panels: &[Panel]) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    area.fill(&WHITE)?;
    for (part, panel) in area.split_evenly(grid).iter().zip(panels) {
        draw_panel(part, panel)?;
    }
    area.present()?;
    Ok(())
}

fn draw_panel<B: DrawingBackend>(area: &DrawingArea<B, Shift>, panel: &Panel) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    let text = |size: i32| (FONT, size * FINE).into_font().color(&INK);
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, (FONT, 19 * FINE, FontStyle::Bold).into_font().color(&INK))
        .margin(12 * FINE)
        .margin_right(24 * FINE)
        .x_label_area_size(48 * FINE)
        .y_label_area_size(70 * FINE)
        .build_cartesian_2d(panel.place(panel.x.start)..panel.place(panel.x.end), panel.y.clone())?;
    let y_digits = digits(&panel.y);
    let mut mesh = chart.configure_mesh();
    if !panel.x_names.is_empty() {
        mesh.disable_x_mesh();
    }
    mesh.x_labels(8)
        .y_labels(7)
        .x_label_formatter(&|x| panel.x_tick(*x))
        .y_label_formatter(&|y| number(*y, y_digits))
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID.stroke_width(FINE.unsigned_abs()))
        .axis_style(INK.stroke_width(FINE.unsigned_abs()))
        .set_all_tick_mark_size(5 * FINE)
        .label_style(text(15))
        .axis_desc_style(text(16))
        .x_desc(&panel.x_label)
        .y_desc(&panel.y_label)
        .draw()?;
    for line in &panel.lines {
        let colour = COLOURS[line.colour % COLOURS.len()];
        let style = colour.stroke_width(2 * FINE.unsigned_abs());
        let points: Vec<(f64, f64)> = line.points.iter().map(|&(x, y)| (panel.place(x), y)).collect();
        if !line.band.is_empty() {
            let upper = points.iter().zip(&line.band).map(|(&(x, y), half)| (x, y + half));
            let lower = points.iter().zip(&line.band).rev().map(|(&(x, y), half)| (x, y - half));
            chart.draw_series([Polygon::new(upper.chain(lower).collect::<Vec<_>>(), colour.mix(0.18))])?;
        }
        let drawn = if line.filled {
            chart.draw_series([Polygon::new(points, colour.filled())])?
        } else if line.dashed {
            chart.draw_series(DashedLineSeries::new(points, 8 * FINE, 5 * FINE, style))?
        } else {
            chart.draw_series(LineSeries::new(points, style))?
        };
        if !line.label.is_empty() {
            let drawn = drawn.label(&line.label);
            let ends = |(x, y)| [(x, y), (x + 22 * FINE, y)];
            if line.dashed {
                drawn.legend(move |at| DashedPathElement::new(ends(at), 6 * FINE, 3 * FINE, style));
            } else {
                drawn.legend(move |at| PathElement::new(ends(at), style));
            }
        }
    }
    for mark in &panel.marks {
        let side = match mark.offset.0 {
            ..0 => HPos::Right,
            0 => HPos::Center,
            1.. => HPos::Left,
        };
        let words = text(15).pos(Pos::new(side, VPos::Center));
        let element = EmptyElement::at((panel.place(mark.at.0), mark.at.1))
            + Circle::new((0, 0), 4 * FINE, INK.filled())
            + Text::new(mark.text.clone(), (mark.offset.0 * FINE, mark.offset.1 * FINE), words);
        chart.draw_series([element])?;
    }
    if panel.lines.iter().filter(|line| !line.label.is_empty()).count() > 0 {
        chart
            .configure_series_labels()
            .position(panel.legend.clone())
            .margin(14 * FINE)
            .legend_area_size(28 * FINE)
            .label_font(text(15))
            .background_style(WHITE.mix(0.85))
            .border_style(GRID)
            .draw()?;
    }
    Ok(())
}

/// Digits after the point that tell the labels of an axis apart.
fn digits(range: &Range<f64>) -> usize {
    let step = (range.end - range.start) / 8.0;
    (-step.log10().floor()).clamp(0.0, 4.0) as usize
}

fn number(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') { "0".to_owned() } else { text }
}
