//! Charge transfer: an overpotential that bends with the current, from a line to a logarithm.
//!
//! `V = s (2 R_gas T / F) asinh(I_cell / (2 i0))`, the Butler-Volmer equation with transfer
//! coefficient 1/2 solved for the voltage; i0 the exchange current of one cell in A, T in K. Far
//! above i0 it is Tafel's line in log I (Kottas, Eq. C.7), far below a resistance
//! `s R_gas T / (F i0)`. The share s is 1 for one such electrode; other transfer coefficients
//! make it `1 / (2 alpha)`, two electrodes up to 2. Temperature acts through the scale only; what
//! i0 does over temperature is left to `polarisation_arrhenius`.
//!
//! Absence: at small currents the drop is larger than in proportion to the current.

use super::arrhenius::kelvin;
use crate::units::{FARADAY_C_PER_MOL, GAS_CONSTANT_J_PER_MOL_K};
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct ButlerVolmer;

static SPEC: EffectSpec = EffectSpec {
    id: "butler_volmer",
    title: "Charge transfer (Butler-Volmer)",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "V = s (2 R T / F) asinh(I / (2 i0))",
    source: "Butler-Volmer equation with alpha = 1/2; Tafel limit: Kottas, Eq. C.7",
    validity: "exchange current constant over SoC; no double layer, so at once; far below i0 it is one with R0",
    signature: "the drop per ampere is larger at small currents than at large ones",
    matters: 1e-3,
    confused_with: &[("ohmic", "currents of a twentieth and of twice the capacity per hour at one SoC and temperature")],
    parameters: &[
        ParameterSpec {
            name: "share",
            meaning: "s: 1 for one electrode with transfer coefficient 1/2",
            default: 1.0,
            null: Some(0.0),
            min: 0.0,
            max: 4.0,
            source: "theory: 1 / (2 alpha) for each electrode that limits",
        },
        ParameterSpec {
            name: "exchange_current_a",
            meaning: "i0: exchange current of one cell",
            default: 1.0,
            null: None,
            min: 1e-3,
            max: 100.0,
            source: "guess: of the order of the one-hour current; 10-100 mOhm of charge transfer in 2 Ah cells give 0.3-3 A",
        },
    ],
    states: &[],
};

/// `asinh(x)` to an absolute error of about 1e-16: a small x loses digits that no voltage needs,
/// in a third of the time of the standard library's.
#[inline]
fn asinh<S: Real>(x: S) -> S {
    let sign = 1f64.copysign(x.re());
    let size = x * sign;
    (size + (size * size + 1.0).sqrt()).ln() * sign
}

impl Physics for ButlerVolmer {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn prepared_len(&self) -> usize {
        2
    }

    fn prepare<S: Real>(&self, _: &Facts, _dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        prepared[0] = parameters[0] * (2.0 * GAS_CONSTANT_J_PER_MOL_K / FARADAY_C_PER_MOL);
        prepared[1] = (parameters[1] * 2.0).recip();
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let scale_v = own.prepared[0] * kelvin(channels[Channel::CellDegc]);
        channels.add(Channel::OverpotentialV, scale_v * asinh(channels[Channel::CellCurrentA] * own.prepared[1]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn drop_mv(exchange_current_a: f64, current_a: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::CellDegc] = 25.0;
        channels[Channel::CellCurrentA] = current_a;
        step_once(&ButlerVolmer, &Facts::robot(), 1.0, &[1.0, exchange_current_a], &mut [], &mut channels);
        1000.0 * channels[Channel::OverpotentialV]
    }

    /// The thermal voltage R T / F at 25 °C is 25.69 mV (any electrochemistry table). Small
    /// currents see it over i0 as a resistance: 1 mA at i0 = 1 A is 0.02569 mV.
    #[test]
    fn a_small_current_sees_the_thermal_voltage_over_the_exchange_current() {
        assert!((drop_mv(1.0, 1e-3) / 1e-3 - 25.69).abs() < 0.01);
        assert_eq!(drop_mv(1.0, -0.3), -drop_mv(1.0, 0.3));
    }

    /// Tafel: with alpha = 1/2 a decade of current is 2 x 25.69 mV x ln 10 = 118.3 mV at 25 °C.
    #[test]
    fn far_above_the_exchange_current_a_decade_costs_118_millivolts() {
        assert!((drop_mv(1e-3, 10.0) - drop_mv(1e-3, 1.0) - 118.3).abs() < 0.05);
    }

    /// The equation it solves: I = i0 (exp(F V / 2RT) - exp(-F V / 2RT)).
    #[test]
    fn its_voltage_put_into_butler_volmer_gives_the_current_back() {
        for current_a in [-7.0, -0.2, 0.01, 3.0_f64] {
            let reduced = drop_mv(0.5, current_a) / (2.0 * 25.6926);
            let back_a = 0.5 * (reduced.exp() - (-reduced).exp());
            assert!((back_a - current_a).abs() < 1e-4 * current_a.abs(), "{current_a} {back_a}");
        }
    }
}
