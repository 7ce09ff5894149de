//! Currents that a cycler writes without a sign, with its direction in a column beside them.

use std::collections::BTreeMap;

use energy::Channel;

use super::Table;
use super::mapping::Source;
use super::selection::Selection;

/// In which rows current flows into the battery, as the user says; empty where it is written with its sign. Logs in which nothing is charged
/// have no such row, which is noted.
pub(super) fn rows_that_charge(
    table: &Table,
    charging: &[Selection],
    mapped: &BTreeMap<&str, Source>,
    notes: &mut Vec<String>,
) -> Result<Vec<bool>, String> {
    let mut charges = if charging.is_empty() { Vec::new() } else { vec![false; table.lines.len()] };
    for selection in charging {
        let rows = selection.marks(table, mapped)?;
        if !rows.contains(&true) {
            notes.push(format!("--charging {}", selection.no_row(table, mapped)));
        }
        charges.iter_mut().zip(rows).for_each(|(charges, row)| *charges |= row);
    }
    Ok(charges)
}

/// Gives a current its sign: negative where it charges. Other rows are as they were written.
pub(super) fn sign(channel: Channel, values: &mut [f64], charges: &[bool]) {
    if matches!(channel, Channel::CurrentA | Channel::PackCurrentA) {
        values.iter_mut().zip(charges).filter(|(_, charges)| **charges).for_each(|(value, _)| *value = -value.abs());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::{LogFacts, read_log};

    #[test]
    fn a_current_without_a_sign_flows_in_where_a_column_says_so() {
        let text = "time_s,current_a,voltage_v,State\n0,0,3.7,R\n1,1.5,3.6,D\n2,1.5,3.8,C\n3,-0.5,3.9,C\n4,0.2,4.0,T\n";
        let read = |charging: &[&str]| {
            let charging = charging.iter().map(|one| one.parse().unwrap()).collect();
            read_log("maccor.csv", text.as_bytes(), LogFacts { charging, ..LogFacts::default() })
        };
        let current_a = |charging: &[&str]| read(charging).unwrap().channels[&Channel::CurrentA].clone();
        assert_eq!(current_a(&[]), [0.0, 1.5, 1.5, -0.5, 0.2]);
        assert_eq!(current_a(&["State=C"]), [0.0, 1.5, -1.5, -0.5, 0.2]);
        assert_eq!(current_a(&["State=C", "State=T"]), [0.0, 1.5, -1.5, -0.5, -0.2]);
        // Another log of the same command may only be discharged.
        let none = read(&["State=X"]).unwrap();
        assert!(none.notes[0].contains("--charging State=X: no row is like that; `State` holds `R`, `D`"), "{:?}", none.notes);
        assert!(read(&["state=C"]).unwrap_err().to_string().contains("the log has no column `state`; did you mean `State`?"));
    }
}
