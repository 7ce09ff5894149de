//! The battery selector: which pack feeds the station, and whether the station lives through the
//! change from one to the next (Kottas, section B.2.2: the basis of an uninterruptible supply).
//!
//! ```text
//!   pack 1 ──┤ ├──┬── capacitor ── converters, computer, lift
//!   pack 2 ──┤ ├──┘
//! ```
//!
//! Before it makes the new contact, a selector breaks the old one (a gap, carried by the
//! capacitor), or it makes first (no gap, but the two packs are in parallel for a moment).

/// State of charge at which a pack that gave out feeds the station again, where it is charged. A guess: what a lift and a few minutes of service
/// take is there by then.
pub const RELEASED_SOC: f64 = 0.1;

/// How the selector changes from one pack to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Change {
    /// Breaks, waits, makes: the station has no pack during the gap.
    BreakBeforeMake {
        /// Length of the gap, s (>= 0).
        gap_s: f64,
    },
    /// Makes, then breaks: both packs are connected during the overlap.
    MakeBeforeBreak {
        /// Length of the overlap, s (>= 0).
        overlap_s: f64,
        /// Resistance from one pack to the other: both packs' own and that of the switches, ohm (> 0).
        loop_ohm: f64,
    },
}

/// A selector with the capacitor behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Selector {
    /// How it changes packs.
    pub change: Change,
    /// Capacitance at its output, F (>= 0).
    pub capacitance_f: f64,
    /// Least input voltage at which the station's converters work, V (> 0).
    pub least_v: f64,
}

/// What a change of packs does to the station.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transition {
    /// Whether the converters work throughout.
    pub survives: bool,
    /// Time that the capacitor could carry the load, s.
    pub hold_up_s: f64,
    /// Lowest voltage at the converters, V.
    pub lowest_v: f64,
    /// Energy from the pack that takes over beside the load's own: what refills the capacitor, J.
    pub refill_j: f64,
    /// Greatest current from pack to pack, A; positive into the pack that is given up.
    pub cross_a: f64,
}

/// Time for which a capacitor feeds a constant power while its voltage falls, s:
/// `t = C (V_1^2 - V_2^2) / (2 P)` with C in F, V in V and P in W. Converters draw a constant
/// power, so the current rises as the voltage falls; `t = C (V_1 - V_2) / I` would promise too
/// much. Without a load the time is infinite; below `to_v` it is 0.
#[must_use]
pub fn hold_up_s(capacitance_f: f64, from_v: f64, to_v: f64, power_w: f64) -> f64 {
    if from_v <= to_v {
        return 0.0;
    }
    if power_w <= 0.0 {
        return f64::INFINITY;
    }
    capacitance_f * (from_v * from_v - to_v * to_v) / (2.0 * power_w)
}

/// Voltage of that capacitor after `time_s`, V; 0 once it is empty.
#[must_use]
pub fn held_v(capacitance_f: f64, from_v: f64, power_w: f64, time_s: f64) -> f64 {
    if power_w * time_s <= 0.0 {
        return from_v;
    }
    if capacitance_f <= 0.0 {
        return 0.0;
    }
    (from_v * from_v - 2.0 * power_w * time_s / capacitance_f).max(0.0).sqrt()
}

/// Energy that a source of `to_v` gives to fill a capacitor from `from_v`, J: `C V (V - V_1)`, of
/// which `C (V - V_1)^2 / 2` heats the resistance between them whatever that is.
#[must_use]
pub fn refill_j(capacitance_f: f64, from_v: f64, to_v: f64) -> f64 {
    capacitance_f * to_v * (to_v - from_v).max(0.0)
}

impl Selector {
    /// What a change from a pack at `from_v` to one at `to_v` does while the station takes
    /// `power_w` (voltages under that load, V; power in W, >= 0).
    #[must_use]
    pub fn transition(&self, from_v: f64, to_v: f64, power_w: f64) -> Transition {
        let hold_up_s = hold_up_s(self.capacitance_f, from_v, self.least_v, power_w);
        match self.change {
            Change::BreakBeforeMake { gap_s } => {
                let lowest_v = held_v(self.capacitance_f, from_v, power_w, gap_s);
                let survives = lowest_v >= self.least_v && to_v >= self.least_v;
                let refill_j = refill_j(self.capacitance_f, lowest_v, to_v);
                Transition { survives, hold_up_s, lowest_v: lowest_v.min(to_v), refill_j, cross_a: 0.0 }
            }
            Change::MakeBeforeBreak { loop_ohm, .. } => {
                let lowest_v = from_v.min(to_v);
                Transition {
                    survives: lowest_v >= self.least_v,
                    hold_up_s,
                    lowest_v,
                    refill_j: refill_j(self.capacitance_f, from_v, to_v),
                    cross_a: (to_v - from_v) / loop_ohm,
                }
            }
        }
    }
}

/// What the selector knows of a pack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PackSeen {
    /// Its voltage, V: under load for the active one, at rest for the others.
    pub voltage_v: f64,
    /// Whether its protection lets it be discharged.
    pub usable: bool,
}

/// When the selector changes packs, and to which.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rule {
    /// The active pack is left when its voltage falls below this, V.
    pub leave_below_v: f64,
    /// A pack is taken over only above this, V. It lies higher than the other: a pack that was
    /// left recovers at rest, and would be taken again at once.
    pub take_above_v: f64,
}

impl Rule {
    /// The pack that is to feed the station; `None` when none can. A request wins when its pack
    /// can be used. The active pack stays while it is good; then the next in order that is good,
    /// and when none is, any that is usable: better a low pack than none.
    #[must_use]
    pub fn choose(&self, packs: &[PackSeen], active: usize, request: Option<usize>) -> Option<usize> {
        let usable = |index: usize| packs.get(index).is_some_and(|pack| pack.usable);
        if let Some(wanted) = request.filter(|&wanted| usable(wanted)) {
            return Some(wanted);
        }
        if usable(active) && packs[active].voltage_v >= self.leave_below_v {
            return Some(active);
        }
        let others = || (active + 1..packs.len()).chain(0..active.min(packs.len())).filter(|&index| usable(index));
        others()
            .find(|&index| packs[index].voltage_v >= self.take_above_v)
            .or_else(|| usable(active).then_some(active))
            .or_else(|| others().next())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BREAKS: Selector = Selector { change: Change::BreakBeforeMake { gap_s: 0.005 }, capacitance_f: 0.01, least_v: 8.0 };

    #[test]
    fn the_hold_up_time_is_that_of_a_power_supplys_handbook() {
        // Server supplies: 400 V to 300 V, 200 W, 20 ms need 114 microfarads (vbatpower.com, formula
        // collection; the same in the ATX design guides' sizing).
        assert!((hold_up_s(114.3e-6, 400.0, 300.0, 200.0) - 0.020).abs() < 1e-5);
        assert!((held_v(114.3e-6, 400.0, 200.0, 0.020) - 300.0).abs() < 0.02);
        assert_eq!(hold_up_s(1e-3, 8.0, 9.0, 10.0), 0.0);
        assert_eq!(hold_up_s(1e-3, 9.0, 8.0, 0.0), f64::INFINITY);
    }

    #[test]
    fn a_capacitor_carries_the_gap_or_does_not() {
        // 10 mF from 9 V to 8 V under 75 W: 0.01 x 17 / 150 = 1.13 ms; the gap is 5 ms.
        let lost = BREAKS.transition(9.0, 12.0, 75.0);
        assert!(!lost.survives && (lost.hold_up_s - 0.01 * 17.0 / 150.0).abs() < 1e-12);
        // So 2 x 75 x 0.005 / 17 = 44 mF are needed.
        let needed_f = 0.75 / 17.0;
        assert!(Selector { capacitance_f: 1.001 * needed_f, ..BREAKS }.transition(9.0, 12.0, 75.0).survives);
        assert!(!Selector { capacitance_f: 0.999 * needed_f, ..BREAKS }.transition(9.0, 12.0, 75.0).survives);
    }

    #[test]
    fn making_before_breaking_needs_no_capacitor_but_lets_the_full_pack_feed_the_empty_one() {
        let makes = Selector { change: Change::MakeBeforeBreak { overlap_s: 0.001, loop_ohm: 0.1 }, capacitance_f: 0.0, least_v: 8.0 };
        let transition = makes.transition(9.0, 12.0, 75.0);
        // 3 V over 0.1 ohm: 30 A, four times the 7.6 A that a station's pack is charged with.
        assert!(transition.survives && (transition.cross_a - 30.0).abs() < 1e-12);
        assert_eq!(BREAKS.transition(9.0, 12.0, 75.0).cross_a, 0.0);
    }

    #[test]
    fn the_active_pack_stays_until_it_is_low_and_a_recovered_one_is_not_taken_back() {
        let rule = Rule { leave_below_v: 9.3, take_above_v: 10.5 };
        let pack = |voltage_v| PackSeen { voltage_v, usable: true };
        assert_eq!(rule.choose(&[pack(9.4), pack(12.0)], 0, None), Some(0));
        assert_eq!(rule.choose(&[pack(9.2), pack(12.0)], 0, None), Some(1));
        // The first has recovered to 10 V at rest; the second is now low too.
        assert_eq!(rule.choose(&[pack(10.0), pack(9.2)], 1, None), Some(1), "better than one that fails sooner");
        assert_eq!(rule.choose(&[pack(12.0), pack(11.0)], 0, Some(1)), Some(1), "asked for");
        let gone = PackSeen { voltage_v: 9.0, usable: false };
        assert_eq!(rule.choose(&[pack(10.0), gone], 1, Some(1)), Some(0));
        assert_eq!(rule.choose(&[gone, gone], 0, None), None);
    }
}
