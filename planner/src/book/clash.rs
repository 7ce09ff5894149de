//! Why a way does not fit.

use super::Book;
use crate::problem::Tick;
use crate::way::{Choices, Mode, NEVER, Way};

/// What a way asks for that is not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Clash {
    /// All bays are taken in this tick.
    Bay(Tick),
    /// The lift is taken in this tick.
    Lift(Tick),
    /// The place for exchanges is taken in this tick.
    Slot(Tick),
    /// No charged spare of this kind is left in this tick.
    Spare(Tick, u16),
    /// The station would draw more than it may in this tick, by so much.
    Power(Tick, i64),
    /// The packs that are there before this tick are so much short.
    Energy(Tick, i64),
}

impl Book<'_> {
    /// The first thing that a way asks for and is not there.
    #[must_use]
    pub fn clash(&self, choices: &Choices, way: &Way) -> Option<Clash> {
        let found = self.place_lacks(way).into_iter().flatten().next();
        found.or_else(|| self.draw_clash(choices, way))
    }

    /// All that a way asks for and is not there, one of a kind: added, each in full, the way would fit.
    #[must_use]
    pub fn lacks(&self, choices: &Choices, way: &Way) -> Vec<Clash> {
        let power = self.power_short(choices, way).map(|(tick, short)| Clash::Power(tick, short));
        let energy = self.energy_short(choices, way).map(|(before, short)| Clash::Energy(before, short));
        self.place_lacks(way).into_iter().flatten().chain(power).chain(energy).collect()
    }

    /// The places that a way asks for and are not there.
    fn place_lacks(&self, way: &Way) -> [Option<Clash>; 2] {
        let (start, end) = (usize::from(way.start), usize::from(way.end));
        if let Mode::Charge(_) = way.mode {
            let (load, unload) = (self.station.load_ticks as usize, self.station.unload_ticks as usize);
            let bay = self.bays.none().first(start, end);
            let lift = self.lift.none().first(start, start + load).or_else(|| self.lift.none().first(end - unload, end));
            [bay.map(|tick| Clash::Bay(tick as Tick)), lift.map(|tick| Clash::Lift(tick as Tick))]
        } else {
            let slot = self.slot.none().first(start, end);
            let spare = self.spares.none(way.spares).first(start, self.spare_back(way));
            [slot.map(|tick| Clash::Slot(tick as Tick)), spare.map(|tick| Clash::Spare(tick as Tick, way.spares))]
        }
    }

    /// In which tick a way would draw most beyond what the station may, and how much; none where it never does.
    fn power_short(&self, choices: &Choices, way: &Way) -> Option<(Tick, i64)> {
        let mut most: Option<(Tick, i64)> = None;
        choices.draws(way, self.station, self.horizon, |from, to, draw| {
            let Some((tick, room)) = (from..).zip(&self.headroom[from..to]).min_by_key(|(_, room)| **room) else { return };
            let short = draw - room;
            if short > most.map_or(0, |(_, short)| short) {
                most = Some((tick as Tick, short));
            }
        });
        most
    }

    /// The first lack of power or energy.
    pub(super) fn draw_clash(&self, choices: &Choices, way: &Way) -> Option<Clash> {
        let mut clash = None;
        choices.draws(way, self.station, self.horizon, |from, to, draw| {
            if clash.is_none() {
                let short = self.headroom[from..to].iter().position(|&room| room < draw);
                clash = short.map(|tick| Clash::Power((from + tick) as Tick, draw - self.headroom[from + tick]));
            }
        });
        if clash.is_some() {
            return clash;
        }
        let certain = self.certain_short(choices, way).find(|&(_, short)| short > 0).map(|(before, short)| Clash::Energy(before, short));
        certain.or_else(|| {
            let (before, short) = self.odds_clash(choices, way);
            (short > 0).then_some(Clash::Energy(before, short))
        })
    }

    /// Whether a robot's way is among what causes a clash.
    #[must_use]
    pub fn takes_part(&self, clash: Clash, way: &Way) -> bool {
        let (start, end) = (Tick::from(way.start), Tick::from(way.end));
        let charge = matches!(way.mode, Mode::Charge(_));
        match clash {
            Clash::Bay(tick) => charge && (start..end).contains(&tick),
            Clash::Lift(tick) => {
                let (load, unload) = (self.station.load_ticks, self.station.unload_ticks);
                charge && ((start..start + load).contains(&tick) || (end - unload..end).contains(&tick))
            }
            Clash::Slot(tick) => !charge && (start..end).contains(&tick),
            Clash::Spare(tick, kind) => !charge && way.spares == kind && (start..Tick::from(way.ready)).contains(&tick),
            Clash::Power(tick, _) => (start..if way.ready == NEVER { end } else { Tick::from(way.ready) }).contains(&tick),
            Clash::Energy(before, _) => start < before,
        }
    }
}
