//! The force at the wheels and the power that it draws.
//!
//! Effects push with a force each; what the battery gives is `max(0, F v)` of their sum F. Each
//! effect adds the change of that, so that the shares sum to it in any order: a robot that rolls
//! downhill pays no friction, and gets nothing back unless something recovers it.

use crate::real::Real;
use crate::{Channel, Channels};

/// Speed below which a robot counts as standing, m/s. Wheel encoders of small robots resolve
/// about this.
pub const STANDING_MPS: f64 = 1e-3;
/// Yaw rate below which a robot counts as not turning, rad/s.
pub const STANDING_RADPS: f64 = 1e-2;

/// Whether the robot moves along its path.
pub(crate) fn drives<S: Real>(channels: &Channels<S>) -> bool {
    channels[Channel::SpeedMps].re().abs() > STANDING_MPS
}

/// Whether its wheels turn: it drives, or turns on the spot.
pub(crate) fn wheels_turn<S: Real>(channels: &Channels<S>) -> bool {
    drives(channels) || channels[Channel::YawRateRadps].re().abs() > STANDING_RADPS
}

/// Power that a force at the wheels draws when nothing is recovered: `max(0, F v)`, W. At zero it
/// keeps its derivatives: a force that a fit has not found yet must show what it would change.
#[must_use]
pub fn drawn_w<S: Real>(force_n: S, speed_mps: S) -> S {
    let power_w = force_n * speed_mps;
    if power_w.re() < 0.0 { S::from(0.0) } else { power_w }
}

/// Adds a force along the direction of travel (N, positive when the motors must give it), and
/// the power that it makes the wheels draw.
pub(crate) fn push<S: Real>(channels: &mut Channels<S>, force_n: S) {
    let share_w = pushed_w(channels, force_n);
    channels.add(Channel::PowerW, share_w);
}

/// Adds such a force, and gives the power that it makes the wheels draw, W.
pub(crate) fn pushed_w<S: Real>(channels: &mut Channels<S>, force_n: S) -> S {
    let speed_mps = channels[Channel::SpeedMps];
    let before_w = drawn_w(channels[Channel::TractionN], speed_mps);
    channels.add(Channel::TractionN, force_n);
    drawn_w(channels[Channel::TractionN], speed_mps) - before_w
}

/// Adds a force that resists motion in either direction, N >= 0; nothing at a standstill.
pub(crate) fn resist<S: Real>(channels: &mut Channels<S>, force_n: S) {
    if drives(channels) {
        let along_n = along(channels, force_n);
        push(channels, along_n);
    }
}

/// A force that resists motion, N >= 0, as one along the direction of travel; nothing at a standstill.
pub(crate) fn along<S: Real>(channels: &Channels<S>, force_n: S) -> S {
    match channels[Channel::SpeedMps].re() {
        _ if !drives(channels) => S::from(0.0),
        speed_mps if speed_mps > 0.0 => force_n,
        _ => -force_n,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_the_power_of_the_whole_force_in_any_order() {
        for order in [[2.0, -5.0, 1.0], [-5.0, 1.0, 2.0], [1.0, 2.0, -5.0], [4.0, -2.0, 1.0]] {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::SpeedMps] = 0.5;
            for force_n in order {
                push(&mut channels, force_n);
            }
            let whole_n: f64 = order.iter().sum();
            assert!((channels[Channel::PowerW] - (whole_n * 0.5).max(0.0)).abs() < 1e-15, "{order:?}");
        }
    }

    #[test]
    fn friction_resists_in_both_directions_and_not_at_rest() {
        for (speed_mps, power_w) in [(0.5, 1.0), (-0.5, 1.0), (0.0, 0.0)] {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::SpeedMps] = speed_mps;
            resist(&mut channels, 2.0);
            assert_eq!(channels[Channel::PowerW], power_w);
        }
    }
}
