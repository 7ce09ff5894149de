//! One planning problem: what is known at tick 0, immutable.
//!
//! Time is counted in ticks; tick t is the interval [t, t+1). Energy is in whole units of which
//! [`Problem::units_per_wh`] make a Wh (1,000 in `mds-inst-1`: mWh), draws and gains in units per
//! tick. All numbers are whole, so that a plan can be judged without rounding. Only the
//! [`Chance`] that packs hold what was promised is a matter of normal distributions.

mod chance;

use std::ops::Range;

pub use chance::Chance;

/// Ticks since the planning began.
pub type Tick = u32;

/// Everything a plan is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// What people call it.
    pub name: String,
    /// Length of a tick, s.
    pub tick_s: u32,
    /// Units of energy in a Wh.
    pub units_per_wh: i64,
    /// Services lie in the ticks `0..horizon`.
    pub horizon: Tick,
    /// Index of the level in [`Battery::targets`] to which the question of capacity charges.
    pub capacity_target: usize,
    /// Kinds of robots' packs.
    pub batteries: Vec<Battery>,
    /// Where robots are serviced.
    pub stations: Vec<Station>,
    /// Who may be serviced.
    pub robots: Vec<Robot>,
}

/// A kind of robots' packs, and how it takes charge.
#[derive(Debug, Clone, PartialEq)]
pub struct Battery {
    /// What it holds.
    pub capacity: i64,
    /// What a robot must never go below.
    pub floor: i64,
    /// What a service must add at least.
    pub min_gain: i64,
    /// Levels at which a charge may end, ascending.
    pub targets: Vec<i64>,
    /// How stations charge it; [`Station::charger`] is an index of this.
    pub chargers: Vec<Charger>,
}

/// How a station charges a kind of pack.
#[derive(Debug, Clone, PartialEq)]
pub struct Charger {
    /// What a charged spare of the station holds.
    pub swap_energy: i64,
    /// What a pack that a robot left holds when it has been charged and is a spare, at least `swap_energy`.
    pub again_energy: i64,
    /// The taper: the first segment above the stored energy holds.
    pub curve: Vec<Segment>,
    /// Ticks of work that a robot owes which is let go at each of [`Battery::targets`], because it comes again so much
    /// sooner than from the highest; they count as missed. Empty where nothing is owed.
    pub owed: Vec<Tick>,
}

/// A stretch of the charge curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// Holds while less than this is stored.
    pub below: i64,
    /// What is stored in a tick while the robot is in the bay.
    pub gain: i64,
    /// What is stored in a tick of a pack alone.
    pub gain_bare: i64,
    /// What the station's packs give in a tick while the robot is powered.
    pub draw: i64,
    /// The same for a pack alone.
    pub draw_bare: i64,
}

/// A docking station.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// What people call it.
    pub name: String,
    /// How it charges: index of [`Battery::chargers`].
    pub charger: usize,
    /// First tick in which it takes robots in: a station that moves is on its way until then.
    pub opens: Tick,
    /// The ticks in which it is away once more, a station that moves: no service overlaps them. Empty where it stays.
    pub away: Vec<Range<Tick>>,
    /// By how much those of robots whose promise is only held to ([`Robot::held`]) may, ticks: their begin is earlier by as much than it will be.
    pub away_slack: Tick,
    /// Places to charge.
    pub bays: u32,
    /// Lift movements at once.
    pub lift_slots: i64,
    /// Exchanges of packs at once.
    pub swap_slots: i64,
    /// What it draws for itself, per tick.
    pub hotel: i64,
    /// What it may draw in all, per tick.
    pub p_max: i64,
    /// What is lost when a pack takes over.
    pub switch_cost: i64,
    /// Time that the lift takes to bring a robot in, ticks.
    pub load_ticks: Tick,
    /// Draw meanwhile, per tick.
    pub load_draw: i64,
    /// Time that the lift takes to let a robot out, ticks.
    pub unload_ticks: Tick,
    /// Draw meanwhile, per tick.
    pub unload_draw: i64,
    /// Time that an exchange takes, ticks.
    pub swap_ticks: Tick,
    /// Draw meanwhile, per tick.
    pub swap_draw: i64,
    /// Charged spares.
    pub spares: Vec<Spare>,
    /// What becomes of packs that robots leave.
    pub left_packs: LeftPacks,
    /// Packs that feed it, one at a time.
    pub packs: Vec<Pack>,
    /// Services that had begun at tick 0.
    pub ongoing: Vec<Ongoing>,
    /// How certain it must be that the packs hold what is promised; none when everything is known
    /// for certain, and then the station must be fed to the horizon.
    pub chance: Option<Chance>,
}

/// A charged spare.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spare {
    /// Tick from which it can be handed out.
    pub ready: Tick,
    /// Its kind among those of its station, from 0 on: it goes into robots that take this kind ([`Travel::spares`]), and what one of
    /// them leaves for it is of this kind.
    pub kind: u16,
}

/// What becomes of a pack that a robot leaves in an exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeftPacks {
    /// It is charged and becomes a spare, or not, as the plan says.
    AsPlanned,
    /// It is put aside.
    PutAside,
    /// It is charged and becomes a spare.
    Charged,
}

/// A pack of a station.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pack {
    /// What people call it.
    pub name: String,
    /// What it holds.
    pub remaining: i64,
    /// What must stay in it.
    pub reserve: i64,
    /// Tick from which it can be used: later while it is at the depot.
    pub available_from: i64,
}

impl Pack {
    /// What it can give; below zero when it holds less than its reserve.
    #[must_use]
    pub fn usable(&self) -> i64 {
        self.remaining - self.reserve
    }
}

/// A service that had begun at tick 0: it is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ongoing {
    /// Its bay; none for an exchange.
    pub bay: Option<u32>,
    /// The tick in which it begins, 0 when it has; a bay is held for it until then.
    pub from: Tick,
    /// The tick in which the place is free again.
    pub until: Tick,
    /// Draw until then, per tick.
    pub draw: i64,
    /// The lift is taken in its first ticks, this many.
    pub load_ticks: Tick,
    /// The lift is taken in the last ticks, this many.
    pub unload_ticks: Tick,
}

/// A robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// What people call it.
    pub name: String,
    /// Index of its kind of pack.
    pub battery: usize,
    /// What is stored in its pack.
    pub energy: i64,
    /// Expected consumption outside services, per tick.
    pub drain: i64,
    /// The same with the caution that promises need, per tick; at least `drain` and 1.
    pub drain_hi: i64,
    /// The same after a service: what is uncertain of the charge of now no longer counts.
    pub drain_served: i64,
    /// The tick in which its work ends; may lie beyond the horizon.
    pub mission_end: i64,
    /// Worth of a tick of work.
    pub weight: i64,
    /// Work that is worth more.
    pub critical: Option<Critical>,
    /// No service begins before this tick.
    pub not_before: Tick,
    /// The tick in which a service is wanted, if that matters: every tick between then and its beginning counts
    /// as missed, be it earlier or later.
    pub wanted: Option<Tick>,
    /// Whether an earlier plan promised it a service: then less certainty is asked for.
    pub held: bool,
    /// Index of the lowest of [`Battery::targets`] at which a charge of it may end.
    pub lowest_target: usize,
    /// Stations in reach.
    pub travel: Vec<Travel>,
    /// Those where it could only be after the horizon: nothing is planned there, but packs could serve it ([`crate::capacity()`]).
    pub beyond: Vec<Travel>,
}

/// Work in the ticks `from..to` that is worth more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Critical {
    /// First tick.
    pub from: i64,
    /// The tick after the last.
    pub to: i64,
    /// Worth of each tick, beside the robot's weight.
    pub weight: i64,
}

/// A station in reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Travel {
    /// Index of the station.
    pub station: usize,
    /// Time to get there, and back, ticks.
    pub ticks: Tick,
    /// What the way takes beyond as many ticks of work, there and as much once more back; below zero where it takes less.
    pub extra: i64,
    /// The same on the way there with the caution that promises need.
    pub extra_hi: i64,
    /// Variance of what a charge there takes that is this robot's own, units².
    pub variance: f64,
    /// The kind of spares there that goes into it; none where no spare does.
    pub spares: Option<u16>,
}

impl Station {
    /// How many kinds of spares it has.
    #[must_use]
    pub fn kinds_of_spares(&self) -> usize {
        self.spares.iter().map(|spare| usize::from(spare.kind) + 1).max().unwrap_or(0)
    }

    /// Whether it is not away once more in any of the ticks `start..end`, by the clock of a robot whose promise is only held to or of another.
    #[must_use]
    pub fn is_there(&self, start: Tick, end: Tick, held: bool) -> bool {
        let slack = if held { self.away_slack } else { 0 };
        self.away.iter().all(|away| end <= away.start.saturating_add(slack) || start >= away.end)
    }
}

impl Robot {
    /// Ticks until it is empty by the cautious estimate, if it goes on working.
    #[must_use]
    pub fn endurance(&self, floor: i64) -> i64 {
        ((self.energy - floor).div_euclid(self.drain_hi)).max(0)
    }

    /// The last tick in which a service at the end of a way can begin by the cautious estimate; below zero where it never gets there.
    #[must_use]
    pub fn last_start(&self, travel: &Travel, floor: i64) -> i64 {
        (self.energy - travel.extra_hi - floor).div_euclid(self.drain_hi)
    }

    /// What a service must add at least: half as much where it was promised. Else a robot that turns out to last a little longer
    /// would lose its place, or come so much later that the packs no longer hold for sure what it was promised.
    #[must_use]
    pub fn least_gain(&self, battery: &Battery) -> i64 {
        if self.held { battery.min_gain / 2 } else { battery.min_gain }
    }

    /// What is left in its pack at the end of a way, in the tick in which a service begins there.
    #[must_use]
    pub fn left_at(&self, travel: &Travel, start: Tick) -> i64 {
        self.energy - travel.extra - self.drain * i64::from(start)
    }

    /// Worth of the work that is missed when it works only in these ticks, given as disjoint `(from, to)`.
    #[must_use]
    pub fn missed(&self, worked: [(i64, i64); 2]) -> i64 {
        let end = self.mission_end;
        let within = |from: i64, to: i64| -> i64 { worked.iter().map(|&(a, b)| (b.min(to) - a.max(from)).max(0)).sum() };
        let critical = self.critical.map_or(0, |critical| {
            let (from, to) = (critical.from.max(0), critical.to.min(end));
            critical.weight * ((to - from).max(0) - within(from, to))
        });
        self.weight * (end - within(0, end)) + critical
    }

    /// The first tick in which a service at a station is wanted and the robot can be there.
    #[must_use]
    pub fn in_time(&self, station: usize) -> Tick {
        let away = self.travel.iter().find(|travel| travel.station == station).map_or(0, |travel| travel.ticks);
        self.wanted.unwrap_or(0).max(away)
    }

    /// Worth of the work that is missed without a service: all after the tick in which one is wanted, as if it
    /// were late for ever.
    #[must_use]
    pub fn missed_unserved(&self, floor: i64) -> i64 {
        self.missed([(0, self.endurance(floor).min(self.wanted.map_or(i64::MAX, i64::from))), (0, 0)])
    }
}

impl Problem {
    /// A robot's kind of pack.
    #[must_use]
    pub fn battery(&self, robot: usize) -> &Battery {
        &self.batteries[self.robots[robot].battery]
    }

    /// Whether there may be a spare for the robot at the end of this way.
    #[must_use]
    pub fn exchanges(&self, travel: &Travel) -> bool {
        self.stations[travel.station].spares.iter().any(|spare| travel.spares == Some(spare.kind))
    }

    /// First tick in which a service can begin at the end of this way: the robot and the station must be there.
    #[must_use]
    pub fn soonest(&self, travel: &Travel) -> Tick {
        travel.ticks.max(self.stations[travel.station].opens)
    }

    /// Ticks until a robot is empty by the cautious estimate, if it goes on working.
    #[must_use]
    pub fn endurance(&self, robot: usize) -> i64 {
        self.robots[robot].endurance(self.battery(robot).floor)
    }

    /// The last tick in which a service of a robot can begin anywhere by the cautious estimate: where it has no way, as long as it lasts.
    #[must_use]
    pub fn last_start(&self, robot: usize) -> i64 {
        let (who, floor) = (&self.robots[robot], self.battery(robot).floor);
        let last = who.travel.iter().map(|travel| who.last_start(travel, floor)).max();
        last.map_or_else(|| self.endurance(robot), |last| last.max(0))
    }

    /// Whether a robot runs empty before its work or the horizon ends when nobody services it.
    #[must_use]
    pub fn strands(&self, robot: usize) -> bool {
        self.endurance(robot) < self.robots[robot].mission_end.min(i64::from(self.horizon))
    }

    /// Energy in Wh.
    #[must_use]
    pub fn wh(&self, energy: i64) -> f64 {
        energy as f64 / self.units_per_wh as f64
    }

    /// What a station draws by itself and for what had begun, in each tick.
    #[must_use]
    pub fn base_load(&self, station: &Station) -> Vec<i64> {
        let mut load = vec![station.hotel; self.horizon as usize];
        for ongoing in &station.ongoing {
            let until = ongoing.until.min(self.horizon) as usize;
            for tick in &mut load[(ongoing.from as usize).min(until)..until] {
                *tick += ongoing.draw;
            }
        }
        load
    }
}
