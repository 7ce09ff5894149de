//! A measured converter: a plain efficiency fails at light load, a fixed need repairs it.
//!
//! Data: a 12 V buck-boost supply under five loads (github jorge-pais/PE_universal12Vsupply,
//! CERN-OHL-P-2.0), present on development machines only.

use std::path::Path;
use std::sync::Arc;

use energy::{Channel, Model, Run, Start};
use nalgebra::{DMatrix, DVector};

/// Not recorded; it scales watts into amperes and cancels in every residual.
const INPUT_V: f64 = 18.0;

fn measured() -> Option<Vec<(f64, f64)>> {
    let file = "shared/data/dcdc_12v_buckboost/load_regulation.csv";
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|folder| folder.join(file)).find(|path| path.exists())?;
    let text = std::fs::read_to_string(path).ok()?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next()?.split(',').collect();
    let column = |name: &str| names.iter().position(|known| *known == name).expect(name);
    let (output_w, input_a) = (column("pout_w"), column("iin_a"));
    let rows = lines.map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect::<Vec<f64>>());
    Some(rows.map(|row| (row[output_w], row[input_a])).collect())
}

/// Input current of a robot whose only load is `output_w`, behind the quadratic converter.
fn input_a(parameters: [f64; 3], output_w: f64) -> f64 {
    let text = "schema = 1\nsystem = \"robot\"\nname = \"bench\"\n[[effect]]\nid = \"idle\"\n[[effect]]\nid = \"converter_quadratic\"\n";
    let model = Arc::new(Model::parse("bench", text, &|_| unreachable!()).unwrap());
    let values = [vec![output_w], parameters.to_vec()].concat();
    let mut run = Run::with_parameters(model, values, Start::at_soc(0.0));
    run.step(1.0);
    run.channels[Channel::PowerW] / INPUT_V
}

/// Root mean square of the residual current after least squares over some of the parameters. The
/// model is linear in each, so its answer to a unit step is a column of the fit.
fn residual_a(rows: &[(f64, f64)], free: &[usize]) -> f64 {
    let base: Vec<f64> = rows.iter().map(|&(output_w, _)| input_a([0.0; 3], output_w)).collect();
    let column = |parameter: usize, row: usize| {
        let mut unit = [0.0; 3];
        unit[parameter] = 1.0;
        input_a(unit, rows[row].0) - base[row]
    };
    let columns = DMatrix::from_fn(rows.len(), free.len(), |row, index| column(free[index], row));
    let wanted = DVector::from_fn(rows.len(), |row, _| rows[row].1 - base[row]);
    let found = columns.clone().svd(true, true).solve(&wanted, 1e-12).unwrap();
    ((&columns * found - wanted).norm_squared() / rows.len() as f64).sqrt()
}

#[test]
fn a_fixed_need_brings_a_measured_converter_from_60_to_4_milliamperes() {
    let Some(rows) = measured() else { return };
    let (proportional_a, fixed_too_a, all_a) = (residual_a(&rows, &[1]), residual_a(&rows, &[0, 1]), residual_a(&rows, &[0, 1, 2]));
    assert!((proportional_a - 0.060).abs() < 0.001, "{proportional_a}");
    assert!(fixed_too_a < 0.0045, "{fixed_too_a}");
    assert!(all_a <= fixed_too_a, "{all_a}");
}
