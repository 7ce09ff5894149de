//! Loss in the H-bridge: its switches conduct, and switch.
//!
//! `P = c F² v / V_bat + P_sw`: the conducting pair loses `2 R_DS,on I² d` (Kottas, Eq. A.2 put right),
//! I follows the force F at the wheels and the duty d follows speed over battery voltage, so
//! `c = 2 R_DS,on n (r_w / (n N k_tau))² k_w N / r_w` in V/N. P_sw is what switching takes while the
//! wheels turn. Without a voltage in the log the first term is left out.
//!
//! Absence: hard pulls take more on an empty pack, and a step is missing between rest and motion.

use crate::drive::traction;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct HBridge;

static SPEC: EffectSpec = EffectSpec {
    id: "h_bridge",
    title: "Loss in the H-bridge",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps, Channel::VoltageV],
    equation: "P = c F² |v| / V_bat + P_sw, F the sum of all forces",
    source: "Kottas, Eqs. A.1 and A.2; RMS current in place of a complex divider",
    validity: "duty from the back-EMF alone; ripple left out",
    signature: "a residual with speed and the square of force, more on an empty pack; and a step when the wheels turn",
    matters: 0.02,
    confused_with: &[
        ("slip", "a full and a nearly empty pack"),
        ("no_load_current", "a full and a nearly empty pack"),
        ("dry_friction", "wheels off the ground"),
        ("motor_copper", "two speeds on one slope"),
    ],
    parameters: &[
        ParameterSpec {
            name: "conduction_v_per_n",
            meaning: "conduction loss over force squared times duty",
            default: 0.01,
            null: Some(0.0),
            min: 0.0,
            max: 10.0,
            source: "integrated bridges of 0.2-1 ohm per switch",
        },
        ParameterSpec {
            name: "switching_w",
            meaning: "power of switching while the wheels turn",
            default: 0.02,
            null: Some(0.0),
            min: 0.0,
            max: 20.0,
            source: "data sheets: 1-5 mA of gate drive",
        },
    ],
    states: &[],
};

impl Physics for HBridge {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        if traction::wheels_turn(channels) {
            channels.add(Channel::PowerW, own.parameters[1]);
        }
        let (force_n, battery_v) = (channels[Channel::TractionN], facts.supply_v(channels));
        if battery_v.re() > 0.0 {
            let conduction_w = own.parameters[0] * force_n * force_n * channels[Channel::SpeedMps].abs() / battery_v;
            channels.add(Channel::PowerW, conduction_w);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::bridge;
    use crate::drive::explorer::MOTOR;
    use crate::drive::motor::{Gear, Gearmotor, Motor};
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&HBridge, parameters, inputs)
    }

    #[test]
    fn conduction_agrees_with_the_bridge_itself() {
        // The Explorer's bridge without ripple, at 6 N and 0.3 m/s from 11.1 V. The effect leaves
        // the armature's own voltage out of the duty, hence a motor of little resistance.
        let (bridge, force_n, speed_mps) = (bridge::HBridge { on_ohm: 0.05, pwm_hz: 1e9 }, 6.0, 0.3);
        let motor = Motor { resistance_ohm: 0.01, friction_nm: 0.0, ..MOTOR.motor };
        let drive = Gearmotor { motor, gear: Gear { efficiency: 1.0, ..MOTOR.gear } };
        let at = drive.at(force_n * 0.0225 / 2.0, speed_mps / 0.0225);
        let supply = bridge.supply(at.voltage_v, at.current_a, 11.1, 310e-6, 0.01);
        let conduction_v_per_n = 2.0 * 0.05 * 2.0 * (0.0225 / (2.0 * 41.0 * 11.4e-3_f64)).powi(2) * 11.43e-3 * 41.0 / 0.0225;
        let inputs = [(Channel::SpeedMps, speed_mps), (Channel::TractionN, force_n), (Channel::VoltageV, 11.1)];
        let taken_w = power_w(&[conduction_v_per_n, 0.0], &inputs);
        assert!((taken_w / (2.0 * supply.conduction_w) - 1.0).abs() < 0.01, "{taken_w} {}", 2.0 * supply.conduction_w);
    }

    #[test]
    fn switching_counts_while_wheels_turn_and_half_the_voltage_doubles_conduction() {
        assert_eq!(power_w(&[0.0, 0.02], &[]), 0.0);
        assert_eq!(power_w(&[0.0, 0.02], &[(Channel::YawRateRadps, -1.0)]), 0.02);
        let at = |volts| power_w(&[0.5, 0.0], &[(Channel::SpeedMps, 1.0), (Channel::TractionN, 2.0), (Channel::VoltageV, volts)]);
        assert!((at(4.0) - 0.5).abs() < 1e-12 && (at(2.0) - 1.0).abs() < 1e-12 && at(0.0) == 0.0);
    }

    /// DRV8871 (Texas Instruments): 565 mOhm for both switches together. One motor without
    /// resistance, 1 A at full duty: 0.565 W by Joule's law.
    #[test]
    fn an_integrated_bridge_loses_what_its_datasheet_says_at_one_ampere() {
        let (pair_ohm, k, ratio, radius_m, battery_v) = (0.565, 11.4e-3, 41.0, 0.0225, 11.1);
        let conduction_v_per_n = pair_ohm * (radius_m / (ratio * k)) * (radius_m / (ratio * k)) * k * ratio / radius_m;
        let (force_n, speed_mps) = (ratio * k / radius_m, battery_v * radius_m / (k * ratio));
        let inputs = [(Channel::SpeedMps, speed_mps), (Channel::TractionN, force_n), (Channel::VoltageV, battery_v)];
        assert!((power_w(&[conduction_v_per_n, 0.0], &inputs) - 0.565).abs() < 1e-12);
    }
}
