//! What a coordinator has shown so far: how charge went, which services ended, what happened.
//!
//! Memory is bounded: when a series is full, every second point of it goes and its period doubles,
//! until it spans a day; from then on the oldest go.

use std::collections::{BTreeMap, VecDeque};

use energy::units::S_PER_DAY;
use proto::{Estimate, Event, EventKind, PackId, RobotId, Schedule, Service, ServiceStatus, StationId, Timestamp};
use serde::Serialize;

use crate::core::Core;

/// Events that are kept.
const EVENTS_MAX: usize = 500;
/// Services that have ended and are kept.
const SERVICES_MAX: usize = 2_000;
/// Points of a series.
const POINTS_MAX: usize = 720;
/// First period of a series, s.
const PERIOD_S: f64 = 5.0;
/// A full series spans at least this, s.
const SPAN_S: f64 = S_PER_DAY;

/// A quantity over time: columns of equal length, as charts take them.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Series {
    /// Instants, Unix seconds.
    pub time_s: VecDeque<f64>,
    /// Values.
    pub value: VecDeque<f64>,
    /// Their standard deviations.
    pub sigma: VecDeque<f64>,
}

impl Series {
    fn push(&mut self, at: Timestamp, estimate: Estimate) {
        self.time_s.push_back(at.unix_ms() as f64 / 1000.0);
        self.value.push_back(estimate.value);
        self.sigma.push_back(estimate.sigma);
    }

    fn columns(&mut self) -> [&mut VecDeque<f64>; 3] {
        [&mut self.time_s, &mut self.value, &mut self.sigma]
    }

    /// Lets go of the oldest: what is from before `from_s` (Unix seconds), and what is too much.
    fn shorten(&mut self, from_s: f64) {
        let old = self.time_s.iter().take_while(|time_s| **time_s <= from_s).count().max(self.time_s.len().saturating_sub(POINTS_MAX));
        self.columns().into_iter().for_each(|column| drop(column.drain(..old)));
    }

    fn thin(&mut self) {
        for column in self.columns() {
            let mut keep = false;
            column.retain(|_| {
                keep = !keep;
                keep
            });
        }
    }
}

/// The past of one coordinator.
#[derive(Debug, Clone)]
pub struct Past {
    /// Events, oldest first.
    pub events: VecDeque<Event>,
    /// How many events of each kind there were.
    pub counts: BTreeMap<EventKind, u64>,
    /// Services that have ended, with the instant at which they did.
    pub services: VecDeque<Service>,
    /// State of charge of each robot, a fraction.
    pub robots: BTreeMap<RobotId, Series>,
    /// Energy left in each pack, Wh.
    pub packs: BTreeMap<(StationId, PackId), Series>,
    running: BTreeMap<RobotId, Service>,
    sampled: Option<Timestamp>,
    period_s: f64,
    points: usize,
}

impl Default for Past {
    fn default() -> Self {
        Self {
            events: VecDeque::new(),
            counts: BTreeMap::new(),
            services: VecDeque::new(),
            robots: BTreeMap::new(),
            packs: BTreeMap::new(),
            running: BTreeMap::new(),
            sampled: None,
            period_s: PERIOD_S,
            points: 0,
        }
    }
}

impl Past {
    /// Takes in what happened.
    pub fn event(&mut self, event: &Event) {
        *self.counts.entry(event.kind).or_default() += 1;
        if let (EventKind::Forgotten, Some(robot)) = (event.kind, &event.robot) {
            self.robots.remove(robot);
        }
        let status = match event.kind {
            EventKind::ServiceDone => Some(ServiceStatus::Done),
            EventKind::ServiceFailed => Some(ServiceStatus::Failed),
            _ => None,
        };
        let ended = status.and_then(|status| Some((status, self.running.remove(event.robot.as_ref()?)?)));
        if let Some((status, service)) = ended {
            let begun = service.start.min(event.at);
            push_bounded(&mut self.services, Service { status, start: begun, end: event.at, ..service }, SERVICES_MAX);
        }
        push_bounded(&mut self.events, event.clone(), EVENTS_MAX);
    }

    /// Looks at the core; to be called about once a second of its time.
    pub fn look(&mut self, now: Timestamp, core: &Core) {
        self.remember_running(core.schedule());
        let passed_s = self.sampled.map_or(f64::INFINITY, |sampled| now.seconds_since(sampled));
        if (0.0..self.period_s).contains(&passed_s) {
            return;
        }
        if passed_s < 0.0 {
            self.set_back(now);
        }
        self.sampled = Some(now);
        for (id, robot) in &core.fleet().robots {
            if let Some((gauge, _)) = robot.heard() {
                self.robots.entry(id.clone()).or_default().push(now, gauge.soc);
            }
        }
        for (id, station) in core.fleet().stations.iter().filter(|(_, station)| !station.is_lost()) {
            for (pack, gauge) in &station.packs {
                self.packs.entry((id.clone(), pack.clone())).or_default().push(now, gauge.remaining_wh);
            }
        }
        self.make_room(now);
    }

    /// The clock was set back: what lies ahead of it would only be drawn over.
    fn set_back(&mut self, now: Timestamp) {
        let now_s = now.unix_ms() as f64 / 1000.0;
        let all = self.robots.values_mut().chain(self.packs.values_mut());
        all.for_each(|series| {
            let left = series.time_s.partition_point(|time_s| *time_s < now_s);
            series.columns().into_iter().for_each(|column| column.truncate(left));
        });
        self.robots.retain(|_, series| !series.time_s.is_empty());
        self.packs.retain(|_, series| !series.time_s.is_empty());
        let lengths = self.robots.values().chain(self.packs.values()).map(|series| series.time_s.len());
        self.points = lengths.max().unwrap_or(0);
    }

    /// Lets go of services that ended before a day: on a site that runs for months a plan's few bars would drown among them.
    pub fn keep_a_day(&mut self, now: Timestamp) {
        self.services.retain(|service| now.seconds_since(service.end) <= SPAN_S);
    }

    /// A sample was taken: where the series are full, every second point goes, or what is older than they span.
    fn make_room(&mut self, now: Timestamp) {
        self.points += 1;
        if self.points < POINTS_MAX {
            return;
        }
        let spanned_s = self.period_s * POINTS_MAX as f64;
        if spanned_s < SPAN_S {
            self.robots.values_mut().chain(self.packs.values_mut()).for_each(Series::thin);
            self.points = POINTS_MAX / 2;
            self.period_s *= 2.0;
            return;
        }
        let from_s = now.plus_s(-spanned_s).unix_ms() as f64 / 1000.0;
        // Whoever came later has fewer points, and keeps them; who has none left was gone for all that time.
        let is_left = |series: &mut Series| {
            series.shorten(from_s);
            !series.time_s.is_empty()
        };
        self.robots.retain(|_, series| is_left(series));
        self.packs.retain(|_, series| is_left(series));
        self.points -= 1;
    }

    fn remember_running(&mut self, schedule: &Schedule) {
        for service in schedule.services.iter().filter(|service| service.status != ServiceStatus::Planned) {
            if self.running.get(&service.robot) != Some(service) {
                self.running.insert(service.robot.clone(), service.clone());
            }
        }
    }
}

fn push_bounded<T>(queue: &mut VecDeque<T>, item: T, most: usize) {
    if queue.len() == most {
        queue.pop_front();
    }
    queue.push_back(item);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn service() -> Service {
        let at = Timestamp::from_unix_ms;
        Service {
            robot: "r".parse().unwrap(),
            station: "s".parse().unwrap(),
            mode: proto::Mode::Recharge { to_soc: 1.0 },
            bay: None,
            packs: Vec::new(),
            leave: at(0),
            start: at(10),
            end: at(90),
            pack_energy_wh: Estimate::new(20.0, 1.0),
            probability: None,
            status: ServiceStatus::Charging,
            why: Vec::new().into(),
        }
    }

    #[test]
    fn a_service_becomes_past_when_it_is_done_whatever_else_its_robot_did_before() {
        let at = Timestamp::from_unix_ms;
        let service = service();
        let robot = service.robot.clone();
        let mut past = Past::default();
        past.running.insert(robot.clone(), service.clone());
        let event =
            |kind, ms| Event { at: at(ms), seq: 1, kind, robot: Some(robot.clone()), station: None, pack: None, text: String::new() };
        past.event(&event(EventKind::PhaseChanged, 70));
        past.event(&event(EventKind::ServiceDone, 80));
        past.event(&event(EventKind::ServiceDone, 85));
        assert_eq!(past.services, [Service { status: ServiceStatus::Done, end: at(80), ..service }]);
        assert_eq!(past.counts[&EventKind::ServiceDone], 2);
    }

    #[test]
    fn a_site_shows_the_services_of_a_day() {
        let mut past = Past::default();
        let end = |hours: f64| Timestamp::from_unix_ms(0).plus_s(3600.0 * hours);
        for hour in 0..100 {
            let (at, robot) = (end(f64::from(hour)), format!("r{hour}").parse().unwrap());
            past.services.push_back(Service { robot, end: at, ..service() });
        }
        past.keep_a_day(end(99.5));
        assert_eq!(past.services.iter().map(|service| service.robot.to_string()).next().unwrap(), "r76");
        assert_eq!(past.services.len(), 24);
    }

    #[test]
    fn a_full_series_keeps_every_second_point_from_its_first_to_its_last() {
        let mut series = Series::default();
        for point in 0..9 {
            series.push(Timestamp::from_unix_ms(point * 1000), Estimate::new(point as f64, 0.5));
        }
        series.thin();
        assert_eq!(series.time_s, [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert_eq!(series.value, [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert_eq!(series.sigma.len(), 5);
    }

    /// Samples until `to_s`, from where it stands: the robots that `joined` says are there, with when they joined, s.
    fn sampled(past: &mut Past, from_s: &mut f64, to_s: f64, joined: &[(&str, f64, f64)]) {
        while *from_s < to_s {
            let now = Timestamp::from_unix_ms(0).plus_s(*from_s);
            for (robot, _, _) in joined.iter().filter(|(_, begin_s, end_s)| (*begin_s..*end_s).contains(from_s)) {
                past.robots.entry(robot.parse().unwrap()).or_default().push(now, Estimate::new(0.5, 0.1));
            }
            past.make_room(now);
            *from_s += past.period_s;
        }
    }

    #[test]
    fn who_joins_after_days_has_a_past_from_then_on_and_who_left_has_none_in_the_end() {
        const DAY_S: f64 = 86_400.0;
        let (mut past, mut time_s) = (Past::default(), 0.0);
        let fleet = [("first", 0.0, f64::INFINITY), ("late", 3.0 * DAY_S, f64::INFINITY), ("left", 0.0, 2.0 * DAY_S)];
        let points = |past: &Past, robot: &str| past.robots.get(&robot.parse::<RobotId>().unwrap()).map_or(0, |series| series.time_s.len());
        sampled(&mut past, &mut time_s, 3.5 * DAY_S, &fleet);
        // Half a day of a point in 160 s.
        assert_eq!((points(&past, "late"), past.period_s), (270, 160.0));
        sampled(&mut past, &mut time_s, 10.0 * DAY_S, &fleet);
        assert_eq!(["first", "late", "left"].map(|robot| points(&past, robot)), [POINTS_MAX, POINTS_MAX, 0]);
        let first = &past.robots[&"first".parse::<RobotId>().unwrap()];
        assert!(first.time_s[0] > time_s - 160.0 * (POINTS_MAX as f64 + 1.0), "{} of {time_s}", first.time_s[0]);
        // A clock that is set back a little takes nothing away, and one that is set far back makes no series grow.
        past.set_back(Timestamp::from_unix_ms(0).plus_s(time_s - 400.0));
        assert_eq!((points(&past, "first"), past.points), (POINTS_MAX - 2, POINTS_MAX - 2));
        time_s = 0.0;
        sampled(&mut past, &mut time_s, 2.0 * DAY_S, &fleet);
        assert_eq!(["first", "late"].map(|robot| points(&past, robot) <= POINTS_MAX), [true, true]);
    }

    #[test]
    fn what_is_oldest_makes_room() {
        let mut queue = VecDeque::new();
        (0..5).for_each(|item| push_bounded(&mut queue, item, 3));
        assert_eq!(queue, [2, 3, 4]);
    }
}
