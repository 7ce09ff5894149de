//! A made-up cell, of which every number is known.

use std::sync::Arc;

use energy::Model;

/// The cell without sensors and effects.
const CELL: &str = r#"
schema = 1
system = "battery"
name = "synthetic"
[battery]
series = 1
parallel = 1
capacity_ah = 2.0
full_v_per_cell = 4.2
eod_v_per_cell = 3.0
charge_current_a = 1.0
charge_cutoff_a = 0.1
ocv = { soc = [0.0, 0.2, 1.0], voltage_v = [3.0, 3.6, 4.2] }
"#;

/// The text of the cell's file, with what follows.
pub fn text(rest: &str) -> String {
    format!("{CELL}{rest}")
}

/// The cell with what follows in its file.
pub fn model(rest: &str) -> Arc<Model> {
    pack(1, rest)
}

/// So many of these cells in series.
pub fn pack(series: u32, rest: &str) -> Arc<Model> {
    let cells = CELL.replace("series = 1", &format!("series = {series}"));
    Arc::new(Model::parse("synthetic.toml", &format!("{cells}{rest}"), &|_| Err("no table".to_owned())).unwrap())
}
