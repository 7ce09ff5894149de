//! Logs that the model found does not explain: held-out ones, whatever it does for those that it was fitted to, and these.

use serde::Serialize;

use crate::compare::{Comparison, WITHIN};
use crate::concentration::Concentration;
use crate::infer::answer::{Discovery, Verdict};
use crate::report::quantity::{quantity, unit_of};

use super::floor_name;

/// A channel of which logs show more error than `lab compare` counts as the sensors' floor.
#[derive(Debug, Clone, Serialize, PartialEq)]
pub struct Unexplained {
    /// The channel.
    pub channel: &'static str,
    /// RMS at the end of the search, each log asked for what is known of it only roughly.
    pub rms: f64,
    /// Noise of the sensors.
    pub floor: f64,
    /// Where the error that the file leaves is densest; null when it is spread evenly.
    pub worst: Option<Concentration>,
}

impl Unexplained {
    /// By channel, `compared` being the held-out logs, or those that were learned from, with the model found.
    #[must_use]
    pub fn of(found: &Discovery, compared: &Comparison, are_held_out: bool) -> Vec<Unexplained> {
        let Some(last) = found.ladder.last() else { return Vec::new() };
        let worst = |channel: &str| compared.worst.iter().find(|worst| worst.channel == channel).map(|worst| worst.concentration.clone());
        let of = |(&channel, &rms): (&&'static str, &f64)| {
            let floor = *last.floor.get(channel)?;
            (rms > WITHIN * floor).then(|| Unexplained { channel, rms, floor, worst: worst(channel) })
        };
        if are_held_out { &last.holdout_rms } else { &last.train_rms }.iter().filter_map(of).collect()
    }

    /// Where its error lies, where that is in one spot.
    fn place(&self, whose: &str) -> Option<String> {
        let worst = self.worst.as_ref()?;
        let (share, rows) = (100.0 * worst.share, 100.0 * worst.share_of_rows);
        let (channel, place) = (self.channel, worst.words());
        Some(format!("By the file alone, {share:.0} % of {whose} squared error of {channel} lies {place}, in {rows:.0} % of {whose} rows."))
    }
}

/// Where the error of the logs that were learned from lies, a line each: a few rows may decide what is found, and hide what is missing from all others.
#[must_use]
pub fn in_few_rows(all: &[Unexplained]) -> String {
    all.iter().filter_map(|one| one.place("the")).map(|words| words + "\n").collect()
}

/// The same in words, beside a verdict that sounds as if all were well; none otherwise.
#[must_use]
pub fn held_out(found: &Discovery, all: &[Unexplained]) -> Option<String> {
    let last = found.ladder.last().filter(|_| !all.is_empty() && found.verdict != Verdict::Unknown)?;
    let size = |one: &Unexplained| {
        let unit = unit_of(one.channel);
        let (rms, floor) = (quantity(one.rms, unit), quantity(one.floor, unit));
        format!("{rms} RMS of {} at a {} of {floor}", one.channel, floor_name(last, one.channel))
    };
    let sizes: Vec<String> = all.iter().map(size).collect();
    let places: String = all.iter().filter_map(|one| one.place("their")).map(|words| format!(" {words}")).collect();
    let sizes = sizes.join(", ");
    Some(format!("Held-out logs are not explained: {sizes}, perhaps in conditions that the training logs have not visited.{places}"))
}
