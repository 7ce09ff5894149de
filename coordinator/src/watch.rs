//! Whether models still explain what their robots and packs measure.
//!
//! ```text
//!   battery.rs   a battery's voltage against its model     ─┐
//!   station.rs   power of a station against its model      ├─> innovations ── cusum.rs ──> doubts
//!   power.rs     power of a robot at work and on its ways  │
//!     filter.rs    what is only roughly known, learnt      ─┘          words.rs: what to run
//! ```
//!
//! Everything is fed by the messages that the coordinator hears anyway. What is kept of a watched
//! thing does not grow. While a model is doubted, forecasts that rest on it are as much less certain
//! as its innovations are too large (R. T. Birge, Physical Review 40, 1932: deviations are scaled by
//! how far residuals exceed them).

mod battery;
mod cusum;
mod filter;
mod pace;
mod power;
mod station;
mod words;

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::{Channel, Model};
use proto::{Doubt, Gauge, PackId, RobotId, RobotPhase, RobotState, StationId, StationState, Timestamp};

use self::battery::BatteryWatch;
pub(crate) use self::cusum::Change;
use self::cusum::{Cusum, Raised};
use self::power::{Judged, RobotWatch};
use self::station::StationWatch;
pub(crate) use self::words::BEFORE_COMMAND;
use crate::fleet::Fleet;
use crate::models::{Models, StationModels};

/// Most that a doubt widens a forecast: beyond it the forecast says nothing anyway.
const WIDER_MAX: f64 = 10.0;
/// After a station's state changed its messages and those of its robots disagree for a while, s.
const SETTLE_S: f64 = 5.0;

/// Whose model is watched.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Subject {
    /// A robot's battery.
    RobotBattery(RobotId),
    /// What a robot draws at work.
    RobotWork(RobotId),
    /// What a robot draws on its ways.
    RobotWay(RobotId),
    /// A station's pack.
    Pack(StationId, PackId),
    /// What a station draws from its packs.
    Station(StationId),
}

/// How a watched model stands.
#[derive(Debug, Clone)]
pub(crate) struct Standing {
    /// Whose model.
    pub(crate) subject: Subject,
    /// Its last innovation, in sigma.
    pub(crate) z: f64,
    /// Evidence against it, as a share of what raises a doubt.
    pub(crate) evidence: f64,
    /// The doubt, if there is one.
    pub(crate) doubt: Option<Doubt>,
}

/// What a message changed: whose model, and how.
pub(crate) type News = Vec<(Subject, Change)>;

/// All that is watched.
#[derive(Default)]
pub(crate) struct Watch {
    cusums: BTreeMap<Subject, Cusum>,
    batteries: BTreeMap<RobotId, BatteryWatch>,
    robots: BTreeMap<RobotId, RobotWatch>,
    packs: BTreeMap<(StationId, PackId), BatteryWatch>,
    stations: BTreeMap<StationId, StationWatch>,
    /// From when on each station's messages agree again.
    settled: BTreeMap<StationId, Timestamp>,
}

impl Watch {
    /// A robot's gauge spoke, and that is the model of its battery.
    pub(crate) fn robot_gauge(&mut self, id: &RobotId, model: Option<&Arc<Model>>, gauge: &Gauge) -> News {
        let mut news = News::new();
        let robot = self.robots.entry(id.clone()).or_default();
        let swapping = robot.swapping();
        if let Some(judged) = robot.gauge(gauge) {
            self.judged(id, judged, &mut news);
        }
        let Some(model) = model.filter(|_| !swapping) else { return news };
        match self.batteries.get_mut(id) {
            Some(watch) if Arc::ptr_eq(watch.model(), model) => {
                if let Some((begin, z)) = watch.update(gauge) {
                    self.add(Subject::RobotBattery(id.clone()), begin, z, &mut news);
                }
            }
            _ => drop(self.batteries.insert(id.clone(), BatteryWatch::new(model, gauge))),
        }
        news
    }

    /// A robot reported its state.
    pub(crate) fn robot_state(&mut self, id: &RobotId, state: &RobotState) -> News {
        let mut news = News::new();
        if state.phase == RobotPhase::Swapping {
            // What comes in is another battery.
            self.batteries.remove(id);
            self.forget(Subject::RobotBattery(id.clone()), &mut news);
        }
        if let Some(judged) = self.robots.entry(id.clone()).or_default().state(state) {
            self.judged(id, judged, &mut news);
        }
        news
    }

    /// The gauge of a station's pack spoke.
    pub(crate) fn pack_gauge(&mut self, fleet: &Fleet, models: &StationModels, id: &StationId, pack: &PackId, gauge: &Gauge) -> News {
        let mut news = News::new();
        let Some(model) = models.packs.get(pack) else { return news };
        let key = (id.clone(), pack.clone());
        match self.packs.get_mut(&key) {
            Some(watch) => {
                if let Some((begin, z)) = watch.update(gauge) {
                    self.add(Subject::Pack(id.clone(), pack.clone()), begin, z, &mut news);
                }
            }
            None => drop(self.packs.insert(key, BatteryWatch::new(model, gauge))),
        }
        self.station_power(fleet, models, id, pack, gauge, &mut news);
        news
    }

    /// A station reported its state, different from the one before.
    pub(crate) fn station_changed(&mut self, id: &StationId, before: &StationState, state: &StationState) -> News {
        let mut news = News::new();
        self.settled.insert(id.clone(), state.at.plus_s(SETTLE_S));
        for was in &before.packs {
            let Some(is) = state.packs.iter().find(|is| is.pack == was.pack) else { continue };
            if was.connected != is.connected {
                self.packs.remove(&(id.clone(), is.pack.clone()));
                self.forget(Subject::Pack(id.clone(), is.pack.clone()), &mut news);
            }
        }
        news
    }

    /// A robot is gone for good.
    pub(crate) fn robot_gone(&mut self, id: &RobotId) {
        self.robots.remove(id);
        self.batteries.remove(id);
        self.cusums.retain(
            |subject, _| !matches!(subject, Subject::RobotBattery(of) | Subject::RobotWork(of) | Subject::RobotWay(of) if of == id),
        );
    }

    /// What was watched is gone, and a doubt in it with it.
    fn forget(&mut self, subject: Subject, news: &mut News) {
        if self.cusums.remove(&subject).is_some_and(|cusum| cusum.raised().is_some()) {
            news.push((subject, Change::Gone));
        }
    }

    fn station_power(&mut self, fleet: &Fleet, models: &StationModels, id: &StationId, pack: &PackId, gauge: &Gauge, news: &mut News) {
        let Some(state) = fleet.stations.get(id).and_then(|station| station.known()) else { return };
        if state.active_pack.as_ref() != Some(pack) {
            return;
        }
        let gain_of = |model: Option<&Arc<Model>>| model.map_or(0.0, |model| model.sensor(Channel::CurrentA).gain_sigma);
        let gain_sigma = || gain_of(models.packs.get(pack));
        let watch = self.stations.entry(id.clone()).or_insert_with(|| StationWatch::new(&models.load, pack.clone(), gain_sigma()));
        watch.read_by(pack, gain_sigma);
        let settled = self.settled.get(id).is_none_or(|settled| gauge.at >= *settled);
        // What driving takes is not its load's, and how fast packs on the shelf are charged is not told.
        let drives = state.arrives.is_some();
        let shelf = models.spare_battery.is_some() && models.recharge_w <= 0.0 && state.spares.iter().any(|spare| !spare.ready);
        let holds_s = |robot: &RobotId| self.robots.get(robot).map_or(station::STALE_S, |watch| watch.silent_s(station::STALE_S));
        let robot = |id: &RobotId| {
            let (gauge, state) = fleet.robots.get(id).and_then(|robot| robot.known())?;
            Some((gauge, state.phase, holds_s(id)))
        };
        let robots_gain = |robot: &RobotId| gain_of(self.batteries.get(robot).map(BatteryWatch::model));
        let situation = station::situation(state, gauge.voltage_v, gauge.at, robot, robots_gain)
            .filter(|_| settled && state.powered && !drives && !shelf);
        let Some(situation) = situation else { return watch.interrupt() };
        if let Some(judged) = watch.update(gauge.at, gauge.voltage_v * gauge.current_a, &situation) {
            let subject = Subject::Station(id.clone());
            let change = self.cusums.entry(subject.clone()).or_default().add_at(judged.begin, judged.z, judged.power_w);
            news.extend(change.map(|change| (subject, change)));
        }
    }

    fn judged(&mut self, id: &RobotId, judged: Judged, news: &mut News) {
        match judged {
            Judged::Work(begin, z) => self.add(Subject::RobotWork(id.clone()), begin, z, news),
            Judged::Way(begin, z) => {
                let subject = Subject::RobotWay(id.clone());
                let change = self.cusums.entry(subject.clone()).or_default().add_whole(begin, z);
                news.extend(change.map(|change| (subject, change)));
            }
        }
    }

    fn add(&mut self, subject: Subject, begin: Timestamp, z: f64, news: &mut News) {
        let change = self.cusums.entry(subject.clone()).or_default().add(begin, z);
        news.extend(change.map(|change| (subject, change)));
    }

    fn raised(&self, subject: &Subject) -> Option<Raised> {
        self.cusums.get(subject).and_then(Cusum::raised)
    }

    /// By how much deviations that rest on that model are to be taken wider: 1 while it is not
    /// doubted.
    pub(crate) fn wider(&self, subject: &Subject) -> f64 {
        self.raised(subject).map_or(1.0, |raised| raised.z.abs().clamp(1.0, WIDER_MAX))
    }

    /// State of charge that a pack's voltage shows, whatever its gauge has counted; none while its model explains both.
    pub(crate) fn shown_soc(&self, station: &StationId, pack: &PackId) -> Option<f64> {
        let (station, pack) = (station.clone(), pack.clone());
        self.raised(&Subject::Pack(station.clone(), pack.clone()))?;
        self.packs.get(&(station, pack))?.shown_soc()
    }

    /// Whether any model is doubted.
    pub(crate) fn is_doubting(&self) -> bool {
        self.cusums.values().any(|cusum| cusum.raised().is_some())
    }

    /// Every doubt there is, as it goes on the wire.
    pub(crate) fn doubts(&self, now: Timestamp, fleet: &Fleet, models: &Models) -> Vec<Doubt> {
        let raised = self.cusums.iter().filter(|(_, cusum)| cusum.raised().is_some());
        raised.filter_map(|(subject, _)| self.doubt(now, subject, fleet, models)).collect()
    }

    /// How every model stands that has been judged.
    pub(crate) fn standings(&self, now: Timestamp, fleet: &Fleet, models: &Models) -> Vec<Standing> {
        let standing = |(subject, cusum): (&Subject, &Cusum)| {
            let (z, evidence) = cusum.standing();
            Standing { subject: subject.clone(), z, evidence, doubt: self.doubt(now, subject, fleet, models) }
        };
        self.cusums.iter().map(standing).collect()
    }

    /// The doubt in one model, if there is one.
    pub(crate) fn doubt(&self, now: Timestamp, subject: &Subject, fleet: &Fleet, models: &Models) -> Option<Doubt> {
        Some(words::doubt(now, subject, self.raised(subject)?, fleet, models))
    }
}

impl Subject {
    /// Robot, station and pack, as far as they are concerned.
    pub(crate) fn ids(&self) -> (Option<&RobotId>, Option<&StationId>, Option<&PackId>) {
        match self {
            Subject::RobotBattery(id) | Subject::RobotWork(id) | Subject::RobotWay(id) => (Some(id), None, None),
            Subject::Pack(id, pack) => (None, Some(id), Some(pack)),
            Subject::Station(id) => (None, Some(id), None),
        }
    }
}

impl std::fmt::Display for Subject {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Subject::RobotBattery(id) => write!(f, "the battery model of {id}"),
            Subject::RobotWork(id) => write!(f, "the load model of {id} at work"),
            Subject::RobotWay(id) => write!(f, "the load model of {id} on its ways"),
            Subject::Pack(id, pack) => write!(f, "the model of {pack} of {id}"),
            Subject::Station(id) => write!(f, "the load model of {id}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::Kept;

    #[test]
    fn a_doubt_says_since_when_and_what_to_run_and_widens_forecasts_while_it_lasts() {
        let robot: RobotId = "explorer-2".parse().unwrap();
        let mut models = Models { kept: Kept::Store("site.db".to_owned()), ..Models::default() };
        let battery = Arc::new(energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap());
        models.robots.insert(robot.clone(), battery);
        let begin: Timestamp = "2026-01-01T14:05:00Z".parse().unwrap();
        let (mut watch, subject, mut news) = (Watch::default(), Subject::RobotBattery(robot), News::new());
        let fleet = Fleet::default();
        watch.add(subject.clone(), begin, 6.1, &mut news);
        assert_eq!((news.len(), watch.wider(&subject)), (0, 1.0));
        watch.add(subject.clone(), begin.plus_s(60.0), 6.1, &mut news);
        assert_eq!(news, [(subject.clone(), Change::Raised)]);
        let [doubt] = &watch.doubts(begin.plus_s(60.0), &fleet, &models)[..] else { panic!("one doubt") };
        assert_eq!(
            doubt.text,
            "the battery model of explorer-2 no longer explains its data since 14:05 (residual z = 6.1): run `lab discover --model \
             explorer-3s1p-1320mah --store site.db --robot explorer-2 --from 2026-01-01T14:05:00.000Z`"
        );
        let days_later = &watch.doubts(begin.plus_s(2.0 * 86_400.0), &fleet, &models)[0].text;
        assert!(days_later.contains("since 2026-01-01 14:05 (res"), "{days_later}");
        assert!((watch.wider(&subject) - 6.1).abs() < 1e-12);
        (2..20).for_each(|minute| watch.add(subject.clone(), begin.plus_s(60.0 * f64::from(minute)), 0.0, &mut news));
        assert_eq!(news.last(), Some(&(subject.clone(), Change::Cleared)));
        assert_eq!((watch.wider(&subject), watch.doubts(begin.plus_s(60.0), &fleet, &models).len()), (1.0, 0));
    }
}
