//! Comparisons for people.

use comfy_table::Table;

use crate::compare::{ChannelError, Comparison, RegimeError};
use crate::floor::FloorCheck;

use super::quantity::{digits, quantity};
use super::table::{numbers_from, table, text};

/// Regimes that are printed for each channel; JSON holds all.
const PRINTED: usize = 4;

/// A comparison as people read it.
#[must_use]
pub fn human(comparison: &Comparison) -> String {
    let mut whole = format!("{}: observed minus predicted\n\n{}", comparison.model, text(&errors(comparison)));
    if comparison.errors.iter().any(|error| error.whiteness.is_some()) {
        whole += &format!("\n{}", text(&whiteness(&comparison.errors)));
    }
    let mut left_out: Vec<&str> = Vec::new();
    let mut regimes = table(&["channel", "by", "band", "rows", "RMS", "mean", "share of squared error"]);
    for (rank, bands) in ranked(&comparison.regimes) {
        if rank >= PRINTED {
            if !left_out.contains(&bands[0].dimension) {
                left_out.push(bands[0].dimension);
            }
            continue;
        }
        for error in bands {
            regimes.add_row([
                error.channel.to_owned(),
                error.dimension.to_owned(),
                error.band.clone(),
                error.size.rows.to_string(),
                quantity(error.size.rms, error.unit),
                quantity(error.size.mean, error.unit),
                format!("{:.0} %", error.share * 100.0),
            ]);
        }
    }
    numbers_from(&mut regimes, 3);
    if !comparison.regimes.is_empty() {
        whole += &format!("\n{}", text(&regimes));
    }
    if !left_out.is_empty() {
        whole += &format!("Not printed, as the error is spread more evenly there: by {} (--format json has all).\n", left_out.join(", "));
    }
    format!("{whole}\n{}\n", comparison.words.join("\n"))
}

fn errors(comparison: &Comparison) -> Table {
    let calibrated = comparison.left_by_calibration();
    let mut titles = vec!["log", "channel", "rows", "RMS", "mean", "max", "floor", "RMS/floor", "95 %"];
    titles.extend(calibrated.map(|_| "calibrated"));
    let mut overall = table(&titles);
    for (place, error) in comparison.errors.iter().enumerate() {
        let (size, unit) = (error.size, error.unit);
        let mut row = vec![
            error.log.clone(),
            error.channel.to_owned(),
            size.rows.to_string(),
            quantity(size.rms, unit),
            quantity(size.mean, unit),
            quantity(size.max_abs, unit),
            error.floor.map_or_else(|| "unknown".to_owned(), |floor| quantity(floor, unit)),
            error.ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.2}")),
            error.floor_check.map_or_else(String::new, interval),
        ];
        row.extend(calibrated.map(|all| quantity(all[place].rms, unit)));
        overall.add_row(row);
    }
    numbers_from(&mut overall, 2);
    overall
}

/// The interval of RMS over floor; too few independent rows give no upper end worth reading.
#[must_use]
pub fn interval(check: FloorCheck) -> String {
    if check.effective_rows < 3.0 {
        return format!("> {}", digits(check.ratio_low));
    }
    format!("{} .. {}", digits(check.ratio_low), digits(check.ratio_high))
}

fn whiteness(errors: &[ChannelError]) -> Table {
    let mut rows = table(&["log", "channel", "every", "lag 1", "lasts", "Ljung-Box p", "periodogram p", "period"]);
    for error in errors {
        let Some(white) = &error.whiteness else { continue };
        let period = white.period.map(|period| format!("{} s ({:.0} %)", digits(period.period_s), period.share * 100.0));
        rows.add_row([
            error.log.clone(),
            error.channel.to_owned(),
            format!("{} s", digits(white.interval_s)),
            format!("{:.3}", white.lag1),
            white.correlation_time_s.map_or_else(|| "-".to_owned(), |time| format!("{} s", digits(time))),
            format!("{} ({} lags)", chance(white.ljung_box.p_value), white.ljung_box.lags),
            chance(white.cumulative_periodogram.p_value),
            period.unwrap_or_else(|| "-".to_owned()),
        ]);
    }
    numbers_from(&mut rows, 2);
    rows
}

/// A p-value: small ones need no digits.
#[must_use]
pub fn chance(p_value: f64) -> String {
    if p_value < 1e-4 { "< 0.0001".to_owned() } else { format!("{p_value:.4}") }
}

/// The regimes of every channel, each with its rank among that channel's: where the error is
/// spread least like the rows comes first.
#[must_use]
pub fn ranked(regimes: &[RegimeError]) -> Vec<(usize, &[RegimeError])> {
    let uneven = |bands: &[RegimeError]| bands.iter().map(|band| (band.share - band.share_of_rows).max(0.0)).sum::<f64>();
    let mut all = Vec::new();
    for channel in regimes.chunk_by(|a, b| a.channel == b.channel) {
        let mut own: Vec<&[RegimeError]> = channel.chunk_by(|a, b| a.dimension == b.dimension).collect();
        own.sort_by(|a, b| uneven(b).total_cmp(&uneven(a)));
        all.extend(own.into_iter().enumerate());
    }
    all
}
