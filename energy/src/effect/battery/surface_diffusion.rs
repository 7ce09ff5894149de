//! Diffusion in the electrode's particles: the voltage follows the charge at their surface.
//!
//! `V = s (OCV(z) - OCV(z_surf))`: the open-circuit curve is read at the surface's state of charge
//! instead of the mean one. Spherical particles of radius r_p and diffusivity D with an even flux
//! at the surface; `tau_d = r_p^2 / D`. In modes, with `tan(l_n) = l_n`:
//!
//! `z - z_surf = sum d_n`, `d d_n/dt = l_n^2 / tau_d (g_n j - d_n)`, `g_n = 2 / l_n^2`,
//! `j = tau_d I_cell / (3 Q_cell)`.
//!
//! All gains add up to 1/5, so at a steady current the surface is `tau_d I / (15 Q)` ahead of the
//! mean. The modes 1, 2, 3-4, 5-8, 9-16 and all beyond are one pair each, with the sum of the
//! group's gains and the mean of its times weighted by gain; the sums of all modes, 1/5 and 2/350,
//! are exact. Errors of the transfer function stay below 3 % down to times of tau_d / 3000.
//!
//! Absence: under load the residual is largest where the OCV curve is steep, lags the current by
//! minutes and turns up sharply near empty.

use std::sync::LazyLock;

use super::rc::step_slowed_pairs;
use super::relaxation_arrhenius::slowness;
use crate::units::S_PER_H;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct SurfaceDiffusion;

/// First mode after each group, but for the last, which is endless.
const GROUP_ENDS: [usize; 5] = [1, 2, 4, 8, 16];
const PAIRS: usize = GROUP_ENDS.len() + 1;

static SPEC: EffectSpec = EffectSpec {
    id: "surface_diffusion",
    title: "Solid diffusion: OCV at the surface",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "V = s (OCV(z) - OCV(z_surf)), z - z_surf by spherical diffusion with tau_d",
    source: "single-particle model; modes of a sphere: Carslaw and Jaeger, Conduction of Heat in Solids (1959), section 9.8",
    validity: "one electrode limits; diffusivity constant over SoC, and over temperature but for `relaxation_arrhenius`; times above tau_d / 3000",
    signature: "the residual lags the current by minutes and follows the slope of the OCV curve, steep near empty",
    matters: 1e-3,
    confused_with: &[
        ("ohmic_soc", "a rest after discharges that ended near empty"),
        ("rc2", "rests at several SoC, near empty above all"),
        ("warburg", "rests at several SoC, where the OCV curve is steep and where it is flat"),
    ],
    parameters: &[
        ParameterSpec {
            name: "share",
            meaning: "s: share of the OCV's slope that lies in the electrode that limits",
            default: 1.0,
            null: Some(0.0),
            min: 0.0,
            max: 2.0,
            source: "theory: 1 when one electrode makes all of the slope; above it when the electrodes' slopes oppose each other",
        },
        ParameterSpec {
            name: "tau_d_s",
            meaning: "tau_d: square of the particles' radius over their diffusivity",
            default: 1000.0,
            null: None,
            min: 10.0,
            max: 100_000.0,
            source: "guess: radius 1-10 um, diffusivity 1e-15 to 1e-13 m2/s; 5 um and 1e-14 m2/s give 2500 s",
        },
    ],
    states: &["surface_soc_0", "surface_soc_1", "surface_soc_2", "surface_soc_3", "surface_soc_4", "surface_soc_5"],
};

/// Gain, and rate in units of `1 / tau_d`, of every group of modes.
static GROUPS: LazyLock<[(f64, f64); PAIRS]> = LazyLock::new(|| {
    // What is left for the groups to come: gain, and gain times time.
    let (mut gain_left, mut time_left) = (1.0 / 5.0, 2.0 / 350.0);
    let mut begin = 0;
    let mut groups = [(0.0, 0.0); PAIRS];
    for (group, end) in groups.iter_mut().zip(GROUP_ENDS) {
        let squares = (begin..end).map(|index| eigenvalue(index).powi(2));
        let (gain, time) = squares.fold((0.0, 0.0), |(gain, time), square| (gain + 2.0 / square, time + 2.0 / square.powi(2)));
        *group = (gain, gain / time);
        (gain_left, time_left, begin) = (gain_left - gain, time_left - time, end);
    }
    groups[PAIRS - 1] = (gain_left, gain_left / time_left);
    groups
});

/// The root of `tan(l) = l` between `(index + 1) pi` and `(index + 3/2) pi`, by iterating
/// `l = (index + 1) pi + atan(l)`, which contracts by `1 / (1 + l^2)`.
fn eigenvalue(index: usize) -> f64 {
    let turns = (index + 1) as f64 * std::f64::consts::PI;
    (0..16).fold(turns + 1.5, |root: f64, _| turns + root.atan())
}

impl Physics for SurfaceDiffusion {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn reads_curve(&self) -> bool {
        true
    }

    /// Decay and gain of every pair, the flux of one ampere, and the exponents of all decays.
    fn prepared_len(&self) -> usize {
        3 * PAIRS + 1
    }

    fn prepare<S: Real>(&self, facts: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        let per_tau = parameters[1].recip() * -dt_s;
        for (pair, &(gain, rate)) in GROUPS.iter().enumerate() {
            let exponent = per_tau * rate;
            (prepared[2 * pair], prepared[2 * pair + 1]) = (exponent.exp(), S::from(gain));
            prepared[2 * PAIRS + 1 + pair] = exponent;
        }
        prepared[2 * PAIRS] = parameters[1] * (f64::from(facts.parallel()) / (3.0 * S_PER_H));
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let Facts::Battery(battery) = facts else { return };
        let mut flux = own.prepared[2 * PAIRS] * channels[Channel::CellCurrentA] / channels[Channel::CapacityAh];
        let slowness = slowness(channels);
        if let Some(slowness) = slowness {
            flux *= slowness;
        }
        let (soc, ahead) = (
            channels[Channel::Soc],
            step_slowed_pairs(own.states, (&own.prepared[..2 * PAIRS], &own.prepared[2 * PAIRS + 1..]), flux, slowness),
        );
        let share_v = battery.cell_ocv_v(soc, channels) - battery.cell_ocv_v(soc - ahead, channels);
        channels.add(Channel::OverpotentialV, own.parameters[0] * share_v);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;
    use crate::effect::cell;
    use crate::{Run, Start};

    /// Abramowitz and Stegun, Table 4.19: the first roots of tan x = x.
    #[test]
    fn the_eigenvalues_are_the_tabulated_roots() {
        for (index, root) in [4.49341, 7.72525, 10.90412, 14.06619].into_iter().enumerate() {
            assert!((eigenvalue(index) - root).abs() < 1e-5);
        }
    }

    /// Closed form with q = sqrt(p), p in units of 1 / tau_d: the surface moves by
    /// tanh(q) / (q - tanh(q)) j, the mean by 3 j / p.
    #[test]
    fn the_groups_have_the_transfer_function_of_a_sphere() {
        for step in 0..=350 {
            let p = Complex::new(0.0, 10f64.powf(f64::from(step) / 100.0 - 0.02));
            let q = p.sqrt();
            let exact = q.tanh() / (q - q.tanh()) - p.inv() * 3.0;
            let ours: Complex<f64> = GROUPS.iter().map(|&(gain, rate)| gain * rate / (p + rate)).sum();
            assert!((ours / exact - 1.0).norm() < 0.03, "{p}: {ours} {exact}");
        }
    }

    /// By hand: a curve that is a straight line of 1 V over SoC, shortened by a fifth at its full
    /// end, is 0.8 V over SoC, and so is what the surface makes of it.
    #[test]
    fn an_aged_cell_reads_its_own_curve_at_the_surface() {
        let lag_v = |aged: &[(&str, &[(&str, f64)])]| {
            let mut effects: Vec<(&str, &[(&str, f64)])> = vec![("surface_diffusion", &[("share", 1.0), ("tau_d_s", 1000.0)])];
            effects.extend(aged);
            let mut run = cell(1, &effects, Start::at_soc(0.8));
            run.channels[Channel::CurrentA] = 1.0;
            run.step(600.0);
            run.channels[Channel::OverpotentialV]
        };
        let aged_v = lag_v(&[("electrode_balance", &[("shift_empty", 0.0), ("shift_full", -0.2)])]);
        assert!((aged_v / lag_v(&[]) - 0.8).abs() < 1e-9, "{aged_v}");
    }

    /// A cell of 2 Ah whose OCV is a straight line of 1 V over SoC.
    fn diffusing(share: f64, tau_d_s: f64) -> Run<f64> {
        let effects: &[(&str, &[(&str, f64)])] = &[("surface_diffusion", &[("share", share), ("tau_d_s", tau_d_s)])];
        cell(1, effects, Start::at_soc(0.5))
    }

    /// A parabola over the radius with surface slope j has its surface j/2 - 3j/10 = j/5 from its
    /// mean, and a sphere fills three times faster than its surface flux: tau_d I / (15 Q).
    #[test]
    fn at_a_steady_current_the_surface_is_a_fifteenth_of_tau_d_ahead() {
        let mut run = diffusing(1.0, 1000.0);
        run.channels[Channel::CurrentA] = 0.5;
        run.step(5000.0);
        let expected_v = 1000.0 * 0.5 / (15.0 * 2.0 * 3600.0);
        assert!((run.channels[Channel::OverpotentialV] - expected_v).abs() < 1e-9);
    }

    /// Soon after a step the particle's core has noticed nothing: a plane surface, whose
    /// concentration moves by `2 sqrt(D t / pi)` times its slope, less what the mean has moved.
    #[test]
    fn soon_after_a_step_the_surface_moves_with_the_square_root_of_time() {
        let mut run = diffusing(1.0, 10_000.0);
        run.channels[Channel::CurrentA] = 1.0;
        run.step(20.0);
        let flux = 10_000.0 / (3.0 * 2.0 * 3600.0);
        let share_of_tau = 20.0 / 10_000.0;
        // Second order: the sphere's curvature adds t / tau_d.
        let expected_v = flux * (2.0 * (share_of_tau / std::f64::consts::PI).sqrt() + share_of_tau - 3.0 * share_of_tau);
        let ratio = run.channels[Channel::OverpotentialV] / expected_v;
        assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    }
}
