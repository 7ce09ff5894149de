//! What is left of something in each tick, so held that a stretch of ticks is changed word by word.

use crate::bits::Bits;
use crate::problem::Tick;

/// Whole numbers by tick, each bit of 64 of them in a word of its own (two's complement).
#[derive(Debug, Clone)]
pub(super) struct Counters {
    /// For each 64 ticks the lowest bits, the next ones, and so on; the last are the signs.
    words: Vec<u64>,
    bits: usize,
    none: Bits,
}

impl Counters {
    /// So many everywhere. Each may rise or fall by `room`.
    pub(super) fn new(ticks: usize, left: i64, room: usize) -> Self {
        let most = left.unsigned_abs().saturating_add(room as u64);
        let bits = (u64::BITS - most.leading_zeros() + 1) as usize;
        let all = |bit: usize| if left >> bit.min(63) & 1 == 1 { u64::MAX } else { 0 };
        let words = (0..ticks.div_ceil(64)).flat_map(|_| (0..bits).map(all)).collect();
        Self { words, bits, none: Bits::new(ticks, left <= 0) }
    }

    /// One more (`1`) or one less (`-1`) in these ticks.
    #[inline]
    pub(super) fn change(&mut self, from: usize, to: usize, by: i32) {
        let mut at = from;
        while at < to {
            let (word, bit) = (at / 64, at % 64);
            let count = (to - at).min(64 - bit);
            let mask = Bits::stretch(bit, count);
            // To add is to carry where a bit was set, to take away where it was not.
            let turned = if by > 0 { 0 } else { u64::MAX };
            let (mut carried, mut some, mut sign) = (mask, 0, 0);
            for bits in &mut self.words[word * self.bits..][..self.bits] {
                let next = (*bits ^ turned) & carried;
                *bits ^= carried;
                carried = next;
                some |= *bits;
                sign = *bits;
            }
            self.none.set(word, mask, sign | !some);
            at += count;
        }
    }

    /// The ticks in which nothing is left.
    #[inline]
    pub(super) fn none(&self) -> &Bits {
        &self.none
    }

    /// What is left in each tick.
    pub(super) fn left(&self, horizon: Tick) -> impl Iterator<Item = i64> + '_ {
        (0..horizon as usize).map(|tick| self.left_at(tick))
    }

    /// Tells what is left from a tick on, in words.
    pub(super) fn from(&self, tick: usize, mut tell: impl FnMut(u64)) {
        let first = tick / 64 * self.bits;
        for (place, &word) in self.words.iter().enumerate().skip(first) {
            tell(if place < first + self.bits { word >> (tick % 64) } else { word });
        }
    }

    /// What is left in a tick.
    pub(super) fn left_at(&self, tick: usize) -> i64 {
        let bits = &self.words[tick / 64 * self.bits..][..self.bits];
        let set = |word: u64| (word >> (tick % 64) & 1) as i64;
        let (sign, number) = bits.split_last().map_or((0, bits), |(&sign, number)| (set(sign), number));
        number.iter().zip(0..).map(|(&word, place)| set(word) << place).sum::<i64>() - (sign << number.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_counts_like_a_row_of_numbers() {
        for start in [-1, 0, 1, 2, 7] {
            let mut counters = Counters::new(150, start, 4);
            let mut row = vec![start; 150];
            let changes = [(0, 150, -1), (3, 70, 1), (60, 64, 1), (64, 128, 1), (63, 65, -1), (127, 150, -1), (10, 10, 1), (149, 150, 1)];
            for (from, to, by) in changes {
                counters.change(from, to, by);
                row[from..to].iter_mut().for_each(|left| *left += i64::from(by));
                assert_eq!(counters.left(150).collect::<Vec<_>>(), row);
                for (tick, &left) in row.iter().enumerate() {
                    assert_eq!(counters.none().any(tick, tick + 1), left <= 0, "tick {tick} of {row:?}");
                }
            }
        }
    }
}
