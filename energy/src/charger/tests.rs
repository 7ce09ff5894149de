use std::sync::Arc;

use super::*;
use crate::{Run, Start, load_model};

fn explorer(soc: f64) -> Run<f64> {
    let model = load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap();
    Run::new(Arc::new(model), Start::at_soc(soc))
}

/// Charges until the charger is done or `hours` are over; gives the hours and the last stage.
fn charged(run: &mut Run<f64>, charger: &Charger, around: &Surroundings, hours: f64) -> (f64, Stage) {
    let (mut charging, mut seconds) = (charger.begin(), 0.0);
    while charging.stage != Stage::Done && seconds < hours * 3600.0 {
        charger.step(&mut charging, run, around, 5.0);
        seconds += 5.0;
    }
    (seconds / 3600.0, charging.stage)
}

fn around(own_load_w: f64) -> Surroundings {
    Surroundings { request: request(explorer(0.0).model().battery(), true), series: 3, own_load_w, output_w_max: f64::INFINITY }
}

#[test]
fn a_charge_at_1c_is_constant_current_for_most_of_its_charge_and_ends_at_a_twentieth() {
    let mut run = explorer(0.0);
    let charger = Charger::for_pack(run.model().battery(), PowerPath::Selected);
    let (hours, stage) = charged(&mut run, &charger, &around(0.0), 5.0);
    assert_eq!(stage, Stage::Done);
    // Makers of LiCoO2 cells state 2.5 h for a standard charge at 0.5C to C/20, so 1C takes
    // between the hour that its charge needs and that.
    assert!((1.0..2.5).contains(&hours), "{hours}");
    assert!(run.channels[Channel::Soc] > 0.98, "{}", run.channels[Channel::Soc]);
}

#[test]
fn a_robot_on_the_chargers_output_keeps_the_charge_from_ending() {
    // 4.19 W at 12.6 V is 0.33 A, five times the cutoff of 0.066 A.
    let mut run = explorer(0.9);
    let direct = Charger::for_pack(run.model().battery(), PowerPath::Direct);
    let (_, stage) = charged(&mut run, &direct, &around(4.19), 5.0);
    assert_eq!(stage, Stage::Voltage);
    // 0.5 W is 0.04 A, less than the cutoff: it ends.
    let mut run = explorer(0.9);
    assert_eq!(charged(&mut run, &direct, &around(0.5), 5.0).1, Stage::Done);
    let mut run = explorer(0.9);
    let selected = Charger { path: PowerPath::Selected, ..direct };
    assert_eq!(charged(&mut run, &selected, &around(4.19), 5.0).1, Stage::Done);
}

#[test]
fn on_the_direct_connection_the_own_load_takes_its_share_of_the_current() {
    let mut run = explorer(0.3);
    let charger = Charger::for_pack(run.model().battery(), PowerPath::Direct);
    let before_v = run.channels[Channel::TerminalVoltageV];
    let flow = charger.step(&mut charger.begin(), &mut run, &around(4.0), 1.0);
    assert!((flow.output_a - 1.32).abs() < 1e-9 && (flow.battery_a - (1.32 - 4.0 / before_v)).abs() < 1e-9);
    // 20 W are 1.8 A: the charger gives its 1.32 A and the battery the rest.
    let mut run = explorer(0.3);
    let flow = charger.step(&mut charger.begin(), &mut run, &around(20.0), 1.0);
    assert!((flow.output_a - 1.32).abs() < 1e-9 && flow.battery_a < 0.0 && run.channels[Channel::Soc] < 0.3);
    // Past the charger it takes nothing from it.
    let mut run = explorer(0.3);
    let selected = Charger { path: PowerPath::Selected, ..charger };
    let flow = selected.step(&mut selected.begin(), &mut run, &around(20.0), 1.0);
    assert!((flow.battery_a - 1.32).abs() < 1e-9 && flow.bypass_w == 20.0);
}

#[test]
fn the_lesser_of_request_and_own_limit_holds_and_in_the_cold_nothing_is_asked() {
    let mut run = explorer(0.3);
    let charger = Charger { output_a_max: 2.0, ..Charger::for_pack(run.model().battery(), PowerPath::Selected) };
    let asked = around(0.0);
    assert!((charger.step(&mut charger.begin(), &mut run, &asked, 1.0).battery_a - 1.32).abs() < 1e-9);
    let small = Charger { output_a_max: 0.5, ..charger };
    assert!((small.step(&mut small.begin(), &mut run, &asked, 1.0).battery_a - 0.5).abs() < 1e-9);
    let cold = Surroundings { request: request(run.model().battery(), false), ..asked };
    let mut charging = charger.begin();
    assert_eq!(charger.step(&mut charging, &mut run, &cold, 1.0).battery_a, 0.0);
    assert_eq!(charging.stage, Stage::Waiting);
    // It goes on when it is warm again.
    charger.step(&mut charging, &mut run, &asked, 1.0);
    assert_eq!(charging.stage, Stage::Current);
}

#[test]
fn very_low_cells_are_charged_with_a_tenth_and_a_full_pack_begins_again_only_when_it_has_sunk() {
    // Below 3 V per cell by a discharge under load: the gauge reads the voltage, not the charge.
    let mut run = explorer(0.0);
    while run.channels[Channel::TerminalVoltageV] >= 8.9 {
        run.step_current(1.0, 10.0);
    }
    let charger = Charger::for_pack(run.model().battery(), PowerPath::Selected);
    let mut charging = charger.begin();
    let flow = charger.step(&mut charging, &mut run, &around(0.0), 1.0);
    assert_eq!(charging.stage, Stage::Precharge);
    assert!((flow.battery_a - 0.132).abs() < 1e-9);

    let mut run = explorer(0.95);
    let (_, stage) = charged(&mut run, &charger, &around(0.0), 5.0);
    assert_eq!(stage, Stage::Done);
    let mut charging = Charging { stage, ..charger.begin() };
    charger.step(&mut charging, &mut run, &around(0.0), 1.0);
    assert_eq!(charging.stage, Stage::Done);
    let mut sunk = explorer(0.8);
    charger.step(&mut charging, &mut sunk, &around(0.0), 1.0);
    assert_eq!(charging.stage, Stage::Current);
}

#[test]
fn a_shared_converter_cuts_the_current() {
    let mut run = explorer(0.3);
    let charger = Charger::for_pack(run.model().battery(), PowerPath::Selected);
    let before_v = run.channels[Channel::TerminalVoltageV];
    let cut = Surroundings { output_w_max: 6.0, ..around(0.0) };
    let flow = charger.step(&mut charger.begin(), &mut run, &cut, 1.0);
    assert!((flow.battery_a - 6.0 / before_v).abs() < 1e-9);
}

#[test]
fn shares_are_max_min_fair() {
    // Bertsekas and Gallager's rule by hand: 10 among 1, 4, 8: the first gets 1, the others 4.5
    // each, of which the second asks for 4 only: 1, 4, 5.
    let mut shares = [0.0; 3];
    share_fairly(10.0, &[1.0, 4.0, 8.0], &mut shares);
    assert_eq!(shares, [1.0, 4.0, 5.0]);
    share_fairly(13.5, &[1.0, 4.0, 8.0], &mut shares);
    assert_eq!(shares, [1.0, 4.0, 8.0]);
    share_fairly(9.0, &[8.0, 8.0, 8.0], &mut shares);
    assert_eq!(shares, [3.0, 3.0, 3.0]);
    share_fairly(0.0, &[8.0, 8.0, 8.0], &mut shares);
    assert_eq!(shares, [0.0, 0.0, 0.0]);
    assert_eq!(fair_level(1.0, &[]), f64::INFINITY);
}

#[test]
fn what_path_selection_saves_is_the_chargers_loss_on_the_own_load() {
    // 4.19 W for 0.95 h through 0.88 and 0.84: 4.19 x 0.95 x 0.13636 / 0.84 = 0.646 Wh, a fortieth
    // of the 26 Wh that a service takes: no fourth robot (Kottas, chapter 6: three empty a pack).
    let pack_w = |station: &str| {
        let model = load_model(station, &|_| unreachable!("built in")).unwrap();
        let mut station = Run::new(Arc::new(model), Start::at_soc(0.0));
        station.channels[Channel::ChargePowerW] = 15.0;
        station.channels[Channel::RobotsDocked] = 1.0;
        station.channels[Channel::RobotsCharging] = 1.0;
        station.step(1.0);
        station.channels[Channel::PackPowerW]
    };
    let saved_wh = 0.95 * (pack_w("mds-station") - pack_w("mds-station-path-selection"));
    assert!((saved_wh - 0.6462).abs() < 1e-4, "{saved_wh}");
}
