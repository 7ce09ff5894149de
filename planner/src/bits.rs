//! A row of flags, one per tick, that answers "any in this stretch?" by whole words.

/// Flags by tick.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Bits(Vec<u64>);

impl Bits {
    /// `ticks` flags, all of them set or none.
    pub(crate) fn new(ticks: usize, set: bool) -> Self {
        Self(vec![if set { u64::MAX } else { 0 }; ticks.div_ceil(64) + 1])
    }

    /// Sets the flags of `from..` to what holds of these, one after the other.
    #[inline]
    pub(crate) fn put<T>(&mut self, from: usize, of: &mut [T], mut holds: impl FnMut(&mut T) -> bool) {
        let (mut at, mut of) = (from, of);
        while !of.is_empty() {
            let bit = at % 64;
            let (here, rest) = of.split_at_mut(of.len().min(64 - bit));
            let (count, mut flags) = (here.len(), 0_u64);
            for each in here {
                flags = flags >> 1 | u64::from(holds(each)) << 63;
            }
            self.set(at / 64, Self::stretch(bit, count), flags >> (64 - count) << bit);
            (at, of) = (at + count, rest);
        }
    }

    /// `count` flags of a word from this one on; 1 to 64.
    #[inline]
    pub(crate) fn stretch(bit: usize, count: usize) -> u64 {
        u64::MAX >> (64 - count) << bit
    }

    /// Sets those flags of a word that a mask names.
    #[inline]
    pub(crate) fn set(&mut self, word: usize, mask: u64, flags: u64) {
        self.0[word] = self.0[word] & !mask | flags & mask;
    }

    /// Whether a flag in `from..to` is set.
    #[inline]
    pub(crate) fn any(&self, from: usize, to: usize) -> bool {
        if from >= to {
            return false;
        }
        let (first, last) = (from / 64, (to - 1) / 64);
        let head = u64::MAX << (from % 64);
        let tail = u64::MAX >> (63 - (to - 1) % 64);
        if first == last {
            return self.0[first] & head & tail != 0;
        }
        self.0[first] & head != 0 || self.0[last] & tail != 0 || self.0[first + 1..last].iter().any(|&word| word != 0)
    }

    /// The first flag in `from..to` that is set.
    #[inline]
    pub(crate) fn first(&self, from: usize, to: usize) -> Option<usize> {
        let mut at = from;
        while at < to {
            let word = self.0[at / 64] >> (at % 64);
            if word != 0 {
                let found = at + word.trailing_zeros() as usize;
                return (found < to).then_some(found);
            }
            at = (at / 64 + 1) * 64;
        }
        None
    }
}
