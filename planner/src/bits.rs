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
    pub(crate) fn put<T>(&mut self, from: usize, of: &[T], holds: impl Fn(&T) -> bool) {
        let (mut at, mut of) = (from, of);
        while !of.is_empty() {
            let bit = at % 64;
            let (here, rest) = of.split_at(of.len().min(64 - bit));
            let flags = here.iter().zip(bit..).fold(0, |flags, (each, bit)| flags | u64::from(holds(each)) << bit);
            self.set(at / 64, Self::stretch(bit, here.len()), flags);
            (at, of) = (at + here.len(), rest);
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

    /// The words of 64 flags each; there is always one after that of the last tick.
    pub(crate) fn words(&self) -> &[u64] {
        &self.0
    }

    /// Whether a flag in `from..to` is set.
    #[inline(always)]
    pub(crate) fn any(&self, from: usize, to: usize) -> bool {
        any(&self.0, from, to)
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

/// Whether a flag in `from..to` of these words is set.
#[inline(always)]
pub(crate) fn any(words: &[u64], from: usize, to: usize) -> bool {
    if from >= to {
        return false;
    }
    if to - from > 64 {
        return any_of_many(words, from, to);
    }
    let (word, bit) = (from / 64, from % 64);
    let flags = words[word] >> bit | words[word + 1] << 1 << (63 - bit);
    flags << (64 - (to - from)) != 0
}

fn any_of_many(words: &[u64], from: usize, to: usize) -> bool {
    let (first, last) = (from / 64, (to - 1) / 64);
    let head = u64::MAX << (from % 64);
    let tail = u64::MAX >> (63 - (to - 1) % 64);
    words[first] & head != 0 || words[last] & tail != 0 || words[first + 1..last].iter().any(|&word| word != 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_is_asked_as_its_ticks_would_be() {
        for set in [vec![], vec![0], vec![63], vec![64, 65], vec![127], vec![130, 191]] {
            let mut bits = Bits::new(192, false);
            bits.put(0, &(0..192).map(|tick| set.contains(&tick)).collect::<Vec<_>>(), |&is_set| is_set);
            for from in 0..=192 {
                for to in from..=192 {
                    assert_eq!(bits.any(from, to), (from..to).any(|tick| set.contains(&tick)), "{set:?} {from}..{to}");
                    assert_eq!(bits.first(from, to), (from..to).find(|tick| set.contains(tick)), "{set:?} {from}..{to}");
                }
            }
        }
    }
}
