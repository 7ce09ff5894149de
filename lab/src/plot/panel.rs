//! One set of axes with what is drawn in it.

use super::axis::Axis;
use super::svg::{Anchor, Ink, Svg, text_width};
use super::trace::Pieces;

/// What is drawn in a panel, in the units of its axes.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A line through points.
    Line {
        /// The points.
        pieces: Pieces,
        /// Its colour.
        ink: Ink,
        /// Its width in pixels.
        width: f64,
        /// Whether it is dashed.
        dashed: bool,
        /// Name in the legend; an empty one stays out of it.
        label: String,
    },
    /// All between two heights.
    Band {
        /// Lower height.
        low: f64,
        /// Upper height.
        high: f64,
        /// Its colour.
        ink: Ink,
        /// Name in the legend.
        label: String,
    },
}

impl Mark {
    fn label(&self) -> (&str, Ink, bool) {
        match self {
            Mark::Line { label, ink, .. } => (label, *ink, false),
            Mark::Band { label, ink, .. } => (label, *ink, true),
        }
    }
}

/// One set of axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Title above it; none when empty.
    pub title: String,
    /// The horizontal axis. Without a label it gets no words: the panel below shares it.
    pub x: Axis,
    /// The vertical axis; its label stands above it, where it can be read.
    pub y: Axis,
    /// What is drawn, in that order.
    pub marks: Vec<Mark>,
    /// Height of the axes in pixels.
    pub height: f64,
}

const SIZE: f64 = 12.0;
const LEFT: f64 = 58.0;
const RIGHT: f64 = 14.0;

/// Draws a panel below what is there.
pub fn draw(svg: &mut Svg, panel: &Panel) {
    if !panel.title.is_empty() {
        let y = svg.grow(26.0);
        svg.bold((8.0, y + 19.0), 14.0, &panel.title);
    }
    legend(svg, panel);
    let top = svg.grow(panel.height);
    let (left, right) = (LEFT, svg.width() - RIGHT);
    let x = |value: f64| left + panel.x.place(value) * (right - left);
    let y = |value: f64| top + (1.0 - panel.y.place(value).clamp(0.0, 1.0)) * panel.height;
    let bottom = top + panel.height;
    for mark in &panel.marks {
        if let Mark::Band { low, high, ink, .. } = mark {
            svg.rect((left, y(*high)), (right - left, y(*low) - y(*high)), *ink, 0.25);
        }
    }
    for (value, words) in panel.y.ticks((panel.height / 24.0) as usize) {
        svg.line((left, y(value)), (right, y(value)), Ink::Grid, 1.0, false);
        svg.text((left - 7.0, y(value) + 4.0), Anchor::End, SIZE, Ink::Muted, &words);
    }
    let x_ticks = panel.x.ticks(((right - left) / 80.0) as usize);
    for (value, words) in &x_ticks {
        svg.line((x(*value), top), (x(*value), bottom), Ink::Grid, 1.0, false);
        if !panel.x.label.is_empty() {
            svg.text((x(*value), bottom + 17.0), Anchor::Middle, SIZE, Ink::Muted, words);
        }
    }
    for mark in &panel.marks {
        if let Mark::Line { pieces, ink, width, dashed, .. } = mark {
            for piece in pieces {
                let points: Vec<(f64, f64)> = piece.iter().map(|point| (x(point.0), y(point.1))).collect();
                svg.path(&points, *ink, *width, *dashed);
            }
        }
    }
    svg.line((left, bottom), (right, bottom), Ink::Muted, 1.0, false);
    if panel.x.label.is_empty() {
        svg.grow(10.0);
    } else {
        svg.text(((left + right) / 2.0, bottom + 35.0), Anchor::Middle, SIZE, Ink::Text, &panel.x.label);
        svg.grow(46.0);
    }
}

/// The label of the vertical axis, and the legend beside it or, where it is too narrow, below.
fn legend(svg: &mut Svg, panel: &Panel) {
    let base = svg.grow(22.0) + 14.0;
    svg.text((8.0, base), Anchor::Start, SIZE, Ink::Text, &panel.y.label);
    let entries: Vec<_> = panel.marks.iter().map(Mark::label).filter(|(label, ..)| !label.is_empty()).collect();
    let width = |label: &str| 34.0 + text_width(label, SIZE);
    let whole: f64 = entries.iter().map(|(label, ..)| width(label)).sum();
    let mut base = base;
    let mut x = svg.width() - RIGHT - whole;
    if x < 16.0 + text_width(&panel.y.label, SIZE) {
        base = svg.grow(18.0) + 12.0;
        x = 8.0;
    }
    for (label, ink, area) in entries {
        if x > 8.0 && x + width(label) > svg.width() {
            base = svg.grow(18.0) + 12.0;
            x = 8.0;
        }
        if area {
            svg.rect((x, base - 10.0), (20.0, 11.0), ink, 0.35);
        } else {
            svg.line((x, base - 4.0), (x + 20.0, base - 4.0), ink, 3.0, false);
        }
        svg.text((x + 26.0, base), Anchor::Start, SIZE, Ink::Text, label);
        x += width(label);
    }
}
