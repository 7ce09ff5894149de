//! A battery's first model, made of its own logs: what it holds, its open-circuit voltage over the state of
//! charge, and what its current costs at once.
//!
//! ```text
//!   parts      logs between their gaps
//!     |
//!   counted    a log as charge drawn and voltage of one cell
//!     |   level    what current flows, behind the noise of its readings
//!     |
//!   anchor     where logs are stated to begin, full and empty
//!     |
//!   passage    what lies between: the capacity
//!   course     every row's state of charge
//!     |
//!   shown      what rests and slow currents show of the open-circuit voltage
//!     |   step     resistance, in steps of the current
//!     |   noise    what the voltage's own readings say of their noise
//!     v
//!   solve      the table, and what a slow current costs, by least squares
//!     |
//!   text       all of it as the text of a model
//! ```
//!
//! What is not known of the battery stays unknown: the model that comes of it has the resistance alone, states how
//! roughly its table is known, and is where `discover` begins. A state of charge is a share of what lies between a charge
//! to the full voltage and a slow discharge to the voltage at which it ends.

mod anchor;
mod counted;
mod course;
mod level;
mod noise;
mod parts;
mod passage;
mod shown;
mod solve;
mod step;
mod text;

use energy::Estimate;

use crate::measurement::Log;
use counted::Counted;
pub use passage::{Beginning, Doubted, Passage};
pub use shown::Kind;
pub use solve::{Branch, Table};
pub use text::model_text;

/// What a data sheet says of a battery, and how its logs are to be read.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Name of the model.
    pub name: String,
    /// Cells in series, >= 1.
    pub series: u32,
    /// Cells in parallel, >= 1.
    pub parallel: u32,
    /// Voltage to which a cell is charged, V.
    pub full_v_per_cell: f64,
    /// Voltage of a cell at which a discharge ends, V; below that of a full one.
    pub eod_v_per_cell: f64,
    /// Current of a charge, A.
    pub charge_current_a: Option<f64>,
    /// Current at which a charge ends, A.
    pub charge_cutoff_a: Option<f64>,
    /// Capacity of the pack, Ah, where no log is to say it.
    pub capacity_ah: Option<f64>,
    /// Up to this current, as a share of the capacity per hour, rows show the open-circuit voltage.
    pub slow_per_hour: f64,
}

/// Why no model comes of it. Every message ends with what would help.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OcvError {
    /// A fact of the battery cannot be.
    #[error("{name} = {value}: must be {allowed}")]
    Fact {
        /// The fact.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        allowed: String,
    },
    /// A log has no current or no voltage.
    #[error("{file}: no `{channel}` with a value; its columns: {columns}. Map one by --column {channel}=SOURCE")]
    NoChannel {
        /// The log.
        file: String,
        /// What is missing.
        channel: &'static str,
        /// Columns of the log.
        columns: String,
    },
    /// The voltages are of another number of cells.
    #[error(
        "{file}: its voltages are {low_v:.2} to {high_v:.2} V a cell with {series} in series, and a cell ends at {eod_v} and is full at {full_v} V: \
         check --series, --full-v-per-cell and --eod-v-per-cell"
    )]
    OtherCells {
        /// The log.
        file: String,
        /// Least voltage of a cell, V.
        low_v: f64,
        /// Greatest voltage of a cell, V.
        high_v: f64,
        /// Cells in series.
        series: u32,
        /// Where a discharge ends, V.
        eod_v: f64,
        /// Where a charge ends, V.
        full_v: f64,
    },
    /// Nothing says how much the battery holds.
    #[error(
        "no log runs from full to empty, or back, at a fifth of the capacity an hour or less, so none says what the battery holds: give such a log, say \
         --soc-initial 1 if one begins full, 0 if one begins empty, or give --capacity-ah{because}"
    )]
    NoCapacity {
        /// What logs and ammeters have to do with it; empty where nothing shows that.
        because: String,
    },
    /// Nothing says how full a log begins.
    #[error(
        "{file}: nothing says how full it is anywhere: it is neither charged full nor discharged slowly to the end. Say soc_initial in {facts}, or --soc-initial"
    )]
    NoStart {
        /// The log.
        file: String,
        /// The facts beside it.
        facts: String,
    },
    /// The charge that was counted is impossible.
    #[error(
        "{file}: from {from:.0} % by what is known it goes to {to:.0} % by its current: another battery, a wrong capacity, or a current of the wrong sign{because}"
    )]
    Overrun {
        /// The log.
        file: String,
        /// Where it is known, per cent.
        from: f64,
        /// What follows, per cent.
        to: f64,
        /// What ammeters have to do with it; empty where nothing shows that.
        because: String,
    },
    /// A log does not begin where it is stated to.
    #[error(
        "{file}: it is stated to begin at {soc:.0} %, and shows {shown_v:.3} V a cell at rest there: soc_initial is another, or --full-v-per-cell or --eod-v-per-cell"
    )]
    Begins {
        /// The log.
        file: String,
        /// What is stated, per cent.
        soc: f64,
        /// Its first voltage, V a cell.
        shown_v: f64,
    },
    /// The voltage falls as the charge rises.
    #[error(
        "the voltage falls by {fall_v:.3} V where the charge rises, at {soc:.0} %: is the current of the wrong sign (it is positive out of the battery), is the capacity another, or is a log of another battery?"
    )]
    Falls {
        /// By how much, V a cell.
        fall_v: f64,
        /// Where, per cent.
        soc: f64,
    },
    /// Neither a rest nor a slow current.
    #[error(
        "no log shows the open-circuit voltage at {least} states of charge or more: that takes rests of {rest_min:.0} minutes, or a steady current of at most \
         {slow} of the capacity an hour (--slow-c-rate). The slowest steady current is {slowest} of it{because}"
    )]
    NothingSlow {
        /// Places that a table takes.
        least: usize,
        /// Shortest rest that counts, min.
        rest_min: f64,
        /// The limit.
        slow: f64,
        /// What the logs have.
        slowest: String,
        /// What ammeters have to do with it; empty where nothing shows that.
        because: String,
    },
}

/// What one log gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Used {
    /// Name of the log.
    pub log: String,
    /// How full it begins.
    pub soc_initial: f64,
    /// What says so.
    pub beginning: Beginning,
    /// Least and greatest state of charge.
    pub range: (f64, f64),
    /// Rests that count.
    pub rests: usize,
    /// Places at which a slow current shows the voltage.
    pub slow: usize,
}

/// A battery as its logs show it.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstModel {
    /// What was known before.
    pub sheet: Sheet,
    /// What the pack holds, Ah.
    pub capacity_ah: Estimate,
    /// The passages between full and empty that logs have, the slowest.
    pub passages: Vec<Passage>,
    /// Open-circuit voltage of one cell.
    pub table: Table,
    /// Resistance in steps of the pack's current, ohm for each cell in series, and how many show it.
    pub step_ohm: Option<(Estimate, usize)>,
    /// Noise of one reading of the pack's voltage, V, and the step of its digits.
    pub voltage_noise: noise::Noise,
    /// What each log gave.
    pub used: Vec<Used>,
    /// Logs that begin elsewhere than is stated.
    pub doubted: Vec<Doubted>,
    /// Parts of logs after gaps that were left out: nothing says how full they are anywhere.
    pub unplaced: Vec<String>,
    /// Of logs whose ammeter may be so far off that no rest shows, that in words.
    pub ammeters: Vec<String>,
}

/// Makes a battery's first model of its logs, in canonical channels.
///
/// # Errors
/// Names the fact or the log, and what would help.
pub fn first_model(sheet: &Sheet, logs: &[Log]) -> Result<FirstModel, OcvError> {
    sheet.check()?;
    let parts = parts::parts(logs);
    let counted: Vec<Counted<'_>> = parts.iter().map(|part| Counted::of(&part.log, sheet)).collect::<Result<_, _>>()?;
    let nominal_ah = passage::nominal_ah(sheet, &counted);
    let counted = parts.iter().zip(counted).map(|(part, log)| (part.is_later, log.told(nominal_ah)));
    // What nothing says of how full it is after a gap, says nothing.
    let is_placed = |(is_later, log): &(bool, Counted<'_>)| !is_later || !anchor::anchors(log, sheet, nominal_ah).0.is_empty();
    let (placed, others): (Vec<_>, Vec<_>) = counted.partition(is_placed);
    let counted: Vec<Counted<'_>> = placed.into_iter().map(|(_, log)| log).collect();
    let unplaced = others.into_iter().map(|(_, log)| log.log.name.clone()).collect();
    let known = passage::known(sheet, &counted, nominal_ah)?;
    let noise = noise::noise(&counted, sheet);
    let step_ohm = step::resistance(&counted, &known, noise.per_cell(sheet));
    let shown = shown::shown(&counted, &known, sheet, noise.per_cell(sheet));
    let table = solve::solve(&shown.all, step_ohm.map(|(ohm, _)| ohm), &known)?.ok_or_else(|| OcvError::NothingSlow {
        least: solve::LEAST,
        rest_min: shown::REST_S / 60.0,
        slow: sheet.slow_per_hour,
        slowest: shown.slowest.map_or_else(|| "none".to_owned(), |per_hour| format!("{per_hour:.2}")),
        because: counted::because(&counted),
    })?;
    let used = counted.iter().enumerate().map(|(log, counted)| {
        let soc = &known.soc[log];
        let of = |kind: Kind| shown.all.iter().filter(|shown| shown.log == log && shown.kind == kind).count();
        let range = soc.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &soc| (low.min(soc), high.max(soc)));
        Used {
            log: counted.log.name.clone(),
            soc_initial: soc[0],
            beginning: known.beginnings[log],
            range,
            rests: of(Kind::Rest),
            slow: of(Kind::Slow),
        }
    });
    let used = used.collect();
    Ok(FirstModel {
        sheet: sheet.clone(),
        capacity_ah: known.capacity_ah,
        passages: known.passages,
        table,
        step_ohm,
        voltage_noise: noise,
        used,
        doubted: known.doubted,
        ammeters: counted.iter().filter_map(Counted::never_rests).collect(),
        unplaced,
    })
}

impl Sheet {
    fn check(&self) -> Result<(), OcvError> {
        let fact = |name, value: f64, fits: bool, allowed: &str| {
            if value.is_finite() && fits { Ok(()) } else { Err(OcvError::Fact { name, value, allowed: allowed.to_owned() }) }
        };
        for (name, count) in [("--series", self.series), ("--parallel", self.parallel)] {
            fact(name, f64::from(count), (1..=1000).contains(&count), "between 1 and 1000")?;
        }
        let (full, eod) = (self.full_v_per_cell, self.eod_v_per_cell);
        fact("--eod-v-per-cell", eod, (0.1..10.0).contains(&eod), "between 0.1 and 10")?;
        fact("--full-v-per-cell", full, full > eod && full <= 10.0, &format!("between --eod-v-per-cell ({eod}) and 10"))?;
        let slow = self.slow_per_hour;
        fact("--slow-c-rate", slow, slow > 0.0 && slow <= 2.0, "above 0 and at most 2")?;
        if let Some(capacity_ah) = self.capacity_ah {
            fact("--capacity-ah", capacity_ah, (1e-3..=1e5).contains(&capacity_ah), "between 0.001 and 100000")?;
        }
        let current_a = self.charge_current_a;
        if let Some(current_a) = current_a {
            fact("--charge-current-a", current_a, (1e-3..=1e5).contains(&current_a), "between 0.001 and 100000")?;
        }
        if let Some(cutoff_a) = self.charge_cutoff_a {
            let most = current_a.unwrap_or(1e5);
            fact("--charge-cutoff-a", cutoff_a, (1e-6..=most).contains(&cutoff_a), &format!("between 0.000001 and {most}"))?;
        }
        Ok(())
    }

    /// What a cell lies between when it is full and when its discharge ends, V.
    fn span_v(&self) -> f64 {
        self.full_v_per_cell - self.eod_v_per_cell
    }
}
