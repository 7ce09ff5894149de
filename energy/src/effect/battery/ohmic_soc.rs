//! Resistance that depends on state of charge, with the knee near empty.
//!
//! `V = dR(SoC) I_cell`, where dR is linearly interpolated between knots and adds to R0. Kottas,
//! section 3.2 (Fig. 3.10), keeps such a table over depth-of-discharge grid points; the overpotential
//! rises as the battery nears empty (section 3.1). All knots at zero means no effect.
//!
//! Absence: the residual under load grows towards empty (and a little towards full).

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct OhmicSoc;

/// State of charge of each knot: dense near empty, where the knee is.
const KNOTS: [f64; 7] = [0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0];

macro_rules! knot {
    ($name:literal) => {
        ParameterSpec {
            name: $name,
            meaning: "resistance of one cell at this SoC, beyond R0",
            default: 0.0,
            null: Some(0.0),
            min: -0.2,
            max: 2.0,
            source: "range: rise near empty of the Enertech 0.5C and 1C discharges",
        }
    };
}

static SPEC: EffectSpec = EffectSpec {
    id: "ohmic_soc",
    title: "Resistance over state of charge",
    system: System::Battery,
    phase: Phase::Series,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "V = dR(SoC) I, dR linear between SoC 0, 0.05, 0.1, 0.2, 0.4, 0.7, 1",
    source: "Kottas, section 3.2 (resistance table over DoD grid points)",
    validity: "SoC 0..1; held constant outside; excludes slow diffusion",
    signature: "the residual under load follows SoC, largest near empty",
    matters: 1e-3,
    confused_with: &[("ohmic", "a discharge over the whole range of SoC")],
    parameters: &[
        knot!("resistance_soc_000_ohm"),
        knot!("resistance_soc_005_ohm"),
        knot!("resistance_soc_010_ohm"),
        knot!("resistance_soc_020_ohm"),
        knot!("resistance_soc_040_ohm"),
        knot!("resistance_soc_070_ohm"),
        knot!("resistance_soc_100_ohm"),
    ],
    states: &[],
};

impl Physics for OhmicSoc {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let knots_ohm: &[S; KNOTS.len()] = own.parameters.try_into().expect("one parameter per knot");
        channels.add(Channel::OverpotentialV, between(&KNOTS, knots_ohm, channels[Channel::Soc]) * channels[Channel::CellCurrentA]);
    }
}

/// The value at a state of charge on straight lines between knots from 0 to 1, and that of the nearest outside.
#[inline(always)]
pub(super) fn between<S: Real, const COUNT: usize>(knots: &[f64; COUNT], values: &[S; COUNT], soc: S) -> S {
    // A few comparisons without branches are faster than a search.
    let low = knots[1..COUNT - 1].iter().map(|&knot| usize::from(soc.re() >= knot)).sum::<usize>().min(COUNT - 2);
    let share = if (0.0..=1.0).contains(&soc.re()) {
        (soc - knots[low]) * (knots[low + 1] - knots[low]).recip()
    } else {
        S::from(soc.re().clamp(0.0, 1.0).round())
    };
    values[low] + (values[low + 1] - values[low]) * share
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn interpolates_between_knots_and_holds_outside() {
        let parameters = [0.3, 0.1, 0.05, 0.02, 0.0, 0.0, 0.01];
        let drop_v = |soc: f64| {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::Soc] = soc;
            channels[Channel::CellCurrentA] = 2.0;
            step_once(&OhmicSoc, &Facts::robot(), 1.0, &parameters, &mut [], &mut channels);
            channels[Channel::OverpotentialV]
        };
        assert!((drop_v(0.025) - 2.0 * 0.2).abs() < 1e-12);
        assert!((drop_v(0.85) - 2.0 * 0.005).abs() < 1e-12);
        assert!((drop_v(-0.1) - 2.0 * 0.3).abs() < 1e-12);
        assert!((drop_v(1.2) - 2.0 * 0.01).abs() < 1e-12);
    }

    /// Enertech pouch (logs in `scenarios/measured`) of 2.335 Ah at 0.1C. After 1.00 and 2.15 Ah it
    /// has 3.8173 and 3.6241 V at 0.228 A, 3.7573 and 3.5027 V at 1.14 A, 3.6835 and 3.3859 V at
    /// 2.28 A. Resistances from the slowest and the fastest must tell the drop of the one between.
    #[test]
    fn the_knee_of_a_measured_cell_near_empty_needs_another_resistance_than_its_middle() {
        let [middle_ohm, empty_ohm] = [3.8173 - 3.6835, 3.6241 - 3.3859].map(|drop_v: f64| drop_v / (2.28 - 0.228));
        let parameters = [empty_ohm, empty_ohm, empty_ohm, middle_ohm, middle_ohm, middle_ohm, middle_ohm];
        let drop_v = |taken_ah: f64| {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::Soc] = 1.0 - taken_ah / 2.335;
            channels[Channel::CellCurrentA] = 1.14 - 0.228;
            step_once(&OhmicSoc, &Facts::robot(), 1.0, &parameters, &mut [], &mut channels);
            channels[Channel::OverpotentialV]
        };
        let [middle_v, empty_v] = [3.8173 - 3.7573, 3.6241 - 3.5027];
        assert!((drop_v(1.00) / middle_v - 1.0).abs() < 0.15 && (drop_v(2.15) / empty_v - 1.0).abs() < 0.15);
        assert!(drop_v(1.00) < 0.6 * empty_v);
    }
}
