//! What the coordinator believes of robots and stations: the newest word of each.
//!
//! Who has spoken and is not there to be heard any more goes through two states:
//!
//! - **Lost**, from the moment on at which its liveliness token is gone ([`Robot::is_lost`], [`Station::is_lost`]). It is sent nowhere,
//!   and planned for as before: most are back in a moment. This is what `lost` means in the API, the metrics, the journal's events and
//!   WIRE.md.
//! - **Written off**, once that has lasted and nobody waits for it any longer ([`Robot::written_off`], [`Station::written_off`]): nothing
//!   is planned for it. Outside the program this shows in its place in the schedule, among the unserved and with when it was lost.
//!
//! Its next word, or its token, ends both.

use std::collections::{BTreeMap, BTreeSet};

use energy::Estimate;
use proto::{
    BayId, BayPhase, BayState, Gauge, PackId, RobotId, RobotPhase, RobotState, SpareId, StationId, StationState, Timestamp, newer,
};

/// What is believed of a robot.
#[derive(Debug, Clone, Default)]
pub struct Robot {
    /// Its last gauge message.
    pub gauge: Option<Gauge>,
    /// Its last state message.
    pub state: Option<RobotState>,
    /// When it first said, by its own clock, that it does what it does.
    pub phase_since: Timestamp,
    /// Since when it is lost.
    pub lost_since: Option<Timestamp>,
    /// Whether it is written off.
    pub written_off: bool,
    /// Whether it was lost since its last gauge message, and since its last state: see [`is_news`].
    pub is_anew: [bool; 2],
}

/// Whether a message is to be heard: it is newer than the one that is known, or its sender was lost since that one. Who was lost may have
/// been started anew with another clock, and is not to be deaf until that has caught up; what was on its way when it was lost is long here.
#[must_use]
pub fn is_news(now: Timestamp, said: (Timestamp, u64), known: Option<(Timestamp, u64)>, is_anew: bool) -> bool {
    is_anew && known != Some(said) || newer(now, said, known)
}

/// Who is lost for longer is written off, s: an agent that is restarted is back within seconds, and so is everybody after a pause of the
/// coordinator's own. A guess.
pub const WRITTEN_OFF_S: f64 = 30.0;
/// A station that is lost for so long is written off, s, also where nobody would have to leave for it yet. A guess: a machine has started
/// anew by then.
pub const STATION_WRITTEN_OFF_S: f64 = 300.0;

impl Robot {
    /// Takes in a state message that is newer than the one before.
    pub fn says(&mut self, state: RobotState) {
        // A clock that was set back makes no moment of the future of the past.
        let since = if self.phase() == Some(state.phase) { self.phase_since.min(state.at) } else { state.at };
        (self.phase_since, self.state) = (since, Some(state));
    }

    /// Whether its last gauge message is of what it does now, not of what it did before.
    #[must_use]
    pub fn is_gauged_since(&self) -> bool {
        self.gauge.as_ref().is_some_and(|gauge| gauge.at >= self.phase_since)
    }

    /// What it is doing, once it has said so.
    #[must_use]
    pub fn phase(&self) -> Option<RobotPhase> {
        self.state.as_ref().map(|state| state.phase)
    }

    /// Power out of its battery by its last word, W; 0 where a station feeds it.
    #[must_use]
    pub fn drawn_w(&self) -> f64 {
        let draws = |state: &&RobotState| matches!(state.phase, RobotPhase::Working | RobotPhase::Travelling | RobotPhase::Waiting);
        self.state.as_ref().filter(draws).map_or(0.0, |state| state.drain_w.value)
    }

    /// Whether it is lost.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.lost_since.is_some()
    }

    /// Gauge and state of a robot that can be planned for.
    #[must_use]
    pub fn known(&self) -> Option<(&Gauge, &RobotState)> {
        if self.written_off { None } else { Some((self.gauge.as_ref()?, self.state.as_ref()?)) }
    }

    /// The same of one that is there to be heard.
    #[must_use]
    pub fn heard(&self) -> Option<(&Gauge, &RobotState)> {
        if self.is_lost() { None } else { self.known() }
    }
}

/// What is believed of a station.
#[derive(Debug, Clone, Default)]
pub struct Station {
    /// Its last state message.
    pub state: Option<StationState>,
    /// The last gauge message of each pack; of one that was brought back since, with the charge that its station expected it with.
    pub packs: BTreeMap<PackId, Gauge>,
    /// How warm it is there, °C, as plans count with it; none before a pack has spoken.
    ///
    /// Nothing measures the air. Work only warms packs, so the coolest one comes nearest to it. One reading is noisy, so an average of it
    /// is kept; and plans see that average only when it has moved by a degree, so that promises do not come and go with its tenths.
    pub surroundings_degc: Option<f64>,
    /// That average, °C.
    average_degc: Option<f64>,
    /// The pack that fed it before the present one, and until when.
    pub relieved: Option<(PackId, Timestamp)>,
    /// Packs that robots left and that are not charged yet, by the spare whose place they took.
    pub left: BTreeMap<SpareId, LeftPack>,
    /// Since when it is lost.
    pub lost_since: Option<Timestamp>,
    /// Whether it is written off.
    pub written_off: bool,
    /// Whether it was lost since its last state: see [`is_news`].
    pub is_anew: bool,
    /// Packs whose gauges have not been heard since it was lost, likewise.
    pub packs_anew: BTreeSet<PackId>,
}

/// A pack that a robot left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftPack {
    /// Since when it is known to stand there.
    pub since: Timestamp,
    /// What its robot's gauge said of it before; none of a pack whose robot is not known.
    pub soc: Option<Estimate>,
}

impl LeftPack {
    /// The better known of what the station says of its charge and of what its robot said.
    #[must_use]
    pub fn soc(&self, station: Estimate) -> Estimate {
        self.soc.filter(|robot| robot.sigma < station.sigma).unwrap_or(station)
    }
}

/// Time constant of the average of a station's temperature, s: the noise of a thermometer goes, and the weather stays.
const SURROUNDINGS_TAU_S: f64 = 600.0;
/// How far that average moves before it is counted with anew, K: whether spares are charged again at all may hang on a tenth of a degree, and
/// what was promised of them must not come and go with it.
const SURROUNDINGS_MOVE_K: f64 = 1.0;

impl Station {
    /// Takes in what the gauge of a pack says.
    pub fn gauged(&mut self, pack: PackId, gauge: Gauge) {
        let (at, before) = (gauge.at, self.packs.values().map(|known| known.at).max());
        let own_degc = gauge.temperature_degc;
        let is_new = self.packs.insert(pack, gauge).is_none();
        // One that has left was as cool as it is here then.
        let away = |pack: &PackId| {
            self.state.as_ref().is_some_and(|state| state.packs.iter().any(|known| known.pack == *pack && !known.connected))
        };
        let here = self.packs.iter().filter(|(pack, _)| !away(pack)).map(|(_, known)| known.temperature_degc);
        let coolest_degc = here.reduce(f64::min).unwrap_or(own_degc);
        let average_degc = match (self.average_degc, before) {
            (Some(was_degc), Some(before)) if !is_new => {
                let passed_s = at.seconds_since(before).clamp(0.0, SURROUNDINGS_TAU_S);
                was_degc + (coolest_degc - was_degc) * passed_s / SURROUNDINGS_TAU_S
            }
            _ => coolest_degc,
        };
        self.average_degc = Some(average_degc);
        let moved = |counted_degc: &f64| (average_degc - counted_degc).abs() >= SURROUNDINGS_MOVE_K;
        if is_new || self.surroundings_degc.as_ref().is_none_or(moved) {
            self.surroundings_degc = Some(average_degc);
        }
    }

    /// Takes in that packs which were away are in their places again: what their gauges said before holds no longer.
    pub fn is_brought(&mut self, before: &StationState, state: &StationState) {
        for was in before.packs.iter().filter(|was| !was.connected) {
            let is_there = state.packs.iter().any(|pack| pack.pack == was.pack && pack.connected);
            let Some((back, gauge)) = was.back.filter(|_| is_there).zip(self.packs.get_mut(&was.pack)) else { continue };
            if gauge.at < state.at {
                let (soc, full_wh) = (back.soc, gauge.full_wh.value);
                (gauge.soc, gauge.remaining_wh) = (soc, proto::Estimate::new(soc.value * full_wh, soc.sigma * full_wh));
                (gauge.time_to_empty_s, gauge.time_to_full_s) = (None, None);
                // It may be another one.
                (gauge.soh, gauge.cycles) = (proto::Estimate::new(1.0, 0.0), None);
            }
        }
    }

    /// What a station says, with the times that it expects on the coordinator's clock, and absences one after the other; its own clock is ahead by
    /// so much, s.
    #[must_use]
    pub fn on_own_clock(mut state: StationState, ahead_s: f64) -> StationState {
        let times = state.arrives.iter_mut().chain(state.packs.iter_mut().filter_map(|pack| Some(&mut pack.back.as_mut()?.at)));
        let away = state.away.iter_mut().flat_map(|away| std::iter::once(&mut away.leaves).chain(&mut away.returns));
        times.chain(away).for_each(|at| *at = at.plus_s(-ahead_s));
        state.away.sort_by_key(|away| away.leaves);
        state
    }

    /// Whether it is lost.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.lost_since.is_some()
    }

    /// Power out of one of its packs by its last word, W.
    #[must_use]
    pub fn drawn_w(&self, pack: &PackId) -> f64 {
        let feeds = |state: &&StationState| state.powered && state.active_pack.as_ref() == Some(pack);
        self.state.as_ref().filter(feeds).map_or(0.0, |state| state.pack_power_w)
    }

    /// State of one bay.
    #[must_use]
    pub fn bay(&self, bay: &BayId) -> Option<&BayState> {
        self.state.as_ref()?.bays.iter().find(|known| known.bay == *bay)
    }

    /// Phase of one bay.
    #[must_use]
    pub fn bay_phase(&self, bay: &BayId) -> Option<BayPhase> {
        self.bay(bay).map(|bay| bay.phase)
    }

    /// The state, once every pack that is in its place has spoken too.
    #[must_use]
    pub fn known(&self) -> Option<&StationState> {
        let state = self.state.as_ref()?;
        (self.unheard(state).next().is_none() && !self.written_off).then_some(state)
    }

    /// The same of one that is there to be heard.
    #[must_use]
    pub fn heard(&self) -> Option<&StationState> {
        if self.is_lost() { None } else { self.known() }
    }

    /// Packs that are in their places and have not spoken yet.
    fn unheard<'s>(&'s self, state: &'s StationState) -> impl Iterator<Item = &'s PackId> {
        let there = state.packs.iter().filter(|pack| pack.connected).map(|pack| &pack.pack);
        there.filter(|pack| !self.packs.contains_key(*pack))
    }

    /// Why it is not known.
    #[must_use]
    pub fn why_unknown(&self) -> String {
        let Some(state) = &self.state else { return "it has not been heard".to_owned() };
        if self.written_off {
            return "it was lost: nothing has been heard of it since".to_owned();
        }
        let unheard: Vec<&str> = self.unheard(state).map(AsRef::as_ref).collect();
        format!("the gauge of {} has not been heard", unheard.join(", "))
    }
}

/// All robots and stations.
#[derive(Debug, Clone, Default)]
pub struct Fleet {
    /// Robots by id.
    pub robots: BTreeMap<RobotId, Robot>,
    /// Stations by id.
    pub stations: BTreeMap<StationId, Station>,
}

impl Fleet {
    /// That a robot is not known, with the nearest that is.
    #[must_use]
    pub fn unknown(&self, robot: &RobotId) -> String {
        let known = || self.robots.keys().map(AsRef::as_ref);
        let hint = energy::document::hint(robot.as_ref(), known());
        format!("robot {robot} is not known{hint} Known: {}", known().collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use proto::Estimate as Told;

    use super::*;

    #[test]
    fn a_stations_temperature_is_that_of_its_coolest_pack_on_average() {
        let mut station = Station::default();
        let gauge = |at_s: i64, temperature_degc: f64| {
            let nothing = Told::new(0.0, 0.0);
            Gauge {
                at: Timestamp::from_unix_ms(at_s * 1000),
                seq: at_s as u64,
                soc: nothing,
                remaining_wh: nothing,
                full_wh: nothing,
                time_to_empty_s: None,
                time_to_full_s: None,
                soh: nothing,
                cycles: None,
                voltage_v: 11.1,
                current_a: 0.0,
                temperature_degc,
                power_w: 0.0,
                cells_series: 3,
                source: "test".to_owned(),
            }
        };
        let mut says = |name: &str, at_s: i64, temperature_degc: f64| {
            station.gauged(PackId::new(name).unwrap(), gauge(at_s, temperature_degc));
            station.surroundings_degc.unwrap()
        };
        assert_eq!(says("warm", 0, 9.0), 9.0);
        assert_eq!(says("cool", 1, 1.0), 1.0, "a pack that nobody knew counts at once");
        assert_eq!(says("warm", 2, 20.0), 1.0);
        // Noise of 1 K in one reading a minute later is a tenth of that on average, and that is not counted.
        assert_eq!(says("cool", 62, 2.0), 1.0);
        // Ten minutes later it has all of a change.
        assert!((says("cool", 762, 5.0) - 5.0).abs() < 1e-9);
        assert_eq!(says("cool", 1462, 4.1), 5.0, "less than a degree");
        assert!((says("cool", 2162, 4.0) - 4.0).abs() < 1e-9, "that together is one");
        // It is taken away, and what it was like at dawn is not what it is like here any longer.
        let is = |name: &str, connected| proto::PackState { pack: PackId::new(name).unwrap(), connected, depleted: false, back: None };
        let packs = vec![is("warm", true), is("cool", false)];
        station.state = Some(serde_json::from_value(serde_json::json!({
            "at": Timestamp::from_unix_ms(0), "seq": 1, "bays": [], "lift_busy": false, "packs": packs, "powered": true, "pack_power_w": 6.0, "spares": []
        })).unwrap());
        station.gauged(PackId::new("warm").unwrap(), gauge(2862, 21.0));
        assert!((station.surroundings_degc.unwrap() - 21.0).abs() < 1e-9);
    }
}
