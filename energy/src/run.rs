//! A model in motion: its channels, its states and the step.

use std::sync::Arc;

use crate::effect::{Lane, Own, Phase};
use crate::model::{Model, Placed};
use crate::power::Flow;
use crate::step::{self, Parts};
use crate::system::Facts;
use crate::units::REFERENCE_DEGC;
use crate::{Channel, Channels};

/// Where a run begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start<S = f64> {
    /// State of charge, for a battery.
    pub soc: S,
    /// Temperature of battery and surroundings, °C.
    pub temperature_degc: f64,
    /// Full cycles so far, for a battery.
    pub cycle_count: f64,
    /// Days since the battery was made.
    pub age_days: f64,
    /// How the battery came to this charge: 1 by discharge, -1 by charge, between them after both
    /// or when it is not known.
    pub history: f64,
    /// What the clock of formulas (`time_s`) shows then, s.
    pub clock_s: f64,
}

impl Start<f64> {
    /// A new battery at this state of charge and the reference temperature.
    #[must_use]
    pub fn at_soc(soc: f64) -> Self {
        Self { soc, temperature_degc: REFERENCE_DEGC, cycle_count: 0.0, age_days: 0.0, history: 0.0, clock_s: 0.0 }
    }

    /// The same start, as plain or dual numbers.
    #[must_use]
    pub fn lifted<S: From<f64>>(self) -> Start<S> {
        Start {
            soc: S::from(self.soc),
            temperature_degc: self.temperature_degc,
            cycle_count: self.cycle_count,
            age_days: self.age_days,
            history: self.history,
            clock_s: self.clock_s,
        }
    }
}

/// A model with the values of its parameters, states and channels.
///
/// Set the input channels, call [`Run::step`], read the output channels. Inputs hold over the
/// step; outputs are those at its end. A step allocates nothing.
#[derive(Clone)]
pub struct Run<S: Lane> {
    model: Arc<Model>,
    parameters: Vec<S>,
    prepared: Prepared<S>,
    states: Vec<S>,
    saved: (Vec<S>, Channels<S>),
    /// The value of every channel.
    pub channels: Channels<S>,
}

impl Run<f64> {
    /// Starts with the model's own parameter values.
    #[must_use]
    pub fn new(model: Arc<Model>, start: Start) -> Self {
        let parameters = model.values();
        Run::with_parameters(model, parameters, start)
    }
}

impl<S: Lane> Run<S> {
    /// Starts with the given parameter values, in the order of [`Model::parameters`].
    ///
    /// # Panics
    /// When there are not as many values as the model has parameters.
    #[must_use]
    pub fn with_parameters(model: Arc<Model>, parameters: Vec<S>, start: Start<S>) -> Self {
        assert_eq!(parameters.len(), model.parameters().len(), "one value per parameter of {}", model.name);
        let zero = S::from(0.0);
        let (states, channels) = (vec![zero; model.state_count()], Channels::filled(zero));
        let prepared = Prepared::new(&model);
        let mut run = Run { saved: (states.clone(), channels), model, parameters, prepared, states, channels };
        run.restart(start);
        run
    }

    /// Values of its parameters.
    pub(crate) fn parameters(&self) -> &[S] {
        &self.parameters
    }

    /// Puts the run back to a start, keeping its parameters.
    pub fn restart(&mut self, start: Start<S>) {
        self.channels = Channels::filled(S::from(0.0));
        begin(&self.model, &self.parameters, &mut self.states, &mut self.channels, start);
    }

    /// Takes other parameter values, in the order of [`Model::parameters`]; states stay.
    pub fn set_parameters(&mut self, parameters: &[S]) {
        self.parameters.copy_from_slice(parameters);
        self.prepared.forget();
    }

    /// The model that runs.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// All states: first what the system keeps (a battery its state of charge, a robot the power
    /// that effects asked of each rail, W), then those of the effects in order of evaluation.
    #[must_use]
    pub fn states(&self) -> &[S] {
        &self.states
    }

    /// All states, to be changed: an estimator corrects them.
    pub fn states_mut(&mut self) -> &mut [S] {
        &mut self.states
    }

    /// Advances by `dt_s` seconds (> 0).
    #[inline]
    pub fn step(&mut self, dt_s: f64) {
        self.step_observed(dt_s, |_, _, _| {});
    }

    /// Advances like [`Run::step`] and says what each effect added to its own channel, as
    /// `(effect id, share)` in order of evaluation; last, where there are rails, what these add
    /// with their own loads and losses. On the power channels of robot and station
    /// the shares sum to what the step adds to its input.
    pub fn step_explained(&mut self, dt_s: f64) -> Vec<(&'static str, f64)> {
        let mut shares = Vec::with_capacity(self.model.placed().len());
        self.step_observed(dt_s, |placed, before, after| shares.push((placed.effect.spec().id, after.re() - before.re())));
        if let Some(flow) = self.rails() {
            // What the rails take beyond the effects that hang on them: their own loads and losses.
            let asked_w: f64 = self.states[..flow.rails().len()].iter().map(S::re).sum();
            shares.push(("rails", flow.battery_w.re() - asked_w));
        }
        shares
    }

    /// The rails of a robot at the channels and the effects' demand of the last step: voltages,
    /// currents and losses, and which rail cannot deliver. None without rails.
    #[must_use]
    pub fn rails(&self) -> Option<Flow<S>> {
        let tree = self.model.facts.tree()?;
        let now = &self.channels;
        let asked_w = &self.states[..tree.rails().len()];
        Some(tree.flow(self.model.facts.supply_v(now), now[Channel::AmbientDegc], |channel| now[channel], asked_w))
    }

    /// Keeps states and channels, so that [`Run::restore`] can take trial steps back.
    pub fn save(&mut self) {
        self.saved.0.copy_from_slice(&self.states);
        self.saved.1 = self.channels;
    }

    /// Takes back every step since [`Run::save`].
    pub fn restore(&mut self) {
        self.states.copy_from_slice(&self.saved.0);
        self.channels = self.saved.1;
    }

    /// Steps what lies around a battery's cells: sensors and connection. `cells` goes from the
    /// current at the terminals to the voltage of all cells, in the channels it is given.
    pub(crate) fn step_around(&mut self, warms: bool, dt_s: f64, cells: impl FnOnce(&mut [S], &mut Channels<S>)) {
        let Run { model, parameters, prepared, states, channels, .. } = self;
        let prepared = prepared.of(dt_s, |prepared, known| prepare(model, dt_s, parameters, prepared, known));
        let mut parts = Lone { model, dt_s, parameters, prepared, states, channels, observe: |_: &Placed, _, _| {} };
        step::sensed(warms, &mut parts);
        step::drawn(model.facts.parallel(), &mut parts);
        cells(parts.states, parts.channels);
        step::terminals(warms, &mut parts);
    }

    #[inline]
    fn step_observed(&mut self, dt_s: f64, observe: impl FnMut(&Placed, S, S)) {
        let Run { model, parameters, prepared, states, channels, .. } = self;
        let prepared = prepared.of(dt_s, |prepared, known| prepare(model, dt_s, parameters, prepared, known));
        step::step(model, dt_s, &mut Lone { model, dt_s, parameters, prepared, states, channels, observe });
    }
}

/// What effects prepared for steps of several lengths: a log takes the same few lengths over and over, and exponentials
/// are dear.
#[derive(Clone)]
struct Prepared<S> {
    /// One behind the other for each length.
    numbers: Vec<S>,
    /// How many there are for a length.
    count: usize,
    /// The lengths, s; NaN where there is none yet.
    lengths_s: [f64; LENGTHS],
    /// The length of the last step among them, and the one that gives way to a new one.
    last: usize,
    oldest: usize,
}

/// Lengths of steps that are kept.
const LENGTHS: usize = 32;
/// Share by which lengths differ that are one: clocks jitter, and differences of times are rounded. What decays over a step is
/// off by less than this share over e, which is 4 uV of an overpotential of 100 mV.
const ONE_LENGTH: f64 = 1e-4;

impl<S: Lane> Prepared<S> {
    fn new(model: &Model) -> Self {
        let count = model.prepared_count();
        Self { numbers: vec![S::from(0.0); LENGTHS * count], count, lengths_s: [f64::NAN; LENGTHS], last: 0, oldest: 0 }
    }

    /// Parameters have changed.
    fn forget(&mut self) {
        self.lengths_s = [f64::NAN; LENGTHS];
    }

    /// The numbers for steps of this length.
    #[inline(always)]
    fn of(&mut self, dt_s: f64, prepare: impl FnOnce(&mut [S], Known)) -> &[S] {
        if self.count == 0 {
            return &[];
        }
        let one = |known: f64| (known - dt_s).abs() <= ONE_LENGTH * dt_s;
        if !one(self.lengths_s[self.last]) {
            match self.lengths_s.iter().position(|&known| one(known)) {
                Some(known) => self.last = known,
                None => {
                    let before = self.last * self.count;
                    let known = if self.lengths_s[self.last].is_nan() { Known::Nothing } else { Known::AnotherLength };
                    self.last = self.oldest;
                    self.oldest = (self.oldest + 1) % LENGTHS;
                    self.lengths_s[self.last] = dt_s;
                    let own = self.last * self.count;
                    self.numbers.copy_within(before..before + self.count, own);
                    prepare(&mut self.numbers[own..own + self.count], known);
                }
            }
        }
        &self.numbers[self.last * self.count..(self.last + 1) * self.count]
    }
}

/// Sets states and channels of one run to its start.
pub(crate) fn begin<S: Lane>(model: &Model, parameters: &[S], states: &mut [S], channels: &mut Channels<S>, start: Start<S>) {
    states.fill(S::from(0.0));
    channels[Channel::Soc] = start.soc;
    for channel in [Channel::TemperatureDegc, Channel::AmbientDegc, Channel::CellDegc] {
        channels[channel] = S::from(start.temperature_degc);
    }
    let before = if let Facts::Battery(facts) = &model.facts { facts.cycle_count } else { 0.0 };
    channels[Channel::CycleCount] = S::from(start.cycle_count + before);
    channels[Channel::AgeDays] = S::from(start.age_days);
    channels[Channel::History] = S::from(start.history.clamp(-1.0, 1.0));
    if let Facts::Battery(facts) = &model.facts {
        states[0] = start.soc;
        channels[Channel::OcvV] = facts.ocv.voltage_v(start.soc);
        for channel in [Channel::CellVoltageV, Channel::CellMinV, Channel::CellMaxV] {
            channels[channel] = channels[Channel::OcvV];
        }
        for channel in [Channel::VoltageV, Channel::TerminalVoltageV] {
            channels[channel] = channels[Channel::OcvV] * f64::from(facts.series);
        }
    }
    for placed in model.placed() {
        let own = &mut states[placed.states.clone()];
        S::of(placed).start(&model.facts, &parameters[placed.parameters.clone()], own, channels);
        if placed.effect.spec().tells_time()
            && let Some(clock) = own.last_mut()
        {
            *clock = S::from(start.clock_s);
        }
    }
}

/// What is prepared for these parameters already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Known {
    Nothing,
    /// Numbers for steps of another length.
    AnotherLength,
}

/// Lets every effect prepare for steps of this length.
pub(crate) fn prepare<S: Lane>(model: &Model, dt_s: f64, parameters: &[S], prepared: &mut [S], known: Known) {
    for placed in model.placed() {
        let (effect, own) = (S::of(placed), &mut prepared[placed.prepared.clone()]);
        let parameters = &parameters[placed.parameters.clone()];
        match known {
            Known::Nothing => effect.prepare(&model.facts, dt_s, parameters, own),
            Known::AnotherLength => effect.prepare_length(&model.facts, dt_s, parameters, own),
        }
    }
}

/// The parts of one run, for a step.
struct Lone<'a, S, F> {
    model: &'a Model,
    dt_s: f64,
    parameters: &'a [S],
    prepared: &'a [S],
    states: &'a mut [S],
    channels: &'a mut Channels<S>,
    observe: F,
}

impl<S: Lane, F: FnMut(&Placed, S, S)> Parts<S> for Lone<'_, S, F> {
    #[inline(always)]
    fn act(&mut self, phase: Phase) {
        self.act_among(self.model.placed_in(phase));
    }

    #[inline(always)]
    fn act_among(&mut self, placed: &[Placed]) {
        for placed in placed {
            let before = self.channels[placed.channel];
            let own = Own {
                parameters: &self.parameters[placed.parameters.clone()],
                prepared: &self.prepared[placed.prepared.clone()],
                states: &mut self.states[placed.states.clone()],
            };
            S::of(placed).step(&self.model.facts, self.dt_s, own, self.channels);
            (self.observe)(placed, before, self.channels[placed.channel]);
        }
    }

    #[inline(always)]
    fn each(&mut self, between: impl Fn(&mut [S], &mut Channels<S>)) {
        between(self.states, self.channels);
    }
}

#[cfg(test)]
mod tests {
    use super::Start;
    use crate::Channel;
    use crate::effect::cell;

    /// Of every step one less and one more than the bound apart, against the law of one RC pair.
    #[test]
    fn steps_of_a_clock_that_jitters_decay_as_they_should() {
        let (resistance_ohm, tau_s, current_a) = (0.05, 10.0, 2.0);
        let mut run = cell(1, &[("rc1", &[("resistance_ohm", resistance_ohm), ("tau_s", tau_s)])], Start::at_soc(0.9));
        let mut expected_v = 0.0;
        for step in 0..1000 {
            let (beat_s, share) = ([1.0, 20.0, 0.1][step % 3], [0.0, 0.9e-4, -0.9e-4, 5e-4][step / 3 % 4]);
            let dt_s = beat_s * (1.0 + share);
            run.channels[Channel::CurrentA] = if step % 50 < 25 { current_a } else { 0.0 };
            let settled_v = resistance_ohm * run.channels[Channel::CurrentA];
            expected_v = settled_v + (expected_v - settled_v) * (-dt_s / tau_s).exp();
            run.step(dt_s);
            let found_v = run.channels[Channel::OverpotentialV];
            // 4 uV of 100 mV.
            assert!((found_v - expected_v).abs() < 4e-6, "{found_v} {expected_v} V");
        }
    }
}
