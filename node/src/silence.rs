//! How long no coordinator has been heard.

use proto::Timestamp;

/// Knows whether a coordinator is there. Before the first word of one there is none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Silence {
    heard: bool,
    since: Option<Timestamp>,
}

impl Silence {
    /// A coordinator appeared (true), or was lost (false).
    pub fn tell(&mut self, now: Timestamp, heard: bool) {
        if heard {
            *self = Self { heard, since: None };
        } else if std::mem::take(&mut self.heard) || self.since.is_none() {
            self.since = Some(now);
        }
    }

    /// A coordinator has asked for something: it was there now. That it is lost may have been told before its last word comes, so
    /// that this says nothing of what follows.
    pub fn speaks(&mut self, now: Timestamp) {
        if !self.heard {
            self.since = Some(now);
        }
    }

    /// Seconds without a coordinator; 0 while there is one.
    pub fn lasts_s(&mut self, now: Timestamp) -> f64 {
        if self.heard {
            return 0.0;
        }
        let since = self.since.get_or_insert(now);
        // The clock was set back: count from here.
        *since = now.min(*since);
        now.seconds_since(*since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_from_the_loss_and_survives_a_clock_that_is_set_back() {
        let at = |s: i64| Timestamp::from_unix_ms(s * 1000);
        let mut silence = Silence::default();
        assert_eq!(silence.lasts_s(at(100)), 0.0);
        assert_eq!(silence.lasts_s(at(130)), 30.0);
        silence.tell(at(131), true);
        assert_eq!(silence.lasts_s(at(200)), 0.0);
        silence.tell(at(200), false);
        silence.tell(at(210), false);
        assert_eq!(silence.lasts_s(at(260)), 60.0);
        assert_eq!(silence.lasts_s(at(50)), 0.0);
        assert_eq!(silence.lasts_s(at(70)), 20.0);
        // Its last word comes after its loss was told: nobody tells that again.
        silence.speaks(at(75));
        assert_eq!(silence.lasts_s(at(75)), 0.0);
        assert_eq!(silence.lasts_s(at(135)), 60.0);
        silence.tell(at(136), true);
        silence.speaks(at(140));
        assert_eq!(silence.lasts_s(at(300)), 0.0);
    }
}
