//! Why a log does not fit a model.

use energy::Channel;

/// Why a log does not fit a model.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// Columns are not there.
    #[error("{file}: {} Columns: {columns}.{}", lacks(.missing), ways(.missing, .facts))]
    MissingChannels {
        /// The log.
        file: String,
        /// Which, at least one.
        missing: Vec<Missing>,
        /// What the log has.
        columns: String,
        /// The file for facts beside it.
        facts: String,
    },
    /// A column is there but holds no number.
    #[error("{file}: column `{channel}`, which {needed_by} needs, holds no number")]
    EmptyChannel {
        /// The log.
        file: String,
        /// The channel.
        channel: &'static str,
        /// Who needs it.
        needed_by: String,
    },
    /// Nobody says how full the battery is at the start.
    #[error(
        "{file}: the state of charge at the first row is not known: give --soc-initial (0 to 1), or --rest-voltage-v (pack voltage after a long rest), or soc_initial / rest_voltage_v in {facts}{}", begins(*.soc)
    )]
    NoStart {
        /// The log.
        file: String,
        /// The file for facts beside it.
        facts: String,
        /// Where a column of the state of charge begins, if there is one.
        soc: Option<f64>,
    },
    /// The rest voltage cannot be one of this battery.
    #[error("{file}: rest_voltage_v = {rest_v} is {per_cell_v:.3} V per cell; the OCV table reaches from {low_v} to {high_v} V")]
    RestVoltage {
        /// The log.
        file: String,
        /// Given, V.
        rest_v: f64,
        /// Per cell, V.
        per_cell_v: f64,
        /// Lowest of the table, V.
        low_v: f64,
        /// Highest of the table, V.
        high_v: f64,
    },
    /// What there is to compare with holds no number.
    #[error("{file}: nothing to compare with: no row of `{columns}` after the first holds a number")]
    EmptyTargets {
        /// The log.
        file: String,
        /// The columns.
        columns: String,
    },
    /// What there is to compare with was measured only where inputs were not.
    #[error("{file}: nothing to compare with: `{columns}` holds a number only in rows in which an input of the model does not")]
    NoCommonRow {
        /// The log.
        file: String,
        /// The columns.
        columns: String,
    },
    /// There is nothing to compare with.
    #[error("{file}: nothing to compare with: a {system} model predicts {predicted}{hint} Columns: {columns}")]
    NoTarget {
        /// The log.
        file: String,
        /// The system.
        system: &'static str,
        /// What its models predict.
        predicted: String,
        /// Nearest column, if there is one, and what it needs to predict that and is not there either.
        hint: String,
        /// What the log has.
        columns: String,
    },
}

/// A column that is not there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Missing {
    /// The channel.
    pub channel: Channel,
    /// Who needs it.
    pub needed_by: String,
    /// What comes near, as the end of a sentence.
    pub hint: String,
    /// The flag that maps a column to it; empty where none can.
    pub flag: String,
}

impl Missing {
    /// One number for every row of this log, as the file beside it says it.
    fn constant(&self) -> String {
        match self.channel {
            Channel::AmbientDegc => "`ambient_degc = NUMBER`".to_owned(),
            channel => format!("`{} = \"NUMBER\"` under [columns]", channel.name()),
        }
    }

    /// The flag for that, which is for every log of a command.
    fn constant_of_all(&self) -> String {
        match self.channel {
            // Of logs that hold the column it says nothing.
            Channel::AmbientDegc => "--ambient-degc NUMBER for every log without that column".to_owned(),
            channel => format!("--column {}=NUMBER, which every log then has in place of what it measured", channel.name()),
        }
    }
}

fn lacks(missing: &[Missing]) -> String {
    let one = |(place, one): (usize, &Missing)| {
        let no = if place == 0 { "no" } else { "No" };
        format!("{no} column `{}`, which {} needs{}", one.channel.name(), one.needed_by, one.hint)
    };
    missing.iter().enumerate().map(one).collect::<Vec<_>>().join(" ")
}

fn ways(missing: &[Missing], facts: &str) -> String {
    let flags: Vec<&str> = missing.iter().map(|one| one.flag.as_str()).filter(|flag| !flag.is_empty()).collect();
    let map = if flags.is_empty() { String::new() } else { format!(" Map with {}.", flags.join(" ")) };
    // Where a column comes near, that is what is meant.
    let unlike = || missing.iter().filter(|one| one.hint == "." || one.channel == Channel::AmbientDegc);
    let numbers: Vec<String> = unlike().map(Missing::constant).collect();
    let of_all: Vec<String> = unlike().map(Missing::constant_of_all).collect();
    if numbers.is_empty() {
        return map;
    }
    format!("{map} Or give one number for all rows of this log: {} in {facts} (or {})", numbers.join(" and "), of_all.join("; "))
}

fn begins(soc: Option<f64>) -> String {
    soc.map_or_else(String::new, |soc| format!("; its soc column begins at {soc}: --soc-initial {soc}"))
}
