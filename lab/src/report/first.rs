//! A first model for people and for JSON.

use energy::Estimate;
use serde::Serialize;

use crate::ocv::{Beginning, Branch, FirstModel};

use super::quantity::{quantity, with_sigma};
use super::table::{numbers_from, table, text};

/// A way between full and empty that says what the battery holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PassageReport {
    /// Name of the log.
    pub log: String,
    /// `charge` or `discharge`.
    pub direction: &'static str,
    /// State of charge that passed.
    pub share: f64,
    /// Charge that passed, Ah, over that share.
    pub charge_ah: f64,
    /// Mean current as a share of that charge an hour.
    pub c_rate: f64,
}

/// What a log gave.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UsedLog {
    /// Its name.
    pub log: String,
    /// State of charge at its first row.
    pub soc_initial: f64,
    /// What says so: `stated`, `full` or `counted`.
    pub beginning: &'static str,
    /// Least state of charge.
    pub soc_min: f64,
    /// Greatest state of charge.
    pub soc_max: f64,
    /// Rests that show the open-circuit voltage.
    pub rests: usize,
    /// Places at which a slow current shows it.
    pub slow: usize,
}

/// Everything that `lab ocv` says.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FirstReport {
    /// Version of this structure.
    pub schema: u32,
    /// Name of the model.
    pub model: String,
    /// Version of the program.
    pub version: &'static str,
    /// Capacity of the pack, Ah.
    pub capacity_ah: f64,
    /// Its deviation, Ah.
    pub capacity_sigma_ah: f64,
    /// Whether it was stated, and not measured.
    pub capacity_stated: bool,
    /// The slowest ways of the logs between full and empty.
    pub passages: Vec<PassageReport>,
    /// States of charge of the table.
    pub soc: Vec<f64>,
    /// Open-circuit voltage of one cell there, V.
    pub voltage_v: Vec<f64>,
    /// Deviation of each, V.
    pub sigma_v: Vec<f64>,
    /// Deviation of the table above 5 % of the charge, V, RMS.
    pub ocv_sigma_v: f64,
    /// What was shown lies so far from it, V, RMS; null where each point rests on one place.
    pub left_v: Option<f64>,
    /// Resistance of the pack in steps of the current, ohm; null where there was none.
    pub step_ohm: Option<f64>,
    /// Its deviation, ohm.
    pub step_sigma_ohm: Option<f64>,
    /// Steps that show it.
    pub steps: usize,
    /// What a slow current costs a pack at half its charge, ohm; null where there was none. Half of a hysteresis is in it where it was both charged
    /// and discharged.
    pub slow_ohm: Option<f64>,
    /// Its deviation, ohm.
    pub slow_sigma_ohm: Option<f64>,
    /// Whether it was shown both charged and discharged.
    pub both_ways: bool,
    /// By log.
    pub logs: Vec<UsedLog>,
    /// What to know about it, one sentence each.
    pub words: Vec<String>,
    /// The file written; null when none was asked for.
    pub output: Option<String>,
}

impl FirstReport {
    /// Puts a report together.
    #[must_use]
    pub fn of(found: &FirstModel, output: Option<String>) -> FirstReport {
        let (soc, voltage_v) = found.table.ocv.points();
        let series = f64::from(found.sheet.series);
        let (step, slow) = (found.step_ohm, found.table.slow_ohm);
        FirstReport {
            schema: 1,
            model: found.sheet.name.clone(),
            version: env!("CARGO_PKG_VERSION"),
            capacity_ah: found.capacity_ah.value,
            capacity_sigma_ah: found.capacity_ah.sigma,
            capacity_stated: found.sheet.capacity_ah.is_some(),
            passages: found
                .passages
                .iter()
                .map(|passage| PassageReport {
                    log: passage.log.clone(),
                    direction: if passage.discharge { "discharge" } else { "charge" },
                    share: passage.share,
                    charge_ah: passage.charge_ah,
                    c_rate: passage.per_hour,
                })
                .collect(),
            soc: soc.to_vec(),
            voltage_v: voltage_v.to_vec(),
            sigma_v: found.table.sigma_v.clone(),
            ocv_sigma_v: found.table.rms_sigma_v,
            left_v: found.table.left_v,
            step_ohm: step.map(|(ohm, _)| series * ohm.value),
            step_sigma_ohm: step.map(|(ohm, _)| series * ohm.sigma),
            steps: step.map_or(0, |(_, steps)| steps),
            slow_ohm: slow.map(|ohm| series * ohm.value),
            slow_sigma_ohm: slow.map(|ohm| series * ohm.sigma),
            both_ways: found.table.branch == Branch::Both,
            logs: found
                .used
                .iter()
                .map(|used| UsedLog {
                    log: used.log.clone(),
                    soc_initial: used.soc_initial,
                    beginning: match used.beginning {
                        Beginning::Stated => "stated",
                        Beginning::Full => "full",
                        Beginning::Counted => "counted",
                    },
                    soc_min: used.range.0,
                    soc_max: used.range.1,
                    rests: used.rests,
                    slow: used.slow,
                })
                .collect(),
            words: words(found),
            output,
        }
    }

    /// The report for people.
    #[must_use]
    pub fn human(&self) -> String {
        let mut said = format!("{}: {}", self.model, with_sigma(self.capacity_ah, Some(self.capacity_sigma_ah), "Ah"));
        match self.passages.len() {
            _ if self.capacity_stated => said.push_str(", as stated\n"),
            1 => said.push_str(", by one way between full and empty\n"),
            many => said.push_str(&format!(", by {many} ways between full and empty\n")),
        }
        for passage in &self.passages {
            let (direction, log) = (passage.direction, &passage.log);
            said.push_str(&format!("  {direction} of {log}: {:.4} Ah at {:.3} of it an hour\n", passage.charge_ah, passage.c_rate));
        }
        let mut logs = table(&["log", "begins at", "by", "least", "most", "rests", "slow places"]);
        numbers_from(&mut logs, 3);
        let per_cent = |soc: f64| format!("{:.1} %", 100.0 * soc + 0.0);
        for log in &self.logs {
            logs.add_row([
                log.log.clone(),
                per_cent(log.soc_initial),
                log.beginning.to_owned(),
                per_cent(log.soc_min),
                per_cent(log.soc_max),
                log.rests.to_string(),
                log.slow.to_string(),
            ]);
        }
        said.push_str(&text(&logs));
        said.push('\n');
        let (first, last) = (self.soc[0], self.soc[self.soc.len() - 1]);
        let (points, known) = (self.soc.len(), quantity(self.ocv_sigma_v, "V"));
        said.push_str(&format!(
            "open-circuit voltage: {points} points from {} to {}, known to {known} per cell",
            per_cent(first),
            per_cent(last)
        ));
        match self.left_v {
            Some(left_v) => said.push_str(&format!("; what was shown lies {} from it (RMS)\n", quantity(left_v, "V"))),
            None => said.push_str("; nothing was shown twice, to check it by\n"),
        }
        if let Some(ohm) = self.step_ohm {
            let steps = if self.steps == 1 { "step" } else { "steps" };
            said.push_str(&format!(
                "resistance at once: {} by {} {steps} of the current\n",
                with_sigma(ohm, self.step_sigma_ohm, "ohm"),
                self.steps
            ));
        }
        if let Some(ohm) = self.slow_ohm {
            let half = if self.both_ways { ", half of a hysteresis in it" } else { "" };
            said.push_str(&format!(
                "what a slow current costs at half the charge{half}: {}\n",
                with_sigma(ohm, self.slow_sigma_ohm, "ohm")
            ));
        }
        for words in &self.words {
            said.push_str(&format!("{words}\n"));
        }
        said
    }
}

/// Ways between full and empty that differ by more than this share are told.
const UNLIKE: f64 = 0.03;
/// So is a state of charge that is this far beyond full or empty.
const BEYOND: f64 = 0.02;

/// What is not known, and what comes next.
fn words(found: &FirstModel) -> Vec<String> {
    let mut words = Vec::new();
    match found.table.branch {
        Branch::Both => {}
        Branch::Discharge => {
            words.push("only discharges show it: half of a hysteresis would be in the table. A slow charge would tell".to_owned())
        }
        Branch::Unknown => {
            let half = "half of a hysteresis would be in the table";
            words.push(format!("nothing says whether it was charged or discharged before it rested: {half}"));
        }
        Branch::Charge => {
            words.push("only charges show it: half of a hysteresis would be in the table. A slow discharge would tell".to_owned())
        }
    }
    let charges = found.passages.iter().map(|passage| passage.charge_ah);
    let (least, most) = charges.fold((f64::INFINITY, 0.0_f64), |(least, most), ah| (least.min(ah), most.max(ah)));
    let capacity_ah = found.capacity_ah.value;
    let off = (most / capacity_ah - 1.0).abs().max((least / capacity_ah - 1.0).abs());
    if found.sheet.capacity_ah.is_some() && most > 0.0 && off > UNLIKE {
        let apart = 100.0 * off;
        words.push(format!(
            "between full and empty the logs pass {least:.3} to {most:.3} Ah, {apart:.0} % from the capacity that was stated"
        ));
    } else if most > (1.0 + UNLIKE) * least {
        let differ = 100.0 * (most / least - 1.0);
        words.push(format!(
            "the ways between full and empty differ by {differ:.0} %: an ammeter that is off one way, or a charge that had not ended"
        ));
    }
    if found.step_ohm.is_none() {
        words.push("no step of the current within ten seconds stands out of the noise: the resistance of the model is a guess".to_owned());
    }
    let (soc, _) = found.table.ocv.points();
    let widest = soc.windows(2).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    if let Some([from, to]) = widest.filter(|pair| pair[1] - pair[0] > 0.15) {
        words.push(format!("nothing shows it between {:.0} and {:.0} %: the table is a straight line there", 100.0 * from, 100.0 * to));
    }
    for (end, missing, side) in [(soc[0], soc[0] > 0.1, "below"), (soc[soc.len() - 1], soc[soc.len() - 1] < 0.9, "above")] {
        if missing {
            words.push(format!(
                "nothing shows it {side} {:.0} %: the table goes straight on there, and its deviation says nothing of that",
                100.0 * end
            ));
        }
    }
    words.extend(found.ammeters.iter().cloned());
    let left_out =
        |part: &String| format!("{part}, after a gap in which nobody knows what flowed, is left out: nothing says how full it is anywhere");
    words.extend(found.unplaced.iter().map(left_out));
    for used in &found.used {
        let (low, high) = used.range;
        if low < -BEYOND || high > 1.0 + BEYOND {
            let (low, high) = (100.0 * low, 100.0 * high);
            words.push(format!("{} goes from {low:.0} to {high:.0} %: its current is off, or what is known of the battery", used.log));
        }
        if let Some(doubted) = found.doubted.iter().find(|doubted| doubted.log == used.log) {
            let per_cent = |soc: Estimate| format!("{:.1} +- {:.1} %", 100.0 * soc.value, 100.0 * soc.sigma);
            let (log, stated, counted) = (&used.log, per_cent(doubted.stated), per_cent(doubted.counted));
            words.push(format!(
                "{log} is stated to begin at {stated}, and at {counted} by what was counted to where it is full or empty: both count by how well they are known"
            ));
        }
        if used.beginning != Beginning::Stated {
            let log = &used.log;
            words.push(format!(
                "say of {log} where it begins when it is used again, in {log}.toml: schema = 1, soc_initial = {:.4}",
                used.soc_initial.clamp(0.0, 1.0)
            ));
        }
    }
    words
}
