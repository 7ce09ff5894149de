//! Dead band of the current sensor: small currents are shown as none.
//!
//! `I = I_shown + I_hidden` while `|I_shown| <= band`, else `I = I_shown`; all in A of the pack,
//! discharge positive. A gauge shows zero within its band so that an offset does not count as
//! charge; what truly flows there cannot be seen and is a parameter: the standby current of what
//! hangs on the pack. Acts first of all sensor effects, since the band is the sensor's last step.
//!
//! Absence: the state of charge is overestimated after long rests, and after them only.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CurrentDeadBand;

static SPEC: EffectSpec = EffectSpec {
    id: "current_dead_band",
    title: "Dead band of the current sensor",
    system: System::Battery,
    phase: Phase::Sensed,
    channel: Channel::TerminalCurrentA,
    needs: &[Channel::CurrentA],
    equation: "I = I_shown + I_hidden while |I_shown| <= band",
    source: "gauge manuals: TI SLUUBE8 (bq34210), section 2.9.11; Maxim DS2784, current blanking",
    validity: "one current while the sensor shows none; band below every other current of the log",
    signature: "SoC drifts at rest and stands still under load",
    matters: 1e-4,
    confused_with: &[("parasitic_load", "the same charge drawn slowly and fast"), ("self_discharge", "the pack disconnected for weeks")],
    parameters: &[
        ParameterSpec {
            name: "hidden_a",
            meaning: "current that flows while the sensor shows none",
            default: 1e-3,
            null: Some(0.0),
            min: -0.5,
            max: 0.5,
            source: "standby of a gauge and a switched-off robot: about 1 mA",
        },
        ParameterSpec {
            name: "band_a",
            meaning: "largest current that is shown as none",
            default: 2.5e-3,
            null: None,
            min: 0.0,
            max: 0.5,
            source: "DS2784: 25 uV on discharge, 2.5 mA at 10 mOhm",
        },
    ],
    states: &[],
};

impl Physics for CurrentDeadBand {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        // A threshold has no derivative: the log shows which rows lie in the band, a fit need not.
        if channels[Channel::TerminalCurrentA].re().abs() <= own.parameters[1].re() {
            channels.add(Channel::TerminalCurrentA, own.parameters[0]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn flows_a(shown_a: f64, hidden_a: f64, band_a: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::TerminalCurrentA] = shown_a;
        step_once(&CurrentDeadBand, &Facts::robot(), 1.0, &[hidden_a, band_a], &mut [], &mut channels);
        channels[Channel::TerminalCurrentA]
    }

    #[test]
    fn only_what_is_shown_as_none_hides_a_current() {
        assert_eq!(flows_a(0.0, 1.5e-3, 2e-3), 1.5e-3);
        assert_eq!(flows_a(0.5, 1.5e-3, 2e-3), 0.5);
        assert_eq!(flows_a(-0.5, 1.5e-3, 2e-3), -0.5);
    }

    #[test]
    fn the_default_band_is_that_of_a_gauge_on_ten_milliohms() {
        // Maxim DS2784: discharge below 25 uV over the shunt is not counted.
        let band_a = 25e-6 / 0.010;
        assert!((SPEC.parameters[1].default - band_a).abs() < 1e-12);
        assert_eq!(flows_a(0.99 * band_a, 1e-3, SPEC.parameters[1].default), 0.99 * band_a + 1e-3);
        assert_eq!(flows_a(1.01 * band_a, 1e-3, SPEC.parameters[1].default), 1.01 * band_a);
    }
}
