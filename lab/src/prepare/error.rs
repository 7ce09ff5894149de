//! Why a log does not fit a model.

/// Why a log does not fit a model.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// A column is not there.
    #[error(
        "{file}: no column `{channel}`, which {needed_by} needs{hint} Columns: {columns}. Map one with --column {channel}=SOURCE, or give one number for all rows: --column {channel}=NUMBER"
    )]
    MissingChannel {
        /// The log.
        file: String,
        /// The channel.
        channel: &'static str,
        /// Who needs it.
        needed_by: String,
        /// Nearest column, or nothing.
        hint: String,
        /// What the log has.
        columns: String,
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
        "{file}: the state of charge at the first row is not known: give --soc-initial (0 to 1), or --rest-voltage-v (pack voltage after a long rest), or soc_initial / rest_voltage_v in {facts}"
    )]
    NoStart {
        /// The log.
        file: String,
        /// The file for facts beside it.
        facts: String,
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
        /// Nearest column, or nothing.
        hint: String,
        /// What the log has.
        columns: String,
    },
}
