//! How many robots more the packs can service.

use proto::{Capacity, PackCapacity, Promise, StationCapacity};
use serde::Serialize;

use super::Tone;
use crate::models::from_wire;
use crate::web::number::{Quantity, likely_of, quantity, short};

/// A promise beyond this needs no number of its own when the next is as good.
const SURE: f64 = 0.995;

/// The panel.
#[derive(Debug, Clone, Serialize)]
pub struct CapacityPanel {
    /// `3 more at 95 %`.
    pub headline: String,
    /// What to expect beside what is promised.
    pub note: String,
    /// Head of the column of promised services: `At 95 %`.
    pub certain: String,
    /// Pack by pack; after the last of a station that has several, all of them together.
    pub packs: Vec<PackRow>,
    /// Where the energy of one service goes, station by station where that differs.
    pub breakdowns: Vec<Breakdown>,
}

/// Where the energy of one service goes.
#[derive(Debug, Clone, Serialize)]
pub struct Breakdown {
    /// What one service takes and where: `Where the energy of one service at mds-1 goes: 24.1 ± 0.5 Wh`.
    pub title: String,
    /// By cause, the largest part first.
    pub causes: Vec<Cause>,
}

/// What one pack can pay for.
#[derive(Debug, Clone, Serialize)]
pub struct PackRow {
    /// `mds-1 pack-2`, or `mds-1 together`.
    pub label: String,
    /// Can go into services beyond those that have begun.
    pub usable: Quantity,
    /// What one service takes; none for packs together.
    pub service: Option<Quantity>,
    /// Services to expect.
    pub expected: u32,
    /// Services that hold with the confidence asked for.
    pub promised: u32,
    /// Lacking for one more: `2.5 Wh`.
    pub short: String,
    /// How certainly it does for how many: `3 at > 99 %, 4 at 23 %`.
    pub odds: String,
    /// Which robots these are: `1: explorer-3, 2: one more`.
    pub who: String,
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
        packs: rows(capacity),
        breakdowns: by_station(capacity).into_iter().map(|(at, pack)| breakdown(&at, pack)).collect(),
    }
}

fn breakdown(at: &str, pack: &PackCapacity) -> Breakdown {
    let service = quantity(from_wire(pack.service_wh), "Wh");
    Breakdown { title: format!("Where the energy of one service{at} goes: {}", service.text), causes: causes(pack) }
}

/// One pack of each station, as a service takes as much from any other there, and at which stations that is so: ` at mds-1, mds-2`,
/// or nothing where there is one station only.
pub(crate) fn by_station(capacity: &Capacity) -> Vec<(String, &PackCapacity)> {
    let mut found: Vec<(Vec<&str>, &PackCapacity)> = Vec::new();
    for pack in &capacity.packs {
        if found.iter().any(|(stations, _)| stations.contains(&pack.station.as_str())) {
            continue;
        }
        match found.iter_mut().find(|(_, other)| are_alike(other, pack)) {
            Some((stations, _)) => stations.push(pack.station.as_str()),
            None => found.push((vec![pack.station.as_str()], pack)),
        }
    }
    let is_alone = matches!(&found[..], [(stations, _)] if stations.len() == 1);
    let at = |stations: Vec<&str>| if is_alone { String::new() } else { format!(" at {}", stations.join(", ")) };
    found.into_iter().map(|(stations, pack)| (at(stations), pack)).collect()
}

/// Whether a service takes the same from both, as far as it is printed.
fn are_alike(one: &PackCapacity, other: &PackCapacity) -> bool {
    let printed = |pack: &PackCapacity| -> Vec<(String, String)> {
        pack.breakdown_wh.iter().map(|(cause, wh)| (cause.clone(), format!("{wh:.1}"))).collect()
    };
    let service = |pack: &PackCapacity| quantity(from_wire(pack.service_wh), "Wh").text;
    printed(one) == printed(other) && service(one) == service(other)
}

/// Packs, station by station.
fn rows(capacity: &Capacity) -> Vec<PackRow> {
    let mut rows: Vec<PackRow> = Vec::new();
    let mut told = Vec::new();
    for station in &capacity.stations {
        let before = rows.len();
        rows.extend(capacity.packs.iter().filter(|pack| pack.station == station.station).map(row));
        if rows.len() > before + 1 {
            rows.push(together(station, capacity.confidence));
        }
        told.push(&station.station);
    }
    rows.extend(capacity.packs.iter().filter(|pack| !told.contains(&&pack.station)).map(row));
    rows
}

fn row(pack: &PackCapacity) -> PackRow {
    PackRow {
        label: format!("{} {}", pack.station, pack.pack),
        usable: quantity(from_wire(pack.usable_wh), "Wh"),
        service: Some(quantity(from_wire(pack.service_wh), "Wh")),
        expected: pack.robots_expected,
        promised: pack.robots_promised,
        short: short(pack.short_for_next_wh, [pack.lacks_power, pack.lacks_bay, pack.lacks_spare, pack.lacks_right_temperature]),
        odds: odds(&pack.promises, pack.confidence),
        who: who(&pack.promises),
        tone: tone(pack.robots_promised),
    }
}

fn together(station: &StationCapacity, confidence: f64) -> PackRow {
    PackRow {
        label: format!("{} together", station.station),
        usable: quantity(from_wire(station.usable_wh), "Wh"),
        service: None,
        expected: station.robots_expected,
        promised: station.robots_promised,
        short: short(
            station.short_for_next_wh,
            [station.lacks_power, station.lacks_bay, station.lacks_spare, station.lacks_right_temperature],
        ),
        odds: odds(&station.promises, confidence),
        who: who(&station.promises),
        tone: tone(station.robots_promised),
    }
}

fn tone(promised: u32) -> Tone {
    if promised == 0 { Tone::Warn } else { Tone::Good }
}

/// Up to which number of services there is hardly a doubt, and how certain those after it are.
fn odds(promises: &[Promise], asked: f64) -> String {
    let sure = promises.iter().take_while(|promise| promise.probability > SURE).count();
    let from = sure.saturating_sub(1);
    let one = |(before, promise): (usize, &Promise)| format!("{} at {}", before + 1, likely_of(promise.probability, asked));
    promises.iter().enumerate().skip(from).map(one).collect::<Vec<_>>().join(", ")
}

/// The robot that each of them would be.
fn who(promises: &[Promise]) -> String {
    let one = |(before, promise): (usize, &Promise)| format!("{}: {}", before + 1, whom(promise));
    promises.iter().enumerate().map(one).collect::<Vec<_>>().join(", ")
}

/// Whom a service is for; who gets less than the usual charge is told with how much: `explorer-1 to 63 %`.
pub(crate) fn whom(promise: &Promise) -> String {
    let robot = promise.robot.as_ref().map_or_else(|| "one more".to_owned(), ToString::to_string);
    promise.part_to_soc.map_or_else(|| robot.clone(), |to_soc| format!("{robot} to {:.0} %", 100.0 * to_soc))
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

#[cfg(test)]
mod tests {
    use proto::{Estimate, Timestamp};

    use super::*;

    fn pack(station: &str, pack: &str, conversion_wh: f64) -> PackCapacity {
        PackCapacity {
            station: station.parse().unwrap(),
            pack: pack.parse().unwrap(),
            remaining_wh: Estimate::new(80.0, 1.0),
            usable_wh: Estimate::new(70.0, 1.0),
            service_wh: Estimate::new(12.0 + conversion_wh, 0.5),
            breakdown_wh: [("conversion".to_owned(), conversion_wh), ("robot_battery".to_owned(), 12.0)].into(),
            robots_expected: 3,
            robots_promised: 2,
            confidence: 0.95,
            short_for_next_wh: 1.0,
            lacks_power: false,
            lacks_bay: false,
            lacks_spare: false,
            lacks_right_temperature: false,
            promises: Vec::new(),
        }
    }

    fn titles(packs: Vec<PackCapacity>) -> Vec<String> {
        let at = Timestamp::from_unix_ms(0);
        let capacity = Capacity { at, packs, stations: Vec::new(), robots_expected: 0, robots_promised: 0, confidence: 0.95 };
        panel(&capacity).breakdowns.into_iter().map(|breakdown| breakdown.title).collect()
    }

    #[test]
    fn where_energy_goes_is_told_of_each_station_where_it_differs() {
        let of_one = titles(vec![pack("north", "p1", 2.0), pack("north", "p2", 2.0)]);
        assert_eq!(of_one, ["Where the energy of one service goes: 14.00 ± 0.50 Wh"]);
        let (north, south, west) = (pack("north", "p1", 2.0), pack("south", "p1", 3.0), pack("west", "p1", 2.01));
        assert_eq!(
            titles(vec![north, south, west]),
            [
                "Where the energy of one service at north goes: 14.00 ± 0.50 Wh",
                "Where the energy of one service at south goes: 15.00 ± 0.50 Wh",
                "Where the energy of one service at west goes: 14.01 ± 0.50 Wh"
            ]
        );
        let alike = titles(vec![pack("north", "p1", 2.0), pack("south", "p1", 2.0)]);
        assert_eq!(alike, ["Where the energy of one service at north, south goes: 14.00 ± 0.50 Wh"]);
    }
}
