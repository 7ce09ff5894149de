//! Time skew: current and voltage of one row were not taken at the same time.
//!
//! The current of a row is the mean over an interval that ends `skew` after the voltage was
//! taken. The mean over the interval that ends with the voltage then is, for currents held over
//! each interval, `I_k + (skew / dt) (I_(k-1) - I_k)` in A, with dt the length of the step in s
//! and I_k the shown current of step k, corrected for offset and gain. A skew of more than half a
//! step counts as half: beyond it the row's own current would say less of what flows than the one
//! before, and whoever sets a power at the terminals could not hold it by the shown current.
//!
//! Absence: one row with a large residual after every step of the current, as if the voltage had
//! a short time constant; nothing between the steps.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CurrentSkew;

/// Greatest share of the current before.
const SHARE_MAX: f64 = 0.5;

static SPEC: EffectSpec = EffectSpec {
    id: "current_skew",
    title: "Time skew between current and voltage",
    system: System::Battery,
    phase: Phase::Sensed,
    channel: Channel::TerminalCurrentA,
    needs: &[Channel::CurrentA],
    equation: "I = I_k + min(skew / dt, 1/2) (I_(k-1) - I_k)",
    source: "linear interpolation of the charge drawn",
    validity: "voltage taken before the current's interval ends, by less than half a step",
    signature: "single residuals at the steps of the current, in proportion to the step",
    matters: 1e-3,
    confused_with: &[("rc1", "logs with two lengths of step")],
    parameters: &[ParameterSpec {
        name: "skew_s",
        meaning: "time by which the current's interval ends after the voltage was taken",
        default: 0.05,
        null: Some(0.0),
        min: 0.0,
        max: 10.0,
        source: "gauge chips: 0.05 s between converters; a poll over SMBus: up to 1 s",
    }],
    states: &["current_before_a"],
};

impl Physics for CurrentSkew {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn prepared_len(&self) -> usize {
        1
    }

    fn prepare<S: Real>(&self, _: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        prepared[0] = if parameters[0].re() < SHARE_MAX * dt_s { parameters[0] / dt_s } else { S::from(SHARE_MAX) };
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let current_a = channels[Channel::TerminalCurrentA];
        channels.add(Channel::TerminalCurrentA, (own.states[0] - current_a) * own.prepared[0]);
        own.states[0] = current_a;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn flows_a(skew_s: f64, dt_s: f64, shown_a: &[f64]) -> Vec<f64> {
        let (mut states, mut channels) = ([0.0], Channels::filled(0.0_f64));
        let step = |&shown_a: &f64| {
            channels[Channel::TerminalCurrentA] = shown_a;
            step_once(&CurrentSkew, &Facts::robot(), dt_s, &[skew_s], &mut states, &mut channels);
            channels[Channel::TerminalCurrentA]
        };
        shown_a.iter().map(step).collect()
    }

    #[test]
    fn a_step_arrives_in_part_and_then_whole_and_no_charge_is_lost() {
        assert_eq!(flows_a(0.0, 1.0, &[2.0, 0.0]), [2.0, 0.0]);
        assert_eq!(flows_a(0.25, 1.0, &[2.0, 2.0, 0.0, 0.0]), [1.5, 2.0, 0.5, 0.0]);
        assert_eq!(flows_a(3.0, 1.0, &[2.0, 2.0, 0.0, 0.0]), [1.0, 2.0, 1.0, 0.0]);
    }

    #[test]
    fn the_skew_of_a_gauge_chip_leaves_five_percent_of_a_step_at_one_second() {
        // Gauge chips convert current and voltage up to 50 ms apart (data sheets).
        let flows = flows_a(SPEC.parameters[0].default, 1.0, &[1.0]);
        assert!((flows[0] - 0.95).abs() < 1e-12);
    }
}
