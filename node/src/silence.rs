//! How long no coordinator has been heard.

use proto::Timestamp;

/// What passes between two looks is no more than this, s: else a clock was set, or the machine has slept.
pub const LOOK_MAX_S: f64 = 10.0;

/// Knows whether a coordinator is there. Before the first word of one there is none. What counts is the time that passes between its calls,
/// whatever the clock is set to.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Silence {
    heard: bool,
    looked: Option<Timestamp>,
    lasts_s: f64,
}

impl Silence {
    fn pass(&mut self, now: Timestamp) {
        let passed_s = self.looked.replace(now).map_or(0.0, |looked| now.seconds_since(looked));
        self.lasts_s += passed_s.clamp(0.0, LOOK_MAX_S);
    }

    /// A coordinator appeared (true), or was lost (false).
    pub fn tell(&mut self, now: Timestamp, heard: bool) {
        self.pass(now);
        if std::mem::replace(&mut self.heard, heard) || heard {
            self.lasts_s = 0.0;
        }
    }

    /// A coordinator has asked for something: it was there now. That it is lost may have been told before its last word comes, so
    /// that this says nothing of what follows.
    pub fn speaks(&mut self, now: Timestamp) {
        self.pass(now);
        self.lasts_s = 0.0;
    }

    /// Seconds without a coordinator; 0 while there is one. To be asked every few seconds.
    pub fn lasts_s(&mut self, now: Timestamp) -> f64 {
        self.pass(now);
        if self.heard {
            self.lasts_s = 0.0;
        }
        self.lasts_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(s: i64) -> Timestamp {
        Timestamp::from_unix_ms(s * 1000)
    }

    /// What it says at the end of these seconds, of which each is looked at.
    fn over(silence: &mut Silence, seconds: std::ops::RangeInclusive<i64>) -> f64 {
        seconds.map(|s| silence.lasts_s(at(s))).last().unwrap()
    }

    #[test]
    fn counts_from_the_loss_and_from_the_last_word() {
        let mut silence = Silence::default();
        assert_eq!(silence.lasts_s(at(100)), 0.0);
        assert_eq!(over(&mut silence, 101..=130), 30.0);
        silence.tell(at(131), true);
        assert_eq!(over(&mut silence, 132..=200), 0.0);
        silence.tell(at(200), false);
        silence.tell(at(210), false);
        assert_eq!(over(&mut silence, 211..=260), 60.0);
        // Its last word comes after its loss was told: nobody tells that again.
        silence.speaks(at(261));
        assert_eq!(silence.lasts_s(at(261)), 0.0);
        assert_eq!(over(&mut silence, 262..=321), 60.0);
        silence.tell(at(322), true);
        silence.speaks(at(330));
        assert_eq!(over(&mut silence, 331..=400), 0.0);
    }

    #[test]
    fn a_clock_that_is_set_is_no_silence() {
        for set_s in [3600, -3600] {
            let mut silence = Silence::default();
            assert_eq!(over(&mut silence, 5000..=5020), 20.0);
            let set = silence.lasts_s(at(5021 + set_s));
            assert!((20.0..=30.0).contains(&set), "{set}");
            assert_eq!(over(&mut silence, 5022 + set_s..=5041 + set_s), set + 20.0);
        }
    }
}
