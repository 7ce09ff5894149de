//! What energy models know as it goes on the wire.

use energy::gauge::{Reading, Sample};
use proto::{Gauge, Message as _, Timestamp};

/// The same value and deviation, as a message carries it.
#[must_use]
pub fn wire(estimate: energy::Estimate) -> proto::Estimate {
    proto::Estimate::new(estimate.value, estimate.sigma)
}

/// A gauge's reading, with the sample that it was last fed, as a message.
#[must_use]
pub fn gauge_message(at: Timestamp, seq: u64, sample: &Sample, reading: &Reading, cells_series: u32, source: &str) -> Gauge {
    Gauge {
        at,
        seq,
        soc: wire(reading.soc),
        remaining_wh: wire(reading.remaining_wh),
        full_wh: wire(reading.full_wh),
        time_to_empty_s: reading.time_to_empty_s.map(wire),
        time_to_full_s: reading.time_to_full_s.map(wire),
        soh: wire(reading.soh),
        cycles: Some(reading.cycles),
        voltage_v: sample.voltage_v,
        current_a: sample.current_a,
        temperature_degc: sample.temperature_degc,
        power_w: reading.power_w,
        cells_series,
        source: source.to_owned(),
    }
}

/// Why a gauge's message is not sent, for nobody would take it: a battery that cannot deliver what is said to flow, say.
#[must_use]
pub fn why_senseless(message: &Gauge) -> Option<String> {
    message.validate().err().map(|error| format!("the gauge makes no sense of what is measured: {error}"))
}
