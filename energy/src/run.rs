//! A model in motion: its channels, its states and the step.

use std::sync::Arc;

use crate::effect::{Lane, Phase};
use crate::model::{Model, Placed};
use crate::system::{BatteryFacts, Facts, System};
use crate::units::{REFERENCE_DEGC, S_PER_H};
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
}

impl Start<f64> {
    /// A new battery at this state of charge and the reference temperature.
    #[must_use]
    pub fn at_soc(soc: f64) -> Self {
        Self { soc, temperature_degc: REFERENCE_DEGC, cycle_count: 0.0 }
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
    states: Vec<S>,
    saved: Vec<S>,
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
        let states = vec![S::from(0.0); model.state_count()];
        let mut run = Run { saved: states.clone(), model, parameters, states, channels: Channels::filled(S::from(0.0)) };
        run.restart(start);
        run
    }

    /// Puts the run back to a start, keeping its parameters.
    pub fn restart(&mut self, start: Start<S>) {
        self.states.fill(S::from(0.0));
        self.channels = Channels::filled(S::from(0.0));
        self.channels[Channel::Soc] = start.soc;
        self.channels[Channel::TemperatureDegc] = S::from(start.temperature_degc);
        self.channels[Channel::AmbientDegc] = S::from(start.temperature_degc);
        self.channels[Channel::CycleCount] = S::from(start.cycle_count);
        let model = Arc::clone(&self.model);
        if let Facts::Battery(facts) = &model.facts {
            self.states[0] = start.soc;
            self.channels[Channel::VoltageV] = facts.ocv.voltage_v(start.soc) * f64::from(facts.series);
        }
        for placed in model.placed() {
            let (parameters, states) = (&self.parameters[placed.parameters.clone()], &mut self.states[placed.states.clone()]);
            S::start(placed.effect, &model.facts, parameters, states, &self.channels);
        }
    }

    /// The model that runs.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Advances by `dt_s` seconds (> 0).
    #[inline]
    pub fn step(&mut self, dt_s: f64) {
        self.step_observed(dt_s, |_, _, _| {});
    }

    /// Advances like [`Run::step`] and says what each effect added to its own channel, as
    /// `(effect id, share)` in order of evaluation. On the power channels of robot and station
    /// the shares sum to what the step adds to its input.
    pub fn step_explained(&mut self, dt_s: f64) -> Vec<(&'static str, f64)> {
        let mut shares = Vec::with_capacity(self.model.placed().len());
        self.step_observed(dt_s, |placed, before, after| shares.push((placed.effect.spec().id, after.re() - before.re())));
        shares
    }

    /// Keeps the states, so that [`Run::restore`] can take a trial step back.
    pub fn save(&mut self) {
        self.saved.copy_from_slice(&self.states);
    }

    /// Takes back every step since [`Run::save`]. Channels keep the values of the last step.
    pub fn restore(&mut self) {
        self.states.copy_from_slice(&self.saved);
        if self.model.system == System::Battery {
            self.channels[Channel::Soc] = self.states[0];
        }
    }

    #[inline]
    fn step_observed(&mut self, dt_s: f64, mut observe: impl FnMut(&Placed, S, S)) {
        let model = Arc::clone(&self.model);
        match &model.facts {
            Facts::Battery(facts) => self.step_battery(&model, facts, dt_s, &mut observe),
            Facts::Robot => {
                self.channels[Channel::PowerW] = S::from(0.0);
                self.effects(&model, 0..model.placed().len(), dt_s, &mut observe);
            }
            Facts::Station => {
                self.channels[Channel::PackPowerW] = self.channels[Channel::ChargePowerW];
                self.effects(&model, 0..model.placed().len(), dt_s, &mut observe);
            }
        }
    }

    fn step_battery(&mut self, model: &Model, facts: &BatteryFacts, dt_s: f64, observe: &mut impl FnMut(&Placed, S, S)) {
        let parallel = f64::from(facts.parallel);
        self.channels[Channel::Soc] = self.states[0];
        self.channels[Channel::CapacityAh] = S::from(facts.capacity_ah);
        self.channels[Channel::CellCurrentA] = self.channels[Channel::CurrentA] / parallel;
        self.effects(model, model.placed_in(Phase::Capacity), dt_s, observe);
        self.effects(model, model.placed_in(Phase::Current), dt_s, observe);

        // Charge: the cell's current over the cell's capacity, exact for a held current.
        let cell_capacity_ah = self.channels[Channel::CapacityAh] / parallel;
        self.states[0] -= self.channels[Channel::CellCurrentA] / cell_capacity_ah * (dt_s / S_PER_H);
        self.channels[Channel::Soc] = self.states[0];

        let ocv_v = facts.ocv.voltage_v(self.states[0]);
        self.channels[Channel::OcvV] = ocv_v;
        self.channels[Channel::OverpotentialV] = S::from(0.0);
        self.effects(model, model.placed_in(Phase::Voltage), dt_s, observe);
        let overpotential_v = self.channels[Channel::OverpotentialV];
        let voltage_v = (ocv_v - overpotential_v) * f64::from(facts.series);
        self.channels[Channel::VoltageV] = voltage_v;
        self.channels[Channel::PowerW] = voltage_v * self.channels[Channel::CurrentA];

        self.channels[Channel::HeatW] = overpotential_v * self.channels[Channel::CellCurrentA];
        self.effects(model, model.placed_in(Phase::Heat), dt_s, observe);
    }

    #[inline]
    fn effects(&mut self, model: &Model, which: std::ops::Range<usize>, dt_s: f64, observe: &mut impl FnMut(&Placed, S, S)) {
        for placed in &model.placed()[which] {
            let channel = placed.effect.spec().channel;
            let before = self.channels[channel];
            let (parameters, states) = (&self.parameters[placed.parameters.clone()], &mut self.states[placed.states.clone()]);
            S::step(placed.effect, &model.facts, dt_s, parameters, states, &mut self.channels);
            observe(placed, before, self.channels[channel]);
        }
    }
}
