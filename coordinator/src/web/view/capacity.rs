//! How many robots more the packs can service.

use proto::{Capacity, PackCapacity};
use serde::Serialize;

use super::Tone;
use crate::models::from_wire;
use crate::web::number::{Quantity, quantity};

/// The panel.
#[derive(Debug, Clone, Serialize)]
pub struct CapacityPanel {
    /// `3 more at 95 %`.
    pub headline: String,
    /// What to expect beside what is promised.
    pub note: String,
    /// Head of the column of promised services: `At 95 %`.
    pub certain: String,
    /// Pack by pack.
    pub packs: Vec<PackRow>,
    /// Where the energy of one service goes, the largest part first.
    pub causes: Vec<Cause>,
    /// What one service takes, all causes together.
    pub service: Option<Quantity>,
}

/// What one pack can pay for.
#[derive(Debug, Clone, Serialize)]
pub struct PackRow {
    /// `mds-1 pack-2`.
    pub label: String,
    /// Left in it.
    pub remaining: Quantity,
    /// Can go into services beyond those that have begun.
    pub usable: Quantity,
    /// What one service takes.
    pub service: Quantity,
    /// Services to expect.
    pub expected: u32,
    /// Services that hold with the confidence asked for.
    pub promised: u32,
    /// Lacking for one more: `2.5 Wh short of one more`.
    pub short: String,
    /// How it stands.
    pub tone: Tone,
}

/// A part of a service's energy.
#[derive(Debug, Clone, Serialize)]
pub struct Cause {
    /// What takes it.
    pub cause: String,
    /// How much, Wh: an expected value, whose deviation is in that of the whole.
    pub wh: f64,
    /// Its share of the whole, %.
    pub share: f64,
    /// Both in words: `13.1 Wh, 54 %`.
    pub number: String,
}

pub(super) fn panel(capacity: &Capacity) -> CapacityPanel {
    let percent = 100.0 * capacity.confidence;
    let note = match capacity.packs.is_empty() {
        true => "No pack has been heard yet.".to_owned(),
        false => format!(
            "{} to expect. Each pack by itself, beyond services that have begun; planned ones are among these.",
            capacity.robots_expected
        ),
    };
    CapacityPanel {
        headline: format!("{} more at {percent:.0} %", capacity.robots_promised),
        note,
        certain: format!("At {percent:.0} %"),
        packs: capacity.packs.iter().map(row).collect(),
        causes: capacity.packs.first().map_or_else(Vec::new, causes),
        service: capacity.packs.first().map(|pack| quantity(from_wire(pack.service_wh), "Wh")),
    }
}

fn row(pack: &PackCapacity) -> PackRow {
    PackRow {
        label: format!("{} {}", pack.station, pack.pack),
        remaining: quantity(from_wire(pack.remaining_wh), "Wh"),
        usable: quantity(from_wire(pack.usable_wh), "Wh"),
        service: quantity(from_wire(pack.service_wh), "Wh"),
        expected: pack.robots_expected,
        promised: pack.robots_promised,
        short: format!("{:.1} Wh", pack.short_for_next_wh),
        tone: if pack.robots_promised == 0 { Tone::Warn } else { Tone::Good },
    }
}

fn causes(pack: &PackCapacity) -> Vec<Cause> {
    let whole = pack.breakdown_wh.values().sum::<f64>().max(f64::MIN_POSITIVE);
    let cause = |(cause, &wh): (&String, &f64)| {
        let share = 100.0 * wh / whole;
        let words = cause.replace('_', " ");
        Cause { number: format!("{wh:.1} Wh, {share:.0} %"), cause: words, wh, share }
    };
    let mut causes: Vec<Cause> = pack.breakdown_wh.iter().map(cause).collect();
    causes.sort_by(|a, b| b.wh.total_cmp(&a.wh));
    causes
}
