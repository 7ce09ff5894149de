//! Flags that refuse most ways that do not fit, by a look at a few words that lie together.

use crate::bits::{self, Bits};
use crate::way::{At, Starts};

/// Where each row of flags stands.
const BAY: usize = 0;
const BEGIN: usize = 1;
const END: usize = 2;
const SLOT: usize = 3;
/// The first of a row for each kind.
const SPARE: usize = 4;

/// Flags by tick, copied from where they are kept: no bay, slot or spare, and no lift for who begins or ends then.
#[derive(Debug, Clone)]
pub(super) struct Gates {
    words: usize,
    ticks: usize,
    flags: Vec<u64>,
    /// Ticks in the slot.
    swap_ticks: usize,
    /// Ticks on the lift before and after a charge.
    lift_ticks: [usize; 2],
}

/// What the flags are made of.
pub(super) struct Kept<'a> {
    pub(super) bays: &'a Bits,
    pub(super) lift: &'a Bits,
    pub(super) slot: &'a Bits,
}

impl Gates {
    /// All shut, with so many kinds of spares.
    pub(super) fn new(ticks: usize, lift_ticks: [usize; 2], swap_ticks: usize, kinds: usize) -> Self {
        let words = Bits::new(ticks, true).words().len();
        Self { words, ticks, flags: vec![u64::MAX; (SPARE + kinds) * words], swap_ticks, lift_ticks }
    }

    /// Copies the flags anew that an exchange between these ticks may have changed.
    pub(super) fn renew_exchanges<'a>(&mut self, kept: &Kept<'a>, spares: impl Iterator<Item = &'a Bits>, from: usize, to: usize) {
        let changed = from / 64..(to / 64 + 1).min(self.words);
        for (row, flags) in std::iter::once((SLOT, kept.slot)).chain((SPARE..).zip(spares)) {
            self.flags[row * self.words..][changed.clone()].copy_from_slice(&flags.words()[changed.clone()]);
        }
    }

    /// Copies the flags anew that a charge between these ticks may have changed.
    pub(super) fn renew_charges(&mut self, kept: &Kept<'_>, from: usize, to: usize) {
        let [load, unload] = self.lift_ticks;
        let (words, lift) = (self.words, kept.lift.words());
        let word = |at: usize| lift.get(at).copied().unwrap_or(0);
        for at in from.saturating_sub(load) / 64..((to + unload) / 64 + 1).min(words) {
            self.flags[BAY * words + at] = kept.bays.words()[at];
            // Who begins needs the lift in the next ticks, who ends in those before.
            let before = |ticks: usize| {
                let near = at.checked_sub(ticks / 64).map_or(0, word) << (ticks % 64);
                near | at.checked_sub(ticks / 64 + 1).map_or(0, word) >> 1 >> (63 - ticks % 64)
            };
            self.flags[BEGIN * words + at] = (0..load).fold(0, |flags, ticks| flags | later(lift, at, ticks));
            self.flags[END * words + at] = (1..=unload).fold(0, |flags, ticks| flags | before(ticks));
        }
    }

    /// Shuts all.
    pub(super) fn shut(&mut self) {
        self.flags.fill(u64::MAX);
    }

    /// Whether a charge between these ticks has no bay, or no lift.
    #[inline]
    pub(super) fn refuse_charge(&self, start: usize, end: usize) -> bool {
        let flag = |row: usize, tick: usize| self.flags[row * self.words + tick / 64] >> (tick % 64) & 1 != 0;
        // All three are looked at: which of them refuses cannot be foreseen, that one does can.
        flag(BEGIN, start) | flag(END, end) | bits::any(self.row(BAY), start, end)
    }

    /// Whether an exchange between these ticks has no slot, or no spare of this kind until then.
    #[inline]
    pub(super) fn refuse_exchange(&self, start: usize, end: usize, (kind, back): (u16, usize)) -> bool {
        bits::any(self.row(SLOT), start, end) | bits::any(self.row(SPARE + usize::from(kind)), start, back)
    }

    /// Tells those of a robot's ways of one kind at this station that are not refused.
    pub(super) fn tell(&self, starts: &Starts, at: &At, limit: i64, tell: &mut impl FnMut(u32)) {
        let spare = SPARE + usize::from(at.spares);
        let held = self.row(if at.charges { BAY } else { spare });
        // A spare that does not come back is there in every tick from the start on.
        let kept_from = if at.charges { 0 } else { self.all_free_from(spare) };
        for (word, &any) in at.any().iter().enumerate().filter(|(_, any)| **any != 0) {
            let mut free = any;
            if at.charges {
                free &= !self.row(BEGIN)[word];
            } else {
                (0..self.swap_ticks).for_each(|ticks| free &= !later(self.row(SLOT), word, ticks));
            }
            if free == 0 {
                continue;
            }
            let late = kept_from.saturating_sub(word * 64);
            if late < 64 && free & u64::MAX << late != 0 {
                for group in starts.kept(at, limit) {
                    starts.tell(group, word, free & u64::MAX << late, limit, tell);
                }
            }
            let mut ticks = 0;
            for group in starts.groups(at, limit) {
                while ticks < usize::from(group.ticks) && free != 0 {
                    free &= !later(held, word, ticks);
                    ticks += 1;
                }
                if free == 0 {
                    break;
                }
                let blocked = if at.charges { later(self.row(END), word, ticks) } else { 0 };
                starts.tell(group, word, free & !blocked, limit, tell);
            }
        }
    }

    /// The tick from which on a row has no flag.
    fn all_free_from(&self, row: usize) -> usize {
        let words = self.row(row).iter().enumerate().take(self.ticks.div_ceil(64));
        let within = |word: usize| if self.ticks - word * 64 < 64 { (1 << (self.ticks - word * 64)) - 1 } else { u64::MAX };
        words.rev().find_map(|(word, flags)| (flags & within(word)).checked_ilog2().map(|bit| word * 64 + bit as usize + 1)).unwrap_or(0)
    }

    #[inline]
    fn row(&self, row: usize) -> &[u64] {
        &self.flags[row * self.words..][..self.words]
    }
}

/// The flags so many ticks after those of a word.
#[inline]
fn later(row: &[u64], word: usize, ticks: usize) -> u64 {
    let (at, bit) = (word + ticks / 64, ticks % 64);
    let flags = |at: usize| row.get(at).copied().unwrap_or(u64::MAX);
    flags(at) >> bit | flags(at + 1) << 1 << (63 - bit)
}

#[cfg(test)]
mod tests {
    use crate::construct::{self, Order};
    use crate::draft::Draft;
    use crate::instance::Instance;
    use crate::way::{Mode, Ways};

    #[test]
    fn a_station_tells_the_ways_that_it_does_not_refuse_one_by_one() {
        let instance = Instance::parse(include_str!("../../tests/instances/16-2-1.json")).expect("a valid instance");
        let ways = Ways::all(&instance.problem);
        let mut draft = Draft::new(&ways);
        let order = construct::ranked(&ways, Order::Deadline);
        for robots in order.chunks(3) {
            for robot in 0..instance.problem.robots.len() {
                let choices = ways.of(robot);
                let starts = choices.starts(instance.problem.horizon);
                for limit in [i64::MAX, i64::from(choices.unserved_cost) / 2] {
                    let mut told = Vec::new();
                    for at in starts.at() {
                        draft.books[usize::from(at.station)].tell_places(starts, at, limit, &mut |way| told.push(way));
                    }
                    told.sort_unstable();
                    let has_place = |&way: &u32| {
                        let way = &choices.ways[way as usize];
                        let book = &draft.books[usize::from(way.station)];
                        let (start, end) = (usize::from(way.start), usize::from(way.end));
                        let refused = match way.mode {
                            Mode::Charge(_) => book.gates.refuse_charge(start, end),
                            _ => book.gates.refuse_exchange(start, end, (way.spares, book.spare_back(way))),
                        };
                        !refused && i64::from(way.cost) <= limit
                    };
                    assert_eq!(told, (0..choices.ways.len() as u32).filter(has_place).collect::<Vec<_>>());
                }
            }
            construct::greedy(&mut draft, robots, 0.0);
        }
    }
}
