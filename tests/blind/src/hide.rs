//! Hides an effect of the catalogue in a world, at a size that leaves a wanted trace.

use energy::{EffectSpec, ParameterSpec, System, find};

use crate::case::{Hidden, Leaves};
use crate::draft::Draft;
use crate::random::Stream;
use crate::refit::{ROUNDS as ROUNDS_OF_REFIT, leaves};
use crate::world::{Script, World, courses};

/// How an effect's parameters go together when more than one of them vanishes with it, or its
/// shape differs from the catalogue's defaults: (system, id, share of the size per parameter).
/// The shape of the others is drawn.
const SHAPES: &[(System, &str, &[f64])] = &[
    // A knee near empty.
    (System::Battery, "ohmic_soc", &[6.0, 3.5, 2.0, 0.8, 0.2, 0.0, 0.1]),
    // The same of what is slow.
    (System::Battery, "polarisation_soc", &[6.0, 3.5, 2.0, 0.8, 0.0, 0.1]),
    // The asinh bends within the currents of the logs.
    (System::Battery, "butler_volmer", &[1.0, 0.0]),
    // One amplitude at all states of charge; what goes with the charge is a case of its own (`hysteresis-lopsided`).
    (System::Battery, "hysteresis", &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
];

/// Values of shape parameters that the logs can show, where the catalogue's default is none:
/// (system, id, parameter, low, high).
const RANGES: &[(System, &str, &str, f64, f64)] = &[
    (System::Battery, "butler_volmer", "exchange_current_a", 0.05, 0.3),
    (System::Battery, "current_dead_band", "band_a", 0.01, 0.03),
    (System::Battery, "rc1", "tau_s", 15.0, 90.0),
    (System::Battery, "rc2", "tau_s", 250.0, 1900.0),
    (System::Battery, "rc_ladder", "tau_s", 30.0, 300.0),
    (System::Battery, "capacity_fade", "knee_cycles", 400.0, 600.0),
    (System::Robot, "ldo", "output_v", 3.0, 5.0),
];

/// Rounds of the search for a size, and how near it comes.
const ROUNDS: usize = 14;
const NEAR: f64 = 1.1;

/// An effect with a shape, before it has a size.
#[derive(Debug, Clone)]
pub struct Shape {
    spec: &'static EffectSpec,
    /// Per parameter: what it is at no size, and what one unit of size adds.
    lines: Vec<(f64, f64)>,
}

impl Shape {
    /// Draws a shape.
    ///
    /// # Panics
    /// When the system has no such effect.
    #[must_use]
    pub fn draw(system: System, id: &str, random: &mut Stream) -> Self {
        let spec = find(system, id).unwrap_or_else(|| panic!("no effect {id}")).1.spec();
        let shape = SHAPES.iter().find(|(s, known, _)| (*s, *known) == (system, id)).map(|(.., shape)| *shape);
        let both_ways = random.sign();
        let line = |(index, p): (usize, &ParameterSpec)| match p.null {
            None => (shaped(system, id, p, random), 0.0),
            Some(null) => {
                let unit = if (p.default - null).abs() > 0.0 { p.default - null } else { (p.max - null) * 0.01 };
                let room = if unit > 0.0 { null - p.min } else { p.max - null };
                let sign = if room > 5.0 * unit.abs() { both_ways } else { 1.0 };
                (null, sign * unit * shape.map_or_else(|| random.between(0.75, 1.3), |shape| shape[index]))
            }
        };
        Self { spec, lines: spec.parameters.iter().enumerate().map(line).collect() }
    }

    /// Parameters at a size, within their ranges.
    fn at(&self, size: f64) -> Vec<(&'static str, f64)> {
        let value = |(p, (null, unit)): (&ParameterSpec, &(f64, f64))| {
            let margin = 0.02 * (p.max - p.min);
            let (low, high) = (p.min + if *null > p.min { margin } else { 0.0 }, p.max - if *null < p.max { margin } else { 0.0 });
            (p.name, (null + unit * size).clamp(low.min(*null), high.max(*null)))
        };
        self.spec.parameters.iter().zip(&self.lines).map(value).collect()
    }

    /// The effect at the size that leaves `strength` after a refit of `base`, or as near to it as
    /// its range allows.
    #[must_use]
    pub fn sized(&self, base: &Draft, scripts: &[Script], strength: f64) -> Hidden {
        let logs: Vec<Script> = scripts.iter().filter(|script| !script.holdout).cloned().collect();
        let trial = |size: f64| {
            let draft = base.with(self.spec.id, &self.at(size));
            leaves(base, &courses(&World { draft, foreign: None }, &logs), ROUNDS_OF_REFIT).strength
        };
        let size = size_for(strength, trial, |size, next| self.at(next) == self.at(size));
        Hidden { id: self.spec.id, parameters: self.at(size), leaves: Leaves::nothing() }
    }
}

/// The size at which `trial` gives `strength`, or comes nearest to it; `stuck` says that a next
/// size would change nothing.
pub fn size_for(strength: f64, trial: impl Fn(f64) -> f64, stuck: impl Fn(f64, f64) -> bool) -> f64 {
    let mut size = 1.0;
    let mut best = (f64::INFINITY, size);
    // What is tried and found, as logarithms: a straight line through the last two leads on, and
    // once the size lies between two, it stays there. Tolerances make some effects rise like a wall.
    let mut last: Option<(f64, f64)> = None;
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for round in 0..ROUNDS {
        let found = trial(size);
        let off = if found > 0.0 { (strength / found).ln().abs() } else { f64::INFINITY };
        if round == 0 || off < best.0 {
            best = (off, size);
        }
        let here = (f64::ln(size), found.max(1e-9).ln());
        if found < strength {
            low = low.max(here.0)
        } else {
            high = high.min(here.0)
        }
        let slope = last.map_or(1.0, |last| ((here.1 - last.1) / (here.0 - last.0)).clamp(0.3, 4.0));
        last = Some(here);
        let mut next = here.0 + ((strength.ln() - here.1) / slope).clamp(-4.0, 3.4);
        if (high - low).is_finite() && (round % 2 == 1 || !(low..high).contains(&next)) {
            next = f64::midpoint(low, high);
        }
        let next = next.exp();
        if off < NEAR.ln() || stuck(size, next) || next > 1e6 || (next / size).ln().abs() < 1e-6 {
            break;
        }
        size = next;
    }
    best.1
}

fn shaped(system: System, id: &str, p: &ParameterSpec, random: &mut Stream) -> f64 {
    let known = RANGES.iter().find(|(s, known, name, ..)| (*s, *known, *name) == (system, id, p.name));
    if let Some(&(.., low, high)) = known {
        return random.log_between(low, high);
    }
    if p.default > 0.0 && p.min >= 0.0 {
        (p.default * random.log_between(0.7, 1.5)).clamp(p.min, p.max)
    } else {
        random.between(p.default - 0.2 * (p.default - p.min), p.default + 0.2 * (p.max - p.default))
    }
}
