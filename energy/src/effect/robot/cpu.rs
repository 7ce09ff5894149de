//! Computer: switching and leakage power of its processor.
//!
//! `P += C N V^2 f (s + (1 - s) u) + I_leak V` in W (Kottas, Eq. 4.10, with utilisation and leakage
//! added). C N: effective switched capacitance, nF; f: clock, MHz (channel `cpu_mhz`); u:
//! utilisation 0..1; s: share of the switching that goes on while it idles; I_leak: A. The core
//! voltage V follows the clock by the PXA270's nominal states (Kottas, Table 4.1), linearly
//! between them: 1.00 V at 104 and 156 MHz, 1.05 at 208, 1.10 at 312, 1.35 at 416. Another processor's
//! may follow it more steeply: `V(f) = V_table(f) (f / 416 MHz)^b` within the table's clocks, b = 0 for the PXA270;
//! with b = 0.8 the voltage is about in proportion to the clock and the power to its cube.
//!
//! Absence: the power residual steps with clock and utilisation, more than in proportion to the clock.

use crate::real::exp;
use crate::units::S_PER_NF_MHZ;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Cpu;

/// Clock, MHz, and core voltage, V (Kottas, Table 4.1, nominal, slow system bus).
const STATES: [(f64, f64); 5] = [(104.0, 1.00), (156.0, 1.00), (208.0, 1.05), (312.0, 1.10), (416.0, 1.35)];

/// Core voltage at a clock, V, of a processor whose voltage follows the clock by this power more steeply; the first and
/// last state's beyond the table.
fn core_v<S: Real>(mhz: S, steepness: S) -> S {
    let (low_mhz, high_mhz) = (STATES[0].0, STATES[STATES.len() - 1].0);
    let share = (mhz.re().clamp(low_mhz, high_mhz) / high_mhz).ln();
    table_v(mhz) * exp(steepness * share)
}

/// Core voltage of the PXA270 at a clock, V.
fn table_v<S: Real>(mhz: S) -> S {
    if mhz.re() <= STATES[0].0 {
        return S::from(STATES[0].1);
    }
    for pair in STATES.windows(2) {
        let ((low_mhz, low_v), (high_mhz, high_v)) = (pair[0], pair[1]);
        if mhz.re() <= high_mhz {
            return (mhz - low_mhz) * ((high_v - low_v) / (high_mhz - low_mhz)) + low_v;
        }
    }
    S::from(STATES[STATES.len() - 1].1)
}

static SPEC: EffectSpec = EffectSpec {
    id: "cpu",
    title: "Computer: C N V^2 f and leakage",
    system: System::Robot,
    phase: Phase::Load,
    channel: Channel::PowerW,
    needs: &[Channel::CpuMhz, Channel::CpuUtil],
    equation: "P += C N V(f)^2 f (s + (1 - s) u) + I_leak V(f), V(f) = V_table(f) (f / 416 MHz)^b",
    source: "Kottas, Eq. 4.10 and Table 4.1",
    validity: "PXA270 at nominal core voltage with the slow system bus; one temperature",
    signature: "missing power that goes with clock and utilisation",
    matters: 0.02,
    confused_with: &[("idle", "logs at two clocks and two utilisations")],
    parameters: &[
        ParameterSpec {
            name: "capacitance_nf",
            meaning: "effective switched capacitance C N of the core at full utilisation",
            default: 0.72,
            null: Some(0.0),
            min: 0.0,
            max: 20.0,
            source: "0.57 W typical at 416 MHz and 1.35 V, as the maker quotes the PXA270 (not checked against the original)",
        },
        ParameterSpec {
            name: "leakage_a",
            meaning: "leakage current of the core",
            default: 0.02,
            null: Some(0.0),
            min: 0.0,
            max: 1.0,
            source: "guess: 0.005-0.05 A for a 180-130 nm core",
        },
        ParameterSpec {
            name: "idle_share",
            meaning: "share of the switching that goes on while the core idles",
            default: 0.3,
            null: None,
            min: 0.0,
            max: 1.0,
            source: "0.19 W idle at 416 MHz, as the maker quotes the PXA270 (not checked against the original)",
        },
        ParameterSpec {
            name: "voltage_steepness",
            meaning: "b: power of the clock by which the core voltage follows it more steeply than the PXA270's",
            default: 0.0,
            null: None,
            min: 0.0,
            max: 1.0,
            source: "theory: 0.8 makes the voltage follow the clock in proportion, as scaling of voltage and clock together aims at",
        },
    ],
    states: &[],
};

impl Physics for Cpu {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let [capacitance_nf, leakage_a, idle_share, steepness] =
            [own.parameters[0], own.parameters[1], own.parameters[2], own.parameters[3]];
        let mhz = channels[Channel::CpuMhz];
        let volts = core_v(mhz, steepness);
        let working = idle_share + (-idle_share + 1.0) * channels[Channel::CpuUtil];
        let switching_w = capacitance_nf * mhz * S_PER_NF_MHZ * volts * volts * working;
        channels.add(Channel::PowerW, switching_w + leakage_a * volts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn power_w(parameters: [f64; 3], mhz: f64, util: f64) -> f64 {
        steep_w(parameters, 0.0, mhz, util)
    }

    fn steep_w([capacitance_nf, leakage_a, idle_share]: [f64; 3], steepness: f64, mhz: f64, util: f64) -> f64 {
        let parameters = [capacitance_nf, leakage_a, idle_share, steepness];
        let mut channels = Channels::filled(0.0_f64);
        (channels[Channel::CpuMhz], channels[Channel::CpuUtil]) = (mhz, util);
        step_once(&Cpu, &Facts::robot(), 1.0, &parameters, &mut [], &mut channels);
        channels[Channel::PowerW]
    }

    #[test]
    fn one_nanofarad_at_a_gigahertz_and_a_volt_would_be_a_watt() {
        // 1 nF x 104 MHz x (1.00 V)^2 = 0.104 W; idling at 30 %: 0.0312 W; stopped: leakage alone.
        assert!((power_w([1.0, 0.0, 0.3], 104.0, 1.0) - 0.104).abs() < 1e-12);
        assert!((power_w([1.0, 0.0, 0.3], 104.0, 0.0) - 0.0312).abs() < 1e-12);
        assert!((power_w([1.0, 0.02, 0.3], 0.0, 1.0) - 0.02).abs() < 1e-12);
    }

    /// Kottas, Table 4.1: 208 MHz at 1.05 V and 416 MHz at 1.35 V. The same work at half the clock
    /// takes (1.05 / 1.35)^2 = 60.5 % of the energy.
    #[test]
    fn the_same_work_at_half_the_clock_takes_three_fifths_of_the_energy() {
        let [slow_w, fast_w] = [208.0, 416.0].map(|mhz| power_w([0.72, 0.0, 0.0], mhz, 1.0));
        assert!((2.0 * slow_w / fast_w - (1.05_f64 / 1.35).powi(2)).abs() < 1e-12);
    }

    #[test]
    fn the_voltage_is_tabled_and_interpolated() {
        for (mhz, volts) in STATES {
            assert!((core_v(mhz, 0.0) - volts).abs() < 1e-12);
        }
        assert!((core_v(364.0_f64, 0.0) - 1.225).abs() < 1e-12);
        assert_eq!([core_v(13.0_f64, 0.0), core_v(520.0, 0.0)], [1.00, 1.35]);
    }

    /// 208 and 416 MHz, b = 1: half the voltage of the table at half the clock, (1.05 / 2 / 1.35)^2 / 2 of the power.
    #[test]
    fn a_steeper_voltage_saves_more_at_half_the_clock() {
        let [slow_w, fast_w] = [208.0, 416.0].map(|mhz| steep_w([0.72, 0.0, 0.0], 1.0, mhz, 1.0));
        assert!((slow_w / fast_w - (1.05_f64 / 2.0 / 1.35).powi(2) / 2.0).abs() < 1e-12);
        assert_eq!(core_v(0.0_f64, 1.0), core_v(104.0, 1.0), "a stopped clock has a voltage");
    }
}
