//! Loads: constant current, constant power, constant resistance, and any sum of them.
//!
//! A sum is a ZIP load: at the voltage V (V) it takes `I = I_0 + P / V + G V` in A, with the
//! constant current I_0 (A), the constant power P (W) and the conductance G (S). Kottas, chapter 4:
//! load devices show one of these three behaviours "or an ensemble of each".

use crate::{Channel, Real};

/// What a load keeps constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConsumerKind {
    /// The current: a sensor within its range of supply voltages.
    Current,
    /// The power: anything behind a switch-mode converter of its own.
    Power,
    /// The resistance: a heater, a lamp, a divider.
    Resistance,
}

impl ConsumerKind {
    /// The unit of a load's value.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            ConsumerKind::Current => "A",
            ConsumerKind::Power => "W",
            ConsumerKind::Resistance => "ohm",
        }
    }
}

/// A load with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Consumer {
    /// Name, for people.
    pub name: String,
    /// What it keeps constant.
    pub kind: ConsumerKind,
    /// How much: A, W or ohm by kind; >= 0, a resistance > 0.
    pub value: f64,
    /// Standard deviation of that, in the same unit, >= 0.
    pub sigma: f64,
    /// Channel 0..1 that switches or scales the load (for a resistance, its conductance); always on without.
    pub when: Option<Channel>,
}

impl Consumer {
    /// The load as part of a sum, at a share 0..1 of its full size.
    #[must_use]
    pub fn zip<S: Real>(&self, share: S) -> Zip<S> {
        let mut zip = Zip::none();
        match self.kind {
            ConsumerKind::Current => zip.current_a = share * self.value,
            ConsumerKind::Power => zip.power_w = share * self.value,
            ConsumerKind::Resistance => zip.conductance_s = share / self.value,
        }
        zip
    }
}

/// A sum of loads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zip<S> {
    /// Constant current, A.
    pub current_a: S,
    /// Constant power, W.
    pub power_w: S,
    /// Conductance, S.
    pub conductance_s: S,
}

impl<S: Real> Zip<S> {
    /// No load.
    #[must_use]
    pub fn none() -> Self {
        Self { current_a: S::from(0.0), power_w: S::from(0.0), conductance_s: S::from(0.0) }
    }

    /// Puts another load beside this one.
    pub fn join(&mut self, other: Zip<S>) {
        self.current_a += other.current_a;
        self.power_w += other.power_w;
        self.conductance_s += other.conductance_s;
    }

    /// Current at a voltage, A. Without a voltage there is no current.
    #[must_use]
    pub fn current_a(&self, voltage_v: S) -> S {
        if voltage_v.re() > 0.0 { self.current_a + self.power_w / voltage_v + self.conductance_s * voltage_v } else { S::from(0.0) }
    }

    /// Power at a voltage, W.
    #[must_use]
    pub fn power_w(&self, voltage_v: S) -> S {
        if voltage_v.re() > 0.0 { (self.conductance_s * voltage_v + self.current_a) * voltage_v + self.power_w } else { S::from(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(kind: ConsumerKind, value: f64) -> Consumer {
        Consumer { name: "test".to_owned(), kind, value, sigma: 0.0, when: None }
    }

    #[test]
    fn each_kind_keeps_its_own_quantity_constant() {
        for volts in [3.0_f64, 6.0, 12.0] {
            assert!((load(ConsumerKind::Current, 0.2).zip(1.0).current_a(volts) - 0.2).abs() < 1e-15);
            assert!((load(ConsumerKind::Power, 1.2).zip(1.0).power_w(volts) - 1.2).abs() < 1e-15);
            assert!((load(ConsumerKind::Power, 1.2).zip(1.0).current_a(volts) * volts - 1.2).abs() < 1e-12);
            assert!((volts / load(ConsumerKind::Resistance, 50.0).zip(1.0).current_a(volts) - 50.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_mixture_is_the_sum_of_its_parts() {
        let mut zip = Zip::none();
        for (kind, value) in [(ConsumerKind::Current, 0.1), (ConsumerKind::Power, 2.0), (ConsumerKind::Resistance, 20.0)] {
            zip.join(load(kind, value).zip(1.0_f64));
        }
        // At 5 V: 0.1 + 0.4 + 0.25 A.
        assert!((zip.current_a(5.0) - 0.75).abs() < 1e-12);
        assert!((zip.power_w(5.0) - 3.75).abs() < 1e-12);
        assert_eq!(zip.current_a(0.0), 0.0);
    }

    #[test]
    fn half_on_is_half_the_current_for_every_kind() {
        for kind in [ConsumerKind::Current, ConsumerKind::Power, ConsumerKind::Resistance] {
            let (full, half) = (load(kind, 3.0).zip(1.0_f64), load(kind, 3.0).zip(0.5));
            assert!((half.current_a(7.0) * 2.0 - full.current_a(7.0)).abs() < 1e-12, "{kind:?}");
        }
    }
}
