//! A pack that a robot left behind and that is charged at the station: drawn from the station's packs beside its
//! services, and long after the exchange is over.

use energy::Need;
use energy::units::S_PER_H;

use super::carry::Part;
use super::charging::Point;

/// Charging such a pack, at a steady power.
#[derive(Debug, Clone, PartialEq)]
pub struct Recharging {
    /// When it begins, s from now.
    pub from_s: f64,
    /// When the pack is charged, s from now.
    pub until_s: f64,
    /// What the station's packs give for it.
    pub need: Need,
}

impl Recharging {
    /// What an exchange takes until it ends at `end_s`, and the charge of the pack that it leaves, which follows: together
    /// the whole need. Its own doubt is that of the charge.
    #[must_use]
    pub fn split(whole: &Need, charge: Point, end_s: f64) -> (Need, Option<Self>) {
        let share = (charge.bare_wh / whole.mean_wh.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let exchange = Need { own_variance: 0.0, ..whole.scaled(1.0 - share) };
        let need = Need { own_variance: whole.own_variance, ..whole.scaled(share) };
        (exchange, Some(Self { from_s: end_s, until_s: end_s + charge.bare_s, need }))
    }

    /// What of it is drawn by a time, s from now.
    #[must_use]
    pub fn by(&self, time_s: f64) -> Need {
        self.need.scaled(self.share(time_s))
    }

    /// What of it is left at a time, s from now.
    #[must_use]
    pub fn after(&self, time_s: f64) -> Self {
        let [from_s, until_s] = [self.from_s, self.until_s].map(|at_s| at_s.max(time_s));
        Self { from_s, until_s, need: self.need.scaled(1.0 - self.share(time_s)) }
    }

    /// The same so much later.
    #[must_use]
    pub fn later(&self, by_s: f64) -> Self {
        Self { from_s: self.from_s + by_s, until_s: self.until_s + by_s, need: self.need.clone() }
    }

    /// As a part of a load.
    #[must_use]
    pub fn part(&self) -> Part {
        (self.from_s, self.until_s, self.need.mean_wh / (self.until_s - self.from_s).max(1.0) * S_PER_H)
    }

    fn share(&self, time_s: f64) -> f64 {
        ((time_s - self.from_s) / (self.until_s - self.from_s).max(1.0)).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_drawn_by_a_time_and_what_is_left_after_it_are_the_whole() {
        let need = Need { mean_wh: 20.0, shared_wh: vec![1.0], own_variance: 4.0 };
        let charged = Recharging { from_s: 600.0, until_s: 4200.0, need };
        for (time_s, drawn_wh) in [(0.0, 0.0), (600.0, 0.0), (1500.0, 5.0), (4200.0, 20.0), (9000.0, 20.0)] {
            let (drawn, left) = (charged.by(time_s), charged.after(time_s));
            assert!((drawn.mean_wh - drawn_wh).abs() < 1e-9, "{time_s}: {drawn:?}");
            assert!((drawn.mean_wh + left.need.mean_wh - 20.0).abs() < 1e-9);
        }
        // 20 Wh in an hour are 20 W, whenever it is looked at.
        for time_s in [0.0, 300.0, 2400.0] {
            assert!((charged.after(time_s).part().2 - 20.0).abs() < 1e-9);
        }
        assert_eq!((charged.after(2400.0).part().0, charged.after(2400.0).part().1), (2400.0, 4200.0));
        assert_eq!(charged.later(60.0).part(), (660.0, 4260.0, 20.0));
    }
}
