//! A robot's power against what the robot itself says of its work and of its ways.
use energy::units::S_PER_H;
use proto::{Gauge, RobotPhase, RobotState, Timestamp};

use super::filter::Filter;
use super::pace::Pace;

/// Length of a block of a robot's work, s: longer than most legs of its work.
const WORK_BLOCK_S: f64 = 300.0;
/// Blocks of work from which it is known how much work differs from block to block.
const BLOCKS_MIN: f64 = 6.0;
/// What messages of a second ago leave open of a power, as a share of it (guess).
pub(super) const STALE_SHARE: f64 = 0.003;
/// The same, W: the last digits of current and voltage.
pub(super) const STALE_W: f64 = 0.05;
/// How uneven the energy of a way is over its time, as a share of it (guess: it may climb at its end).
const UNEVEN_SHARE: f64 = 0.25;
/// A way on which nothing was heard for this long is not judged, s; for longer of a robot that speaks seldom.
const SILENT_S: f64 = 5.0;
/// Neither is one that takes no longer than this, s: where it begins and ends is known to a message a second.
const SHORT_S: f64 = 30.0;
/// What integrating a message a second leaves open of a way's energy, as a share of it (guess).
const WAY_SHARE: f64 = 0.02;

/// A robot's power at work and the energy of its ways, against what it says they are.
#[derive(Default)]
pub(super) struct RobotWatch {
    state: Option<RobotState>,
    work: Option<Work>,
    block: Option<Block>,
    way: Option<Way>,
    /// Until when it is on its way back to work, which is not work.
    back_until: Timestamp,
    last: Option<Timestamp>,
    pace: Pace,
}

/// Power at work, as learnt.
struct Work {
    drain_w: proto::Estimate,
    filter: Filter,
    blocks: f64,
    mean_w: f64,
    squares_w2: f64,
}

#[derive(Clone, Copy)]
struct Block {
    begin: Timestamp,
    rows: f64,
    power_w: f64,
    squares_w2: f64,
}

struct Way {
    begin: Timestamp,
    time_s: f64,
    expected_wh: proto::Estimate,
    energy_wh: f64,
    /// Longest time without a message, s.
    silent_s: f64,
}

/// What a message of a robot's gauge or state brought.
pub(super) enum Judged {
    /// The innovation of a block of work, in sigma.
    Work(Timestamp, f64),
    /// That of a whole way.
    Way(Timestamp, f64),
}

impl RobotWatch {
    /// Takes in a state: work or a way may begin or end with it.
    pub(super) fn state(&mut self, state: &RobotState) -> Option<Judged> {
        let before = self.state.replace(state.clone());
        let phase = before.as_ref().map(|before| before.phase);
        if phase == Some(state.phase) {
            return None;
        }
        self.block = None;
        if state.phase == RobotPhase::Working
            && let Some(station) = before.as_ref().and_then(|before| before.station.as_ref())
        {
            self.back_until = state.at.plus_s(state.travel.get(station).map_or(0.0, |travel| travel.time_s));
        }
        let judged = self.way.take().filter(|way| way.silent_s < self.pace.silent_s(SILENT_S) && way.time_s > SHORT_S).and_then(|way| {
            // Of a robot that stopped on its way its share of the time is known, and of the energy that
            // share about as well as ways are even.
            let arrived = state.phase == RobotPhase::Waiting;
            let share = if arrived { 1.0 } else { (state.at.seconds_since(way.begin) / way.time_s.max(1.0)).min(1.0) };
            let (whole_wh, uneven) = (way.expected_wh.value, UNEVEN_SHARE * share * (1.0 - share));
            let sigma = (share * way.expected_wh.sigma).hypot(whole_wh * WAY_SHARE.hypot(uneven));
            let z = (way.energy_wh - share * whole_wh) / sigma.max(1e-6);
            // Whoever stopped for another reason has taken no more than he should.
            let tells = arrived || state.phase == RobotPhase::Stranded && z > 0.0;
            tells.then_some(Judged::Way(way.begin, z))
        });
        if state.phase == RobotPhase::Travelling
            && let Some(travel) = state.station.as_ref().and_then(|station| state.travel.get(station))
        {
            let at_work = phase == Some(RobotPhase::Working) && state.at >= self.back_until;
            self.way = at_work.then_some(Way {
                begin: state.at,
                time_s: travel.time_s,
                expected_wh: travel.energy_wh,
                energy_wh: 0.0,
                silent_s: 0.0,
            });
        }
        judged
    }

    /// From when on its last word says nothing of now, s; at least this long.
    pub(super) fn silent_s(&self, least_s: f64) -> f64 {
        self.pace.silent_s(least_s)
    }

    /// Whether its battery is being exchanged: nobody knows which one the gauge speaks of.
    pub(super) fn swapping(&self) -> bool {
        self.state.as_ref().is_some_and(|state| state.phase == RobotPhase::Swapping)
    }

    /// Takes in a gauge message.
    pub(super) fn gauge(&mut self, gauge: &Gauge) -> Option<Judged> {
        let dt_s = self.last.replace(gauge.at).map_or(0.0, |last| gauge.at.seconds_since(last));
        let power_w = gauge.voltage_v * gauge.current_a;
        if dt_s > 0.0 {
            self.pace.add(dt_s);
        }
        if dt_s < 0.0 {
            // Its clock was set back: what the way has taken since is not known.
            self.way = None;
        }
        if let Some(way) = &mut self.way {
            way.energy_wh += power_w * dt_s / S_PER_H;
            way.silent_s = way.silent_s.max(dt_s);
        }
        let state = self.state.as_ref()?;
        if state.phase != RobotPhase::Working || gauge.at < self.back_until || power_w <= 0.0 {
            self.block = None;
            return None;
        }
        let block = self.block.get_or_insert(Block { begin: gauge.at, rows: 0.0, power_w: 0.0, squares_w2: 0.0 });
        block.rows += 1.0;
        block.power_w += power_w;
        block.squares_w2 += power_w * power_w;
        if gauge.at.seconds_since(block.begin) < WORK_BLOCK_S {
            return None;
        }
        let (block, drain_w) = (self.block.take()?, state.drain_w);
        if self.work.as_ref().is_none_or(|work| work.drain_w != drain_w) {
            let filter = Filter::new(&[drain_w.sigma]);
            self.work = Some(Work { drain_w, filter, blocks: 0.0, mean_w: 0.0, squares_w2: 0.0 });
        }
        self.work.as_mut()?.judge(&block).map(|z| Judged::Work(block.begin, z))
    }
}

impl Work {
    fn judge(&mut self, block: &Block) -> Option<f64> {
        let mean_w = block.power_w / block.rows;
        let within_w2 = (block.squares_w2 / block.rows - mean_w * mean_w).max(0.0);
        // Welford: how much blocks differ among themselves.
        let before_w = self.mean_w;
        self.blocks += 1.0;
        self.mean_w += (mean_w - before_w) / self.blocks;
        self.squares_w2 += (mean_w - before_w) * (mean_w - self.mean_w);
        if self.blocks < BLOCKS_MIN {
            return None;
        }
        let between_w2 = self.squares_w2 / (self.blocks - 1.0);
        let noise_w2 = within_w2 + between_w2 + STALE_W.powi(2) + (STALE_SHARE * mean_w).powi(2);
        Some(self.filter.judge(&[1.0], mean_w - self.drain_w.value, noise_w2))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use proto::{Estimate, Mission, Travel};

    use super::*;

    fn at(second: u32) -> Timestamp {
        Timestamp::from_unix_ms(1000 * i64::from(second))
    }

    pub(in crate::watch) fn state(second: u32, phase: RobotPhase) -> RobotState {
        RobotState {
            at: at(second),
            seq: 1,
            phase,
            station: (phase != RobotPhase::Working).then(|| "mds-1".parse().unwrap()),
            bay: None,
            drain_w: Estimate::new(4.0, 0.3),
            travel: [("mds-1".parse().unwrap(), Travel { time_s: 1800.0, energy_wh: Estimate::new(2.0, 0.03) })].into(),
            mission: Mission { weight: 1.0, until: None },
            battery: String::new(),
            load: None,
            last_command: None,
            note: None,
        }
    }

    /// Half an hour's way at 5 W, that was to take 2 Wh, and its end.
    fn way(end: RobotPhase, seconds: u32) -> Option<f64> {
        let mut watch = RobotWatch::default();
        watch.state(&state(0, RobotPhase::Working));
        watch.state(&state(10, RobotPhase::Travelling));
        for second in 10..=10 + seconds {
            let gauge = super::super::battery::tests::gauge(i64::from(second), 0.5, 0.5, 10.0);
            assert!(watch.gauge(&gauge).is_none());
        }
        match watch.state(&state(10 + seconds, end)) {
            Some(Judged::Way(begin, z)) => {
                assert_eq!(begin, at(10));
                Some(z)
            }
            _ => None,
        }
    }

    #[test]
    fn a_way_is_judged_when_it_ends_and_by_what_it_had_taken_where_the_robot_stopped() {
        // 2.5 Wh less 2 Wh, over 0.03 Wh and 2 % of 2 Wh: 0.05 Wh.
        let arrived = way(RobotPhase::Waiting, 1800).unwrap();
        assert!((arrived - 10.0).abs() < 0.1, "{arrived}");
        // After 1620 s 2.25 Wh less 1.8 Wh, over 0.027, 0.04 and 0.25 x 0.9 x 0.1 x 2 = 0.045 Wh: 0.066 Wh.
        let stopped = way(RobotPhase::Stranded, 1620).unwrap();
        assert!((stopped - 0.45 / 0.066).abs() < 0.1, "{stopped}");
        // Called back to work.
        assert_eq!(way(RobotPhase::Working, 1800), None);
    }

    #[test]
    fn a_way_of_a_moment_says_nothing() {
        let mut watch = RobotWatch::default();
        let beside = |second: u32, phase: RobotPhase| {
            let nothing = Travel { time_s: 0.0, energy_wh: Estimate::new(0.0, 0.0) };
            RobotState { travel: [("mds-1".parse().unwrap(), nothing)].into(), ..state(second, phase) }
        };
        watch.state(&beside(0, RobotPhase::Working));
        watch.state(&beside(10, RobotPhase::Travelling));
        for second in 10..=12 {
            watch.gauge(&super::super::battery::tests::gauge(second, 0.5, 0.5, 10.0));
        }
        assert!(watch.state(&beside(12, RobotPhase::Waiting)).is_none());
    }

    #[test]
    fn work_that_takes_more_than_it_says_is_news_in_every_block() {
        let mut watch = RobotWatch::default();
        watch.state(&state(0, RobotPhase::Working));
        let judged: Vec<f64> = (0..3 * 3600)
            .filter_map(|second| match watch.gauge(&super::super::battery::tests::gauge(second, 0.5, 0.6, 10.0)) {
                Some(Judged::Work(_, z)) => Some(z),
                _ => None,
            })
            .collect();
        // 2 W beyond 4.0 ± 0.3 W; the first half hour says how much blocks differ: not at all.
        assert_eq!(judged.len(), 3 * 3600 / 301 - 5);
        assert!(judged.iter().all(|z| (6.0..6.7).contains(z)), "{judged:?}");
    }
}
