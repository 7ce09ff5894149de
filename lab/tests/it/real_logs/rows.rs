//! Rows of measured logs, read and written as a user's own script would.

use std::fmt::Write as _;
use std::path::Path;

/// A CSV file as it stands.
pub struct Csv {
    names: Vec<String>,
    pub cells: Vec<Vec<String>>,
}

impl Csv {
    pub fn read(path: &Path) -> Csv {
        let text = std::fs::read_to_string(path).unwrap();
        let split = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
        let mut lines = text.lines().map(split);
        Csv { names: lines.next().unwrap(), cells: lines.collect() }
    }

    fn place(&self, name: &str) -> usize {
        self.names.iter().position(|known| known == name).unwrap_or_else(|| panic!("no column {name}"))
    }

    pub fn text<'a>(&self, row: &'a [String], name: &str) -> &'a str {
        &row[self.place(name)]
    }

    /// A number of a row; NaN where the cell is empty.
    pub fn number(&self, row: &[String], name: &str) -> f64 {
        self.text(row, name).parse().unwrap_or(f64::NAN)
    }

    pub fn numbers(&self, name: &str) -> Vec<f64> {
        self.cells.iter().map(|row| self.number(row, name)).collect()
    }
}

/// What a battery's log holds at one time.
#[derive(Clone, Copy)]
pub struct Row {
    pub time_s: f64,
    pub current_a: f64,
    pub voltage_v: f64,
    pub temperature_degc: f64,
}

/// A battery's log; the temperature is none where it was not measured.
pub fn battery(csv: &Csv) -> Vec<Row> {
    let measured = csv.names.iter().any(|name| name == "temperature_c");
    let row = |row: &Vec<String>| Row {
        time_s: csv.number(row, "time_s"),
        current_a: csv.number(row, "current_a"),
        voltage_v: csv.number(row, "voltage_v"),
        temperature_degc: if measured { csv.number(row, "temperature_c") } else { f64::NAN },
    };
    csv.cells.iter().map(row).collect()
}

/// Charge drawn since the first row, Ah: the current of a row holds over the interval that ends there.
pub fn drawn_ah(rows: &[Row]) -> Vec<f64> {
    let mut drawn = vec![0.0];
    for pair in rows.windows(2) {
        drawn.push(drawn[drawn.len() - 1] + pair[1].current_a * (pair[1].time_s - pair[0].time_s) / 3600.0);
    }
    drawn
}

/// Takes away the voltages below 2 % of charge, where the open-circuit table of a cell falls by a volt.
pub fn above_empty(mut rows: Vec<Row>, soc_initial: f64, capacity_ah: f64) -> Vec<Row> {
    let drawn = drawn_ah(&rows);
    for (row, drawn_ah) in rows.iter_mut().zip(drawn) {
        if soc_initial - drawn_ah / capacity_ah < 0.02 {
            row.voltage_v = f64::NAN;
        }
    }
    rows
}

/// Writes a log and its facts; a number that is none becomes an empty cell.
pub fn write(directory: &Path, name: &str, columns: &str, rows: &[Vec<f64>], facts: &str) -> String {
    let mut text = format!("{columns}\n");
    for row in rows {
        let cells: Vec<String> = row.iter().map(|value| if value.is_nan() { String::new() } else { value.to_string() }).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    std::fs::write(directory.join(format!("{name}.csv")), text).unwrap();
    std::fs::write(directory.join(format!("{name}.toml")), format!("schema = 1\n{facts}")).unwrap();
    format!("{name}.csv")
}

/// Writes a battery's log under the names that the data have, with the charge that it begins with and more facts.
pub fn write_battery(directory: &Path, name: &str, rows: &[Row], soc_initial: f64, facts: &str) -> String {
    let cell = |row: &Row| vec![row.time_s, row.current_a, row.voltage_v, row.temperature_degc];
    let mut cells: Vec<Vec<f64>> = rows.iter().map(cell).collect();
    let mut facts = format!("soc_initial = {:.5}\nambient_degc = 25.0\n{facts}", soc_initial.min(1.0));
    let measured = rows.iter().any(|row| row.temperature_degc.is_finite());
    let columns = if measured { "time_s,current_a,voltage_v,temperature_c" } else { "time_s,current_a,voltage_v" };
    if measured {
        facts.push_str("[columns]\ntemperature_degc = \"temperature_c\"\n");
    } else {
        cells.iter_mut().for_each(|row| row.truncate(3));
    }
    write(directory, name, columns, &cells, &facts)
}

/// An open-circuit table as a model file holds it: voltages that do not fall as charge rises.
pub fn table(mut points: Vec<(f64, f64)>) -> String {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut rising: Vec<(f64, f64)> = Vec::new();
    for (soc, voltage_v) in points {
        if rising.last().is_none_or(|last| soc > last.0 + 1e-4 && voltage_v >= last.1) {
            rising.push((soc, voltage_v));
        }
    }
    let (soc, voltage_v): (Vec<f64>, Vec<f64>) = rising.into_iter().unzip();
    format!("ocv = {{ soc = {soc:?}, voltage_v = {voltage_v:?} }}\n")
}

/// The straight line through the points beside a place; the nearest point beyond the ends.
pub fn interpolate(points: &[(f64, f64)], at: f64) -> f64 {
    let next = points.partition_point(|(x, _)| *x < at);
    match (next.checked_sub(1).map(|place| points[place]), points.get(next)) {
        (Some((a, from)), Some(&(b, to))) => from + (to - from) * (at - a) / (b - a),
        (Some((_, last)), None) => last,
        (None, first) => first.unwrap().1,
    }
}
