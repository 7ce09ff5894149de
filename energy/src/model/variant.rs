//! Models made from models: with an effect more or less, on other facts, at other values.

use super::{Model, Parameter, file};
use crate::Estimate;
use crate::effect::expression::{Definition, Expression};
use crate::effect::{Effect, EffectSpec, find};
use crate::system::Facts;

impl Model {
    /// The same model without some of its effects.
    #[must_use]
    pub fn without(&self, leave_out: impl Fn(&str) -> bool) -> Model {
        let kept = self.placed.iter().filter(|placed| !leave_out(placed.effect.spec().id));
        let effects = kept.map(|placed| (placed.effect, self.parameters[placed.parameters.clone()].to_vec()));
        let (sensors, facts) = (self.sensors.clone(), self.facts.clone());
        Model::assemble(self.name.clone(), self.system, facts, sensors, self.uncertainty, effects.collect())
            .expect("no effect appears twice")
    }

    /// The same model with one more effect of the catalogue, its parameters at their defaults and
    /// free to be fitted; the others keep their values and their order.
    ///
    /// # Errors
    /// When the system has no such effect or the model has it already.
    pub fn with(&self, id: &str) -> Result<Model, String> {
        let (_, effect) = find(self.system, id).ok_or_else(|| format!("a {} has no effect `{id}`", self.system.name()))?;
        self.with_effect(effect)
    }

    /// The same model with a formula as one more effect, its parameters free to be fitted.
    ///
    /// # Errors
    /// Says what is wrong with the definition, or that the model has an effect of that name.
    pub fn with_expression(&self, definition: &Definition) -> Result<Model, String> {
        self.with_effect(Expression::new(self.system, &self.facts, definition).map_err(|error| error.message)?)
    }

    fn with_effect(&self, effect: &'static dyn Effect) -> Result<Model, String> {
        let spec = effect.spec();
        let own = spec.parameters.iter().map(|p| Parameter { free: true, ..file::default_parameter(spec.id, p) });
        let mut effects = vec![(effect, own.collect())];
        for placed in &self.placed {
            effects.push((placed.effect, self.parameters[placed.parameters.clone()].to_vec()));
        }
        let (sensors, facts) = (self.sensors.clone(), self.facts.clone());
        Model::assemble(self.name.clone(), self.system, facts, sensors, self.uncertainty, effects)
    }

    /// The same model with other values of its parameters, in the order of [`Model::parameters`].
    ///
    /// # Panics
    /// When there are not as many values as parameters.
    #[must_use]
    pub fn with_values(mut self, values: &[f64]) -> Model {
        assert_eq!(values.len(), self.parameters.len(), "one value per parameter of {}", self.name);
        self.parameters.iter_mut().zip(values).for_each(|(parameter, &value)| parameter.value = value);
        self
    }

    /// The battery of this model as one of its kind is after use: with that share of the charge that the model gives it (above 0), as
    /// certain as that is, and after so many full cycles more.
    ///
    /// # Panics
    /// When the model is not of a battery.
    #[must_use]
    pub fn worn(&self, capacity: Estimate, cycle_count: f64) -> Model {
        let mut model = self.clone();
        let Facts::Battery(facts) = &mut model.facts else { panic!("`{}` is not the model of a battery", self.name) };
        facts.capacity_ah *= capacity.value;
        facts.cycle_count += cycle_count;
        model.uncertainty.capacity_relative_sigma = capacity.sigma / capacity.value;
        model
    }

    /// The same model with nothing to be fitted.
    #[must_use]
    pub fn held(mut self) -> Model {
        self.parameters.iter_mut().for_each(|parameter| parameter.free = false);
        self
    }

    /// The same model with these to be fitted as well.
    #[must_use]
    pub fn freed(mut self, wanted: impl Fn(&Parameter) -> bool) -> Model {
        self.parameters.iter_mut().for_each(|parameter| parameter.free |= wanted(parameter));
        self
    }

    /// The same model with these, each an effect and a name, to be fitted as one number: the first, which all others follow.
    #[must_use]
    pub fn freed_as_one(mut self, numbers: &[(&'static str, &'static str)]) -> Model {
        let Some((first, others)) = numbers.split_first() else { return self };
        for parameter in &mut self.parameters {
            let own = (parameter.effect, parameter.name);
            parameter.free |= own == *first;
            if others.contains(&own) {
                parameter.follows = Some(*first);
            }
        }
        self
    }

    /// The same model with some of an effect's parameters as they are where nobody states them, and not to be fitted.
    #[must_use]
    pub fn unstated(mut self, effect: &EffectSpec, names: &[&str]) -> Model {
        for parameter in self.parameters.iter_mut().filter(|one| one.effect == effect.id && names.contains(&one.name)) {
            let spec = effect.parameters.iter().find(|spec| spec.name == parameter.name);
            spec.into_iter().for_each(|spec| *parameter = file::default_parameter(effect.id, spec));
        }
        self
    }

    /// The same model with one effect in the place of another that has the same parameters; none
    /// when it lacks the one or has the other already.
    pub(crate) fn exchanged(&self, old: &str, new: &str) -> Option<Model> {
        let (_, effect) = find(self.system, new)?;
        let has = |id: &str| self.placed.iter().any(|placed| placed.effect.spec().id == id);
        if !has(old) || has(new) {
            return None;
        }
        let effects = self.placed.iter().map(|placed| {
            let mut own = self.parameters[placed.parameters.clone()].to_vec();
            if placed.effect.spec().id != old {
                return (placed.effect, own);
            }
            own.iter_mut().for_each(|parameter| parameter.effect = effect.spec().id);
            (effect, own)
        });
        let (sensors, facts) = (self.sensors.clone(), self.facts.clone());
        Model::assemble(self.name.clone(), self.system, facts, sensors, self.uncertainty, effects.collect()).ok()
    }

    /// Some of the effects on other facts, and which of this model's parameters are left,
    /// in their order.
    pub(crate) fn part(&self, facts: Facts, keep: impl Fn(&EffectSpec) -> bool) -> (Model, Vec<usize>) {
        let kept = || self.placed.iter().filter(|placed| keep(placed.effect.spec()));
        let effects = kept().map(|placed| (placed.effect, self.parameters[placed.parameters.clone()].to_vec()));
        let model = Model::assemble(self.name.clone(), self.system, facts, self.sensors.clone(), self.uncertainty, effects.collect())
            .expect("no effect appears twice");
        (model, kept().flat_map(|placed| placed.parameters.clone()).collect())
    }
}
