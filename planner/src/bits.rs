//! A row of flags, one per tick, that answers "any in this stretch?" by whole words.

/// Flags by tick.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Bits(Vec<u64>);

impl Bits {
    /// `ticks` flags, all of them set or none.
    pub(crate) fn new(ticks: usize, set: bool) -> Self {
        Self(vec![if set { u64::MAX } else { 0 }; ticks.div_ceil(64) + 1])
    }

    /// Sets the flags of `from..` to what holds of these.
    #[inline]
    pub(crate) fn put<T: Copy>(&mut self, from: usize, of: &[T], holds: impl Fn(T) -> bool) {
        let (mut at, mut of) = (from, of);
        while !of.is_empty() {
            let (word, bit) = (at / 64, at % 64);
            let (here, rest) = of.split_at(of.len().min(64 - bit));
            let (mut mask, mut flags) = (0_u64, 0_u64);
            for (n, &each) in here.iter().enumerate() {
                mask |= 1 << n;
                flags |= u64::from(holds(each)) << n;
            }
            self.0[word] = self.0[word] & !(mask << bit) | flags << bit;
            (at, of) = (at + here.len(), rest);
        }
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
