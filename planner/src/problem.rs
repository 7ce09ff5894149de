//! One planning problem: what is known at tick 0, immutable.
//!
//! Time is counted in ticks; tick t is the interval [t, t+1). Energy is in mWh, draws and gains in
//! mWh per tick. All numbers are whole, so that a plan can be judged without rounding.

/// Ticks since the planning began.
pub type Tick = u32;

/// Everything a plan is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// What people call it.
    pub name: String,
    /// Length of a tick, s.
    pub tick_s: u32,
    /// Services lie in the ticks `0..horizon`.
    pub horizon: Tick,
    /// Index of the level in [`Battery::targets`] to which the question of capacity charges.
    pub capacity_target: usize,
    /// The robots' packs.
    pub battery: Battery,
    /// Where robots are serviced.
    pub stations: Vec<Station>,
    /// Who may be serviced.
    pub robots: Vec<Robot>,
}

/// A robot's pack, and how it takes charge.
#[derive(Debug, Clone, PartialEq)]
pub struct Battery {
    /// What it holds, mWh.
    pub capacity: i64,
    /// What a robot must never go below, mWh.
    pub floor: i64,
    /// What a service must add at least, mWh.
    pub min_gain: i64,
    /// Levels at which a charge may end, mWh, ascending.
    pub targets: Vec<i64>,
    /// What a charged spare holds, mWh.
    pub swap_energy: i64,
    /// The taper: the first segment above the stored energy holds.
    pub curve: Vec<Segment>,
}

/// A stretch of the charge curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// Holds while less than this is stored, mWh.
    pub below: i64,
    /// What is stored in a tick, mWh.
    pub gain: i64,
    /// What the station's packs give for it in a tick while the robot is powered, mWh.
    pub draw: i64,
    /// The same for a pack alone, mWh.
    pub draw_bare: i64,
}

/// A docking station.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// What people call it.
    pub name: String,
    /// Places to charge.
    pub bays: u32,
    /// Lift movements at once.
    pub lift_slots: i64,
    /// Exchanges of packs at once.
    pub swap_slots: i64,
    /// What it draws for itself, mWh per tick.
    pub hotel: i64,
    /// What it may draw in all, mWh per tick.
    pub p_max: i64,
    /// What is lost when a pack takes over, mWh.
    pub switch_cost: i64,
    /// Time that the lift takes to bring a robot in, ticks.
    pub load_ticks: Tick,
    /// Draw meanwhile, mWh per tick.
    pub load_draw: i64,
    /// Time that the lift takes to let a robot out, ticks.
    pub unload_ticks: Tick,
    /// Draw meanwhile, mWh per tick.
    pub unload_draw: i64,
    /// Time that an exchange takes, ticks.
    pub swap_ticks: Tick,
    /// Draw meanwhile, mWh per tick.
    pub swap_draw: i64,
    /// Ticks from which each charged spare can be handed out.
    pub spares: Vec<Tick>,
    /// Packs that feed it, one at a time.
    pub packs: Vec<Pack>,
    /// Charges that had begun at tick 0.
    pub ongoing: Vec<Ongoing>,
}

/// A pack of a station.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pack {
    /// What people call it.
    pub name: String,
    /// What it holds, mWh.
    pub remaining: i64,
    /// What must stay in it, mWh.
    pub reserve: i64,
    /// Tick from which it can be used: later while it is at the depot.
    pub available_from: i64,
}

impl Pack {
    /// What it can give, mWh; below zero when it holds less than its reserve.
    #[must_use]
    pub fn usable(&self) -> i64 {
        self.remaining - self.reserve
    }
}

/// A charge that had begun at tick 0: it is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ongoing {
    /// Its bay.
    pub bay: u32,
    /// The tick in which the bay is free again.
    pub until: Tick,
    /// Draw until then, mWh per tick.
    pub draw: i64,
    /// The lift is taken in the last ticks, this many.
    pub unload_ticks: Tick,
}

/// A robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// What people call it.
    pub name: String,
    /// What is stored in its pack, mWh.
    pub energy: i64,
    /// Expected consumption outside services, mWh per tick.
    pub drain: i64,
    /// The same with the caution that promises need, mWh per tick; at least `drain` and 1.
    pub drain_hi: i64,
    /// The tick in which its work ends; may lie beyond the horizon.
    pub mission_end: i64,
    /// Worth of a tick of work.
    pub weight: i64,
    /// Work that is worth more.
    pub critical: Option<Critical>,
    /// Stations in reach.
    pub travel: Vec<Travel>,
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Travel {
    /// Index of the station.
    pub station: usize,
    /// Time to get there, and back, ticks.
    pub ticks: Tick,
}

impl Robot {
    /// Ticks until it is empty by the cautious estimate, if it goes on working.
    #[must_use]
    pub fn endurance(&self, floor: i64) -> i64 {
        ((self.energy - floor).div_euclid(self.drain_hi)).max(0)
    }

    /// Whether it runs empty before its work or the horizon ends when nobody services it.
    #[must_use]
    pub fn strands(&self, problem: &Problem) -> bool {
        self.endurance(problem.battery.floor) < self.mission_end.min(i64::from(problem.horizon))
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

    /// Worth of the work that is missed without a service.
    #[must_use]
    pub fn missed_unserved(&self, floor: i64) -> i64 {
        self.missed([(0, self.endurance(floor)), (0, 0)])
    }
}

impl Problem {
    /// What a station draws by itself and for the charges that had begun, mWh in each tick.
    #[must_use]
    pub fn base_load(&self, station: &Station) -> Vec<i64> {
        let mut load = vec![station.hotel; self.horizon as usize];
        for ongoing in &station.ongoing {
            for tick in &mut load[..ongoing.until.min(self.horizon) as usize] {
                *tick += ongoing.draw;
            }
        }
        load
    }
}
