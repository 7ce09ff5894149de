//! The error by regime as bars.

use crate::compare::RegimeError;
use crate::report::comparison::ranked;
use crate::report::quantity::quantity;

use super::axis::title_of;
use super::bars::{Bars, Row};
use super::svg::Ink;

/// Regimes that are drawn for each channel: those over which the error is spread least evenly.
const DRAWN: usize = 5;

/// One chart for each channel and regime: the share of the squared error beside the share of the
/// rows, with the RMS in words.
#[must_use]
pub fn charts(regimes: &[RegimeError]) -> Vec<Bars> {
    ranked(regimes).into_iter().filter(|(rank, _)| *rank < DRAWN).map(|(_, bands)| chart(bands)).collect()
}

fn chart(bands: &[RegimeError]) -> Bars {
    let row = |band: &RegimeError| Row {
        name: band.band.clone(),
        bars: vec![(band.share, Ink::Residual, format!("{:.0} %, RMS {}", band.share * 100.0, quantity(band.size.rms, band.unit)))],
        mark: Some(band.share_of_rows),
    };
    let (channel, dimension) = (title_of(bands[0].channel), bands[0].dimension);
    Bars {
        title: format!("Error of {channel} by {dimension}"),
        legend: vec![(Ink::Residual, "share of squared error".to_owned())],
        mark: "share of rows".to_owned(),
        rows: bands.iter().map(row).collect(),
        // A whole bar is all of the error, in every chart.
        full: 1.0,
    }
}
