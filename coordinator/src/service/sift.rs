//! A batch of which the store refuses something, by halves: with few tries all else of it is kept, and in order.

use std::ops::Range;

use crate::store::Record;

/// The parts of a batch that are still to be tried.
#[derive(Debug)]
pub(super) struct Sift {
    /// The next one last.
    parts: Vec<Range<usize>>,
}

impl Sift {
    /// A batch of so many records, to be tried as a whole first.
    pub(super) fn new(len: usize) -> Self {
        let whole = 0..len;
        Self { parts: if len == 0 { Vec::new() } else { vec![whole] } }
    }

    /// What is to be tried next: everything before it is done with.
    pub(super) fn next(&mut self) -> Option<Range<usize>> {
        self.parts.pop()
    }

    /// A part was refused: its halves are tried next. Whether it was a single record, which is left out.
    pub(super) fn refused(&mut self, part: Range<usize>, records: &[Record]) -> bool {
        if part.len() < 2 {
            return true;
        }
        let middle = part.start + part.len() / 2;
        // What came of an input stays with its line, where it can: the store takes from there when it came.
        let middle = (part.start + 1..=middle).rev().find(|&place| matches!(records[place], Record::Heard(_))).unwrap_or(middle);
        self.parts.extend([middle..part.end, part.start..middle]);
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Input;
    use crate::store::Heard;
    use crate::store::tests::event;

    /// What a store keeps that refuses some of so many records, and how often it is asked.
    fn sifted(records: &[Record], bad: &[usize]) -> (Vec<usize>, Vec<usize>, usize) {
        let (mut kept, mut left_out, mut tries) = (Vec::new(), Vec::new(), 0);
        let mut sift = Sift::new(records.len());
        while let Some(part) = sift.next() {
            tries += 1;
            if !bad.iter().any(|place| part.contains(place)) {
                kept.extend(part);
            } else if sift.refused(part.clone(), records) {
                left_out.push(part.start);
            }
        }
        (kept, left_out, tries)
    }

    fn events(count: u64) -> Vec<Record> {
        (0..count).map(|seq| Record::Event(event(seq, "r1 joined"))).collect()
    }

    #[test]
    fn one_bad_record_among_thousands_is_found_with_two_tries_for_each_halving() {
        for bad in [0, 1, 1_234, 4_095] {
            let (kept, left_out, tries) = sifted(&events(4_096), &[bad]);
            assert!(kept.iter().copied().eq((0..4_096).filter(|place| *place != bad)), "all others, in order");
            assert_eq!(left_out, [bad]);
            assert!(tries <= 2 * 12 + 1, "{tries}");
        }
        assert_eq!(sifted(&[], &[]), (Vec::new(), Vec::new(), 0));
        assert_eq!(sifted(&events(5), &[]), ((0..5).collect(), Vec::new(), 1));
        assert_eq!(sifted(&events(3), &[0, 1, 2]), (Vec::new(), vec![0, 1, 2], 5));
    }

    #[test]
    fn a_batch_is_divided_before_a_line_of_what_was_heard() {
        let line = |number| Record::Heard(Heard::of((1, number), event(number, "").at, Input::Tick, &[]));
        let mut records = vec![line(1)];
        records.extend(events(3));
        records.push(line(2));
        records.extend(events(7));
        let mut sift = Sift::new(records.len());
        let whole = sift.next().unwrap();
        assert!(!sift.refused(whole, &records));
        assert_eq!((sift.next(), sift.next(), sift.next()), (Some(0..4), Some(4..12), None));
    }
}
