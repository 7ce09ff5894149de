//! The robots' own load past their chargers: the path-selection power path.
//!
//! `P += n_docked P_own`, in W at the output of the station's converters. Where a robot selects
//! its path, its supply rail hangs on the bay while it is docked, and the charger serves the
//! battery alone; so the own load passes the converter, but not the charger (Kottas, section
//! B.2.1, calls it the more efficient one). The direct connection, in which charger, battery and
//! robot share one rail, is `robot_own_load`: a model has the one or the other. With path
//! selection a charger sees the battery's current alone and ends its charge by it; with the
//! direct connection it sees the robot's too (see `charger.rs`).
//!
//! Absence: every docked robot takes a constant power that neither battery nor charger knows of.

use super::own_load::OwnLoad;
use crate::{Channel, EffectSpec, ParameterSpec, Phase, System};

/// Past the robots' chargers.
pub(crate) static PATH_SELECTION: OwnLoad = OwnLoad(&SPEC);

static SPEC: EffectSpec = EffectSpec {
    id: "path_selection",
    title: "Robots' own load past the charger",
    system: System::Station,
    phase: Phase::Bypass,
    channel: Channel::PackPowerW,
    needs: &[Channel::RobotsDocked],
    equation: "P += n_docked P_own, after the charger",
    source: "Kottas, section B.2.1 (path selection)",
    validity: "path selection; robots idle while docked; no loss in the selecting switch",
    signature: "missing power in steps with the number of docked robots",
    matters: 0.1,
    confused_with: &[
        ("robot_own_load", "measure between converter and charger: its reading shows the own load or not"),
        ("hotel", "an hour with no robot docked"),
    ],
    parameters: &[ParameterSpec {
        name: "own_load_w",
        meaning: "power that one docked robot takes from its bay beside its charger",
        default: 3.0,
        null: Some(0.0),
        min: 0.0,
        max: 100.0,
        source: "a robot's idle load",
    }],
    states: &[],
};

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{Run, Start, load_model};

    fn pack_w(name: &str, charge_w: f64, docked: f64) -> f64 {
        let mut run = Run::new(Arc::new(load_model(name, &|_| unreachable!("built in")).unwrap()), Start::at_soc(0.0));
        run.channels[Channel::ChargePowerW] = charge_w;
        run.channels[Channel::RobotsDocked] = docked;
        run.step(1.0);
        run.channels[Channel::PackPowerW]
    }

    #[test]
    fn only_the_charger_is_spared() {
        // By hand: 3 x 4.19 W through 0.88 and 0.84, against through 0.84 alone.
        let saved_w = pack_w("mds-station", 40.0, 3.0) - pack_w("mds-station-path-selection", 40.0, 3.0);
        assert!((saved_w - 3.0 * 4.19 * (1.0 / 0.88 - 1.0) / 0.84).abs() < 1e-9, "{saved_w}");
        assert!((pack_w("mds-station", 40.0, 0.0) - pack_w("mds-station-path-selection", 40.0, 0.0)).abs() < 1e-12);
    }

    /// Kottas, section B.2.1: path selection is "more energy efficient". An Explorer charges
    /// at 1C (there), for about an hour. It saves, but less than a tenth of a service of some 26 Wh.
    #[test]
    fn path_selection_saves_but_does_not_make_a_fourth_robot() {
        let saved_wh = pack_w("mds-station", 13.0, 1.0) - pack_w("mds-station-path-selection", 13.0, 1.0);
        assert!(saved_wh > 0.0 && saved_wh < 2.6, "{saved_wh}");
    }
}
