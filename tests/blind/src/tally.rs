//! From marks to rates: what is published, each with its Wilson interval.

use energy::System;

use crate::ask::Formula;
use crate::case::{Bin, Kind};
use crate::score::Mark;

/// So many out of so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rate {
    /// Of which it holds.
    pub hits: usize,
    /// All.
    pub of: usize,
}

impl Rate {
    /// Counts a yes or no.
    #[must_use]
    pub fn count(answers: impl Iterator<Item = bool>) -> Self {
        let mut rate = Self::default();
        for yes in answers {
            rate.of += 1;
            rate.hits += usize::from(yes);
        }
        rate
    }

    /// The share; NaN of none.
    #[must_use]
    pub fn share(self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    /// Wilson's 95 % interval of the share.
    #[must_use]
    pub fn wilson(self) -> (f64, f64) {
        const Z: f64 = 1.959_964;
        if self.of == 0 {
            return (0.0, 1.0);
        }
        let (n, p) = (self.of as f64, self.share());
        let middle = p + Z * Z / (2.0 * n);
        let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        let scale = 1.0 + Z * Z / n;
        (((middle - half) / scale).max(0.0), ((middle + half) / scale).min(1.0))
    }
}

/// One published figure.
#[derive(Debug, Clone, PartialEq)]
pub enum Figure {
    /// A rate, and what it should reach: at least, or at most when negative.
    Rate(Rate),
    /// A number with its unit: median, 95th percentile, how many it is of.
    Spread {
        /// Half of all lie below.
        median: f64,
        /// 95 % of all lie below.
        p95: f64,
        /// How many.
        of: usize,
        /// Unit.
        unit: &'static str,
    },
}

/// A line of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// What it says.
    pub name: String,
    /// What it should reach.
    pub target: &'static str,
    /// The figure.
    pub figure: Figure,
}

/// Everything that is published of these marks.
#[must_use]
pub fn tally(marks: &[Mark]) -> Vec<Line> {
    let mut lines = Vec::new();
    hits(marks, &mut lines);
    mistakes(marks, &mut lines);
    held_out(marks, &mut lines);
    times(marks, &mut lines);
    lines.retain(|line| match line.figure {
        Figure::Rate(rate) => rate.of > 0,
        Figure::Spread { of, .. } => of > 0,
    });
    lines
}

/// What is published of formulas for what lies outside the catalogue.
#[must_use]
pub fn with_formulas(formulas: &[Formula]) -> Vec<Line> {
    let line = |what: &str, target, at_random: bool, value: fn(&Formula) -> f64| {
        let own = formulas.iter().filter(|one| one.at_random == at_random).map(value);
        spread(format!("held-out RMS over floor: {what}"), target, own, "x")
    };
    let mut lines = vec![
        line("outside, with a period, base model", "", false, |one| one.before),
        line("outside, with a period, with the formula that is proposed", "<= 2", false, |one| one.after),
        line("outside, at random times, base model", "", true, |one| one.before),
        line("outside, at random times, with the formula that is proposed, if one is", "<= 2", true, |one| one.after),
    ];
    lines.retain(|line| !matches!(line.figure, Figure::Spread { of: 0, .. }));
    lines
}

fn rate<'a>(name: &str, target: &'static str, marks: impl Iterator<Item = &'a Mark>, holds: impl Fn(&Mark) -> bool) -> Line {
    Line { name: name.to_owned(), target, figure: Figure::Rate(Rate::count(marks.map(holds))) }
}

fn hits(marks: &[Mark], lines: &mut Vec<Line>) {
    let of = |kind: Kind, bin: Bin| marks.iter().filter(move |mark| mark.kind == kind && mark.bin == bin);
    let right = |mark: &Mark| mark.right;
    lines.push(rate("single, right class, clear (>= 1 mV per cell or 2 sigma)", ">= 98 %", of(Kind::Single, Bin::Clear), right));
    lines.push(rate("single, right effect, clear", "", of(Kind::Single, Bin::Clear), |mark| mark.exact));
    lines.push(rate("single, right class, faint (0.3-1 mV or 0.6-2 sigma)", ">= 60 %", of(Kind::Single, Bin::Faint), right));
    // Below that, anything but a wrong name is right.
    lines.push(rate("single, no wrong name, below", ">= 98 %", of(Kind::Single, Bin::Below), |mark| mark.wrong.is_empty()));
    let pairs = |confusable: bool, clear: bool| {
        marks.iter().filter(move |m| m.kind == Kind::Pair && m.confusable == confusable && (m.bin == Bin::Clear) == clear)
    };
    lines.push(rate("pair of unlike effects, both classes, clear", ">= 98 %", pairs(false, true), right));
    lines.push(rate("confusable pair, both classes, clear", ">= 80 %", pairs(true, true), right));
    lines.push(rate("confusable pair, both classes, one of them faint or below", "", pairs(true, false), right));
    let clear_of = |kind: Kind| marks.iter().filter(move |mark| mark.kind == kind && mark.bin == Bin::Clear);
    lines.push(rate("another form than the catalogue's, right class", ">= 92 %", clear_of(Kind::OtherForm), right));
    lines.push(rate("electrochemical truth, relaxation found", "", clear_of(Kind::Electrochemical), right));
    lines.push(rate("outside the catalogue, called unknown", ">= 90 %", clear_of(Kind::Outside), right));
    lines.push(rate("collinear, called ambiguous with the right set", ">= 90 %", clear_of(Kind::Collinear), right));
    for system in [System::Battery, System::Robot, System::Station] {
        let own = marks.iter().filter(move |m| m.system == system && m.kind == Kind::Single && m.bin == Bin::Clear);
        lines.push(rate(&format!("single, right class, clear: {}", system.name()), "", own, right));
    }
}

fn mistakes(marks: &[Mark], lines: &mut Vec<Line>) {
    let known = |mark: &&Mark| matches!(mark.kind, Kind::Single | Kind::Pair | Kind::OtherForm | Kind::Electrochemical);
    lines.push(rate("wrong names, where something of the catalogue is hidden", "<= 2 %", marks.iter().filter(known), |m| {
        !m.wrong.is_empty()
    }));
    let null = |wrong_ocv: bool, of_battery: bool| {
        marks.iter().filter(move |m| m.kind == Kind::Null && m.wrong_ocv == wrong_ocv && (m.system == System::Battery) == of_battery)
    };
    let alarm = |mark: &Mark| !mark.right;
    lines.push(rate("false alarms on nulls", "<= 2 %", marks.iter().filter(|mark| mark.kind == Kind::Null), alarm));
    lines.push(rate("false alarms on nulls, battery with wrong OCV table", "", null(true, true), alarm));
    lines.push(rate("false alarms on nulls, battery with exact OCV table", "", null(false, true), alarm));
    lines.push(rate("false alarms on nulls, robot and station", "", null(false, false), alarm));
    let (of, hits) = marks.iter().fold((0, 0), |sum, mark| (sum.0 + mark.covered.0, sum.1 + mark.covered.1));
    lines.push(Line { name: "90 % intervals that hold the truth".to_owned(), target: "86-94 %", figure: Figure::Rate(Rate { hits, of }) });
}

fn held_out(marks: &[Mark], lines: &mut Vec<Line>) {
    let targets = [
        (Kind::Single, "<= 1.02"),
        (Kind::Pair, "<= 1.02"),
        (Kind::Null, ""),
        (Kind::OtherForm, "<= 1.5"),
        (Kind::Electrochemical, "<= 3"),
    ];
    for (kind, target) in targets {
        let values = marks.iter().filter(|mark| mark.kind == kind).map(|mark| mark.holdout_over_floor);
        lines.push(spread(format!("held-out RMS over floor: {}", kind.name()), target, values, "x"));
    }
    for kind in [Kind::Single, Kind::Pair, Kind::Null] {
        let values = marks.iter().filter(|mark| mark.kind == kind).map(|mark| mark.holdout_over_told);
        lines.push(spread(format!("held-out RMS over the truth's, told what the lab is told: {}", kind.name()), "<= 1", values, "x"));
    }
}

fn times(marks: &[Mark], lines: &mut Vec<Line>) {
    for (system, target) in [(System::Battery, "<= 0.1 s, p95 <= 1 s"), (System::Robot, "<= 0.03 s"), (System::Station, "<= 0.03 s")] {
        let values = marks.iter().filter(|mark| mark.system == system).map(|mark| mark.cpu_s);
        lines.push(spread(format!("time per case: {}", system.name()), target, values, "s"));
    }
}

fn spread(name: String, target: &'static str, values: impl Iterator<Item = f64>, unit: &'static str) -> Line {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len() as f64 * share).ceil() as usize).max(1) - 1).copied().unwrap_or(f64::NAN);
    Line { name, target, figure: Figure::Spread { median: at(0.5), p95: at(0.95), of: values.len(), unit } }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wilson 1927; numbers from Brown, Cai and DasGupta 2001 and by hand.
    #[test]
    fn the_interval_is_wilsons() {
        let (low, high) = Rate { hits: 0, of: 50 }.wilson();
        assert!(low < 1e-12 && (high - 0.0713).abs() < 1e-4, "{low} {high}");
        let (low, high) = Rate { hits: 9, of: 10 }.wilson();
        assert!((low - 0.5958).abs() < 1e-4 && (high - 0.9821).abs() < 1e-4, "{low} {high}");
    }

    #[test]
    fn medians_and_percentiles_are_members() {
        let line = spread("x".to_owned(), "", (1..=20).map(f64::from), "s");
        assert_eq!(line.figure, Figure::Spread { median: 10.0, p95: 19.0, of: 20, unit: "s" });
    }
}
