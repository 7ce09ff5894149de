//! A station's power against its model, at what goes on in its bays.

use std::sync::Arc;

use energy::service::Situation;
use energy::{Channel, Model, Run, Start};
use proto::{Gauge, PackId, RobotPhase, Timestamp};

use super::filter::Filter;
use super::power::{STALE_SHARE, STALE_W};

/// Length of a station's block, s.
const STATION_BLOCK_S: f64 = 60.0;
/// Older than this, a docked robot's word says nothing of the station's power now, s; later of one that speaks seldom.
pub(super) const STALE_S: f64 = 2.0;

/// A station's power against its model, at what goes on in its bays.
pub(super) struct StationWatch {
    /// The pack whose gauge is read.
    pack: PackId,
    run: Run<f64>,
    filter: Filter,
    sigmas: Vec<f64>,
    block: Option<StationBlock>,
}

struct StationBlock {
    begin: Timestamp,
    rows: f64,
    observed_w: f64,
    predicted_w: f64,
    /// What the robots' own gauges leave open of their charging, variance, W².
    doubt_w2: f64,
    situation: Situation,
}

/// A block of a station's power, judged.
pub(super) struct StationJudged {
    pub(super) begin: Timestamp,
    /// Innovation, in sigma.
    pub(super) z: f64,
    /// Power that was predicted, W.
    pub(super) power_w: f64,
}

impl StationWatch {
    /// Watches a station's load by the gauge of a pack. `gain_sigma` is the doubt of the pack's current sensor as a share.
    pub(super) fn new(model: &Arc<Model>, pack: PackId, gain_sigma: f64) -> Self {
        let sigmas: Vec<f64> = model.parameters().iter().map(|p| p.sigma).chain([gain_sigma]).collect();
        Self { pack, run: Run::new(Arc::clone(model), Start::at_soc(0.0)), filter: Filter::new(&sigmas), sigmas, block: None }
    }

    /// The model of the load.
    pub(super) fn model(&self) -> &Arc<Model> {
        self.run.model()
    }

    /// Another pack feeds the station: its sensor has a gain of its own.
    pub(super) fn read_by(&mut self, pack: &PackId, gain_sigma: impl FnOnce() -> f64) {
        if self.pack == *pack {
            return;
        }
        self.pack = pack.clone();
        if let Some((gain, sigma)) = self.sigmas.iter_mut().enumerate().next_back() {
            *sigma = gain_sigma();
            self.filter.forget(gain, *sigma);
        }
        self.interrupt();
    }

    /// Something changed that messages tell at different times: what was begun does not count.
    pub(super) fn interrupt(&mut self) {
        self.block = None;
    }

    /// Takes in the power of the active pack while that goes on, and the variance that the robots' gauges leave open of their charging, W²; at
    /// the end of a block what it says.
    pub(super) fn update(&mut self, now: Timestamp, observed_w: f64, (situation, doubt_w2): &(Situation, f64)) -> Option<StationJudged> {
        let predicted_w = power_w(&mut self.run, situation);
        let empty =
            StationBlock { begin: now, rows: 0.0, observed_w: 0.0, predicted_w: 0.0, doubt_w2: 0.0, situation: Situation::default() };
        let block = self.block.get_or_insert(empty);
        block.rows += 1.0;
        block.observed_w += observed_w;
        block.predicted_w += predicted_w;
        block.doubt_w2 += doubt_w2;
        let sum = &mut block.situation;
        for (sum, value) in [
            (&mut sum.charge_w, situation.charge_w),
            (&mut sum.docked, situation.docked),
            (&mut sum.charging, situation.charging),
            (&mut sum.squared_a2, situation.squared_a2),
            (&mut sum.lift, situation.lift),
            (&mut sum.pack_v, situation.pack_v),
        ] {
            *sum += value;
        }
        if now.seconds_since(block.begin) < STATION_BLOCK_S {
            return None;
        }
        let block = self.block.take()?;
        Some(StationJudged { begin: block.begin, z: self.judge(&block), power_w: block.predicted_w / block.rows })
    }

    fn judge(&mut self, block: &StationBlock) -> f64 {
        let (rows, sum) = (block.rows, block.situation);
        let mean = Situation {
            charge_w: sum.charge_w / rows,
            docked: sum.docked / rows,
            charging: sum.charging / rows,
            squared_a2: sum.squared_a2 / rows,
            lift: sum.lift / rows,
            pack_v: sum.pack_v / rows,
        };
        let (observed_w, predicted_w) = (block.observed_w / rows, block.predicted_w / rows);
        let mut slopes = vec![0.0; self.sigmas.len()];
        let values = self.model().values();
        for (index, slope) in slopes.iter_mut().enumerate().take(values.len()).filter(|(index, _)| self.sigmas[*index] > 0.0) {
            let at = |sign: f64| {
                let mut values = values.clone();
                values[index] += sign * self.sigmas[index];
                power_w(&mut Run::with_parameters(Arc::clone(self.run.model()), values, Start::at_soc(0.0)), &mean)
            };
            *slope = (at(1.0) - at(-1.0)) / (2.0 * self.sigmas[index]);
        }
        slopes[values.len()] = predicted_w;
        // What a charge is mistaken by counts as often as its chargers lose.
        let more = Situation { charge_w: mean.charge_w + 1.0, ..mean };
        let per_w = power_w(&mut self.run, &more) - power_w(&mut self.run, &mean);
        let noise_w = STALE_W.hypot(STALE_SHARE * predicted_w).hypot(per_w * (block.doubt_w2 / rows).sqrt());
        self.filter.judge(&slopes, observed_w - predicted_w, noise_w * noise_w)
    }
}

fn power_w(run: &mut Run<f64>, situation: &Situation) -> f64 {
    situation.set(run);
    run.step(1.0);
    run.channels[Channel::PackPowerW]
}

/// What goes on in a station's bays, by its own state and its robots' gauges, and the variance that the gains of those leave open of what
/// they are charged with, W²: none while that cannot be told. A robot's gauge comes with how long it holds, s.
pub(super) fn situation<'a>(
    state: &proto::StationState,
    pack_v: f64,
    now: Timestamp,
    gauge_of: impl Fn(&proto::RobotId) -> Option<(&'a Gauge, RobotPhase, f64)>,
    gain_sigma: impl Fn(&proto::RobotId) -> f64,
) -> Option<(Situation, f64)> {
    let mut doubt_w2 = 0.0;
    let mut situation =
        Situation { lift: f64::from(u8::from(state.lift_busy || state.swapping.is_some())), pack_v, ..Situation::default() };
    for bay in &state.bays {
        let here = matches!(bay.phase, proto::BayPhase::Occupied | proto::BayPhase::Unloading);
        let Some(robot) = bay.robot.as_ref().filter(|_| here) else { continue };
        let (gauge, phase, holds_s) = gauge_of(robot)?;
        if now.seconds_since(gauge.at) > holds_s {
            return None;
        }
        situation.docked += 1.0;
        if phase == RobotPhase::Charging {
            let current_a = (-gauge.current_a).max(0.0);
            situation.charging += 1.0;
            situation.charge_w += current_a * gauge.voltage_v;
            doubt_w2 += (gain_sigma(robot) * current_a * gauge.voltage_v).powi(2);
            situation.squared_a2 += current_a * current_a;
        }
    }
    Some((situation, doubt_w2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(second: u32) -> Timestamp {
        Timestamp::from_unix_ms(1000 * i64::from(second))
    }

    #[test]
    fn an_empty_stations_power_is_judged_by_what_is_known_of_its_hotel() {
        let station = Arc::new(energy::load_model("mds-station", &|_| unreachable!("built in")).unwrap());
        let mut watch = StationWatch::new(&station, "pack-1".parse().unwrap(), 0.0);
        let nothing = (Situation { pack_v: 11.1, ..Situation::default() }, 0.0);
        // 5.5 W of hotel and 0.2 W of converters, in truth 1 W more.
        let z = (0..=60).find_map(|second| watch.update(at(second), 6.7, &nothing)).map(|judged| judged.z).unwrap();
        // 0.2 W of hotel, 0.05 W of converters, 0.05 W and 0.3 % of 5.7 W of messages: 0.213 W.
        assert!((z - 1.0 / 0.213).abs() < 0.02, "{z}");
    }

    /// A pack's sensor shows 3 % too much and is known to 1 %; the next one shows what is.
    #[test]
    fn what_is_learnt_of_one_packs_sensor_is_not_said_of_the_next() {
        let station = Arc::new(energy::load_model("mds-station", &|_| unreachable!("built in")).unwrap());
        let mut watch = StationWatch::new(&station, "pack-1".parse().unwrap(), 0.01);
        let charging = Situation { pack_v: 11.1, charge_w: 30.0, docked: 2.0, charging: 2.0, squared_a2: 3.0, ..Situation::default() };
        let predicted_w = power_w(&mut Run::new(Arc::clone(&station), Start::at_soc(0.0)), &charging);
        let mut last = |seconds: std::ops::Range<u32>, share: f64, pack: &str| {
            watch.read_by(&pack.parse().unwrap(), || 0.01);
            let z = seconds.filter_map(|second| watch.update(at(second), share * predicted_w, &(charging, 0.0)));
            z.map(|judged| judged.z).collect::<Vec<f64>>()
        };
        assert!(last(0..1800, 1.01, "pack-1").last().unwrap().abs() < 0.5);
        let next = last(1800..2400, 0.99, "pack-2");
        assert!(next.iter().all(|z| z.abs() < 1.5), "{next:?}");
        // A robot's gauge that is known to 10 % says little of what its charge takes.
        let doubted: Vec<f64> = {
            let mut watch = StationWatch::new(&station, "pack-1".parse().unwrap(), 0.0);
            let judged = (0..600).filter_map(|second| watch.update(at(second), 1.08 * predicted_w, &(charging, 3.0 * 3.0)));
            judged.map(|judged| judged.z).collect()
        };
        assert!(doubted[0] > 0.3 && doubted[0] < 1.5, "{doubted:?}");
    }
}
