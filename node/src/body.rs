//! A simulated pack behind a simulated gauge IC: what an agent's source steps when there is no
//! real pack. The truth is the energy model; only the readings are noisy.

use std::sync::Arc;

use energy::gauge::Sample;
use energy::load::{CannotDeliver, Terminals as _};
use energy::{Channel, Estimate, Model, Run, Start};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// The channels that a gauge IC reads.
const SENSED: [Channel; 3] = [Channel::CurrentA, Channel::VoltageV, Channel::TemperatureDegc];

/// A pack, its true state, and the specimen of gauge IC that watches it.
#[derive(Clone)]
pub struct PackBody {
    run: Run<f64>,
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
    pub fn new(model: Arc<Model>, soc: f64, temperature_degc: f64, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let [offset, gain] = [0, 1].map(|_| [0, 1, 2].map(|_| StandardNormal.sample(&mut rng)));
        let run = Run::new(model, Start { temperature_degc, ..Start::at_soc(soc) });
        Self { run, rng, offset, gain }
    }

    /// The true value of a channel at the end of the last step.
    #[must_use]
    pub fn truth(&self, channel: Channel) -> f64 {
        self.run.channels[channel]
    }

    /// The pack's model.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        self.run.model()
    }

    /// Puts in another pack of the same kind.
    pub fn exchange(&mut self, soc: f64) {
        let temperature_degc = self.truth(Channel::AmbientDegc);
        self.run.restart(Start { temperature_degc, ..Start::at_soc(soc) });
    }

    /// Steps the pack and reads its sensors.
    ///
    /// # Errors
    /// [`CannotDeliver`] when the power cannot be had or the pack would fall below its end of
    /// discharge: the protection opens, and the step is one of rest.
    pub fn step(&mut self, dt_s: f64, task: Task) -> Result<Sample, CannotDeliver> {
        let facts = self.run.model().battery();
        let (eod_v, full_v, charge) = (facts.eod_v(), facts.full_v(), facts.charge);
        let failed = match task {
            Task::Power(power_w) => {
                let before = self.run.clone();
                let under = self.run.step_power(power_w, dt_s).is_err() || self.truth(Channel::VoltageV) < eod_v;
                if under {
                    self.run = before;
                }
                under.then_some(CannotDeliver { power_w })
            }
            Task::Charge { current_a_max } => {
                self.run.step_charge(charge.current_a.min(current_a_max), full_v, dt_s);
                None
            }
            Task::Rest => {
                self.run.channels[Channel::CurrentA] = 0.0;
                self.run.step(dt_s);
                None
            }
        };
        if let Some(error) = failed {
            self.run.channels[Channel::CurrentA] = 0.0;
            self.run.step(dt_s);
            return Err(error);
        }
        Ok(self.sample(dt_s))
    }

    /// Reads the sensors once, as after a step of `dt_s`.
    pub fn sample(&mut self, dt_s: f64) -> Sample {
        let model = Arc::clone(self.run.model());
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
        let sigma = self.run.model().uncertainty.soc_initial_sigma;
        let noise: f64 = StandardNormal.sample(&mut self.rng);
        Estimate::new((self.truth(Channel::Soc) + sigma * noise).clamp(0.0, 1.0), sigma)
    }
}
