//! How long what a robot has in its pack lasts.

use energy::Estimate;
use energy::units::S_PER_H;
use proto::Travel;

use crate::models::from_wire;
use crate::scheduler::Lasts;

/// Share of the usual caution with which a robot's time is judged that was promised a service: a promise that was given is not broken over
/// the last minute of its margin.
const HELD_CAUTION: f64 = 0.5;

/// What a robot's pack holds against what it draws, as uncertain as doubts make it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stock {
    /// State of charge.
    pub(crate) soc: Estimate,
    /// What the pack can still give, Wh.
    pub(crate) remaining_wh: Estimate,
    /// What a full pack stores, Wh.
    pub(crate) stored_wh: f64,
    /// What work draws, W.
    pub(crate) drain_w: Estimate,
    /// Factor by which what ways take is less certain than the robot says.
    pub(crate) on_way: f64,
    /// Standard deviations that the confidence asks for.
    pub(crate) caution: f64,
    /// Whether the last plan promised it a service.
    pub(crate) held: bool,
}

impl Stock {
    /// What work draws with the caution that promises need, W.
    pub(crate) fn drain_hi_w(&self) -> f64 {
        self.drain_at(self.caution)
    }

    /// Charge that a way takes beyond as much work, SoC.
    pub(crate) fn extra_soc(&self, way: &Travel) -> Estimate {
        let extra_wh = way.energy_wh.value - self.drain_w.value * way.time_s / S_PER_H;
        Estimate::new(extra_wh / self.stored_wh, self.on_way * way.energy_wh.sigma / self.stored_wh)
    }

    /// How long it lasts with work alone, or until a service begins at the end of a way, where it must have `taken_in_s` left.
    pub(crate) fn lasts(&self, way: Option<&Travel>, taken_in_s: f64) -> Lasts {
        let surely_s = self.lasts_s(way, self.caution);
        // What nobody knows yet lasts no longer than a full pack would by the cautious drain. (Who draws nothing for certain lasts for ever,
        // however it is looked at.)
        let full_s = self.stored_wh / self.drain_hi_w().max(f64::MIN_POSITIVE) * S_PER_H;
        let expected_s = self.lasts_s(way, 0.0).min(full_s).max(surely_s);
        let spread_s = if expected_s.is_finite() && surely_s.is_finite() { expected_s - surely_s } else { 0.0 };
        let empty_s = if self.held { self.lasts_s(way, HELD_CAUTION * self.caution) } else { surely_s };
        Lasts {
            empty_s: empty_s - taken_in_s,
            surely_s: surely_s - taken_in_s,
            expected_s: Estimate::new(expected_s - taken_in_s, spread_s / self.caution.max(f64::MIN_POSITIVE)),
        }
    }

    /// Time until it is empty, s, when all is `z` deviations worse than expected: what the pack has over what is drawn, when it has kept
    /// back what the way takes beyond as much work. Below zero where that is more than it has.
    fn lasts_s(&self, way: Option<&Travel>, z: f64) -> f64 {
        let drain_w = self.drain_at(z);
        let on_way = |way: &Travel| {
            let taken_wh = from_wire(way.energy_wh);
            taken_wh.value + z * self.on_way * taken_wh.sigma - drain_w * way.time_s / S_PER_H
        };
        let left_wh = self.remaining_wh.value - z * self.remaining_wh.sigma - way.map_or(0.0, on_way);
        match drain_w <= 0.0 {
            true if way.is_some() && left_wh < 0.0 => f64::NEG_INFINITY,
            true => f64::INFINITY,
            false => left_wh / drain_w * S_PER_H,
        }
    }

    fn drain_at(&self, z: f64) -> f64 {
        self.drain_w.value + z * self.drain_w.sigma
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: f64 = 3600.0;

    fn stock(remaining_wh: Estimate) -> Stock {
        Stock {
            soc: Estimate::new(0.5, 0.025),
            remaining_wh,
            stored_wh: 20.0,
            drain_w: Estimate::exact(5.0),
            on_way: 1.0,
            caution: 2.0,
            held: false,
        }
    }

    #[test]
    fn each_way_is_kept_back_for_itself_alone() {
        let stock = stock(Estimate::new(10.0, 0.5));
        // Half an hour of work takes 2.5 Wh.
        let way = |mean_wh: f64| Travel { time_s: 0.5 * HOUR, energy_wh: proto::Estimate::new(mean_wh, 0.1) };
        let hours = |lasts: Lasts| [lasts.surely_s, lasts.expected_s.value, lasts.expected_s.sigma].map(|s| s / HOUR);
        let close = |lasts: Lasts, by_hand: [f64; 3]| {
            assert!(hours(lasts).iter().zip(by_hand).all(|(a, b)| (a - b).abs() < 1e-9), "{:?} {by_hand:?}", hours(lasts));
        };
        close(stock.lasts(None, 0.0), [1.8, 2.0, 0.1]);
        close(stock.lasts(Some(&way(4.0)), 0.0), [(9.0 - 1.7) / 5.0, 1.7, 0.12]);
        close(stock.lasts(Some(&way(1.0)), 0.01 * HOUR), [(9.0 + 1.3) / 5.0 - 0.01, 2.3 - 0.01, 0.12]);
        // What it has is not enough for this one, however little it works before.
        assert!(stock.lasts(Some(&way(12.5)), 0.0).expected_s.value < 0.5 * HOUR);
        let extra = stock.extra_soc(&way(4.0));
        assert!((extra.value - 1.5 / 20.0).abs() < 1e-12 && (extra.sigma - 0.1 / 20.0).abs() < 1e-12, "{extra:?}");
    }

    #[test]
    fn a_gauge_that_knows_next_to_nothing_says_as_much_of_how_long_it_lasts() {
        // By hand: 2.09 Wh are expected to be there and 2 are needed, out of 50 that they may be off.
        let lasts = stock(Estimate::new(2.09, 50.0)).lasts(None, 0.0);
        assert!((lasts.for_s(0.4 * HOUR) - 0.5007).abs() < 1e-3, "{}", lasts.for_s(0.4 * HOUR));
    }

    #[test]
    fn a_promise_is_held_to_with_less_caution_and_said_to_be_less_sure() {
        let lasts = Stock { held: true, ..stock(Estimate::new(10.0, 0.5)) }.lasts(None, 0.0);
        assert_eq!((lasts.empty_s, lasts.surely_s), (1.9 * HOUR, 1.8 * HOUR));
        // One deviation, of the normal distribution.
        assert!((lasts.for_s(1.9 * HOUR) - 0.8413).abs() < 1e-3 && lasts.for_s(1.8 * HOUR) == 1.0);
    }
}
