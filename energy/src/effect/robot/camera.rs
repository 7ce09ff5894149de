//! Camera and its video path, while they run.
//!
//! `P += on P_camera` in W; on: 0..1 (channel `camera_on`).
//!
//! Absence: the power residual steps as the camera is switched.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Camera;

static SPEC: EffectSpec = EffectSpec {
    id: "camera",
    title: "Camera",
    system: System::Robot,
    phase: Phase::Load,
    channel: Channel::PowerW,
    needs: &[Channel::CameraOn],
    equation: "P += on P_camera",
    source: "Kottas, chapter 4: a camera can be turned on or off",
    validity: "one frame rate and resolution",
    signature: "a step of missing power as the camera is switched",
    matters: 0.02,
    confused_with: &[("cpu", "switch the camera at a fixed clock and utilisation")],
    parameters: &[ParameterSpec {
        name: "camera_w",
        meaning: "power while it runs",
        default: 0.5,
        null: Some(0.0),
        min: 0.0,
        max: 10.0,
        source: "guess: small CMOS camera 0.1-0.4 W, with a video transmitter 0.5-1.5 W",
    }],
    states: &[],
};

impl Physics for Camera {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PowerW, own.parameters[0] * channels[Channel::CameraOn]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn it_takes_power_only_while_it_runs() {
        let power_w = |on| {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::CameraOn] = on;
            step_once(&Camera, &Facts::robot(), 1.0, &[0.5], &mut [], &mut channels);
            channels[Channel::PowerW]
        };
        assert_eq!([power_w(0.0), power_w(1.0)], [0.0, 0.5]);
    }

    /// OV7670 (OmniVision datasheet, version 1.4): 60 mW active at 15 fps VGA. It lies inside the range.
    #[test]
    fn a_bare_vga_sensor_is_a_plausible_camera() {
        let spec = &SPEC.parameters[0];
        assert!((spec.min..spec.default).contains(&0.06));
    }
}
