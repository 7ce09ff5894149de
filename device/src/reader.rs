//! What a device says, as what a gauge is fed with: samples in which no charge is lost or counted twice, and where the
//! gauge begins.

use std::sync::Arc;

use anyhow::ensure;
use energy::gauge::{Sample, soc_at_rest};
use energy::units::{REFERENCE_DEGC, S_PER_H};
use energy::{Channel, Estimate, Model, Run, Start};
use serde::{Deserialize, Serialize};
use tracing::{info, warn};

use crate::report::{Device, PLAUSIBLE_DEGC, Report, Supply};

/// Without a report for this long, what was drawn meanwhile is not known: the gauge starts anew from
/// what the device says, s.
const HISTORY_LOST_S: f64 = 60.0;
/// A report with the same time as the one before may be that one again: then no time has passed. A device that goes on like that for
/// longer than this, s, has a clock that stands, and ours counts.
const STANDS_S: f64 = 5.0;
/// For how long the current of a first report has flowed nobody knows, be it the first of all or the first after a gap: it counts for no
/// more than this, s.
const FIRST_S: f64 = 1.0;
/// A device that measures no current is heard again after this time even if its charge has not
/// moved, s: the time over which gauges look for rest.
const UNMOVED_S: f64 = 300.0;
/// Time under load after which a voltage tells a state of charge as well as it can, s.
const SETTLED_S: f64 = 60.0;

/// A charge that is told after a failure of its device, and has moved by more than this and by more than [`OTHER_SIGMAS`] of what it may be off
/// by, is another battery's: nobody draws a twentieth of a battery within the minute after which it is taken to be another anyway. A guess, as
/// far as gauges settle.
const OTHER_SOC: f64 = 0.05;
/// See [`OTHER_SOC`].
const OTHER_SIGMAS: f64 = 2.0;

/// What stands in for what a device does not measure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Unmeasured {
    /// Temperature taken where nothing measures the battery's, °C.
    pub ambient_degc: f64,
    /// How far a device's own state of charge may be off (standard deviation) where it does not say.
    pub soc_sigma: f64,
}

impl Default for Unmeasured {
    fn default() -> Self {
        Self { ambient_degc: REFERENCE_DEGC, soc_sigma: 0.05 }
    }
}

impl Unmeasured {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn check(&self) -> anyhow::Result<()> {
        let ambient_degc = self.ambient_degc;
        let (least_degc, most_degc) = (PLAUSIBLE_DEGC.start(), PLAUSIBLE_DEGC.end());
        let is_plausible = PLAUSIBLE_DEGC.contains(&ambient_degc);
        ensure!(is_plausible, "ambient_degc = {ambient_degc}: must be between {least_degc} and {most_degc}");
        ensure!((0.0001..=0.5).contains(&self.soc_sigma), "soc_sigma = {}: must be between 0.0001 and 0.5", self.soc_sigma);
        Ok(())
    }
}

/// What a device showed since it was read before.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reading {
    /// What a gauge is to be fed with; none where nothing new was shown.
    pub sample: Option<Sample>,
    /// The gauge begins anew, from this state of charge.
    pub exchanged: Option<Estimate>,
    /// State of charge by the last report alone, whatever was counted before: its own gauge's, or by the voltage.
    pub said_soc: Option<Estimate>,
    /// What each report said of what feeds the battery's load, oldest first.
    pub supplies: Vec<Supply>,
    /// Why nothing has been heard for long.
    pub silent: Option<String>,
}

/// A device beside the model of what it measures.
pub struct Reader {
    device: Box<dyn Device>,
    model: Arc<Model>,
    unmeasured: Unmeasured,
    now_s: f64,
    last: Option<Last>,
    /// For how long the device's clock has shown the same, s.
    stood_s: f64,
    /// What was counted by our clock for that, s.
    counted_s: f64,
    /// From when a charge is counted whose current nobody measures.
    anchor: Option<Anchor>,
    /// What reports without a voltage have said, until one shows a voltage.
    waits: Flowed,
    trouble: Option<String>,
    /// What was said of its charge last, and whether it could not be read since.
    said: Option<Estimate>,
    has_failed: bool,
    told_missing: bool,
    told_implausible: bool,
}

/// The last report, by both clocks.
#[derive(Debug, Clone, Copy)]
struct Last {
    now_s: f64,
    at_s: Option<f64>,
}

#[derive(Debug, Clone, Copy)]
struct Anchor {
    soc: f64,
    waited_s: f64,
}

/// Charge that has flowed, and in what time.
#[derive(Debug, Clone, Copy, Default)]
struct Flowed {
    charge_as: f64,
    passed_s: f64,
}

/// Interval of charge and what was shown at its end.
#[derive(Debug, Clone, Copy, Default)]
struct Counted {
    charge_as: f64,
    passed_s: f64,
    voltage_v: f64,
    temperature_degc: f64,
}

impl Reader {
    /// Reads a battery that is believed to be `model`.
    #[must_use]
    pub fn new(device: Box<dyn Device>, model: Arc<Model>, unmeasured: Unmeasured) -> Self {
        Self {
            device,
            model,
            unmeasured,
            now_s: 0.0,
            last: None,
            stood_s: 0.0,
            counted_s: 0.0,
            anchor: None,
            waits: Flowed::default(),
            trouble: None,
            said: None,
            has_failed: false,
            told_missing: false,
            told_implausible: false,
        }
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> &dyn Device {
        self.device.as_ref()
    }

    /// Switches the charger on or off, where the device can.
    pub fn charge(&mut self, on: bool) {
        self.device.charge(on);
    }

    /// What it feeds leaves its charger: nothing that was asked of that is wanted any more.
    pub fn leave(&mut self) {
        self.device.leave();
    }

    /// The least current that its sensor can tell from none, A.
    #[must_use]
    pub fn least_a(&self) -> f64 {
        let sensor = self.model.sensor(Channel::CurrentA);
        3.0 * sensor.floor().hypot(sensor.offset_sigma)
    }

    /// What was shown in the last `dt_s` seconds.
    pub fn advance(&mut self, dt_s: f64) -> Reading {
        self.now_s += dt_s;
        let reports = self.device.read(dt_s).unwrap_or_else(|error| {
            self.has_failed = true;
            let trouble = format!("{error:#}");
            if self.trouble.as_ref() != Some(&trouble) {
                warn!("{}: {trouble}", self.device.name());
                self.trouble = Some(trouble);
            }
            Vec::new()
        });
        // What waited while the machine slept is older than it looks: the next report begins anew.
        let slept = dt_s > HISTORY_LOST_S;
        if slept {
            self.last = None;
        }
        let (mut counted, mut exchanged, mut supplies) = (Counted::default(), None, Vec::new());
        for report in reports.iter().filter(|_| !slept) {
            self.trouble = None;
            let report = &self.plausible(report);
            self.tell_missing(report);
            if self.is_another(report) {
                self.last = None;
            }
            match self.since_last(report) {
                Some(since_s) => self.count(report, since_s, &mut counted),
                None => {
                    (counted, self.waits) = (Counted::default(), Flowed::default());
                    self.anchor = report.soc.map(|soc| Anchor { soc, waited_s: 0.0 });
                    exchanged = self.state_of_charge(report);
                    // Said at once, so that the battery is known; what a device without a current draws
                    // will show.
                    let first = Report { current_a: Some(report.current_a.unwrap_or(0.0)), ..*report };
                    self.count(&first, dt_s.min(FIRST_S), &mut counted);
                }
            }
            supplies.push(self.fed(report));
        }
        let sample = (counted.passed_s > 0.0).then(|| Sample {
            dt_s: counted.passed_s,
            current_a: counted.charge_as / counted.passed_s,
            voltage_v: counted.voltage_v,
            temperature_degc: counted.temperature_degc,
        });
        let silent_s = self.now_s - self.last.map_or(0.0, |last| last.now_s);
        let silent = (silent_s > HISTORY_LOST_S).then(|| {
            let why = self.trouble.as_ref().map(|why| format!(": {why}")).unwrap_or_default();
            format!("no reading of {} for {silent_s:.0} s{why}", self.device.name())
        });
        let said_soc = reports.last().filter(|_| !slept).and_then(|report| self.state_of_charge(report));
        Reading { sample, exchanged, said_soc, supplies, silent }
    }

    /// Whether another battery was put in while the device could not be read.
    fn is_another(&mut self, report: &Report) -> bool {
        let is = report.soc.and_then(|_| self.state_of_charge(report));
        let was = self.said;
        self.said = is.or(was);
        let has_moved =
            |was: Estimate, is: Estimate| (is.value - was.value).abs() > (OTHER_SIGMAS * was.sigma.hypot(is.sigma)).max(OTHER_SOC);
        std::mem::take(&mut self.has_failed) && was.zip(is).is_some_and(|(was, is)| has_moved(was, is))
    }

    /// Time since the report before, s; none when what was drawn meanwhile is not known.
    fn since_last(&mut self, report: &Report) -> Option<f64> {
        let now = Last { now_s: self.now_s, at_s: report.at_s };
        let last = self.last.replace(now)?;
        let by_us = now.now_s - last.now_s;
        // The device's clock knows better when reports came late and together, unless it was set, or stands.
        let by_device = now.at_s.zip(last.at_s).map(|(now, last)| now - last).filter(|s| (0.0..=HISTORY_LOST_S).contains(s));
        let since_s = match by_device {
            // It repeats itself, or its clock stands: what is counted for that by ours has passed when it moves on.
            Some(0.0) => {
                self.stood_s += by_us;
                let counts_s = if self.stood_s > STANDS_S { std::mem::take(&mut self.stood_s) } else { 0.0 };
                self.counted_s += counts_s;
                counts_s
            }
            _ => {
                self.stood_s = 0.0;
                let counted_s = std::mem::take(&mut self.counted_s);
                by_device.map_or(by_us, |passed_s| (passed_s - counted_s).max(0.0))
            }
        };
        (by_us <= HISTORY_LOST_S && since_s <= HISTORY_LOST_S).then_some(since_s)
    }

    /// State of charge from what the device says: its own gauge's, or by the voltage.
    fn state_of_charge(&self, report: &Report) -> Option<Estimate> {
        if let Some(soc) = report.soc {
            return Some(Estimate::new(soc, report.soc_sigma.unwrap_or(self.unmeasured.soc_sigma)));
        }
        let voltage_v = report.voltage_v?;
        let at_rest = soc_at_rest(&self.model, voltage_v);
        let Some(current_a) = report.current_a else { return Some(at_rest) };
        // It is not known for how long that current has flowed: what that makes of the answer is part of
        // its deviation.
        let [settled, begun] = [SETTLED_S, 1.0].map(|for_s| self.unloaded(voltage_v, current_a, for_s));
        Some(Estimate::new(settled.value, settled.sigma.hypot(settled.value - begun.value)))
    }

    /// State of charge of a pack that shows this voltage after a current has flowed for a time.
    fn unloaded(&self, voltage_v: f64, current_a: f64, for_s: f64) -> Estimate {
        let mut soc = soc_at_rest(&self.model, voltage_v);
        // What the current makes of the voltage depends on the charge: three rounds, each nearer.
        for _ in 0..3 {
            let mut run = Run::new(Arc::clone(&self.model), Start::at_soc(soc.value));
            run.channels[Channel::CurrentA] = current_a;
            run.step(for_s);
            let rested_v = run.channels[Channel::OcvV] * f64::from(self.model.battery().series);
            soc = soc_at_rest(&self.model, voltage_v + rested_v - run.channels[Channel::VoltageV]);
        }
        soc
    }

    /// Charge that has flowed since the report before, as far as it can be told now.
    fn count(&mut self, report: &Report, since_s: f64, counted: &mut Counted) {
        let flowed = match (report.current_a, report.soc) {
            (Some(current_a), soc) => {
                // A later report without a current counts from here: what flowed until now is counted.
                self.anchor = soc.map(|soc| Anchor { soc, waited_s: 0.0 });
                Some((current_a * since_s, since_s))
            }
            (None, Some(soc)) => self.by_charge(soc, since_s),
            (None, None) => None,
        };
        if let Some((charge_as, passed_s)) = flowed {
            self.waits = Flowed { charge_as: self.waits.charge_as + charge_as, passed_s: self.waits.passed_s + passed_s };
        }
        let Some(voltage_v) = report.voltage_v else { return };
        let Flowed { charge_as, passed_s } = std::mem::take(&mut self.waits);
        if passed_s > 0.0 {
            let temperature_degc = report.temperature_degc.unwrap_or(self.unmeasured.ambient_degc);
            let (charge_as, passed_s) = (counted.charge_as + charge_as, counted.passed_s + passed_s);
            *counted = Counted { charge_as, passed_s, voltage_v, temperature_degc };
        }
    }

    /// The mean current over the time in which the device's state of charge has moved by a step, or
    /// has not for long: no charge is lost or counted twice.
    fn by_charge(&mut self, soc: f64, since_s: f64) -> Option<(f64, f64)> {
        let anchor = self.anchor.get_or_insert(Anchor { soc, waited_s: 0.0 });
        anchor.waited_s += since_s;
        if anchor.soc == soc && anchor.waited_s < UNMOVED_S {
            return None;
        }
        let charge_as = (anchor.soc - soc) * self.model.battery().capacity_ah * S_PER_H;
        let passed_s = anchor.waited_s;
        *anchor = Anchor { soc, waited_s: 0.0 };
        Some((charge_as, passed_s))
    }

    /// Whether something feeds what the battery feeds: by the device's word, or by a current that its
    /// sensor can tell from none.
    fn fed(&self, report: &Report) -> Supply {
        let none_a = self.least_a();
        match (report.supply, report.current_a) {
            (Supply::Unknown, Some(current_a)) if current_a < -none_a => Supply::Connected,
            (Supply::Unknown, Some(current_a)) if current_a > none_a => Supply::Absent,
            (said, _) => said,
        }
    }

    /// The report without a temperature that no battery has: as if there were none.
    fn plausible(&mut self, report: &Report) -> Report {
        let Some(shown_degc) = report.temperature_degc.filter(|degc| !PLAUSIBLE_DEGC.contains(degc)) else { return *report };
        if !std::mem::replace(&mut self.told_implausible, true) {
            let stands_in_degc = self.unmeasured.ambient_degc;
            warn!("{} shows {shown_degc:.0} degC, which no battery has: taken as {stands_in_degc} degC (ambient_degc)", self.device.name());
        }
        Report { temperature_degc: None, ..*report }
    }

    /// Says once what the device does not measure, and what stands in for it.
    fn tell_missing(&mut self, report: &Report) {
        if std::mem::replace(&mut self.told_missing, true) {
            return;
        }
        let name = self.device.name();
        info!("{name}: the first reading is here");
        if report.current_a.is_none() && report.soc.is_some() {
            warn!("{name} measures no current: it is taken from how its state of charge moves, in steps");
        }
        if report.current_a.is_none() && report.soc.is_none() {
            warn!("{name} measures neither current nor state of charge: the gauge has nothing to count");
        }
        if report.temperature_degc.is_none() {
            warn!("{name} measures no temperature: taken as {} degC (ambient_degc)", self.unmeasured.ambient_degc);
        }
        if report.soc.is_none() {
            warn!("{name} has no state of charge of its own: the gauge starts from the voltage");
        }
        if report.voltage_v.is_none() {
            warn!("{name} measures no voltage: the gauge cannot work without");
        }
    }
}

#[cfg(test)]
mod tests;
