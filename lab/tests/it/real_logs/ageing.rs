//! What a battery loses over cycles and months.

use super::rows::{Csv, battery, drawn_ah, table, write};
use super::{Set, cells::FREE, real};

/// NASA B0025: discharges by a square wave of 4 A, ten seconds on and ten off, which the log samples once each. The table is the
/// rests of ten seconds of the first discharge.
fn nasa_cycles(name: &'static str, train: &[&str], holdout: &[&str]) -> Option<Set> {
    let csv = Csv::read(&real("nasa_pcoe_18650_2ah")?.join("b0025_selected_cycles.csv"));
    let all = battery(&csv);
    let cycle = |index: &str| {
        let wanted = |place: &usize| csv.text(&csv.cells[*place], "op") == "discharge" && csv.text(&csv.cells[*place], "index") == index;
        let rows: Vec<_> = (0..all.len()).filter(wanted).map(|place| all[place]).collect();
        let end = rows.iter().rposition(|row| row.current_a > 1.0).unwrap();
        rows[..=end].to_vec()
    };
    let first = cycle("0");
    let drawn = drawn_ah(&first);
    let capacity_ah = drawn[drawn.len() - 1];
    let rests = (0..first.len()).filter(|&place| first[place].current_a.abs() < 0.1).step_by(3);
    let rests = rests.map(|place| (1.0 - drawn[place] / capacity_ah, first[place].voltage_v)).collect();
    let model = format!(
        "schema = 1\nsystem = \"battery\"\nname = \"nasa-b0025\"\nsource = \"NASA PCoE battery data set\"\n\
         [battery]\nseries = 1\nparallel = 1\ncapacity_ah = {capacity_ah:.4}\nfull_v_per_cell = 4.2\neod_v_per_cell = 2.0\n\
         charge_current_a = 1.5\ncharge_cutoff_a = 0.02\n{}[sensor.voltage_v]\nsigma = 1e-3\n[sensor.current_a]\nsigma = 2e-3\n\
         [uncertainty]\nocv_sigma_v = 5e-3\nsoc_initial_sigma = 5e-3\ncapacity_relative_sigma = 0.01\n{FREE}",
        table(rests)
    );
    let mut set = Set::new(name, &model);
    for (list, indices) in [(0, train), (1, holdout)] {
        for index in indices {
            let rows = cycle(index);
            let drawn = drawn_ah(&rows);
            // The last 3 % of its charge, where the table ends in rests that were never taken.
            let counts = 0.97 * drawn[drawn.len() - 1];
            let cells: Vec<Vec<f64>> = rows
                .iter()
                .zip(drawn)
                .map(|(row, drawn)| {
                    let voltage_v = if drawn < counts { row.voltage_v } else { f64::NAN };
                    vec![row.time_s, row.current_a, voltage_v, row.temperature_degc, index.parse().unwrap()]
                })
                .collect();
            let columns = "time_s,current_a,voltage_v,temperature_degc,cycle_count";
            let log = write(set.directory.path(), &format!("discharge{index}"), columns, &cells, "soc_initial = 1.0\n");
            if list == 0 { set.train.push(log) } else { set.holdout.push(log) }
        }
    }
    set.flags = &["--target", "voltage_v"];
    Some(set)
}

pub fn nasa() -> Option<Set> {
    nasa_cycles("nasa B0025, first discharge; the next held out", &["0"], &["1"])
}

pub fn nasa_over_cycles() -> Option<Set> {
    nasa_cycles("nasa B0025, discharges 0, 10 and 27; 20 held out", &["0", "10", "27"], &["20"])
}

#[test]
fn a_square_wave_shows_how_resistance_goes_with_charge() {
    let Some(set) = nasa() else { return };
    let answer = set.discover();
    assert!(answer.names_any(&["ohmic_soc"]), "{}", answer.json["selected"]);
    // Another program on one discharge: R0 6.6 mV, R over SoC 1.8, two pairs 1.0.
    let ((_, after), (_, held_out)) = (answer.train(), answer.held_out());
    assert!(after < 1.8e-3 && held_out < 5e-3, "{after} {held_out}");
}

/// The cycler counted 1.847 Ah at first and 1.768 Ah at last, over all of the set's discharges.
#[test]
fn capacity_fades_over_the_discharges_of_a_month() {
    let Some(set) = nasa_over_cycles() else { return };
    let answer = set.discover();
    assert!(answer.names_any(&["capacity_fade"]), "{}", answer.json["selected"]);
    let (before, after) = answer.held_out();
    assert!(after < 0.7 * before, "{before} {after}");
}

/// GoPi5Go, a robot that docks by itself when its pack falls to 9.9 V: the median play of each week of five months, and one discharge
/// down to 9 V that was logged all the way and gives the table. Nobody measured the current: one ampere stands for it, and charge is
/// counted in hours of it.
pub fn gopi5go() -> Option<Set> {
    let folder = real("gopi5go_docking_3s_liion_robot")?;
    let full = Csv::read(&folder.join("full_discharge_2024-04-02.csv"));
    // The first readings are those of a pack that comes from the charger.
    let (time_s, voltage_v) = (full.numbers("time_s"), full.numbers("voltage_v"));
    let whole_s = time_s[time_s.len() - 1];
    let places: Vec<usize> = (3..time_s.len()).step_by(40).chain([time_s.len() - 1]).collect();
    let points = places.iter().map(|&place| (1.0 - time_s[place] / whole_s, voltage_v[place] / 3.0)).collect();
    let model = format!(
        "schema = 1\nsystem = \"battery\"\nname = \"gopi5go\"\nsource = \"github slowrunner/GoPi5Go (MIT)\"\n\
         [battery]\nseries = 3\nparallel = 1\ncapacity_ah = {:.4}\nfull_v_per_cell = 4.2\neod_v_per_cell = 2.7\n\
         charge_current_a = 1.5\ncharge_cutoff_a = 0.05\n{}[sensor.voltage_v]\nsigma = 0.03\nquantum = 0.1\n[sensor.current_a]\nsigma = 0.03\n\
         [uncertainty]\nocv_sigma_v = 1e-2\nsoc_initial_sigma = 2e-2\ncapacity_relative_sigma = 0.03\n[[effect]]\nid = \"ohmic\"\n\
         resistance_ohm = {{ value = 0.0, sigma = 0.02, source = \"the table was taken at the same load\" }}\n",
        whole_s / 3600.0,
        table(points)
    );
    let mut set = Set::new("gopi5go, every second week held out", &model);
    let columns = "time_s,current_a,voltage_v,age_days,cycle_count";
    let rows: Vec<Vec<f64>> = (3..time_s.len()).step_by(10).map(|place| vec![time_s[place], 1.0, voltage_v[place], 0.0, 0.0]).collect();
    let soc_initial = 1.0 - time_s[3] / whole_s;
    set.train.push(write(set.directory.path(), "full", columns, &rows, &format!("soc_initial = {soc_initial:.5}\n")));
    for (week, mut plays) in plays(&Csv::read(&folder.join("dock_events.csv"))).into_iter().enumerate() {
        plays.sort_by(|a, b| a.hours.total_cmp(&b.hours));
        let Some(play) = plays.get(plays.len() / 2) else { continue };
        let row = |part: u32, voltage_v: f64| {
            let current_a = if part == 0 { 0.0 } else { 1.0 };
            vec![play.hours * 900.0 * f64::from(part), current_a, voltage_v, play.age_days, play.cycles]
        };
        let rows: Vec<Vec<f64>> = (0..4).map(|part| row(part, f64::NAN)).chain([row(4, play.voltage_v)]).collect();
        let log = write(set.directory.path(), &format!("week{week:02}"), columns, &rows, "soc_initial = 1.0\n");
        if week % 2 == 0 { set.train.push(log) } else { set.holdout.push(log) }
    }
    Some(set)
}

/// A time between leaving the dock and coming back to it.
struct Play {
    hours: f64,
    voltage_v: f64,
    age_days: f64,
    cycles: f64,
}

/// The plays of each week. The logger says 0.0 or 23.6 h after reboots, and plays end early: only those count whose duration is what
/// the clock says, after a charge of a usual length that ended at the usual voltage.
fn plays(csv: &Csv) -> Vec<Vec<Play>> {
    let mut weeks: Vec<Vec<Play>> = Vec::new();
    let mut first_s = None;
    for pair in csv.cells.windows(2) {
        let is = |row: &[String], event: &str| csv.text(row, "event") == event && csv.text(row, "result") == "success";
        let number = |place: usize, name: &str| csv.number(&pair[place], name);
        let (hours, charged_h) = (number(1, "phase_hours"), number(0, "phase_hours"));
        let clock_h = (number(1, "time_s") - number(0, "time_s")) / 3600.0;
        let usual = (hours - clock_h).abs() < 0.15 && (1.0..4.3).contains(&hours) && (2.0..=4.0).contains(&charged_h);
        if !(is(&pair[0], "undock") && is(&pair[1], "dock") && usual && (number(0, "voltage_v") - 12.13).abs() < 0.1) {
            continue;
        }
        let (time_s, docking) = (number(1, "time_s"), number(1, "docking_number"));
        let (first_s, first_docking) = *first_s.get_or_insert((time_s, docking));
        let week = ((time_s - first_s) / 604_800.0) as usize;
        weeks.resize_with(weeks.len().max(week + 1), Vec::new);
        // The first of them is three weeks after the discharge that gives the table.
        let age_days = 21.0 + (time_s - first_s) / 86_400.0;
        weeks[week].push(Play { hours, voltage_v: number(1, "voltage_v"), age_days, cycles: docking - first_docking });
    }
    weeks
}

#[test]
fn a_robots_play_time_falls_as_its_pack_fades() {
    let Some(set) = gopi5go() else { return };
    let answer = set.discover();
    assert!(answer.names_any(&["calendar_fade", "capacity_fade"]), "{}", answer.json["selected"]);
    let (before, after) = answer.held_out();
    assert!(after < 0.3 * before, "{before} {after}");
}
