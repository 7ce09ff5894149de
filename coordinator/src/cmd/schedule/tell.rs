//! Schedule, capacity, explanation and events as text for people.

use comfy_table::{Cell, CellAlignment};
use energy::units::S_PER_H;
use proto::{Capacity, Event, Explanation, Mode, Promise, Quality, Schedule};

use crate::answers::mode_in_words;
use crate::cmd::{say_text, table, text};
use crate::web::number::{likely_of, short};
use crate::web::view::{by_station, whom};
use crate::when::second_from;

pub(in crate::cmd) fn show(schedule: &Schedule) {
    if !begin(schedule) {
        return;
    }
    let mut services = table();
    services.set_header(["robot", "status", "how", "where", "leave", "start", "end", "pack energy", "from"]);
    for service in &schedule.services {
        let how = match &service.mode {
            Mode::Recharge { to_soc } => format!("recharge to {:.0} %", to_soc * 100.0),
            Mode::Swap { spare } => format!("exchange for {spare}"),
        };
        let bay = service.bay.as_ref().map_or_else(String::new, |bay| format!(" {bay}"));
        services.add_row([
            service.robot.to_string(),
            service.status.to_string(),
            how,
            format!("{}{bay}", service.station),
            second_from(schedule.at, service.leave),
            second_from(schedule.at, service.start),
            second_from(schedule.at, service.end),
            format!("{:.1} ± {:.1} Wh", service.pack_energy_wh.value, service.pack_energy_wh.sigma),
            service.packs.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
        ]);
    }
    if schedule.services.is_empty() {
        say!("no service is planned");
    } else {
        say_text(&text(&services));
    }
    finish(schedule);
}

/// What stands above every form of a schedule; false when there is none.
pub(super) fn begin(schedule: &Schedule) -> bool {
    if schedule.plan == 0 {
        say!("no plan has been made yet: {}", schedule.trigger);
        return false;
    }
    say!("plan {} of {} by {} ({})", schedule.plan, schedule.at, schedule.policy, schedule.trigger);
    true
}

/// What stands below every form of a schedule.
pub(super) fn finish(schedule: &Schedule) {
    for unserved in &schedule.unserved {
        say!("unserved: {}: {}", unserved.robot, unserved.reasons.join("; "));
    }
    if let Some(quality) = &schedule.quality {
        say!("{}", in_words(quality));
    }
    for doubt in &schedule.doubts {
        say!("doubted: {}", doubt.text);
    }
}

fn in_words(quality: &Quality) -> String {
    let empty = |robots: u32| if robots == 1 { "1 robot runs empty".to_owned() } else { format!("{robots} robots run empty") };
    let stranded = match (quality.stranded, quality.stranded_bound) {
        (0, _) => "nobody runs empty".to_owned(),
        (robots, least) if robots == least => format!("{}, which no plan as sure can help", empty(robots)),
        (robots, 0) => format!("{}; it is not proven that anybody must", empty(robots)),
        (robots, least) => format!("{}; it is proven that at least {least} must", empty(robots)),
    };
    let missed = match quality.gap() {
        None => "not bounded".to_owned(),
        Some(gap) if gap < 1e-6 => "proven least".to_owned(),
        Some(gap) => format!("at most {:.1} % above the least", gap * 100.0),
    };
    let moved: Vec<String> = quality.moved.iter().map(ToString::to_string).collect();
    let moved = if moved.is_empty() { String::new() } else { format!("; moved: {}", moved.join(", ")) };
    format!("{stranded}; {:.1} h of work are missed, {missed}{moved}", quality.missed_s / S_PER_H)
}

pub(super) fn show_capacity(capacity: &Capacity) {
    say!("capacity as of {}", capacity.at);
    let confidence = capacity.confidence * 100.0;
    let wh = |estimate: proto::Estimate| format!("{:.1} ± {:.1} Wh", estimate.value, estimate.sigma);
    let mut packs = table();
    let at = format!("at {confidence:.0} %");
    packs.set_header(["station", "pack", "remaining", "usable", "one service", "robots expected", &at, "short for one more"]);
    let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
    for pack in &capacity.packs {
        packs.add_row([
            Cell::new(&pack.station),
            Cell::new(&pack.pack),
            Cell::new(wh(pack.remaining_wh)),
            Cell::new(wh(pack.usable_wh)),
            Cell::new(wh(pack.service_wh)),
            right(pack.robots_expected.to_string()),
            right(pack.robots_promised.to_string()),
            right(short(pack.short_for_next_wh, [pack.lacks_power, pack.lacks_bay, pack.lacks_spare, pack.lacks_right_temperature])),
        ]);
    }
    for station in capacity.stations.iter().filter(|station| capacity.packs_at(&station.station).count() > 1) {
        packs.add_row([
            Cell::new(&station.station),
            Cell::new("together"),
            Cell::new(""),
            Cell::new(wh(station.usable_wh)),
            Cell::new(""),
            right(station.robots_expected.to_string()),
            right(station.robots_promised.to_string()),
            right(short(
                station.short_for_next_wh,
                [station.lacks_power, station.lacks_bay, station.lacks_spare, station.lacks_right_temperature],
            )),
        ]);
    }
    say_text(&text(&packs));
    let robots = if capacity.robots_expected == 1 { "robot" } else { "robots" };
    say!("{} {robots} expected, {} at {confidence:.0} %", capacity.robots_expected, capacity.robots_promised);
    for pack in capacity.packs.iter().filter(|pack| !pack.promises.is_empty()) {
        say!("{} of {}: {}", pack.pack, pack.station, in_order(&pack.promises, pack.confidence));
    }
    for station in &capacity.stations {
        if capacity.packs_at(&station.station).count() > 1 && !station.promises.is_empty() {
            say!("{} with all its packs: {}", station.station, in_order(&station.promises, capacity.confidence));
        }
    }
    for (at, pack) in by_station(capacity) {
        let causes: Vec<String> = pack.breakdown_wh.iter().map(|(cause, wh)| format!("{cause} {wh:.1}")).collect();
        say!("where the energy of one service{at} goes (Wh): {}", causes.join(", "));
    }
}

/// "1 at > 99 % (explorer-2, 24.1 Wh), 2 at 97 % (+ explorer-1, 48.0 Wh), 3 at 40 % (+ one more, 71.9 Wh)": energy is of all together.
fn in_order(promises: &[Promise], asked: f64) -> String {
    let one = |(count, promise): (usize, &Promise)| {
        let plus = if count == 0 { "" } else { "+ " };
        let (sure, who) = (likely_of(promise.probability, asked), whom(promise));
        format!("{} at {sure} ({plus}{who}, {:.1} Wh)", count + 1, promise.need_wh.value)
    };
    promises.iter().enumerate().map(one).collect::<Vec<_>>().join(", ")
}

pub(super) fn show_explanation(explanation: &Explanation) {
    say!("{} at {}", explanation.robot, explanation.at);
    match &explanation.service {
        Some(service) => {
            let bay = service.bay.as_ref().map_or_else(String::new, |bay| format!(" {bay}"));
            say!(
                "  {} at {}{bay}, {} to {}",
                service.status,
                service.station,
                second_from(explanation.at, service.start),
                second_from(explanation.at, service.end)
            );
        }
        None => say!("  no service"),
    }
    for reason in &explanation.reasons {
        say!("  - {reason}");
    }
    for earlier in &explanation.earlier {
        say!("  earlier? {earlier}");
    }
    for doubt in &explanation.doubts {
        say!("  ! {}", doubt.text);
    }
    for alternative in &explanation.alternatives {
        let start = alternative
            .start
            .map_or_else(|| "not to be had".to_owned(), |start| format!("could begin {}", second_from(explanation.at, start)));
        let but = if alternative.why_not.is_empty() { String::new() } else { format!(": {}", alternative.why_not.join("; ")) };
        say!("  or {} at {}, {start}{but}", mode_in_words(&alternative.mode), alternative.station);
    }
    for changed in &explanation.changed {
        say!("  last change: {changed}");
    }
}

pub(super) fn show_event(event: &Event) {
    say!("{} {:<18} {}", event.at, event.kind.to_string(), event.text);
}
