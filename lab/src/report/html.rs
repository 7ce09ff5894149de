//! One self-contained HTML file: reads without a network, on a phone, in light and in dark.
//!
//! A report is a [`Page`] of plain data; each part of it that is filled becomes a section. Nothing
//! is loaded from elsewhere: style and pictures stand in the file, and there are no scripts.

mod charts;
mod of_comparison;
mod of_discovery;
mod sections;
mod style;
mod tables;

use maud::{DOCTYPE, Markup, PreEscaped, html};

pub use of_comparison::{log_lines, page_of};
pub use sections::{
    Answer, Confounding, DecisionRow, Epc, Errors, Evidence, Files, Header, Ladder, LadderStep, LogLine, Page, ParameterRow, SpectrumCurve,
    Tone,
};

use crate::plot::axis::time_unit;
use crate::report::quantity::digits;

/// The whole file.
#[must_use]
pub fn render(page: &Page) -> String {
    let parts = [
        ("noticed", "Noticed in the logs", noticed(&page.header.notes)),
        ("errors", "Error against the sensor floor", tables::errors(&page.errors, &page.holdout_errors)),
        ("time", "Measured and predicted", charts::traces(&page.traces)),
        ("regimes", "Where the error lies", charts::regimes(&page.regimes)),
        ("ladder", "How the error fell", charts::ladders(&page.ladders)),
        ("evidence", "What speaks for each effect", tables::evidence(&page.evidence)),
        ("confounding", "Which effects look alike here", charts::confounding(page.confounding.as_ref())),
        ("spectrum", "Is the residual white?", charts::spectra(&page.spectra, &page.errors.all)),
        ("parameters", "Parameters", tables::parameters(&page.parameters)),
        ("files", "The model file by itself", tables::files(&page.files)),
        ("decisions", "What it changes", tables::decisions(&page.decisions)),
    ];
    let parts: Vec<_> = parts.into_iter().filter_map(|(id, title, body)| Some((id, title, body?))).collect();
    let whole = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (page.header.title) }
                style { (PreEscaped(style::css())) }
            }
            body {
                header { (head(&page.header)) }
                main {
                    @if let Some(verdict) = &page.verdict { (answer(verdict)) }
                    @if parts.len() > 2 {
                        nav aria-label="Sections" {
                            @for (id, title, _) in &parts { a href={ "#" (id) } { (title) } }
                        }
                    }
                    @for (id, title, body) in &parts {
                        section id=(id) aria-labelledby={ (id) "-title" } {
                            h2 id={ (id) "-title" } { (title) }
                            (body)
                        }
                    }
                }
                footer { p { "Residuals are measured minus predicted. Written by lab " (page.header.version) "." } }
            }
        }
    };
    whole.into_string()
}

fn head(header: &Header) -> Markup {
    html! {
        h1 { (header.title) }
        dl.facts {
            div { dt { "Model" } dd { (header.model) } }
            @if let Some(date) = &header.date { div { dt { "Date" } dd { (date) } } }
            @for (holdout, title) in [(false, "Logs"), (true, "Held out")] {
                @if header.logs.iter().any(|log| log.holdout == holdout) {
                    div {
                        dt { (title) }
                        dd {
                            @for log in header.logs.iter().filter(|log| log.holdout == holdout) {
                                span.log { (log.name) small { " " (log.rows) " rows, " (span(log.span_s)) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn noticed(notes: &[String]) -> Option<Markup> {
    (!notes.is_empty()).then(|| html! { ul { @for note in notes { li { (note) } } } })
}

fn span(span_s: f64) -> String {
    let (unit_s, unit) = time_unit(span_s);
    format!("{} {unit}", digits(span_s / unit_s))
}

fn answer(answer: &Answer) -> Markup {
    // The sign says the same as the colour, for eyes that do not see the colour.
    let (class, sign, meaning) = match answer.tone {
        Tone::Good => ("good", "\u{2713}", "Yes"),
        Tone::Bad => ("bad", "\u{2717}", "No"),
        Tone::Unsure => ("unsure", "?", "Cannot tell"),
    };
    html! {
        section.verdict.(class) aria-labelledby="verdict-title" {
            h2 id="verdict-title" { span.sign role="img" aria-label=(meaning) { (sign) } " " (answer.headline) }
            @if !answer.words.is_empty() { ul { @for words in &answer.words { li { (words) } } } }
            @if let Some(experiment) = &answer.experiment { p.experiment { strong { "Next measurement: " } (experiment) } }
        }
    }
}

#[cfg(test)]
mod tests;
