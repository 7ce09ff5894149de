//! A robot's ways sorted by how long they hold their place, so that a station answers for all starts of 64 ticks at once.

use crate::problem::Tick;
use crate::way::{Mode, NEVER, Way};

/// All ways of a robot.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Starts {
    words: usize,
    at: Vec<At>,
    groups: Vec<Group>,
    /// For each group and each 64 ticks the starts that there are, and where in `ways` the first of them stands.
    masks: Vec<(u64, u32)>,
    /// Cost and place of each way.
    ways: Vec<(i32, u32)>,
}

/// The ways of a robot at one station and of one kind.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct At {
    pub(crate) station: u16,
    /// Charges, or else exchanges.
    pub(crate) charges: bool,
    /// The kind of spares that it takes; 0 for charges.
    pub(crate) spares: u16,
    first: usize,
    /// Where those begin whose spares do not come back.
    kept: usize,
    end: usize,
    /// The cost of the cheapest.
    pub(crate) least: i32,
    /// For each 64 ticks the starts of all groups.
    any: Vec<u64>,
}

/// Ways that hold what they hold longest for equally long: a charge its bay, an exchange its spare.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Group {
    /// So long; [`NEVER`] where a spare does not come back.
    pub(crate) ticks: u16,
    /// The cost of the cheapest.
    least: i32,
    masks: usize,
}

impl Starts {
    pub(crate) fn new(ways: &[Way], horizon: Tick) -> Self {
        let words = (horizon as usize).div_ceil(64);
        let mut made = Self { words, at: Vec::new(), groups: Vec::new(), masks: Vec::new(), ways: Vec::with_capacity(ways.len()) };
        let held = |way: &Way| match way.mode {
            Mode::Charge(_) => way.end - way.start,
            _ if Tick::from(way.ready) < horizon => way.ready - way.start,
            _ => NEVER,
        };
        let key = |way: &Way| (way.station, !matches!(way.mode, Mode::Charge(_)), held(way), way.mode);
        let mut sorted: Vec<_> = ways.iter().zip(0..).map(|(way, place)| (key(way), way.start, place)).collect();
        sorted.sort_unstable();
        let mut last = None;
        for (key, start, place) in sorted {
            let (station, exchanges, ticks, _) = key;
            if last != Some(key) {
                if made.at.last().is_none_or(|at| (at.station, at.charges) != (station, !exchanges)) {
                    let first = made.groups.len();
                    let spares = ways[place as usize].spares;
                    let any = vec![0; words];
                    made.at.push(At { station, charges: !exchanges, spares, first, kept: first, end: first, least: i32::MAX, any });
                }
                made.groups.push(Group { ticks, least: i32::MAX, masks: made.masks.len() });
                made.masks.resize(made.masks.len() + words, (0, 0));
                last = Some(key);
            }
            let (word, bit) = (usize::from(start) / 64, 1 << (start % 64));
            let masks = made.masks.len() - words;
            let (mask, first) = &mut made.masks[masks + word];
            if *mask == 0 {
                *first = made.ways.len() as u32;
            }
            *mask |= bit;
            made.ways.push((ways[place as usize].cost, place));
            if let (Some(at), Some(group)) = (made.at.last_mut(), made.groups.last_mut()) {
                let cost = ways[place as usize].cost;
                (at.least, group.least) = (at.least.min(cost), group.least.min(cost));
                at.any[word] |= bit;
                at.end = made.groups.len();
                if ticks != NEVER {
                    at.kept = at.end;
                }
            }
        }
        made.at.sort_by_key(|at| at.least);
        made
    }

    /// By station and kind, those with the cheapest way first.
    pub(crate) fn at(&self) -> impl Iterator<Item = &At> {
        self.at.iter()
    }

    /// The groups there in which some way costs no more than this, the shortest first.
    pub(crate) fn groups(&self, at: &At, limit: i64) -> impl Iterator<Item = &Group> {
        self.groups[at.first..at.kept].iter().filter(move |group| i64::from(group.least) <= limit)
    }

    /// The same where no spare comes back.
    pub(crate) fn kept(&self, at: &At, limit: i64) -> impl Iterator<Item = &Group> {
        self.groups[at.kept..at.end].iter().filter(move |group| i64::from(group.least) <= limit)
    }

    /// Tells those of a group's ways whose starts are among these of a word and that cost no more than this.
    #[inline]
    pub(crate) fn tell(&self, group: &Group, word: usize, free: u64, limit: i64, tell: &mut impl FnMut(u32)) {
        let (mask, first) = self.masks[group.masks + word];
        let mut found = mask & free;
        while found != 0 {
            let before = mask & ((found & found.wrapping_neg()) - 1);
            let (cost, way) = self.ways[first as usize + before.count_ones() as usize];
            if i64::from(cost) <= limit {
                tell(way);
            }
            found &= found - 1;
        }
    }
}

impl At {
    /// The starts of all groups in each 64 ticks.
    pub(crate) fn any(&self) -> &[u64] {
        &self.any
    }
}
