//! Sections that hold pictures.

use maud::{Markup, PreEscaped, html};

use super::sections::{Confounding, Ladder, SpectrumCurve};
use super::tables::whiteness;
use crate::compare::{ChannelError, RegimeError};
use crate::plot::axis::{Axis, title_of};
use crate::plot::bars::{Bars, Row, draw_bars};
use crate::plot::heat::draw_heat;
use crate::plot::panel::{Mark, Panel, draw};
use crate::plot::regimes::charts;
use crate::plot::svg::Ink;
use crate::plot::time::{FLOORS, draw_trace};
use crate::plot::{Look, Svg, Trace};
use crate::report::quantity::quantity;

/// Widths of a picture on a screen and on a phone, pixels.
const WIDTHS: [(&str, f64); 2] = [("wide", 860.0), ("narrow", 380.0)];

/// A picture, drawn once for wide and once for narrow screens, so that words keep their size.
fn figure(alt: &str, caption: &str, draw: impl Fn(&mut Svg)) -> Markup {
    html! {
        figure {
            @for (class, width) in WIDTHS {
                div class=(class) { (PreEscaped(drawn(width, alt, &draw))) }
            }
            @if !caption.is_empty() { figcaption { (caption) } }
        }
    }
}

fn drawn(width: f64, alt: &str, draw: impl Fn(&mut Svg)) -> String {
    let mut svg = Svg::new(width, Look::Page);
    draw(&mut svg);
    svg.finish(alt)
}

pub(super) fn traces(traces: &[Trace]) -> Option<Markup> {
    let alt = |trace: &Trace| {
        let largest = trace.residual.iter().flatten().fold(0.0_f64, |largest, point| largest.max(point.1.abs()));
        let largest = quantity(largest, &trace.unit);
        format!("{} of {} over time, measured and predicted; they differ by at most {largest}.", title_of(&trace.channel), trace.log)
    };
    let caption = |trace: &Trace| {
        let band = trace.floor.map_or_else(
            || "the model states no sensor floor".to_owned(),
            |floor| format!("the band is \u{b1}{FLOORS} sensor floors of {}", quantity(floor, &trace.unit)),
        );
        format!("{} rows; {band}.", trace.rows)
    };
    (!traces.is_empty()).then(|| html! { @for trace in traces { (figure(&alt(trace), &caption(trace), |svg| draw_trace(svg, trace))) } })
}

pub(super) fn regimes(regimes: &[RegimeError]) -> Option<Markup> {
    let alt = |chart: &Bars| {
        let rows: Vec<String> = chart.rows.iter().map(|row| format!("{}: {}", row.name, row.bars[0].2)).collect();
        format!("{}. {}", chart.title, rows.join("; "))
    };
    let charts = charts(regimes);
    (!charts.is_empty()).then(|| {
        html! {
            p.note { "A bar longer than its mark: there is more of the error here than of the rows." }
            @for chart in &charts { (figure(&alt(chart), "", |svg| draw_bars(svg, chart))) }
        }
    })
}

pub(super) fn ladders(ladders: &[Ladder]) -> Option<Markup> {
    let chart = |ladder: &Ladder| {
        let holdout = ladder.steps.iter().any(|step| step.holdout_rms.is_some());
        let rows = ladder.steps.iter().map(|step| {
            let bar = |rms: f64, ink| (rms, ink, quantity(rms, &ladder.unit));
            let bars = std::iter::once(bar(step.train_rms, Ink::Residual)).chain(step.holdout_rms.map(|rms| bar(rms, Ink::Holdout)));
            Row { name: step.effect.clone(), bars: bars.collect(), mark: ladder.floor }
        });
        let mut legend = vec![(Ink::Residual, "RMS on training logs".to_owned())];
        if holdout {
            legend.push((Ink::Holdout, "RMS on held-out logs".to_owned()));
        }
        let all = ladder.steps.iter().flat_map(|step| [Some(step.train_rms), step.holdout_rms, ladder.floor]).flatten();
        Bars {
            title: title_of(&ladder.channel),
            legend,
            mark: ladder.floor.map_or_else(String::new, |floor| format!("{}, {}", ladder.floor_name, quantity(floor, &ladder.unit))),
            full: all.fold(0.0, f64::max),
            rows: rows.collect(),
        }
    };
    let alt = |ladder: &Ladder| {
        let steps: Vec<String> =
            ladder.steps.iter().map(|step| format!("{} {}", step.effect, quantity(step.train_rms, &ladder.unit))).collect();
        format!("RMS of {} on the training logs, step by step: {}", title_of(&ladder.channel), steps.join(", "))
    };
    (!ladders.is_empty()).then(|| html! { @for ladder in ladders { (figure(&alt(ladder), "", |svg| draw_bars(svg, &chart(ladder)))) } })
}

pub(super) fn confounding(confounding: Option<&Confounding>) -> Option<Markup> {
    let Confounding { effects, rho, absorbed } = confounding.filter(|confounding| confounding.effects.len() > 1)?;
    let mut alike = Vec::new();
    for (i, row) in rho.iter().enumerate().take(effects.len()) {
        for (j, rho) in row.iter().enumerate().take(i).filter(|(_, rho)| rho.abs() > 0.95) {
            alike.push(format!("{} and {} ({rho:.2})", effects[j], effects[i]));
        }
    }
    let words = if alike.is_empty() {
        "No two of these effects look alike in these logs.".to_owned()
    } else {
        format!("These logs cannot tell apart: {}.", alike.join(", "))
    };
    Some(html! {
        p.note { "Correlation of what two effects would leave in the residual, after a refit of what is in the model. Near 1 these logs cannot tell them apart." }
        (figure(&words, &words, |svg| draw_heat(svg, effects, rho)))
        @if !absorbed.is_empty() {
            p.note { "Not shown, since a refit of what is in the model does all of their work: " (absorbed.join(", ")) "." }
        }
    })
}

pub(super) fn spectra(spectra: &[SpectrumCurve], errors: &[ChannelError]) -> Option<Markup> {
    let alt = |curve: &SpectrumCurve| {
        let words = if curve.p_value < 0.05 { "leaves" } else { "stays within" };
        format!("Cumulative periodogram of {} in {}: it {words} the bounds of white noise.", title_of(&curve.channel), curve.log)
    };
    let numbers = whiteness(errors);
    (!spectra.is_empty() || numbers.is_some()).then(|| {
        html! {
            @if let Some(numbers) = numbers { (numbers) }
            @if !spectra.is_empty() { p.note { "Share of the residual's power up to each frequency. White noise stays between the dashed lines in 19 of 20 cases; a curve above them is slow error, a jump is a period." } }
            @for curve in spectra { (figure(&alt(curve), "", |svg| draw(svg, &spectrum(curve)))) }
        }
    })
}

fn spectrum(curve: &SpectrumCurve) -> Panel {
    let end = curve.points.last().map_or(1.0, |point| point.0);
    // mHz, as logs are minutes to hours long.
    let (factor, unit) = if end < 1.0 { (1e3, "mHz") } else { (1.0, "Hz") };
    let line = |points: Vec<(f64, f64)>, ink, width, dashed, label: &str| Mark::Line {
        pieces: vec![points],
        ink,
        width,
        dashed,
        label: label.to_owned(),
    };
    let bound = |sign: f64| {
        let at = |x: f64| (x * end * factor, (x + sign * curve.distance_5_percent).clamp(0.0, 1.0));
        // The corners where a bound meets 0 and 1 are points of their own.
        let corner = if sign > 0.0 { 1.0 - curve.distance_5_percent } else { curve.distance_5_percent };
        vec![at(0.0), at(corner.clamp(0.0, 1.0)), at(1.0)]
    };
    let points = std::iter::once((0.0, 0.0)).chain(curve.points.iter().map(|(frequency, share)| (frequency * factor, *share)));
    Panel {
        title: format!("{}: {}", curve.log, title_of(&curve.channel)),
        x: Axis { label: format!("frequency, {unit}"), low: 0.0, high: end * factor },
        y: Axis { label: "share of power".to_owned(), low: 0.0, high: 1.06 },
        marks: vec![
            line(bound(1.0), Ink::Floor, 1.5, true, "white, 95 %"),
            line(bound(-1.0), Ink::Floor, 1.5, true, ""),
            line(points.collect(), Ink::Residual, 2.0, false, "residual"),
        ],
        height: 170.0,
    }
}
