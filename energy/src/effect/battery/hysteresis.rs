//! Voltage hysteresis: a cell rests lower after a discharge than after a charge.
//!
//! `dh/dt = |gamma I_cell / Q_cell| (sign(I) - h)`, `V_hyst = M(SoC) h`: Plett's one-state model. h in
//! -1..1 is 1 after a long discharge and -1 after a long charge, and stays where it is at rest; gamma
//! without unit: half of a reversal takes a share `ln 2 / gamma` of the capacity. M(SoC) is the amplitude
//! at half charge times one plus a share that is linearly interpolated between knots: an LFP cell's
//! branches are three times as far apart at some charges as at others. Stepped exactly for a current held over the step: `h' = s + (h - s) exp(-gamma |dz|)`
//! with the share dz of the capacity that passed.
//!
//! A run begins at h = 0. How its state of charge was reached is not in the channels; who knows
//! it (`history` of a log) sets the state to 1 (discharged) or -1 (charged).
//!
//! Absence: the residual at rest has one sign after charges and the other after discharges, at
//! the same SoC, however long the rest.

use std::cmp::Ordering;

use super::ohmic_soc::between;
use crate::real::exp;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Hysteresis;

/// State of charge of each knot: closer to the ends, where voltages are steep.
const KNOTS: [f64; 7] = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0];
/// The knot whose amplitude is the effect's own.
const MIDDLE: usize = 3;

macro_rules! knot {
    ($name:literal) => {
        ParameterSpec {
            name: $name,
            meaning: "amplitude at this SoC beyond that at SoC 0.5, as a share of that one",
            default: 0.0,
            null: Some(0.0),
            min: -1.0,
            max: 3.0,
            source: "range: C/30 data of an A123 26650, 12 to 32 mV where it has 17 at half charge",
        }
    };
}

static SPEC: EffectSpec = EffectSpec {
    id: "hysteresis",
    title: "Voltage hysteresis",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "dh/dt = |gamma I / Q| (sign(I) - h), V = M(SoC) h, M linear between SoC 0, 0.1, 0.3, 0.5, 0.7, 0.9, 1",
    source: "G. L. Plett, Battery Management Systems, vol. I (2015), section 2.7, one-state hysteresis without its instantaneous part",
    validity: "reversals of some per cent of SoC and more; M held constant outside SoC 0..1; does not relax at rest",
    signature: "rests at one SoC differ by whether a charge or a discharge came before, and the difference stays",
    matters: 1e-3,
    confused_with: &[
        ("rc2", "a rest of several hours after a charge and after a discharge"),
        ("charge_asymmetry", "a long rest at one SoC reached from both sides"),
    ],
    parameters: &[
        ParameterSpec {
            name: "amplitude_v",
            meaning: "distance of either branch from the middle at SoC 0.5, per cell",
            default: 5e-3,
            null: Some(0.0),
            min: 0.0,
            max: 0.1,
            source: "2-20 mV in NMC and LCO cells, 10-30 mV in LFP (C/30 data of an A123 26650)",
        },
        ParameterSpec {
            name: "rate",
            meaning: "gamma: how fast a reversal goes, per capacity passed",
            default: 50.0,
            null: None,
            min: 1.0,
            max: 1000.0,
            source: "guess: half of a reversal within 0.1 to 70 % of capacity; about 1 % is usual",
        },
        knot!("share_soc_000"),
        knot!("share_soc_010"),
        knot!("share_soc_030"),
        knot!("share_soc_070"),
        knot!("share_soc_090"),
        knot!("share_soc_100"),
    ],
    states: &["hysteresis"],
};

impl Physics for Hysteresis {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn start<S: Real>(&self, _: &Facts, _: &[S], states: &mut [S], channels: &Channels<S>) {
        states[0] = channels[Channel::History];
    }

    /// Half of a reversal at the usual rate, `ln 2 / gamma`. While the current only ever runs one way, h goes to one branch and stays
    /// there: a drop that builds up and remains, which is what polarisation, a table or a sensor that is off do as well.
    fn reversal(&self) -> f64 {
        std::f64::consts::LN_2 / SPEC.parameters[1].default
    }

    /// The amplitude at each knot, what the exponent of a reversal is multiplied by, and 1 where all amplitudes are one and the same.
    fn prepared_len(&self) -> usize {
        KNOTS.len() + 2
    }

    fn prepare<S: Real>(&self, _: &Facts, _dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        let (amplitude_v, shares) = (parameters[0], &parameters[2..]);
        let share = |knot: usize| match knot.cmp(&MIDDLE) {
            Ordering::Less => shares[knot],
            Ordering::Equal => S::from(0.0),
            Ordering::Greater => shares[knot - 1],
        };
        (0..KNOTS.len()).for_each(|knot| prepared[knot] = amplitude_v * (share(knot) + 1.0));
        prepared[KNOTS.len()] = -parameters[1];
        let flat = shares.iter().all(|share| share.re() == 0.0 && share.stands_still());
        prepared[KNOTS.len() + 1] = S::from(if flat { 1.0 } else { 0.0 });
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let (current_a, state) = (channels[Channel::CellCurrentA], &mut own.states[0]);
        let branch = 1f64.copysign(current_a.re());
        let kept = exp(own.prepared[KNOTS.len()] * (current_a * branch) * channels[Channel::SocPerA]);
        *state = (*state - branch) * kept + branch;
        let amplitudes_v: &[S; KNOTS.len()] = own.prepared[..KNOTS.len()].try_into().expect("one amplitude per knot");
        let flat = own.prepared[KNOTS.len() + 1].re() != 0.0;
        let amplitude_v = if flat { amplitudes_v[MIDDLE] } else { between(&KNOTS, amplitudes_v, channels[Channel::Soc]) };
        channels.add(Channel::OverpotentialV, amplitude_v * *state);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    /// The effect's parameters without shares: one amplitude at all states of charge.
    fn flat(amplitude_v: f64, rate: f64) -> Vec<f64> {
        [vec![amplitude_v, rate], vec![0.0; KNOTS.len() - 1]].concat()
    }

    /// Passes a share of the capacity through a cell of 2 Ah at 1 A; negative shares charge it.
    fn pass(share: f64, amplitude_v: f64, rate: f64, states: &mut [f64; 1]) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::SocPerA] = share.abs();
        channels[Channel::CellCurrentA] = 1f64.copysign(share);
        step_once(&Hysteresis, &Facts::robot(), 1.0, &flat(amplitude_v, rate), states, &mut channels);
        channels[Channel::OverpotentialV]
    }

    /// From one branch (h = 1) to the middle (h = 0), exp(-gamma dz) must be one half.
    #[test]
    fn half_of_a_reversal_takes_ln_2_over_gamma_of_the_capacity() {
        let mut states = [1.0];
        assert!(pass(-(2f64.ln()) / 50.0, 5e-3, 50.0, &mut states).abs() < 1e-12);
    }

    #[test]
    fn one_long_step_equals_many_short_ones_and_a_rest_changes_nothing() {
        let (mut long, mut short) = ([-0.4], [-0.4]);
        pass(0.03, 5e-3, 50.0, &mut long);
        for _ in 0..1000 {
            pass(0.03 / 1000.0, 5e-3, 50.0, &mut short);
        }
        assert!((long[0] - short[0]).abs() < 1e-12);
        let before = long[0];
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::SocPerA] = 1.0;
        step_once(&Hysteresis, &Facts::robot(), 1e4, &flat(5e-3, 50.0), &mut long, &mut channels);
        assert_eq!(long[0], before);
    }

    /// A123 26650 LFP at 25 °C and C/30 (data of Plett's ESC toolbox): at half charge 3.29115 V
    /// on the way down and 3.32472 V on the way up, so M is half of 33.6 mV (the ohmic part at
    /// 77 mA is about 1 mV of it).
    #[test]
    fn charge_and_discharge_of_an_lfp_cell_lie_two_amplitudes_apart() {
        let amplitude_v = 16.8e-3;
        let (down_v, up_v) = (pass(0.5, amplitude_v, 50.0, &mut [0.0]), pass(-0.5, amplitude_v, 50.0, &mut [0.0]));
        assert!((down_v - up_v - (3.32472 - 3.29115)).abs() < 1e-4, "{down_v} {up_v}");
    }

    /// The same data, half of what lies between the way down and the way up in mV: at SoC 0.1 21.3, at 0.3 29.1, at 0.5 16.8, at 0.7
    /// 19.8, at 0.9 11.8, and between them at 0.2 23.3, at 0.6 19.3, at 0.8 13.6. One amplitude is off by 5.1 mV RMS from 0.025 to 0.98.
    #[test]
    fn between_knots_the_amplitude_of_a_measured_cell_is_met_within_a_fifth() {
        let half_v = [(0.1, 21.3e-3), (0.2, 23.3e-3), (0.3, 29.1e-3), (0.6, 19.3e-3), (0.7, 19.8e-3), (0.8, 13.6e-3), (0.9, 11.8e-3)];
        let share = |knot: usize| half_v.iter().find(|(soc, _)| *soc == KNOTS[knot]).map_or(0.0, |(_, half_v)| half_v / 16.8e-3 - 1.0);
        let shares = (0..KNOTS.len()).filter(|&knot| knot != MIDDLE).map(share);
        let parameters: Vec<f64> = [16.8e-3, 50.0].into_iter().chain(shares).collect();
        for (soc, half_v) in half_v {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::Soc] = soc;
            step_once(&Hysteresis, &Facts::robot(), 1.0, &parameters, &mut [1.0], &mut channels);
            let off = (channels[Channel::OverpotentialV] / half_v - 1.0).abs();
            assert!(off < if KNOTS.contains(&soc) { 1e-9 } else { 0.2 }, "{soc}: {off}");
        }
    }

    /// A rested cell that was charged before lies M above the middle, one that was discharged below.
    #[test]
    fn a_run_starts_on_the_branch_that_its_history_says() {
        for (history, side) in [(1.0, 1.0), (-1.0, -1.0), (0.0, 0.0)] {
            let (mut states, mut channels) = ([0.5], Channels::filled(0.0_f64));
            channels[Channel::History] = history;
            Physics::start(&Hysteresis, &Facts::robot(), &flat(5e-3, 50.0), &mut states, &channels);
            step_once(&Hysteresis, &Facts::robot(), 1.0, &flat(5e-3, 50.0), &mut states, &mut channels);
            assert!((channels[Channel::OverpotentialV] - 5e-3 * side).abs() < 1e-15);
        }
    }
}
