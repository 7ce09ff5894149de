//! Plots of a robot's electrical side: converter efficiency, regulator loss and temperature, the
//! power tree over a discharge, processor power, radio range and supply power.
//!
//! # Plots
//!
//! ```text
//! cargo run -p energy --example plot_power [FOLDER]      (default: plots)
//! ```
//!
//! - `power-rails`: efficiency of a converter, loads and losses of the Aquapod's rails over the
//!   pack's voltage, loss and temperature of its linear regulator.
//! - `power-loads`: power of a processor over its clock, supply power of a radio module, range of a
//!   radio link with and without a matched antenna.
//!
//! Each as SVG and as PNG.

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

use energy::power::radio::{Duty, Impedance, Link, RadioModule};
use energy::power::{PowerTree, RailKind};
use energy::{Channel, Model, Run, Start, load_model};
use plotters::prelude::SeriesLabelPosition::{LowerRight, UpperLeft};

mod plot;

use plot::{Line, Mark, Panel, save};

const SIZE: (u32, u32) = (620, 420);
const AMBIENT_DEGC: f64 = 25.0;
const M_PER_KM: f64 = 1000.0;

/// Efficiency of the Aquapod's 5 V converter over its output current (compare Kottas, Fig. 4.2).
fn converter(tree: &PowerTree) -> Panel {
    let RailKind::Switching(converter) = &tree.rails()[tree.find("5v").expect("a 5 V rail")].kind else { unreachable!("it switches") };
    let volts = [6.0, 7.0, 8.4, 12.0];
    let line = |(colour, volts): (usize, &f64)| {
        Line::of(&format!("{volts} V in"), colour, 0.0..1.5, |output_a| 100.0 * converter.efficiency(*volts, output_a))
    };
    let lines = volts.iter().enumerate().map(line).collect();
    Panel::new("5 V switch-mode converter", ("output current / A", 0.0..1.5), ("efficiency / %", 0.0..100.0), lines, LowerRight)
}

/// Heat and junction temperature of the Aquapod's linear 5 V regulator.
fn regulator(tree: &PowerTree) -> [Panel; 2] {
    let RailKind::Linear(ldo) = &tree.rails()[tree.find("5v_clean").expect("a clean rail")].kind else { unreachable!("it is linear") };
    let volts = [6.0, 7.4, 8.4];
    let lines = |of: &dyn Fn(f64, f64) -> f64| -> Vec<Line> {
        let line = |(colour, volts): (usize, &f64)| Line::of(&format!("{volts} V in"), colour, 0.0..0.25, |output_a| of(*volts, output_a));
        volts.iter().enumerate().map(line).collect()
    };
    let loss_w = |volts: f64, output_a: f64| ldo.loss_w(volts, output_a);
    let degc = |volts: f64, output_a: f64| ldo.junction_degc(AMBIENT_DEGC, loss_w(volts, output_a)).expect("theta_JA is given");
    let current = || ("output current / A", 0.0..0.25);
    let loss = Panel::new("Linear regulator to 5 V: loss", current(), ("loss / W", 0.0..0.9), lines(&loss_w), UpperLeft);
    let mut heat = Panel::new("Linear regulator to 5 V: heat", current(), ("junction / \u{b0}C", 0.0..200.0), lines(&degc), UpperLeft);
    let limit_a = (1..250).map(|ma| f64::from(ma) / 1e3).find(|&output_a| degc(volts[2], output_a) > ldo.junction_max_degc);
    heat.lines.push(Line::of("", 3, 0.0..0.25, |_| ldo.junction_max_degc).dashed());
    if let Some(limit_a) = limit_a {
        let text = format!("shuts down: {limit_a:.2} A at {} V", volts[2]);
        heat.marks.push(Mark { at: (limit_a, ldo.junction_max_degc), text, offset: (-4, -14) });
    }
    [loss, heat]
}

/// Where the Aquapod's battery power goes while its pack falls from 8.4 V to 6.0 V.
fn discharge(aquapod: &Arc<Model>, tree: &PowerTree) -> Panel {
    let at = |volts: f64| {
        let mut run = Run::new(Arc::clone(aquapod), Start::at_soc(1.0));
        run.channels[Channel::VoltageV] = volts;
        run.step(1.0);
        run.rails().expect("the Aquapod has rails")
    };
    let pack = || 6.0..8.4;
    let mut lines =
        vec![Line::of("battery", 0, pack(), |volts| at(volts).battery_w), Line::of("all loads", 1, pack(), |volts| at(volts).load_w())];
    for (index, rail) in tree.rails().iter().enumerate() {
        lines.push(Line::of(&format!("loss of {}", rail.id), 2 + index, pack(), |volts| at(volts).rails()[index].loss_w));
    }
    Panel::new("Aquapod at rest: where its power goes", ("pack voltage / V", pack()), ("power / W", 0.0..1.6), lines, UpperLeft)
}

/// Power of the processor over its clock, by utilisation.
fn processor() -> Result<Panel, Box<dyn Error>> {
    let text = "schema = 1\nsystem = \"robot\"\nname = \"cpu\"\n[[effect]]\nid = \"cpu\"\n";
    let model = Arc::new(Model::parse("cpu", text, &|table| Err(format!("no table {table}")))?);
    let power_w = |mhz: f64, util: f64| {
        let mut run = Run::new(Arc::clone(&model), Start::at_soc(0.0));
        (run.channels[Channel::CpuMhz], run.channels[Channel::CpuUtil]) = (mhz, util);
        run.step(1.0);
        run.channels[Channel::PowerW]
    };
    let line =
        |(colour, util): (usize, &f64)| Line::of(&format!("{:.0} % busy", 100.0 * util), colour, 13.0..416.0, |mhz| power_w(mhz, *util));
    let lines = [1.0, 0.5, 0.0].iter().enumerate().map(line).collect();
    let mut panel =
        Panel::new("PXA270: C N V\u{b2} f and leakage", ("clock / MHz", 0.0..430.0), ("power / W", 0.0..0.65), lines, UpperLeft);
    for (mhz, volts) in [(104.0, 1.0), (208.0, 1.05), (312.0, 1.1), (416.0, 1.35)] {
        panel.marks.push(Mark { at: (mhz, power_w(mhz, 1.0)), text: format!("{volts:.2} V"), offset: (-10, -12) });
    }
    Ok(panel)
}

/// Range of a 75.57 MHz link with and without its antenna matched.
fn range() -> Panel {
    let antenna = Impedance { resistance_ohm: 12.0, reactance_ohm: 70.0 };
    let range_km = |transmit_dbm: f64, loss_db: f64| {
        let link =
            Link { frequency_hz: 75.57e6, transmit_dbm, transmit_gain_db: 0.0, receive_gain_db: 0.0, loss_db, sensitivity_dbm: -85.0 };
        link.range_m() / M_PER_KM
    };
    let lines = vec![
        Line::of("matched by L and C", 0, -10.0..20.0, |dbm| range_km(dbm, 0.0)),
        Line::of("12 + j70 ohm on a 50 ohm line", 1, -10.0..20.0, |dbm| range_km(dbm, antenna.mismatch_loss_db(50.0))),
    ];
    let title = "75.57 MHz in free space, received with -85 dBm";
    Panel::new(title, ("transmitted power / dBm", -10.0..20.0), ("range / km", 0.0..60.0), lines, UpperLeft)
}

/// Mean supply power of a Wi-Fi module.
fn supply() -> Panel {
    let module = RadioModule { sleep_w: 0.01, listen_w: 0.6, transmit_w: 0.9, amplifier_efficiency: 0.2 };
    let line = |(colour, dbm): (usize, &f64)| {
        let mean_w = |transmit: f64| module.mean_w(Duty { transmit, listen: 1.0 - transmit }, *dbm);
        Line::of(&format!("{dbm:.0} dBm"), colour, 0.0..1.0, mean_w)
    };
    let lines = [20.0, 15.0, 10.0, 0.0].iter().enumerate().map(line).collect();
    Panel::new("Wi-Fi module: supply power", ("share of time sending", 0.0..1.0), ("supply power / W", 0.0..1.5), lines, LowerRight)
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "plots".to_owned()));
    let aquapod = Arc::new(load_model("aquapod-robot", &|path| Err(format!("{} is not built in", path.display())))?);
    let tree = aquapod.facts.tree().expect("the Aquapod has rails");
    let [loss, heat] = regulator(tree);
    let rails = [converter(tree), discharge(&aquapod, tree), loss, heat];
    for path in save(&folder, "power-rails", 2, SIZE, &rails)? {
        println!("{}", path.display());
    }
    for path in save(&folder, "power-loads", 3, SIZE, &[processor()?, supply(), range()])? {
        println!("{}", path.display());
    }
    Ok(())
}
