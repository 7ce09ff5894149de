//! Truths of another kind: logs of single-particle cells with electrolyte and temperature, made
//! once by `data/make.py` with PyBaMM.

use energy::{Channel, OcvTable, Start};

use crate::world::Course;

/// Files of a cell: name of the log, text.
type Files = &'static [(&'static str, &'static str)];

/// A cell.
#[derive(Debug)]
pub struct Cell {
    /// Name.
    pub name: &'static str,
    /// Charge between full and empty, Ah, as the parameter set gives it.
    pub capacity_ah: f64,
    /// Voltage of the full and the empty cell, V.
    pub limits_v: (f64, f64),
    ocv: &'static str,
    logs: Files,
}

macro_rules! logs {
    ($cell:literal) => {
        &[
            ("train-1", include_str!(concat!("../data/", $cell, "-train-1.csv"))),
            ("train-2", include_str!(concat!("../data/", $cell, "-train-2.csv"))),
            ("train-3", include_str!(concat!("../data/", $cell, "-train-3.csv"))),
            ("train-4", include_str!(concat!("../data/", $cell, "-train-4.csv"))),
            ("holdout-1", include_str!(concat!("../data/", $cell, "-holdout-1.csv"))),
            ("holdout-2", include_str!(concat!("../data/", $cell, "-holdout-2.csv"))),
        ]
    };
}

/// Every cell.
pub const CELLS: &[Cell] = &[
    Cell {
        name: "chen2020",
        capacity_ah: 5.1532,
        limits_v: (4.2, 2.5),
        ocv: include_str!("../data/chen2020-ocv.csv"),
        logs: logs!("chen2020"),
    },
    Cell { name: "ai2020", capacity_ah: 2.4663, limits_v: (4.2, 3.0), ocv: include_str!("../data/ai2020-ocv.csv"), logs: logs!("ai2020") },
];

/// State of charge and ambient temperature at the start of each log, as `data/make.py` sets them.
const STARTS: [(f64, f64); 6] = [(0.95, 25.0), (0.9, 8.0), (0.2, 25.0), (0.55, 8.0), (0.85, 16.0), (0.35, 25.0)];

impl Cell {
    /// Its open-circuit voltage.
    #[must_use]
    pub fn ocv(&self) -> OcvTable {
        let [soc, voltage_v] = columns(self.ocv);
        OcvTable::new(soc, voltage_v).unwrap_or_else(|error| panic!("{}: {error}", self.name))
    }

    /// What truly happened, log by log.
    #[must_use]
    pub fn courses(&self) -> Vec<Course> {
        let course = |(&(name, text), (soc, ambient_degc)): (&(&str, &str), (f64, f64))| {
            let [time_s, current_a, voltage_v, temperature_degc] = columns(text);
            let history = if soc > 0.6 { -1.0 } else { 1.0 };
            let start = Start { soc, temperature_degc: ambient_degc, cycle_count: 0.0, age_days: 0.0, history, clock_s: 0.0 };
            let all = |value: f64| vec![value; time_s.len()];
            let columns = vec![
                (Channel::AmbientDegc, all(ambient_degc)),
                (Channel::CycleCount, all(0.0)),
                (Channel::AgeDays, all(0.0)),
                (Channel::CurrentA, current_a),
                (Channel::VoltageV, voltage_v),
                (Channel::TemperatureDegc, temperature_degc),
            ];
            Course { name: name.to_owned(), holdout: name.starts_with("holdout"), start, time_s, columns }
        };
        self.logs.iter().zip(STARTS).map(course).collect()
    }
}

fn columns<const N: usize>(text: &str) -> [Vec<f64>; N] {
    let mut columns = [const { Vec::new() }; N];
    for line in text.lines().skip(1) {
        for (column, cell) in columns.iter_mut().zip(line.split(',')) {
            column.push(cell.parse().expect("made by the script"));
        }
    }
    columns
}
