//! Efficiency of the robots' chargers against their load.
//!
//! `P_in = n_docked P_0 + n_charging P_1 + (1 + a) P_out + b P_out^2 / n_charging`, all powers in W.
//! `P_0` is what one charger takes while nothing is charged (W), `P_1` what it takes beside that while
//! it charges, whatever the current (gate drive, magnetisation of the inductor, W), `a` the loss in
//! proportion (diode drop, switching; no unit), `b` the loss in the square of the load (resistance of
//! switch and inductor, 1/W). The load is shared equally by the `n_charging` chargers that work: the square of a sum of
//! unlike loads is up to twice that, but only while both are small. A model has this or
//! `charger_efficiency`. With both, the losses come on top of each other, and `a` may be negative: a stated efficiency that was a guess of
//! the whole then holds more than the part in proportion.
//!
//! Efficiency is best where the constant loss equals the square one, `P = sqrt((P_0 + P_1) / b)` for one
//! charger, and falls steeply below: the end of the constant-voltage part is where it is worst.
//!
//! Absence: what is missing is not in proportion to the charge power: too little explained while
//! chargers idle and at full current, too much in between.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct ChargerCurve;

static SPEC: EffectSpec = EffectSpec {
    id: "charger_curve",
    title: "Charger efficiency against load",
    system: System::Station,
    phase: Phase::Charger,
    channel: Channel::PackPowerW,
    needs: &[Channel::ChargePowerW, Channel::RobotsDocked, Channel::RobotsCharging],
    equation: "P_in = n_docked P_0 + n_charging P_1 + (1 + a) P_out + b P_out^2 / n_charging",
    source: "loss polynomial of switch-mode converters: Erickson and Maksimovic, Fundamentals of Power Electronics, chapter 3; Kottas, Eq. 4.1 with the loss put right",
    validity: "chargers of one kind that share the load about equally",
    signature: "missing power that is not in proportion to the charge power: worst at the end of the charge",
    matters: 0.1,
    confused_with: &[
        ("charger_efficiency", "charge powers from a tenth to the whole of a charger's rating"),
        ("converter_curve", "measure between converter and charger"),
        ("robot_own_load", "docked robots that are switched off"),
    ],
    parameters: &[
        ParameterSpec {
            name: "standby_w",
            meaning: "power of one charger with a robot docked and nothing charged",
            default: 0.1,
            null: Some(0.0),
            min: 0.0,
            max: 5.0,
            source: "switch-mode charger controllers: some 5 mA at 15 V, with their gate drive",
        },
        ParameterSpec {
            name: "proportional_loss",
            meaning: "loss in proportion to the charge power; beside a charger_efficiency, beyond what that says",
            default: 0.05,
            null: Some(0.0),
            min: -0.3,
            max: 1.0,
            source: "drop of a diode over the pack's voltage: 0.4-0.6 V of 11 V",
        },
        ParameterSpec {
            name: "square_loss_per_w",
            meaning: "loss over the square of one charger's load",
            default: 0.003,
            null: Some(0.0),
            min: 0.0,
            max: 0.1,
            source: "0.1-0.4 ohm in series at 11 V: R / V^2",
        },
        ParameterSpec {
            name: "working_w",
            meaning: "power of one charger beside its standby while it charges, whatever the current",
            default: 0.0,
            null: Some(0.0),
            min: 0.0,
            max: 5.0,
            source: "guess: often within the standby power; gate drive and magnetisation of a switch-mode charger, some tenths of a watt",
        },
    ],
    states: &[],
};

impl Physics for ChargerCurve {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let out_w = channels[Channel::PackPowerW];
        // A robot that is full still has its own load behind the charger: at least one works.
        let working = if channels[Channel::RobotsCharging].re() > 1.0 { channels[Channel::RobotsCharging] } else { S::from(1.0) };
        let [standby_w, proportional, square, working_w] = [own.parameters[0], own.parameters[1], own.parameters[2], own.parameters[3]];
        let constant_w = standby_w * channels[Channel::RobotsDocked] + working_w * channels[Channel::RobotsCharging];
        let lost_w = constant_w + proportional * out_w + square * out_w * out_w / working;
        channels.add(Channel::PackPowerW, lost_w);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn in_w(parameters: [f64; 4], out_w: f64, robots: f64) -> f64 {
        let mut channels = Channels::filled(0.0);
        channels[Channel::PackPowerW] = out_w;
        channels[Channel::RobotsDocked] = robots;
        channels[Channel::RobotsCharging] = robots;
        step_once(&ChargerCurve, &Facts::Station, 1.0, &parameters, &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn one_charger_by_hand_and_three_as_three_times_one() {
        // 0.1 + 1.05 x 10 + 0.003 x 100 = 10.9 W.
        assert!((in_w([0.1, 0.05, 0.003, 0.0], 10.0, 1.0) - 10.9).abs() < 1e-12);
        assert!((in_w([0.1, 0.05, 0.003, 0.0], 30.0, 3.0) - 32.7).abs() < 1e-12);
        assert!((in_w([0.1, 0.05, 0.003, 0.0], 0.0, 0.0)).abs() < 1e-12);
        // 0.4 W more for each that charges.
        assert!((in_w([0.1, 0.05, 0.003, 0.4], 30.0, 3.0) - 33.9).abs() < 1e-12);
    }

    /// Synchronous switch-mode chargers for three cells reach up to 97 % (bq24610, as Texas
    /// Instruments gives it), and the curve's own best lies where constant and square loss are
    /// equal (textbook).
    #[test]
    fn the_default_has_the_efficiency_of_a_switch_mode_charger_and_its_best_where_losses_are_equal() {
        let parameters = [0.1, 0.05, 0.003, 0.0];
        let efficiency = |out_w: f64| out_w / in_w(parameters, out_w, 1.0);
        let best_w = (0.1_f64 / 0.003).sqrt();
        assert!((0.90..0.97).contains(&efficiency(best_w)), "{}", efficiency(best_w));
        assert!(efficiency(best_w) > efficiency(0.9 * best_w) && efficiency(best_w) > efficiency(1.1 * best_w));
        // 1 / (1 + a + 2 sqrt(P_0 b)).
        assert!((efficiency(best_w) - 1.0 / (1.05 + 2.0 * (0.1_f64 * 0.003).sqrt())).abs() < 1e-12);
    }
}
