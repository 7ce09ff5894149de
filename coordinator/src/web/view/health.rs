//! Whether models still explain what is measured, and what the lab last found.

use proto::{Doubt, Timestamp};
use serde::{Deserialize, Serialize};

use super::Tone;
use crate::core::Core;
use crate::watch::Standing;
use crate::when::minute_from;

/// The panel.
#[derive(Debug, Clone, Serialize)]
pub struct HealthPanel {
    /// Models that are doubted.
    pub doubted: usize,
    /// In a sentence.
    pub headline: String,
    /// Models that are watched, the most suspicious first.
    pub rows: Vec<HealthRow>,
    /// The ladder of the lab's last search, if one is configured.
    pub ladder: Option<Ladder>,
    /// Why there is no ladder; empty when there is one.
    pub ladder_note: String,
}

/// One watched model.
#[derive(Debug, Clone, Serialize)]
pub struct HealthRow {
    /// Whose: `the battery model of explorer-2`.
    pub subject: String,
    /// Residual of the last block of measurements, in standard deviations.
    pub z: f64,
    /// That in words: `+1.3 σ`.
    pub z_text: String,
    /// Evidence against the model, as a share of what raises a doubt (1).
    pub evidence: f64,
    /// `explains its data`, or since when it does not.
    pub state: String,
    /// How it stands.
    pub tone: Tone,
    /// What finds out what the model lacks; none while it is not doubted.
    pub command: Option<String>,
}

/// How the error fell, effect by effect, in the lab's last search.
#[derive(Debug, Clone, Serialize)]
pub struct Ladder {
    /// The model that was searched.
    pub model: String,
    /// What came of it, in words.
    pub verdict: String,
    /// Where it comes from.
    pub source: String,
    /// Steps, per channel.
    pub steps: Vec<Step>,
}

/// One step of the ladder, of one channel.
#[derive(Debug, Clone, Serialize)]
pub struct Step {
    /// The channel, with its unit as in the logs.
    pub channel: String,
    /// The effect that was added, or the model as given.
    pub effect: String,
    /// RMS on the logs that were fitted, in the channel's unit.
    pub train_rms: f64,
    /// RMS on held-out logs.
    pub holdout_rms: Option<f64>,
    /// Noise of the sensor.
    pub floor: f64,
    /// `train_rms` as a share of the first step's, for drawing.
    pub share: f64,
    /// All of it in words.
    pub text: String,
}

pub(super) fn panel(now: Timestamp, core: &Core, ladder: Option<Result<Ladder, String>>) -> HealthPanel {
    let (ladder, ladder_note) = match ladder {
        Some(Ok(ladder)) => (Some(ladder), String::new()),
        Some(Err(why)) => (None, why),
        None => (None, "No search of the lab is shown: name the output of `lab discover --format json` by web.discovery.".to_owned()),
    };
    let mut rows: Vec<HealthRow> = core.standings(now).into_iter().map(|standing| row(now, standing)).collect();
    rows.sort_by(|a, b| (b.tone == Tone::Warn).cmp(&(a.tone == Tone::Warn)).then(b.evidence.total_cmp(&a.evidence)));
    let doubted = rows.iter().filter(|row| row.command.is_some()).count();
    let headline = match (rows.len(), doubted) {
        (0, _) => "No model has been judged yet: that takes minutes of measurements.".to_owned(),
        (watched, 0) => format!("All {watched} watched models explain what is measured."),
        (watched, 1) => format!("1 of {watched} watched models no longer explains what is measured."),
        (watched, n) => format!("{n} of {watched} watched models no longer explain what is measured."),
    };
    HealthPanel { doubted, headline, rows, ladder, ladder_note }
}

fn row(now: Timestamp, standing: Standing) -> HealthRow {
    let Standing { subject, z, evidence, doubt } = standing;
    let (state, tone, command) = match doubt {
        Some(Doubt { since, z, command, .. }) => {
            (format!("doubted since {}, {z:+.1} σ on average", minute_from(now, since)), Tone::Warn, Some(command))
        }
        None => ("explains its data".to_owned(), Tone::Good, None),
    };
    HealthRow { subject: subject.to_string(), z, z_text: format!("{z:+.1} σ"), evidence, state, tone, command }
}

/// What is read of `lab discover --format json`; the rest of it is for others.
#[derive(Deserialize)]
struct Discovery {
    model: String,
    verdict: String,
    #[serde(default)]
    selected: Vec<String>,
    #[serde(default)]
    equivalent: Vec<String>,
    #[serde(default)]
    equivalent_sets: Vec<Vec<String>>,
    #[serde(default)]
    ladder: Vec<Rung>,
}

#[derive(Deserialize)]
struct Rung {
    effect: Option<String>,
    train_rms: std::collections::BTreeMap<String, f64>,
    #[serde(default)]
    holdout_rms: std::collections::BTreeMap<String, f64>,
    #[serde(default)]
    floor: std::collections::BTreeMap<String, f64>,
}

impl Ladder {
    /// Reads what `lab discover --format json` printed.
    ///
    /// # Errors
    /// Says what is wrong with the text.
    pub fn parse(source: &str, text: &str) -> Result<Self, String> {
        let found: Discovery =
            serde_json::from_str(text).map_err(|error| format!("{source}: not a report of `lab discover --format json`: {error}"))?;
        let verdict = match found.verdict.as_str() {
            "complete" if found.selected.is_empty() => "complete: nothing is missing".to_owned(),
            "complete" => format!("complete with {}", found.selected.join(", ")),
            "ambiguous" => {
                // Older reports have all of them in one list.
                let sets = if found.equivalent_sets.is_empty() { vec![found.equivalent] } else { found.equivalent_sets };
                let sets: Vec<String> = sets.iter().map(|set| set.join(", ")).collect();
                format!("cannot tell between {}", sets.join("; nor between "))
            }
            "missing" => format!("missing: {}", found.selected.join(", ")),
            other => other.to_owned(),
        };
        let mut steps = Vec::new();
        let channels = found.ladder.first().map_or_else(Vec::new, |rung| rung.train_rms.keys().cloned().collect());
        for channel in channels {
            let first = found.ladder.first().and_then(|rung| rung.train_rms.get(&channel)).copied().unwrap_or(0.0);
            steps.extend(found.ladder.iter().filter_map(|rung| step(rung, &channel, first)));
        }
        Ok(Self { model: found.model, verdict, source: source.to_owned(), steps })
    }
}

fn step(rung: &Rung, channel: &str, first: f64) -> Option<Step> {
    let train_rms = *rung.train_rms.get(channel)?;
    let holdout_rms = rung.holdout_rms.get(channel).copied();
    let floor = rung.floor.get(channel).copied().unwrap_or(0.0);
    let effect = rung.effect.as_ref().map_or_else(|| "as given".to_owned(), |effect| format!("+ {effect}"));
    let (scale, unit) = unit(channel);
    let number = |value: f64| format!("{:.3} {unit}", value * scale);
    let held = holdout_rms.map_or_else(String::new, |rms| format!(", held out {}", number(rms)));
    let text = format!("{}{held}, sensor floor {}", number(train_rms), number(floor));
    let share = if first > 0.0 { train_rms / first } else { 0.0 };
    Some(Step { channel: channel.to_owned(), effect, train_rms, holdout_rms, floor, share, text })
}

/// A channel's unit is in its name; voltages are told in millivolts.
fn unit(channel: &str) -> (f64, &'static str) {
    match channel.rsplit('_').next() {
        Some("v") => (1000.0, "mV"),
        Some("w") => (1.0, "W"),
        Some("a") => (1.0, "A"),
        Some("degc") => (1.0, "K"),
        _ => (1.0, ""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ladder_is_read_step_by_step() {
        let text = r#"{"schema":1,"model":"m","verdict":"complete","selected":["soc_resistance"],"ladder":[
            {"effect":null,"train_rms":{"voltage_v":0.02},"holdout_rms":{},"floor":{"voltage_v":0.001}},
            {"effect":"soc_resistance","train_rms":{"voltage_v":0.005},"holdout_rms":{"voltage_v":0.006},"floor":{"voltage_v":0.001}}]}"#;
        let ladder = Ladder::parse("d.json", text).unwrap();
        assert_eq!(ladder.verdict, "complete with soc_resistance");
        let steps: Vec<(&str, f64, &str)> = ladder.steps.iter().map(|s| (s.effect.as_str(), s.share, s.text.as_str())).collect();
        assert_eq!(steps[0], ("as given", 1.0, "20.000 mV, sensor floor 1.000 mV"));
        assert_eq!(steps[1], ("+ soc_resistance", 0.25, "5.000 mV, held out 6.000 mV, sensor floor 1.000 mV"));
    }

    #[test]
    fn another_file_is_refused_by_name() {
        let refused = Ladder::parse("d.json", "{}").unwrap_err();
        assert!(refused.starts_with("d.json: not a report of `lab discover --format json`: missing field `model`"), "{refused}");
    }
}
