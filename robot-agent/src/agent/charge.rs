//! Whether a charge is over, by what flows: a current that has fallen off says so, one that is only held up does not.

use energy::BatteryFacts;
use energy::charger::{Charger, PowerPath};
use energy::gauge::Sample;
use energy::protection::Trip;

/// At the end of a taper a charger waits for a moment (`cutoff_hold_s`) before it is done. One that gives nothing for so many such
/// moments, while nothing is known that holds it up, is done as well, for a reason of its own. A guess: well above one moment.
const GIVES_NOTHING_HOLDS: f64 = 10.0;
/// A current of less than so many times the cutoff is the last part of a taper: what holds a charge up cuts it off from above that.
const LAST_PART: f64 = 3.0;

/// A bay that has given nothing for so long, s, has no power, or its charger has ended: what gauges say seldom, they say every half minute.
/// A guess.
pub(super) const DARK_S: f64 = 30.0;

/// A charger that gives only when it is asked to is asked again where its bay has power and it gives nothing, so long apart, s: as long as what
/// fails is waited for at most.
const ASKED_AGAIN_S: f64 = 300.0;

/// What a charge has shown so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Watch {
    /// What keeps the battery from being charged, by its temperature.
    barred: Option<Trip>,
    /// For how long nothing to speak of has flowed, s.
    nothing_s: f64,
    /// The last current that did, A; 0 before any.
    last_a: f64,
    /// How often such a current was cut off.
    cut_off: u32,
    /// Whether the last that flowed was near the end of a charge.
    is_ending: bool,
    /// Since when the bay has given nothing, s since the agent's start.
    dark_since_s: Option<f64>,
    /// When it was asked again for that, s since the agent's start.
    asked_s: Option<f64>,
}

impl Watch {
    /// Takes in a sample of a charge whose current falls below `cutoff_a` at its end. Says whether it has ended.
    ///
    /// A taper falls off slowly, and ends near the full voltage: above what a charger begins anew from. A current that is cut off below
    /// that, or while the battery is too hot or too cold, comes again. (A shared converter's limit, or the robot's own load, may leave
    /// nothing for the battery as well.) Where it is cut off once more, something is wrong that nobody here knows of, such as one
    /// cell that is full before the others.
    pub(super) fn sees(&mut self, sample: &Sample, facts: &BatteryFacts, cutoff_a: f64) -> bool {
        self.feels(sample, facts);
        let (nothing, charges) = (sample.current_a.abs() < cutoff_a, -sample.current_a >= cutoff_a);
        self.nothing_s = if nothing && self.barred.is_none() { self.nothing_s + sample.dt_s } else { 0.0 };
        if charges {
            self.last_a = -sample.current_a;
        } else if nothing && self.nothing_s == sample.dt_s && self.last_a > 0.0 {
            self.cut_off += 1;
        }
        let charger = Charger::for_pack(facts, PowerPath::Selected);
        let fell_off = self.last_a > 0.0 && self.last_a < LAST_PART * cutoff_a;
        let is_full = sample.voltage_v >= charger.recharge_below_v_per_cell * f64::from(facts.series);
        if charges {
            self.is_ending = fell_off;
        }
        let gave_up = self.cut_off > 1 || self.nothing_s >= GIVES_NOTHING_HOLDS * charger.cutoff_hold_s;
        nothing && self.barred.is_none() && (fell_off || is_full || gave_up)
    }

    /// Takes in how warm the battery is.
    pub(super) fn feels(&mut self, sample: &Sample, facts: &BatteryFacts) {
        self.barred = facts.protection.no_charge_at(sample.temperature_degc, self.barred);
    }

    /// Takes in whether the bay gives nothing; for how long it has not, s.
    pub(super) fn dark_s(&mut self, now_s: f64, is_dark: bool) -> f64 {
        self.dark_since_s = if is_dark { Some(self.dark_since_s.unwrap_or(now_s)) } else { None };
        self.dark_since_s.map_or(0.0, |since_s| (now_s - since_s).max(f64::MIN_POSITIVE))
    }

    /// Whether a charger that gives nothing is to be asked again, which is noted.
    pub(super) fn is_to_be_asked_again(&mut self, now_s: f64) -> bool {
        let is_due = self.barred.is_none() && self.asked_s.is_none_or(|asked_s| now_s - asked_s >= ASKED_AGAIN_S);
        if is_due {
            self.asked_s = Some(now_s);
        }
        is_due
    }

    /// Whether the charge was near its end when the bay gave something last, and its temperature did not hold it up.
    pub(super) fn was_ending(&self) -> bool {
        self.is_ending && self.barred.is_none()
    }

    /// What holds the charge up, in words.
    pub(super) fn note(&self, sample: Option<&Sample>) -> Option<String> {
        let (why, sample) = self.barred.zip(sample)?;
        Some(format!("the battery is {why}: {:.0} °C", sample.temperature_degc))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(watch: &mut Watch, current_a: f64, voltage_v: f64, temperature_degc: f64) -> bool {
        let model = energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap();
        watch.sees(&Sample { dt_s: 1.0, current_a, voltage_v, temperature_degc }, model.battery(), 0.066)
    }

    #[test]
    fn a_current_that_has_fallen_off_near_the_full_voltage_ends_a_charge() {
        let mut watch = Watch::default();
        assert!(!ends(&mut watch, -1.32, 12.58, 30.0));
        assert!(!ends(&mut watch, -0.07, 12.6, 30.0));
        assert!(ends(&mut watch, -0.06, 12.6, 30.0));
        // The robot drains it: nothing is charged, and nothing has ended.
        assert!(!ends(&mut watch, 0.3, 12.4, 30.0));
    }

    #[test]
    fn a_charge_that_heat_holds_up_goes_on_and_says_why() {
        let mut watch = Watch::default();
        let hot = Sample { dt_s: 1.0, current_a: 0.0, voltage_v: 12.5, temperature_degc: 45.2 };
        assert!(!ends(&mut watch, 0.0, 12.5, 45.2));
        assert_eq!(watch.note(Some(&hot)).as_deref(), Some("the battery is too hot to charge: 45 °C"));
        // It holds until the release, however long that takes.
        for _ in 0..2000 {
            assert!(!ends(&mut watch, 0.0, 12.5, 42.0));
        }
        assert!(!ends(&mut watch, -1.32, 12.55, 39.9));
        assert_eq!(watch.note(Some(&hot)), None);
    }

    #[test]
    fn a_charger_that_gives_nothing_below_the_full_voltage_has_ended_after_a_while() {
        let mut watch = Watch::default();
        let ended: Vec<bool> = (0..300).map(|second| ends(&mut watch, [-1e-3, 1e-3][second % 2], 12.2, 30.0)).collect();
        assert!(ended[299] && !ended[..299].contains(&true));
    }

    #[test]
    fn a_charge_that_is_cut_off_again_and_again_has_ended() {
        let mut watch = Watch::default();
        assert!(![-1.3, 0.0, 0.0, -1.3].into_iter().any(|current_a| ends(&mut watch, current_a, 12.2, 30.0)));
        assert!(ends(&mut watch, 0.0, 12.2, 30.0));
    }

    #[test]
    fn a_current_that_falls_off_slowly_has_ended_wherever_the_voltage_stands() {
        // One weak cell is full, and the others are not.
        let mut watch = Watch::default();
        assert!(![-1.3, -0.8, -0.3, -0.1].into_iter().any(|current_a| ends(&mut watch, current_a, 12.2, 30.0)));
        assert!(ends(&mut watch, -0.06, 12.2, 30.0));
    }
}
