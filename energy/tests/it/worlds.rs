//! Worlds to try gauges in: packs and sensors drawn from what their models say they do not know.
//!
//! A world draws every parameter within its sigma, the capacity, smooth errors of the OCV table and
//! of the resistance's shape, a specimen of each sensor, a mission of drives, rests and recharges,
//! and what the gauge is told of the state of charge at the start. The gauges are given the model as
//! it stands.

use std::sync::Arc;

use energy::gauge::Sample;
use energy::load::Terminals as _;
use energy::{Channel, Estimate, Facts, Model, OcvTable, Run, Start, built_in, forecast};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal, StudentT};
use rand_pcg::Pcg64Mcg;

/// Length of a step, s.
const DT_S: f64 = 5.0;
/// Time constant of the mean power that energy is asked at, as gauges take it, s.
const POWER_TAU_S: f64 = 60.0;
/// Waves that a random function of state of charge is made of.
const WAVES: usize = 60;

/// What the gauges are told about the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Told {
    /// Within the model's `soc_initial_sigma`.
    Remembered,
    /// Within this.
    Within(f64),
}

/// The packs that worlds are made of, by name: the two built-in ones, and one with a polarisation
/// pair, whose voltage relaxes at rest.
pub fn model(name: &str) -> Model {
    let read = |table: &str| built_in(table).map(str::to_owned).ok_or_else(|| "not built in".to_owned());
    match name.strip_suffix("+rc") {
        None => Model::parse(name, built_in(name).unwrap(), &read).unwrap(),
        Some(base) => {
            let pair = "\n[[effect]]\nid = \"rc1\"\nresistance_ohm = { value = 0.03, sigma = 0.006, source = \"guess\" }\ntau_s = { value = 60.0, sigma = 12.0, source = \"guess\" }\n";
            Model::parse(name, &format!("{}{pair}", built_in(base).unwrap()), &read).unwrap()
        }
    }
}

/// What is true at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Truth {
    pub soc: f64,
    pub remaining_wh: f64,
    /// None while the pack is not drained.
    pub time_to_empty_s: Option<f64>,
    pub full_wh: f64,
    pub soh: f64,
    /// Whether the pack has rested long enough for a gauge to have seen it.
    pub rested: bool,
}

pub struct World {
    rng: Pcg64Mcg,
    truth: Run<f64>,
    values: Vec<f64>,
    capacity: f64,
    stored_wh: f64,
    offset: [f64; 3],
    gain: [f64; 3],
    left_out: LeftOut,
    believed: Arc<Model>,
    task: Task,
    left_s: f64,
    power_w: f64,
    seen_s: f64,
    rested_s: f64,
    rested: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Task {
    Drive { mean_w: f64, swing_w: f64, period_s: f64 },
    Rest,
    Charge { to: f64 },
}

/// Resistance that the model's shape leaves out, of the whole pack, over state of charge.
struct LeftOut {
    sigma_ohm: f64,
    shape: Smooth,
}

impl LeftOut {
    fn ohm(&self, soc: f64) -> f64 {
        self.shape.at(soc) * self.sigma_ohm
    }
}

/// Resistance of a pack by its model in the middle of its charge, ohm: a minute at 0.3C.
fn resistance_ohm(model: &Arc<Model>) -> f64 {
    let mut run = Run::new(Arc::clone(model), Start::at_soc(0.3));
    let current_a = 0.3 * model.battery().capacity_ah;
    run.channels[Channel::CurrentA] = current_a;
    run.step(60.0);
    (run.channels[Channel::OcvV] * f64::from(model.battery().series) - run.channels[Channel::VoltageV]) / current_a
}

impl World {
    pub fn new(believed: &Arc<Model>, name: &str, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut true_model = model(name);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let capacity = 1.0 + believed.uncertainty.capacity_relative_sigma * normal();
        let values: Vec<f64> = true_model.parameters().iter().map(|p| (p.value + p.sigma * normal()).clamp(p.min, p.max)).collect();
        let stored_wh = true_model.battery().stored_wh();
        let (offset, gain) = ([normal(), normal(), normal()], [normal(), normal(), normal()]);
        let length = believed.uncertainty.ocv_length_soc;
        let table_error = Smooth::draw(length, &mut rng);
        let left_out = LeftOut {
            sigma_ohm: believed.uncertainty.resistance_relative_sigma * resistance_ohm(believed),
            shape: Smooth::draw(length, &mut rng),
        };
        if let Facts::Battery(facts) = &mut true_model.facts {
            facts.capacity_ah *= capacity;
            facts.ocv = perturbed(&facts.ocv, believed.uncertainty.ocv_sigma_v, &table_error);
        }
        let soc = rng.random_range(0.35..0.98);
        let truth = Run::with_parameters(Arc::new(true_model), values.clone(), Start::at_soc(soc));
        let mut world = Self {
            rng,
            truth,
            values,
            capacity,
            stored_wh,
            offset,
            gain,
            left_out,
            believed: Arc::clone(believed),
            task: Task::Rest,
            left_s: 0.0,
            power_w: 0.0,
            seen_s: 0.0,
            rested_s: 0.0,
            rested: false,
        };
        world.choose();
        world
    }

    /// What a gauge is told of the state of charge.
    pub fn told(&mut self, told: Told) -> Estimate {
        let sigma = match told {
            Told::Remembered => self.believed.uncertainty.soc_initial_sigma,
            Told::Within(sigma) => sigma,
        };
        let noise: f64 = StandardNormal.sample(&mut self.rng);
        Estimate::new(self.truth.channels[Channel::Soc] + sigma * noise, sigma)
    }

    fn choose(&mut self) {
        let soc = self.truth.channels[Channel::Soc];
        let rng = &mut self.rng;
        let was_resting = self.task == Task::Rest;
        let dice: f64 = rng.random();
        (self.task, self.left_s) = if soc < 0.12 || (soc < 0.3 && dice < 0.5) {
            (Task::Charge { to: rng.random_range(0.6..0.99) }, 3.0 * 3600.0)
        } else if was_resting || dice < 0.55 {
            let mean_w = rng.random_range(0.1..0.6) * self.stored_wh;
            let swing_w = if rng.random() { 0.0 } else { rng.random_range(0.1..0.6) * mean_w };
            (Task::Drive { mean_w, swing_w, period_s: rng.random_range(20.0..600.0) }, rng.random_range(600.0..5400.0))
        } else {
            (Task::Rest, rng.random_range(1200.0..4000.0))
        };
    }

    /// Steps the truth and reads the sensors.
    pub fn step(&mut self) -> Sample {
        let facts = self.truth.model().battery().clone();
        let load = match self.task {
            Task::Drive { mean_w, swing_w, period_s } => {
                let wave = if (self.left_s / period_s).fract() < 0.5 { 1.0 } else { -1.0 };
                mean_w + swing_w * wave
            }
            _ => 0.0,
        };
        match self.task {
            Task::Charge { to } => {
                self.truth.step_charge(facts.charge.current_a, facts.full_v(), DT_S);
                if self.truth.channels[Channel::Soc] >= to || -self.truth.channels[Channel::CurrentA] < facts.charge.cutoff_a {
                    self.left_s = 0.0;
                }
            }
            _ => {
                if self.truth.step_power(load, DT_S).is_err() {
                    self.truth.step_power(0.0, DT_S).unwrap();
                    self.left_s = 0.0;
                }
            }
        }
        // What the model's shape leaves out of the resistance lies between its cells and the terminals.
        let current_a = self.truth.channels[Channel::CurrentA];
        let more_v = self.left_out.ohm(self.truth.channels[Channel::Soc]) * current_a;
        let keep = (-DT_S / POWER_TAU_S).exp();
        let all = |seen_s: f64| 1.0 - (-seen_s / POWER_TAU_S).exp();
        let now_w = self.truth.channels[Channel::PowerW] - more_v * current_a;
        self.power_w = (keep * all(self.seen_s) * self.power_w + (1.0 - keep) * now_w) / all(self.seen_s + DT_S);
        self.seen_s += DT_S;
        self.rested_s = if self.truth.channels[Channel::CurrentA].abs() < 1e-9 { self.rested_s + DT_S } else { 0.0 };
        self.rested |= self.rested_s > 900.0;
        self.left_s -= DT_S;
        if self.left_s <= 0.0 || self.truth.channels[Channel::Soc] < 0.05 {
            self.choose();
        }
        let mut shown = [0.0; 3];
        for (index, channel) in [Channel::CurrentA, Channel::VoltageV, Channel::TemperatureDegc].into_iter().enumerate() {
            let noise = StandardNormal.sample(&mut self.rng);
            let value = self.truth.channels[channel] - if channel == Channel::VoltageV { more_v } else { 0.0 };
            shown[index] = self.believed.sensor(channel).shows(value, noise, self.offset[index], self.gain[index]);
        }
        Sample { dt_s: DT_S, current_a: shown[0], voltage_v: shown[1], temperature_degc: shown[2] }
    }

    pub fn truth(&self) -> Truth {
        let drawn_w = self.power_w.max(0.0);
        let soc = self.truth.channels[Channel::Soc];
        let from = |soc: f64| {
            let start = Start { temperature_degc: self.truth.channels[Channel::TemperatureDegc], ..Start::at_soc(soc) };
            let mut run = Run::with_parameters(Arc::clone(self.truth.model()), self.values.clone(), start);
            forecast::discharge_behind(&mut run, drawn_w, |soc| self.left_out.ohm(soc)).energy_wh
        };
        let remaining_wh = from(soc);
        Truth {
            soc,
            remaining_wh,
            full_wh: from(1.0),
            time_to_empty_s: (drawn_w > 0.03 * self.stored_wh).then(|| remaining_wh * 3600.0 / drawn_w),
            soh: self.capacity,
            rested: self.rested,
        }
    }
}

/// A smooth random function of state of charge with a deviation of 1: a sum of waves (wave number,
/// cosine, sine). Wave numbers drawn from Student's distribution with three degrees of freedom make
/// it a Gaussian process with the Matern 3/2 covariance that [`energy::Uncertainty`] speaks of.
struct Smooth(Vec<(f64, f64, f64)>);

impl Smooth {
    fn draw(length: f64, rng: &mut Pcg64Mcg) -> Self {
        let student = StudentT::new(3.0).expect("three degrees of freedom");
        Self((0..WAVES).map(|_| (student.sample(rng) / length, StandardNormal.sample(rng), StandardNormal.sample(rng))).collect())
    }

    fn at(&self, soc: f64) -> f64 {
        let share = 1.0 / (self.0.len() as f64).sqrt();
        self.0.iter().map(|(k, a, b)| share * (a * (k * soc).cos() + b * (k * soc).sin())).sum()
    }
}

/// The table with a smooth random error.
fn perturbed(table: &OcvTable, sigma_v: f64, error: &Smooth) -> OcvTable {
    let (soc, voltage_v) = table.points();
    let mut least_v = 0.0_f64;
    let moved = soc.iter().zip(voltage_v).map(|(&s, &v)| {
        least_v = least_v.max(v + sigma_v * error.at(s));
        least_v
    });
    OcvTable::new(soc.to_vec(), moved.collect()).unwrap()
}
