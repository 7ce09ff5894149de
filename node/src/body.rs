//! A simulated pack behind a simulated gauge IC: what an agent's source steps when there is no
//! real pack. The truth is the energy model; only the readings are noisy.

use std::sync::Arc;

use energy::charger::{self, ChargeRequest, Charger, Charging, Flow, Surroundings};
use energy::gauge::Sample;
use energy::load::{CannotDeliver, Terminals as _};
use energy::pack::Battery as _;
use energy::protection::{Measured, Protection, Trip};
use energy::{Channel, Estimate, Model, Pack, Start};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// The channels that a gauge IC reads.
const SENSED: [Channel; 3] = [Channel::CurrentA, Channel::VoltageV, Channel::TemperatureDegc];

/// A pack with all its cells, its true state, and the specimen of gauge IC that watches it.
#[derive(Clone)]
pub struct PackBody {
    pack: Pack,
    protection: Protection,
    rng: Pcg64Mcg,
    offset: [f64; 3],
    gain: [f64; 3],
}

/// What a pack is asked to do for one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Task {
    /// Give this power, W.
    Power(f64),
    /// Take charge from its own CC-CV charger.
    Charge {
        /// Most current that the charger has for it, A; infinite when only its own limits count.
        current_a_max: f64,
    },
    /// Nothing.
    Rest,
}

impl PackBody {
    /// A pack at a true state of charge. Offset and gain of its gauge IC are drawn once, within
    /// the sensor deviations that the model states.
    #[must_use]
    pub fn new(model: Arc<Model>, start: Start, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let [offset, gain] = [0, 1].map(|_| [0, 1, 2].map(|_| StandardNormal.sample(&mut rng)));
        let pack = Pack::new(model, start);
        let protection = Protection::of(pack.model().battery());
        let mut body = Self { pack, protection, rng, offset, gain };
        body.rest();
        body
    }

    /// The true value of a channel at the end of the last step.
    #[must_use]
    pub fn truth(&self, channel: Channel) -> f64 {
        self.pack.channels()[channel]
    }

    /// The pack's model.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        self.pack.model()
    }

    /// Puts in another pack of the same kind.
    pub fn exchange(&mut self, soc: f64) {
        let temperature_degc = self.truth(Channel::AmbientDegc);
        self.pack.restart(Start { temperature_degc, ..Start::at_soc(soc) });
        self.rest();
    }

    /// What keeps the pack from being charged or discharged, if anything does.
    #[must_use]
    pub fn protection(&self) -> &Protection {
        &self.protection
    }

    /// Steps the pack and reads its sensors. A charge that the protection does not allow is a
    /// step of rest.
    ///
    /// # Errors
    /// [`CannotDeliver`] when the power cannot be had, when the pack or its weakest cell would
    /// fall below its end of discharge, or when the protection has opened: the step is one of
    /// rest.
    pub fn step(&mut self, dt_s: f64, task: Task) -> Result<Sample, CannotDeliver> {
        let facts = self.pack.model().battery();
        let (full_v, charge) = (facts.full_v(), facts.charge);
        let allowed = self.protection.allowed();
        let mut failed = None;
        match task {
            Task::Power(power_w) => {
                let open = if power_w > 0.0 { allowed.discharge } else { allowed.charge };
                if open.is_err() || self.pack.step_power(power_w, dt_s).is_err() {
                    failed = Some(CannotDeliver { power_w });
                } else if self.pack.is_empty() {
                    self.pack.restore();
                    failed = Some(CannotDeliver { power_w });
                }
                if failed.is_some() {
                    self.pack.step_current(0.0, dt_s);
                }
            }
            Task::Charge { current_a_max } if allowed.charge.is_ok() => {
                self.pack.step_charge(charge.current_a.min(current_a_max), full_v, dt_s);
            }
            Task::Charge { .. } | Task::Rest => self.pack.step_current(0.0, dt_s),
        }
        self.protect(dt_s);
        failed.map_or_else(|| Ok(self.sample(dt_s)), Err)
    }

    /// What the pack asks its charger for: nothing while it is too hot or too cold.
    #[must_use]
    pub fn charge_request(&self) -> ChargeRequest {
        let bars = |trip| matches!(trip, Trip::OverTemperatureCharge | Trip::UnderTemperatureCharge);
        charger::request(self.pack.model().battery(), !self.protection.tripped().any(bars))
    }

    /// Steps the pack on a charger with what stands around it, and reads its sensors. While the
    /// protection does not allow a charge, the pack asks for none.
    ///
    /// # Errors
    /// [`CannotDeliver`] when the robot beside the charger would drain the pack below its end of
    /// discharge, or when the protection has opened: the step is one of rest.
    pub fn step_on(
        &mut self,
        charger: &Charger,
        charging: &mut Charging,
        around: &Surroundings,
        dt_s: f64,
    ) -> Result<(Flow, Sample), CannotDeliver> {
        let mut around = *around;
        let allowed = self.protection.allowed();
        if allowed.charge.is_err() {
            around.request.current_a = 0.0;
        }
        let before = *charging;
        let trial = self.pack.clone();
        let flow = charger.step(charging, &mut self.pack, &around, dt_s);
        let drained = flow.battery_a < 0.0 && (allowed.discharge.is_err() || self.pack.is_empty());
        if drained {
            (self.pack, *charging) = (trial, before);
            self.pack.step_current(0.0, dt_s);
        }
        self.protect(dt_s);
        if drained { Err(CannotDeliver { power_w: around.own_load_w }) } else { Ok((flow, self.sample(dt_s))) }
    }

    /// A current that no sensor is read in, A: one of another pack beside this one.
    pub fn pulse(&mut self, current_a: f64, dt_s: f64) {
        if dt_s > 0.0 {
            self.pack.step_current(current_a, dt_s);
            self.protect(dt_s);
        }
    }

    /// The front end of a pack that has been at rest for long.
    fn rest(&mut self) {
        const LONG_S: f64 = 3600.0;
        self.protection = Protection::of(self.pack.model().battery());
        self.protect(LONG_S);
    }

    /// The front end takes in a step.
    fn protect(&mut self, dt_s: f64) {
        let measured = Measured { temperature_degc: self.thermistor_degc(), ..measured(&self.pack) };
        self.protection.step(dt_s, &measured);
    }

    /// Temperature of the cells as this specimen's thermistor has it, °C: front end and gauge share it.
    fn thermistor_degc(&self) -> f64 {
        let [.., offset] = self.offset;
        let [.., gain] = self.gain;
        self.pack.model().sensor(Channel::TemperatureDegc).shows(self.truth(Channel::CellDegc), 0.0, offset, gain)
    }

    /// Reads the sensors once, as after a step of `dt_s`.
    pub fn sample(&mut self, dt_s: f64) -> Sample {
        let model = Arc::clone(self.pack.model());
        let mut shown = [0.0; 3];
        for (index, channel) in SENSED.into_iter().enumerate() {
            let noise = StandardNormal.sample(&mut self.rng);
            shown[index] = model.sensor(channel).shows(self.truth(channel), noise, self.offset[index], self.gain[index]);
        }
        Sample { dt_s, current_a: shown[0], voltage_v: shown[1], temperature_degc: shown[2] }
    }

    /// What a gauge that watched this pack before would start from: the true state of charge
    /// within the model's stated deviation.
    pub fn remembered_soc(&mut self) -> Estimate {
        let sigma = self.pack.model().uncertainty.soc_initial_sigma;
        let noise: f64 = StandardNormal.sample(&mut self.rng);
        Estimate::new((self.truth(Channel::Soc) + sigma * noise).clamp(0.0, 1.0), sigma)
    }
}

fn measured(pack: &Pack) -> Measured {
    let [cell_min_v, cell_max_v, current_a, temperature_degc] =
        [Channel::CellMinV, Channel::CellMaxV, Channel::TerminalCurrentA, Channel::CellDegc].map(|channel| pack.channels()[channel]);
    Measured { cell_min_v, cell_max_v, current_a, temperature_degc }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHARGE: Task = Task::Charge { current_a_max: f64::INFINITY };

    fn body(extra: &str, soc: f64, temperature_degc: f64) -> PackBody {
        let text =
            energy::built_in("explorer-3s1p-1320mah").unwrap().replacen("[sensor.voltage_v]", &format!("{extra}\n[sensor.voltage_v]"), 1);
        let read = |table: &str| Ok(energy::built_in(table).unwrap().to_owned());
        PackBody::new(Arc::new(Model::parse("pack", &text, &read).unwrap()), Start { temperature_degc, ..Start::at_soc(soc) }, 1)
    }

    #[test]
    fn a_pack_below_freezing_takes_no_charge_but_gives_power() {
        let mut cold = body("", 0.5, -5.0);
        cold.step(1.0, CHARGE).unwrap();
        assert_eq!(cold.truth(Channel::TerminalCurrentA), 0.0);
        assert!(cold.step(1.0, Task::Power(3.0)).is_ok());
        let mut warm = body("", 0.5, 20.0);
        warm.step(1.0, CHARGE).unwrap();
        assert_eq!(warm.truth(Channel::TerminalCurrentA), -1.32);
    }

    #[test]
    fn a_cell_above_its_highest_voltage_stops_the_charge_until_it_is_back() {
        // The third cell is 15 % ahead of the others: full long before the pack.
        let ahead = "[[battery.cell]]\nseries = 1\nsoc_offset = -0.15\n[[battery.cell]]\nseries = 2\nsoc_offset = -0.15";
        let mut body = body(ahead, 0.9, 25.0);
        let mut stopped_s = 0;
        for _ in 0..3600 {
            body.step(1.0, CHARGE).unwrap();
            stopped_s += u32::from(body.protection().allowed().charge.is_err());
            // 4.3 V, and two seconds more.
            assert!(body.truth(Channel::CellMaxV) < 4.32, "{}", body.truth(Channel::CellMaxV));
        }
        assert!(stopped_s > 0);
    }

    #[test]
    fn a_weak_cell_ends_what_the_pack_gives() {
        let lasts_s = |extra: &str| {
            let mut body = body(extra, 1.0, 25.0);
            (0..).find(|_| body.step(10.0, Task::Power(4.0)).is_err()).unwrap() * 10
        };
        let (like_s, weak_s) = (lasts_s(""), lasts_s("[[battery.cell]]\nseries = 2\ncapacity_factor = 0.8"));
        let share = f64::from(weak_s) / f64::from(like_s);
        // 80 % of the charge at a somewhat higher mean voltage.
        assert!((0.79..0.84).contains(&share), "{share}");
    }
}
