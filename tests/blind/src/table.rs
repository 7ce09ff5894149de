//! The published table: Markdown for people, JSON for programs.

use serde_json::{Value, json};

use crate::tally::{Figure, Line};

/// The table in Markdown.
#[must_use]
pub fn markdown(lines: &[Line]) -> String {
    let mut text = "| figure | result | 95 % interval | cases | aim |\n| --- | --- | --- | --- | --- |\n".to_owned();
    for Line { name, target, figure } in lines {
        let (result, interval, of) = match figure {
            Figure::Rate(rate) => {
                let (low, high) = rate.wilson();
                (format!("{:.1} %", 100.0 * rate.share()), format!("{:.1}-{:.1} %", 100.0 * low, 100.0 * high), rate.of)
            }
            Figure::Spread { median, p95, of, unit } => (format!("{median:.3} {unit}"), format!("p95 {p95:.3} {unit}"), *of),
        };
        text += &format!("| {name} | {result} | {interval} | {of} | {target} |\n");
    }
    text
}

/// The table in JSON.
#[must_use]
pub fn json(lines: &[Line]) -> Value {
    let line = |Line { name, target, figure }: &Line| match figure {
        Figure::Rate(rate) => {
            let (low, high) = rate.wilson();
            json!({ "figure": name, "aim": target, "hits": rate.hits, "cases": rate.of, "share": rate.share(), "low": low, "high": high })
        }
        Figure::Spread { median, p95, of, unit } => {
            json!({ "figure": name, "aim": target, "median": median, "p95": p95, "cases": of, "unit": unit })
        }
    };
    Value::Array(lines.iter().map(line).collect())
}
