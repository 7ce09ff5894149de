//! Units in which columns are taken, against those that their names and a row of units tell. A conversion that the user wrote is right.

use energy::Channel;

use super::hints::{as_flag, conversion, unit};
use super::log::TIME;
use super::{Mapping, Table};

/// What columns are taken in as they are: the name that each gets, and which it is.
fn taken<'a>(table: &'a Table, columns: &'a [Mapping]) -> impl Iterator<Item = (&'a str, usize)> {
    let index_of = |name: &str| table.names.iter().position(|known| known == name);
    let mapped = columns.iter().filter_map(move |mapping| Some((mapping.canonical.as_str(), index_of(&mapping.expression)?)));
    let is_ours = |name: &str| name == TIME || Channel::from_name(name).is_some();
    let is_mapped = |name: &str| columns.iter().any(|mapping| mapping.canonical == name);
    let own = table.names.iter().enumerate().map(|(index, name)| (name.as_str(), index));
    let own = own.filter(move |(name, _)| is_ours(name) && !is_mapped(name));
    // Dates and clocks become seconds by themselves.
    mapped.chain(own).filter(|(name, index)| *name != TIME || table.columns[*index].moments().next().is_none())
}

/// Whether a cell is a unit alone, and no description such as `type K`.
fn is_word(cell: &str) -> bool {
    let bare = cell.trim_matches(['(', ')', '[', ']', '\u{b0}', ' ']);
    !bare.is_empty() && bare.chars().all(char::is_alphanumeric)
}

/// What is to be said of columns whose own names tell another unit than the one that they are taken in.
///
/// # Errors
/// The line of a row of units that tells another one, and what to do.
pub(super) fn doubts(table: &Table, columns: &[Mapping]) -> Result<Vec<String>, (u64, String)> {
    let mut notes = Vec::new();
    for (wanted, index) in taken(table, columns) {
        let name = &table.names[index];
        let flag = |how: &str| as_flag(wanted, name, how);
        if let Some(units) = &table.units {
            let said = units.of[index].as_str();
            match conversion(wanted, said) {
                "" if unit(said) == unit(wanted) => continue,
                how if !how.is_empty() && is_word(said) => {
                    let message = format!(
                        "this line says `{said}` of column `{name}`, which is taken as `{wanted}`: {} converts it; where the line is wrong, {} says so",
                        flag(how),
                        flag("*1")
                    );
                    return Err((units.line, message));
                }
                _ => {}
            }
        }
        match conversion(wanted, name) {
            "" => {}
            how => notes.push(format!(
                "`{wanted}` is `{name}` as it is, whose name tells another unit: {} converts it; where the name is wrong, {} says so",
                flag(how),
                flag("*1")
            )),
        }
    }
    Ok(notes)
}

#[cfg(test)]
mod tests {
    use super::super::{LogFacts, read_log};

    /// What is noted of a log of these columns, or why it is refused.
    fn told(text: &str, columns: &[&str]) -> Result<Vec<String>, String> {
        let columns = columns.iter().map(|text| text.parse().unwrap()).collect();
        read_log("a.csv", text.as_bytes(), LogFacts { columns, ..LogFacts::default() }).map(|log| log.notes).map_err(|e| e.to_string())
    }

    #[test]
    fn a_name_that_tells_another_unit_is_told_unless_a_conversion_was_written() {
        let text = "time_min,current_ma,T(F),U(V)\n0,1,70,3.7\n1,1,70,3.7\n";
        let all = ["time_s=time_min", "current_a=current_ma", "temperature_degc=T(F)", "voltage_v=U(V)"];
        let notes = told(text, &all).unwrap();
        assert_eq!(
            notes[1],
            "a.csv: `current_a` is `current_ma` as it is, whose name tells another unit: --column current_a=current_ma/1000 converts it; where \
             the name is wrong, --column current_a=current_ma*1 says so"
        );
        assert_eq!(notes.len(), 3, "{notes:?}");
        assert!(notes[0].contains("time_s=time_min*60") && notes[2].contains("T(F)*0.5555555556-17.7777777778"), "{notes:?}");
        let written = ["time_s=time_min*60", "current_a=current_ma*1", "temperature_degc=T(F)*0.5556-17.78", "voltage_v=U(V)"];
        assert_eq!(told(text, &written), Ok(Vec::new()));
    }

    #[test]
    fn a_row_of_units_that_contradicts_is_refused_and_one_that_agrees_settles_a_name() {
        let log = |units: &str| format!("time_s,current_a,u_mv\n{units}\n0,1,3.7\n1,1,3.7\n");
        assert_eq!(
            told(&log("s,mA,V"), &[]).unwrap_err(),
            "a.csv:2: this line says `mA` of column `current_a`, which is taken as `current_a`: --column current_a=current_a/1000 converts \
             it; where the line is wrong, --column current_a=current_a*1 says so"
        );
        assert!(told(&log("min,A,V"), &[]).unwrap_err().contains("--column time_s=time_s*60 converts it"));
        assert!(told(&log("s,mA,V"), &["current_a=current_a/1000"]).is_ok());
        // Words of a description end in letters that are units elsewhere.
        assert_eq!(told(&log("s,type mA,V"), &[]).unwrap().len(), 1);
        assert!(told(&log("s,[mA],V"), &[]).unwrap_err().contains("`[mA]` of column `current_a`"));
        let degrees = |unit: &str| told(&format!("time_s,temperature_degc\ns,{unit}\n0,25\n1,25\n"), &[]);
        assert_eq!(degrees("type K").unwrap().len(), 1);
        assert!(degrees("(\u{b0}F)").unwrap_err().contains("`(\u{b0}F)` of column"));
        assert!(degrees("K").is_err());
        // By its name alone the voltage would be doubted.
        assert_eq!(told(&log("s,A,V"), &["voltage_v=u_mv"]).unwrap().len(), 1);
        assert_eq!(told(&log("s,A,-"), &["voltage_v=u_mv"]).unwrap().len(), 2);
    }
}
