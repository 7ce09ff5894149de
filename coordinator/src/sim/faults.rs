//! What goes wrong in a run, drawn by seed: everything is known before the run begins, so that the same
//! seed goes wrong in the same way.

use proto::Timestamp;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

use super::net::{Host, Weather};

/// Something that goes wrong.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Fault {
    /// The process is killed, and started again after a while.
    Kill {
        /// How many of the next outputs it still gets done: 0 kills it before anything is kept.
        after: u32,
        /// How long it stays away, s.
        for_s: f64,
    },
    /// Nobody reaches the host.
    Cut {
        /// How long, s.
        for_s: f64,
    },
    /// The host's clock is set.
    Clock {
        /// By how much, s.
        by_s: f64,
    },
    /// The coordinator's disk takes nothing.
    FullDisk {
        /// How long, s.
        for_s: f64,
    },
}

/// What goes wrong in a run.
#[derive(Debug, Clone)]
pub(super) struct Faults {
    /// The network, all the time.
    pub(super) weather: Weather,
    /// By how much each host's clock is wrong from the start, s.
    pub(super) skews: Vec<(Host, f64)>,
    /// When, where, what; in the order of time.
    pub(super) events: Vec<(f64, Host, Fault)>,
    /// Whether agents lose what they had kept, too: nothing promises to withstand that.
    pub(super) forgetful: bool,
    /// Chooses the messages that are lost.
    pub(super) seed: u64,
}

/// Clocks are wrong by at most this, s: as badly kept ones are, and less than a command lives.
const SKEW_S: f64 = 2.0;
/// Longest absence of a coordinator or of a link, s: longer than agents wait before they act alone.
const AWAY_S: f64 = 900.0;
/// Longest absence of an agent, s: what watches over it starts it again.
const RESTART_S: f64 = 30.0;

impl Faults {
    /// Nothing goes wrong.
    pub(super) fn none() -> Self {
        Self { weather: Weather::FAIR, skews: Vec::new(), events: Vec::new(), forgetful: false, seed: 0 }
    }

    /// Draws what goes wrong in a run of that length with those agents.
    pub(super) fn draw(seed: u64, duration_s: f64, agents: &[Host]) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let rng = &mut rng;
        let mut share = |most: f64| if rng.random_bool(0.5) { rng.random::<f64>() * most } else { 0.0 };
        let weather = Weather { loss: share(0.3), doubled: share(0.3), delay_s: share(8.0) };
        let hosts: Vec<Host> = std::iter::once(Host::Coordinator).chain(agents.iter().cloned()).collect();
        let skews = hosts.iter().map(|host| (host.clone(), rng.random_range(-SKEW_S..SKEW_S))).collect();
        let count = rng.random_range(0..12);
        let mut events: Vec<(f64, Host, Fault)> = (0..count)
            .map(|_| {
                // Half of all trouble is the coordinator's.
                let host = if rng.random_bool(0.5) { Host::Coordinator } else { hosts[rng.random_range(0..hosts.len())].clone() };
                let away_s = if host == Host::Coordinator { AWAY_S } else { RESTART_S };
                // Most absences are short.
                let for_s = |rng: &mut Pcg64Mcg, most_s: f64| 1.0 + most_s * rng.random::<f64>().powi(3);
                let fault = match rng.random_range(0..10) {
                    0..5 => Fault::Kill { after: rng.random_range(0..6), for_s: for_s(rng, away_s) },
                    5..7 => Fault::Cut { for_s: for_s(rng, AWAY_S) },
                    7..9 => Fault::Clock { by_s: rng.random_range(-SKEW_S..SKEW_S) },
                    _ if host == Host::Coordinator => Fault::FullDisk { for_s: for_s(rng, AWAY_S) },
                    _ => Fault::Kill { after: 0, for_s: for_s(rng, RESTART_S) },
                };
                // The last third is for the fleet to find its way back.
                (rng.random::<f64>() * duration_s * 2.0 / 3.0, host, fault)
            })
            .collect();
        events.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { weather, skews, events, forgetful: false, seed: rng.random() }
    }

    pub(super) fn rng(&self) -> Pcg64Mcg {
        Pcg64Mcg::seed_from_u64(self.seed)
    }

    /// One line per fault, for whoever reads why a run went wrong.
    pub(super) fn lines(&self) -> Vec<String> {
        let weather = format!("{:?}", self.weather);
        std::iter::once(weather).chain(self.events.iter().map(|(at_s, host, fault)| format!("{at_s:>8.0} s {host:?}: {fault:?}"))).collect()
    }
}

/// What a host's clock shows.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct HostClock {
    /// By how much it is ahead, s.
    pub(super) ahead_s: f64,
}

impl HostClock {
    pub(super) fn shows(self, now: Timestamp) -> Timestamp {
        now.plus_s(self.ahead_s)
    }
}
