//! Physics of the catalogue in forms that the catalogue does not have.

use energy::units::{KELVIN_AT_0_DEGC, REFERENCE_DEGC};
use energy::{Channel, System};

use super::{Stranger, at_once, on_target};

const RELAXATIONS: &[&str] = &["rc1", "rc2", "rc_ladder", "warburg", "surface_diffusion"];
const FRICTIONS: &[&str] = &["dry_friction", "rolling", "viscous_friction", "no_load_current", "h_bridge"];
const STATION_LOSSES: &[&str] = &["charger_efficiency", "converter_efficiency", "charger_curve", "converter_curve"];

/// Voltage over a relaxation ladder: each rung takes its share of the resistance.
fn ladder(rungs: Vec<(f64, f64)>) -> crate::world::MakeForeign {
    on_target(move |size, _| {
        let (rungs, mut volts) = (rungs.clone(), vec![0.0; rungs.len()]);
        Box::new(move |now| {
            for ((tau_s, ohm), v) in rungs.iter().zip(&mut volts) {
                let keep = (-now.dt_s / tau_s).exp();
                *v = *v * keep + (1.0 - keep) * ohm * now.channels[Channel::CurrentA];
            }
            -size * volts.iter().sum::<f64>()
        })
    })
}

/// Every other form.
pub const OTHER_FORMS: &[Stranger] = &[
    Stranger {
        name: "many-modes",
        system: System::Battery,
        story: "diffusion through a slab: a ladder of twelve modes with time constants tau / n^2",
        any: RELAXATIONS,
        may: &["polarisation_arrhenius"],
        base: &["ohmic", "rc1"],
        make: |random| {
            let tau_s = random.log_between(1500.0, 5000.0);
            ladder((1..=12).map(|n| f64::from(n * n)).map(|squared| (tau_s / squared, 0.01 / squared)).collect())
        },
    },
    Stranger {
        name: "stretched",
        system: System::Battery,
        story: "stretched-exponential relaxation, as a dense ladder of time constants",
        any: RELAXATIONS,
        may: &["polarisation_arrhenius"],
        base: &["ohmic"],
        make: |random| {
            let (tau_s, width) = (random.log_between(60.0, 400.0), random.between(0.7, 1.2));
            // A log-normal spectrum stands for the stretched exponential.
            let rung = |step: i32| (tau_s * (f64::from(step) * 0.4 * width).exp(), 0.002 * (-0.5 * (f64::from(step) * 0.4).powi(2)).exp());
            ladder((-6..=6).map(rung).collect())
        },
    },
    Stranger {
        name: "resistance-hyperbola",
        system: System::Battery,
        story: "series resistance that grows towards empty as 1 / (SoC + a)",
        any: &["ohmic_soc"],
        may: &["surface_diffusion", "contact_resistance"],
        base: &["ohmic"],
        make: |random| {
            let a = random.between(0.03, 0.08);
            at_once(move |now| -0.002 / (now.channels[Channel::Soc].max(0.0) + a) * now.channels[Channel::CurrentA])
        },
    },
    Stranger {
        name: "hysteresis-lopsided",
        system: System::Battery,
        story: "hysteresis that is wider after charge than after discharge and narrows towards full",
        any: &["hysteresis"],
        may: &["charge_asymmetry", "rc2", "warburg"],
        base: &["ohmic"],
        make: |random| {
            let (rate, wide) = (random.between(30.0, 80.0), random.between(1.3, 1.8));
            on_target(move |size, _| {
                let (mut h, mut begun) = (0.0, false);
                Box::new(move |now| {
                    if !begun {
                        (h, begun) = (now.channels[Channel::History], true);
                    }
                    let current_a = now.channels[Channel::CurrentA];
                    let moved = (current_a * now.dt_s / 3600.0 / now.channels[Channel::CapacityAh].max(0.1)).abs();
                    h = current_a.signum() * (1.0 - (-rate * moved).exp()) + h * (-rate * moved).exp();
                    let branch = if h < 0.0 { wide } else { 1.0 };
                    -size * 0.005 * branch * h * (1.3 - 0.6 * now.channels[Channel::Soc])
                })
            })
        },
    },
    Stranger {
        name: "cold-line",
        system: System::Battery,
        story: "series resistance that rises in a straight line as the cell gets colder",
        any: &["arrhenius"],
        may: &[],
        base: &["ohmic"],
        make: |_| at_once(|now| -1e-3 * (REFERENCE_DEGC - now.channels[Channel::CellDegc]) * now.channels[Channel::CurrentA]),
    },
    Stranger {
        name: "cold-vft",
        system: System::Battery,
        story: "series resistance by Vogel, Fulcher and Tammann: steeper in the cold than Arrhenius",
        any: &["arrhenius"],
        may: &[],
        base: &["ohmic", "rc1"],
        make: |_| {
            let law = |kelvin: f64| (450.0 / (kelvin - 190.0)).exp();
            let warm = law(REFERENCE_DEGC + KELVIN_AT_0_DEGC);
            at_once(move |now| {
                let cold = law(now.channels[Channel::CellDegc] + KELVIN_AT_0_DEGC);
                -0.02 * (cold / warm - 1.0) * now.channels[Channel::CurrentA]
            })
        },
    },
    Stranger {
        name: "tafel-lopsided",
        system: System::Battery,
        story: "charge transfer of unlike branches: logarithms with another slope on charge",
        any: &["butler_volmer"],
        may: &["charge_asymmetry", "hysteresis"],
        base: &["ohmic"],
        make: |random| {
            let (i0_a, charge) = (random.between(0.05, 0.2), random.between(0.75, 0.9));
            at_once(move |now| {
                let current_a = now.channels[Channel::CurrentA];
                let slope = if current_a < 0.0 { charge } else { 1.0 };
                -0.02 * slope * current_a.signum() * (current_a.abs() / i0_a).ln_1p()
            })
        },
    },
    Stranger {
        name: "growth-root",
        system: System::Battery,
        story: "series resistance that grows with the root of the cycles",
        any: &["resistance_growth"],
        may: &[],
        base: &["ohmic"],
        make: |_| at_once(|now| -5e-4 * now.channels[Channel::CycleCount].sqrt() * now.channels[Channel::CurrentA]),
    },
    Stranger {
        name: "stribeck",
        system: System::Robot,
        story: "friction with Stribeck's dip: large at a crawl, least at a walk, rising beyond",
        any: FRICTIONS,
        may: FRICTIONS,
        base: &["idle", "slope", "acceleration", "payload"],
        make: |random| {
            let (knee_mps, rise) = (random.between(0.05, 0.15), random.between(0.3, 0.8));
            at_once(move |now| {
                let v = now.channels[Channel::SpeedMps].abs();
                v * (1.0 + 1.5 * (-(v / knee_mps).powi(2)).exp() + rise * v)
            })
        },
    },
    Stranger {
        name: "converter-power-law",
        system: System::Robot,
        story: "a converter whose loss rises with the load to the power of 1.5",
        any: &["converter", "converter_quadratic"],
        may: &["idle", "gps", "encoders"],
        base: &["cpu", "camera", "radio", "rolling", "slope", "acceleration", "payload"],
        make: |_| {
            at_once(|now| {
                // The base's motion draws force times speed and nothing else.
                let moving_w = (now.channels[Channel::TractionN] * now.channels[Channel::SpeedMps]).max(0.0);
                let loads_w = (now.channels[Channel::PowerW] - moving_w).max(0.0);
                0.05 + 0.04 * loads_w.powf(1.5)
            })
        },
    },
    Stranger {
        name: "cpu-cubic",
        system: System::Robot,
        story: "a computer whose power rises with the cube of its clock",
        any: &["cpu"],
        may: &[],
        base: &["idle", "rolling", "slope", "acceleration", "payload"],
        make: |_| at_once(|now| (0.2 + 0.8 * now.channels[Channel::CpuUtil]) * (now.channels[Channel::CpuMhz] / 416.0).powi(3)),
    },
    Stranger {
        name: "slope-worm-gear",
        system: System::Robot,
        story: "a gear that loses a larger share the harder it pushes",
        any: &["gear_loss", "slip", "motor_copper"],
        may: &["gear_loss", "slip", "motor_copper", "viscous_friction", "h_bridge", "regeneration"],
        base: &["idle", "rolling", "slope", "acceleration", "payload"],
        make: |_| {
            at_once(|now| {
                let push_n = now.channels[Channel::TractionN].max(0.0);
                push_n.powf(1.3) * now.channels[Channel::SpeedMps] * 0.3
            })
        },
    },
    Stranger {
        name: "station-loss-root",
        system: System::Station,
        story: "a conversion loss that rises with the root of the load",
        any: STATION_LOSSES,
        may: &["pack_wiring", "robot_own_load", "bay_contact"],
        base: &["robot_own_load", "converter_efficiency", "hotel", "lift"],
        make: |_| at_once(|now| now.channels[Channel::ChargePowerW].max(0.0).sqrt()),
    },
    Stranger {
        name: "taper-loss",
        system: System::Station,
        story: "chargers that lose most at the end of a charge: fixed loss per charging robot",
        any: STATION_LOSSES,
        may: &["robot_own_load", "path_selection", "bay_contact"],
        base: &["robot_own_load", "charger_efficiency", "converter_efficiency", "hotel", "lift"],
        make: |_| {
            at_once(|now| {
                let charging = now.channels[Channel::RobotsCharging];
                let each_w = now.channels[Channel::ChargePowerW] / charging.max(1.0);
                charging * (0.3 + 0.2 * (1.0 - each_w / 15.0).max(0.0))
            })
        },
    },
];
