//! Measured and predicted over time, with the residual below.

use super::axis::{Axis, readable_unit, time_unit, title_of};
use super::panel::{Mark, Panel, draw};
use super::svg::{Ink, Svg};
use super::trace::{Pieces, Trace};
use crate::report::quantity::quantity;

/// Sensor floors on each side that the band about zero shows: 95 % of white noise lies inside.
pub const FLOORS: f64 = 2.0;

/// Draws one channel of one log below what is there.
pub fn draw_trace(svg: &mut Svg, trace: &Trace) {
    let all_s = || trace.measured.iter().flatten().map(|point| point.0);
    let (begin_s, end_s) = all_s().fold((f64::INFINITY, f64::NEG_INFINITY), |ends, time| (ends.0.min(time), ends.1.max(time)));
    let (unit_s, unit) = time_unit(end_s - begin_s);
    let x = |label: &str| Axis { label: label.to_owned(), ..span(begin_s / unit_s, end_s / unit_s) };
    let y = |pieces: &Pieces, factor: f64| -> Pieces {
        pieces.iter().map(|piece| piece.iter().map(|(time, value)| (time / unit_s, value * factor)).collect()).collect()
    };
    let values =
        |pieces: &[&Pieces]| -> Vec<f64> { pieces.iter().flat_map(|pieces| pieces.iter().flatten().map(|point| point.1)).collect() };
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let line = |pieces, ink, width, label: &str| Mark::Line { pieces, ink, width, dashed: false, label: label.to_owned() };

    let both = values(&[&trace.measured, &trace.predicted]);
    let (factor, name) = readable_unit(largest(&both), &trace.unit);
    draw(
        svg,
        &Panel {
            title: format!("{}: {}", trace.log, title_of(&trace.channel)),
            x: x(""),
            y: Axis::over(labelled(&title_of(&trace.channel), &name), both.iter().map(|value| value * factor)),
            marks: vec![
                line(y(&trace.measured, factor), Ink::Measured, 4.0, "measured"),
                line(y(&trace.predicted, factor), Ink::Predicted, 1.6, "predicted"),
            ],
            height: 190.0,
        },
    );
    let rest = values(&[&trace.residual]);
    let (factor, name) = readable_unit(largest(&rest), &trace.unit);
    let half = trace.floor.map(|floor| FLOORS * floor * factor);
    let label = trace.floor.map_or(String::new(), |floor| format!("\u{b1}{FLOORS} sensor floors of {}", quantity(floor, &trace.unit)));
    let band = half.map(|half| Mark::Band { low: -half, high: half, ink: Ink::Floor, label });
    let ends = rest.iter().map(|value| value * factor).chain(half.into_iter().flat_map(|half| [-1.5 * half, 1.5 * half])).chain([0.0]);
    draw(
        svg,
        &Panel {
            title: String::new(),
            x: x(&format!("time, {unit}")),
            y: Axis::over(labelled("measured \u{2212} predicted", &name), ends),
            marks: band.into_iter().chain([line(y(&trace.residual, factor), Ink::Residual, 1.4, "")]).collect(),
            height: 110.0,
        },
    );
}

fn span(low: f64, high: f64) -> Axis {
    if low < high { Axis { label: String::new(), low, high } } else { Axis::over(String::new(), [low].into_iter()) }
}

/// A name with its unit, if it has one.
fn labelled(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name}, {unit}") }
}
