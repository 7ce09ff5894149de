//! First models of robots from data sheets.

use std::path::Path;
use std::sync::Arc;

use energy::Model;
use lab::drive::RobotSheet;
use lab::report::drive::DriveReport;

use crate::commands::lab_in;

fn text() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/sheets/explorer.toml")).unwrap()
}

fn report(text: &str) -> (Arc<Model>, DriveReport) {
    let sheet = RobotSheet::parse("sheet.toml", text).unwrap();
    let made = sheet.model_text("a test");
    let model = Model::parse("made.toml", &made, &|_| Err("no file".to_owned())).unwrap_or_else(|error| panic!("{error}\n{made}"));
    let model = Arc::new(model);
    (Arc::clone(&model), DriveReport::of(&sheet, &model, None))
}

/// The built-in Explorer was put together by hand of the same sheets.
#[test]
fn the_sheets_of_the_explorer_give_its_built_in_model() {
    let (made, report) = report(&text());
    let built_in = lab::load_model("explorer-robot").unwrap().model;
    for (effect, name, within) in [
        ("motion", "mass_kg", 1e-9),
        ("motion", "rolling_coefficient", 1e-9),
        // By hand it is the gear's alone; the sheet's two constants of the motor differ by 0.3 %.
        ("motion", "drive_efficiency", 0.005),
        ("dry_friction", "force_n", 0.01),
        ("acceleration", "mass_kg", 0.01),
    ] {
        let [value, by_hand] = [&made, &built_in].map(|model| model.parameter(effect, name).unwrap().value);
        assert!((value / by_hand - 1.0).abs() <= within, "{effect}.{name}: {value} for {by_hand}");
    }
    // By hand it went by the force at the ground; on a ramp most of that has passed the gear, with an efficiency of 0.7.
    let [copper, by_hand] = [&made, &built_in].map(|model| model.parameter("motor_copper", "copper_w_per_n2").unwrap().value);
    assert!(copper > by_hand && copper < by_hand / 0.7_f64.powi(2), "{copper} for {by_hand}");
    // Kottas, section 5.2: approximately 520 mm/s.
    assert!((report.top_speed_mps / 0.52 - 1.0).abs() < 0.02, "{}", report.top_speed_mps);
    assert_eq!(report.cheapest_mps, Some(report.top_speed_mps));
}

/// The effects take what the equations of motor, gear and bridge say, on the ramp but for ripple, and nearly so on the level.
#[test]
fn the_model_takes_what_the_motors_take() {
    // Also where the two constants of the motor differ, as those of real sheets do.
    for torque in ["11.4e-3", "9.0e-3"] {
        let (_, report) = report(&text().replace("24.57e3", "1e7").replace("= 11.4e-3", &format!("= {torque}")));
        assert_eq!(report.going.len(), 3);
        for going in &report.going {
            let within = if going.pitch_deg > 0.0 { 0.01 } else { 0.05 };
            assert!((going.model_w / going.motors_w - 1.0).abs() < within, "{torque}: {going:?}");
        }
    }
}

/// Twice the deviation of what alone is uncertain is twice that of what follows.
#[test]
fn deviations_go_by_those_of_the_sheet() {
    let sigma = |text: &str| {
        let sheet = RobotSheet::parse("sheet.toml", text).unwrap();
        sheet.parameters().into_iter().find(|parameter| parameter.name == "conduction_v_per_n").unwrap().value.sigma
    };
    let known = text().replace("0.2 }", "0.0 }").replace("0.0045 }", "0.0 }").replace("0.07 }", "0.0 }").replace("0.01 }", "0.0 }");
    let only = |share: f64| {
        known.replace("torque_nm_per_a = 11.4e-3", &format!("torque_nm_per_a = {{ value = 11.4e-3, sigma = {:e} }}", 11.4e-3 * share))
    };
    let [rest, once, twice] = [0.0, 0.04, 0.08].map(|share| sigma(&only(share)).powi(2));
    assert!(((twice - rest) / (once - rest) - 4.0).abs() < 0.2, "{rest} {once} {twice}");
    assert!(sigma(&text()) > rest.sqrt());
}

#[test]
fn mistakes_are_placed() {
    let folder = tempfile::tempdir().unwrap();
    let drive = |text: &str| {
        std::fs::write(folder.path().join("sheet.toml"), text).unwrap();
        lab_in(folder.path(), &["drive", "sheet.toml", "-o", "robot.toml"])
    };
    for (from, to, words) in [
        ("mass_kg = { value = 0.5, sigma = 0.1 }", "mas_kg = 0.5", "did you mean `mass_kg`?"),
        ("ratio = 41.0", "ratio = 0.0", "gear.ratio = 0: must be between 0.01 and 10000"),
        ("no_load_a = 10.5e-3", "no_load_a = 2.0", "must be less than the current of the blocked motor, 0.876 A"),
        ("sigma = 0.07 }", "sigma = 7.0 }", "gear.efficiency: sigma = 7: must be between 0 and the value"),
        ("torque_nm_per_a = 11.4e-3", "torque_nm_per_a = 11.4", "check the units (N m/A, turns a minute)"),
        ("battery_v = 11.1", "battery_v = \"11.1\"", "a number, or { value = .., sigma = .. }"),
        ("value = 3.9, sigma = 0.4", "value = 1e6, sigma = 1.0", "idle_w = 1000000: must be between 0 and"),
        ("schema = 1", "schema = 2", "sheet.toml:3:10: schema = 2: this program reads schema = 1"),
        ("driven_wheels = 2", "driven_wheels = 0", "driven_wheels = 0: must be between 1 and 16"),
    ] {
        let outcome = drive(&text().replace(from, to));
        assert_eq!((outcome.code, outcome.stdout.as_str()), (2, ""), "{to}");
        assert!(outcome.stderr.contains(words), "`{words}` is not in: {}", outcome.stderr);
    }
    assert!(!folder.path().join("robot.toml").exists());
    let outcome = drive(&text());
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    assert!(
        outcome.stdout.contains("a metre costs least at 0.5")
            && outcome.stdout.contains("are the ripple of the current")
            && outcome.stdout.ends_with("wrote robot.toml\n"),
        "{}",
        outcome.stdout
    );
    // Half a ton is too much for these motors.
    let heavy = drive(&text().replace("value = 0.5, sigma = 0.1", "value = 499.0, sigma = 10.0"));
    assert!(heavy.stdout.contains("its motors do not move it"), "{}", heavy.stdout);
    let over = lab_in(folder.path(), &["drive", "sheet.toml", "-o", "sheet.toml"]);
    assert!(over.code == 2 && over.stderr.contains("is the data sheet that is read here"), "{}", over.stderr);
}
