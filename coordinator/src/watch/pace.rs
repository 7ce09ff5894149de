//! How often somebody speaks, and so how long a silence says nothing.

/// A silence of so many usual intervals is one.
const INTERVALS: f64 = 2.5;
/// Beyond that nobody knows what went on in between, however seldom somebody speaks, s: as long as what is averaged.
const MOST_S: f64 = 60.0;
/// Share of what is usual that the last interval counts for.
const NEWEST: f64 = 0.2;

/// The usual interval between messages.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pace {
    usual_s: f64,
}

impl Pace {
    /// Takes in an interval, s.
    pub(super) fn add(&mut self, interval_s: f64) {
        let interval_s = interval_s.clamp(0.0, MOST_S);
        self.usual_s = if self.usual_s == 0.0 { interval_s } else { self.usual_s + NEWEST * (interval_s - self.usual_s) };
    }

    /// What follows on a silence: it may be the new pace.
    pub(super) fn anew(interval_s: f64) -> Self {
        Self { usual_s: interval_s.clamp(0.0, MOST_S) }
    }

    /// From when on a silence says nothing, s; at least this long.
    pub(super) fn silent_s(self, least_s: f64) -> f64 {
        least_s.max((INTERVALS * self.usual_s).min(MOST_S))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_speaks_seldom_is_silent_later() {
        let mut pace = Pace::default();
        assert_eq!(pace.silent_s(10.0), 10.0);
        (0..30).for_each(|_| pace.add(1.0));
        assert_eq!(pace.silent_s(2.0), 2.5);
        (0..60).for_each(|_| pace.add(9.0));
        assert!((pace.silent_s(2.0) - 22.5).abs() < 0.01, "{pace:?}");
        assert_eq!(Pace::anew(3600.0).silent_s(10.0), 60.0);
    }
}
