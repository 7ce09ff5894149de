//! The open-circuit curve of a cell as it is: what the model makes of its table.

use std::sync::Arc;

use crate::effect::Phase;
use crate::{Channel, Model, OcvTable, Run, Start};

/// Parts of the whole charge between which the curve is a straight line.
const PARTS: u32 = 400;

/// The curve that a gauge reads at rest, at the reference temperature: the model's table, moved by what
/// moves the equilibrium (age). The table itself where nothing does, or where the result would fall with
/// the charge, which no gauge can read.
pub(super) fn curve(model: &Arc<Model>) -> OcvTable {
    let table = &model.battery().ocv;
    if model.placed_in(Phase::Equilibrium).is_empty() {
        return table.clone();
    }
    let soc: Vec<f64> = (0..=PARTS).map(|part| f64::from(part) / f64::from(PARTS)).collect();
    let rested_v = |&soc: &f64| {
        let mut run = Run::new(Arc::clone(model), Start::at_soc(soc));
        run.step(1e-3);
        run.channels[Channel::OcvV]
    };
    let voltage_v = soc.iter().map(rested_v).collect();
    OcvTable::new(soc, voltage_v).unwrap_or_else(|_| table.clone())
}
