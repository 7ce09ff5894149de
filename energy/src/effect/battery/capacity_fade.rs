//! Capacity fade with cycles, in two slopes.
//!
//! `Q(N) = Q_max (1 - m1 N)` up to the knee N_x and `Q_max (1 - m1 N_x - m2 (N - N_x))` beyond.
//! Kottas, Eq. 3.4, prints `m2 N` for the second term, which would jump by `m2 N_x` at the knee;
//! this is the continuous form. N counts full cycles, m1 and m2 are shares of Q_max per cycle.
//!
//! Absence: an aged pack empties earlier than the model says, more so every month.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CapacityFade;

static SPEC: EffectSpec = EffectSpec {
    id: "capacity_fade",
    title: "Capacity fade per cycle, two slopes",
    system: System::Battery,
    phase: Phase::Capacity,
    channel: Channel::CapacityAh,
    needs: &[Channel::CycleCount],
    equation: "Q = Q_max (1 - m1 min(N, N_x) - m2 max(N - N_x, 0))",
    source: "Kottas, Eq. 3.4, made continuous at the knee",
    validity: "until half of the capacity is left",
    signature: "SoC error grows with cycle count; full discharges end early",
    matters: 1e-2,
    confused_with: &[],
    parameters: &[
        ParameterSpec {
            name: "fade_per_cycle",
            meaning: "share of capacity lost per cycle before the knee",
            default: 2e-4,
            null: Some(0.0),
            min: 0.0,
            max: 0.01,
            source: "guess: 80 % of capacity after 1000 cycles",
        },
        ParameterSpec {
            name: "fade_per_cycle_after_knee",
            meaning: "share of capacity lost per cycle beyond the knee",
            default: 1e-3,
            null: Some(0.0),
            min: 0.0,
            max: 0.05,
            source: "guess: several times the first slope",
        },
        ParameterSpec {
            name: "knee_cycles",
            meaning: "full cycles at which the second slope begins",
            default: 500.0,
            null: None,
            min: 1.0,
            max: 5000.0,
            source: "guess: rated cycle life of LiPo cells",
        },
    ],
    states: &[],
};

impl Physics for CapacityFade {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let (cycles, knee) = (channels[Channel::CycleCount], own.parameters[2]);
        let lost = if cycles.re() <= knee.re() {
            own.parameters[0] * cycles
        } else {
            own.parameters[0] * knee + own.parameters[1] * (cycles - knee)
        };
        // Beyond its range of validity the line would cross zero: a pack that is worn out still
        // holds a little, and the physics stays finite.
        let kept = if lost.re() > 0.95 { S::from(0.05) } else { -lost + 1.0 };
        channels[Channel::CapacityAh] *= kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn fades_continuously_through_the_knee() {
        let capacity_ah = |cycles: f64| {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::CapacityAh] = 2.0;
            channels[Channel::CycleCount] = cycles;
            step_once(&CapacityFade, &Facts::robot(), 1.0, &[2e-4, 1e-3, 500.0], &mut [], &mut channels);
            channels[Channel::CapacityAh]
        };
        assert!((capacity_ah(500.0) - 1.8).abs() < 1e-12);
        assert!((capacity_ah(500.0) - capacity_ah(500.001)).abs() < 1e-5);
        assert!((capacity_ah(600.0) - 1.6).abs() < 1e-12);
    }

    /// NASA PCoE cell B0025, 28 discharges: means of four capacities are 1.8479 Ah around discharge
    /// 2.5, 1.8167 Ah around 14.5 and 1.7852 Ah around 26.5. The slope between the first two must
    /// tell the third.
    #[test]
    fn the_first_slope_of_a_measured_cell_tells_its_later_capacity() {
        let fade_per_cycle = (1.8479 - 1.8167) / 12.0 / 1.8479;
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::CapacityAh] = 1.8479;
        channels[Channel::CycleCount] = 24.0;
        step_once(&CapacityFade, &Facts::robot(), 1.0, &[fade_per_cycle, 0.05, 500.0], &mut [], &mut channels);
        assert!((channels[Channel::CapacityAh] - 1.7852).abs() < 3e-3, "{}", channels[Channel::CapacityAh]);
    }

    /// By hand: a new cell has all of its capacity, and one that is worn out a twentieth.
    #[test]
    fn a_new_cell_is_whole_and_a_dead_one_not_negative() {
        for (cycles, share) in [(0.0, 1.0), (1e6, 0.05)] {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::CapacityAh] = 2.0;
            channels[Channel::CycleCount] = cycles;
            step_once(&CapacityFade, &Facts::robot(), 1.0, &[2e-4, 1e-3, 500.0], &mut [], &mut channels);
            assert!((channels[Channel::CapacityAh] - 2.0 * share).abs() < 1e-12);
        }
    }
}
