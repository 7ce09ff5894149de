//! Facts about one log: from a TOML file beside it (same stem) or from flags.

use std::collections::BTreeMap;
use std::path::PathBuf;

use energy::DocumentError;
use energy::document::{Document, hint};
use serde::{Deserialize, Serialize};

use super::{Mapping, Mark, Selection};

/// How the state of charge at the start was reached: it sets the branch of the hysteresis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum History {
    /// By charging.
    Charged,
    /// By discharging.
    Discharged,
}

/// What a log is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// To fit models.
    Train,
    /// To judge them.
    Holdout,
}

/// What the current of the row after a gap says of the gap. A logger that stopped knows nothing of what flowed; one that
/// writes little while a battery is stored, or a gauge that counted on, does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum GapCurrent {
    /// It held over all of it, as that of every row does over its interval.
    Stated,
    /// Nothing.
    Unknown,
}

/// What is known about a log beside its rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LogFacts {
    /// Where its rows stand, seen from the file of these facts, when that is not the file of the same name.
    pub log: Option<PathBuf>,
    /// What its rows must hold to be read.
    pub rows: Vec<Selection>,
    /// In which rows current flows into the battery, where the logger writes it without a sign; each of these says some.
    pub charging: Vec<Selection>,
    /// Cell or robot.
    pub id: Option<String>,
    /// State of charge at the first row that is read, 0..1.
    pub soc_initial: Option<f64>,
    /// Standard deviation of it.
    pub soc_initial_sigma: Option<f64>,
    /// Pack voltage after a long rest before the log, V.
    pub rest_voltage_v: Option<f64>,
    /// How the initial state of charge was reached.
    pub history: Option<History>,
    /// Temperature of the surroundings, °C, when no column holds it.
    pub ambient_degc: Option<f64>,
    /// Standard deviation of it, K; none where it is known exactly.
    pub ambient_sigma_k: Option<f64>,
    /// Whether it is what a battery's own sensor read, and no better known than that.
    pub ambient_is_read: bool,
    /// What is known of its gaps; as of an accident, nothing, where this says nothing.
    pub gap_current: Option<GapCurrent>,
    /// Time from the first row over which what was before the log may still show, s: nothing is compared there.
    pub settling_s: Option<f64>,
    /// What the log is used for.
    pub role: Option<Role>,
    /// Numbers that this logger writes when nothing was measured.
    pub missing: Vec<Mark>,
    /// Which topic of a recording that holds several.
    pub topic: Option<String>,
    /// Column names and units of this logger.
    pub columns: Vec<Mapping>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    schema: toml::Spanned<u32>,
    log: Option<PathBuf>,
    #[serde(default)]
    rows: Vec<Selection>,
    #[serde(default)]
    charging: Vec<Selection>,
    id: Option<String>,
    soc_initial: Option<toml::Spanned<f64>>,
    soc_initial_sigma: Option<toml::Spanned<f64>>,
    rest_voltage_v: Option<toml::Spanned<f64>>,
    history: Option<History>,
    ambient_degc: Option<toml::Spanned<f64>>,
    ambient_sigma_k: Option<toml::Spanned<f64>>,
    gap_current: Option<GapCurrent>,
    settling_s: Option<toml::Spanned<f64>>,
    role: Option<Role>,
    #[allow(dead_code, reason = "for readers of the file")]
    source: Option<String>,
    topic: Option<String>,
    #[serde(default)]
    missing: Vec<Mark>,
    #[serde(default)]
    columns: BTreeMap<String, String>,
}

/// The only version of the file so far.
const SCHEMA: u32 = 1;

impl LogFacts {
    /// Reads the facts beside a log.
    ///
    /// # Errors
    /// With line, column, allowed values and near match.
    pub fn parse(file: &str, text: &str) -> Result<LogFacts, DocumentError> {
        let document = Document { file, text };
        let raw: Raw = document.parse()?;
        if *raw.schema.get_ref() != SCHEMA {
            let message = format!("schema = {}: this program reads schema = {SCHEMA}", raw.schema.get_ref());
            return Err(document.error_at(raw.schema.span(), message));
        }
        let within = |name: &str, given: Option<toml::Spanned<f64>>, min: f64, max: f64| match given {
            Some(value) if !(min..=max).contains(value.get_ref()) => {
                Err(document.error_at(value.span(), out_of_range(name, *value.get_ref(), min, max)))
            }
            other => Ok(other.map(toml::Spanned::into_inner)),
        };
        if let (Some(_), Some(rest)) = (&raw.soc_initial, &raw.rest_voltage_v) {
            let message = "rest_voltage_v: soc_initial says already how full the log starts; give one of them".to_owned();
            return Err(document.error_at(rest.span(), message));
        }
        let columns = raw.columns.into_iter().map(|(canonical, expression)| Mapping { canonical, expression });
        Ok(LogFacts {
            log: raw.log,
            rows: raw.rows,
            charging: raw.charging,
            id: raw.id,
            soc_initial: within("soc_initial", raw.soc_initial, SOC.0, SOC.1)?,
            soc_initial_sigma: within("soc_initial_sigma", raw.soc_initial_sigma, SOC.0, SOC.1)?,
            rest_voltage_v: within("rest_voltage_v", raw.rest_voltage_v, VOLTAGE_V.0, VOLTAGE_V.1)?,
            history: raw.history,
            ambient_degc: within("ambient_degc", raw.ambient_degc, DEGC.0, DEGC.1)?,
            ambient_sigma_k: within("ambient_sigma_k", raw.ambient_sigma_k, SIGMA_K.0, SIGMA_K.1)?,
            ambient_is_read: false,
            gap_current: raw.gap_current,
            settling_s: within("settling_s", raw.settling_s, SETTLING_S.0, SETTLING_S.1)?,
            role: raw.role,
            missing: raw.missing,
            topic: raw.topic,
            columns: columns.collect(),
        })
    }
}

const SOC: (f64, f64) = (0.0, 1.0);
const VOLTAGE_V: (f64, f64) = (0.0, 1e4);
const DEGC: (f64, f64) = (-100.0, 200.0);
const SIGMA_K: (f64, f64) = (0.0, 50.0);
const SETTLING_S: (f64, f64) = (0.0, 1e6);

fn out_of_range(name: &str, value: f64, min: f64, max: f64) -> String {
    format!("{name} = {value}: must be between {min} and {max}")
}

/// Facts given by flags, for all logs of a command. They win over the files beside the logs.
#[derive(Debug, Clone, Default)]
pub struct Overrides {
    /// See [`LogFacts::soc_initial`].
    pub soc_initial: Option<f64>,
    /// See [`LogFacts::soc_initial_sigma`].
    pub soc_initial_sigma: Option<f64>,
    /// See [`LogFacts::rest_voltage_v`].
    pub rest_voltage_v: Option<f64>,
    /// See [`LogFacts::ambient_degc`].
    pub ambient_degc: Option<f64>,
    /// See [`LogFacts::ambient_sigma_k`].
    pub ambient_sigma_k: Option<f64>,
    /// See [`LogFacts::gap_current`].
    pub gap_current: Option<GapCurrent>,
    /// See [`LogFacts::settling_s`].
    pub settling_s: Option<f64>,
    /// See [`LogFacts::rows`].
    pub rows: Vec<Selection>,
    /// See [`LogFacts::charging`].
    pub charging: Vec<Selection>,
    /// See [`LogFacts::missing`].
    pub missing: Vec<Mark>,
    /// See [`LogFacts::topic`].
    pub topic: Option<String>,
    /// See [`LogFacts::columns`].
    pub columns: Vec<Mapping>,
}

impl Overrides {
    /// Checks the ranges that files are checked for.
    ///
    /// # Errors
    /// Names the flag, its value and the range.
    pub fn check(&self) -> Result<(), String> {
        let given = [
            ("--soc-initial", self.soc_initial, SOC),
            ("--soc-initial-sigma", self.soc_initial_sigma, SOC),
            ("--rest-voltage-v", self.rest_voltage_v, VOLTAGE_V),
            ("--ambient-degc", self.ambient_degc, DEGC),
            ("--ambient-sigma-k", self.ambient_sigma_k, SIGMA_K),
            ("--settling-s", self.settling_s, SETTLING_S),
        ];
        for (name, value, (min, max)) in given {
            if let Some(value) = value.filter(|value| !(min..=max).contains(value)) {
                return Err(out_of_range(name, value, min, max));
            }
        }
        for (index, mapping) in self.columns.iter().enumerate() {
            let name = &mapping.canonical;
            if let Some(first) = self.columns[..index].iter().find(|first| first.canonical == *name) {
                let (first, second) = (&first.expression, &mapping.expression);
                return Err(format!("--column {name}={first} and --column {name}={second}: one column has one source; give one of them"));
            }
        }
        Ok(())
    }

    /// The facts of a log with the flags laid over them.
    #[must_use]
    pub fn over(&self, mut facts: LogFacts) -> LogFacts {
        // Either says where the log starts: a flag replaces whatever the file says about it.
        if self.soc_initial.is_some() || self.rest_voltage_v.is_some() {
            (facts.soc_initial, facts.rest_voltage_v) = (self.soc_initial, self.rest_voltage_v);
        }
        facts.soc_initial_sigma = self.soc_initial_sigma.or(facts.soc_initial_sigma);
        facts.ambient_degc = self.ambient_degc.or(facts.ambient_degc);
        facts.ambient_sigma_k = self.ambient_sigma_k.or(facts.ambient_sigma_k);
        facts.gap_current = self.gap_current.or(facts.gap_current);
        facts.settling_s = self.settling_s.or(facts.settling_s);
        if !self.rows.is_empty() {
            facts.rows.retain(|known| self.rows.iter().all(|given| given.column != known.column));
            facts.rows.extend(self.rows.iter().cloned());
        }
        if !self.charging.is_empty() {
            facts.charging.clone_from(&self.charging);
        }
        facts.missing.extend(self.missing.iter().cloned());
        facts.topic = self.topic.clone().or(facts.topic);
        for mapping in &self.columns {
            facts.columns.retain(|known| known.canonical != mapping.canonical);
            facts.columns.push(mapping.clone());
        }
        facts
    }
}

/// A note when a column gets a name that no effect knows but that resembles one that is known.
pub(super) fn misspelt(canonical: &str) -> Option<String> {
    let hint = hint(canonical, energy::Channel::ALL.iter().map(|channel| channel.name()));
    (!hint.is_empty()).then(|| format!("`{canonical}` is not a channel that any effect knows{hint}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_facts_and_columns() {
        let text = "schema = 1\nid = \"cell 7\"\nsoc_initial = 0.9\nhistory = \"charged\"\nrole = \"holdout\"\n[columns]\nvoltage_v = \"mv*1e-3\"\n";
        let facts = LogFacts::parse("log.toml", text).unwrap();
        assert_eq!(facts.soc_initial, Some(0.9));
        assert_eq!((facts.history, facts.role), (Some(History::Charged), Some(Role::Holdout)));
        assert_eq!(facts.columns, [Mapping { canonical: "voltage_v".to_owned(), expression: "mv*1e-3".to_owned() }]);
    }

    #[test]
    fn mistakes_are_placed() {
        let error = LogFacts::parse("log.toml", "schema = 1\nsoc_inital = 1.0\n").unwrap_err().to_string();
        assert!(error.starts_with("log.toml:2:1: ") && error.contains("did you mean `soc_initial`?"), "{error}");
        let error = LogFacts::parse("log.toml", "schema = 1\nsoc_initial = 90.0\n").unwrap_err().to_string();
        assert_eq!(error, "log.toml:2:15: soc_initial = 90: must be between 0 and 1");
        let error = LogFacts::parse("log.toml", "schema = 2\n").unwrap_err().to_string();
        assert!(error.contains("reads schema = 1"), "{error}");
    }

    #[test]
    fn a_flag_replaces_what_the_file_says_about_the_start() {
        let file = LogFacts { soc_initial: Some(1.0), ambient_degc: Some(20.0), ..LogFacts::default() };
        let flags = Overrides { rest_voltage_v: Some(3.9), ..Overrides::default() };
        let both = flags.over(file);
        assert_eq!((both.soc_initial, both.rest_voltage_v, both.ambient_degc), (None, Some(3.9), Some(20.0)));
        assert!(Overrides { soc_initial: Some(1.5), ..Overrides::default() }.check().unwrap_err().contains("--soc-initial = 1.5"));
    }
}
