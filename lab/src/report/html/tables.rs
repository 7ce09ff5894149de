//! Sections that hold tables.

use maud::{Markup, html};

use super::sections::{DecisionRow, Errors, Evidence, Files, ParameterRow};
use crate::compare::ChannelError;
use crate::report::comparison::{chance, interval};
use crate::report::discovery::FileErrors;
use crate::report::quantity::{digits, quantity, unit_of, with_sigma};

/// A table that scrolls by itself where it is wider than the screen. The first `names` columns
/// are words, the others numbers; the first one names the row.
fn table(caption: &str, header: &[&str], names: usize, rows: &[Vec<String>]) -> Markup {
    let class = |column: usize| if column < names { None } else { Some("n") };
    html! {
        div.scroll tabindex="0" role="region" aria-label=(caption) {
            table {
                caption { (caption) }
                thead { tr { @for (column, name) in header.iter().enumerate() { th scope="col" class=[class(column)] { (name) } } } }
                tbody {
                    @for row in rows {
                        tr {
                            @for (column, cell) in row.iter().enumerate() {
                                @if column == 0 { th scope="row" { (cell) } } @else { td class=[class(column)] { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn or_dash<T>(value: Option<T>, words: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "\u{2013}".to_owned(), words)
}

pub(super) fn errors(errors: &Errors, holdout: &Errors) -> Option<Markup> {
    (!errors.all.is_empty()).then(|| {
        html! {
            (errors_of("Measured minus predicted, by log and channel", errors))
            @if !holdout.all.is_empty() { (errors_of("The same for the logs that were held out", holdout)) }
            p.note { "The floor is what the sensor's noise and rounding explain. A model that explains a log has a ratio near 1." }
            @if errors.calibrated.is_some() || holdout.calibrated.is_some() {
                p.note {
                    "Calibrated is what stays of the RMS once offsets, gains and delays of sensors and the start of each log are at their best "
                    "within what is stated of them."
                }
            }
        }
    })
}

/// Where its column stands.
const CALIBRATED: usize = 4;

fn errors_of(caption: &str, errors: &Errors) -> Markup {
    let mut header = vec!["log", "channel", "rows", "RMS", "mean", "largest", "sensor floor", "RMS / floor", "95 %"];
    // Beside what it makes smaller: the last columns may have to be scrolled to.
    let calibrated = errors.calibrated.as_ref();
    calibrated.iter().for_each(|_| header.insert(CALIBRATED, "calibrated"));
    let row = |(place, error): (usize, &ChannelError)| {
        let (size, unit) = (error.size, error.unit);
        let mut row = vec![
            error.log.clone(),
            error.channel.to_owned(),
            size.rows.to_string(),
            quantity(size.rms, unit),
            quantity(size.mean, unit),
            quantity(size.max_abs, unit),
            error.floor.map_or_else(|| "unknown".to_owned(), |floor| quantity(floor, unit)),
            or_dash(error.ratio, |ratio| format!("{ratio:.2}")),
            or_dash(error.floor_check, interval),
        ];
        calibrated.iter().for_each(|all| row.insert(CALIBRATED, quantity(all[place].rms, unit)));
        row
    };
    table(caption, &header, 2, &errors.all.iter().enumerate().map(row).collect::<Vec<_>>())
}

pub(super) fn whiteness(errors: &[ChannelError]) -> Option<Markup> {
    let row = |error: &ChannelError| {
        let white = error.whiteness.as_ref()?;
        Some(vec![
            error.log.clone(),
            error.channel.to_owned(),
            format!("{} s", digits(white.interval_s)),
            format!("{:.3}", white.lag1),
            or_dash(white.correlation_time_s, |time_s| format!("{} s", digits(time_s))),
            format!("{} ({} lags)", chance(white.ljung_box.p_value), white.ljung_box.lags),
            chance(white.cumulative_periodogram.p_value),
            or_dash(white.period, |period| format!("{} s, {:.0} %", digits(period.period_s), period.share * 100.0)),
        ])
    };
    let rows: Vec<Vec<String>> = errors.iter().filter_map(row).collect();
    let header = ["log", "channel", "one row every", "lag-1 correlation", "lasts", "p, Ljung-Box", "p, periodogram", "period"];
    (!rows.is_empty()).then(|| {
        html! {
            (table("The residual's order in time, by log and channel", &header, 2, &rows))
            p.note { "Small p: the residual is not white, so something in its order in time is left to explain." }
        }
    })
}

/// Parameters of one effect that are shown: tables over charge have many.
const SIZES: usize = 2;

pub(super) fn evidence(evidence: &[Evidence]) -> Option<Markup> {
    let header = ["effect", "", "fall of BIC", "p", "expected size", "unique", "RMS", "held-out RMS"];
    let row = |effect: &Evidence| {
        let fall = |before: Option<f64>, after: Option<f64>| {
            let [before, after] = [before, after].map(|value| value.map(|value| quantity(value, &effect.unit)));
            match (before, after) {
                (Some(before), Some(after)) => format!("{before} \u{2192} {after}"),
                (before, _) => before.unwrap_or_else(|| "\u{2013}".to_owned()),
            }
        };
        let mut sizes: Vec<String> = effect
            .epc
            .iter()
            .take(SIZES)
            .map(|epc| {
                let value = with_sigma(epc.value, epc.sigma, unit_of(&epc.name)).replace("+-", "\u{b1}");
                if effect.epc.len() == 1 { value } else { format!("{} {value}", epc.name) }
            })
            .collect();
        if effect.epc.len() > SIZES {
            sizes.push(format!("{} more", effect.epc.len() - SIZES));
        }
        vec![
            effect.effect.clone(),
            if effect.accepted { "added".to_owned() } else { effect.refused.clone() },
            or_dash(effect.delta_bic, digits),
            or_dash(effect.p_value, chance),
            sizes.join("; "),
            or_dash(effect.uniqueness, |unique| format!("{unique:.2}")),
            fall(effect.rms_before, effect.rms_after),
            fall(effect.holdout_before, effect.holdout_after),
        ]
    };
    let rows: Vec<Vec<String>> = evidence.iter().map(row).collect();
    (!rows.is_empty()).then(|| {
        html! {
            (table("Effects that are not in the model, the strongest first", &header, 2, &rows))
            p.note { "Unique: how much of the effect the parameters already in the model cannot imitate, 0 to 1." }
        }
    })
}

pub(super) fn parameters(parameters: &[ParameterRow]) -> Option<Markup> {
    let row = |parameter: &ParameterRow| {
        vec![
            format!("{}.{}", parameter.effect, parameter.name),
            parameter.remark.clone(),
            or_dash(parameter.before, |before| quantity(before, &parameter.unit)),
            with_sigma(parameter.value, parameter.sigma, &parameter.unit).replace("+-", "\u{b1}"),
        ]
    };
    let rows: Vec<Vec<String>> = parameters.iter().map(row).collect();
    (!rows.is_empty()).then(|| table("Values with one standard deviation", &["parameter", "", "before", "value"], 2, &rows))
}

pub(super) fn files(files: &Files) -> Option<Markup> {
    let row = |file: &FileErrors| {
        let unit = unit_of(file.channel);
        vec![
            file.channel.to_owned(),
            if file.holdout { "held out" } else { "" }.to_owned(),
            if file.is_worse() { "worse" } else { "" }.to_owned(),
            quantity(file.given, unit),
            quantity(file.found, unit),
        ]
    };
    let rows: Vec<Vec<String>> = files.rows.iter().map(row).collect();
    (!rows.is_empty() || !files.left_out.is_empty()).then(|| {
        html! {
            @if !rows.is_empty() {
                (table("RMS of the files alone, as lab compare sees them", &["channel", "", "", "model given", "model found"], 3, &rows))
            }
            @if !files.warning.is_empty() { p { strong { (files.warning) } } }
            @if !files.left_out.is_empty() {
                p { (files.without) ":" }
                ul { @for one in &files.left_out { li { (one) } } }
            }
        }
    })
}

pub(super) fn decisions(decisions: &[DecisionRow]) -> Option<Markup> {
    let row = |decision: &DecisionRow| {
        let value = |value, sigma: Option<f64>| match sigma {
            Some(_) => with_sigma(value, sigma, &decision.unit).replace("+-", "\u{b1}"),
            None => quantity(value, &decision.unit),
        };
        let change = (decision.after - decision.before) / decision.before * 100.0;
        vec![
            decision.what.clone(),
            value(decision.before, decision.before_sigma),
            value(decision.after, decision.after_sigma),
            or_dash(Some(change).filter(|change| change.is_finite()), |change| format!("{change:+.1} %").replace('-', "\u{2212}")),
        ]
    };
    let rows: Vec<Vec<String>> = decisions.iter().map(row).collect();
    (!rows.is_empty()).then(|| table("What the coordinator would plan with", &["", "before", "after", "change"], 1, &rows))
}
