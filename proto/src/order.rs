//! Which of two messages of one sender is the newer one.

use crate::time::Timestamp;

/// By how much messages of one sender can overtake each other on the network, s.
const OVERTAKE_S: f64 = 10.0;

/// Whether a message (its instant and number) is newer than the one that is known.
///
/// Messages may come twice or in the wrong order, and a sender's counter restarts with it, so its clock decides. Of two messages of one
/// millisecond the counter tells: a command may change what a robot does just after its state was told. A sender whose clock was set
/// back is heard before that time comes again: its counter tells, and where it was restarted with that, that it spoke of the future
/// before.
#[must_use]
pub fn newer(now: Timestamp, (at, seq): (Timestamp, u64), known: Option<(Timestamp, u64)>) -> bool {
    known.is_none_or(|(known_at, known_seq)| {
        let [back_s, ahead_s] = [at, now].map(|at| known_at.seconds_since(at));
        let is_set_right = ahead_s > OVERTAKE_S && at.seconds_since(now) <= OVERTAKE_S;
        let has_counted = seq > known_seq;
        at > known_at || at == known_at && has_counted || back_s > OVERTAKE_S && (has_counted || is_set_right)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_word_counts_whatever_the_order_and_whatever_the_clock_does() {
        let at = |s: i64| Timestamp::from_unix_ms(s * 1000);
        let newer = |now_s, stamp, known| newer(at(now_s), stamp, known);
        assert!(newer(1, (at(1), 1), None));
        assert!(newer(2, (at(2), 2), Some((at(1), 1))));
        assert!(!newer(1, (at(1), 1), Some((at(1), 1))), "a copy");
        assert!(!newer(2, (at(1), 1), Some((at(2), 2))), "overtaken");
        assert!(newer(1, (at(1), 2), Some((at(1), 1))), "the second word of one moment");
        assert!(!newer(1, (at(1), 1), Some((at(1), 2))), "the first one, overtaken");
        assert!(newer(3, (at(3), 1), Some((at(2), 700))), "restarted");
        assert!(newer(100, (at(100), 8), Some((at(3_700), 7))), "set back by an hour");
        assert!(newer(100, (at(100), 1), Some((at(3_700), 700))), "restarted, and its clock is not an hour ahead any more");
        assert!(!newer(3_700, (at(100), 6), Some((at(3_700), 7))), "a copy from before the clock was set forward");
        assert!(!newer(100, (at(3_680), 5), Some((at(3_700), 7))), "late, from a clock that stays an hour ahead");
    }
}
