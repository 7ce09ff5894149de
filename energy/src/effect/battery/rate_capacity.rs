//! Capacity that falls as the current rises.
//!
//! `Q(I) = Q / (1 + k c^n)` with the rate `c = |I| / Q` in 1/h (pack current over pack capacity),
//! k the loss at the one-hour rate and n its exponent. Peukert's own law gives an infinite
//! capacity at no current; this generalised form keeps Q there and falls like a power at high
//! rates.
//!
//! It stands for charge that a fast discharge leaves behind where no diffusion is modelled: state
//! of charge then counts usable charge at the present rate. It acts on charge and discharge alike.
//!
//! Absence: discharges end the earlier the higher their current, more than resistance explains.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct RateCapacity;

static SPEC: EffectSpec = EffectSpec {
    id: "rate_capacity",
    title: "Capacity over discharge rate",
    system: System::Battery,
    phase: Phase::Capacity,
    channel: Channel::CapacityAh,
    needs: &[Channel::CurrentA],
    equation: "Q(I) = Q / (1 + k (|I| / Q)^n)",
    source: "generalised Peukert equation: Galushkin et al., J. Electrochem. Soc. 167 (2020) 120516",
    validity: "constant-current discharges up to about 4 C; a shortcut for diffusion, so wrong right after a change of current",
    signature: "the SoC error of a discharge grows with its current",
    matters: 1e-2,
    confused_with: &[
        ("capacity_fade", "one pack discharged at two rates"),
        ("ohmic", "the voltage half an hour after discharges at two rates that removed the same charge"),
    ],
    parameters: &[
        ParameterSpec {
            name: "loss_at_1c",
            meaning: "k: share by which the capacity at no current exceeds that at the one-hour rate",
            default: 0.02,
            null: Some(0.0),
            min: 0.0,
            max: 1.0,
            source: "0.5 % for a Samsung 30Q discharged to 2.5 V; some per cent for energy cells; range is a guess",
        },
        ParameterSpec {
            name: "exponent",
            meaning: "n: how the loss grows with the rate",
            default: 1.0,
            null: None,
            min: 0.3,
            max: 3.0,
            source: "1.1 for a Samsung 30Q between 1 C and 4 C",
        },
    ],
    states: &[],
};

impl Physics for RateCapacity {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let per_h = (channels[Channel::TerminalCurrentA] / channels[Channel::CapacityAh]).abs();
        if per_h.re() > 0.0 {
            let loss = own.parameters[0] * (per_h.ln() * own.parameters[1]).exp();
            channels[Channel::CapacityAh] /= loss + 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn capacity_ah(parameters: [f64; 2], stated_ah: f64, current_a: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::CapacityAh] = stated_ah;
        channels[Channel::TerminalCurrentA] = current_a;
        step_once(&RateCapacity, &Facts::robot(), 1.0, &parameters, &mut [], &mut channels);
        channels[Channel::CapacityAh]
    }

    #[test]
    fn at_rest_the_capacity_is_whole_and_at_one_c_the_stated_share_is_gone() {
        assert_eq!(capacity_ah([0.1, 0.5], 2.0, 0.0), 2.0);
        assert!((capacity_ah([0.1, 0.5], 2.0, 2.0) - 2.0 / 1.1).abs() < 1e-12);
        assert!((capacity_ah([0.1, 0.5], 2.0, -2.0) - 2.0 / 1.1).abs() < 1e-12);
    }

    /// Samsung 30Q to 2.5 V (ARTS laboratory data): 2.970 Ah at C/10, 2.957 / 2.946 / 2.926 /
    /// 2.901 Ah at 1 to 4 C. The law is put through 1 C and 4 C, with 2.972 Ah at no current; it
    /// must then tell the three others.
    #[test]
    fn a_law_through_one_and_four_c_tells_the_capacity_of_a_30q_between_and_below() {
        let k = 2.972_f64 / 2.957 - 1.0;
        let n = ((2.972 / 2.901 - 1.0) / k).ln() / 4f64.ln();
        for (current_a, measured_ah) in [(0.3, 2.970), (6.0, 2.946), (9.0, 2.926)] {
            let ours_ah = capacity_ah([k, n], 2.972, current_a);
            assert!((ours_ah / measured_ah - 1.0).abs() < 3e-3, "{current_a} A: {ours_ah} Ah");
        }
    }
}
