//! A battery's voltage against what its model says at the current and temperature of its gauge.
//!
//! The model is stepped on the current that the gauge tells, from the state of charge that the gauge
//! told first. What the voltage shows beyond it is averaged over a minute and judged by a
//! [`Filter`] over what the model itself calls rough:
//!
//! | unknown | deviation |
//! | --- | --- |
//! | state of charge | the gauge's at the start |
//! | charge count, as a share | capacity of the model, gain of the current sensor |
//! | current, A | offset of the current sensor |
//! | voltage drop, as a share | the model's resistances, by central differences |
//! | voltage, V | OCV table, offset of the voltage sensor |
//!
//! The last two belong to a state of charge and are forgotten over 0.15 of it, the correlation length
//! that gauges assume for an OCV table's error (a guess, 0.05 to 0.5).

use std::sync::Arc;

use energy::gauge::Sample;
use energy::load::Terminals as _;
use energy::units::S_PER_H;
use energy::{Channel, Estimate, Model, Run, Start, propagate};
use proto::{Gauge, Timestamp};

use super::filter::Filter;
use super::pace::Pace;

/// Length of a block, s: long enough that sensors' noise averages out, short beside a charge.
const BLOCK_S: f64 = 60.0;
/// Without a message for this long nobody knows what current flowed, s; later of a gauge that speaks seldom.
const GAP_S: f64 = 10.0;
/// Longest interval over which a message's current counts as the mean, s.
const MEAN_S: f64 = 2.0;
/// After a start drops are not judged until fast polarisation has come to what the current makes of
/// it, s: five time constants of a minute (guess; 10 s to 100 s for lithium cells).
const SETTLE_S: f64 = 300.0;
/// What steps of a second and blocks of a minute leave out, V per cell (guess).
const STEPS_V: f64 = 0.3e-3;
/// Distance in state of charge over which errors of table and resistance change.
const LENGTH: f64 = 0.15;
/// Time constant with which the surroundings' temperature is made out from the pack's, s.
const AMBIENT_TAU_S: f64 = 1800.0;

/// Share of a change of the drop that cells of the same model differ by for some minutes: what the
/// slow part of a cell's polarisation makes of it (guess).
const SLOW_SHARE: f64 = 0.05;

/// Least current, in capacities per hour, whose drop tells a resistance: a guess, at which a tenth of a volt of drop at 1C is as large as what tables are off by.
const DRAWN_LEAST_PER_H: f64 = 0.05;

const SOC: usize = 0;
const COUNT: usize = 1;
const CURRENT: usize = 2;
const DROP: usize = 3;
const VOLTAGE: usize = 4;

/// A model that follows one battery.
pub(super) struct BatteryWatch {
    run: Run<f64>,
    filter: Filter,
    drop_sigma: f64,
    voltage_sigma_v: f64,
    /// Drop over the last few blocks, V.
    recent_drop_v: f64,
    begun: Timestamp,
    last: Timestamp,
    pace: Pace,
    last_a: f64,
    last_v: f64,
    /// Resistance that the pack showed beyond its model when it was first judged, ohm: a wrong count shows later.
    further_ohm: Option<f64>,
    block: Block,
}

/// Sums over a block.
#[derive(Debug, Clone, Copy)]
struct Block {
    begin: Timestamp,
    rows: f64,
    residual_v: f64,
    slope_v: f64,
    drop_v: f64,
    current_a: f64,
    moved: f64,
}

impl Block {
    fn begin(begin: Timestamp) -> Self {
        Self { begin, rows: 0.0, residual_v: 0.0, slope_v: 0.0, drop_v: 0.0, current_a: 0.0, moved: 0.0 }
    }
}

impl BatteryWatch {
    /// Follows from this message on.
    pub(super) fn new(model: &Arc<Model>, gauge: &Gauge) -> Self {
        let start = Start { temperature_degc: gauge.temperature_degc, ..Start::at_soc(gauge.soc.value) };
        let series = f64::from(model.battery().series);
        let [current, voltage] = [Channel::CurrentA, Channel::VoltageV].map(|channel| model.sensor(channel));
        let rough = &model.uncertainty;
        let drop_sigma = drop_relative_sigma(model).hypot(rough.resistance_relative_sigma);
        let voltage_sigma_v = (rough.ocv_sigma_v * series).hypot(voltage.offset_sigma);
        let count_sigma = rough.capacity_relative_sigma.hypot(current.gain_sigma);
        Self {
            run: Run::new(Arc::clone(model), start),
            filter: Filter::new(&[gauge.soc.sigma, count_sigma, current.offset_sigma, drop_sigma, voltage_sigma_v]),
            drop_sigma,
            voltage_sigma_v,
            recent_drop_v: 0.0,
            begun: gauge.at,
            last: gauge.at,
            pace: Pace::default(),
            last_a: gauge.current_a,
            last_v: gauge.voltage_v,
            further_ohm: None,
            block: Block::begin(gauge.at),
        }
    }

    /// The model that follows.
    pub(super) fn model(&self) -> &Arc<Model> {
        self.run.model()
    }

    /// State of charge that the voltage alone shows, by the drop that the model makes of the current and the resistance that the pack showed
    /// beyond it at first; none before that. A pack that has aged shows where it ends before its count does.
    pub(super) fn shown_soc(&self) -> Option<f64> {
        let (facts, now) = (self.run.model().battery(), &self.run.channels);
        let series = f64::from(facts.series);
        let drop_v = now[Channel::OcvV] - now[Channel::VoltageV] / series;
        let further_v = self.further_ohm? * self.last_a / series;
        Some(facts.ocv.soc(self.last_v / series + drop_v + further_v))
    }

    /// Takes in a message; at the end of a block its begin and its innovation in sigma.
    pub(super) fn update(&mut self, gauge: &Gauge) -> Option<(Timestamp, f64)> {
        let dt_s = gauge.at.seconds_since(self.last);
        // Long silence, or a clock that was set back.
        if dt_s.abs() > self.pace.silent_s(GAP_S) {
            *self = Self { pace: Pace::anew(dt_s), ..Self::new(&Arc::clone(self.run.model()), gauge) };
            return None;
        }
        if dt_s <= 0.0 {
            return None;
        }
        self.pace.add(dt_s);
        let current_a = if dt_s <= MEAN_S { gauge.current_a } else { f64::midpoint(self.last_a, gauge.current_a) };
        let soc = self.run.states()[0];
        self.follow(&Sample { dt_s, current_a, voltage_v: gauge.voltage_v, temperature_degc: gauge.temperature_degc }, gauge.cycles);
        let capacity_as = self.run.channels[Channel::CapacityAh] * S_PER_H;
        if dt_s > MEAN_S {
            // Where the current changed in the interval is as likely as anywhere in it.
            let unseen = (gauge.current_a - self.last_a) * dt_s / capacity_as;
            self.filter.wander(SOC, unseen * unseen / 12.0);
        }
        (self.last, self.last_a, self.last_v) = (gauge.at, gauge.current_a, gauge.voltage_v);
        let block = &mut self.block;
        let (facts, now) = (self.run.model().battery(), &self.run.channels);
        let (series, after) = (f64::from(facts.series), self.run.states()[0]);
        block.rows += 1.0;
        block.residual_v += gauge.voltage_v - now[Channel::VoltageV];
        block.slope_v += facts.ocv.slope_v(after) * series;
        block.drop_v += now[Channel::OcvV] * series - now[Channel::VoltageV];
        block.current_a += current_a;
        block.moved += soc - after;
        let length_s = gauge.at.seconds_since(block.begin);
        (length_s >= BLOCK_S).then(|| self.judge(gauge.at, length_s, capacity_as)).flatten()
    }

    /// Steps the model as a gauge does: at the measured temperature, its surroundings led by it.
    fn follow(&mut self, sample: &Sample, cycles: Option<f64>) {
        let now = &mut self.run.channels;
        let colder_degc = sample.temperature_degc - now[Channel::TemperatureDegc];
        now[Channel::AmbientDegc] += colder_degc * (sample.dt_s / AMBIENT_TAU_S).min(1.0);
        now[Channel::TemperatureDegc] = sample.temperature_degc;
        now[Channel::CycleCount] = cycles.unwrap_or(0.0);
        self.run.step_current(sample.current_a, sample.dt_s);
    }

    fn judge(&mut self, now: Timestamp, length_s: f64, capacity_as: f64) -> Option<(Timestamp, f64)> {
        let block = std::mem::replace(&mut self.block, Block::begin(now));
        let series = f64::from(self.model().battery().series);
        self.filter.carry(COUNT, SOC, -block.moved);
        self.filter.carry(CURRENT, SOC, -length_s / capacity_as);
        let keep = (-block.moved.abs() / LENGTH).exp();
        self.filter.renew(DROP, keep, self.drop_sigma);
        self.filter.renew(VOLTAGE, keep, self.voltage_sigma_v);
        if now.seconds_since(self.begun) < SETTLE_S {
            return None;
        }
        let mean = |sum: f64| sum / block.rows;
        if self.further_ohm.is_none() && mean(block.current_a) * S_PER_H > DRAWN_LEAST_PER_H * capacity_as {
            self.further_ohm = Some(-mean(block.residual_v) / mean(block.current_a));
        }
        let slope_v = mean(block.slope_v);
        let noise_v = self.model().sensor(Channel::VoltageV).floor() / block.rows.sqrt();
        // The table bends: a wrong state of charge is off by more than its slope there says.
        let (soc, sigma) = (self.run.states()[0], self.filter.sigma(SOC));
        let ocv = &self.model().battery().ocv;
        let bend_v = series * (ocv.voltage_v(soc + sigma) + ocv.voltage_v(soc - sigma) - 2.0 * ocv.voltage_v(soc)) / 2.0;
        let drop_v = mean(block.drop_v);
        let changed_v = SLOW_SHARE * (drop_v - self.recent_drop_v);
        self.recent_drop_v = f64::midpoint(self.recent_drop_v, drop_v);
        let variance = noise_v.powi(2) + (STEPS_V * series).powi(2) + bend_v.powi(2) + changed_v.powi(2);
        let z = self.filter.judge(&[slope_v, 0.0, 0.0, -drop_v, 1.0], mean(block.residual_v), variance);
        // What was learnt of the charge goes into the model, for the table's sake.
        self.run.states_mut()[0] += self.filter.value(SOC);
        self.filter.rebase(SOC);
        Some((block.begin, z))
    }
}

/// Deviation of the voltage drop at 1C as a share of it, from the deviations of the parameters: the
/// greatest of three states of charge.
fn drop_relative_sigma(model: &Arc<Model>) -> f64 {
    let at = |soc: f64| {
        let drop = propagate(&model.estimates(), |values| {
            let values = values.iter().zip(model.parameters()).map(|(&value, p)| value.clamp(p.min, p.max)).collect();
            let mut run = Run::with_parameters(Arc::clone(model), values, Start::at_soc(soc));
            run.step_current(model.battery().capacity_ah, BLOCK_S);
            run.channels[Channel::OcvV] * f64::from(model.battery().series) - run.channels[Channel::VoltageV]
        });
        relative(drop)
    };
    [0.1, 0.5, 0.9].into_iter().map(at).fold(0.0, f64::max)
}

fn relative(estimate: Estimate) -> f64 {
    if estimate.value.abs() > 0.0 { estimate.sigma / estimate.value.abs() } else { 0.0 }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    fn model() -> Arc<Model> {
        Arc::new(energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap())
    }

    pub(crate) fn gauge(second: i64, soc: f64, current_a: f64, voltage_v: f64) -> Gauge {
        let known = proto::Estimate::new(soc, 0.01);
        Gauge {
            at: Timestamp::from_unix_ms(1000 * second),
            seq: 1,
            soc: known,
            remaining_wh: known,
            full_wh: proto::Estimate::new(14.0, 0.1),
            time_to_empty_s: None,
            time_to_full_s: None,
            soh: known,
            cycles: None,
            voltage_v,
            current_a,
            temperature_degc: 25.0,
            power_w: 0.0,
            cells_series: 3,
            source: String::new(),
        }
    }

    /// Innovations of 20 minutes at 0.4 A, of a pack with this resistance beside the model's.
    fn innovations(extra_ohm: f64) -> Vec<f64> {
        let mut truth = Run::new(model(), Start::at_soc(0.8));
        let mut watch = BatteryWatch::new(&model(), &gauge(0, 0.8, 0.4, truth.channels[Channel::VoltageV]));
        let second = |second| {
            truth.step_current(0.4, 1.0);
            watch.update(&gauge(second, 0.8, 0.4, truth.channels[Channel::VoltageV] - extra_ohm * 0.4))
        };
        (1..=1200).filter_map(second).map(|(_, z)| z).collect()
    }

    #[test]
    fn a_battery_that_is_as_its_model_says_has_no_innovations() {
        let z = innovations(0.0);
        assert_eq!(z.len(), 16, "twenty minutes less four of settling");
        assert!(z.iter().all(|z| z.abs() < 0.05), "{z:?}");
    }

    #[test]
    fn a_resistance_beyond_all_doubt_stays_an_innovation() {
        // 0.5 ohm at 0.4 A: 200 mV, where the model is unsure of 9 mV of its table, 10 % of 0.13 V, and
        // 1 % of charge, which is some 20 mV: 26 mV in all.
        let z = innovations(0.5);
        assert!(z.iter().all(|z| (-12.0..-4.0).contains(z)), "{z:?}");
    }

    #[test]
    fn after_silence_it_begins_again_with_what_the_gauge_says() {
        let mut watch = BatteryWatch::new(&model(), &gauge(0, 0.8, 0.4, 11.8));
        assert_eq!(watch.update(&gauge(60, 0.5, 0.4, 11.4)), None);
        assert_eq!(watch.run.states()[0], 0.5);
    }
}
