//! What Prometheus reads: names and units by its conventions (base units, `_total` for counters).
//!
//! Gauges are made anew from the core at every scrape, so nothing is counted twice and a robot that
//! is gone is gone here too.

use energy::Estimate;
use energy::units::S_PER_H;
use prometheus::{Encoder as _, GaugeVec, IntCounterVec, Opts, Registry, TextEncoder};
use proto::{RobotPhase, ServiceStatus, Timestamp};

use super::past::Past;
use crate::core::Core;
use crate::models::from_wire;
use crate::store::Standing;

/// What the metrics' text is, for HTTP.
pub const CONTENT_TYPE: &str = prometheus::TEXT_FORMAT;

/// Every phase, so that one that nobody is in counts as zero.
const PHASES: [RobotPhase; 8] = [
    RobotPhase::Working,
    RobotPhase::Travelling,
    RobotPhase::Waiting,
    RobotPhase::Docked,
    RobotPhase::Charging,
    RobotPhase::Charged,
    RobotPhase::Swapping,
    RobotPhase::Stranded,
];

/// One page of metrics.
#[derive(Default)]
struct Sheet {
    registry: Registry,
}

impl Sheet {
    fn gauges(&self, name: &str, help: &str, labels: &[&str]) -> GaugeVec {
        let gauges = GaugeVec::new(Opts::new(name, help), labels).expect("names here are valid");
        self.registry.register(Box::new(gauges.clone())).expect("names here differ");
        gauges
    }

    fn counters(&self, name: &str, help: &str, labels: &[&str]) -> IntCounterVec {
        let counters = IntCounterVec::new(Opts::new(name, help), labels).expect("names here are valid");
        self.registry.register(Box::new(counters.clone())).expect("names here differ");
        counters
    }

    fn text(&self) -> String {
        let mut text = Vec::new();
        TextEncoder::new().encode(&self.registry.gather(), &mut text).expect("memory can be written to");
        String::from_utf8(text).expect("the encoder writes text")
    }
}

/// A value and its sigma under the same labels: `kind` tells which.
fn set(gauges: &GaugeVec, labels: &[&str], estimate: Estimate, factor: f64) {
    for (kind, value) in [("value", estimate.value), ("sigma", estimate.sigma)] {
        let labels: Vec<&str> = labels.iter().copied().chain([kind]).collect();
        gauges.with_label_values(&labels).set(factor * value);
    }
}

/// All metrics of a coordinator, as text.
#[must_use]
pub fn text(now: Timestamp, core: &Core, past: &Past, store: Option<&Standing>) -> String {
    let sheet = Sheet::default();
    let build = sheet.gauges("tender_build_info", "The running program; always 1.", &["version"]);
    build.with_label_values(&[env!("CARGO_PKG_VERSION")]).set(1.0);
    robots(&sheet, core);
    packs(&sheet, core);
    decisions(&sheet, now, core);
    if let Some(standing) = store {
        kept(&sheet, standing);
    }
    let events = sheet.counters("tender_events_total", "Events since the coordinator started, by kind.", &["kind"]);
    for (kind, count) in &past.counts {
        events.with_label_values(&[&kind.to_string()]).inc_by(*count);
    }
    sheet.text()
}

fn kept(sheet: &Sheet, standing: &Standing) {
    let writable = sheet.gauges("tender_store_writable", "Whether what happens can be written to the store: 1 or 0.", &[]);
    writable.with_label_values::<&str>(&[]).set(f64::from(u8::from(standing.failing.is_none())));
    let waiting = sheet.gauges("tender_store_waiting_records", "Records that wait to be written to the store.", &[]);
    waiting.with_label_values::<&str>(&[]).set(standing.waiting as f64);
    let dropped = sheet.counters("tender_store_dropped_records_total", "Records that were never written to the store.", &[]);
    dropped.with_label_values::<&str>(&[]).inc_by(standing.dropped);
}

fn robots(sheet: &Sheet, core: &Core) {
    let by_phase = sheet.gauges("tender_robots", "Robots heard and not lost, by what they do.", &["phase"]);
    for phase in PHASES {
        let here = core.fleet().robots.values().filter(|robot| !robot.is_lost() && robot.phase() == Some(phase)).count();
        by_phase.with_label_values(&[&phase.to_string()]).set(here as f64);
    }
    let lost = sheet.gauges("tender_robots_lost", "Robots that have spoken and are no longer heard.", &[]);
    lost.with_label_values::<&str>(&[]).set(core.fleet().robots.values().filter(|robot| robot.is_lost()).count() as f64);
    let soc = sheet.gauges("tender_robot_charge_ratio", "State of charge of a robot's battery, 0 to 1.", &["robot", "kind"]);
    let left = sheet.gauges("tender_robot_remaining_energy_joules", "Energy left in a robot's battery.", &["robot", "kind"]);
    let empty = sheet.gauges("tender_robot_time_to_empty_seconds", "Time until a robot is empty at its recent load.", &["robot", "kind"]);
    for (id, robot) in &core.fleet().robots {
        let Some((gauge, _)) = robot.known() else { continue };
        let id = [id.as_ref()];
        set(&soc, &id, from_wire(gauge.soc), 1.0);
        set(&left, &id, from_wire(gauge.remaining_wh), S_PER_H);
        if let Some(time_s) = gauge.time_to_empty_s {
            set(&empty, &id, from_wire(time_s), 1.0);
        }
    }
}

fn packs(sheet: &Sheet, core: &Core) {
    let powered = sheet.gauges("tender_station_powered", "Whether a station's bays have power: 1 or 0.", &["station"]);
    let lost = sheet.gauges("tender_stations_lost", "Stations that have spoken and are no longer heard.", &[]);
    lost.with_label_values::<&str>(&[]).set(core.fleet().stations.values().filter(|station| station.is_lost()).count() as f64);
    let labels = ["station", "pack", "kind"];
    let soc = sheet.gauges("tender_pack_charge_ratio", "State of charge of a station's pack, 0 to 1.", &labels);
    let left = sheet.gauges("tender_pack_remaining_energy_joules", "Energy left in a station's pack.", &labels);
    for (id, station) in &core.fleet().stations {
        let Some(state) = station.known() else { continue };
        powered.with_label_values(&[id.as_ref()]).set(f64::from(u8::from(state.powered)));
        for pack in state.packs.iter().filter(|pack| pack.connected) {
            let labels = [id.as_ref(), pack.pack.as_ref()];
            let gauge = &station.packs[&pack.pack];
            set(&soc, &labels, from_wire(gauge.soc), 1.0);
            set(&left, &labels, from_wire(gauge.remaining_wh), S_PER_H);
        }
    }
}

fn decisions(sheet: &Sheet, now: Timestamp, core: &Core) {
    let schedule = core.schedule();
    let plans = sheet.gauges("tender_plan_number", "Number of the plan in force.", &[]);
    plans.with_label_values::<&str>(&[]).set(schedule.plan as f64);
    let age = sheet.gauges("tender_plan_age_seconds", "Time since the plan in force was made; absent before the first.", &[]);
    if schedule.plan > 0 {
        age.with_label_values::<&str>(&[]).set(now.seconds_since(schedule.at));
    }
    let services = sheet.gauges("tender_services", "Services of the plan in force, by how far they have come.", &["status"]);
    use ServiceStatus as S;
    for status in [S::Planned, S::Travelling, S::Waiting, S::Loading, S::Charging, S::Swapping, S::Unloading] {
        let here = schedule.services.iter().filter(|service| service.status == status).count();
        services.with_label_values(&[&status.to_string()]).set(here as f64);
    }
    let unserved = sheet.gauges("tender_robots_unserved", "Robots that need a service and get none in this plan.", &[]);
    unserved.with_label_values::<&str>(&[]).set(schedule.unserved.iter().filter(|unserved| unserved.runs_empty).count() as f64);
    let doubts = sheet.gauges("tender_models_doubted", "Energy models that no longer explain what is measured.", &[]);
    doubts.with_label_values::<&str>(&[]).set(schedule.doubts.len() as f64);
    let capacity = core.capacity(now);
    let more = sheet.gauges("tender_further_services", "Further services that the packs can pay for: promised or expected.", &["kind"]);
    more.with_label_values(&["promised"]).set(f64::from(capacity.robots_promised));
    more.with_label_values(&["expected"]).set(f64::from(capacity.robots_expected));
    let labels = ["station", "pack", "kind"];
    let usable =
        sheet.gauges("tender_pack_usable_energy_joules", "Energy of a pack that can go into services beyond those begun.", &labels);
    let service = sheet.gauges("tender_pack_service_energy_joules", "Energy that one more service takes from a pack.", &labels);
    for pack in &capacity.packs {
        let labels = [pack.station.as_ref(), pack.pack.as_ref()];
        set(&usable, &labels, from_wire(pack.usable_wh), S_PER_H);
        set(&service, &labels, from_wire(pack.service_wh), S_PER_H);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Failing;

    #[test]
    fn a_store_that_cannot_be_written_is_one_that_an_alert_sees() {
        let told = |standing: &Standing| {
            let sheet = Sheet::default();
            kept(&sheet, standing);
            let text = sheet.text();
            let values = text.lines().filter(|line| !line.starts_with('#'));
            values.map(str::to_owned).collect::<Vec<_>>()
        };
        let failing = Some(Failing { since: Timestamp::from_unix_ms(0), why: "full".to_owned() });
        let names = ["tender_store_dropped_records_total", "tender_store_waiting_records", "tender_store_writable"];
        let lines = |values: [u32; 3]| names.iter().zip(values).map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>();
        assert_eq!(told(&Standing { failing, waiting: 7, dropped: 2 }), lines([2, 7, 0]));
        assert_eq!(told(&Standing::default()), lines([0, 0, 1]));
    }
}
