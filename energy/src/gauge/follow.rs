//! A run of the model that follows the pack: what a step moves, and how far the voltage lies below
//! the open-circuit voltage.

use std::sync::Arc;

use super::Sample;
use crate::units::S_PER_H;
use crate::{Channel, Estimate, Model, Run, Start, propagate};

/// Time constant with which the surroundings' temperature is made out from the pack's, s: slower
/// than a cell warms, faster than a day does.
const AMBIENT_TAU_S: f64 = 1800.0;

/// The model on the pack's current.
#[derive(Clone)]
pub(crate) struct Follower {
    run: Run<f64>,
}

/// What a step did, by the model.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Followed {
    /// Share of capacity that left the cells, also unseen.
    pub(crate) moved: f64,
    /// State of charge after it.
    pub(crate) soc: f64,
    /// Open-circuit voltage of a cell after it, V.
    pub(crate) ocv_v: f64,
    /// How far that lies below the curve that the gauge reads, V: what the temperature shifts.
    pub(crate) shift_v: f64,
    /// How far the voltage of a cell lies below its open-circuit voltage, V.
    pub(crate) drop_v: f64,
    /// By how much that may differ for what the pack went through before the gauge began, V.
    pub(crate) branch_v: f64,
    /// Current through one cell, A.
    pub(crate) cell_a: f64,
    /// Capacity, Ah.
    pub(crate) capacity_ah: f64,
}

impl Follower {
    /// A pack that has rested, and came to its charge like this (see [`Start::history`]).
    pub(crate) fn new(model: &Arc<Model>, soc: f64, temperature_degc: f64, history: f64) -> Self {
        Self { run: Run::new(Arc::clone(model), Start { temperature_degc, history, ..Start::at_soc(soc) }) }
    }

    /// The run.
    pub(crate) fn run(&self) -> &Run<f64> {
        &self.run
    }

    /// Follows a sample from a state of charge, with this current per capacity of the model.
    pub(crate) fn step(&mut self, sample: &Sample, current_a: f64, soc: f64, cycles: f64) -> Followed {
        follow(&mut self.run, sample, current_a, soc, cycles)
    }
}

impl std::fmt::Debug for Follower {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Follower").field("states", &self.run.states()).finish()
    }
}

/// [`Follower::step`] on any run.
pub(crate) fn follow(run: &mut Run<f64>, sample: &Sample, current_a: f64, soc: f64, cycles: f64) -> Followed {
    run.states_mut()[0] = soc;
    // A model that predicts the temperature is led to the measured one by its surroundings; one
    // that does not takes it as it is.
    let colder_degc = sample.temperature_degc - run.channels[Channel::TemperatureDegc];
    run.channels[Channel::AmbientDegc] += colder_degc * (sample.dt_s / AMBIENT_TAU_S).min(1.0);
    run.channels[Channel::TemperatureDegc] = sample.temperature_degc;
    // Beside what the pack had seen before the gauge, as where a run begins.
    run.channels[Channel::CycleCount] = cycles + run.model().battery().cycle_count;
    run.channels[Channel::CurrentA] = current_a;
    run.step(sample.dt_s);
    let facts = run.model().battery();
    Followed {
        moved: soc - run.states()[0],
        soc: run.states()[0],
        ocv_v: run.channels[Channel::OcvV],
        shift_v: 0.0,
        drop_v: run.channels[Channel::OcvV] - run.channels[Channel::VoltageV] / f64::from(facts.series),
        branch_v: 0.0,
        cell_a: run.channels[Channel::CellCurrentA],
        capacity_ah: run.channels[Channel::CapacityAh],
    }
}

/// A run that was begun at `start` goes on in the state in which another has come to be, but for its charge: each state lies as far from where
/// it began as the other's does from where that would have begun. What parameters and charge make of a beginning (a weak cell that has run
/// ahead) stays. The other followed the current per `capacity` (a share of the model's): what goes with the current is that much larger.
pub(crate) fn go_on_like(run: &mut Run<f64>, start: Start, other: &Run<f64>, capacity: f64) {
    let begun = Run::with_parameters(Arc::clone(other.model()), other.parameters().to_vec(), Start { soc: other.states()[0], ..start });
    let model = Arc::clone(other.model());
    for placed in model.placed() {
        for (own, state) in placed.states.clone().enumerate() {
            let factor = if placed.effect.goes_with_current(own) { capacity } else { 1.0 };
            run.states_mut()[state] += factor * (other.states()[state] - begun.states()[state]);
        }
    }
    run.channels[Channel::AmbientDegc] = other.channels[Channel::AmbientDegc];
}

/// How far the voltage of a rested cell at this charge may lie from the middle, for how it came there, V.
pub(crate) fn branch_v(model: &Arc<Model>, soc: f64) -> f64 {
    let [discharged_v, charged_v] = [1.0, -1.0].map(|history| {
        let mut run = Run::new(Arc::clone(model), Start { history, ..Start::at_soc(soc) });
        run.step(1e-3);
        run.channels[Channel::VoltageV] / f64::from(model.battery().series)
    });
    0.5 * (charged_v - discharged_v).abs()
}

/// What half a pack loses per second without a current, by the model, with the deviation that its
/// parameters give, 1/s.
pub(crate) fn leak_per_s(model: &Arc<Model>, temperature_degc: f64) -> Estimate {
    let start = Start { temperature_degc, ..Start::at_soc(0.5) };
    let lost = propagate(&model.estimates(), |values| {
        let values = values.iter().zip(model.parameters()).map(|(&value, p)| value.clamp(p.min, p.max)).collect();
        let mut run = Run::with_parameters(Arc::clone(model), values, start);
        run.channels[Channel::CurrentA] = 0.0;
        run.step(S_PER_H);
        start.soc - run.channels[Channel::Soc]
    });
    Estimate::new(lost.value / S_PER_H, lost.sigma / S_PER_H)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::S_PER_DAY;

    fn model() -> Arc<Model> {
        Arc::new(crate::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap())
    }

    #[test]
    fn a_month_costs_what_the_thesis_says() {
        let month = leak_per_s(&model(), 25.0).value * 30.0 * S_PER_DAY;
        // Kottas, section 3.1: 3 % of capacity in a month.
        assert!((month - 0.03).abs() < 1e-6, "{month}");
    }

    #[test]
    fn the_drop_is_the_resistance_times_the_current_of_a_cell() {
        let mut follower = Follower::new(&model(), 0.4, 25.0, 0.0);
        let sample = Sample { dt_s: 1e-3, current_a: 7.6, voltage_v: 11.0, temperature_degc: 25.0 };
        let followed = follower.step(&sample, 7.6, 0.4, 0.0);
        // 0.0766 ohm at 40 % (the model's file), 1.9 A through each of four strings.
        assert!((followed.drop_v - 0.0766 * 1.9).abs() < 1e-4, "{followed:?}");
    }

    /// Of a pack that holds a quarter less than the model, followed at the current per capacity: what is left of it, against its own discharge.
    #[test]
    fn a_smaller_pack_goes_on_from_the_polarisation_that_it_has() {
        const CAPACITY: f64 = 0.75;
        // Its slow pair, as a formula of somebody's says it.
        let slow = "[[effect]]\nid = \"expression\"\nname = \"more\"\nchannel = \"overpotential_v\"\nformula = \"0.02 * slow\"\n\
                    tau_s = { value = 900.0, source = \"t\" }\nstates = { slow = { input = \"cell_current_a\", tau = \"tau_s\" } }\n";
        let text = crate::built_in("a123-lfp-26650-2p3ah").unwrap().to_owned() + slow;
        let read = |table: &str| crate::built_in(table).map(str::to_owned).ok_or_else(|| "not built in".to_owned());
        let model = Arc::new(Model::parse("a123", &text, &read).unwrap());
        let mut smaller = Model::clone(&model);
        if let crate::Facts::Battery(facts) = &mut smaller.facts {
            facts.capacity_ah *= CAPACITY;
        }
        let smaller = Arc::new(smaller);
        for after_s in [900, 1800, 2400] {
            let mut pack = Run::new(Arc::clone(&smaller), Start { history: 1.0, ..Start::at_soc(0.98) });
            let mut follower = Follower::new(&model, 0.98, 25.0, 1.0);
            for _ in 0..after_s {
                let before = pack.states()[0];
                crate::load::Terminals::step_power(&mut pack, 6.6, 1.0).unwrap();
                let sample = Sample { dt_s: 1.0, current_a: pack.channels[Channel::CurrentA], voltage_v: 3.2, temperature_degc: 25.0 };
                follower.step(&sample, sample.current_a / CAPACITY, before, 0.0);
            }
            let start = Start::at_soc(pack.states()[0]);
            let mut run = Run::new(Arc::clone(&model), start);
            go_on_like(&mut run, start, follower.run(), CAPACITY);
            let told_wh = CAPACITY * crate::forecast::discharge(&mut run, 6.6).energy_wh;
            let given_wh = crate::forecast::discharge(&mut pack, 6.6).energy_wh;
            assert!((told_wh / given_wh - 1.0).abs() < 0.004, "after {after_s} s: {told_wh} Wh, {given_wh} came");
        }
    }

    #[test]
    fn the_surroundings_are_made_out_from_the_packs_temperature() {
        let mut follower = Follower::new(&model(), 0.5, 25.0, 0.0);
        let sample = Sample { dt_s: 10.0, current_a: 0.0, voltage_v: 11.4, temperature_degc: 5.0 };
        (0..2000).for_each(|_| {
            follower.step(&sample, 0.0, 0.5, 0.0);
        });
        assert!((follower.run.channels[Channel::CellDegc] - 5.0).abs() < 1.0);
    }
}
