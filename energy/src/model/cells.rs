//! Reads how single cells of a pack differ, and what balances them.
//!
//! ```toml
//! [[battery.cell]]            # counted from 1
//! series = 2                  # the second in series
//! parallel = 3                # the third of its group; all of the group when left out
//! capacity_factor = 0.93      # times the capacity of the pack's other cells
//! resistance_factor = 1.2     # times what every resistance of the model says
//! soc_offset = -0.02          # against the state of charge that a run starts from
//! self_discharge_factor = 5.0 # times the charge that is lost inside the cell
//!
//! [battery.balancing]         # passive: a resistor past the cell
//! bypass_a_max = 0.01
//! start_v = 3.9
//! difference_v = 0.01
//! at_rest = true
//! ```

use std::collections::BTreeSet;

use serde::Deserialize;
use toml::Spanned;

use crate::document::{Document, DocumentError};
use crate::pack::{Balancing, CellFactors, UnlikeCell};
use crate::system::BatteryFacts;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCell {
    series: u32,
    parallel: Option<u32>,
    #[serde(default = "one")]
    capacity_factor: f64,
    #[serde(default = "one")]
    resistance_factor: f64,
    #[serde(default)]
    soc_offset: f64,
    #[serde(default = "one")]
    self_discharge_factor: f64,
}

fn one() -> f64 {
    1.0
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawBalancing {
    bypass_a_max: f64,
    start_v: f64,
    difference_v: f64,
    #[serde(default)]
    at_rest: bool,
}

fn within(table: &str, name: &str, value: f64, min: f64, max: f64) -> Result<f64, String> {
    if value.is_finite() && (min..=max).contains(&value) {
        Ok(value)
    } else {
        Err(format!("{table}.{name} = {value}: must be between {min} and {max}"))
    }
}

/// Checks cells: each within the pack, none named twice, every factor in its range.
pub(super) fn cells(
    document: &Document<'_>,
    raw: Vec<Spanned<RawCell>>,
    series: u32,
    parallel: u32,
) -> Result<Vec<UnlikeCell>, DocumentError> {
    let (mut named, mut cells) = (BTreeSet::new(), Vec::new());
    for raw in raw {
        let span = raw.span();
        cells.push(cell(raw.into_inner(), series, parallel, &mut named).map_err(|message| document.error_at(span, message))?);
    }
    Ok(cells)
}

fn cell(raw: RawCell, series: u32, parallel: u32, named: &mut BTreeSet<(u32, u32)>) -> Result<UnlikeCell, String> {
    let place = |name: &str, value: u32, count: u32| {
        let message = || format!("battery.cell.{name} = {value}: the pack has {count} in {name}, counted from 1");
        if (1..=count).contains(&value) { Ok(value - 1) } else { Err(message()) }
    };
    let factor = |name: &str, value: f64, min: f64, max: f64| within("battery.cell", name, value, min, max);
    let cell = UnlikeCell {
        series: place("series", raw.series, series)?,
        parallel: raw.parallel.map(|value| place("parallel", value, parallel)).transpose()?,
        factors: CellFactors {
            capacity: factor("capacity_factor", raw.capacity_factor, 0.05, 2.0)?,
            resistance: factor("resistance_factor", raw.resistance_factor, 0.1, 20.0)?,
            soc_offset: factor("soc_offset", raw.soc_offset, -0.5, 0.5)?,
            self_discharge: factor("self_discharge_factor", raw.self_discharge_factor, 0.0, 1000.0)?,
        },
    };
    for index in cell.parallel.map_or(0..parallel, |index| index..index + 1) {
        if !named.insert((cell.series, index)) {
            return Err(format!("battery.cell: the cell series = {}, parallel = {} is described twice", cell.series + 1, index + 1));
        }
    }
    Ok(cell)
}

/// Checks what balances the cells.
pub(super) fn balancing(document: &Document<'_>, raw: Spanned<RawBalancing>, facts: &BatteryFacts) -> Result<Balancing, DocumentError> {
    let span = raw.span();
    let raw = raw.into_inner();
    let number = |name: &str, value: f64, min: f64, max: f64| {
        within("battery.balancing", name, value, min, max).map_err(|message| document.error_at(span.clone(), message))
    };
    Ok(Balancing {
        bypass_a_max: number("bypass_a_max", raw.bypass_a_max, 1e-6, facts.charge.current_a.max(1e-6))?,
        start_v: number("start_v", raw.start_v, 0.0, facts.full_v_per_cell)?,
        difference_v: number("difference_v", raw.difference_v, 0.0, 1.0)?,
        at_rest: raw.at_rest,
    })
}

#[cfg(test)]
mod tests {
    use crate::Model;

    fn parsed(extra: &str) -> Result<Model, String> {
        let text = format!(
            "schema = 1\nsystem = \"battery\"\nname = \"p\"\n[battery]\nseries = 3\nparallel = 2\ncapacity_ah = 4.0\n\
             full_v_per_cell = 4.2\neod_v_per_cell = 3.0\ncharge_current_a = 4.0\ncharge_cutoff_a = 0.2\n\
             ocv = {{ soc = [0.0, 1.0], voltage_v = [3.0, 4.2] }}\n{extra}"
        );
        Model::parse("p.toml", &text, &|_| unreachable!()).map_err(|error| error.to_string())
    }

    #[test]
    fn cells_are_counted_from_one_and_a_group_is_all_its_cells() {
        let model = parsed("[[battery.cell]]\nseries = 3\ncapacity_factor = 0.9\n[[battery.cell]]\nseries = 1\nparallel = 2\n").unwrap();
        let facts = model.battery();
        assert_eq!((facts.factors(2, 0).capacity, facts.factors(2, 1).capacity, facts.factors(0, 1).capacity), (0.9, 0.9, 1.0));
    }

    #[test]
    fn what_is_wrong_with_a_cell_is_said_with_its_place_and_what_is_allowed() {
        let refused = |extra: &str| parsed(extra).unwrap_err();
        assert!(refused("[[battery.cell]]\nseries = 4\n").contains("the pack has 3 in series, counted from 1"));
        assert!(refused("[[battery.cell]]\nseries = 0\n").contains("counted from 1"));
        assert!(refused("[[battery.cell]]\nseries = 1\nparallel = 3\n").contains("the pack has 2 in parallel"));
        let near = refused("[[battery.cell]]\nseries = 1\ncapacity_facto = 0.9\n");
        assert!(near.contains("did you mean `capacity_factor`?") && near.starts_with("p.toml:15:"), "{near}");
        assert!(refused("[[battery.cell]]\nseries = 1\nresistance_factor = 0.0\n").contains("resistance_factor = 0: must be between"));
        assert!(refused("[[battery.cell]]\nseries = 1\nsoc_offset = nan\n").contains("soc_offset = NaN"));
        let twice = refused("[[battery.cell]]\nseries = 2\n[[battery.cell]]\nseries = 2\nparallel = 1\n");
        assert!(twice.contains("series = 2, parallel = 1 is described twice"), "{twice}");
        let near = refused("[battery.balancing]\nbypass_a = 0.1\nstart_v = 4.0\ndifference_v = 0.01\n");
        assert!(near.contains("did you mean `bypass_a_max`?"), "{near}");
        assert!(refused("[battery.balancing]\nbypass_a_max = 0.1\nstart_v = 5.0\ndifference_v = 0.01\n").contains("start_v = 5: must be"));
    }
}
