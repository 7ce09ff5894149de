//! Plots of a docking station: a CC-CV charge with both power paths, converter efficiency, and where
//! the energy of a service goes.
//!
//! # Plots
//!
//! ```text
//! cargo run -p energy --example plot_station [FOLDER]      (default: plots)
//! ```
//!
//! - `station`: current, voltage, state of charge and power of a battery that charges, for a charger
//!   that also feeds the robot (direct connection) and one that does not (path selection);
//!   efficiency of the converters in front of the bays; energy of one service by cause.
//!
//! Each as SVG and as PNG.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

use energy::charger::{self, Charger, PowerPath, Stage, Surroundings};
use energy::service::{Circumstances, Handling, service_energy};
use energy::units::S_PER_H;
use energy::{Channel, Estimate, Model, Run, Start, load_model};
use plotters::prelude::SeriesLabelPosition::{self, LowerRight, UpperRight};

mod plot;

use plot::{Line, Panel, save};

const SIZE: (u32, u32) = (620, 400);
/// An Explorer's own load, W.
const OWN_LOAD_W: f64 = 4.19;
const HOURS: f64 = 2.5;
const STEP_S: f64 = 5.0;

fn model(name: &str) -> Result<Arc<Model>, Box<dyn Error>> {
    Ok(Arc::new(load_model(name, &|path| std::fs::read_to_string(path).map_err(|error| error.to_string()))?))
}

/// What a charge looks like: one series per quantity, over hours.
type Series = BTreeMap<&'static str, Vec<(f64, f64)>>;

fn charge(battery: &Arc<Model>, path: PowerPath) -> Series {
    let mut run = Run::new(Arc::clone(battery), Start::at_soc(0.05));
    let facts = battery.battery();
    let device = Charger::for_pack(facts, path);
    let around =
        Surroundings { request: charger::request(facts, true), series: facts.series, own_load_w: OWN_LOAD_W, output_w_max: f64::INFINITY };
    let (mut charging, mut series) = (device.begin(), Series::new());
    for step in 1..=(HOURS * S_PER_H / STEP_S) as u32 {
        let flow = device.step(&mut charging, &mut run, &around, STEP_S);
        if charging.stage == Stage::Done {
            break;
        }
        let hours = f64::from(step) * STEP_S / S_PER_H;
        let voltage_v = run.channels[Channel::TerminalVoltageV];
        let values = [
            ("battery_a", flow.battery_a),
            ("output_a", flow.output_a),
            ("voltage_v", voltage_v),
            ("soc", 100.0 * run.channels[Channel::Soc]),
            ("output_w", flow.output_w),
            ("battery_w", flow.battery_a * voltage_v),
        ];
        for (name, value) in values {
            series.entry(name).or_default().push((hours, value));
        }
    }
    series
}

fn charge_panels(battery: &Arc<Model>) -> Vec<Panel> {
    let (direct, selected) = (charge(battery, PowerPath::Direct), charge(battery, PowerPath::Selected));
    let panel = |title: &str, y_label: &str, top: f64, bottom: f64, lines, legend: SeriesLabelPosition| {
        Panel::new(title, ("time / h", 0.0..HOURS), (y_label, bottom..top), lines, legend)
    };
    let both = |name: &'static str| {
        vec![Line::through("direct connection", 1, direct[name].clone()), Line::through("path selection", 0, selected[name].clone())]
    };
    let mut current = both("battery_a");
    current.push(Line::through("charger's output, direct", 3, direct["output_a"].clone()).dashed());
    let mut power = both("battery_w");
    power.push(Line::through("charger's output, direct", 3, direct["output_w"].clone()).dashed());
    vec![
        panel("Current into the battery", "current / A", 1.6, 0.0, current, UpperRight),
        panel("Voltage of the battery", "voltage / V", 13.0, 10.0, both("voltage_v"), LowerRight),
        panel("State of charge", "state of charge / %", 105.0, 0.0, both("soc"), LowerRight),
        panel("Power into the battery", "power / W", 20.0, 0.0, power, UpperRight),
    ]
}

/// Efficiency of the bays' converters by the default curve, and the constant of `mds-station`.
fn converters() -> Result<Panel, Box<dyn Error>> {
    let text = |effect: &str| format!("schema = 1\nsystem = \"station\"\nname = \"bays\"\n[[effect]]\nid = \"{effect}\"\n");
    let efficiency = |model: &Arc<Model>, out_w: f64, pack_v: f64| {
        let mut run = Run::new(Arc::clone(model), Start::at_soc(0.0));
        run.channels[Channel::ChargePowerW] = out_w;
        run.channels[Channel::PackVoltageV] = pack_v;
        run.step(1.0);
        100.0 * out_w / run.channels[Channel::PackPowerW]
    };
    let curve = Arc::new(Model::parse("bays", &text("converter_curve"), &|_| Err("no table".to_owned()))?);
    let mut lines: Vec<Line> = [12.6, 11.1, 9.0]
        .iter()
        .enumerate()
        .map(|(colour, &pack_v)| Line::of(&format!("{pack_v:.1} V"), colour, 0.5..80.0, |out_w| efficiency(&curve, out_w, pack_v)))
        .collect();
    let station = Arc::new(model("mds-station")?.without(|id| id != "converter_efficiency"));
    lines.push(Line::of("constant, plus no-load power", 3, 0.5..80.0, |out_w| efficiency(&station, out_w, 11.1)).dashed());
    Ok(Panel::new("Converters of the bays", ("power to the bays / W", 0.0..80.0), ("efficiency / %", 70.0..95.0), lines, LowerRight))
}

/// Where the energy of a service goes, as bars for both power paths.
fn services(battery: &Arc<Model>) -> Result<Panel, Box<dyn Error>> {
    let handling = Handling { load_s: 30.0, unload_s: 30.0, swap_s: 60.0 };
    let around = Circumstances { pack_v: 11.4, at_once: 3.0, ..Circumstances::ALONE };
    let causes = ["charge", "own load", "charger_efficiency", "converter_efficiency", "lift"];
    let (mut lines, mut names) = (Vec::new(), Vec::new());
    for (place, (name, own, title)) in
        [("mds-station", "robot_own_load", "direct connection"), ("mds-station-path-selection", "path_selection", "path selection")]
            .into_iter()
            .enumerate()
    {
        let recharge = service_energy(&model(name)?, handling, battery, Estimate::new(0.1, 0.01), 0.98, &around);
        let mut bottom_wh = 0.0;
        for (colour, cause) in causes.iter().enumerate() {
            let wh = recharge.breakdown_wh.get(if *cause == "own load" { own } else { cause }).copied().unwrap_or(0.0);
            let left = place as f64 + 0.25;
            let label = if place == 0 { cause.replace('_', " ") } else { String::new() };
            let (right, top_wh) = (left + 0.5, bottom_wh + wh);
            let corners = vec![(left, bottom_wh), (right, bottom_wh), (right, top_wh), (left, top_wh)];
            lines.push(Line::through(&label, colour, corners).filled());
            bottom_wh += wh;
        }
        let whole = recharge.need.estimate();
        names.push((place as f64 + 0.5, format!("{title}: {:.1} \u{b1} {:.1} Wh", whole.value, whole.sigma)));
    }
    let title = "Energy of one service, 10 % to 98 %";
    let mut panel = Panel::new(title, ("power path", 0.0..2.0), ("energy from the pack / Wh", 0.0..45.0), lines, UpperRight);
    panel.x_names = names;
    Ok(panel)
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "plots".to_owned()));
    let battery = model("explorer-3s1p-1320mah")?;
    let mut panels = charge_panels(&battery);
    panels.push(converters()?);
    panels.push(services(&battery)?);
    for path in save(&folder, "station", 2, SIZE, &panels)? {
        println!("{}", path.display());
    }
    Ok(())
}
