//! Plots of a battery: discharges at constant power, rests, impedance, the built-in cells, and a
//! model against measured discharges.
//!
//! # Plots
//!
//! ```text
//! cargo run -p energy --example plot_battery [FOLDER]      (default: plots)
//! ```
//!
//! - `battery-discharge`: voltage over depth of discharge at several powers, with the energy that
//!   is usable at each; it is less than what is stored (compare Kottas, Fig. 3.5 and 3.7).
//! - `battery-rest`: a discharge with rests, two rests with their time constant and extrapolation,
//!   and the error of that over depth of discharge (compare Kottas, Fig. 3.6, 3.8 and 3.9).
//! - `battery-impedance`: magnitude over frequency and Nyquist plot of a cell with two RC pairs,
//!   with and without diffusion (compare Kottas, Fig. 3.1).
//! - `battery-cells`: open-circuit voltage and resistance of the built-in cells over state of charge.
//! - `battery-measured`: voltage and warming of one cell, measured and modelled, and what is left.
//!
//! Each as SVG and as PNG.

use std::error::Error;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use energy::forecast::discharge;
use energy::load::Terminals as _;
use energy::relaxation::{Relaxation, extrapolate};
use energy::units::S_PER_H;
use energy::{Channel, Model, Run, Start, built_in, load_model};
use plotters::prelude::SeriesLabelPosition::{LowerLeft, LowerRight, UpperLeft, UpperRight};

mod measured;
#[path = "../plot/mod.rs"]
mod plot;

use measured::measured;
use plot::{BLACK, Line, Mark, Panel, save};

const SIZE: (u32, u32) = (620, 420);
/// Powers as shares of the stored energy per hour.
const RATES: [(&str, f64); 5] = [("E/20", 0.05), ("E/5", 0.2), ("E/2", 0.5), ("1E", 1.0), ("2E", 2.0)];
/// Rest that an extrapolation sees, s.
const WATCHED_S: f64 = 300.0;
/// Rest after which a cell counts as relaxed, s.
const RELAXED_S: f64 = 4.0 * S_PER_H;
/// Noise of the voltage sensor that an extrapolation assumes, V.
const NOISE_V: f64 = 1e-4;
/// Cells of the built-in sets, with what they are made of.
const CELLS: [(&str, &str); 5] = [
    ("enertech-lco-2280mah-full", "LCO 2.28 Ah, Enertech"),
    ("a123-lfp-26650-2p3ah", "LFP 2.3 Ah, A123"),
    ("samsung-inr18650-30q-3ah", "NCA 3 Ah, Samsung"),
    ("melasta-lipo-3p7ah", "LiPo 3.7 Ah, Melasta"),
    ("nissan-leaf-33ah", "LMO/LNO 33 Ah, Leaf"),
];

fn model(name: &str) -> Result<Arc<Model>, Box<dyn Error>> {
    Ok(Arc::new(load_model(name, &|_| unreachable!("built in"))?))
}

/// Discharges of a full pack at several powers.
fn discharges(title: &str, battery: &Arc<Model>, volts: Range<f64>) -> Panel {
    let facts = battery.battery();
    let stored_wh = facts.stored_wh();
    let series = f64::from(facts.series);
    let ocv = Line::of(&format!("open circuit: {stored_wh:.2} Wh stored"), BLACK, 0.0..100.0, |dod| {
        series * facts.ocv.voltage_v(1.0 - dod / 100.0)
    });
    let mut lines = vec![ocv.dashed()];
    for (colour, (name, rate)) in RATES.into_iter().enumerate() {
        let power_w = rate * stored_wh;
        let usable_wh = discharge(&mut Run::new(Arc::clone(battery), Start::at_soc(1.0)), power_w).energy_wh;
        let mut run = Run::new(Arc::clone(battery), Start::at_soc(1.0));
        let mut points = Vec::new();
        while run.step_power(power_w, S_PER_H / rate / 1000.0).is_ok() && run.channels[Channel::VoltageV] >= facts.eod_v() {
            points.push((100.0 * (1.0 - run.channels[Channel::Soc]), run.channels[Channel::VoltageV]));
        }
        let share = 100.0 * usable_wh / stored_wh;
        lines.push(Line::through(&format!("{name} = {power_w:.2} W: {usable_wh:.2} Wh usable, {share:.1} %"), colour, points));
    }
    let end = Mark { at: (0.0, facts.eod_v()), text: format!("end of discharge, {:.1} V", facts.eod_v()), offset: (10, -12) };
    lines.push(Line::of("", BLACK, 0.0..100.0, |_| facts.eod_v()));
    Panel::new(title, ("depth of discharge / %", 0.0..100.0), ("voltage / V", volts), lines, LowerLeft).marked(vec![end])
}

/// Discharges a full cell at 1E down to a depth, and no further than its end of discharge.
fn down_to(run: &mut Run<f64>, dod: f64, mut seen: impl FnMut(&Run<f64>)) {
    let model = Arc::clone(run.model());
    let power_w = model.battery().stored_wh();
    while run.channels[Channel::Soc] > 1.0 - dod && run.channels[Channel::VoltageV] > model.battery().eod_v() {
        if run.step_power(power_w, 1.0).is_err() {
            break;
        }
        seen(run);
    }
}

/// Rests for some time and says the voltage every second, from the first on.
fn rest(run: &mut Run<f64>, length_s: f64) -> Vec<(f64, f64)> {
    run.channels[Channel::CurrentA] = 0.0;
    let second = |second: u32| {
        run.step(1.0);
        (f64::from(second), run.channels[Channel::VoltageV])
    };
    (1..=length_s as u32).map(second).collect()
}

/// A rest after a discharge at 1E to a depth, and what its first minutes tell.
struct Rest {
    voltage_v: Vec<(f64, f64)>,
    /// From the first minutes.
    told: Relaxation,
    /// From all of it.
    whole: Relaxation,
}

impl Rest {
    fn at(battery: &Arc<Model>, dod: f64) -> Result<Self, Box<dyn Error>> {
        let mut run = Run::new(Arc::clone(battery), Start::at_soc(1.0));
        down_to(&mut run, dod, |_| {});
        let voltage_v = rest(&mut run, RELAXED_S);
        let told = extrapolate(&voltage_v[..WATCHED_S as usize], NOISE_V)?;
        let whole = extrapolate(&voltage_v, NOISE_V)?;
        Ok(Rest { voltage_v, told, whole })
    }

    fn end_v(&self) -> f64 {
        self.voltage_v[self.voltage_v.len() - 1].1
    }

    fn watched_v(&self) -> f64 {
        self.voltage_v[WATCHED_S as usize - 1].1
    }
}

/// A discharge at 1E that pauses for a quarter of an hour at every tenth of its charge.
fn paused(battery: &Arc<Model>) -> Panel {
    let mut run = Run::new(Arc::clone(battery), Start::at_soc(1.0));
    let (mut time_s, mut loaded, mut resting, mut ends) = (0.0, Vec::new(), Vec::new(), Vec::new());
    for tenth in 1..=9 {
        down_to(&mut run, f64::from(tenth) / 10.0, |run| {
            time_s += 1.0;
            loaded.push((time_s / S_PER_H, run.channels[Channel::VoltageV]));
        });
        for (_, voltage_v) in rest(&mut run, 900.0) {
            time_s += 1.0;
            loaded.push((time_s / S_PER_H, voltage_v));
            resting.push((time_s / S_PER_H, battery.battery().ocv.voltage_v(run.channels[Channel::Soc])));
        }
        ends.push(Mark { at: loaded[loaded.len() - 1], text: String::new(), offset: (0, 0) });
    }
    let emf = resting.chunks(900).enumerate().map(|(index, chunk)| {
        let label = if index == 0 { "relaxed voltage" } else { "" };
        Line::through(label, BLACK, chunk.to_vec()).dashed()
    });
    let mut lines = vec![Line::through("voltage; dots: after 15 min of rest", 0, loaded.clone())];
    lines.extend(emf);
    let title = "Leaf cell: 1E with 15 min of rest every 10 %";
    Panel::new(title, ("time / h", 0.0..3.4), ("voltage / V", 3.4..4.2), lines, UpperRight).marked(ends)
}

/// One rest, what its first minutes tell, and where it ends.
fn one_rest(title: &str, rest: &Rest, shown_min: f64) -> Panel {
    let told = rest.told;
    // The exponential goes through the last voltage that was watched.
    let gap_v = rest.watched_v() - told.emf_v.value;
    let extrapolated = |min: f64| told.emf_v.value + gap_v * (-(60.0 * min - WATCHED_S) / told.tau_s).exp();
    let mut guess = Line::of("extrapolated from 5 min, one sigma", 1, WATCHED_S / 60.0..shown_min, extrapolated);
    guess.band = vec![told.emf_v.sigma; guess.points.len()];
    let shown: Vec<_> = rest.voltage_v.iter().map(|&(s, v)| (s / 60.0, v)).take_while(|(min, _)| *min <= shown_min).collect();
    let lines = vec![
        Line::through("voltage", 0, shown),
        guess.dashed(),
        Line::of(&format!("where it ends: {:.4} V", rest.end_v()), BLACK, 0.0..shown_min, |_| rest.end_v()).dashed(),
    ];
    let (first_s, first_v) = rest.voltage_v[0];
    let at_s = rest.whole.tau_rlx_s + first_s;
    let at = |s: f64| rest.voltage_v[(s.round() as usize).clamp(1, rest.voltage_v.len()) - 1].1;
    let tau = format!("63 % of the way: tau_rlx = {:.0} s (by 5 min: {:.0} s)", rest.whole.tau_rlx_s, told.tau_rlx_s);
    let marks = vec![
        Mark { at: (at_s / 60.0, at(at_s)), text: tau, offset: (14, 34) },
        Mark { at: (WATCHED_S / 60.0, rest.watched_v()), text: "5 min".to_owned(), offset: (6, 14) },
    ];
    let way_v = rest.end_v() - first_v;
    let volts = first_v - 0.5 * way_v..rest.end_v() + 0.1 * way_v;
    Panel::new(title, ("time of rest / min", 0.0..shown_min), ("voltage / V", volts), lines, LowerRight).marked(marks)
}

/// Error of the voltage after five minutes and of what is extrapolated from them. A process much
/// slower than five minutes stays unseen, and the deviation does not know of it (the Leaf cell).
fn rest_errors(cells: &[(&str, &Arc<Model>)]) -> Result<Panel, Box<dyn Error>> {
    let mut lines = Vec::new();
    for (place, (name, battery)) in cells.iter().enumerate() {
        let (mut waited, mut told, mut band) = (Vec::new(), Vec::new(), Vec::new());
        for step in 1..=18 {
            let dod = 0.05 * f64::from(step);
            let rest = Rest::at(battery, dod)?;
            waited.push((100.0 * dod, 1e3 * (rest.watched_v() - rest.end_v())));
            told.push((100.0 * dod, 1e3 * (rest.told.emf_v.value - rest.end_v())));
            band.push(1e3 * rest.told.emf_v.sigma);
        }
        lines.push(Line::through(&format!("{name}: waited 5 min"), place, waited).dashed());
        let mut line = Line::through(&format!("{name}: extrapolated, one sigma"), place, told);
        line.band = band;
        lines.push(line);
    }
    let title = "Five minutes of rest against four hours";
    Ok(Panel::new(title, ("depth of discharge / %", 0.0..100.0), ("error / mV", -80.0..10.0), lines, LowerLeft))
}

fn rests() -> Result<Vec<Panel>, Box<dyn Error>> {
    let (leaf, melasta) = (model("nissan-leaf-33ah")?, model("melasta-lipo-3p7ah")?);
    let half = |battery| Rest::at(battery, 0.5);
    Ok(vec![
        paused(&leaf),
        one_rest("LiPo cell at 50 %: pairs of 6.5 s and 100 s", &half(&melasta)?, 20.0),
        one_rest("Leaf cell at 50 %: pairs of 52 s and 32 min", &half(&leaf)?, 60.0),
        rest_errors(&[("LiPo", &melasta), ("LCO", &model("enertech-lco-2280mah-full")?), ("Leaf", &leaf)])?,
    ])
}

/// Complex impedance of one cell at half charge, ohm: `Z(jw) = s(0) + int s'(t) exp(-jwt) dt` of
/// its overpotential s after a step of current, whose chords between times on a logarithmic grid
/// are integrated exactly.
fn impedance(cell: &Arc<Model>) -> impl Fn(f64) -> (f64, f64) + use<> {
    // So small that the charge stays where it is over all decades.
    const STEP_A: f64 = 1e-6;
    let mut run = Run::new(Arc::clone(cell), Start::at_soc(0.5));
    run.channels[Channel::CurrentA] = STEP_A;
    let mut response = Vec::new();
    let (mut before_s, mut time_s) = (0.0, 1e-5);
    while time_s < 1e6 {
        run.step(time_s - before_s);
        response.push((time_s, run.channels[Channel::OverpotentialV] / STEP_A));
        (before_s, time_s) = (time_s, time_s * 1.01);
    }
    move |frequency_hz| {
        let w = 2.0 * std::f64::consts::PI * frequency_hz;
        let (mut re, mut im) = (response[0].1, 0.0);
        for pair in response.windows(2) {
            let ((t0, s0), (t1, s1)) = (pair[0], pair[1]);
            let slope = (s1 - s0) / (t1 - t0);
            re += slope * ((w * t1).sin() - (w * t0).sin()) / w;
            im += slope * ((w * t1).cos() - (w * t0).cos()) / w;
        }
        (re, im)
    }
}

fn impedances() -> Result<Vec<Panel>, Box<dyn Error>> {
    let text = built_in("melasta-lipo-3p7ah").ok_or("not built in")?;
    let parsed = |text: &str| Model::parse("cell", text, &|table| built_in(table).map(str::to_owned).ok_or_else(|| "no table".to_owned()));
    let pairs = parsed(text)?;
    let whole = parsed(&format!("{text}\n[[effect]]\nid = \"warburg\"\n"))?;
    let ohmic = pairs.without(|id| id.starts_with("rc"));
    let names = ["R0", "R0 + RC + RC", "R0 + RC + RC + Warburg"];
    let hz = |step: u32| 1.5e-4 * (1e2 / 1.5e-4_f64).powf(f64::from(step) / 300.0);
    let (mut magnitude, mut nyquist, mut marks) = (Vec::new(), Vec::new(), Vec::new());
    for (colour, (name, cell)) in names.into_iter().zip([ohmic, pairs, whole]).enumerate() {
        let z = impedance(&Arc::new(cell));
        let over_hz = (0..=300).map(|step| (hz(step), 1e3 * z(hz(step)).0.hypot(z(hz(step)).1)));
        magnitude.push(Line::through(name, colour, over_hz.collect()));
        // Without pairs the curve is a point.
        if colour > 0 {
            nyquist.push(Line::through(name, colour, (0..=300).map(|step| (1e3 * z(hz(step)).0, -1e3 * z(hz(step)).1)).collect()));
        }
        if colour == 2 {
            for (hz, text) in [(1e-3, "1 mHz"), (1e-2, "10 mHz"), (0.1, "0.1 Hz")] {
                marks.push(Mark { at: (1e3 * z(hz).0, -1e3 * z(hz).1), text: text.to_owned(), offset: (10, 12) });
            }
        }
    }
    let title = "LiPo cell, 3.7 Ah, at 50 %: impedance";
    let frequency = ("frequency / Hz", 1e-4..100.0);
    Ok(vec![
        Panel::new(title, frequency, ("magnitude / mOhm", 0.0..50.0), magnitude, UpperRight).log_x(),
        Panel::new(
            "The same as a Nyquist plot",
            ("real part / mOhm", 0.0..45.0),
            ("-imaginary part / mOhm", 0.0..25.0),
            nyquist,
            UpperLeft,
        )
        .marked(marks),
    ])
}

/// Resistance of a cell so long after a step of current, ohm.
fn resistance_ohm(cell: &Arc<Model>, soc: f64, after_s: f64) -> f64 {
    const STEP_A: f64 = 1e-3;
    let mut run = Run::new(Arc::clone(cell), Start::at_soc(soc));
    run.channels[Channel::CurrentA] = STEP_A;
    run.step(after_s);
    run.channels[Channel::OverpotentialV] / STEP_A
}

fn cells() -> Result<Vec<Panel>, Box<dyn Error>> {
    let (mut ocv, mut at_once, mut later) = (Vec::new(), Vec::new(), Vec::new());
    for (colour, (name, label)) in CELLS.into_iter().enumerate() {
        let cell = model(name)?;
        let facts = cell.battery();
        let percent = 0.0..100.0;
        ocv.push(Line::of(label, colour, percent.clone(), |soc| facts.ocv.voltage_v(soc / 100.0)));
        let of = |after_s: f64| {
            let cell = &cell;
            Line::of(label, colour, percent.clone(), move |soc| 1e3 * resistance_ohm(cell, soc / 100.0, after_s) * facts.capacity_ah)
        };
        at_once.push(of(1e-3));
        later.push(of(60.0));
    }
    let soc = || ("state of charge / %", 0.0..100.0);
    let unit = "resistance x capacity / (mOhm Ah)";
    Ok(vec![
        Panel::new("Open-circuit voltage", soc(), ("voltage / V", 1.8..4.6), ocv, LowerRight),
        Panel::new("Resistance at once, 25 \u{b0}C", soc(), (unit, 0.0..450.0), at_once, UpperRight),
        Panel::new("Resistance after one minute, 25 \u{b0}C", soc(), (unit, 0.0..450.0), later, UpperRight),
    ])
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "plots".to_owned()));
    let packs = vec![
        discharges("Aquapod's pack, 2s1p 1900 mAh", &model("aquapod-2s1p-1900mah")?, 4.0..8.5),
        discharges("Enertech cell, 2280 mAh", &model("enertech-lco-2280mah-full")?, 2.0..4.25),
    ];
    let figures = [
        ("battery-discharge", 2, packs),
        ("battery-rest", 2, rests()?),
        ("battery-impedance", 2, impedances()?),
        ("battery-cells", 3, cells()?),
        ("battery-measured", 2, measured()?),
    ];
    for (name, columns, panels) in figures {
        for path in save(&folder, name, columns, SIZE, &panels)? {
            println!("{}", path.display());
        }
    }
    Ok(())
}
