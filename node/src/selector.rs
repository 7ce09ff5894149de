//! A station's battery selector, as configurations and scenarios state it: when it changes packs, and
//! what happens to the station meanwhile.

use anyhow::{anyhow, bail, ensure};
use energy::selector::{Change, Rule, Selector};
use serde::{Deserialize, Serialize};

/// `selector`: when a station changes packs, and what happens meanwhile. Without it a pack is left when
/// it gives out, and changes are seamless.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelectorConfig {
    /// Which contact moves first.
    #[serde(default)]
    pub change: ChangeKind,
    /// Time without a pack at each change, s; 0 for a selector that makes before it breaks.
    #[serde(default)]
    pub gap_s: f64,
    /// Time for which two packs are connected at once, s; 0 for one that breaks before it makes.
    #[serde(default)]
    pub overlap_s: f64,
    /// Resistance from one pack to the other while both are connected, ohm.
    #[serde(default = "default_loop_ohm")]
    pub loop_ohm: f64,
    /// Capacitance that carries the station through the gap, F.
    pub capacitance_f: f64,
    /// Least voltage at which the station's converters work, V.
    pub least_v: f64,
    /// Time that the station takes to start again when it did not live through a change, s.
    pub restart_s: f64,
    /// The active pack is left below this voltage, V; 0 to leave it when it gives out.
    #[serde(default)]
    pub leave_below_v: f64,
    /// A pack is taken above this voltage, V; 0 for any that can be used.
    #[serde(default)]
    pub take_above_v: f64,
}

/// Which contact moves first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// The old one breaks, and after a gap the new one makes.
    #[default]
    BreakBeforeMake,
    /// The new one makes; for a moment two packs are in parallel.
    MakeBeforeBreak,
}

/// Both packs' own resistance, and that of two switches.
fn default_loop_ohm() -> f64 {
    0.1
}

/// The rule of a station that states none: a pack feeds it until it gives out, then the next.
pub const UNTIL_EMPTY: Rule = Rule { leave_below_v: 0.0, take_above_v: 0.0 };

/// Checks that the two voltages of a rule do not contradict each other. The error begins with a key of the table that states them.
///
/// # Errors
/// Names both keys.
pub fn check_rule(rule: Rule) -> anyhow::Result<()> {
    let Rule { leave_below_v, take_above_v } = rule;
    ensure!(
        take_above_v >= leave_below_v,
        "take_above_v = {take_above_v} lies below leave_below_v = {leave_below_v}: a pack would be taken to be left at once"
    );
    Ok(())
}

impl SelectorConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the key and the range.
    pub fn check(&self) -> anyhow::Result<()> {
        let numbers = [
            ("gap_s", self.gap_s, 10.0),
            ("overlap_s", self.overlap_s, 10.0),
            ("capacitance_f", self.capacitance_f, 1e3),
            ("least_v", self.least_v, 1e3),
            ("restart_s", self.restart_s, 86_400.0),
            ("leave_below_v", self.leave_below_v, 1e3),
            ("take_above_v", self.take_above_v, 1e3),
        ];
        for (key, value, max) in numbers {
            ensure!((0.0..=max).contains(&value), "selector.{key} = {value}: must be between 0 and {max}");
        }
        ensure!(self.loop_ohm > 0.0 && self.loop_ohm <= 1e3, "selector.loop_ohm = {}: must be above 0 and at most 1000", self.loop_ohm);
        match self.change {
            ChangeKind::BreakBeforeMake if self.overlap_s > 0.0 => {
                bail!(
                    "selector.overlap_s = {}: a selector that breaks before it makes has no overlap; change = \"make_before_break\" has",
                    self.overlap_s
                )
            }
            ChangeKind::MakeBeforeBreak if self.gap_s > 0.0 => {
                bail!(
                    "selector.gap_s = {}: a selector that makes before it breaks has no gap; change = \"break_before_make\" has",
                    self.gap_s
                )
            }
            _ => {}
        }
        check_rule(self.rule()).map_err(|error| anyhow!("selector.{error}"))
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> Selector {
        let change = match self.change {
            ChangeKind::BreakBeforeMake => Change::BreakBeforeMake { gap_s: self.gap_s },
            ChangeKind::MakeBeforeBreak => Change::MakeBeforeBreak { overlap_s: self.overlap_s, loop_ohm: self.loop_ohm },
        };
        Selector { change, capacitance_f: self.capacitance_f, least_v: self.least_v }
    }

    /// When it changes packs, and to which.
    #[must_use]
    pub fn rule(&self) -> Rule {
        Rule { leave_below_v: self.leave_below_v, take_above_v: self.take_above_v }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: SelectorConfig = SelectorConfig {
        change: ChangeKind::BreakBeforeMake,
        gap_s: 0.002,
        overlap_s: 0.0,
        loop_ohm: 0.1,
        capacitance_f: 0.05,
        least_v: 6.0,
        restart_s: 60.0,
        leave_below_v: 9.6,
        take_above_v: 10.8,
    };

    #[test]
    fn keys_that_contradict_each_other_are_refused_with_the_way_out() {
        let refused = |config: SelectorConfig| config.check().unwrap_err().to_string();
        GOOD.check().unwrap();
        assert!(refused(SelectorConfig { overlap_s: 0.001, ..GOOD }).contains("change = \"make_before_break\" has"));
        let makes = SelectorConfig { change: ChangeKind::MakeBeforeBreak, ..GOOD };
        assert!(refused(makes).contains("selector.gap_s = 0.002"));
        SelectorConfig { gap_s: 0.0, overlap_s: 0.001, ..makes }.check().unwrap();
        let crossed = "selector.take_above_v = 9 lies below leave_below_v = 9.6: a pack would be taken to be left at once";
        assert_eq!(refused(SelectorConfig { take_above_v: 9.0, ..GOOD }), crossed);
        assert!(refused(SelectorConfig { loop_ohm: 0.0, ..GOOD }).contains("selector.loop_ohm = 0: must be above 0"));
        assert!(refused(SelectorConfig { least_v: f64::NAN, ..GOOD }).contains("selector.least_v = NaN: must be between"));
    }
}
