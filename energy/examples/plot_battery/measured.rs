//! A model against measured discharges of one cell.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use energy::units::S_PER_H;
use energy::{Channel, Run, Start};
use plotters::prelude::SeriesLabelPosition::{UpperLeft, UpperRight};

use crate::model;
use crate::plot::{BLACK, Line, Panel};

/// A row of a measured log; what was not measured is NaN.
struct Row {
    time_s: f64,
    current_a: f64,
    voltage_v: f64,
    temperature_degc: f64,
}

fn read(path: &Path) -> Result<Vec<Row>, Box<dyn Error>> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        let cell = |index: usize| cells.get(index).copied().unwrap_or(f64::NAN);
        Row { time_s: cell(0), current_a: cell(1), voltage_v: cell(2), temperature_degc: cell(3) }
    };
    Ok(text.lines().skip(1).map(row).collect())
}

fn rms(points: &[(f64, f64)]) -> f64 {
    (points.iter().map(|(_, y)| y * y).sum::<f64>() / points.len() as f64).sqrt()
}

/// Measured discharges of one cell against its model.
pub fn measured() -> Result<Vec<Panel>, Box<dyn Error>> {
    let cell = model("enertech-lco-2280mah-full")?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/measured/enertech-lco-2280mah");
    let (mut voltage, mut left_mv, mut warming, mut left_k) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (colour, (name, file)) in
        [("0.1C", "discharge-0p1c.csv"), ("0.5C", "discharge-0p5c.csv"), ("1C", "discharge-1c.csv")].into_iter().enumerate()
    {
        let rows = read(&folder.join(file))?;
        let begin_degc = rows[0].temperature_degc;
        let start = Start::at_soc(1.0);
        let mut run = Run::new(Arc::clone(&cell), Start { temperature_degc: if begin_degc.is_nan() { 25.0 } else { begin_degc }, ..start });
        let (mut drawn_ah, mut shown, mut modelled, mut off_mv) = (0.0, Vec::new(), Vec::new(), Vec::new());
        let (mut warm, mut warm_model, mut off_k) = (Vec::new(), Vec::new(), Vec::new());
        for pair in rows.windows(2) {
            let (row, dt_s) = (&pair[1], pair[1].time_s - pair[0].time_s);
            run.channels[Channel::CurrentA] = row.current_a;
            run.step(dt_s);
            drawn_ah += row.current_a * dt_s / S_PER_H;
            let model_v = run.channels[Channel::VoltageV];
            if row.voltage_v.is_finite() {
                shown.push((drawn_ah, row.voltage_v));
                modelled.push((drawn_ah, model_v));
                off_mv.push((drawn_ah, 1e3 * (row.voltage_v - model_v)));
            }
            if row.temperature_degc.is_finite() {
                let (hours, model_degc) = (row.time_s / S_PER_H, run.channels[Channel::TemperatureDegc]);
                warm.push((hours, row.temperature_degc - begin_degc));
                warm_model.push((hours, model_degc - begin_degc));
                off_k.push((hours, row.temperature_degc - model_degc));
            }
        }
        let model_label = if colour == 2 { "model" } else { "" };
        voltage.push(Line::through(&format!("{name}, measured"), colour, shown));
        voltage.push(Line::through(model_label, BLACK, modelled).dashed());
        left_mv.push(Line::through(&format!("{name}: {:.1} mV RMS", rms(&off_mv)), colour, off_mv));
        if !warm.is_empty() {
            warming.push(Line::through(&format!("{name}, measured"), colour, warm));
            warming.push(Line::through(model_label, BLACK, warm_model).dashed());
            left_k.push(Line::through(&format!("{name}: {:.2} K RMS", rms(&off_k)), colour, off_k));
        }
    }
    let (charge, time) = (|| ("charge drawn / Ah", 0.0..2.4), || ("time / h", 0.0..2.5));
    Ok(vec![
        Panel::new("Enertech 2.28 Ah at 25 \u{b0}C: voltage", charge(), ("voltage / V", 2.8..4.4), voltage, UpperRight),
        Panel::new("Warming, and cooling after the end", time(), ("above the start / K", -0.5..6.0), warming, UpperRight),
        Panel::new("Voltage, measured less modelled", charge(), ("residual / mV", -40.0..40.0), left_mv, UpperLeft),
        Panel::new("Temperature, measured less modelled", time(), ("residual / K", -1.5..1.5), left_k, UpperRight),
    ])
}
